"""Bodies that move: as they are told, and as the fluid makes them."""

import re
from pathlib import Path

import alsph
import numpy as np
import pytest
import shapely
from alsph import cases
from alsph.analysis.averages import Estimate
from alsph.cases import (
    Body,
    ConcentricRelease,
    Cylinder,
    CylinderPair,
    OscillatingCylinder,
    RotatingCylinder,
    SettlingSphere,
    TowedCylinder,
)
from alsph.config import Config
from alsph.engine.motion import poses
from alsph.errors import ConfigError, SolverError
from alsph.geometry.domain import SolidBody
from alsph.geometry.particles import Kind
from alsph.geometry.rigid import Rigid
from alsph.results.dimensional import dimensional
from alsph.results.ledger import _wall_power as ledger_power
from alsph.run_settings import RunSettings
from alsph.running.outputs import SurfacePressure, remarks_of
from alsph.study.declaration import digest
from scipy.spatial.transform import Rotation

SMALL = {"resolution": 8, "length": 6.0, "height": 4.0, "upstream": 2.0}
CENTRES = np.array([[1.0, 0.5], [2.0, -0.5]])


# What a rule tells


def test_velocities_and_accelerations_are_those_of_the_way():
    def rule(position, time):
        x, y = position.T
        return np.stack([np.sin(3 * time) * x, time**2 + 0 * y, 0.5 * time**3 + 1 + 0 * y], axis=1)

    found = poses(rule, CENTRES, 0.7).reshape(2, 10, 3)
    way, angle, velocity, spin, acceleration, turning = found.transpose(1, 0, 2)[:6]
    x = CENTRES[:, 0]
    assert way == pytest.approx(np.stack([np.sin(2.1) * x, [0.49] * 2, [0, 0]], axis=1))
    assert velocity == pytest.approx(np.stack([3 * np.cos(2.1) * x, [1.4] * 2, [0, 0]], axis=1), abs=1e-9)
    assert acceleration == pytest.approx(np.stack([-9 * np.sin(2.1) * x, [2.0] * 2, [0, 0]], axis=1), abs=1e-6)
    assert angle[:, 2] == pytest.approx(0.5 * 0.7**3)  # that of the time 0 is taken off
    assert spin[:, 2] == pytest.approx(1.5 * 0.7**2) and turning[:, 2] == pytest.approx(3 * 0.7, abs=1e-6)
    assert not angle[:, :2].any() and not found[:, 6:].any()


def test_angles_in_space_are_rotation_vectors_and_turn_about_any_axis():
    def rotation(time):
        return Rotation.from_rotvec([0, 0, 2 * time]) * Rotation.from_rotvec([0.5 * np.sin(time), 0, 0])

    found = poses(lambda position, time: [0, 0, 0, *rotation(time).as_rotvec()], np.zeros((1, 3)), 0.4)[0].reshape(
        10, 3
    )
    step = 1e-5
    turn = (rotation(0.4 + step) * rotation(0.4 - step).inv()).as_rotvec() / (2 * step)
    assert found[3] == pytest.approx(turn, abs=1e-7)
    later, before = (
        (rotation(t + step) * rotation(t - step).inv()).as_rotvec() / (2 * step) for t in (0.4 + 1e-4, 0.4 - 1e-4)
    )
    assert found[5] == pytest.approx((later - before) / 2e-4, abs=1e-4)
    assert Rotation.from_rotvec(found[1]).as_matrix() == pytest.approx(rotation(0.4).as_matrix())


