"""Runs that end when they have converged: what they are judged by, when, and whatever cuts them."""

import json
import re
from dataclasses import replace

import alsph as package
import numpy as np
import pytest
from alsph import config
from alsph.analysis.averages import Estimate
from alsph.analysis.window import Window
from alsph.cases import Cylinder, DamBreak, Sphere, TaylorGreen
from alsph.cases.channel import Channel
from alsph.config import Config, RunSettings, overridden
from alsph.errors import ConfigError, WalltimeError
from alsph.folder.run_folder import RunFolder
from alsph.results.ending import Judgement, judge, next_judgement
from alsph.running import driver
from alsph.running.control import Control
from alsph.running.progress import Reporter
from alsph.running.start import complete, resume, start
from alsph.study.declaration import Study, Sweep, digest
from battery import SETTLED, STROUHAL, autoregressive, judgements, quiet, record, shedding, transient
from processes import bits

CONVERGED = Config(Cylinder(), RunSettings(until="converged"))


def ended(signal, of=CONVERGED):
    """Return when and with what judgement a run with such a signal ends, and those before."""
    found = judgements(signal, of)
    return *found[-1], found[:-1]


def wake(spread=0.0, strength=lambda time: 1.0, drift=0.0):
    """Return shedding with drag that wanders from period to period, over a drift of a straight line."""

    def signal(rng, time):
        drag, lift = shedding(time, strength(time))
        return SETTLED + transient(time) + drag + autoregressive(rng, time, 0.0, spread) + drift * time, lift

    return signal


# When it is judged


def test_judgements_are_at_the_same_times_from_wherever_one_asks():
    found, time = [0.0], 0.0
    while time < 300:
        time = next_judgement(time)
        found.append(time)
    assert found[:4] == [0, 2, 4, 6] and found[32:35] == [64, 68, 72] and found[48:51] == [128, 136, 144]
    rng = np.random.default_rng(0)
    for time in rng.uniform(0, 300, 200):
        assert next_judgement(time) == min(each for each in found if each > time)
    assert next_judgement(63.99999999999999) == 64


# What it is judged by


def test_shedding_that_is_known_well_enough_ends_a_run():
    time, found, before = ended(wake())
    assert found.ended == "converged" and not found.missing and list(found.averages) == ["C_D'", "C_L'", "Sr"]
    assert found.averages["C_D'"] == pytest.approx(SETTLED, abs=0.003)
    assert found.averages["Sr"] == pytest.approx(STROUHAL, rel=1e-3)
    assert 40 <= time <= 50  # eight periods of five, and the transient
    assert re.fullmatch(
        rf"converged: ended after [89] shedding periods, tU/D = {time:.0f}(\.\d+)?; "
        r"C_D' 1\.\d+( ± 0\.\d+)?, C_L' 0\.\d+( ± 0\.\d+)?, Sr 0\.\d+( ± 0\.\d+)?",
        found.remark,
    )
    assert [judgement.ended for _, judgement in before] == [""] * len(before)
    assert "few periods: averaged over 7 of shedding" in before[-1][1].missing
    assert before[-1][1].end == pytest.approx(12 / STROUHAL + before[-1][0] - 35, abs=10)


def test_what_is_missing_is_told_with_its_limit():
    _, found, before = ended(wake(spread=0.05))
    assert found.ended == "periods" and found.remark.startswith("not converged: ended after 1")
    assert re.search(r"; missing: C_D' ± \d+(\.\d+)? % \(limit 0.3 %\)$", found.remark)
    assert any("C_D' ± unknown (limit 0.3 %)" in str(judgement) for _, judgement in before)
    few = replace(found, averages={"C_D'": Estimate(1.5, 0.003, "still developing")}, missing=[])
    assert str(few) == "C_D' 1.5000 ± 0.0030"


def test_the_uncertainty_asked_for_is_what_counts():
    loose = Config(Cylinder(), RunSettings(until="converged", uncertainty=0.05))
    assert ended(wake(spread=0.05), loose)[1].ended == "converged"
    swaying = wake(strength=lambda time: 1 + 0.05 * np.sin(2 * np.pi * time / 17))
    strict = Config(Cylinder(), RunSettings(until="converged", uncertainty=0.001))
    found = ended(swaying, strict)[1]
    assert found.ended == "periods" and any(
        text.startswith("C_L' ± ") and "(limit 0.333 %)" in text for text in found.missing
    )


