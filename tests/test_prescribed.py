"""What is prescribed by place and time: body forces and sliding surfaces beside exact solutions, and expressions."""

import gc
import pickle
import re
import weakref

import alsph
import numpy as np
import pytest
from alsph.cases import BackwardFacingStep, Body, Cavity, Couette, Cylinder, Poiseuille, Sphere, TaylorGreen
from alsph.engine.prescribed import Prescription, difference
from alsph.errors import ConfigError
from alsph.expressions import FUNCTIONS, VectorExpression
from alsph.geometry.particles import Kind
from balance import loads
from hypothesis import given
from hypothesis import strategies as st
from shapely import Point

SMALL = {"resolution": 8, "length": 5.0, "height": 4.0, "upstream": 2.0}


def flow(case, until):
    """Return heights and velocities of the fluid along x at the end, and the time."""
    simulation = case.simulation(threads=1)
    simulation.run_until(until)
    state = simulation.snapshot()
    fluid = state["kind"] == Kind.FLUID
    return state["position"][fluid, 1], state["velocity"][fluid], simulation.time


def error(values, exact):
    return np.sqrt(((values[:, 0] - exact) ** 2).mean() / (exact**2).mean()), np.abs(values[:, 1]).max()


@pytest.mark.parametrize("womersley", [2.0, 6.0])
def test_a_pulsating_channel_is_womersleys_flow(womersley):
    """du/dt = G cos ωt + ν u'' between plates at rest: Womersley, J. Physiol. 127 (1955), in the plane."""
    frequency = womersley**2 / 10 / 0.25  # of the half width, ν = 1/10
    case = Poiseuille(resolution=20, reynolds=10, length=0.5, driving_force=f"-8/reynolds + cos({frequency!r}*t), 0")
    cycle = 2 * np.pi / frequency
    # The transient of the start from rest decays as exp(-π²νt).
    y, velocity, time = flow(case, cycle * np.ceil(6.0 / cycle) + 0.3 * cycle)
    root = np.sqrt(1j * frequency * case.reynolds)
    amplitude = (1 - np.cosh(root * (y - 0.5)) / np.cosh(root / 2)) / (1j * frequency)
    exact = (amplitude * np.exp(1j * frequency * time)).real
    along, across = error(velocity, exact)
    assert along < 0.01 and across < 1e-3 * np.abs(amplitude).max()


def test_an_oscillating_plate_is_stokes_second_problem():
    frequency = 2 * np.pi
    case = Couette(resolution=20, reynolds=10, surface_velocity="where(y > 0.5, 0, cos(2*pi*t)), 0")
    y, velocity, time = flow(case, 8.3)
    root = np.sqrt(1j * frequency * case.reynolds)
    exact = (np.sinh(root * (1 - y)) / np.sinh(root) * np.exp(1j * frequency * time)).real
    along, across = error(velocity, exact)
    assert along < 0.02 and across < 2e-3


def test_a_turning_cylinder_is_the_same_by_expressions_as_by_a_method():
    class Turning(Cylinder):
        def sliding(self, position, time):
            x, y = (position - self.centre).T
            return 0.5 * time * np.stack([-y, x], axis=1)

        def inflow(self, position, time):
            return [1 - 0.1 * np.cos(time), 0]

    told = Cylinder(
        **SMALL, surface_velocity="-0.5*t*y, 0.5*t*(x - upstream)", inlet_velocity="1 - 0.1*cos(t), 0", perturbation=0.0
    )
    flows = []
    for case in (told, Turning(**SMALL, perturbation=0.0)):
        simulation = case.simulation(threads=1)
        simulation.run_until(0.5)
        flows.append(simulation.snapshot())
    assert (flows[0]["velocity"] == flows[1]["velocity"]).all() and (flows[0]["position"] == flows[1]["position"]).all()
    solid = flows[0]["kind"] == Kind.SOLID
    speed = np.hypot(*flows[0]["velocity"][solid].T)
    assert 0.05 < speed.max() < 0.13