def test_a_body_begins_where_it_is_drawn_and_goes_as_the_expression_says():
    case = Cylinder(**SMALL, body_motion="0.1*cos(4*t), 0.2*t, 2*t")
    simulation = case.simulation(threads=1)
    solid = simulation.state()["kind"] == Kind.SOLID
    assert simulation.state()["position"][solid].mean(axis=0) == pytest.approx([2, 0])
    simulation.run_until(0.5)
    time, state, rows = simulation.time, simulation.state(), simulation.history()
    solid = state["kind"] == Kind.SOLID
    there = np.array([2 + 0.1 * (np.cos(4 * time) - 1), 0.2 * time])
    assert state["position"][solid].mean(axis=0) == pytest.approx(there)
    assert rows["displacement"][-1, 0] == pytest.approx(there - [2, 0])
    assert rows["velocity"][-1, 0] == pytest.approx([-0.4 * np.sin(4 * time), 0.2])
    assert rows["angle"][-1, 0, 0] == pytest.approx(2 * time) and rows["angular_velocity"][-1, 0, 0] == pytest.approx(2)
    x, y = (state["position"][solid] - there).T
    normal = np.stack([x, y], axis=1) / np.hypot(x, y)[:, None]
    above = 0.5 * normal  # the surface, whose velocity they have
    expected = np.stack([-0.4 * np.sin(4 * time) - 2 * above[:, 1], 0.2 + 2 * above[:, 0]], axis=1)
    assert state["velocity"][solid] == pytest.approx(expected)
    assert state["normal"][solid] == pytest.approx(normal)
    assert "pose" in state and "pose" not in Cylinder(**SMALL).simulation(threads=1).state()


def test_points_of_the_surface_and_moments_go_along_with_the_body(tmp_path):
    case = Cylinder(**SMALL, body_motion="0.2*t, 0, pi/2*t")
    simulation = case.simulation(threads=1)
    simulation.run_until(1.0)
    rows, points = simulation.history(), case.surface_points()
    found = SurfacePressure(points, 1.0, case).sample(simulation, rows)["pressure_coefficient"]
    turn = Rotation.from_euler("z", np.pi / 2 * simulation.time).as_matrix()[:2, :2]
    there = [2 + 0.2 * simulation.time, 0] + (points.position - [2, 0]) @ turn.T
    assert np.hypot(*(there - [2 + 0.2 * simulation.time, 0]).T) == pytest.approx(0.5)
    pressure = simulation.sample(there)["pressure"]
    assert found == pytest.approx(2 * (pressure - rows["inlet_pressure"][-1]))

    run = case.run(tmp_path / "run", until=1.0, progress=False)
    history = run.history
    drag, lift, way = (history[name] for name in ("drag_coefficient", "lift_coefficient", "cylinder_displacement_x"))
    torque = -2 * (history["cylinder_pressure_torque"] + history["cylinder_viscous_torque"])
    assert run.moment_coefficient() == pytest.approx(torque)  # about its centre, wherever that is
    for x, y in ((2.0, 0.0), (1.5, 0.3)):  # points that stay where they are
        assert run.moment_coefficient(about=(x, y)) == pytest.approx(torque - (2 + way - x) * lift - y * drag)


def test_moments_of_several_bodies_are_about_one_point_that_stays(tmp_path):
    corners = np.array([[-0.4, -0.4], [0.4, -0.4], [0.4, 0.4], [-0.4, 0.4]])
    shape = [corners, corners + [1.8, 0.6]]
    case = Body(shape=shape, resolution=8, length=7, height=6, upstream=2.5, body_motion="0.3*t*(x>3), 0, 0.5*t*(x>3)")
    run = case.run(tmp_path / "run", until=0.6, progress=False)
    parts = [run.moment_coefficient(body=name, about=case.moment_point) for name in run.bodies]
    assert len(parts) == 2 and np.abs(parts[1]).max() > 0.01
    assert run.moment_coefficient() == pytest.approx(parts[0] + parts[1])


def test_periods_where_bodies_are_moved_may_be_those_of_the_motion(tmp_path):
    moved = Cylinder(**SMALL, body_motion="0, 0.2*sin(2*pi*t)").run(tmp_path / "moved", until=8.0, progress=False)
    assert moved.window.periods and any(remark.startswith("driven: ") for remark in moved.remarks)
    still = Cylinder(**SMALL, body_motion="0, 0.1*t").run(tmp_path / "still", until=0.2, progress=False)
    assert not still.window.periods and not any(remark.startswith("driven: ") for remark in still.remarks)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"body_motion": "0.1"}, "body_motion = '0.1': 1 components, and there are 2 directions"),
        ({"body_motion": "a, 0"}, "body_motion = 'a, 0'"),
    ],
)
def test_motions_that_cannot_be_are_refused(options, told):
    with pytest.raises(ConfigError, match=re.escape(told)):
        Cylinder(**SMALL, **options)
    with pytest.raises(ConfigError, match="body_motion = 't, 0': taylor_green has no body to move"):
        cases.TaylorGreen(body_motion="t, 0")