def test_a_flow_that_develops_goes_on_to_its_latest_time():
    time, found, _ = ended(wake(drift=-0.002))
    assert (time, found.ended) == (180.0, "latest") and found.end == 180.0
    assert found.remark.startswith("not converged: ended at its latest time after ")
    assert "missing: still developing: drag changes by -" in found.remark
    short = Config(Cylinder(), RunSettings(until="converged", latest=15.5))
    time, found, _ = ended(wake(), short)
    assert (time, found.ended) == (15.5, "latest")


def test_steady_flow_is_believed_when_shedding_could_have_begun():
    time, found, before = ended(quiet)
    assert (time, found.ended, list(found.averages)) == (60.0, "converged", ["C_D'"])
    assert found.remark.startswith("converged: ended without shedding, tU/D = 60; C_D' 1.")
    assert found.averages["C_D'"] == pytest.approx(SETTLED, abs=0.001)
    assert before[-1][1].missing == ["shedding, which may begin until tU/D = 60"]


@pytest.mark.parametrize(
    ("window", "missing"),
    [
        (Window(np.linspace(10, 60, 11), 10, True, "periodic"), []),
        (Window(np.linspace(10, 60, 11), 10, False, "none yet"), ["not settled: none yet"]),
        (Window(np.linspace(10, 45, 8), 7, True, "periodic"), ["few periods: averaged over 7 of shedding"]),
        (Window(np.linspace(10, 50, 9), 8, True, "periodic"), []),
        (
            Window(np.linspace(10, 60, 11), 10, True, "still developing (drag falls); periodic"),
            ["still developing: drag falls"],
        ),
    ],
)
def test_a_window_with_a_remark_is_not_converged(window, missing):
    run = record(*[np.linspace(0, 61, 100)] * 3, CONVERGED)
    run.window, run.averaged = window, {"C_D'": Estimate(1.5, 0.0045), "Sr": Estimate(0.2, 0.0001)}
    found = judge(run, CONVERGED)
    assert (found.missing, found.ended) == (missing, "" if missing else "converged")


@pytest.mark.parametrize(
    ("estimate", "missing"),
    [
        (Estimate(1.5, 0.00449), []),
        (Estimate(1.5, 0.00451), ["C_D' ± 0.301 % (limit 0.3 %)"]),
        (Estimate(-1.5, 0.00449), []),
        (Estimate(0.0, 0.1), ["C_D' ± unknown (limit 0.3 %)"]),
        (Estimate(1.5, np.inf), ["C_D' ± unknown (limit 0.3 %)"]),
        (Estimate(np.nan), ["C_D' ± unknown (limit 0.3 %)"]),
        (Estimate(1.5, 0.003, "still developing (it falls)"), ["C_D' ± 0.2 % (limit 0.3 %)"]),
    ],
)
def test_the_share_of_an_average_counts(estimate, missing):
    run = record(*[np.linspace(0, 61, 100)] * 3, CONVERGED)
    run.window = Window(np.linspace(10, 60, 11), 10, True, "periodic")
    run.averaged = {"C_D'": estimate, "C_L'": Estimate(0.5, 0.0049), "Sr": Estimate(0.2, 0.0001)}
    assert judge(run, CONVERGED).missing == missing


# How it is asked for


def test_settings_of_a_run_that_converges():
    found = Config(Cylinder(), RunSettings(until="converged"))
    assert (found.converges, found.until, found.uncertainty) == (True, 180.0, 0.003)
    assert found.ending == {"until": "converged", "uncertainty": 0.003, "latest": 180.0}
    loaded = config.from_tables(found.tables())
    assert loaded.tables() == found.tables() and loaded.ending == found.ending
    assert Config(Sphere(), RunSettings(until="converged", latest=20.0)).until == 20.0


