"""The cases with a reference solution: cavity, plates, step, pressure jump; and bodies of any shape."""

import math

import numpy as np
import pytest
import shapely
from alsph import plotting, reference
from alsph.analysis import sampling
from alsph.cases import (
    CASES,
    BackwardFacingStep,
    Body,
    Cavity,
    Couette,
    Cylinder,
    CylinderPair,
    Nozzle,
    Poiseuille,
    PressureJump,
    PulsatingChannel,
    TaylorGreen,
)
from alsph.cases.backward_facing_step import last_upward_zero
from alsph.errors import ConfigError
from alsph.geometry.particles import Kind
from balance import loads
from scipy.spatial import KDTree
from synthetic import write_flow


@pytest.mark.parametrize("model", [Cavity, Poiseuille, Couette, BackwardFacingStep])
def test_walls_continue_the_lattice_of_the_fluid(model):
    case = model()
    state, spacing = case.particles(), case.particle_spacing
    position = state["position"]
    distance, _ = KDTree(position).query(position, k=2)
    assert distance[:, 1] == pytest.approx(spacing)
    solid = state["kind"] == Kind.SOLID
    assert state["depth"][solid].min() == pytest.approx(spacing / 2)
    assert (state["depth"][~solid] == 0).all()
    # Within the support of a fluid particle no place of the lattice is empty, but where fluid enters and leaves.
    fluid = position[state["kind"] == Kind.FLUID]
    near = KDTree(position).query_ball_point(fluid, 3.9 * spacing, return_length=True)
    periodic = "periodic" in str(case.domain())
    assert near.max() == 45 if periodic else (near == 45).all()


@pytest.mark.parametrize(
    "model", [Cavity, Poiseuille, Couette, PulsatingChannel, BackwardFacingStep, Nozzle, PressureJump]
)
def test_a_few_steps_stay_sound(model):
    simulation = model(resolution=10).simulation(threads=1)
    volume = simulation.counts["fluid"] / 100
    simulation.advance(60)
    rows = simulation.history()
    assert rows["velocity_max"].max() < 1.7
    assert rows["volume"] == pytest.approx(volume, rel=0.02)


def test_lid_slides_and_reaches_over_the_corners():
    state = Cavity(resolution=20).particles()
    solid, above = state["kind"] == Kind.SOLID, state["position"][:, 1] > 1
    assert (state["body"] == (solid & above)).all()
    assert (state["velocity"][solid & above] == [1, 0]).all()
    assert (state["velocity"][~above] == 0).all()
    assert len(Cavity().bodies()) == 2


def cavity_flow(position, _):
    """Return a flow whose centre-line velocities have the extrema of Re = 100, at about their places."""
    x, y = position.T
    u = np.where(y < 0.458, -0.214042 * np.sin(np.pi * y / 0.916), -0.214042 + 1.2 * (y - 0.458) ** 2)
    v = np.where(x < 0.5, 0.179573 * np.sin(2 * np.pi * x), -0.253803 * np.sin(2 * np.pi * (x - 0.5)))
    return np.stack([u, v], axis=1)


def test_cavity_measures_find_the_extrema(tmp_path):
    case = Cavity(resolution=50)
    # The first snapshots are of the start, and must not count.
    run = write_flow(tmp_path / "run", case, lambda x, t: cavity_flow(x, t) * (t > 7), times=(0, 4, 8, 9, 10))
    measures = case.measures(run)
    assert [measure.name[:10] for measure in measures] == ["smallest u", "largest v ", "smallest v"]
    assert [measure.error for measure in measures] == pytest.approx([0, 0, 0], abs=2e-3)
    assert all(measure.passed and measure.tolerance == 0.01 for measure in measures)
    u, v = case.profiles(run)
    assert len(u.reference[0]) == len(v.reference[1]) == 101
    assert u.reference[1][-1] == 1
    other = Cavity(reynolds=150, resolution=50)
    assert [measure.value for measure in other.measures(run)] == [measure.value for measure in measures]
    assert all(math.isnan(measure.reference) for measure in other.measures(run))
    assert [curve.reference[0].size for curve in other.profiles(run)] == [0, 0]
    figure = plotting.profile({"Re = 150": other.profiles(run)[0]})
    assert [line.get_label() for line in figure.axes[0].lines] == ["Re = 150"]


