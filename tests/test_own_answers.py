"""What methods of a case of the user's answer: refused before anything is written, or told, never in a traceback."""

import math
import re

import alsph
import numpy as np
import pytest
from alsph import cases
from alsph.analysis.measures import Measure, Profile
from alsph.cases.series import Series
from alsph.errors import ConfigError, SharedError
from alsph.geometry.particles import at_one_place
from alsph.results.judged import NUMBERED, OWN_NAMES
from alsph.study.results import OF_ALL_RUNS, RULE

EMPTY = (np.empty(0), np.empty(0))


class Own(cases.TaylorGreen):
    """Vortices of the user's."""

    name = "own"
    title = "vortices of the user's"


@pytest.fixture
def own(monkeypatch):
    """Return a case, known by its name, whose methods can be changed."""
    monkeypatch.setitem(cases.CASES, "own", Own)

    def make(**methods):
        for name, method in methods.items():
            monkeypatch.setattr(Own, name, method)
        return Own(resolution=8)

    return make


@pytest.fixture
def run(own, tmp_path):
    """Return a function that makes a run of a case with these methods."""

    def make(**methods):
        return own(**methods).run(tmp_path / "run", until=0.03, threads=1, force=True, progress=False)

    return make


@pytest.mark.parametrize("until", [math.nan, 0.0, -1.0, math.inf, "1", None])
def test_an_end_that_is_none_is_refused_before_anything_is_written(own, tmp_path, until):
    case = own(default_until=property(lambda self: until))
    with pytest.raises(ConfigError, match=re.escape(f"Own.default_until = {until!r}: must be a")):
        case.run(tmp_path / "run", progress=False)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("method", "told"),
    [
        ("particles", "Own.particles() gave None: it must return the arrays of particles, position, velocity"),
        ("remarks", "Own.remarks() gave None: it must return a list of texts"),
        ("outputs", "Own.outputs() gave None: it must return a list of Outputs"),
        ("remarks_until", "Own.remarks_until() gave None: it must return a list of texts"),
    ],
)
def test_a_method_that_gives_nothing_is_told_before_anything_is_written(own, tmp_path, method, told):
    case = own(**{method: lambda *_: None})
    with pytest.raises(ConfigError, match=re.escape(told)):
        case.run(tmp_path / "run", until=0.03, progress=False)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("method", ["particles", "remarks", "outputs"])
def test_a_method_that_fails_is_told_with_its_line(own, tmp_path, method):
    case = own(**{method: lambda self: [][1]})
    with pytest.raises(ConfigError, match=rf"Own.{method}\(\) fails, line \d+: IndexError: list index"):
        case.run(tmp_path / "run", until=0.03, progress=False)
    assert not (tmp_path / "run").exists()


def test_arrays_of_particles_are_whole(own):
    state = cases.TaylorGreen(resolution=8).particles()
    with pytest.raises(ConfigError, match=r"Own.particles\(\) gave no array `depth`"):
        own(particles=lambda self: {name: state[name] for name in state if name != "depth"}).build()
    with pytest.raises(ConfigError, match=r"gave an array `pressure` of \(3,\) for \(64,\) particles"):
        own(particles=lambda self: state | {"pressure": np.zeros(3)}).build()


@pytest.mark.parametrize("apart", [0.0, 1e-16])
def test_two_particles_at_one_place_are_refused(own, apart):
    state = cases.TaylorGreen(resolution=8).particles()
    twice = {name: np.concatenate([values, values[5:6]]) for name, values in state.items()}
    twice["position"][-1] += apart
    x, y = state["position"][5]
    told = f"Own.particles() gave two particles at one place, ({x:.6g}, {y:.6g}) [D]: fluid and fluid; leave one out"
    with pytest.raises(ConfigError, match=re.escape(told)):
        own(particles=lambda self: twice).build()
    twice["kind"][-1] = 3
    with pytest.raises(ConfigError, match="fluid and solid"):
        own(particles=lambda self: twice).build()


def test_solids_of_two_faces_may_share_a_place():
    place = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.0]])
    assert not len(at_one_place(place, np.array([False, True, True]), 0.1))
    assert at_one_place(place, np.array([False, False, True]), 0.1).tolist() == [1, 2]


class Odd(Series):
    """Whatever the test says."""

    file = "output_odd.csv"
    interval = 0.01

    def values(self, simulation):
        """Give it."""
        return self.give(simulation)


def odd(give):
    """Return what lets a case have an output that gives that."""

    def outputs(self):
        output = Odd(["time", "number"])
        output.give = give
        return [output]

    return outputs


@pytest.mark.parametrize("given", [None, 1.0, ["a"], [1j], [[1.0]], [[1.0], [1.0, 2.0]]])
def test_values_that_are_none_are_told(run, tmp_path, given):
    with pytest.raises(ConfigError, match=r"output output_odd.csv: values\(\) gave .*: must return an array"):
        run(outputs=odd(lambda simulation: given))
    found = alsph.Run(tmp_path / "run")
    assert found.status == "failed" and "values() gave" in found.info["message"]


def test_values_that_fail_are_told(run, tmp_path):
    with pytest.raises(ConfigError, match=r"output output_odd.csv: Odd fails, .*ZeroDivisionError: division by zero"):
        run(outputs=odd(lambda simulation: [1 / 0]))
    found = alsph.Run(tmp_path / "run")
    assert found.status == "failed" and "ZeroDivisionError" in found.info["message"]