def test_a_run_with_an_end_time_is_known_by_the_same_hash_as_before():
    for case in (Cylinder(), TaylorGreen()):
        found = Config(case, RunSettings(until=7.5))
        assert set(found.tables()["run"]) == {
            "until",
            "output_interval",
            "surface_interval",
            "checkpoint_minutes",
            "flush_seconds",
        }
    hashes = {digest(Config(Cylinder(), RunSettings(until="converged", uncertainty=u))) for u in (None, 0.003, 0.01)}
    assert len(hashes) == 2  # the default written out is the same run
    assert digest(Config(Cylinder(), RunSettings(until=180.0))) not in hashes


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"until": "convergd"}, "until = 'convergd': must be a time, without quotes, or \"converged\""),
        ({"until": "60"}, "until = '60': must be a time, without quotes"),
        ({"until": [1.0]}, r"until = \[1.0\]: must be a number"),
        ({"until": 0.0}, "until = 0.0: must be greater than 0"),
        ({"until": 5.0, "uncertainty": 0.01}, 'uncertainty = 0.01: goes with until = "converged"; say that too'),
        ({"latest": 50.0}, 'latest = 50: goes with until = "converged"'),
        ({"until": "converged", "uncertainty": 0.0}, "uncertainty = 0.0: must be greater than 0"),
        ({"until": "converged", "latest": -1.0}, "latest = -1.0: must be greater than 0"),
    ],
)
def test_settings_without_sense_are_refused(settings, message):
    with pytest.raises(ConfigError, match=f"^{message}"):
        RunSettings(**settings)


@pytest.mark.parametrize("case", [TaylorGreen(), DamBreak()])
def test_a_case_without_averages_cannot_converge(case, tmp_path, alsph):
    told = f'run.until = "converged": {case.name} has no body in a stream, whose drag, lift and shedding'
    with pytest.raises(ConfigError, match=told):
        case.run(tmp_path / "run", until="converged", progress=False)
    for command in ("run", "describe", "converge"):
        code, _, stderr = alsph(command, case.name, "--until", "converged")
        assert code == 2 and told in stderr and "give an end time, as until = " in stderr
    assert not (tmp_path / "run").exists()


def test_an_end_time_takes_the_place_of_what_goes_with_converged():
    settings = RunSettings(until="converged", uncertainty=0.01, latest=50.0, threads=1)
    assert settings.replace(until=5.0) == RunSettings(until=5.0, threads=1)
    assert settings.replace(threads=2).uncertainty == 0.01
    tables = {"case": "cylinder", "run": {"until": "converged", "uncertainty": 0.01, "latest": 50.0}}
    assert overridden(tables, {"until": 5.0})["run"] == {"until": 5.0}
    assert overridden(tables, {"until": "converged"})["run"] == tables["run"]


def test_the_command_line_takes_a_time_or_the_word(alsph, tmp_path, small_options):
    path = tmp_path / "run"
    options = [*small_options, "--until", "converged", "--latest", "0.1", "-o", path]
    code, output, _ = alsph("run", "cylinder", *options)
    assert code == 0 and "not converged: ended at its latest time without shedding, tU/D = 0.1" in output
    code, output, _ = alsph("describe", "cylinder", *small_options, "--until", "converged", "--no-probe")
    assert code == 0 and "at most, until converged, about " in output and " to t* = 180" in output
    code, _, stderr = alsph("resume", path, "--until", "convergd")
    assert code == 2 and "must be a number or converged, not 'convergd'" in stderr
    code, output, _ = alsph("run", "cylinder", "--help")
    assert "--until FLOAT|converged" in output and "as soon as mean drag" in " ".join(output.split())
    assert "not converged: ended at its latest time" in alsph("info", path)[1]


# Whole runs


def without_wall_clock(path):
    return bits(path) | {"ended": RunFolder(path).info()["ended"]}


@pytest.fixture
def ends_at(monkeypatch):
    """Have runs converge at the first judgement from a time on, which is 2, 4, 6, ..."""

    def make(time):
        def judged(run, of):
            now = float(run.history["time"][-1])
            how = "converged" if now >= time else "latest" if now >= of.until else ""
            return Judgement({"C_D'": Estimate(1.5, 0.001)}, [], how, f"after {now:.10g}", of.until)

        monkeypatch.setattr(driver, "judge", judged)

    return make


SETTINGS = {"until": "converged", "output_interval": 0.7, "surface_interval": 0.05}


def test_a_wake_ends_by_itself(tmp_path, small, capsys):
    """Shedding at Re = 150 in a channel that is much too small."""
    run = small.replace(reynolds=150.0).run(tmp_path / "run", until="converged", uncertainty=0.02, threads=1)
    printed = capsys.readouterr().out
    assert run.status == "finished" and run.info["ended"]["why"] == "converged"
    assert run.remarks[0] == run.info["ended"]["remark"] == run.summary()["remark 1"]
    assert run.remarks[0].startswith("converged: ended after ") and run.remarks[0] in printed
    assert run.remarks[0] in (run.path / "run.log").read_text()
    assert run.window.periods >= 8 and run.window.settled
    for name, estimate in run.averaged.items():
        assert estimate.uncertainty <= (0.02 if name != "C_L'" else 0.2 / 3) * estimate
    time = run.history["time"]
    assert time[-1] < 180 and next_judgement(time[-2]) <= time[-1] and run.times[-1] == pytest.approx(time[-1])
    assert run.info["until"] == run.info["time"] == pytest.approx(time[-1])