@pytest.mark.parametrize(("reynolds", "slack"), [(100, 1e-3), (400, 5e-3), (1000, 1e-2)])
def test_cavity_profiles_and_extrema_agree(reynolds, slack, tmp_path):
    case = Cavity(reynolds=reynolds, resolution=10)
    run = write_flow(tmp_path / "run", case, cavity_flow)
    (_, u), (_, v) = (profile.reference for profile in case.profiles(run))
    extrema = [measure.reference for measure in case.measures(run)]
    assert [u.min(), v.max(), v.min()] == pytest.approx(extrema, rel=slack)


@pytest.mark.parametrize(("case", "force"), [(Poiseuille(), 0.8), (Couette(reynolds=50), 0.0)])
def test_exact_plate_flow_solves_its_equation(case, force):
    y, step = np.linspace(0.02, 0.98, 49), 1e-3
    assert case.body_force() == [pytest.approx(force), 0.0]
    for time in 0.02 * case.reynolds, 0.2 * case.reynolds:
        rate = (case.profile(y, time + step) - case.profile(y, time - step)) / (2 * step)
        bend = (case.profile(y + step, time) - 2 * case.profile(y, time) + case.profile(y - step, time)) / step**2
        assert rate == pytest.approx(bend / case.reynolds + force, abs=1e-4)
        assert case.profile(np.array([0.0, 1.0]), time) == pytest.approx([0, case.upper_velocity], abs=1e-6)
    assert case.profile(y, 1e-4 * case.reynolds)[:24] == pytest.approx(0, abs=1e-3)
    steady = {"poiseuille": 4 * y * (1 - y), "couette": y}[case.name]
    assert case.profile(y, 10 * case.reynolds) == pytest.approx(steady, abs=1e-9)


@pytest.mark.parametrize("model", [Poiseuille, Couette])
def test_plate_measure_is_the_error_of_the_last_snapshot(model, tmp_path):
    case = model(resolution=20)
    run = write_flow(tmp_path / "run", case, lambda x, t: 1.03 * case.exact(x, t)["velocity"] if t else 0 * x)
    (measure,) = case.measures(run)
    assert measure.value == pytest.approx(0.03, rel=1e-3)
    assert not measure.passed
    (profile,) = case.profiles(run)
    y, u = profile.computed
    assert (np.diff(y) >= 0).all()
    assert u == pytest.approx(1.03 * np.interp(y, *profile.reference), abs=2e-3)


@pytest.mark.parametrize("model", [Poiseuille, Couette])
def test_plate_flow_follows_the_exact_transient(model, tmp_path):
    case = model(resolution=16)
    run = case.run(tmp_path / "run", until=1.0, threads=1, progress=False)
    assert case.measures(run)[0].value < 0.015


@pytest.mark.parametrize("amplitude", [0.0, 1.0, 5.0])
@pytest.mark.parametrize("womersley", [1.0, 4.0, 10.0])
def test_exact_pulsating_flow_solves_its_equation_and_is_steady_without_pulsation(womersley, amplitude):
    case = PulsatingChannel(reynolds=20, womersley=womersley, amplitude=amplitude)
    y, step, period = np.linspace(0.02, 0.98, 49), 1e-3, 2 * np.pi / case.frequency
    assert 0.5 / np.sqrt(1 / case.frequency / case.reynolds) == pytest.approx(womersley)
    for time in np.array([0, 0.2, 0.7]) * period:
        rate = (case.profile(y, time + step) - case.profile(y, time - step)) / (2 * step)
        bend = (case.profile(y + step, time) - 2 * case.profile(y, time) + case.profile(y - step, time)) / step**2
        force = case.body_force()[0] + case.forcing(y, time)[0]
        assert rate == pytest.approx(bend / case.reynolds + force, abs=2e-3 * (1 + amplitude))
        assert case.profile(np.array([0.0, 1.0]), time) == pytest.approx(0, abs=1e-12)
        assert case.profile(y, time + period) == pytest.approx(case.profile(y, time))
    if amplitude == 0:
        assert case.profile(y, 0.3) == pytest.approx(4 * y * (1 - y))


