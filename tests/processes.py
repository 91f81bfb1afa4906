"""Runs in processes of their own, and what their folders tell in the end; also for benches/faults.py."""

import subprocess
import sys
import time as clock

import h5py
from alsph.config import Config, RunSettings
from alsph.folder import checkpoint
from alsph.folder.run_folder import RunFolder

MAIN = [sys.executable, "-c", "from alsph.cli import main; main()"]


def command(*arguments, **options):
    """Start a command line in a process of its own."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([*MAIN, *map(str, arguments)], **pipes | options)


def bits(path):
    """Return all that a run folder tells of the flow: state, history, particles and surface pressure."""
    found = {"history": (path / "history.csv").read_text(), "step": RunFolder(path).info()["step"]}
    state = RunFolder(path).read_checkpoint().state
    found["state"] = checkpoint.digest(state)
    for name in ("particles.vtkhdf", "surface.h5"):
        if (path / name).exists():
            with h5py.File(path / name) as file:
                names = []
                file.visit(names.append)
                found[name] = {key: file[key][()].tobytes() for key in names if isinstance(file[key], h5py.Dataset)}
    return found


def write_case(path, case, **run):
    Config(case, RunSettings(**run)).save(path)
    return path


def wait_until_stepping(path, process, seconds=60.0):
    """Wait until a process has begun to step in a run folder."""
    end = clock.monotonic() + seconds
    while process.poll() is None:
        info = RunFolder(path).last_info()
        if (info.get("pid"), info.get("status")) == (process.pid, "running"):
            return
        assert clock.monotonic() < end, "waited in vain"
        clock.sleep(0.01)