class Lost(Cylinder):
    """A body that moves, and nothing says how."""

    name = "lost"

    def bodies(self):
        return [SolidBody("cylinder", (2, 0), None, moves=True)]


def test_a_body_of_which_nothing_says_how_it_moves_is_told_of():
    with pytest.raises(ConfigError, match=r"lost: body 'cylinder' moves, and nothing says how; give it a velocity"):
        Lost(**SMALL).simulation()
    assert Lost(**SMALL, body_motion="0, 0.1*t").simulation(threads=1).advance(1) == 1


def test_rules_for_motion_in_python_are_checked():
    simulation = Cylinder(**SMALL).simulation(threads=1)
    with pytest.raises(ConfigError, match="motion: no body is moved by it"):
        simulation.prescribe(motion=lambda position, time: [0, 0])
    for rule in (lambda position, time: [0.0], lambda position, time: "no", lambda position, time: np.zeros((2, 2))):
        simulation = Cylinder(**SMALL, body_motion="0, 0").simulation(threads=1)
        simulation.prescribe(motion=rule)
        with pytest.raises(ConfigError, match="motion: the function must give 2 or 3 numbers a position"):
            simulation.advance(1)
    simulation.prescribe(motion=lambda position, time: [np.nan if time > 0.02 else 0.0, 0])
    with pytest.raises(ConfigError, match="motion.*not finite"):
        simulation.advance(100)


def test_a_body_that_comes_to_a_side_is_told_of():
    case = Cylinder(**SMALL, body_motion="0, t")
    with pytest.raises(SolverError, match='keep "cylinder" some spacings away from sides and other bodies'):
        case.simulation(threads=2).run_until(2)


TWO = shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.box(3, 0, 4, 1)])
PAIR = {"shape": TWO, "resolution": 8, "length": 9.0, "height": 5.0, "upstream": 3.5, "perturbation": 0.0}


def test_several_bodies_are_told_apart_and_turn_about_their_own_middles():
    case = Body(**PAIR, body_motion="0.5*t*(x > 3.5), 0.3*t*(x < 3.5), 2*t*(x < 3.5)")
    assert case.moved_centres.tolist() == [[2.0, 0.0], [5.0, 0.0]]
    simulation = case.simulation(threads=1)
    simulation.run_until(0.2)
    time, state, rows = simulation.time, simulation.state(), simulation.history()
    assert rows["displacement"][-1] == pytest.approx(np.array([[0, 0.3], [0.5, 0]]) * time)
    assert rows["angle"][-1, :, 0] == pytest.approx([2 * time, 0])
    for body, middle in enumerate([(2, 0.3 * time), (5 + 0.5 * time, 0)]):
        solid = (state["kind"] == Kind.SOLID) & (state["body"] == body)
        assert state["position"][solid].mean(axis=0) == pytest.approx(middle, abs=1e-6)


def test_torques_on_several_bodies_are_about_their_own_middles_and_moments_about_the_common_one(tmp_path):
    case = CylinderPair(resolution=8, length=9, height=8, upstream=3, body_offset=0.25)
    assert case.moment_point.tolist() == [3.0, 0.25] and Cylinder(**SMALL).moment_point.tolist() == [2.0, 0.0]
    run = case.run(tmp_path / "run", until=0.2, progress=False)
    for name, arm in (("body_1", -1.5), ("body_2", 1.5)):
        force, torque = (run.history[f"{name}_pressure_{kind}"][-1] for kind in ("force_x", "torque"))
        assert force > 0.3 and abs(torque) < 0.02 * force  # pressure goes through the centre of a circle
        moment = run.moment_coefficient(part="pressure", body=name)[-1]
        assert moment == pytest.approx(-2 * (torque - arm * force))