def test_a_steady_flow_ends_by_itself(tmp_path, small, monkeypatch):
    monkeypatch.setattr(Channel, "default_until", 8.0)
    case = small.replace(reynolds=10.0, perturbation=0.0)
    run = case.run(tmp_path / "run", until="converged", uncertainty=0.05, progress=False)
    assert run.info["ended"]["why"] == "converged" and "without shedding" in run.remarks[0]
    assert 8.0 <= run.history["time"][-1] < 24.0


def test_a_run_that_is_cut_ends_where_one_that_is_not_does(tmp_path, small, ends_at):
    ends_at(4.0)
    whole = small.run(tmp_path / "whole", progress=False, **SETTINGS).path
    assert RunFolder(whole).info()["time"] == pytest.approx(4.0, abs=0.05)
    assert small.run(tmp_path / "timed", until=4.0, progress=False, output_interval=0.7, surface_interval=0.05)
    timed = bits(tmp_path / "timed")
    assert bits(whole) == timed  # an end by judgement changes no bit
    cuts = -1
    with pytest.raises(WalltimeError):
        small.run(tmp_path / "cut", walltime=0.3, progress=False, **SETTINGS)
    while RunFolder(tmp_path / "cut").info()["status"] != "finished":
        cuts += 1
        try:
            resume(tmp_path / "cut", walltime=0.5, progress=False)
        except WalltimeError:
            continue
    assert cuts >= 0 and without_wall_clock(tmp_path / "cut") == without_wall_clock(whole)


@pytest.mark.parametrize("at", ["_output", "_checkpoint"])
def test_a_run_that_is_killed_as_it_ends_has_ended(tmp_path, small, ends_at, monkeypatch, at):
    """Before the last checkpoint is written, and between it and the word that the run has finished."""
    ends_at(2.0)
    whole = small.run(tmp_path / "whole", progress=False, **SETTINGS).path
    step = getattr(driver.Driver, at)

    def killed(self, *arguments):
        if self.ended and (at == "_output" or arguments == ("finished",)):
            raise KeyboardInterrupt
        step(self, *arguments)

    monkeypatch.setattr(driver.Driver, at, killed)
    monkeypatch.setattr(driver.Driver, "_write_status", unless_failed(driver.Driver._write_status))
    path = tmp_path / "killed"
    with pytest.raises(KeyboardInterrupt):
        small.run(path, progress=False, **SETTINGS)
    info = RunFolder(path).info()
    assert info["status"] == "running" and info["ended"]["step"] == info["step"]
    assert (info["checkpoint"]["step"] == info["step"]) == (at == "_checkpoint")
    monkeypatch.undo()
    ends_at(2.0)
    before = bits(path)["state"]
    assert resume(path, progress=False).status == "finished"
    assert without_wall_clock(path) == without_wall_clock(whole) and RunFolder(path).info()["status"] == "finished"
    assert (bits(path)["state"] == before) == (at == "_checkpoint")


def unless_failed(write):
    """As a kill leaves it: nothing is written of a failure."""
    return lambda self, status, message="": None if status == "failed" else write(self, status, message)


def test_a_run_that_has_converged_stays_and_goes_on_when_it_is_told_to(tmp_path, small, ends_at, alsph):
    ends_at(2.0)
    path = small.run(tmp_path / "run", progress=False, **SETTINGS).path
    before = bits(path)
    assert resume(path, progress=False).status == "finished" and bits(path) == before
    with pytest.warns(RuntimeWarning, match=r"nothing to be done: the run has reached t\* = 2\.\d+, and until = conv"):
        resume(path, until="converged", progress=False)
    code, output, _ = alsph("repeat", path)
    assert code == 0 and "the same to the last bit" in output
    farther = resume(path, until=2.5, progress=False)
    assert farther.history["time"][-1] == pytest.approx(2.5, abs=0.05)
    assert "ended" not in farther.info and farther.config.ending == {"until": 2.5}
    assert not any("converged" in remark for remark in farther.remarks)
    again = resume(path, until="converged", progress=False)
    assert again.history["time"][-1] == pytest.approx(4.0, abs=0.05) and again.info["ended"]["why"] == "converged"