@pytest.mark.parametrize(
    "change",
    [
        lambda simulation: simulation.advance(3),
        lambda simulation: simulation.run_until(1.0),
        lambda simulation: next(simulation.steps(1.0)),
        lambda simulation: simulation.restore(simulation.state()),
        lambda simulation: simulation.prescribe(forcing=lambda position, time: [0.0, 0.0]),
        lambda simulation: simulation.set_inflow([1.0, 0.0]),
    ],
)
def test_an_output_reads_the_simulation_and_leaves_it(run, tmp_path, change):
    with pytest.raises(SharedError, match=r"output output_odd.csv: it steps or changes the simulation of the run"):
        run(outputs=odd(lambda simulation: [change(simulation)]))
    found = alsph.Run(tmp_path / "run")
    assert found.status == "failed" and "it may read it alone" in found.info["message"]
    assert found.info["step"] == 1 and found.times.size == 1


def test_measures_may_be_made_one_by_one(run):
    def measures(self, run):
        yield Measure("one", 1.0)
        yield Measure("two", 2.0)

    def profiles(self, run):
        yield Profile("curve", ("x", "y"), ([0, 1], [0, 1]), EMPTY, "")

    found = run(measures=measures, profiles=profiles, is_steady=True)
    assert [measure.name for measure in found.measures] == ["one", "two"]
    assert [profile.name for profile in found.profiles] == ["curve"] and not found._judged[1]


@pytest.mark.parametrize(
    ("measures", "told"),
    [
        ([("m", "abc")], "value = 'abc': must be a number"),
        ([("m", None)], "value = None: must be a number"),
        ([("m", 1j)], "value = 1j: must be a number"),
        ([("m", np.complex128(1))], "must be a number"),
        ([("m", np.ones(1))], "must be a number"),
        ([("m", 10**400)], "must be a number"),
        ([("m", 1.0, "2")], "measure 'm': reference = '2': must be a number"),
        ([("m", 1.0, 1.0, None)], "measure 'm': tolerance = None: must be a number"),
        ([("m", 1.0, 1.0, 1.0, 5)], "measure 'm': source = 5: must be a text"),
        ([(3, 1.0)], "the name of a measure = 3: must be a text"),
        ([("m", 1.0), ("m", 2.0)], "Own.measures() has 2 of the name 'm'"),
        ([("m", 1.0, 2.0), ("m, reference", 2.0)], "has 2 of the name 'm, reference'"),
        ([("status", 1.0)], "'status': results of a run, or rows of a study, have something of that name"),
        ([("resolution", 1.0)], "'resolution': results of a run"),
        ([("remark 1", 1.0)], "'remark 1': results of a run"),
    ],
)
def test_what_is_wrong_with_measures_is_a_remark(run, measures, told):
    found = run(measures=lambda self, run: [Measure(*given) for given in measures])
    assert found.status == "finished" and found.measures == []
    remark = next(remark for remark in found.summary().values() if str(remark).startswith("no measures: "))
    assert told in remark and remark.endswith("; correct the file that defines it")


def test_numbers_of_numpy_are_measures():
    found = Measure("m", np.float32(1.5), np.int64(2), 1)
    assert (found.value, found.reference, found.tolerance) == (1.5, 2.0, 1.0)
    assert type(found.reference) is float and math.isnan(Measure("m", math.nan).value)


@pytest.mark.parametrize("method", ["measures", "profiles"])
def test_measures_and_profiles_that_fail_are_a_remark(run, method):
    found = run(**{method: lambda self, run: [][1]})
    assert getattr(found, method) == []
    assert any(f"no {method}: Own.{method}() fails, line" in remark for remark in found.remarks)
    assert found.summary()["status"] == "finished"


def test_measures_of_what_a_run_has_not_are_a_remark(run):
    found = run(measures=lambda self, run: [Measure("m", run.to_grid(spacing=-1.0).time)])
    assert any("no measures: Own.measures() fails, spacing = -1.0: must be" in remark for remark in found.remarks)
    found = run(measures=lambda self, run: alsph.Run(run.path / "none").measures)
    assert any("no measures: Own.measures() fails, " in remark and "no such run" in remark for remark in found.remarks)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ((3, ("x", "y"), EMPTY, EMPTY, ""), "the name of a profile = 3"),
        (("p", "xy", EMPTY, EMPTY, ""), "axes = 'xy': must be two texts"),
        (("p", ("x", "y"), None, EMPTY, ""), "computed = None: must be two arrays"),
        (("p", ("x", "y"), ([0, 1], [0]), EMPTY, ""), "must be two arrays of numbers, of one length"),
        (("p", ("x", "y"), EMPTY, (["a"], ["b"]), ""), "reference = "),
        (("p", ("x", "y"), EMPTY, EMPTY, None), "source = None: must be a text"),
    ],
)
def test_what_is_wrong_with_a_profile_is_told(given, told):
    with pytest.raises(ConfigError, match=re.escape(told)):
        Profile(*given)


UNITS = alsph.Units(length=0.1, velocity=1.0, density=1000.0, kinematic_viscosity=1e-3)


@pytest.mark.parametrize("scheme", ["alsph", "wcsph"])
def test_names_that_results_have_are_known(tmp_path, scheme):
    """What a summary or a row of a study has of its own is in the list that measures are held against."""
    names = set()
    for case in (cases.Cylinder(resolution=8, scheme=scheme), cases.TaylorGreen(resolution=8, units=UNITS)):
        run = case.run(tmp_path / case.name, until=0.02, threads=1, progress=False)
        run.measures = []
        names |= {*run.summary()} - {*(run.dimensional() if case.units else ())}
    names |= {*OF_ALL_RUNS, RULE, "status", "time", "seconds", "folder", "remarks", "message"}
    own = {name for name in names if not NUMBERED.fullmatch(name)}
    assert own <= OWN_NAMES, own - OWN_NAMES
