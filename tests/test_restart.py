"""A run folder needs nothing but itself: what rules prescribe, and what the run began with."""

import json
import re
import shutil
import threading

import alsph
import numpy as np
import pytest
from alsph import config
from alsph.cases import CASES, BackwardFacingStep, Cylinder, Domain, TaylorGreen
from alsph.config import Config, RunSettings
from alsph.engine.prescribed import Prescription, backflow, difference, fingerprint
from alsph.errors import ConfigError, RunFolderError, SolverError
from alsph.folder.run_folder import RunFolder
from alsph.geometry.domain import SolidBody
from alsph.geometry.particles import Kind
from alsph.geometry.rigid import Rigid
from alsph.running.beginning import changed, remarks, unlike
from alsph.running.control import Control
from alsph.running.start import complete, resume, start
from alsph.study.declaration import digest
from alsph.study.worker import perform
from processes import bits

SMALL = {"resolution": 8, "length": 5.0, "height": 4.0, "upstream": 2.0}
OUTPUTS = {"output_interval": 0.05, "surface_interval": 0.01}
UNSTABLE = {"time_step": 0.2, "penalty_constant": 100.0, "adaptive_time_step": False}


def pulsation(position, time, strength=0.3):
    """A rule that differs from particle to particle and from step to step."""
    u = 1 + strength * np.sin(20 * time) * np.cos(position[:, 1])
    return np.stack([u, 0 * u], axis=1)


class Pulsing(Cylinder):
    """The rule is the case's."""

    name = "pulsing"
    strength: float = 0.3

    def inflow(self, position, time):
        return pulsation(position, time, self.strength)


class Sheared(Cylinder):
    """A steady one."""

    name = "sheared"

    def inflow(self, position, time):
        return pulsation(position, 0.05)


class Prescribed(Cylinder):
    """The rule is given to the simulation."""

    name = "prescribed"

    def simulation(self, threads=None, initial_run=None):
        simulation = super().simulation(threads, initial_run)
        simulation.set_inflow(pulsation)
        return simulation


class Told(Cylinder):
    """An expression, of the same values."""

    name = "told"
    inlet_velocity: str | None = "1 + 0.3*sin(20*t)*cos(y), 0"


class Driven(Pulsing):
    """A body force and a sliding surface, too."""

    name = "driven"

    def forcing(self, position, time):
        return 0.5 * pulsation(position, time)

    def sliding(self, position, time):
        x, y = (position - self.centre).T
        return np.cos(10 * time) * np.stack([-y, x], axis=1)


class Turning(Told):
    """The same by expressions."""

    name = "turning"
    driving_force: str | None = "0.5*(1 + 0.3*sin(20*t)*cos(y)), 0"
    surface_velocity: str | None = "-y*cos(10*t), (x - upstream)*cos(10*t)"


class Swinging(Told):
    """A body that moves as it is told, too."""

    name = "swinging"
    body_motion: str | None = "0.05*sin(20*t), 0.1*t, 0.3*sin(10*t)"


class Free(Told):
    """A body that the fluid moves, on springs."""

    name = "free"

    def bodies(self):
        rigid = Rigid(0.5, 0.1, displaced=0.785, stiffness=(5, 5))
        return [SolidBody("cylinder", tuple(self.centre), rigid=rigid)]


class Constant(Cylinder):
    """An array, which the particles keep and hand on."""

    name = "constant"

    def simulation(self, threads=None, initial_run=None):
        simulation = super().simulation(threads, initial_run)
        simulation.set_inflow(pulsation(simulation.inflow_position(), 0.05))
        return simulation


def expected(case, position, time):
    """Return the velocity of inlet particles after a step from that time on."""
    if isinstance(case, Pulsing | Prescribed | Told):
        return pulsation(position, time)
    return pulsation(position, 0.05 if isinstance(case, Sheared | Constant) else 0.0)


def assert_inflow(path, case):
    """The inlet's particles have the velocities that the rule gave before the last step."""
    state, times = RunFolder(path).read_checkpoint().state, alsph.Run(path).history["time"]
    inlet = state["kind"] == Kind.INLET
    known = expected(case, state["position"][inlet], times[-2])
    assert state["velocity"][inlet] == pytest.approx(known, abs=1e-8)


