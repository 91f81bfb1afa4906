"""Simulations that two threads or processes use, and arrays and numbers of other types than the engine's."""

import os
import signal
import threading

import alsph
import numpy as np
import pytest
from alsph import Simulation
from alsph.errors import AlsphError, ConfigError, SharedError
from alsph.geometry.particles import Kind


def in_a_child(action):
    """Return what an action raises in a forked process, which is killed if it hangs."""
    readable, writable = os.pipe()
    child = os.fork()
    if child == 0:
        signal.alarm(30)
        said = b"nothing"
        try:
            action()
        except AlsphError as error:
            said = f"{type(error).__name__}: {error}".encode()
        except BaseException as error:
            said = repr(error).encode()
        os.write(writable, said)
        os._exit(0)
    os.close(writable)
    with open(readable, "rb") as pipe:
        said = pipe.read().decode()
    os.waitpid(child, 0)
    return said


@pytest.mark.filterwarnings("ignore:.*fork")
def test_a_simulation_does_not_follow_into_a_forked_process(small):
    simulation = small.simulation(2)
    simulation.advance(1)
    for use in (
        lambda: simulation.advance(1),
        lambda: simulation.run_until(1.0),
        simulation.snapshot,
        simulation.state,
        simulation.history,
        lambda: simulation.sample(np.zeros((1, 2))),
        lambda: simulation.time,
    ):
        assert in_a_child(use).startswith(f"SharedError: this simulation was made in process {os.getpid()}")
    assert in_a_child(lambda: repr(simulation)) == "nothing"
    assert in_a_child(lambda: small.simulation(2).advance(2)) == "nothing"
    assert simulation.advance(1) == 1 and simulation.step == 2


def test_a_simulation_is_used_by_one_thread_at_a_time(small):
    simulation = small.simulation(1)
    inside, leave = threading.Event(), threading.Event()

    def inflow(position, time):
        inside.set()
        leave.wait(30)
        assert simulation.time == time  # the same thread may
        return [1.0, 0.0]

    simulation.set_inflow(inflow)
    stepping = threading.Thread(target=simulation.advance, args=(1,))
    stepping.start()
    assert inside.wait(30)
    try:
        for use in (simulation.snapshot, lambda: simulation.advance(1), lambda: simulation.time, simulation.history):
            with pytest.raises(SharedError, match="in use by another thread"):
                use()
    finally:
        leave.set()
        stepping.join()
    assert simulation.step == 1


def test_two_threads_that_step_at_once_get_steps_or_a_plain_error(small):
    simulation = small.simulation(1)
    raised = []

    def step():
        for _ in range(30):
            try:
                simulation.advance(1)
                simulation.snapshot()
            except BaseException as error:
                raised.append(error)

    threads = [threading.Thread(target=step) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert {type(error) for error in raised} <= {SharedError}


def changed(problem, **changes):
    state = problem.state | changes
    return type(problem)(problem.settings, state, problem.coefficient_bodies)


def test_arrays_that_convert_exactly_are_taken(small):
    problem = small.build()
    kinds = {"kind": np.int64, "body": np.float64, "id": np.int32, "pressure": np.float32, "position": np.longdouble}
    state = {name: problem.state[name].astype(kind) for name, kind in kinds.items() if name in problem.state}
    state["depth"] = problem.state["depth"].tolist()
    state["velocity"] = np.asfortranarray(problem.state["velocity"])
    one, two = Simulation(problem, 1), Simulation(changed(problem, **state), 1)
    for simulation in (one, two):
        simulation.advance(2)
    assert (one.state()["velocity"] == two.state()["velocity"]).all()


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("kind", lambda kind: kind + 0.5, "array `kind`: must hold whole numbers from 0 to 255"),
        ("kind", lambda kind: kind.astype(int) - 300, "array `kind`: must hold whole numbers from 0 to 255"),
        ("body", lambda body: body.astype(int) + 65536, "array `body`: must hold whole numbers from 0 to 65535"),
        ("kind", lambda kind: kind[:, None], "array `kind`: must have 1 dimensions, and has 2"),
        ("kind", lambda kind: kind.astype(str), "array `kind`: must hold whole numbers"),
        ("position", lambda position: position.astype(str), "array `position`: must hold numbers"),
        ("velocity", lambda velocity: velocity + 1j, "array `velocity`: must hold numbers"),
        ("position", lambda position: None, "array `position`: must hold numbers"),
        ("pressure", lambda pressure: [[1.0], [1.0, 2.0]], "array `pressure`: must hold numbers"),
    ],
)
def test_arrays_that_do_not_are_refused(small, name, change, message):
    problem = small.build()
    with pytest.raises(ConfigError) as error:
        Simulation(changed(problem, **{name: change(problem.state[name])}))
    assert message in str(error.value)