def test_a_cylinder_that_turns_is_lifted_as_it_should_be():
    """Counterclockwise in a stream along x: downwards, C_L near -2.5 at a surface speed of U (Re = 100 to 200)."""
    case = Cylinder(
        resolution=10, length=8, height=6, upstream=3, perturbation=0.0, surface_velocity="-2*y, 2*(x - upstream)"
    )
    simulation = case.simulation(threads=1)
    simulation.run_until(8.0)
    history = simulation.history()
    late = history["time"] > 6
    assert -3.4 < history["lift_coefficient"][late].mean() < -2.0
    assert (history["cylinder_viscous_torque" if "cylinder_viscous_torque" in history else "viscous_torque"] != 0).any()


def test_loads_with_a_body_force_are_the_momentum_balance():
    """The inflow being given, it is taken up by pressure, which pushes the body against it."""
    room = {"reynolds": 100, "resolution": 10, "length": 7, "height": 6, "upstream": 2.5, "perturbation": 0.0}
    plain, pushed = (loads(Cylinder(**room, **more), 1.0, 1.6, 0.02) for more in ({}, {"driving_force": "0.3, 0.5"}))
    assert pushed.recorded[0] == pytest.approx(pushed.boxes[0], rel=0.05)
    assert pushed.recorded[1] == pytest.approx(pushed.boxes[1], abs=0.05)
    assert np.abs(pushed.boxes - plain.boxes).min() > 0.1


def test_a_case_with_expressions_goes_to_other_processes():
    case = Cylinder(**SMALL, inlet_velocity="1 + 0.1*sin(t)*cos(y), 0")
    copy = pickle.loads(pickle.dumps(case))
    assert copy == case and (copy.inflow(POINTS, 0.3) == case.inflow(POINTS, 0.3)).all()


def test_references_of_other_flows_are_not_used(tmp_path):
    plain = Poiseuille(resolution=10).run(tmp_path / "plain", until=0.1, progress=False)
    run = Poiseuille(resolution=10, driving_force="t, 0").run(tmp_path / "run", until=0.1, progress=False)
    assert [measure.name for measure in plain.measures] == ["relative L2 error of the velocity"] and not run.measures
    assert run.profiles[0].reference[0].size == 0 < plain.profiles[0].reference[0].size
    assert any(remark.startswith("not validated: driving_force of its own") for remark in run.remarks)
    assert np.isfinite(run.ledger.energy_residual if hasattr(run.ledger, "energy_residual") else 0.0)
    driven = Cylinder(inlet_velocity="1 + 0.1*sin(t), 0")
    assert driven._reference() is not None and driven.is_driven and not Cylinder().is_driven


def test_what_a_force_raises_comes_out_as_it_is_and_the_simulation_goes_on(small):
    class OutOfPaper(Exception):
        pass

    def forcing(position, time):
        if time > 0.1 and broken:
            raise OutOfPaper("here")
        return [0.0, 0.0]

    broken = [True]
    simulation, plain = (small.simulation(threads=1) for _ in range(2))
    simulation.prescribe(forcing=forcing)
    with pytest.raises(OutOfPaper, match="here"):
        simulation.run_until(0.3)
    assert 0 < simulation.time <= 0.11
    broken.clear()
    simulation.run_until(0.3)
    plain.run_until(0.3)
    assert (simulation.snapshot()["velocity"] == plain.snapshot()["velocity"]).all()


def test_a_force_that_is_taken_away_acts_no_more():
    case = Couette(resolution=10)
    pushed = case.simulation(threads=1)
    pushed.prescribe(forcing=lambda position, time: [1.0, 0.0])
    pushed.advance(3)
    pushed.prescribe(forcing=None)
    plain = case.restored(pushed.state(), threads=1)
    for simulation in (pushed, plain):
        simulation.advance(20)
    assert (pushed.snapshot()["velocity"] == plain.snapshot()["velocity"]).all()