ALL = Sheared, Constant, Pulsing, Prescribed, Told, Driven, Turning, Swinging, Free


@pytest.fixture(params=[Cylinder, *ALL], ids=lambda model: model.__name__)
def case(request, monkeypatch):
    for model in ALL:
        monkeypatch.setitem(CASES, model.name, model)
    return request.param(**SMALL)


@pytest.fixture
def whole(case, tmp_path):
    """The bits of a run of the case that nothing befell."""
    path = case.run(tmp_path / "whole", until=0.2, progress=False, **OUTPUTS).path
    assert_inflow(path, case)
    return bits(path)


def test_a_cut_run_goes_on_with_its_inflow(case, whole, tmp_path):
    path = case.run(tmp_path / "run", until=0.1, progress=False, **OUTPUTS).path
    resume(path, until=0.2, progress=False)
    assert bits(path) == whole
    assert alsph.repeat(path, progress=False).same


def test_a_study_goes_on_with_the_inflow_of_a_case(case, whole, tmp_path):
    """A run that stopped before its first step, and at its end, too."""
    tables, path = Config(case, RunSettings(until=0.2, **OUTPUTS)).tables(), tmp_path / "run"
    stop = threading.Event()
    stop.set()
    with pytest.raises(KeyboardInterrupt):
        start(config.from_tables(tables), path, Control(progress=False, stop=stop))
    assert RunFolder(path).info()["step"] == 0
    for _ in range(2):
        assert perform(tables, str(path)) == "finished"
        assert bits(path) == whole
    assert RunFolder(path).info()["segments"][0]["step"] == 0


@pytest.mark.filterwarnings("ignore:.*expect divergence")
def test_a_run_goes_back_with_its_inflow(case, tmp_path):
    unstable = Config(case.replace(**UNSTABLE), RunSettings(until=0.2, **OUTPUTS))
    path = start(unstable, tmp_path / "run", Control(progress=False, retry=5)).path
    assert RunFolder(path).info()["retries"]
    assert_inflow(path, case)
    assert alsph.repeat(path, progress=False).same


def test_a_run_that_was_changed_on_its_way_and_back_says_so_and_has_no_reference(tmp_path):
    """A change of the method, or of units, takes it no reference."""
    path = TaylorGreen(resolution=10).run(tmp_path / "run", until=0.1, progress=False).path
    settings, plain = path / "case.toml", (path / "case.toml").read_text()
    whole = shutil.copytree(path, tmp_path / "whole")
    resume(whole, until=0.3, progress=False)
    for until, text in ((0.2, re.sub("courant = .*", "courant = 0.1", plain)), (0.3, plain)):
        settings.write_text(text)
        with pytest.warns(RuntimeWarning, match="goes on with other settings"):
            run = resume(path, until=until, progress=False)
    told = r"changed on the way: at tU/D = 0\.1\d* courant 0\.3 -> 0\.1; at tU/D = 0\.2\d* courant 0\.1 -> 0\.3; av"
    assert re.match(told, run.remarks[0]) and run.measures[0].reference > 0
    assert not any("changed" in remark for remark in alsph.open_run(whole).remarks)
    for until, text in ((0.4, re.sub("reynolds = .*", "reynolds = 50.0", plain)), (0.5, plain)):
        settings.write_text(text)
        with pytest.warns(RuntimeWarning, match="goes on with other settings"):
            run = resume(path, until=until, progress=False)
    assert "reynolds 50.0 -> 100.0" in run.remarks[0] and np.isnan(run.measures[0].reference)
    compared = alsph.compare([whole, path])
    assert [name for name in compared.parameters if name.startswith("reynolds, changed at tU/D = 0.4")]


def test_tools_take_the_inflow_of_a_case(case):
    """As describe and autotune make their simulations."""
    simulation = case.restored(case.build().state)
    simulation.advance(2)
    state, time = simulation.snapshot(), simulation.history()["time"][0]
    inlet = state["kind"] == Kind.INLET
    known = expected(case, state["position"][inlet], time)
    if not isinstance(case, Constant):  # which is part of its start, not of its state
        assert state["velocity"][inlet] == pytest.approx(known, abs=1e-8)