def test_several_bodies_that_move_are_drawn_where_they_have_come(tmp_path):
    """By their particles: the outlines are those of the start."""
    case = Body(**PAIR, body_motion="t*(x > 3.5), 0")
    run = case.run(tmp_path / "run", until=0.4, output_interval=0.4, progress=False)
    assert run.snapshot().solid(np.zeros((1, 2))) is None
    assert case.replace(body_motion=None).solid_height(np.array([[5.0, 0.0]])) < 0
    assert not any("outlet" in remark for remark in run.remarks)
    grid = run.to_grid(spacing=0.1)
    row = grid.fields["pressure"][:, np.abs(grid.axes["y"]).argmin()]
    filled = grid.axes["x"][np.isnan(row) & (grid.axes["x"] > 3.5)]
    assert filled.min() == pytest.approx(4.9, abs=0.1) and filled.max() == pytest.approx(5.9, abs=0.1)


def test_the_outlet_is_as_near_as_a_body_comes_to_it():
    def said(case, until):
        found = remarks_of(Config(case, RunSettings(until=until)), {"kind": np.zeros(0)})
        return [remark.partition(";")[0] for remark in found if "outlet" in remark]

    case = Cylinder(resolution=8, length=8, height=12, upstream=3, body_motion="2*t, 0")
    assert said(case, 0.9) == [] == said(case.replace(body_motion="-2*t, 0"), 1.9)
    assert said(case, 1.9) == ["short channel: outlet 0.7 D behind the body at t* = 1.9"]
    assert said(case.replace(body_motion="cos(pi*t), 0"), 10) == []  # from where it begins, upstream
    swings = case.replace(body_motion="3*sin(pi*t/4), 0")
    assert said(swings, 8) == ["short channel: outlet 1.5 D behind the body at t* = 2"]
    assert said(case.replace(length=5.5), 0.2) == ["short channel: outlet 2 D behind the body"]
    pair = Body(**PAIR | {"length": 9.5})
    assert said(pair.replace(body_motion="t*(x < 3.5), 0"), 0.9) == []
    assert said(pair.replace(body_motion="t*(x > 3.5), 0"), 1.6) == [
        "short channel: outlet 2.4 D behind the body at t* = 1.6"
    ]


def test_runs_with_another_motion_are_other_runs():
    first, again, other = (
        digest(alsph.config.from_tables({"case": "cylinder", **SMALL, "body_motion": text}))
        for text in ("0, sin(t)", "0, sin(t)", "0, 1.01*sin(t)")
    )
    assert first == again != other


class Waving(Cylinder):
    """A cylinder that a function moves which gives a row for each body."""

    def motion(self, position, time):
        assert position.shape == (1, 2)
        return np.array([[0.0, 0.1 * np.sin(time)]])


def test_a_rule_that_gives_a_row_for_each_body_is_asked_of_bodies_alone():
    assert digest(Config(Waving(**SMALL))) != digest(Config(Cylinder(**SMALL)))


def test_a_motion_that_is_known_from_a_time_on_or_jumps_is_told_of():
    with pytest.raises(ConfigError, match=r"motion: is not finite at t\* = -0.00"):
        Cylinder(**SMALL, body_motion="sqrt(t), 0").simulation(threads=1).advance(1)
    with pytest.raises(ConfigError, match=r"`motion`: jumps at time 0.0"):
        Cylinder(**SMALL, body_motion="0.5*(1 + tanh((t - 0.03)*1e4)), 0").simulation(threads=1).advance(100)


def test_a_run_that_begins_with_one_whose_body_has_moved_is_told_so(tmp_path):
    case = Cylinder(**SMALL, body_motion="0, 0.1*t")
    source = case.run(tmp_path / "run", until=0.05, progress=False)
    with pytest.warns(RuntimeWarning, match="its bodies have moved, and here begin where they are drawn"):
        case.simulation(initial_run=source.path)


