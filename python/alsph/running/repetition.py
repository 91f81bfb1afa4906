"""Repeating a run: the same steps again, compared with what its folder holds."""

import contextlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from alsph import config
from alsph.arguments import path_of
from alsph.config import Config
from alsph.engine.prescribed import WORDS, difference
from alsph.engine.simulation import Simulation
from alsph.engine.times import SLICE_SECONDS
from alsph.errors import ConfigError, DamagedError, RunFolderError
from alsph.folder import checkpoint
from alsph.folder.history import UNKNOWN, flatten, lines
from alsph.folder.run_folder import START, RunFolder
from alsph.run_settings import RunSettings
from alsph.running import beginning
from alsph.running.progress import Reporter
from alsph.running.provenance import provenance

UNLIKE_START = (
    "the particles at the start are not those that the run began with: another NumPy or another alsph places them "
    "otherwise"
)


@dataclass(frozen=True)
class Repetition:
    """How a run compares with its repetition.

    Attributes
    ----------
    steps : int
        Steps repeated.
    same_state : bool
        Whether the state at the end is the same to the last bit.
    first_difference : str
        Where the history differs first, empty where it does not.
    environment : list of str
        What is not as it was when the run was made.
    """

    steps: int
    same_state: bool
    first_difference: str
    environment: list[str]

    @property
    def same(self) -> bool:
        """Whether state and history are the same."""
        return self.same_state and not self.first_difference

    def __str__(self) -> str:
        """Tell the result in a line or a few."""
        verdict = "the same to the last bit" if self.same else "not the same"
        lines = [f"{self.steps} steps repeated: {verdict}"]
        if not self.same:
            lines += [self.first_difference or "the history is the same, the state at its end is not"]
        return "\n".join(lines + [f"unlike the run: {fact}" for fact in self.environment])


def repeat(path: str | Path, threads: int | None = None, *, progress: bool = True) -> Repetition:
    """Repeat a run from its start to its last checkpoint, and compare history and state; nothing is written.

    Parameters
    ----------
    path
        The run folder.
    threads
        Number of threads; the run's own if None.
    progress
        Report progress.

    Raises
    ------
    RunFolderError
        If the folder does not hold what a repetition needs.
    SolverError
        If the computation breaks down, which it did not in the run.
    """
    folder = RunFolder(path_of("run", path, "run folder"))
    info, settings = folder.info(), config.of_run(folder.path).run
    if not info.get("segments") or not info.get("checkpoint"):
        raise RunFolderError(f"{path}/run.json does not tell with what steps the run was made; it is of an older alsph")
    threads = threads or settings.threads
    parts = [(int(part["step"]), _case(part["case"], settings, folder)) for part in info["segments"]]
    if parts[0][0] != 0:
        raise RunFolderError(f"{path}/run.json knows the run from step {parts[0][0]} on only; it cannot be repeated")
    beginning.check_class(parts[0][1].case, info, folder.path)
    simulation = _begun(parts[0][1], parts[-1][1], threads, folder, info)
    bodies = [body["name"] for body in simulation.problem.settings["bodies"]]
    recorded = folder.path / "history.csv"
    start, until = info.get("start", {}).get("state_sha256"), info["checkpoint"]["time"]
    unequal = "" if start in (None, checkpoint.digest(simulation.state())) else UNLIKE_START
    if not recorded.is_file():
        raise RunFolderError(f"{path}: {recorded.name} is missing, with which the repetition is compared")
    with recorded.open(encoding="utf-8", errors="replace") as file, Reporter(until, 0.0, enabled=progress) as reporter:
        names = next(file, "").rstrip().split(",")
        unknown = set(names) - {"step", "time"}
        ends = [*(step for step, _ in parts[1:]), int(info["checkpoint"]["step"])]
        for (_, part), end in zip(parts, ends, strict=True):
            if simulation.step:
                simulation = part.case.restored(simulation.state(), threads)
            while simulation.step < end and not unequal:
                simulation.advance(end - simulation.step, SLICE_SECONDS)
                rows = simulation.new_history(keep=False)
                reporter.update(rows)
                for now in lines(flatten(rows, bodies)):
                    unequal = unequal or _difference(names, next(file, ""), now, unknown)
    return Repetition(
        steps=simulation.step,
        same_state=checkpoint.digest(simulation.state()) == info["checkpoint"]["state_sha256"],
        first_difference=unequal,
        environment=_environment(simulation, folder, info),
    )


def _environment(simulation: Simulation, folder: RunFolder, then: dict[str, Any]) -> list[str]:
    """Say what is not as it was when the run was made."""
    now, facts = provenance(simulation.threads), ("versions", "commit", "instructions", "threads")
    found = [f"{name}: {now[name]}, was {then.get(name)}" for name in facts if now[name] != then.get(name)]
    with contextlib.suppress(DamagedError):  # of which a repetition needs nothing else
        if change := difference(simulation.rules, folder.read_checkpoint().prescribed):
            found.append(change)
    return found


def _begun(first: Config, last: Config, threads: int | None, folder: RunFolder, info: dict[str, Any]) -> Simulation:
    """Return a simulation at the start of a run, with the flow that it began with and its first settings."""
    cannot = f"{folder.path}: cannot be repeated because"
    try:
        state = folder.read_start()
    except DamagedError as error:
        raise RunFolderError(f"{cannot} the flow that it began with is damaged: {error}") from None
    start = info.get("start")
    initial = first.run.initial_run if start is None else start.get("initial_run")  # an older alsph has no `start`
    if state is None and initial is not None:
        raise RunFolderError(f"{cannot} it began with the flow of another run, '{initial}', and has no {START}")
    simulation = first.case.restored(state, threads) if state else first.case.simulation(threads)
    for name in beginning.rules_of(info):
        if name not in simulation.rules.keys() | last.case.rules.keys():
            raise RunFolderError(
                f"{cannot} a function prescribes its {WORDS[name]}, and its case does not tell of any; make it the "
                f"method `{name}` of the case's class"
            )
    return simulation


def _case(tables: Any, settings: RunSettings, folder: RunFolder) -> Config:
    try:
        return Config(config.from_tables(tables, folder.path, Path()).case, settings)
    except (ConfigError, TypeError) as error:
        raise RunFolderError(f"{folder.path}/run.json: the case of a segment cannot be used: {error}") from None


def _difference(names: list[str], then: str, now: dict[str, str], unknown: set[str]) -> str:
    """Say where a row of the history differs from the line that was recorded, or return nothing.

    What an older alsph did not record is not compared: columns that are not there, and those that are `unknown` up to
    here and in this row, which stay in that set.
    """
    recorded = then.rstrip("\n").split(",")
    if len(recorded) != len(names) or "step" not in names:
        return f"step {now['step']}: not in the recorded history"
    was = dict(zip(names, recorded, strict=True))
    unknown.intersection_update(name for name, text in was.items() if text == UNKNOWN)
    for name, value in now.items():
        if name in unknown or was.get(name, value) == value:
            continue
        try:
            change = f" (by {abs(float(value) - float(was[name])):.3g})"
        except ValueError:  # a damaged line
            change = ""
        return f"step {now['step']}: {name} is {value}, was {was[name]}{change}"
    return ""