# A rule that is lost, or another one


def forget(monkeypatch, model):
    """Let the case of that name be a plain cylinder, as in a process that has not seen the class."""

    class Plain(Cylinder):
        name = model.name

    Plain.__qualname__ = model.__qualname__
    monkeypatch.setitem(CASES, model.name, Plain)


@pytest.mark.parametrize("model", [Prescribed, Sheared])
def test_a_run_does_not_go_on_without_its_inflow(monkeypatch, tmp_path, model):
    monkeypatch.setitem(CASES, model.name, model)
    settings = Config(model(**SMALL), RunSettings(until=0.05))
    path = start(settings, tmp_path / "run", Control(progress=False)).path
    before = bits(path)
    forget(monkeypatch, model)
    with pytest.raises(RunFolderError, match="a function prescribes the inflow of the run, and its case does not tell"):
        resume(path, until=0.1, progress=False)
    with pytest.raises(RunFolderError, match="cannot be repeated because a function prescribes its inflow"):
        alsph.repeat(path, progress=False)
    assert bits(path) == before
    (path / "run.json").unlink()
    with pytest.raises(RunFolderError, match="a function prescribes the inflow"):
        resume(path, until=0.1, progress=False)


@pytest.mark.parametrize(("rule", "what"), [("forcing", "body force"), ("sliding", "velocity of surfaces")])
def test_a_body_force_and_sliding_surfaces_are_not_lost_either(monkeypatch, tmp_path, rule, what):
    monkeypatch.setitem(CASES, Driven.name, Driven)
    path = Driven(**SMALL).run(tmp_path / "run", until=0.05, progress=False).path
    monkeypatch.setattr(Driven, rule, lambda self, position, time: [0.1, 0.0])
    with pytest.warns(RuntimeWarning, match=f"goes on with another {what}: at t.* its values differ by up to"):
        resume(path, until=0.06, progress=False)
    monkeypatch.setattr(Driven, rule, getattr(Cylinder, rule))
    with pytest.raises(RunFolderError, match=f"prescribes the {what} of the run.* make it the method `{rule}`"):
        resume(path, until=0.1, progress=False)
    with pytest.raises(RunFolderError, match=f"cannot be repeated because a function prescribes its {what}"):
        alsph.repeat(path, progress=False)


def test_another_inflow_is_told(monkeypatch, tmp_path):
    monkeypatch.setitem(CASES, Prescribed.name, Prescribed)
    case, path = Prescribed(**SMALL), tmp_path / "run"
    case.run(path, until=0.05, progress=False)
    settings, before = Config(case, RunSettings(until=0.05)), bits(path)
    complete(settings, path, Control(progress=False))
    assert bits(path) == before

    monkeypatch.setitem(globals(), "pulsation", lambda position, time: (1.2 + 0 * position[:, :1]) * [1.0, 0.0])
    repetition = alsph.repeat(path, progress=False)
    assert not repetition.same and "another inflow: at t* = 0.0" in str(repetition)
    with pytest.warns(RuntimeWarning, match="goes on with another inflow: at t.* differ by up to 0.2"):
        resume(path, until=0.06, progress=False)
    complete(settings, path, Control(progress=False))  # runs it anew
    assert not RunFolder(path).read_checkpoint().warning
    assert bits(path)["history"] != before["history"]
    assert alsph.repeat(path, progress=False).same


def test_a_class_that_is_not_known_by_its_name_is_told_and_not_resumed(tmp_path):
    class Heated(Cylinder):
        """Without a name of its own."""

        def particles(self):
            arrays = super().particles()
            arrays["velocity"] *= 0.5
            return arrays

    with pytest.warns(RuntimeWarning, match="Heated does not stand in alsph.cases.CASES under its name 'cylinder'"):
        path = Heated(**SMALL).run(tmp_path / "run", until=0.05, progress=False).path
    assert "does not stand in alsph.cases.CASES" in (path / "run.log").read_text()
    for call in (lambda: resume(path, until=0.1, progress=False), lambda: alsph.repeat(path, progress=False)):
        with pytest.raises(RunFolderError, match="Heated, and 'cylinder' stands for Cylinder"):
            call()
    before = bits(path)
    complete(Config(Cylinder(**SMALL), RunSettings(until=0.05)), path, Control(progress=False))
    assert bits(path)["history"] != before["history"]


