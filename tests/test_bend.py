"""Flow through a bend: an outlet along another axis than the inlet, and what its measures tell."""

import numpy as np
import pytest
from alsph import reference
from alsph.cases import Bend
from alsph.errors import ConfigError
from alsph.geometry.domain import Domain
from alsph.geometry.particles import Kind
from scipy.spatial import KDTree
from synthetic import write_flow


def test_how_far_points_lie_beyond_sides_of_a_kind():
    domain = Domain((-1, -2), (3, 4), [("inlet", "none"), ("outlet", "outlet")])
    points = np.array([[-1.5, 0], [0, 0], [9, 4.5], [0, -3]])
    assert domain.beyond("inlet", points).tolist() == [0.5, -1, -10, -1]
    assert domain.beyond("outlet", points).tolist() == [-2, -2, 0.5, 1]
    assert np.isneginf(domain.beyond("slip", points)).all()


@pytest.mark.parametrize("radius", [0.0, 0.5, 2.0])
def test_a_bend_starts_with_the_same_flow_rate_everywhere(radius):
    case = Bend(inner_radius=radius, resolution=12)
    state, spacing = case.particles(), case.particle_spacing
    position, velocity, kind = (state[name] for name in ("position", "velocity", "kind"))
    for side, axis in ((Kind.INLET, 0), (Kind.OUTLET, 1)):
        column = (kind == side) & (position[:, axis] == position[kind == side, axis][0])
        assert column.sum() == 12
        assert velocity[column, axis].sum() * spacing == pytest.approx(1.0, rel=5e-3)
        assert not velocity[column, 1 - axis].any()
    assert position[kind == Kind.OUTLET, 1].min() > case.downstream and position[kind == Kind.INLET, 0].max() < -3
    assert case.fluid_volume() == pytest.approx(case.channel().area, rel=3e-3)
    assert case.particle_estimate() == pytest.approx(len(position), rel=0.05)
    fluid = position[kind == Kind.FLUID]
    assert (KDTree(position).query_ball_point(fluid, 3.9 * spacing, return_length=True) == 45).all()
    solid = kind == Kind.SOLID
    place = position[solid]
    assert np.array_equal(state["body"][solid] == 1, (place[:, 0] > 0) & (place[:, 1] < 0))


def with_forces(folder, case, change=1.0, pressure=lambda position: 0 * position[:, 0]):
    """Return a run with the developed flow, whose recorded force on the bend is `change` times the right one."""
    run = write_flow(folder, case, lambda r, t: case.developed(r), pressure=pressure(case.particles()["position"]))
    force = change * (case._through(run, 0.0) - case._through(run, case.arc))
    run.history = {"time": np.linspace(0, 2, 9)}
    for axis, value in zip("xy", force, strict=True):
        run.history[f"bend_pressure_force_{axis}"] = np.full(9, 0.75 * value)
        run.history[f"bend_viscous_force_{axis}"] = np.full(9, 0.25 * value)
    return run


def test_measures_of_a_bend(tmp_path):
    case = Bend(resolution=12)

    def pressure(position):  # of a straight channel, and as much more in the bend as the reference says
        x, y = np.minimum(position[:, 0], 0), np.maximum(position[:, 1], 0)
        angle = np.clip(np.pi / 2 + np.arctan2(position[:, 1], position[:, 0]), 0, np.pi / 2) / (np.pi / 2)
        bend = np.where(position[:, 0] <= 0, 0, np.where(position[:, 1] >= 0, 1, angle))
        return -12 / case.reynolds * (x + y + case.arc * bend) - 0.11135 * bend

    run = with_forces(tmp_path / "run", case, pressure=pressure)
    rate, profile, force, drop, excess = case.measures(run)
    assert (rate.value, profile.value, force.value) == (
        pytest.approx(0, abs=5e-3),
        pytest.approx(0, abs=1e-3),
        pytest.approx(0, abs=1e-9),
    )
    assert drop.reference == pytest.approx(12 / 50 * (1.5 + 5 + np.pi / 2) + 0.11135)
    assert drop.value == pytest.approx(drop.reference, rel=2e-3) and drop.passed
    assert excess.value == pytest.approx(0.11135, abs=3e-3)
    wrong = with_forces(tmp_path / "wrong", case, change=0.9, pressure=pressure)
    assert case.measures(wrong)[2].value == pytest.approx(0.1)
    leaking = write_flow(tmp_path / "leak", case, lambda r, t: case.developed(r) * (1 - 0.1 * (r[:, 1:] > 2)))
    rate, profile, *_ = case.measures(leaking)
    assert (rate.value, profile.value) == (pytest.approx(0.1, abs=5e-3), pytest.approx(0.1, abs=2e-3))


def test_the_pressure_drop_has_a_reference_where_it_was_computed():
    rows = reference.rows("bend_pressure.csv")
    assert {float(row["R_over_D"]) for row in rows} >= {0.5, 1.0, 2.0}
    assert Bend(reynolds=10)._known_excess()[0] == pytest.approx(0.09299)
    for other in (Bend(reynolds=11), Bend(inner_radius=0.75), Bend(downstream=4.0), Bend(upstream=2.0)):
        assert np.isnan(other._known_excess()[0])


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"inner_radius": 0.33}, "inner_radius = 0.33: not a whole number of particle spacings"),
        ({"inner_radius": -1}, "inner_radius = -1: must be 0 or greater|greater than or equal to 0"),
        ({"downstream": 0.0}, "downstream = 0.0: must be greater than 0"),
        ({"upstream": float("nan")}, "upstream = nan"),
    ],
)
def test_bends_that_cannot_be_are_refused(changes, told):
    with pytest.raises(ConfigError, match=told):
        Bend(**changes)


def test_a_short_bend_keeps_mass_and_lets_it_out_at_the_top(tmp_path):
    case = Bend(resolution=8, reynolds=10.0, upstream=1.0, downstream=2.0)
    run = case.run(tmp_path / "run", until=1.5, threads=1, progress=False, output_interval=0.25)
    rate, profile, force, drop, _ = case.measures(run)
    assert rate.value < 0.03 and profile.value < 0.03 and force.value < 0.08
    assert drop.value == pytest.approx(12 / 10 * (0.5 + case.arc + 1.0) + 0.093, rel=0.1)
    snapshot = run.snapshot()
    out = snapshot.kind == Kind.OUTLET
    assert (snapshot.position[out, 1] > case.downstream).all() and out.sum() > 50