# What is free


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"mass": 0}, "rigid: mass = 0: must be a number above zero"),
        ({"mass": "x"}, "rigid: mass = 'x': must be a number above zero"),
        ({"inertia": (1, 2)}, "rigid: inertia = "),
        ({"displaced": -1}, "rigid: displaced = -1: must be a number above zero"),
        ({"force": (1,)}, "rigid: force = (1,): must be 2 finite numbers"),
        ({"free": (True,)}, "rigid: free = (True,): must be 2 directions and 1 axes, True or False each"),
        ({"free": (1, 1, 1)}, "rigid: free = (1, 1, 1): must be"),
        ({"free": True}, "rigid: free = True: must be"),
        ({"free": (False, False, False)}, "rigid: free = (False, False, False): a body that cannot move at all"),
        ({"stiffness": (0, -1)}, "rigid: stiffness = (0, -1): must not be negative"),
        ({"damping": (-0.5, 0)}, "rigid: damping = (-0.5, 0): must not be negative"),
        ({"added_mass": -1.0}, "rigid: added_mass = -1.0: must not be negative"),
        ({"added_inertia": "0"}, "rigid: added_inertia = '0': must be a number"),
        ({"mass": "1"}, "rigid: mass = '1': must be a number above zero"),
        ({"mass": True}, "rigid: mass = True: must be a number above zero"),
        ({"mass": np.inf}, "rigid: mass = inf: must be a finite number above zero"),
    ],
)
def test_rigid_bodies_that_cannot_be_are_refused(wrong, told):
    with pytest.raises(ConfigError, match=re.escape(told)):
        SolidBody("a", (0, 0), rigid=Rigid(**({"mass": 1, "inertia": 1, "displaced": 1} | wrong)))


def test_a_body_may_drag_nothing_along():
    body = SolidBody("a", (0, 0), rigid=Rigid(1, 1, 1, added_mass=0, added_inertia=np.float64(0)))
    assert body.rigid.settings(2)["added_mass"] == body.rigid.settings(2)["added_inertia"] == 0


@pytest.mark.parametrize("ratio", [0.1, 0.5, 2.0, 8.0])
@pytest.mark.parametrize(("scheme", "resolution"), [("alsph", 20), ("isph", 10)])
def test_a_cylinder_that_is_let_go_has_the_acceleration_of_added_mass(tmp_path, ratio, scheme, resolution):
    case = ConcentricRelease(density_ratio=ratio, scheme=scheme, resolution=resolution)
    run = case.run(tmp_path / "run", until=0.11, progress=False)
    (acceleration,) = run.measures
    assert acceleration.passed, acceleration


@pytest.mark.parametrize("sweeps", [8, 16, 40])
def test_a_light_body_is_stable_however_many_sweeps_there_are(sweeps):
    simulation = ConcentricRelease(density_ratio=0.02, resolution=8, projection_sweeps=sweeps).simulation(threads=1)
    simulation.run_until(0.12)
    rows = simulation.history()
    acceleration = np.diff(rows["velocity"][:, 0, 1]) / rows["time_step"][1:]
    assert np.abs(np.diff(acceleration[5:])).mean() < 0.005


def test_a_free_body_moves_as_the_forces_on_it_say():
    """Its velocity is the integral of force over mass, and its way that of the velocity."""
    case = ConcentricRelease(density_ratio=2.0, resolution=10, scheme="isph")
    simulation = case.simulation(threads=1)
    simulation.run_until(0.3)
    rows = simulation.history()
    mass, step = 2 * np.pi / 4, rows["time_step"]
    force = (rows["pressure_force"] + rows["viscous_force"])[:, 0, 1] - mass / 2
    velocity, way = rows["velocity"][:, 0, 1], rows["displacement"][:, 0, 1]
    assert velocity[-1] == pytest.approx((force[10:] * step[10:]).sum() / mass + velocity[9], rel=0.03)
    assert way[-1] == pytest.approx((0.5 * (velocity + np.append(0, velocity[:-1])) * step).sum())
    assert np.abs(rows["displacement"][:, 0, 0]).max() < 1e-6


