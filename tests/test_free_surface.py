"""Cases with a free surface, beside their references."""

import alsph
import numpy as np
import pytest
from alsph import cases, reference
from alsph.errors import ConfigError

SURFACES = [model for model in cases.CASES.values() if issubclass(model, cases.FreeSurface)]


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("dam_break", {"resolution": 40}),
        ("dam_break", {"resolution": 14, "dimensions": 3}),
        ("standing_wave", {"resolution": 30, "reynolds": 200}),
        ("elliptical_drop", {"resolution": 20}),
        ("rotating_patch", {"resolution": 30}),
        ("still_water", {"resolution": 20}),
    ],
)
@pytest.mark.parametrize("gradient", ["adjoint", "conservative"])
def test_a_run_meets_its_references(tmp_path, name, parameters, gradient):
    case = cases.CASES[name](**parameters, pressure_gradient=gradient)
    run = case.run(tmp_path / name, progress=False, output_interval=case.default_until / 10)
    assert len(run.measures) >= 3
    missed = [measure for measure in run.measures if not measure.passed]
    assert not missed, missed


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("gradient", ["adjoint", "conservative"])
def test_a_dam_breaks_to_the_end_without_making_energy(seed, gradient):
    case = cases.DamBreak(resolution=14, pressure_gradient=gradient)
    state = case.build().state
    state["position"] += np.random.default_rng(seed).uniform(-1e-3, 1e-3, state["position"].shape)
    simulation = case.restored(state, threads=1)
    simulation.run_until(8.0)
    rows = simulation.history()
    energy = rows["kinetic_energy"] + rows["potential_energy"]
    assert (energy - np.minimum.accumulate(energy)).max() < 0.01 * energy[0]
    assert 0.6 < energy[-1] / energy[0] < 0.95
    assert rows["fluid"][-1] + rows["mass_out"][-1] * case.resolution**2 == pytest.approx(rows["fluid"][0])
    assert rows["fluid"][-1] > 0.98 * rows["fluid"][0]
    assert rows["packing_max"][-1] < 2


@pytest.mark.parametrize(
    "case", [*(model(resolution=12) for model in SURFACES), cases.DamBreak(resolution=8, dimensions=3)]
)
def test_a_run_that_is_restored_has_the_bits_of_a_whole_one(case):
    """On other numbers of threads, and stored in another order."""
    whole, first = case.simulation(threads=1), case.simulation(threads=2)
    whole.advance(40)
    first.advance(17)
    state = first.state()
    order = np.random.default_rng(3).permutation(len(state["kind"]))
    shuffled = {name: value[order] if np.ndim(value) else value for name, value in state.items()}
    second = case.restored(shuffled, threads=1)
    second.advance(23)
    ends = [simulation.state() for simulation in (whole, second)]
    for name in ("position", "velocity", "pressure"):
        one, other = (end[name][np.argsort(end["id"])] for end in ends)
        assert (one == other).all(), name
    assert ends[0]["time"] == ends[1]["time"]


def test_linear_theory_of_waves_is_that_of_an_independent_computation():
    """Decay and frequency, found there from the equations' eigenvalues on a grid."""
    known = {50: (0.29665154, 1.6817676), 200: (0.086920881, 1.7576976), 2500: (0.0076326354, 1.7688845)}
    for reynolds, (decay, frequency) in known.items():
        growth = cases.StandingWave(reynolds=reynolds).growth()
        assert (-growth.real, growth.imag) == pytest.approx((decay, frequency), rel=1e-6)


def test_linear_theory_of_a_tank_that_sways_is_that_of_an_independent_computation():
    """A tank of length 1 with 0.35 of water, below and above its first frequency: elevation at its far end over A."""
    for share, known in ((0.8, {5: -1.34587, 20: 0.08783}), (1.2, {5: 4.16472, 20: 0.37214})):
        case = cases.Sloshing(
            resolution=140,
            length=1 / 0.35,
            amplitude=1e-3 / 0.35,
            frequency=share * 1.58566776 * np.sqrt(0.35),
            phase=90,
        )
        times = np.array(list(known)) / np.sqrt(0.35)
        level = case.linear_level(times, case.length) * 0.35 / 1e-3
        assert level == pytest.approx(list(known.values()), abs=0.02)