def test_a_case_that_is_not_known_is_told_how_to_make_known(tmp_path):
    with pytest.warns(RuntimeWarning, match="does not know it"):
        path = Pulsing(**SMALL).run(tmp_path / "run", until=0.02, progress=False).path
    with pytest.raises(RunFolderError, match="an entry point of its package, or put into alsph.cases.CASES before"):
        resume(path, progress=False)


def test_an_inflow_is_part_of_what_studies_compare(monkeypatch):
    case = Pulsing(**SMALL)
    first = digest(Config(case))
    assert digest(Config(Pulsing(**SMALL))) == first
    assert digest(Config(case.replace(strength=0.2))) != first
    monkeypatch.setattr(Pulsing, "inflow", lambda self, position, time: pulsation(position, 1.001 * time))
    assert digest(Config(case)) != first
    assert fingerprint("inflow", lambda position, time: None, case.domain(), 1.0)
    driven = Driven(**SMALL)
    first = digest(Config(driven))
    monkeypatch.setattr(Driven, "forcing", lambda self, position, time: 0.501 * pulsation(position, time))
    assert digest(Config(driven)) != first
    cylinder = Cylinder(**SMALL)
    turning = [digest(Config(cylinder.replace(surface_velocity=f"-{speed}*y, x - 2"))) for speed in (1, 1, 2)]
    assert turning[0] == turning[1] != turning[2] and digest(Config(cylinder)) not in turning


@pytest.mark.parametrize("velocity", ["fast", [1.0, 0.0, 0.0], np.ones((3, 2))], ids=["text", "3-D", "rows"])
def test_a_rule_that_gives_no_velocities_is_told_so_wherever_it_is_asked(small, velocity):
    then = Prescription(0.1, np.zeros((5, 2)), np.ones((5, 2)))
    with pytest.raises(ConfigError, match="inflow: the function must give 2 numbers"):
        difference({"inflow": lambda position, time: velocity}, {"inflow": then})
    with pytest.raises(ConfigError, match="inflow: the function must give 2 numbers"):
        fingerprint("inflow", lambda position, time: velocity, small.domain(), 1.0)
    for name in ("forcing", "sliding"):
        with pytest.raises(ConfigError, match=f"{name}: the function must give 2 numbers"):
            fingerprint(name, lambda position, time: None, small.domain(), 1.0)


def test_a_rule_that_fails_is_told_with_its_line(small):
    def inflow(position, time):
        return [1.0, 0.0] if time == 0 else position / "2"

    simulation = small.simulation(threads=1)
    simulation.set_inflow(inflow)
    line = inflow.__code__.co_firstlineno + 1
    with pytest.raises(TypeError) as raised:
        simulation.advance(3)
    told = rf"inflow: the function failed at t\* = 0\.\d+: .*test_restart.py: line {line}: TypeError"
    assert re.match(told, raised.value.__notes__[0]), raised.value.__notes__
    with pytest.raises(ConfigError, match=r"test_restart.py: line \d+: forcing: the function must give 2 numbers"):
        fingerprint("forcing", lambda position, time: None, small.domain(), 1.0)


def test_checkpoints_without_a_rule_are_as_before(tmp_path, small):
    """And those of an older alsph, which had none, go on."""
    path = small.run(tmp_path / "run", until=0.05, progress=False).path
    assert RunFolder(path).read_checkpoint().prescribed == {}
    assert difference({}, {}) == ""
    info = RunFolder(path).info()
    for name in ("start", "case_class", "rules"):
        del info[name]
    (path / "run.json").write_text(json.dumps(info))
    assert alsph.repeat(path, progress=False).same
    resume(path, until=0.1, progress=False)
    assert "start" not in RunFolder(path).info()
    assert alsph.repeat(path, progress=False).same


