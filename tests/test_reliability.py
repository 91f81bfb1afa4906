"""Runs that are killed, stopped, moved, damaged or broken down: none is lost, and all end with the same bits."""

import codecs
import json
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import threading
import time as clock
import warnings

import alsph
import h5py
import numpy as np
import pytest
from alsph.cases import Cylinder, TaylorGreen
from alsph.config import Config, RunSettings
from alsph.engine.simulation import Simulation
from alsph.engine.times import next_multiple
from alsph.errors import ConfigError, RunFolderError, SolverError, WalltimeError
from alsph.folder import checkpoint, durable, reading
from alsph.folder.run_folder import RunFolder
from alsph.running.control import Control, seconds_of
from alsph.running.start import complete, resume, start
from processes import bits, command, wait_until_stepping, write_case

CASES = {
    "cylinder": (Cylinder(resolution=8, length=5.0, height=4.0, upstream=2.0), 2.0),
    "algorithm_1": (Cylinder(resolution=8, length=5.0, height=4.0, upstream=2.0, algorithm=1), 1.6),
    "space": (TaylorGreen(resolution=10, dimensions=3), 0.8),
}


@pytest.mark.parametrize("name", CASES)
def test_a_run_killed_at_random_moments_ends_with_the_same_bits(tmp_path, name):
    """Eight kills each of runs that write all the time; the seed is printed when the test fails."""
    case, until = CASES[name]
    settings = {"until": until, "output_interval": 0.02, "surface_interval": 0.01, "flush_seconds": 0.02}
    whole = case.run(tmp_path / "whole", threads=1, progress=False, **settings)
    path = tmp_path / "run"
    write_case(tmp_path / "case.toml", case, threads=2, **settings)
    seed = random.randrange(2**32)
    print("seed", seed)
    delays = random.Random(seed)
    process = command("run", tmp_path / "case.toml", "-o", path)
    kills = 0
    for _ in range(8):
        wait_until_stepping(path, process)
        clock.sleep(delays.uniform(0.0, 0.25))
        process.kill()
        kills += process.wait() == -signal.SIGKILL
        process = command("resume", path)
    output, errors = process.communicate(timeout=120)
    assert process.returncode == 0, output + errors
    assert kills >= 4
    assert bits(path) == bits(whole.path)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_a_run_with_a_checkpoint_and_its_own_exit_code(tmp_path, small, number, code):
    path = tmp_path / "run"
    process = command("run", write_case(tmp_path / "case.toml", small, until=60.0), "-o", path)
    wait_until_stepping(path, process)
    clock.sleep(0.3)
    process.send_signal(number)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == code
    assert f"go on with: alsph resume {path}" in errors and "Traceback" not in errors
    info = RunFolder(path).info()
    assert info["status"] == "interrupted" and info["step"] == info["checkpoint"]["step"] > 0
    until = info["time"] + 0.1
    assert (
        bits(resume(path, until=until, progress=False).path)["state"]
        == bits(small.run(tmp_path / "whole", until=until, progress=False).path)["state"]
    )


def test_a_wall_time_ends_a_run_with_a_checkpoint(tmp_path, small, alsph):
    path = tmp_path / "run"
    code, _, errors = alsph(
        "run", write_case(tmp_path / "case.toml", small, until=60.0), "-o", path, "--walltime", "0:00:02"
    )
    assert code == 75 and "time limit of 2 s reached" in errors and f"alsph resume {path}" in errors
    assert RunFolder(path).info()["seconds"] < 10
    with pytest.raises(WalltimeError):
        resume(path, walltime=0.5, progress=False)
    assert RunFolder(path).info()["status"] == "interrupted"
    time = RunFolder(path).info()["time"]
    assert resume(path, until=time + 0.05, walltime=100.0, progress=False).status == "finished"


def test_wall_times():
    assert seconds_of(None) == np.inf
    assert seconds_of("00:30:05") == 1805
    assert seconds_of("2-01:00:00") == 49 * 3600
    for text in ("30", "1:99:00", "-1:00:00", "soon"):
        with pytest.raises(ConfigError, match=r"must be \[D-\]HH:MM:SS"):
            seconds_of(text)
    with pytest.raises(ConfigError, match="walltime = 0"):
        Control(walltime=0)
    with pytest.raises(ConfigError, match="walltime = '1:00:00': must be a number above zero"):
        Control(walltime="1:00:00")
    with pytest.raises(ConfigError, match="retry = -1"):
        Control(retry=-1)