def test_a_restored_free_body_has_the_bits_of_a_whole_one():
    case = ConcentricRelease(density_ratio=0.5, resolution=8)
    whole, cut = (case.simulation(threads=1) for _ in range(2))
    whole.advance(12)
    cut.advance(5)
    again = case.restored(cut.state(), threads=2)
    again.advance(7)
    first, second = whole.state(), again.state()
    for name, values in first.items():
        order = [np.argsort(state["id"]) if name != "pose" and np.ndim(values) else ... for state in (first, second)]
        assert np.array_equal(np.asarray(values)[order[0]], np.asarray(second[name])[order[1]]), name


def test_a_free_body_does_not_go_on_without_its_pose():
    case = ConcentricRelease(density_ratio=0.5, resolution=8)
    simulation = case.simulation(threads=1)
    simulation.advance(2)
    state = simulation.state()
    del state["pose"]
    with pytest.raises(ValueError, match="`pose`: is missing, with which free bodies go on from step 2"):
        case.restored(state, threads=1)


# Cases


def test_towed_and_fixed_feel_the_same(tmp_path):
    """And the fluid loses the momentum that the drag takes."""
    runs = [
        TowedCylinder(resolution=8, length=8, height=8, frame=frame).run(tmp_path / frame, until=3, progress=False)
        for frame in ("fluid", "cylinder")
    ]
    drags, balances = np.transpose([[measure.value for measure in run.measures] for run in runs])
    assert drags[0] == pytest.approx(drags[1], rel=0.03) and drags[0] > 1
    assert balances == pytest.approx([1, 1], abs=0.04)  # within 0.003 at D/Δx = 10


def turning(case):
    """Drag, lift and torque of a cylinder, means over t* = 0.5 to 1."""
    simulation = case.simulation(threads=1)
    simulation.run_until(1.0)
    history = simulation.history()
    torque = (history["pressure_torque"] + history["viscous_torque"]).ravel()
    late = history["time"] > 0.5
    return np.array([each[late].mean() for each in (history["drag_coefficient"], history["lift_coefficient"], torque)])


def test_a_cylinder_that_rotates_by_its_motion_or_its_surface_feels_the_same():
    """Solids have the velocity of the surface above them: with that of their own place, loads were 17 % off."""
    slides = turning(RotatingCylinder(**SMALL))
    assert turning(RotatingCylinder(**SMALL, surface_speed=-1.0)) == pytest.approx(slides * (1, -1, -1), rel=1e-6)
    turns = turning(Cylinder(**SMALL, reynolds=100, perturbation=0, body_motion="0, 0, 2*t"))
    assert turns == pytest.approx(slides, rel=0.08)


def test_a_cylinder_that_rotates_has_the_loads_of_finite_elements(tmp_path):
    case = RotatingCylinder(resolution=10, length=8, height=6, upstream=3)
    measures = case.run(tmp_path / "run", until=4.0, progress=False).measures[:3]
    assert [measure.name.split(",")[0] for measure in measures] == ["drag coefficient", "lift coefficient", "torque"]
    assert all(abs(measure.error) < 0.06 for measure in measures)
    mirrored = case.replace(surface_speed=-1.0).run(tmp_path / "mirrored", until=4.0, progress=False).measures[1]
    assert mirrored.reference > 3 and abs(mirrored.error) < 0.06
    started = case.replace(perturbation=0.1).run(tmp_path / "started", until=0.1, progress=False).measures[:3]
    assert all(np.isnan([measure.value, measure.reference]).all() for measure in started)


def test_the_work_of_a_body_that_moves_is_in_the_energy_budget(tmp_path):
    case = OscillatingCylinder(resolution=12, length=6, height=6, reynolds=50)
    run = case.run(tmp_path / "run", until=5, progress=False, output_interval=0.5)
    history, power = run.history, ledger_power(run, case)
    late = history["time"] > 1  # the start is an impulse
    given, taken = ((rate * history["time_step"])[late].sum() for rate in (power, history["dissipation"]))
    kinetic = history["kinetic_energy"][late]
    assert given > 1 and given == pytest.approx(taken + kinetic[-1] - kinetic[0], rel=0.03)
    at = np.interp(run.times[1:], history["time"], power)
    assert run.ledger.power[1:] == pytest.approx(at)
    names = [measure.name for measure in run.measures]
    assert "inertia coefficient of Morison" in names and len(run.profiles) == 1