@pytest.mark.parametrize(("womersley", "amplitude"), [(2.0, 1.0), (6.0, 4.0)])
def test_a_pulsating_flow_follows_the_exact_one(womersley, amplitude, tmp_path):
    case = PulsatingChannel(resolution=20, womersley=womersley, amplitude=amplitude)
    run = case.run(tmp_path / "run", until=0.8, threads=1, progress=False)
    (measure,) = run.measures
    assert measure.passed and measure.value < 0.003
    assert run.profiles[0].reference[0].size and run.summary()["relative L2 error of the velocity"]


@pytest.mark.parametrize(("stagger", "pitch"), [(90, 1.5), (0, 3.0), (30, 2.0)])
def test_two_cylinders_are_where_they_should_be_and_their_loads_balance(stagger, pitch):
    room = {"reynolds": 100, "length": 8, "height": 7, "upstream": 3, "perturbation": 0.0}
    case = CylinderPair(resolution=10, pitch=pitch, stagger=stagger, **room)
    first, second = (np.array(outline.centroid.coords[0]) for outline in case.outlines)
    assert second - first == pytest.approx(pitch * np.array([np.cos(np.radians(stagger)), np.sin(np.radians(stagger))]))
    assert case.blocked == pytest.approx({90: 2.0, 0: 1.0, 30: 2.0}[stagger], abs=1e-9)
    found = loads(case, 1.0, 1.6, 0.02)
    assert found.recorded[0] == pytest.approx(found.boxes[0], rel=0.05)
    assert found.recorded[1] == pytest.approx(found.boxes[1], abs=0.03 * found.boxes[0])
    if stagger != 30:
        assert found.largest_lift < 1e-3


def test_plates_refuse_a_period_shorter_than_the_support():
    with pytest.raises(ConfigError, match="length = 0.075: shorter than the kernel's support"):
        Couette(length=0.075)


def test_step_channel():
    case = BackwardFacingStep()
    state = case.particles()
    position = {kind: state["position"][state["kind"] == kind] for kind in Kind}
    assert len(position[Kind.FLUID]) == (5 * 1 + 20 * 2) * 20**2
    assert (len(position[Kind.INLET]), len(position[Kind.OUTLET])) == (8 * 20, 8 * 40)
    assert position[Kind.INLET][:, 0].max() == pytest.approx(-5 - 0.025)
    assert position[Kind.OUTLET][:, 0].min() == pytest.approx(20 + 0.025)
    assert position[Kind.SOLID][:, 0].min() < position[Kind.INLET][:, 0].min()
    assert position[Kind.SOLID][:, 0].max() > position[Kind.OUTLET][:, 0].max()
    assert case.kinematic_viscosity == case.settings()["kinematic_viscosity"] == 2 / 100


@pytest.mark.parametrize("expansion", [1.5, 2.0, 3.0])
def test_step_starts_with_the_mean_velocity_in_the_inlet_channel(expansion):
    case = BackwardFacingStep(expansion=expansion)
    state = case.particles()
    inlet = state["kind"] == Kind.INLET
    assert state["velocity"][inlet].mean(axis=0) == pytest.approx([1, 0], abs=6e-3)
    assert state["velocity"][inlet, 0].max() == pytest.approx(1.5, rel=0.01)
    outlet = state["kind"] == Kind.OUTLET
    assert state["velocity"][outlet, 0].mean() == pytest.approx(1 / expansion, rel=2e-3)
    normal, edge = state["normal"], np.abs(state["position"] - [0, 1]).max(axis=1) < 0.9 * case.particle_spacing
    assert normal[edge & (state["kind"] == Kind.SOLID)] == pytest.approx(np.sqrt(0.5) * np.ones((1, 2)))


def test_step_measure_finds_the_reattachment(tmp_path):
    case = BackwardFacingStep(resolution=10, downstream=8.0)
    run = write_flow(
        tmp_path / "run", case, lambda r, t: np.stack([r[:, 1] * (r[:, 0] - 3.0), 0 * t * r[:, 1]], axis=1)
    )
    (measure,) = case.measures(run)
    assert measure.value == pytest.approx(3.0, abs=1e-3)
    assert measure.error == pytest.approx(3 / 2.91828 - 1, abs=1e-3)
    assert measure.passed
    for other in case.replace(reynolds=200), case.replace(upstream=4.0):
        (unknown,) = other.measures(run)
        assert (unknown.value, math.isnan(unknown.reference)) == (measure.value, True)