def test_numbers_and_arrays_are_asked_for_in_plain_words(small):
    simulation = small.simulation(1)
    for use, message in (
        (lambda: simulation.advance(1.5), "steps = 1.5: must be a whole number"),
        (lambda: simulation.advance(-3), "steps = -3: must be a whole number, 0 or more"),
        (lambda: small.run("run", progress="no"), "progress = 'no': must be True or False"),
        (lambda: alsph.open_run(3), "run = 3: must be the path of a run folder"),
        (lambda: alsph.cases.find(7), "case = 7: must be the name of a case, or FILE.py:CLASS"),
        (lambda: simulation.run_until("late"), "time = 'late': must be a number"),
        (lambda: simulation.run_until(float("nan")), "time = nan: must be a number"),
        (lambda: next(simulation.steps(every="often")), "every = 'often': must be a number"),
        (lambda: next(simulation.steps(0.1, until="late")), "until = 'late': must be a number"),
        (lambda: simulation.set_inflow("fast"), "array `inflow velocity`: must hold numbers"),
        (lambda: simulation.set_inflow([1.0]), "inflow velocity.*must have 2 components"),
        (lambda: simulation.sample("here"), "array `points`: must hold numbers"),
        (lambda: simulation.sample([1.0, 2.0]), "array `points`: must have 2 dimensions, and has 1"),
        (lambda: small.simulation("2"), "threads = '2': must be a whole number, 1 or more"),
        (lambda: small.simulation(0), "threads = 0: must be a whole number, 1 or more"),
        (lambda: simulation.advance(10**30), "steps = 1000000000000000000000000000000: too large"),
        (lambda: simulation.advance(1, wall_seconds="1"), "wall_seconds = '1': must be a number"),
        (lambda: simulation.advance(1, wall_seconds=float("nan")), "wall_seconds = nan: must be a number"),
        (lambda: simulation.restore(None), r"state = None: must be what `state\(\)` has returned"),
        (lambda: simulation.prescribe(forcing=np.zeros(2)), "forcing = array.*: must be a function of positions"),
        (lambda: simulation.sample(np.ma.masked_less([[0.0, 1.0]], 0.5)), "array `points`: must hold numbers"),
    ):
        with pytest.raises(ConfigError, match=message):
            use()
    for rule, gave in (
        (lambda position, time: "fast", "a str that is none"),
        (lambda position, time: 1j * position, "a ndarray that is none"),
        (lambda position, time: np.ma.masked_less(position, 0.5), "a MaskedArray that is none"),
        (lambda position, time: position[:3], r"an array \(3, 2\)"),
    ):
        simulation.set_inflow(rule)
        with pytest.raises(ConfigError, match=f"inflow: the function must give 2 numbers a position.* and gave {gave}"):
            simulation.advance(1)
    assert small.simulation(np.int64(1)).threads == 1


def test_a_refused_inflow_changes_nothing(small):
    simulation = small.simulation(1)
    simulation.set_inflow(lambda position, time: [0.5, 0.0])
    for refused in ([-1.0, 0.0], [1.0, 0.0, 0.0], np.full((3, 2), 0.5), [np.nan, 0.0]):
        with pytest.raises(ConfigError):
            simulation.set_inflow(refused)
    simulation.advance(1)
    state = simulation.state()
    assert list(simulation.rules) == ["inflow"]
    assert (state["velocity"][state["kind"] == Kind.INLET] == [0.5, 0.0]).all()
    simulation.set_inflow([0.75, 0.0])
    assert not simulation.rules and not simulation.prescribed