def test_velocities_beside_an_oscillating_cylinder_stand_beside_those_measured(tmp_path):
    """A flow that is not at all that of the experiment, at snapshots of its phases and at others."""
    case = OscillatingCylinder(resolution=8, length=6, height=6)
    run = case.run(tmp_path / "run", until=5.0, progress=False, output_interval=5 / 12)
    found = {measure.name: measure.value for measure in run.measures}
    names = [f"velocity at {phase} degrees, rms difference, U" for phase in (180, 210, 330)]
    assert all(0.02 < found[name] < 0.3 for name in names)
    profiles = run.profiles[1:]
    assert len(profiles) == 24 and len({profile.file_name for profile in profiles}) == 24
    # Where the cylinder moves fastest, at 180 degrees, the fluid before and behind it does so too.
    beside = next(profile for profile in profiles if profile.name == "velocity at 180 degrees, u at x = 0.6 D")
    y, u = beside.computed
    assert np.interp(0, y, u) > 0.7 and np.isfinite(u).all()
    middle = next(profile for profile in profiles if profile.name == "velocity at 180 degrees, u at x = 0 D")
    assert (np.abs(middle.reference[0]) > 0.4).all()
    coarse = case.run(tmp_path / "coarse", until=5.0, progress=False, output_interval=1.0)
    assert len(coarse.profiles) == 1


def test_a_sphere_as_heavy_as_the_fluid_is_refused():
    with pytest.raises(ConfigError, match="density_ratio = 1: the sphere neither sinks nor rises"):
        SettlingSphere(density_ratio=1)


def test_a_quarter_of_a_sphere_settles_straight(tmp_path):
    case = SettlingSphere(resolution=8, height=6, width=3)
    run = case.run(tmp_path / "run", until=0.5, progress=False)
    history = run.history
    assert not history["sphere_displacement_x"].any() and not history["sphere_angle_x"].any()
    assert -0.2 < history["sphere_velocity_z"][-1] < -0.1
    assert (np.diff(history["sphere_velocity_z"]) <= 0).all()


def test_a_settling_sphere_has_no_coefficients_of_the_forces_from_its_sides(tmp_path):
    """Its force is along z, and its C_D is formed with the settling velocity: in SI it is no force."""
    case = SettlingSphere(resolution=8, height=6, width=3)
    run = case.run(tmp_path / "run", until=0.1, progress=False)
    assert run.body is None and np.isnan(run.drag.mean) and np.isnan(run.lift.mean)
    assert not {"drag_coefficient", "lift_coefficient"} & run.history.keys()
    force = sum(run.history[f"sphere_{part}_force_z"][-1] for part in ("pressure", "viscous"))
    assert run.coefficient("z", body="sphere")[-1] == pytest.approx(force / (0.5 * np.pi / 16))
    units = alsph.Units(length=2.0, velocity=3.0, density=5.0, kinematic_viscosity=1.0)
    assert "C_D at the settling velocity" in case.later_names
    told = dimensional({name: Estimate(1.2) for name in case.later_names}, units, 3, case.reference_area, 1.0)
    assert [*told] == ["settling velocity over the last two diameters, m/s"]


def test_the_examples_of_the_page_are_run():
    page = (Path(__file__).parents[1] / "docs" / "moving_bodies.md").read_text(encoding="utf-8")
    table, vibrating = re.findall(r"^```python\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)
    space = {"__name__": "examples"}
    exec(table + vibrating, space)
    shaken = space["Shaken"](**SMALL).simulation(threads=1)
    shaken.run_until(0.2)
    assert shaken.history()["displacement"][-1, 0] == pytest.approx([0, 0.2 * np.sin(shaken.time)], abs=1e-3)
    vibrating = space["VibratingCylinder"](**SMALL, reynolds=150).simulation(threads=1)
    vibrating.run_until(1.0)
    way = vibrating.history()["displacement"][:, 0]
    assert not way[:, 0].any() and 0 < np.abs(way[:, 1]).max() < 0.1