@pytest.mark.parametrize("contraction", [1.5, 3.0])
def test_nozzle_starts_with_the_same_flow_rate_everywhere(tmp_path, contraction):
    case = Nozzle(contraction=contraction)
    state, spacing = case.particles(), case.particle_spacing
    position, velocity, kind = (state[name] for name in ("position", "velocity", "kind"))
    for side, height in ((Kind.INLET, contraction), (Kind.OUTLET, 1.0)):
        column = (kind == side) & (position[:, 0] == position[kind == side, 0][0])
        assert column.sum() == height * case.resolution
        assert velocity[column, 0].sum() * spacing == pytest.approx(1.0, rel=2e-3)
    fluid = position[kind == Kind.FLUID]
    assert sorted(map(tuple, np.round(fluid, 9))) == sorted(map(tuple, np.round(fluid * (1, -1), 9)))
    assert case.fluid_volume() == pytest.approx(case.channel().area, rel=2e-3)
    depth, beyond = state["depth"], np.abs(position[:, 1]) - case.height(position[:, 0]) / 2
    slope = np.pi * (contraction - 1) / (4 * case.transition)
    solid = (kind == Kind.SOLID) & (beyond < spacing) & (np.abs(position[:, 0] - 1) < 3)
    assert (beyond[solid] > 0).all() and (depth[solid] <= beyond[solid] + 1e-4).all()
    assert (depth[solid] >= beyond[solid] / np.hypot(1, slope) - 0.1 * spacing).all()
    near = KDTree(position).query_ball_point(fluid, 3.9 * spacing, return_length=True)
    assert (near == 45).all()  # no place of the lattice is empty


def test_nozzle_measures(tmp_path):
    case = Nozzle(resolution=10)
    run = write_flow(tmp_path / "run", case, lambda r, t: case.developed(r))
    rate, profile = case.measures(run)
    assert rate.value < 5e-3 and profile.value < 1e-4 and rate.passed and profile.passed
    leaking = write_flow(tmp_path / "leak", case, lambda r, t: case.developed(r) * (1 - 0.1 * (r[:, :1] > 3)))
    rate, profile = case.measures(leaking)
    assert (rate.value, profile.value) == (pytest.approx(0.1, abs=5e-3), pytest.approx(0.1, abs=1e-3))
    assert not rate.passed and not profile.passed


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (
            {"contraction": 1.33},
            "contraction = 1.33: the step on each side, .* no whole number .*use 1.3 or 1.4$",
        ),
        ({"transition": 0.33}, "transition = 0.33: not a whole number"),
        ({"contraction": 1.0}, "contraction = 1.0: must be greater than 1"),
    ],
)
def test_nozzles_that_do_not_fit_the_lattice_are_refused(changes, told):
    with pytest.raises(ConfigError, match=told):
        Nozzle(**changes)


def test_a_short_nozzle_keeps_mass_and_comes_to_the_parabola(tmp_path):
    case = Nozzle(resolution=8, contraction=1.5, reynolds=20.0, transition=1.0, upstream=1.0, downstream=2.5)
    run = case.run(tmp_path / "run", until=5.0, threads=1, progress=False)
    assert all(measure.passed for measure in run.measures), run.measures


def test_last_upward_zero():
    x = np.arange(5.0)
    assert last_upward_zero(x, np.array([-1, 1, -1, -1, 3])) == 3.25
    assert np.isnan(last_upward_zero(x, np.ones(5)))


def test_pressure_jump_measures(tmp_path):
    case = PressureJump(resolution=20)
    pressure = case.particles()["pressure"]
    assert pressure.mean() == 0.5
    run = write_flow(tmp_path / "run", case, lambda x, _: np.full_like(x, [0.1, 1.0]), pressure=0.02 * pressure)
    jump, energy = case.measures(run)
    assert jump.value == pytest.approx(0.02)
    assert energy.value == pytest.approx(8 * 0.5 * 0.1**2)