# Backflow


@pytest.mark.parametrize("inflow", [[-0.5, 0.0], lambda position, time: [-0.5, 0.0]])
def test_an_inflow_out_of_the_domain_is_refused_at_once(small, inflow):
    simulation = small.simulation()
    with pytest.raises(ConfigError, match="backflow, the mean velocity through the inlet x = 0 at t.* is 0.5 U out of"):
        simulation.set_inflow(inflow)
        simulation.advance(1)
    assert simulation.step == 0


def test_a_start_with_an_inflow_out_of_the_domain_is_refused(small):
    state = small.particles()
    state["velocity"][state["kind"] == Kind.INLET] *= -1
    with pytest.raises(ConfigError, match="backflow"):
        alsph.Simulation(small.problem(state))


def test_an_inflow_that_turns_round_ends_the_run(monkeypatch, tmp_path):
    monkeypatch.setattr(Pulsing, "inflow", lambda self, position, time: [1.0 if time < 0.1 else -0.1, 0.0])
    monkeypatch.setitem(CASES, Pulsing.name, Pulsing)
    with pytest.raises(ConfigError, match=r"backflow.* t\* = 0\.1"):
        Pulsing(**SMALL).run(tmp_path / "run", until=0.5, progress=False)
    assert "backflow" in RunFolder(tmp_path / "run").info()["message"]
    monkeypatch.setattr(Pulsing, "inflow", lambda self, x, time: np.stack([1.5 - np.abs(x[:, 1]), 0 * x[:, 1]], axis=1))
    with pytest.warns(RuntimeWarning, match="backflow through the inlet"):
        Pulsing(**SMALL).run(tmp_path / "other", until=0.02, progress=False)
    assert (tmp_path / "other" / "run.log").read_text().count("warning: inflow: backflow through the inlet") == 1


def test_backflow_in_places_is_warned_of_once(small):
    def inflow(position, time):
        u = 1 - 1.3 * np.exp(-(((np.abs(position[:, 1]) - 2) / 0.2) ** 2))
        return np.stack([u, 0 * u], axis=1)

    simulation = small.simulation()
    simulation.set_inflow(inflow)
    with pytest.warns(RuntimeWarning, match="backflow through the inlet x = 0 .*: 16 of 256 particles") as warned:
        simulation.advance(3)
    assert len(warned) == 1 and simulation.backflow


def test_a_breakdown_after_backflow_tells_of_it(small):
    simulation = small.simulation()
    with pytest.warns(RuntimeWarning, match="backflow"):
        simulation.set_inflow(lambda position, time: [[1e9, 0]] + [[-5.0, 0]] * (len(position) - 1))
        with pytest.raises(SolverError, match="diverged.*; before, inflow: backflow"):
            simulation.advance(2)


def test_backflow_is_judged_at_each_inlet():
    """Two inlets that face each other, and a domain without any."""
    domain = Domain((0, -1), (2, 1), [("inlet", "inlet"), ("outlet", "outlet")])
    position = np.array([[-0.1, 0.0], [2.1, 0.0]])
    assert backflow(domain, position, np.array([[1.0, 0.0], [-1.0, 0.0]]), 0.0) == ""
    with pytest.raises(ConfigError, match="inlet x = 2 "):
        backflow(domain, position, np.array([[1.0, 0.0], [1.0, 0.0]]), 0.0)
    assert backflow(Domain((0, -1), (2, 1), [("slip", "slip")] * 2), position, -position, 0.0) == ""
    assert backflow(domain, position, 0 * position, 0.0) == ""


@pytest.mark.parametrize("nonsense", ["fast", [[1.0], [1.0, 2.0]], [np.nan, 0.0], np.zeros((3, 2))])
def test_an_inflow_that_is_no_velocity_is_refused(small, nonsense):
    simulation = small.simulation()
    for inflow in (nonsense, lambda position, time: nonsense):
        with pytest.raises(ConfigError, match="inflow"):
            simulation.set_inflow(inflow)
            simulation.advance(1)


# What a run began with