def test_what_is_not_named_stays_and_what_cannot_be_is_refused():
    turning = Cylinder(**SMALL, surface_velocity="-y, x - upstream").simulation(threads=1)
    turning.prescribe(forcing=lambda position, time: [0.1, 0.0])
    assert turning.rules.keys() == {"forcing", "sliding"}
    turning.prescribe(forcing=None)
    assert turning.rules.keys() == {"sliding"}
    with pytest.raises(ConfigError, match="sliding: each body has a velocity of its own"):
        Couette(resolution=10).simulation(threads=1).prescribe(sliding=lambda position, time: [1.0, 0.0])


def test_a_simulation_with_rules_goes_when_it_is_not_needed():
    simulation = Couette(resolution=10, driving_force="t, 0", surface_velocity="1, 0").simulation(threads=1)
    simulation.advance(1)
    known = weakref.ref(simulation)
    del simulation
    gc.collect()
    assert known() is None


def test_an_expression_may_come_and_go_in_mid_run(tmp_path):
    path = Couette(resolution=10).run(tmp_path / "run", until=0.1, progress=False).path
    settings, plain = path / "case.toml", (path / "case.toml").read_text()
    told = 'driving_force = "t, 0"\nsurface_velocity = "where(y > 0.5, 1, 0), 0"\n'
    for until, text in ((0.2, told + plain), (0.3, plain)):
        settings.write_text(text)
        with pytest.warns(RuntimeWarning, match="goes on with other settings than before: .*driving_force"):
            alsph.resume(path, until=until, progress=False)
        assert alsph.repeat(path, progress=False).same


def test_a_force_in_one_place_is_known_by_it(small):
    position = np.random.default_rng(2).uniform(-5, 5, (5000, 2))

    def local(strength):
        return lambda position, time: strength * np.exp(-100 * (position**2).sum(axis=1))[:, None] * [1.0, 0.0]

    then = {"forcing": Prescription.of(0.3, position, local(1.0)(position, 0.3))}
    assert difference({"forcing": local(1.0)}, then) == "" and len(then["forcing"].position) <= 512
    assert "another body force" in difference({"forcing": local(1.1)}, then)


def test_names_that_mean_two_things_are_refused():
    class Heated(Cylinder):
        name = "heated_for_names"
        t: float = 7.0

    with pytest.raises(ConfigError, match="t is a parameter of the case, too"):
        Heated(**SMALL, driving_force="t, 0")
    assert Heated(**SMALL, driving_force="x, 0").rules


def test_a_class_of_an_expression_of_its_own_keeps_its_references():
    class Blown(Poiseuille):
        name = "blown"
        driving_force: str | None = "0, 0"

    assert not Blown().is_driven and Blown(driving_force="1, 0").is_driven and Blown().rules.keys() == {"forcing"}


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ("fast", "must give 2 numbers"),
        (None, "must give 2 numbers"),
        ([1.0], "must give 2 numbers"),
        (np.ones((3, 2)), "must give 2 numbers"),
        ([np.nan, 0.0], "body force.*all must be finite"),
    ],
)
def test_a_force_that_is_none_is_refused(small, values, message):
    simulation = small.simulation(threads=1)
    simulation.prescribe(forcing=lambda position, time: values)
    with pytest.raises(ConfigError, match=message):
        simulation.advance(1)
    simulation.prescribe(forcing=None)
    simulation.advance(1)


# Expressions