def test_a_tank_that_sways_a_little_has_the_level_of_linear_theory(tmp_path):
    case = cases.Sloshing(amplitude=0.003, frequency=0.75, phase=90, gauge=0)
    run = case.run(tmp_path / "run", until=20.0, progress=False)
    (measure,) = run.measures
    assert measure.passed, measure
    (profile,) = run.profiles
    assert len(profile.computed[0]) == len(profile.reference[0]) == 400


def test_air_has_no_values(tmp_path, recwarn):
    """On a grid that reaches far beyond the water."""
    run = cases.DamBreak(resolution=12).run(tmp_path / "run", until=0.5, progress=False)
    grid = run.to_grid()
    (x, y), pressure = grid.axes.values(), grid.fields["pressure"]
    in_air = (np.asarray(x)[:, None] > 3) | (np.asarray(y)[None, :] > 1.5)
    assert np.isnan(pressure[in_air]).all() and np.isfinite(pressure[~in_air]).any()
    assert not [warning for warning in recwarn if issubclass(warning.category, RuntimeWarning)]


def test_gauges_tell_the_depth_of_a_lattice():
    case = cases.StillWater(resolution=20)
    levels = cases.free_surface.Levels([0.0, 0.3, 0.5, 1.0], 1.0, case.particle_spacing)
    assert levels.depth(case.particles()["position"]) == pytest.approx(1, rel=1e-12)


def test_levels_of_a_run_that_is_cut_are_those_of_a_whole_one(tmp_path):
    case = cases.Sloshing(resolution=10)
    case.run(tmp_path / "whole", until=1.0, progress=False)
    case.run(tmp_path / "cut", until=0.5, progress=False)
    alsph.resume(tmp_path / "cut", until=1.0, progress=False)
    texts = [(tmp_path / name / "output_levels.csv").read_text() for name in ("whole", "cut")]
    assert texts[0] == texts[1] and len(texts[0].splitlines()) >= 20


def test_first_pressure_of_a_dam_break():
    """That at the foot of the wall is known for a long and for a square column."""
    foot = np.zeros((1, 2))
    assert cases.DamBreak(length=2).first_pressure(foot) == pytest.approx(0.9301, abs=1e-4)
    assert cases.DamBreak(length=1).first_pressure(foot) == pytest.approx(0.6753, abs=1e-4)
    edge = np.array([[2.0, 0.4], [0.7, 1.0]])
    assert cases.DamBreak(length=2).first_pressure(edge) == pytest.approx(0, abs=2e-3)


def test_first_pressure_of_a_patch():
    centre = cases.RotatingPatch().first_pressure(np.zeros((1, 2)))
    assert centre == pytest.approx(-0.1473, abs=1e-4)


def test_exact_drop_keeps_its_energy():
    """It is as the integral of (A² a² + A² a⁻²)."""
    case = cases.EllipticalDrop()
    a, rate = case.exact(0.8)
    assert (a, rate) == pytest.approx((1.9993, 0.6862), abs=2e-4)
    assert rate**2 * (a**2 + a**-2) == pytest.approx(2, rel=1e-6)


def test_the_front_of_the_reference_is_where_the_measures_have_it():
    time, front = reference.table("dam_break_front.csv")
    for at, expected in cases.dam_break.FRONT.items():
        assert np.interp(at, time, front) == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize(
    ("parameters", "told"),
    [
        ({"scheme": "isph"}, "scheme"),
        ({"shifting": "strain"}, "shifting"),
        ({"algorithm": 1}, "algorithm"),
        ({"viscous_order": 4}, "viscous_order"),
        ({"packing_relaxation": 2}, "packing_relaxation"),
        ({"length": 2.01}, "whole number of particle spacings"),
        ({"tank_height": 0.5}, "tank_height"),
    ],
)
def test_what_a_free_surface_does_not_have_is_refused(parameters, told):
    with pytest.raises((ConfigError, ValueError), match=told):
        cases.DamBreak(**parameters).build()


def test_a_column_beyond_its_tank_is_refused():
    with pytest.raises((ConfigError, ValueError), match="tank"):
        cases.DamBreak(length=6.0)
