"""How far the runs of a study are, as their folders tell."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from alsph.errors import RunFolderError
from alsph.folder.run_folder import UNFINISHED, RunFolder
from alsph.study.declaration import RUNS, Point, with_starts
from alsph.text import printable

ENDED = ("finished", "diverged", "skipped")
TAIL_BYTES = 4096


@dataclass(frozen=True)
class State:
    """State of a run.

    Attributes
    ----------
    status : str
        ``waiting``, ``running``, ``stopped`` (goes on when the study is run again), ``finished``, ``diverged``,
        ``failed``, or ``skipped`` because a run before it, or the one that it starts with, diverged.
    time : float
        Time reached [D/U].
    seconds : float
        Computing time so far.
    message : str
        What a run that did not finish says.
    """

    status: str
    time: float = 0.0
    seconds: float = 0.0
    message: str = ""


def states(points: Sequence[Point], output: Path, failures: Mapping[str, str] | None = None) -> dict[str, State]:
    """Return the states of runs by name, from the run folders in ``output/runs``; `failures` are messages by name.

    Those that runs start with are among them.
    """
    found: dict[str, State] = {}
    for point in with_starts(points):
        before = {found[other.name].status for other in (point.after, point.start) if other}
        cut = before & {"diverged", "skipped"}
        found[point.name] = State("skipped") if cut else state(output / RUNS / point.name)
    for name, message in (failures or {}).items():
        found[name] = replace(found[name], status="failed", message=message)
    return found


def state(path: Path) -> State:
    """Return the state of the run in a folder."""
    folder = RunFolder(path)
    try:
        info = folder.info() if (path / "run.json").exists() else {}
    except RunFolderError as error:
        return State("failed", message=str(error))
    status, time = str(info.get("status", "waiting")), float(info.get("time", 0.0))
    message = str(info.get("message", ""))
    if folder.is_busy():
        status, time = "running", max(time, _last_time(path / "history.csv"))
    elif status in UNFINISHED:
        if status != "interrupted":
            message = "no process is at work in it; goes on when the study is run again"
        status = "stopped"
    return State(printable(status), time, float(info.get("seconds", 0.0)), printable(message))


def _last_time(path: Path) -> float:
    """Time of the last complete row of a history, 0 if there is none; reads its end only."""
    try:
        with path.open("rb") as file:
            names = file.readline().decode().strip().split(",")
            file.seek(max(file.tell(), os.fstat(file.fileno()).st_size - TAIL_BYTES))
            lines = [line for line in file.read().decode().split("\n")[:-1] if line.count(",") == len(names) - 1]
            return float(lines[-1].split(",")[names.index("time")])
    except (OSError, ValueError, IndexError):
        return 0.0