@pytest.mark.parametrize("model", CASES.values())
def test_measures_of_a_run_without_snapshots_do_not_pass(model, tmp_path):
    case = model()
    run = write_flow(tmp_path / "run", case, lambda x, _: 0 * x, times=(1.0,))
    (tmp_path / "run" / "particles.vtkhdf").unlink()
    assert not any(measure.passed for measure in case.measures(run))
    case.profiles(run)


def test_late_velocity_is_exact_for_quadratic_fields(tmp_path):
    case = Cavity(resolution=10)
    run = write_flow(tmp_path / "run", case, lambda x, t: t * np.stack([x[:, 0] * x[:, 1], x[:, 1] ** 2], axis=1))
    points = np.array([[0.5, 0.01], [0.99, 0.5]])
    expected = 2 * np.stack([points.prod(axis=1), points[:, 1] ** 2], axis=1)
    assert sampling.late_velocity(run, points) == pytest.approx(expected, abs=1e-5)


def test_a_case_starts_with_the_flow_of_a_coarser_run(tmp_path):
    def flow(x, _):
        return np.stack([x[:, 0] * x[:, 1], x[:, 1] ** 2], axis=1)

    run = write_flow(tmp_path / "run", Cavity(resolution=10), flow, times=(1.0,))
    own = Cavity(resolution=25).build().state
    state = sampling.initial_state(own, run)
    fluid = state["kind"] != Kind.SOLID
    assert state["velocity"][fluid] == pytest.approx(flow(own["position"][fluid], 0), abs=1e-4)
    assert np.array_equal(state["velocity"][~fluid], own["velocity"][~fluid])
    assert not own["velocity"][fluid].any()
    with pytest.raises(ConfigError, match="it is in 2-D and this case in 3-D"):
        sampling.initial_state(TaylorGreen(resolution=8, dimensions=3).build().state, run)


@pytest.mark.parametrize("name", ["cavity_extrema.csv", "step_reattachment.csv", "cylinder_summary.csv"])
def test_reference_tables_are_complete(name):
    rows = reference.rows(name)
    assert rows and all(np.isfinite([float(value) for value in row.values()]).all() for row in rows)


SHAPES = [("square_cylinder", 0.0), ("square_cylinder", 30.0), ("naca0012", 0.0), ("naca0012", 10.0)]


@pytest.mark.parametrize(("shape", "angle"), SHAPES)
def test_fluid_flows_around_the_body(shape, angle):
    case = Body(shape=shape, angle_of_attack=angle, length=5.0, height=4.0, upstream=2.0)
    state = case.particles()
    fluid, solid = (state["position"][state["kind"] == kind] - [2, 0] for kind in (Kind.FLUID, Kind.SOLID))
    (body,) = case.carried
    assert shapely.distance(body, shapely.points(fluid)).min() > 0.35 * case.particle_spacing
    assert shapely.contains_xy(body, *solid.T).all()
    assert len(fluid) == pytest.approx((20 - body.area) * 400, abs=1)
    surface = case.surface_points()
    angles, points = surface.angle, surface.position
    assert angles.min() >= 0 and angles.max() < 360
    assert (np.diff(surface.chord[surface.side > 0]) > -1e-12).all()
    assert (np.diff(surface.chord[surface.side < 0]) < 1e-12).all()
    assert shapely.distance(body.exterior, shapely.points(points - [2, 0])).max() < 1e-9
    directions = np.stack([-np.cos(np.radians(angles)), np.sin(np.radians(angles))], axis=1)
    assert (points - [2, 0]) / np.hypot(*(points - [2, 0]).T)[:, None] == pytest.approx(directions, abs=1e-8)


def test_a_run_past_a_body_tells_its_forces(tmp_path):
    case = Body(resolution=8, length=5.0, height=4.0, upstream=2.0, angle_of_attack=20.0)
    run = case.run(tmp_path / "run", until=0.6, progress=False)
    measures = {measure.name: measure for measure in run.measures}
    assert measures["mean drag coefficient"].value == run.drag.mean > 0.5
    assert measures["mean lift coefficient"].value == run.lift.mean
    assert {"rms lift coefficient", "Strouhal number"} < set(measures)
    assert all(math.isnan(measure.reference) for measure in measures.values())
    assert run.summary()["mean lift coefficient"] == run.lift.mean