POINTS = np.random.default_rng(1).uniform(-2, 2, (40, 2))


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("1, 0", lambda x, y, t: (1 + 0 * x, 0 * x)),
        ("1 + 0.2*sin(2*pi*t), -y", lambda x, y, t: (1 + 0.2 * np.sin(2 * np.pi * t) + 0 * x, -y)),
        ("6*(y/height + 0.5)*(0.5 - y/height), x % 1", lambda x, y, t: (6 * (y / 4 + 0.5) * (0.5 - y / 4), x % 1)),
        ("where(x > 0, t, -t), hypot(x, y)**2", lambda x, y, t: (np.where(x > 0, t, -t), np.hypot(x, y) ** 2)),
        ("spline(t, -2,8, -1,1, 0,0, 1,-1), 0", lambda x, y, t: (0 * x - t**3, 0 * x)),
        ("0, spline(x, -1,-2, 1,2)", lambda x, y, t: (0 * x, 2 * x)),
        ("(x >= y) * e, minimum(x, 1)", lambda x, y, t: ((x >= y) * np.e, np.minimum(x, 1))),
        (
            "(x > 0) + (x > 1), (t > 0.5) - (y < 0)",
            lambda x, y, t: (1.0 * (x > 0) + (x > 1), (t > 0.5) - 1.0 * (y < 0)),
        ),
        (" ( 1 , 2 ) ", lambda x, y, t: (1 + 0 * x, 2 + 0 * x)),
    ],
)
def test_expressions_are_what_numpy_makes_of_them(text, values):
    expression = VectorExpression(text, 2, {"height": 4.0})
    for time in (0.0, 0.7):
        expected = np.stack(values(*POINTS.T, time), axis=1)
        assert expression(POINTS, time) == pytest.approx(expected, rel=1e-14, abs=1e-15)
        assert (expression(POINTS[::-1], time)[::-1] == expression(POINTS, time)).all()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no expression"),
        ("1 +, 0", "no expression near character"),
        ("1", "1 components, and there are 2 directions"),
        ("1, 2, 3", "3 components"),
        ("foo, 0", "unknown name 'foo'; known: x, y, t, height, pi"),
        ("z, 0", "unknown name 'z'"),
        ("sin, 0", "'sin' cannot be used"),
        ("1 - y^2/10, 0", r"'1 - y \^ 2 / 10' cannot be used in an expression; write \*\* for a power"),
        ("x//1, 0", "'x // 1' cannot be used in an expression$"),
        ("x == 1, 0", "'x == 1' cannot be used in an expression$"),
        ("not x, 0", "'not x' cannot be used in an expression$"),
        ("pi(1), 0", "cannot be used"),
        ("sin(x, y), 0", "sin takes 1 arguments, not 2"),
        ("where(x, y), 0", "where takes 3 arguments, not 2"),
        ("spline(t, 0, 0, 1), 0", "spline takes t and a table of two pairs or more"),
        ("spline(t, 0, 0, 0, 1), 0", "its times to increase"),
        ("spline(t, 0, x, 1, 1), 0", "numbers, not places"),
        ("sin(x, where=1), 0", "cannot be used"),
        ("sin(*x), 0", "sin|cannot be used"),
        ("x.real, 0", "'x.real' cannot be used"),
        ("x[0], 0", "cannot be used"),
        ("[1, 2], 0", "cannot be used"),
        ("1 if x > 0 else 2, 0", "cannot be used"),
        ("x and y, 0", "cannot be used"),
        ("lambda: 1, 0", "cannot be used"),
        ("(y := 1), 0", "cannot be used"),
        ("'a', 0", "cannot be used"),
        ("True, 0", "cannot be used"),
        ("1j, 0", "cannot be used"),
        ("(1, 2), 0", "cannot be used"),
        ("__import__('os').system('true'), 0", "cannot be used"),
        ("9**9**9**9, 0", "cannot be computed"),
        ("1/0, 0", "cannot be computed: float division by zero"),
        ("0 < x < 1, 0", "write two comparisons"),
        ("(-1)**0.5*x, 0", "is a complex number"),
        ("9" * 400 + ", 0", "a number in it is too large"),
        ("(" * 300 + "1" + ")" * 300 + ", 0", "no expression|too deep"),
        ("1" + "+1" * 20_000 + ", 0", "too long"),
        ("-" * 1900 + "1, 0", "no expression|too deep"),
    ],
)
def test_what_is_no_expression_is_refused_with_the_reason(text, message):
    with pytest.raises(ValueError, match=message):
        VectorExpression(text, 2, {"height": 4.0})
    with pytest.raises(ConfigError, match="^inlet_velocity = "):
        Cylinder(inlet_velocity=text)


@given(st.lists(st.sampled_from([*"xyt012.,()+-*/%<> =", *FUNCTIONS]), max_size=30).map("".join))
def test_any_text_is_an_expression_or_refused(text):
    try:
        expression = VectorExpression(text, 2, {})
    except ValueError:
        return
    assert expression(POINTS, 0.3).shape == POINTS.shape


