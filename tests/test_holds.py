"""That references are shown where they hold alone, and numbers that develop say so."""

import math
import warnings

import numpy as np
import pytest
from alsph.analysis.measures import Measure
from alsph.cases import (
    Body,
    Cavity,
    ConcentricRelease,
    DamBreak,
    EllipticalDrop,
    FloatingBox,
    Nozzle,
    OscillatingCylinder,
    Poiseuille,
    RotatingPatch,
    SettlingSphere,
    Sloshing,
    StandingWave,
)
from alsph.cases.remarks import keywords
from alsph.config import Config
from alsph.errors import ConfigError
from alsph.geometry.outline import Outline
from alsph.results.outcome import thinned
from alsph.run_settings import RunSettings
from alsph.running.describe import describe
from shapely import Point
from shapely.affinity import translate


def about(case, word):
    return [remark for remark in case.remarks() if remark.startswith(f"{word}:")]


@pytest.mark.parametrize(
    ("case", "beyond"),
    [
        (ConcentricRelease, {"reynolds": 10}),
        (DamBreak, {"reynolds": 10}),
        (EllipticalDrop, {"reynolds": 10}),
        (RotatingPatch, {"reynolds": 20}),
        (SettlingSphere, {"width": 3}),
        (StandingWave, {"reynolds": 10}),
    ],
)
def test_a_reference_holds_where_its_theory_does(case, beyond):
    assert not about(case(), "no reference")
    (remark,) = about(case(**beyond), "no reference")
    assert "holds" in remark or "from Re = 50 on" in remark
    told = case(**beyond).compared([Measure("a", 1.0, 2.0, 0.1, "theory"), Measure("error", 1.0, 0.0, 0.1, "theory")])
    assert [(measure.name, measure.source) for measure in told] == [("a", "")] and math.isnan(told[0].reference)


def test_a_steep_wave_begins_with_its_volume_and_decays_as_a_low_one(tmp_path):
    case = StandingWave(amplitude=0.2, resolution=20)
    assert "4.9 % lower" in about(case, "steep")[0] and not about(StandingWave(), "steep")
    position = case.particles()["position"]
    assert 1.26 < position[:, 1].max() + case.particle_spacing / 2 < 1.32  # of Stokes's second order: 1.263
    run = case.run(tmp_path / "run", progress=False)
    frequency, decay = run.measures[:2]
    assert 0.99 < run.history["packing_min"][0] and run.history["packing_max"][0] < 1.02
    assert -0.06 < frequency.error < -0.03 and decay.passed, run.measures


def test_a_viscous_drop_is_beside_nothing(tmp_path):
    run = EllipticalDrop(resolution=8, reynolds=10).run(tmp_path / "run", until=0.05, progress=False)
    drop = [measure for measure in run.measures if "over exact" in measure.name]
    assert len(drop) == 3 and all(math.isnan(measure.reference) for measure in drop)
    assert any(measure.reference == 0 for measure in run.measures)  # the energy that a step makes stays an error
    assert "no reference" in keywords(run.remarks)


def test_a_flow_that_goes_on_with_another_is_not_beside_a_start(tmp_path):
    case = Poiseuille(resolution=8)
    first = case.run(tmp_path / "first", until=0.2, progress=False)
    then = case.run(tmp_path / "then", until=0.2, initial_run=str(first.path), progress=False)
    assert first.measures and not then.measures
    assert first.profiles[0].reference[0].size and not then.profiles[0].reference[0].size
    assert "no reference" in keywords(then.remarks) and "no reference" not in keywords(first.remarks)


def test_what_a_steady_flow_is_judged_by_says_that_it_develops(tmp_path):
    run = Cavity(resolution=12).run(tmp_path / "run", until=2.0, output_interval=0.1, progress=False)
    assert all(measure.value.developing for measure in run.measures)
    assert run.plot_profile("u at x = D/2").axes[0].get_title() == "u at x = D/2"
    with pytest.raises(ConfigError, match="profile = 'u at x': unknown; did you mean 'u at x = D/2'"):
        run.plot_profile("u at x")
    assert "still developing" in str(run.summary()[run.measures[0].name])


@pytest.mark.parametrize(
    ("now", "before", "reference", "tolerance", "develops"),
    [
        (4.87, 4.69, math.nan, 0.03, True),
        (4.87, 4.82, math.nan, 0.03, False),
        (-0.2, -0.2005, -0.21, 0.01, False),
        (-0.2, -0.204, -0.21, 0.01, True),
        (1.0, 1.006, math.nan, math.nan, True),
        (0.012, 0.03, 0.0, 0.02, True),
        (0.012, 0.02, 0.0, 0.02, False),
        (1.0, math.nan, 1.0, 0.02, False),
    ],
)
def test_a_measure_develops_if_it_has_changed_by_half_its_tolerance(now, before, reference, tolerance, develops):
    measure = Measure("a", now, reference, tolerance)
    settling = measure.settling(Measure("a", before, reference, tolerance))
    assert getattr(settling.value, "developing", False) is develops
    assert settling.value == now and settling.passed is measure.passed