def test_square_body_is_symmetric_and_on_the_lattice():
    state = Body(length=5.0, height=4.0, upstream=2.0).particles()
    distance, _ = KDTree(state["position"]).query(state["position"] * [1, -1])
    assert distance.max() < 1e-9
    distance, _ = KDTree(state["position"]).query(state["position"], k=2)
    assert distance[:, 1] == pytest.approx(0.05)


def test_airfoil_noses_up():
    outline = Body(shape="naca0012", angle_of_attack=10).outline
    nose, tail = (outline.exterior.coords[k] for k in (0, 100))
    assert np.hypot(tail[0] - nose[0], tail[1] - nose[1]) == pytest.approx(1)
    assert np.degrees(np.arctan2(nose[1] - tail[1], tail[0] - nose[0])) == pytest.approx(10)
    assert outline.centroid.coords[0] == pytest.approx((0, 0), abs=1e-9)


def test_body_from_a_file(tmp_path):
    path = tmp_path / "wedge.csv"
    path.write_text("x,y\n0,0\n1,0.2\n1,-0.2\n")
    body = Body(shape=str(path))
    assert body.outline.area == pytest.approx(0.2)
    path.write_text("0 0\n1 0.2\n1 -0.2\n")
    assert Body(shape=str(path)).outline.equals(body.outline)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (
            "0 0\n1 1\n1 0\n0 1\n",
            r'curve.csv:1: "0 0": the curve meets itself after this line and after line 3, at \(0.5',
        ),
        ("0 0\n1 1\n", 'curve.csv:1: "0 0": .*three or more'),
        ("x\n0 a\n", 'curve.csv:2: "0 a": two numbers expected'),
        (None, "no such file"),
    ],
)
def test_body_refuses_what_is_no_curve(content, problem, tmp_path):
    path = tmp_path / "curve.csv"
    if content is not None:
        path.write_text(content)
    with pytest.raises(ConfigError, match=problem):
        Body(shape=str(path))


def test_body_refuses_to_touch_the_sides(tmp_path):
    (tmp_path / "wedge.csv").write_text("0 0\n30 1\n30 -1\n")
    with pytest.raises(ConfigError, match="leave at least 0.5 D"):
        Body(shape=str(tmp_path / "wedge.csv"))


def test_wide_domain_of_the_cylinder_is_possible():
    case = Cylinder(height=60.0, upstream=30.0, length=90.0, resolution=8)
    assert case.domain().upper == (90, 30)
    assert case.particle_estimate() == pytest.approx(90 * 60 * 64, rel=0.05)


def test_projection_of_a_uniform_stream_is_potential_flow():
    channel = {"length": 6, "height": 6, "upstream": 3, "resolution": 10, "perturbation": 0}
    case = Cylinder(reynolds=1e6, max_iterations=1, projection_sweeps=1000, **channel)
    simulation = case.simulation(threads=1)
    simulation.advance(1)
    state = simulation.snapshot()
    x, y = (state["position"] - case.centre).T
    r, angle = np.hypot(x, y), np.arctan2(y, x)
    ring = (state["kind"] == Kind.FLUID) & (r > 0.75) & (r < 1.5)
    u, v = state["velocity"][ring].T
    cosine, sine, inverse = np.cos(angle[ring]), np.sin(angle[ring]), r[ring] ** -2
    # u_r = (A - B/r²) cos θ, u_θ = -(A + B/r²) sin θ: a stream A past a cylinder of radius sqrt(B/A).
    matrix = np.concatenate([np.stack([cosine, -cosine * inverse], 1), np.stack([-sine, -sine * inverse], 1)])
    values = np.concatenate([u * cosine + v * sine, v * cosine - u * sine])
    (stream, doublet), *_ = np.linalg.lstsq(matrix, values)
    assert stream == pytest.approx(1.0, abs=0.04)
    assert np.sqrt(doublet / stream) == pytest.approx(0.5, rel=0.02)
    assert np.abs(matrix @ (stream, doublet) - values).mean() < 0.02