def test_what_a_case_does_not_have_cannot_be_prescribed():
    with pytest.raises(ConfigError, match="inlet_velocity = '1, 0': cavity has no inlet"):
        Cavity(inlet_velocity="1, 0")
    with pytest.raises(ConfigError, match="surface_velocity = '1, 0': taylor_green has no body in place"):
        TaylorGreen(surface_velocity="1, 0")
    with pytest.raises(ConfigError, match="driving_force = '1, 0': 2 components, and there are 3 directions"):
        TaylorGreen(dimensions=3, driving_force="1, 0")

    class Pulsing(Cylinder):
        def inflow(self, position, time):
            return [1.0, 0.0]

    with pytest.raises(ConfigError, match="inlet_velocity: Pulsing says that itself, by its method `inflow`"):
        Pulsing(inlet_velocity="1, 0")
    step = BackwardFacingStep(inlet_velocity="1, 0")
    assert step.rules.keys() >= {"inflow"}


ROOM = {"resolution": 8, "length": 7.0, "height": 6.0, "upstream": 3.0}
TURNING = "-2*y, 2*(x - upstream)"


@pytest.mark.parametrize(
    ("case", "told"),
    [
        (
            Body(**ROOM, surface_velocity="1, 0"),
            "1 U through the surface at (3.5, 0.1875), t* = 0; surfaces slide only",
        ),
        (Body(**ROOM, surface_velocity=TURNING), "0.375 U through the surface at (3.5, 0.1875), t* = 0;"),
        (Cylinder(**ROOM, surface_velocity="-2*y, 2*(x - 4)"), "2 U through the surface at (3, 0.5)"),
        (
            Cylinder(**ROOM, surface_velocity="minimum(t, 1), 0"),
            "U through the surface at (3.495, 0.07116), t* = 37.08",
        ),
        (Couette(resolution=10, surface_velocity="0, y"), "1 U through the surface at (0.05, 1), t* = 0"),
        (Sphere(resolution=8, surface_velocity="-2*y, 2*x, 0"), "U through the surface at (3.0"),
    ],
)
def test_a_surface_slides_only_along_itself(case, told):
    with pytest.raises(ConfigError, match=f"^surface_velocity = '.*': has a component of .*{re.escape(told)}"):
        case.build()


@pytest.mark.parametrize(
    "case",
    [
        Cylinder(surface_velocity="-2*y, 2*(x - 4)"),  # of the help
        Cylinder(**ROOM, surface_velocity=f"sin(t)*{TURNING.replace(', ', ', sin(t)*')}"),
        Body(**ROOM, shape=Point(0, 0).buffer(0.5, quad_segs=6), surface_velocity=TURNING),
        Body(**ROOM, shape=Point(0, 0).buffer(0.5, quad_segs=3), surface_velocity=TURNING),
        Body(**ROOM, surface_velocity="sign(y)*(abs(y) > 0.49), 0"),
        Cavity(resolution=20, surface_velocity="where(y > 0.999, 1, 0), 0"),
    ],
)
def test_surfaces_that_slide_along_themselves_may_be_of_polygons_and_have_corners(case):
    assert case.build().state["position"].any()


def test_expressions_are_parameters_like_others(tmp_path):
    case = Cylinder(**SMALL, inlet_velocity="1 + 0.3*sin(20*t)*cos(y), 0", surface_velocity="-y, x - upstream")
    run = case.run(tmp_path / "run", until=0.1, progress=False)
    assert run.config.case == case and "inlet_velocity = " in (run.path / "case.toml").read_text()
    alsph.resume(run.path, until=0.2, progress=False)
    assert alsph.repeat(run.path, progress=False).same


def test_a_turning_cylinder_has_a_mean_lift(tmp_path):
    names = [
        [
            measure.name
            for measure in Cylinder(**SMALL, **more).run(tmp_path / str(k), until=0.1, progress=False).measures
        ]
        for k, more in enumerate(({}, {"surface_velocity": "-y, x - upstream"}))
    ]
    assert "mean lift coefficient" not in names[0] and "mean lift coefficient" in names[1]