STEP = {"resolution": 8, "upstream": 1.0, "downstream": 3.0}


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """A run over a step that others begin with."""
    path = tmp_path_factory.mktemp("source") / "run"
    return BackwardFacingStep(**STEP).run(path, until=0.2, progress=False)


def flux(state):
    """Return the sum of the inlet particles' velocities."""
    return state["velocity"][state["kind"] == Kind.INLET].sum(axis=0)


@pytest.mark.parametrize(
    ("change", "other"),
    [
        ({"reynolds": 200.0}, None),
        ({"resolution": 16}, None),
        ({"kernel": "wendland_c4"}, None),
        ({"expansion": 3.0}, r"expansion = 2.0 \(here 3.0\)"),
        ({"expansion": 1.5}, "expansion"),
        ({"upstream": 2.0}, "upstream"),
        ({"upstream": 2.0, "downstream": 2.0}, "upstream = .*; downstream = "),
    ],
)
def test_the_inflow_stays_that_of_the_case(source, change, other, recwarn):
    case = BackwardFacingStep(**STEP | change)
    begun = case.simulation(initial_run=source.path).state()
    warned = [str(warning.message) for warning in recwarn if "initial_run" in str(warning.message)]
    own = case.simulation().state()
    assert np.array_equal(flux(begun), flux(own))
    if other is None:
        assert not warned
    else:
        assert len(warned) == 1
        assert re.search(other, warned[0])
        outlet = own["kind"] == Kind.OUTLET
        assert np.array_equal(begun["velocity"][outlet], own["velocity"][outlet])
    assert not np.array_equal(begun["velocity"], own["velocity"])


def test_a_channel_keeps_its_inflow_and_lets_out_as_much(tmp_path, small):
    initial = small.replace(height=6.0, upstream=3.0, length=6.0).run(tmp_path / "other", until=0.2, progress=False)
    with pytest.warns(RuntimeWarning, match="initial_run = .*: is of another flow than this one, length = 6.0"):
        path = small.run(tmp_path / "run", until=0.1, initial_run=str(initial.path), progress=False).path
    assert "warning: initial_run = " in (path / "run.log").read_text()
    state = RunFolder(path).read_start()
    assert (state["velocity"][state["kind"] == Kind.INLET] == [1.0, 0.0]).all()
    state = RunFolder(path).read_checkpoint().state
    assert (state["velocity"][state["kind"] == Kind.INLET] == [1.0, 0.0]).all()


def test_runs_that_are_no_good_beginning_are_told(tmp_path, small, source):
    run = small.run(tmp_path / "run", until=0.05, progress=False)
    assert remarks(small.replace(perturbation=0.0, reynolds=10.0), run) == []
    assert "its case is backward_facing_step" in remarks(small, source)[0]
    for status in ("diverged", "interrupted", "running", "failed"):
        (run.path / "run.json").write_text(json.dumps(run.info | {"status": status}))
        (remark,) = remarks(small, alsph.Run(run.path))
        told = "stopped" if status == "running" else status  # no process is at work in it
        assert f"has not finished, it is {told} at t* = 0.0" in remark
    with pytest.raises(ConfigError, match="it is in 2-D and this case in 3-D"):
        TaylorGreen(resolution=8, dimensions=3).simulation(initial_run=source.path)
    assert unlike(TaylorGreen(seed=3), alsph.Run(run.path)) == ["its case is cylinder"]


@pytest.fixture
def begun(tmp_path, small):
    """A run that began with the flow of another one, which is gone."""
    initial = small.run(tmp_path / "initial", until=0.1, progress=False)
    case = small.replace(resolution=10, reynolds=100.0)
    run = case.run(tmp_path / "run", until=0.05, initial_run=str(initial.path), progress=False)
    shutil.rmtree(initial.path)
    return run.path


def test_a_run_that_began_with_another_one_needs_nothing_but_its_folder(begun, tmp_path):
    moved = shutil.move(begun, tmp_path / "moved")
    assert alsph.repeat(moved, progress=False).same
    resume(moved, until=0.1, progress=False)
    assert alsph.repeat(moved, progress=False).same


