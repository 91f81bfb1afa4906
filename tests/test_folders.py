"""Run folders among files of others: what is replaced, what is not written through, and what a killed run says."""

import json
import os
import pty
import signal
import subprocess
import time as clock

import pytest
from alsph import Run, reading
from alsph.config import Config, RunSettings
from alsph.errors import RunFolderError
from alsph.io import RunFolder
from alsph.run import Control, complete, resume
from alsph.study.state import state
from processes import MAIN, command, wait_until_stepping, write_case


@pytest.fixture
def path(tmp_path, small):
    """The folder of a short run."""
    return small.run(tmp_path / "run", until=0.05, progress=False).path


def content(folder):
    return {file.relative_to(folder): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


@pytest.mark.parametrize(
    "files",
    [
        {".lock": "", "thesis.tex": "x"},
        {".lock": "", "case.toml": 'case = "cylinder"\n'},
        {"run.json": "{}"},
        {"run.json": '{"status": "finished"}', "data/precious.csv": "1"},
        {"run.json": '{"scripts": {}}', "case.toml": 'case = "cylinder"\n'},
        {"run.json": "[1, 2]", "case.toml": "x"},
        {"case.toml": 'case = "cylinder"\n', "thesis.tex": "x"},
    ],
)
def test_what_is_no_run_folder_is_never_replaced(tmp_path, small, files):
    mine = tmp_path / "mine"
    for name, text in files.items():
        (mine / name).parent.mkdir(parents=True, exist_ok=True)
        (mine / name).write_text(text)
    before = content(mine)
    with pytest.raises(RunFolderError, match="not a run folder, so --force does not replace it"):
        small.run(mine, until=0.05, force=True, progress=False)
    assert content(mine) == before


def test_only_what_alsph_made_is_replaced(path, alsph, small):
    assert alsph("plot", path)[0] == 0
    made = content(path)
    notes = {"notes.txt": b"a", "figures/mine.png": b"b", "case.toml.orig": b"c", "figures/sub/forces.png": b"d"}
    for name, text in notes.items():
        (path / name).parent.mkdir(exist_ok=True)
        (path / name).write_bytes(text)
    (path / "particles.damaged.vtkhdf").touch()
    run = small.run(path, until=0.02, force=True, progress=False)
    assert run.status == "finished" and run.history["time"][-1] < 0.04
    for name, text in notes.items():
        assert (path / name).read_bytes() == text
    left = {str(name) for name in content(path)} - set(notes)
    assert left == {str(name) for name in made if name.parent != path / "figures" and name.suffix != ".png"} - {
        "checkpoint.previous.h5"
    } | ({"checkpoint.previous.h5"} & left)


def test_a_run_that_was_cut_while_it_replaced_another_one_is_no_loss(path, small, monkeypatch):
    monkeypatch.setattr(RunFolder, "write_config", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        small.run(path, until=0.02, force=True, progress=False)
    monkeypatch.undo()
    assert RunFolder(path).info()["status"] == "starting"
    assert complete(Config(small, RunSettings(until=0.05)), path, Control(progress=False)).status == "finished"


@pytest.fixture
def killed(tmp_path, small):
    """The folder of a run that was killed."""
    path = tmp_path / "a run"
    process = command("run", write_case(tmp_path / "case.toml", small, until=60.0), "-o", path)
    wait_until_stepping(path, process)
    assert Run(path).status == "running" and state(path).status == "running"
    process.kill()
    process.wait()
    process.communicate()
    return path


def test_a_killed_run_says_so_and_how_to_go_on(killed, alsph):
    run = Run(killed)
    assert run.status == "stopped" and f"alsph resume '{killed}'" in run.info["message"]
    code, output, _ = alsph("info", killed)
    assert code == 0 and "running" not in output.replace("resume", "")
    assert "no process is at work in it" in output and f"go on with: alsph resume '{killed}'" in output
    found = state(killed)
    assert found.status == "stopped" and "no process is at work in it" in found.message
    until = RunFolder(killed).read_checkpoint().state["time"] + 0.02
    assert resume(killed, until=until, progress=False).status == "finished"


def test_a_lock_that_cannot_be_read_tells_nothing(killed, monkeypatch):
    monkeypatch.setattr(RunFolder, "is_busy", lambda self: None)
    assert Run(killed).status == "running"


def test_a_run_killed_before_its_first_step_is_to_be_run_again(path):
    for file in path.glob("checkpoint*"):
        file.unlink()
    (path / "run.json").write_text(json.dumps({"status": "starting"}))
    assert Run(path).status == "stopped" and "alsph run, with --force" in Run(path).info["message"]


def test_a_terminal_that_closes_costs_no_step(tmp_path, small):
    """The system sends SIGHUP to the terminal's session, and all that the run says from then on fails."""
    path, file = tmp_path / "run", write_case(tmp_path / "case.toml", small, until=60.0)
    main, terminal = pty.openpty()
    process = subprocess.Popen(
        [*MAIN, "run", str(file), "-o", str(path)],
        stdin=terminal,
        stdout=terminal,
        stderr=terminal,
        start_new_session=True,
        preexec_fn=lambda: os.close(os.open(os.ttyname(0), os.O_RDWR)),  # which makes it the session's terminal
    )
    os.close(terminal)
    wait_until_stepping(path, process)
    clock.sleep(0.3)
    os.close(main)
    assert process.wait(60) == 129
    info = RunFolder(path).info()
    assert info["status"] == "interrupted" and info["step"] == info["checkpoint"]["step"] > 0


def test_a_run_under_nohup_does_not_heed_its_terminal(tmp_path, small):
    path, file = tmp_path / "run", write_case(tmp_path / "case.toml", small, until=60.0)
    process = command("run", file, "-o", path, preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
    wait_until_stepping(path, process)
    process.send_signal(signal.SIGHUP)
    clock.sleep(0.5)
    assert process.poll() is None and Run(path).status == "running"
    process.terminate()
    process.communicate()
    assert process.returncode == 143


def test_an_end_in_the_past_leaves_nothing_to_be_done(path, alsph):
    with pytest.warns(
        RuntimeWarning, match=r"run: nothing to be done: the run has reached t\* = 0.05\d*, and until = 0.01"
    ):
        resume(path, until=0.01, progress=False)
    resume(path, progress=False)


def test_a_path_may_hold_any_bytes(tmp_path, small_options):
    path = os.fsencode(tmp_path) + b"/caf\xe9"
    arguments = ["cylinder", *small_options, "--until=0.02", "-o", os.fsdecode(path)]
    for line in (["run", *arguments], ["info", os.fsdecode(path)]):
        done = subprocess.run([*MAIN, *line], capture_output=True, timeout=60)
        assert done.returncode == 0 and rb"caf\udce9" in done.stdout and not done.stderr, done.stderr
    assert reading.info(Run(os.fsdecode(path)).path / "run.json")["status"] == "finished"