def test_a_run_goes_on_when_nobody_reads_its_progress(tmp_path, small):
    """As with ``alsph run ... | head -1``."""
    file, path = write_case(tmp_path / "case.toml", small, until=0.3), tmp_path / "run"
    script = f"""
import alsph.running.progress
alsph.running.progress.PLAIN_SECONDS = 0.0
import sys
import threading
sys.argv = ["alsph", "run", {str(file)!r}, "-o", {str(path)!r}]
from alsph.cli import main
main()
"""
    process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    process.stdout.close()
    process.wait(60)
    assert RunFolder(path).info()["status"] == "finished"


def test_a_notebook_goes_on_after_an_interrupt(tmp_path):
    """A cell is interrupted by SIGINT; the next ones resume the run in the same process."""
    script = f"""
import alsph
case = alsph.cases.Cylinder(resolution=8, length=5.0, height=4.0, upstream=2.0)
try:
    case.run({str(tmp_path / "run")!r}, until=60, progress=False)
except KeyboardInterrupt as stop:
    print(stop, flush=True)
run = alsph.open_run({str(tmp_path / "run")!r})
print(alsph.resume(run.path, until=run.info["time"] + 0.05, progress=False).status)
"""
    process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    wait_until_stepping(tmp_path / "run", process)
    process.send_signal(signal.SIGINT)
    output, _ = process.communicate(timeout=30)
    assert "stopped at step" in output and output.split()[-1] == "finished"


@pytest.mark.parametrize("room", [0, 20_000, 200_000])
def test_a_disk_that_fills_up_costs_nothing_but_the_steps_since_the_checkpoint(tmp_path, small, room):
    """A limit of the size of files, which makes writes fail in their midst, stands for the full disk."""
    settings = {"until": 0.5, "output_interval": 0.05, "surface_interval": 0.01}
    whole = small.run(tmp_path / "whole", progress=False, **settings)
    path = tmp_path / "run"
    first = small.run(path, progress=False, **settings | {"until": 0.1})
    largest = max(file.stat().st_size for file in first.path.iterdir())

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (largest + room, resource.RLIM_INFINITY))

    process = command("resume", path, "--until", 0.5, preexec_fn=limit)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 2 and "cannot be written" in errors, errors
    assert RunFolder(path).read_checkpoint().state["time"] >= 0.1
    assert bits(resume(path, until=0.5, progress=False).path) == bits(whole.path)


def test_a_second_process_is_refused(tmp_path, small):
    path, file = tmp_path / "run", write_case(tmp_path / "case.toml", small, until=60.0)
    process = command("run", file, "-o", path)
    wait_until_stepping(path, process)
    for arguments in (("resume", path), ("run", file, "-o", path, "--force")):
        second = command(*arguments)
        _, errors = second.communicate(timeout=30)
        assert second.returncode == 2 and f"process {process.pid} on " in errors
    assert process.poll() is None
    process.kill()
    process.wait()
    assert resume(path, until=RunFolder(path).read_checkpoint().state["time"] + 0.02, progress=False)


def test_files_that_come_and_go_are_no_special_files(tmp_path):
    """As the second process looks at the folder, the first replaces its checkpoint."""
    path = tmp_path / "checkpoint.h5"
    done = threading.Event()

    def replace():
        while not done.is_set():
            path.touch()
            path.unlink()

    other = threading.Thread(target=replace)
    other.start()
    try:
        for _ in range(3000):
            durable.check_target(path)
    finally:
        done.set()
        other.join()


def test_a_folder_that_has_moved_goes_on(tmp_path, small):
    whole = small.run(tmp_path / "whole", until=0.2, progress=False)
    small.run(tmp_path / "here", until=0.1, progress=False)
    shutil.move(tmp_path / "here", tmp_path / "there")
    info = json.loads((tmp_path / "there" / "run.json").read_text())
    info["machine"]["name"] = "elsewhere"
    (tmp_path / "there" / "run.json").write_text(json.dumps(info))
    assert bits(resume(tmp_path / "there", until=0.2, progress=False).path)["state"] == bits(whole.path)["state"]