def test_a_run_without_its_beginning_says_why_it_is_not_repeated(begun):
    (begun / "start.h5").write_bytes((begun / "start.h5").read_bytes()[:-9])
    with pytest.raises(RunFolderError, match="cannot be repeated because the flow that it began with is damaged"):
        alsph.repeat(begun, progress=False)
    (begun / "start.h5").unlink()
    text = (begun / "case.toml").read_text()
    (begun / "case.toml").write_text("".join(line for line in text.splitlines(True) if "initial_run" not in line))
    with pytest.raises(RunFolderError, match="cannot be repeated because it began with the flow of another run"):
        alsph.repeat(begun, progress=False)
    with pytest.warns(RuntimeWarning, match="initial_run = None has no effect: the run has begun with '.*initial'"):
        resume(begun, until=0.06, progress=False)


@pytest.mark.parametrize("path", ["initial", "initial/", "./initial"])
def test_the_path_of_a_beginning_is_the_same_however_it_is_written_and_wherever_one_stands(tmp_path, monkeypatch, path):
    folder = RunFolder(tmp_path / "run")
    folder.path.mkdir()
    Config(TaylorGreen(resolution=8), RunSettings(initial_run=path)).save(folder.path / "case.toml")
    info = {"start": {"initial_run": path}}
    assert config.of_run(folder.path).run.initial_run == path and changed(config.of_run(folder.path), info) == []
    (tmp_path / "initial").mkdir()
    monkeypatch.chdir(tmp_path)
    assert changed(config.of_run(folder.path), info) == []
    assert changed(config.of_run(folder.path), {"start": {"initial_run": "other"}})


def test_a_run_may_take_the_place_of_the_one_that_it_begins_with(tmp_path, small):
    path = small.run(tmp_path / "run", until=0.05, progress=False).path
    last = alsph.Run(path).snapshot()
    small.run(path, until=0.05, initial_run=str(path), force=True, progress=False)
    begun = alsph.Run(path).snapshot(0.0)
    assert np.abs(begun.velocity).max() == pytest.approx(np.abs(last.velocity).max(), rel=0.1)
    assert alsph.repeat(path, progress=False).same


def test_a_case_that_starts_otherwise_is_told(tmp_path, small, monkeypatch):
    path = small.run(tmp_path / "run", until=0.05, progress=False).path
    particles = Cylinder.particles

    def moved(self):
        arrays = particles(self)
        arrays["position"][0, 1] = np.nextafter(arrays["position"][0, 1], 1)
        return arrays

    monkeypatch.setattr(Cylinder, "particles", moved)
    repetition = alsph.repeat(path, progress=False)
    assert not repetition.same and repetition.steps == 0
    assert "the particles at the start are not those that the run began with" in str(repetition)


def test_the_beginning_is_part_of_what_studies_compare(tmp_path, small):
    """By its content: not by the path, under which there may be another run."""
    first, path = small.run(tmp_path / "initial", until=0.05, progress=False).path, tmp_path / "run"
    settings = Config(small, RunSettings(until=0.05, initial_run=str(first)))
    complete(settings, path, Control(progress=False))
    known, before = digest(settings), (path / "run.json").read_bytes()
    moved = Config(small, RunSettings(until=0.05, initial_run=shutil.copytree(first, tmp_path / "copy").as_posix()))
    assert digest(moved) == known != digest(Config(small, RunSettings(until=0.05)))
    complete(moved, path, Control(progress=False))
    assert (path / "run.json").read_bytes() == before  # nothing was to be done

    resume(first, until=0.1, progress=False)
    assert digest(settings) != known
    complete(settings, path, Control(progress=False))
    assert RunFolder(path).info()["start"] != json.loads(before)["start"]
    shutil.rmtree(first)
    before = (path / "run.json").read_bytes()
    complete(settings, path, Control(progress=False))
    assert (path / "run.json").read_bytes() == before
    with pytest.raises(RunFolderError, match="no such run folder"):
        digest(settings)
    complete(Config(small, RunSettings(until=0.05)), path, Control(progress=False))
    assert "flow_sha256" not in RunFolder(path).info()["start"] and not (path / "start.h5").exists()