def test_other_limits_are_another_run(tmp_path, small, ends_at):
    ends_at(2.0)
    path = small.run(tmp_path / "run", progress=False, **SETTINGS).path
    settings = RunSettings(**SETTINGS)
    step = RunFolder(path).info()["step"]
    assert complete(Config(small, settings), path, Control(progress=False)).info["step"] == step
    written = (path / "case.toml").read_text()
    (path / "case.toml").write_text(written.replace("uncertainty = 0.003", "uncertainty = 0.001"))
    assert resume(path, progress=False).info["time"] == pytest.approx(4.0, abs=0.05)
    ends_at(1e9)
    strict = settings.replace(uncertainty=0.002, latest=1.0)
    run = complete(Config(small, strict), path, Control(progress=False))
    assert run.info["time"] == pytest.approx(1.0, abs=0.05) and run.info["ended"]["why"] == "latest"


def test_retries_leave_the_judgements_where_they_are(tmp_path, small, ends_at, monkeypatch):
    ends_at(4.0)
    run_until, broken = driver.Simulation.run_until, {"left": 1}

    def break_down(self, *arguments):
        if self.time > 2.5 and broken["left"]:
            broken["left"] = 0
            raise package.errors.SolverError("step: velocity of particle 1")
        return run_until(self, *arguments)

    monkeypatch.setattr(driver.Simulation, "run_until", break_down)
    path = tmp_path / "run"
    start(Config(small, RunSettings(**SETTINGS)), path, Control(progress=False, retry=1))
    info = RunFolder(path).info()
    assert len(info["retries"]) == 1 and info["ended"]["why"] == "converged"
    assert info["time"] == pytest.approx(4.0, abs=0.05)


# What is told meanwhile, and beside others


def test_progress_tells_the_averages_and_the_latest_end(capsys, monkeypatch):
    monkeypatch.setattr("alsph.running.progress.PLAIN_SECONDS", 0.0)
    rows = {name: np.array([1]) for name in ("step", "iterations", "fluid", "inlet", "outlet", "solid")}
    rows |= {"time": np.array([5.0]), "divergence_max": np.array([1e-3])}
    with Reporter(100.0, 0.0, at_most=True) as reporter:
        reporter.update(rows)
        reporter.judged("C_D' 1.50 ± 0.01; missing: C_D' ± 0.667 % (limit 0.3 %)", 50.0)
        reporter.update(rows)
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith("  5.0 %") and "ETA at most " in first and "missing" not in first
    assert second.startswith(" 10.0 %") and second.endswith("missing: C_D' ± 0.667 % (limit 0.3 %)")


def test_studies_and_comparisons_take_runs_that_converge(tmp_path, small, ends_at):
    first = small.run(tmp_path / "first", until=0.3, progress=False)
    base = {"case": "cylinder", "run": {"until": "converged", "latest": 0.2, "initial_run": str(first.path)}}
    base |= {"resolution": 8, "length": 5.0, "height": 4.0, "upstream": 2.0}
    declared = Study(name="few", base=base, sweep=Sweep(product={"reynolds": [150, 200]}))
    found = package.study.run(declared, tmp_path / "studies", jobs=1, progress=False)
    assert [row["status"] for row in found.rows] == ["finished"] * 2
    assert all(row["remarks"].startswith("not converged, ") for row in found.rows)
    again = package.study.run(declared, tmp_path / "studies", jobs=1, progress=False)
    assert found.complete and [row["seconds"] for row in again.rows] == [row["seconds"] for row in found.rows]
    one = package.Run(tmp_path / "studies" / found.rows[1]["folder"])
    assert one.info["start"]["initial_run"] == str(first.path)
    told = package.compare([first, one]).parameters
    assert told["run.until"] == ["0.3", "'converged'"] and told["run.latest"] == ["not given", "0.2"]
    wrong = Study(name="few", base=base, sweep=Sweep(sets=[{"case": "taylor_green"}]))
    with pytest.raises(ConfigError):
        wrong.points()


def test_what_an_interrupted_run_was_to_reach(tmp_path, small):
    with pytest.raises(WalltimeError):
        small.run(tmp_path / "run", until="converged", walltime=0.05, progress=False)
    run = package.Run(tmp_path / "run")
    assert run.remarks[0].startswith("interrupted: at tU/D = ") and "of at most 180; " in run.remarks[0]
    info = json.loads((run.path / "run.json").read_text())
    assert "ended" not in info and info["until"] == 180.0
