"""Run folders among files of others: what is replaced, what is not written through, and what a killed run says."""

import json
import os
import pty
import signal
import subprocess
import time as clock

import h5py
import numpy as np
import pytest
from alsph import Run
from alsph.analysis.measures import Profile
from alsph.config import Config, RunSettings
from alsph.errors import ConfigError, RunFolderError
from alsph.folder import checkpoint, reading
from alsph.folder.run_folder import OWN, RunFolder
from alsph.running.control import Control
from alsph.running.start import complete, resume
from alsph.study.state import state
from processes import MAIN, command, wait_until_stepping, write_case


@pytest.fixture
def path(tmp_path, small):
    """The folder of a short run."""
    return small.run(tmp_path / "run", until=0.05, surface_interval=0.01, progress=False).path


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
    assert left < {str(name) for name in made if name.suffix != ".png"} and {"case.toml", "surface.h5"} & left == {
        "case.toml"
    }


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


def _in_terminal():
    """Make what the input is the session's terminal, whose end a test under nohup would not hear of either."""
    os.close(os.open(os.ttyname(0), os.O_RDWR))
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


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
        preexec_fn=_in_terminal,
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


@pytest.mark.parametrize("link", ["figures", "figures/forces.png", "figures/vorticity.png", "figures/ledger.png"])
def test_no_figure_is_drawn_through_a_link(path, alsph, tmp_path, link):
    elsewhere = tmp_path / "elsewhere"
    (path / link).parent.mkdir(exist_ok=True)
    if link == "figures":
        elsewhere.mkdir()
    else:
        elsewhere.write_text("precious")
    (path / link).symlink_to(elsewhere)
    code, _, complaints = alsph("plot", path)
    assert code == 2 and f"{path / link}: a link" in complaints
    assert not list(elsewhere.iterdir()) if link == "figures" else elsewhere.read_text() == "precious"
    if link != "figures":
        with pytest.raises(RunFolderError, match="a link or a special file"):
            Run(path).plot_forces(path / link)
        (path / link).unlink()
        os.link(elsewhere, path / link)  # which is replaced, not written through
        assert alsph("plot", path)[0] == 0 and elsewhere.read_text() == "precious"


def test_figures_of_no_known_format_are_refused(path, tmp_path):
    with pytest.raises(ConfigError, match="'pgn' is no format of figures; did you mean 'png'?"):
        Run(path).plot_forces(tmp_path / "forces.pgn")
    Run(path).plot_forces(tmp_path / "new" / "forces")
    assert (tmp_path / "new" / "forces.png").stat().st_size > 1000


def test_the_time_of_a_picture_is_said(path, alsph):
    run = Run(path)
    time, asked = run.times[-1], run.times[-1] + 0.9 * np.diff(run.times).max()
    code, _, complaints = alsph("plot", path, "--field", "pressure", "--time", asked)
    assert code == 0 and complaints == f"fields at t* = {time:.6g}, the output nearest to {asked:g}\n"
    code, _, complaints = alsph("plot", path, "--field", "pressure", "--time", 99)
    assert code == 2 and f"no snapshot near it, they are of t* = 0 to {time:.6g}" in complaints
    for ask in (
        run.snapshot,
        run.to_grid,
        lambda time: run.sample([[1, 0]], time),
        lambda t: run.plot_field("pressure", t),
    ):
        with pytest.raises(ConfigError, match="time = -4: no snapshot near it"):
            ask(-4)


def test_a_file_that_expands_without_end_is_refused(path, alsph):
    with h5py.File(path / "surface.h5", "w") as file:
        file["angle"] = np.arange(72.0)
        file.create_dataset("time", (2**22,), "f8", chunks=(2**20,), compression="gzip", fillvalue=0)[:] = 0
        samples = file.create_dataset("pressure_coefficient", (2**22, 72), "f8", chunks=(2**14, 72), compression="gzip")
        samples[: 2**14] = 0
    code, _, complaints = alsph("plot", path)
    assert code == 2 and "surface.h5: unreadable" in complaints and "more than its" in complaints


@pytest.mark.parametrize("name", ["history.csv", "surface.h5", "checkpoint.h5", "particles.vtkhdf"])
def test_what_does_not_fit_into_memory_is_told_in_a_line(path, monkeypatch, name):
    monkeypatch.setattr(reading, "free_memory", lambda: 100.0)
    readers = {
        "history.csv": reading.history,
        "surface.h5": reading.surface,
        "checkpoint.h5": checkpoint.read,
        "particles.vtkhdf": lambda file: reading.snapshot(file, 0),
    }
    with pytest.raises(RunFolderError, match=f"{name}: .*(GiB of memory|larger than)"):
        readers[name](path / name)
    assert (path / name).exists()


@pytest.mark.parametrize("name", ["case.toml", "run.json", "history.csv"])
def test_a_run_folder_of_devices_has_an_end(path, name):
    (path / name).unlink()
    (path / name).symlink_to("/dev/zero")
    with pytest.raises(RunFolderError, match=f"{name}: unreadable.*no regular file"):
        Run(path).history  # noqa: B018


PROFILES = ["flow rate", "velocity downstream", "force coefficient over the last period", "velocity of the sphere"]


@pytest.mark.parametrize("name", [*PROFILES, "velocity at 180 degrees, u at x = -0.6 D", "velocity at tU/D = 1.50"])
def test_figures_of_a_case_of_ours_go_with_its_run(name):
    nothing = np.empty(0), np.empty(0)
    assert OWN.fullmatch(f"{Profile(name, ('x', 'y'), nothing, nothing, '').file_name}.png")