def test_a_floating_box_says_what_it_takes():
    assert not any(about(FloatingBox(resolution=20), word) for word in ("rounded", "coarse", "unstable"))
    box = FloatingBox(resolution=20, density_ratio=0.3, box_length=0.4, lift=0.02)
    (rounded,) = about(box, "rounded")
    assert "density_ratio 0.25 for 0.3" in rounded and "lift 0 for 0.02" in rounded
    assert "draught of 2 Δx and a lift of 1 Δx" in about(box.replace(lift=-0.05), "coarse")[0]
    assert not about(box.replace(resolution=40, density_ratio=0.25, lift=-0.05), "coarse")
    square = FloatingBox(resolution=20, box_length=0.4, box_height=0.4)  # upright below 0.21 and above 0.79 alone
    assert about(square, "unstable") and not about(square.replace(density_ratio=0.125), "unstable")


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (
            {"density_ratio": 0.99},
            "density_ratio = 0.99: to whole spacings, 1/20, its draught is 0.4 of a box_height of",
        ),
        ({"density_ratio": 0.001}, "density_ratio = 0.001: to whole spacings, 1/20, its draught is 0 of"),
        ({"box_height": 0.02}, "box_height = 0.02: to whole particle spacings it is none; use a finer resolution"),
        ({"box_length": 0.02}, "box_length = 0.02: to whole particle spacings it is none; use a finer resolution"),
        ({"lift": 0.3}, "lift = 0.3: the box would not be in the water"),
        ({"tank_height": 1.2, "box_height": 0.8, "lift": 0.3}, "tank_height = 1.2: the box, up to 1.7, would reach"),
    ],
)
def test_a_box_that_does_not_float_in_its_tank_says_what_is_to_blame(options, told):
    with pytest.raises(ConfigError, match=told):
        FloatingBox(resolution=20, **options)


def test_the_weight_of_a_box_is_by_all_that_pulls_it_down(tmp_path):
    """Twice as much by a force beside gravity: the water carries that."""
    case = FloatingBox(resolution=12, driving_force="0, -1", box_length=1.0)
    run = case.run(tmp_path / "run", until=2.6, progress=False)
    measures = {measure.name: measure.value for measure in run.measures}
    assert measures["mean force of the water over the weight"] == pytest.approx(1, abs=0.05)


def test_a_tank_that_sways_at_its_own_frequency_has_a_level_that_grows():
    case = Sloshing(length=3, amplitude=1e-4, phase=30.0, frequency=0.9041914868500254)
    time = np.linspace(0, 200, 401)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        level = case.linear_level(time, 0.1)
    beside = case.replace(frequency=case.frequency * (1 + 1e-6)).linear_level(time, 0.1)
    assert level == pytest.approx(beside, abs=1e-3 * np.abs(level).max())
    assert np.abs(level[time > 150]).max() > 3 * np.abs(level[time < 50]).max()


def test_linear_theory_is_of_small_waves():
    time = np.linspace(0, 40, 401)
    assert Sloshing(length=2, amplitude=0.001, frequency=0.5)._theory(time)[1] == "linear theory"
    resonant = Sloshing(length=2, amplitude=0.005, frequency=1.2)
    assert np.abs(resonant.linear_level(time, resonant.gauge)).max() > 0.1
    assert resonant._theory(time)[1] == "theory of an irrotational wave"


def test_pressure_that_is_slow_beside_the_period_is_remarked_upon():
    assert not about(OscillatingCylinder(), "slow pressure")
    slow = OscillatingCylinder(keulegan_carpenter=0.5)
    assert about(slow, "slow pressure") and not about(slow.replace(courant=0.05), "slow pressure")
    assert not about(slow.replace(scheme="isph"), "slow pressure")


def test_the_period_of_parallel_flow_is_a_whole_number_of_spacings():
    case = Poiseuille(resolution=11)
    assert case.domain().upper[0] == pytest.approx(6 / 11)
    assert case.fluid_volume() == pytest.approx(6 / 11)
    with pytest.raises(ConfigError, match="use 1.90909 or 2.09091"):
        Nozzle(resolution=11, transition=1, upstream=1, downstream=3)


def test_the_inlet_is_as_near_as_the_foremost_body():
    disc = Point(0, 0).buffer(0.5)
    pair = Body(shape=Outline.of([translate(disc, -2.75), translate(disc, 2.75)]), upstream=4.0)
    (remark,) = about(pair, "short channel")
    assert "inlet 1.25 D before the body, which slows the stream there by about 16 %" in remark
    assert not about(pair.replace(upstream=6.75), "short channel")
    assert about(Body(shape=Outline.of(disc), upstream=1.25), "short channel") == [remark]


def test_several_bodies_are_told_and_drawn_by_their_names():
    disc = Point(0, 0).buffer(0.5)
    case = Body(shape=Outline.of([disc, translate(disc, 2, 1)]), resolution=10)
    assert {name: at.tolist() for name, at in case.middles().items()} == {
        "body_1": pytest.approx([3.0, -0.5]),
        "body_2": pytest.approx([5.0, 0.5]),
    }
    told = dict(describe(Config(case, RunSettings()), probe=False))
    assert told["body_2"] == "1 D by 1 D about x = 5 D, y = 0.5 D"
    assert {"body_1", "body_2"} <= {text.get_text() for text in case.draw().axes[1].texts}
    assert not Body().middles()


def test_fluid_that_is_mostly_surface_is_remarked_upon():
    history = {"surface": np.array([40.0, 40, 300]), "fluid": np.array([500.0, 500, 500])}
    assert "60 % of the fluid" in thinned(history)[0]
    assert not thinned({name: values[:2] for name, values in history.items()})
    assert not thinned({"surface": np.zeros(3), "fluid": np.full(3, 500.0)}) and not thinned({})