@pytest.mark.parametrize("name", ["run.json", "surface.h5", "history.csv", ".lock"])
def test_a_run_goes_on_without_what_it_does_not_need(tmp_path, small, name):
    path = small.run(tmp_path / "run", until=0.1, progress=False).path
    (path / name).unlink(missing_ok=True)
    assert resume(path, until=0.2, progress=False).status == "finished"


def test_the_clock_may_jump(tmp_path, small, monkeypatch):
    """The time of day is only written down."""
    monkeypatch.setattr(clock, "time", lambda: -1e9)
    assert small.run(tmp_path / "run", until=0.05, progress=False).info["seconds"] >= 0


# Checkpoints


@pytest.fixture
def two_checkpoints(tmp_path, small):
    """A run that stands at t* = 0.2, and its checkpoint before at 0.1."""
    path = small.run(tmp_path / "run", until=0.2, output_interval=0.1, progress=False).path
    last, before = (checkpoint.read(path / name).state["time"] for name in ("checkpoint.h5", "checkpoint.previous.h5"))
    assert before <= last
    return path


@pytest.mark.parametrize("damage", ["cut", "flip", "empty", "text", "gone"])
def test_a_damaged_checkpoint_is_noticed_and_the_one_before_used(two_checkpoints, tmp_path, small, damage):
    path, file = two_checkpoints, two_checkpoints / "checkpoint.h5"
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    damaged = {"cut": content[: len(content) // 2], "flip": content, "empty": b"", "text": b"text"}
    file.unlink() if damage == "gone" else file.write_bytes(damaged[damage])
    if damage == "gone":  # a process killed between two renames; nothing is lost
        resume(path, until=0.3, progress=False)
    else:
        with pytest.warns(RuntimeWarning, match="damaged.*going back to checkpoint.previous.h5"):
            resume(path, until=0.3, progress=False)
        assert "going back to checkpoint.previous.h5" in (path / "run.log").read_text()
        assert (path / "checkpoint.damaged.h5").exists()
        assert checkpoint.read(path / "checkpoint.previous.h5").state["time"] > 0  # not the damaged one
    whole = small.run(tmp_path / "whole", until=0.3, output_interval=0.1, progress=False)
    assert bits(path)["state"] == bits(whole.path)["state"]
    assert bits(path)["history"] == bits(whole.path)["history"]


def test_two_damaged_checkpoints_are_an_error(two_checkpoints):
    for name in ("checkpoint.h5", "checkpoint.previous.h5"):
        (two_checkpoints / name).write_bytes(b"text")
    with pytest.raises(RunFolderError, match="checkpoint.h5: not a checkpoint, or damaged"):
        resume(two_checkpoints, until=0.3, progress=False)


def test_every_flipped_bit_is_noticed(two_checkpoints):
    file = two_checkpoints / "checkpoint.h5"
    content = file.read_bytes()
    state = checkpoint.digest(checkpoint.read(file).state)
    chance = random.Random(1)
    for place in [*range(100), *(chance.randrange(len(content)) for _ in range(200))]:
        damaged = bytearray(content)
        damaged[place] ^= 1 << chance.randrange(8)
        file.write_bytes(damaged)
        try:
            assert checkpoint.digest(checkpoint.read(file).state) == state  # in what pads the head
        except RunFolderError:
            pass
        else:
            assert place < checkpoint.HEAD_BYTES


def test_versions(two_checkpoints, tmp_path):
    file = two_checkpoints / "checkpoint.h5"
    found = checkpoint.read(file)
    with h5py.File(tmp_path / "old.h5", "w") as old:  # as version 1 was
        for name, value in found.state.items():
            if np.ndim(value):
                old.create_dataset(name, data=value, compression="gzip")
            else:
                old.attrs[name] = value
    first = checkpoint.read(tmp_path / "old.h5")
    assert checkpoint.digest(first.state) == checkpoint.digest(found.state) and first.case is None
    shutil.copytree(two_checkpoints, tmp_path / "old run")
    shutil.copy(tmp_path / "old.h5", tmp_path / "old run" / "checkpoint.h5")
    with pytest.warns(RuntimeWarning, match="of an older alsph, does not tell its settings"):
        resume(tmp_path / "old run", until=found.state["time"] + 0.02, progress=False)
    file.write_bytes(file.read_bytes().replace(b"version 2", b"version 3"))
    with pytest.raises(RunFolderError, match="of version 3, and this alsph reads up to 2; use a newer alsph"):
        checkpoint.read(file)


def hostile(file, kind):
    """Put an array into a file that must not be read."""
    if kind == "huge":
        file.create_dataset("position", (2**40, 2), "f8", chunks=(2**10, 2), compression="gzip")
    elif kind == "text":
        file["position"] = np.array(["a", "b"], dtype=h5py.string_dtype())
    elif kind == "references":
        file.create_dataset("position", (3,), dtype=h5py.ref_dtype)
    elif kind == "link":
        file["position"] = h5py.ExternalLink("/etc/hostname", "/")
    elif kind == "soft link":
        file["position"] = h5py.SoftLink("/velocity")
    elif kind == "external":
        file.create_dataset("position", (10, 1), "u1", external=[("/etc/hostname", 0, 10)])
    elif kind == "virtual":
        layout = h5py.VirtualLayout((5, 2), "f8")
        layout[:] = h5py.VirtualSource("/tmp/elsewhere.h5", "a", (5, 2))
        file.create_virtual_dataset("position", layout)
    elif kind == "filter":
        file.create_dataset("position", (2**20, 2), "i4", chunks=(2**10, 2), scaleoffset=0)
    elif kind == "group":
        file.create_group("position")


@pytest.mark.parametrize(
    "kind", ["huge", "text", "references", "link", "soft link", "external", "virtual", "filter", "group"]
)
def test_hostile_files_are_refused(tmp_path, kind):
    with h5py.File(tmp_path / "checkpoint.h5", "w") as file:
        file.attrs["time"] = file.attrs["step"] = 1
        file["velocity"] = np.zeros((3, 2))
        hostile(file, kind)
    with pytest.raises(RunFolderError, match="not a checkpoint, or damaged: position"):
        checkpoint.read(tmp_path / "checkpoint.h5")
    with h5py.File(tmp_path / "particles.vtkhdf", "w") as file:
        steps = file.create_group("VTKHDF/Steps")
        steps.attrs["NSteps"] = 1
        hostile(steps, kind)
        steps.move("position", "Values")
    with pytest.raises(RunFolderError, match="unreadable"):
        reading.snapshot_times(tmp_path / "particles.vtkhdf")


def test_a_nested_configuration_is_no_crash(tmp_path, small):
    path = small.run(tmp_path / "run", until=0.02, progress=False).path
    (path / "run.json").write_text("[" * 100_000)
    with pytest.raises(RunFolderError, match="run.json"):
        alsph.open_run(path)


def path_of_damage(name):
    """Return the name under which a damaged file is set aside."""
    return "{}.damaged.{}".format(*name.split("."))


@pytest.mark.parametrize("name", ["particles.vtkhdf", "surface.h5", "history.csv"])
def test_a_damaged_file_is_set_aside(tmp_path, small, name):
    path = small.run(tmp_path / "run", until=0.2, output_interval=0.1, progress=False).path
    (path / name).write_bytes(b"text" + (path / name).read_bytes()[4:])
    with pytest.warns(RuntimeWarning, match=f"{name} is damaged .* set aside as {path_of_damage(name)}"):
        resume(path, until=0.3, progress=False)
    assert (path / path_of_damage(name)).exists()
    assert alsph.open_run(path).snapshot().time >= 0.3


@pytest.mark.parametrize("name", ["particles.vtkhdf", "surface.h5"])
def test_a_file_that_is_damaged_in_mid_run_is_set_aside(tmp_path, small, name, monkeypatch):
    path, run_until, damaged = tmp_path / "run", Simulation.run_until, path_of_damage(name)

    def damage(self, *arguments):
        file = path / name
        if self.time > 0.15 and not (path / damaged).exists():
            file.write_bytes(b"text" + file.read_bytes()[4:])
        return run_until(self, *arguments)

    monkeypatch.setattr(Simulation, "run_until", damage)
    with pytest.warns(RuntimeWarning, match=f"{name} is damaged .* set aside as {damaged}"):
        small.run(path, until=0.3, output_interval=0.1, surface_interval=0.05, progress=False)
    run = alsph.open_run(path)
    assert run.status == "finished" and run.snapshot().time >= 0.3
    assert f"{name} is damaged" in (path / "run.log").read_text()


def test_a_row_that_cannot_be_read_costs_no_other(tmp_path, small):
    path = small.replace(time_step=0.05).run(tmp_path / "run", until=0.1, progress=False).path
    lines = (path / "history.csv").read_text().splitlines(True)
    (path / "history.csv").write_text("".join([*lines[:5], "nonsense\n", *lines[6:]]))
    run = alsph.open_run(resume(path, until=0.2, progress=False).path)
    assert run.history["step"][:6].tolist() == [1, 2, 3, 4, 6, 7]
    assert re.match(r"incomplete: 1 of \d+ steps are missing in the history, the first behind step 4;", run.remarks[0])


def test_a_history_whose_times_do_not_increase_is_refused_and_set_aside(tmp_path, small):
    path = small.replace(time_step=0.05).run(tmp_path / "run", until=0.1, progress=False).path
    lines = (path / "history.csv").read_text().splitlines(True)
    unknown = ",".join(["7", "nan", *lines[7].split(",")[2:]])
    for odd in ([*lines[:6], *lines[4:]], [lines[0], *lines[:0:-1]], [*lines[:7], unknown, *lines[8:]]):
        (path / "history.csv").write_text("".join(odd))
        with pytest.raises(
            RunFolderError, match=r"history.csv: tU/D = \S+ stands behind \S+; the file was edited or dam"
        ):
            alsph.open_run(path).summary()
    assert not alsph.repeat(path, progress=False).same
    (path / "history.csv").write_text("".join([*lines[:6], *lines[4:]]))
    with pytest.warns(RuntimeWarning, match="step 4 stands behind step 5.* set aside as history.damaged.csv"):
        resume(path, until=0.2, progress=False)


def test_snapshots_that_are_gone_are_told(tmp_path, small):
    path = small.run(tmp_path / "run", until=0.05, progress=False).path
    assert not any(remark.startswith("incomplete") for remark in alsph.open_run(path).remarks)
    (path / "particles.vtkhdf").unlink()
    run = alsph.open_run(resume(path, until=0.1, progress=False).path)
    assert f"incomplete: the snapshots before tU/D = {run.times[0]:.4g} are missing in particles.vtkhdf" in run.remarks


def test_a_history_that_a_spreadsheet_has_saved_goes_on(tmp_path, small):
    path = small.replace(time_step=0.05).run(tmp_path / "run", until=0.1, progress=False).path
    content = (path / "history.csv").read_bytes()
    drag = alsph.open_run(path).history["drag_coefficient"]
    (path / "history.csv").write_bytes(codecs.BOM_UTF8 + content.replace(b"\n", b"\r\n"))
    assert (alsph.open_run(path).history["drag_coefficient"] == drag).all()
    with warnings.catch_warnings(action="error"):
        run = alsph.open_run(resume(path, until=0.2, progress=False).path)
    assert (run.history["drag_coefficient"][: len(drag)] == drag).all() and len(run.history["step"]) > len(drag)
    assert not any(remark.startswith("incomplete") for remark in run.remarks)


@pytest.mark.parametrize("name", ["particles.vtkhdf", "run.log", "run.json", "history.csv", ".history.csv.new"])
def test_nothing_is_written_through_links(tmp_path, small, name):
    path = small.run(tmp_path / "run", until=0.05, progress=False).path
    victim = tmp_path / "victim"
    if (path / name).exists():
        shutil.move(path / name, victim)
    else:
        victim.write_text("precious")
    (path / name).symlink_to(victim)
    content = victim.read_bytes()
    with pytest.raises(RunFolderError, match="a link or a special file"):
        resume(path, until=0.1, progress=False)
    assert victim.read_bytes() == content


def test_a_newest_checkpoint_of_a_newer_version_is_not_damaged(two_checkpoints, small):
    file = two_checkpoints / "checkpoint.h5"
    content = file.read_bytes().replace(b"version 2", b"version 3")
    file.write_bytes(content)
    with pytest.raises(RunFolderError, match="use a newer alsph"):
        resume(two_checkpoints, until=0.3, progress=False)
    (two_checkpoints / "checkpoint.previous.h5").write_bytes(content)
    config = Config(small, RunSettings(until=0.2, output_interval=0.1))
    RunFolder(two_checkpoints).write_info({"status": "interrupted"})
    with pytest.raises(RunFolderError, match="use a newer alsph"):
        complete(config, two_checkpoints, Control(progress=False))
    assert file.read_bytes() == content


def test_an_earlier_end_does_not_finish_a_run(tmp_path, small):
    path = tmp_path / "run"
    with pytest.raises(WalltimeError):
        small.run(path, until=60.0, walltime=0.5, progress=False)
    time = RunFolder(path).info()["time"]
    assert resume(path, until=time / 2, progress=False).status == "interrupted"


def test_a_folder_cut_before_its_first_step_is_run_again(tmp_path, small):
    path = small.run(tmp_path / "run", until=0.02, progress=False).path
    for file in path.iterdir():
        if file.name not in (".lock", "case.toml"):
            file.unlink()
    assert complete(Config(small, RunSettings(until=0.02)), path, Control(progress=False)).status == "finished"
    shutil.rmtree(path)
    path.mkdir()
    (path / ".lock").touch()
    assert small.run(path, until=0.02, progress=False).status == "finished"


def test_a_resumed_run_finds_the_same_outputs():
    for interval in (0.05, 0.1, 1 / 3):
        time, target = 0.0, next_multiple(0.0, interval)
        for _ in range(2000):
            time = time + 0.005 * (1 + 1e-16)
            assert next_multiple(np.nextafter(target, 0), interval) == target
            if time >= target:
                target = next_multiple(time, interval)
            assert next_multiple(time, interval) == target > time
    assert next_multiple(1.0, 1e-300) > 1.0


# Settings that change


def test_changed_settings_are_told(tmp_path, small):
    path = small.run(tmp_path / "run", until=0.05, progress=False).path
    text = (path / "case.toml").read_text()
    (path / "case.toml").write_text(text.replace("max_iterations = 2", "max_iterations = 3"))
    with pytest.warns(RuntimeWarning, match=r"other settings than before: max_iterations = 3 \(was 2\)"):
        resume(path, until=0.1, progress=False)
    segments = RunFolder(path).info()["segments"]
    assert [part["case"]["max_iterations"] for part in segments] == [2, 3] and segments[1]["step"] > 0
    assert alsph.repeat(path, progress=False).same


def test_what_the_particles_were_made_for_cannot_change(tmp_path, small):
    path = small.run(tmp_path / "run", until=0.05, progress=False).path
    text = (path / "case.toml").read_text()
    (path / "case.toml").write_text(text.replace("resolution = 8", "resolution = 16"))
    with pytest.raises(RunFolderError, match="changed in what the particles were made for .*particle_spacing"):
        resume(path, until=0.1, progress=False)


# Breakdowns

UNSTABLE = {"time_step": 0.2, "penalty_constant": 100.0, "adaptive_time_step": False}


@pytest.mark.filterwarnings("ignore:.*expect divergence")
def test_a_breakdown_tells_its_cause_and_keeps_both_states(tmp_path, small):
    message = r"of particle \d+ at \[.*times the penalty limit.*take a smaller time step.*breakdown.vtkhdf"
    with pytest.raises(SolverError, match=message):
        small.replace(**UNSTABLE).run(tmp_path / "run", until=20, progress=False)
    file = tmp_path / "run" / "breakdown.vtkhdf"
    assert len(reading.snapshot_times(file)) == 2
    good, bad = (reading.snapshot(file, step) for step in (0, 1))
    assert (good.position == bad.position).all() and np.abs(good.velocity).max() < 50
    assert not np.abs(bad.velocity).max() < np.abs(good.velocity).max()
    kept = RunFolder(tmp_path / "run").read_checkpoint().state
    assert np.isfinite(kept["velocity"]).all() and np.isfinite(kept["pressure"]).all()


@pytest.mark.filterwarnings("ignore:.*expect divergence")
def test_a_retry_goes_back_and_on_with_smaller_steps(tmp_path, small, alsph):
    case = small.replace(**UNSTABLE)
    with pytest.raises(SolverError):
        case.run(tmp_path / "broken", until=0.5, progress=False)
    path = tmp_path / "run"
    code, *_ = alsph("run", write_case(tmp_path / "case.toml", case, until=0.5), "-o", path, "--retry", "4")
    info = RunFolder(path).info()
    assert code == 0 and info["status"] == "finished" and 1 <= len(info["retries"]) <= 4
    assert "diverged at step" in info["retries"][0]["message"]
    last = info["retries"][-1]["time_step"]
    history = reading.history(path / "history.csv")
    assert history["time_step"][-1] == pytest.approx(last * case.particle_spacing) and last < 0.2
    assert history["step"].tolist() == list(range(1, info["step"] + 1))
    assert "retry: back from step" in (path / "run.log").read_text()
    code, output, _ = alsph("repeat", path)
    assert code == 0 and "the same to the last bit" in output


@pytest.mark.filterwarnings("ignore:.*expect divergence")
def test_retries_end(tmp_path, small):
    case = small.replace(**UNSTABLE | {"time_step": 5.0})
    with pytest.raises(SolverError):
        start(Config(case, RunSettings(until=20)), tmp_path / "run", Control(progress=False, retry=2))
    assert len(RunFolder(tmp_path / "run").info()["retries"]) == 2


@pytest.mark.filterwarnings("ignore:.*expect divergence")
def test_retries_that_are_killed_leave_one_line_of_time(tmp_path, small, monkeypatch):
    """The second retry goes back to the checkpoint before the newest, which is then gone for good."""
    path = small.run(tmp_path / "run", until=0.4, output_interval=0.1, surface_interval=0.01, progress=False).path
    times = [RunFolder(path).read_checkpoint().state["time"]]
    broken = {"left": 2}
    run_until = Simulation.run_until

    def break_down(self, *arguments):
        if self.time > times[0] and broken["left"]:
            broken["left"] -= 1
            raise SolverError("step: velocity of particle 1")
        if not broken["left"] and self.time > times[0] - 0.05:
            raise KeyboardInterrupt  # as good as a kill: no checkpoint is written
        return run_until(self, *arguments)

    monkeypatch.setattr(Simulation, "run_until", break_down)
    with pytest.raises(KeyboardInterrupt):
        resume(path, until=0.6, retry=3, progress=False)
    monkeypatch.undo()
    assert RunFolder(path).read_checkpoint().state["time"] < times[0] - 0.05
    with pytest.warns(RuntimeWarning, match="time_step"):
        resume(path, until=0.6, progress=False)
    history = reading.history(path / "history.csv")
    assert np.diff(history["time"]) == pytest.approx(history["time_step"][1:])
    assert history["step"].tolist() == list(range(1, len(history["step"]) + 1))


# Repetition


def test_a_run_is_repeated_to_the_last_bit(tmp_path, small, alsph):
    path = small.run(tmp_path / "run", until=0.3, threads=2, progress=False).path
    before = {file.name: file.read_bytes() for file in path.iterdir()}
    code, output, _ = alsph("repeat", path, "--threads", 1)
    assert code == 0 and "the same to the last bit" in output and "threads: 1, was 2" in output
    assert before == {file.name: file.read_bytes() for file in path.iterdir()}
    lines = (path / "history.csv").read_text().splitlines(True)
    row = lines[10].split(",")
    row[1] = "0.123"
    (path / "history.csv").write_text("".join([*lines[:10], ",".join(row), *lines[11:]]))
    code, output, _ = alsph("repeat", path)
    assert code == 1 and "step 10: time is " in output and "was 0.123" in output


def test_a_run_that_ends_when_the_particles_are_sorted_is_repeated(tmp_path, small):
    for step in (15, 16, 17):
        path = tmp_path / str(step)
        simulation = small.simulation()
        simulation.advance(step)
        small.run(path, until=simulation.time, progress=False)
        assert RunFolder(path).info()["step"] == step
        assert alsph.repeat(path, progress=False).same


def test_a_state_that_differs_is_found(tmp_path, small):
    path = small.run(tmp_path / "run", until=0.05, progress=False).path
    info = RunFolder(path).info()
    info["checkpoint"]["state_sha256"] = "0"
    (path / "run.json").write_text(json.dumps(info))
    repetition = alsph.repeat(path, progress=False)
    assert not repetition.same and "the state at its end is not" in str(repetition)
    (path / "run.json").write_text("{}")
    with pytest.raises(RunFolderError, match="of an older alsph"):
        alsph.repeat(path, progress=False)


@pytest.mark.parametrize(
    "entry",
    [
        {"segments": [3]},
        {"segments": [{"step": "0", "case": {}}]},
        {"retries": ["again"]},
        {"checkpoint": {"step": 1}},
        {"checkpoint": {"step": 1, "time": 0.1, "state_sha256": 5}},
        {"began": 1},
    ],
)
def test_entries_of_another_kind_are_refused(tmp_path, small, entry):
    path = small.run(tmp_path / "run", until=0.05, progress=False).path
    (path / "run.json").write_text(json.dumps(RunFolder(path).info() | entry))
    with pytest.raises(RunFolderError, match="an entry is not of its kind"):
        alsph.repeat(path, progress=False)


def test_a_number_that_no_float_holds_is_refused(tmp_path, small):
    path = small.run(tmp_path / "run", until=0.05, progress=False).path
    info = RunFolder(path).info()
    for name in ("seconds", "time", "step"):
        (path / "run.json").write_text(json.dumps(info | {name: 10**400}))
        with pytest.raises(RunFolderError, match="too large"):
            RunFolder(path).info()


@pytest.mark.filterwarnings("ignore:.*expect divergence")
def test_a_run_retried_from_its_start_is_complete(tmp_path, small):
    settings = Config(small.replace(**UNSTABLE), RunSettings(until=0.3, output_interval=10))
    start(settings, tmp_path / "run", Control(progress=False, retry=4))
    info = RunFolder(tmp_path / "run").info()
    assert info["retries"] and info["segments"][0]["step"] == 0
    complete(settings, tmp_path / "run", Control(progress=False))
    assert RunFolder(tmp_path / "run").info() == info


def test_a_damaged_history_differs(tmp_path, small):
    path = small.run(tmp_path / "run", until=0.05, progress=False).path
    lines = (path / "history.csv").read_text().splitlines(True)
    (path / "history.csv").write_text("".join([*lines[:2], "nonsense" + lines[2], *lines[3:]]))
    assert "step is 2, was nonsense2" in str(alsph.repeat(path, progress=False))
    (path / "history.csv").write_bytes(lines[0].encode() + b"\xff\n")
    assert "not in the recorded history" in str(alsph.repeat(path, progress=False))
    (path / "history.csv").unlink()
    with pytest.raises(RunFolderError, match="history.csv is missing"):
        alsph.repeat(path, progress=False)


@pytest.mark.parametrize("name", CASES)
def test_pinned_instructions_give_the_same_bits(tmp_path, name):
    case, until = CASES[name]
    file = write_case(tmp_path / "case.toml", case, until=until / 8)
    infos = []
    for pin in ("portable", ""):
        process = command("run", file, "-o", tmp_path / f"run{pin}", env=os.environ | {"ALSPH_INSTRUCTIONS": pin})
        _, errors = process.communicate(timeout=120)
        assert process.returncode == 0, errors
        infos.append(RunFolder(tmp_path / f"run{pin}").info())
    assert infos[0]["instructions"] == "portable"
    assert infos[0]["checkpoint"] == infos[1]["checkpoint"]


def test_instructions_that_do_not_exist_are_refused(tmp_path, small):
    file = write_case(tmp_path / "case.toml", small, until=0.02)
    process = command("run", file, "-o", tmp_path / "run", env=os.environ | {"ALSPH_INSTRUCTIONS": "mmx"})
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 2 and "must be portable or avx2, not mmx" in errors
