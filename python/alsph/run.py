"""The driver of a run: stepping, output schedule, checkpoints, and how a run may end."""

import contextlib
import math
import os
import signal
import threading
import time as clock
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from alsph import beginning, checkpoint, config
from alsph.checkpoint import Checkpoint
from alsph.config import Config
from alsph.errors import AlsphError, ConfigError, DamagedError, Interrupted, RunFolderError, SolverError, WalltimeError
from alsph.inflow import difference
from alsph.io import RunFolder, size_of
from alsph.outline import Outline
from alsph.progress import Reporter, duration
from alsph.provenance import describe, peak_memory, provenance
from alsph.results import Run
from alsph.simulation import SLICE_SECONDS, Simulation, next_multiple
from alsph.text import shown

RETRY_FACTOR = 0.5
"""By how much a retry shortens the time step and its share of the stability law."""

FIXED = ("dimensions", "particle_spacing", "smoothing_ratio", "kernel", "domain", "bodies")
"""Settings of the engine that the particles were made for: they cannot change in mid-run."""


@dataclass(frozen=True)
class Control:
    """What a run obeys beside its configuration.

    Attributes
    ----------
    progress : bool
        Report progress.
    stop : threading.Event
        Ends the run as Ctrl-C does once it is set, which another thread may do.
    walltime : float
        Seconds after which the run is to have written a checkpoint and ended.
    retry : int
        How often a run that breaks down goes back to a checkpoint and on with a smaller time step.
    """

    progress: bool = True
    stop: threading.Event = field(default_factory=threading.Event)
    walltime: float = math.inf
    retry: int = 0
    deadline: float = field(init=False)

    def __post_init__(self) -> None:
        """Refuse numbers without sense."""
        if not (isinstance(self.walltime, int | float | np.number) and self.walltime > 0):
            raise ConfigError(f"walltime = {shown(self.walltime)}: must be a number above zero [s]")
        if not (isinstance(self.retry, int) and self.retry >= 0):
            raise ConfigError(f"retry = {shown(self.retry)}: must be a whole number, 0 or more")
        object.__setattr__(self, "deadline", clock.monotonic() + self.walltime)


def start(config: Config, path: Path, control: Control | None = None, *, force: bool = False) -> Run:
    """Run a case from its start in a new run folder: :meth:`alsph.cases.Case.run`."""
    control, folder = control or Control(), RunFolder(path)
    folder.check_new(force=force, configuration=config)
    simulation = config.case.simulation(config.run.threads, config.run.initial_run)
    remarks, info = beginning.of(config)
    with folder.claimed():
        folder.check_new(force=force, configuration=config)  # another process may have been faster
        folder.create(config, 3 * size_of(simulation.problem.state))
        folder.announce(config)
        for remark in remarks:
            folder.log(f"warning: {remark}")
        if isinstance(outline := getattr(config.case, "shape", None), Outline):
            folder.log(f"outline: {outline}")
        if config.run.initial_run is not None:
            folder.write_start(simulation.state(), config.case_tables())
        _Driver(config, folder, simulation, {"start": info}).run(control)
    return Run(path)


def complete(config: Config, path: Path, control: Control | None = None) -> Run:
    """Return the finished run of a case in a folder: as it is there, resumed, or run from the start.

    A folder with another case, inflow or beginning in it, or without a checkpoint that can be read, is replaced. The
    number of threads is that of `config`.
    """
    if (path / "case.toml").exists():
        folder = RunFolder(path)
        kept = folder.config()
        info = folder.last_info()
        # Retries shorten the time step: the run is still that of the case that it began with.
        began = info.get("began", {}) if info.get("retries") else kept.case_tables()
        alike = (began, kept.until) == (config.case_tables(), config.until)
        if alike and beginning.alike(config, kept, folder, info):
            if info.get("status") == "finished":
                return Run(path)
            try:
                folder.read_checkpoint()
            except DamagedError:
                pass
            else:
                return _resume(folder, None, config.run.threads, control or Control())
    return start(config, path, control, force=True)


def resume(
    path: str | Path,
    until: float | None = None,
    threads: int | None = None,
    *,
    walltime: float = math.inf,
    retry: int = 0,
    progress: bool = True,
) -> Run:
    """Go on with a run from its newest checkpoint that is sound; a run that has reached its end stays as it is.

    Parameters
    ----------
    path
        The run folder.
    until
        New end time [D/U]; the run's own if None.
    threads
        Number of threads; the run's own if None.
    walltime, retry, progress
        As in :meth:`alsph.cases.Case.run`.

    Warns
    -----
    RuntimeWarning
        If the newest checkpoint is damaged, or the settings in ``case.toml`` are not those that the run was made with.

    Raises
    ------
    RunFolderError
        If the folder cannot be resumed, or another process is at work in it.
    SolverError, WalltimeError, Interrupted
        As :meth:`alsph.cases.Case.run`.
    """
    return _resume(RunFolder(Path(path)), until, threads, Control(progress, walltime=walltime, retry=retry))


def _resume(folder: RunFolder, until: float | None, threads: int | None, control: Control) -> Run:
    folder.config()  # refuses what is no run folder before the claim makes one
    with folder.claimed():
        config, info = folder.config(), folder.last_info()
        _check_parameters(config, folder)
        beginning.check_class(config.case, info, folder.path)
        changes = {name: value for name, value in (("until", until), ("threads", threads)) if value is not None}
        own_end, config = config.until, Config(config.case, config.run.replace(**changes))
        saved = folder.read_checkpoint()
        if not isinstance(saved.state["time"], float):
            raise RunFolderError(f"{folder.path}: its checkpoint is of no time")
        if saved.state["time"] >= config.until:
            if until is not None:
                reached = f"the run has reached t* = {saved.state['time']:.6g}, and until = {until:g}"
                warnings.warn(f"{folder.path}: nothing to be done: {reached}", RuntimeWarning, stacklevel=3)
            if info.get("status") != "finished" and saved.state["time"] >= own_end:  # cut after its last step
                folder.write_info(info | {"status": "finished"})
            return Run(folder.path)
        remarks = [saved.warning] if saved.warning else []
        if saved.case is None:
            remarks.append("its checkpoint, of an older alsph, does not tell its settings: those in case.toml are used")
        elif changed := _changes(config, saved, folder):
            remarks.append(f"goes on with other settings than before: {', '.join(changed)}")
        config.case.check_memory(config.run.threads)
        simulation = beginning.restored(config, saved, folder)
        if change := difference(simulation.inflow, saved.inflow):
            remarks.append(f"goes on with {change}")
        remarks += beginning.changed(config, info)
        if saved.warning:
            folder.set_damaged_aside()
        remarks += folder.truncate(simulation.step, simulation.time)
        folder.write_config(config)
        for remark in remarks:
            folder.log(f"warning: {remark}")
            warnings.warn(f"{folder.path}: {remark}", RuntimeWarning, stacklevel=3)
        _Driver(config, folder, simulation, info).run(control)
    return Run(folder.path)


def _check_parameters(config: Config, folder: RunFolder) -> None:
    """Refuse a file that does not say what it should: the defaults may not be those that it was made with."""
    fields = type(config.case).model_fields
    given = config.case.model_fields_set | {name for name, field in fields.items() if field.default is None}
    if unknown := [name for name in config.case.parameter_names() if name not in given]:
        raise RunFolderError(
            f"{folder.path}/case.toml does not say what {', '.join(unknown)} was: the run is of an older version, and "
            "the defaults of this one would change its method; add the values that it was made with, or run it again"
        )


def _changes(now: Config, saved: Checkpoint, folder: RunFolder) -> list[str]:
    """Say how the case differs from the one that a checkpoint was made with."""
    then, tables = saved.case or {}, now.case_tables()
    if then == tables:
        return []
    try:
        before = config.from_tables(then, folder.path, Path()).case
    except ConfigError as error:
        raise RunFolderError(f"{folder.path}: the case of its checkpoint cannot be used: {error}") from None
    old, new = (case.problem(saved.state).settings for case in (before, now.case))
    fixed = [name for name in FIXED if old[name] != new[name]]
    made_for = [name for name in now.case.made_for if getattr(before, name) != getattr(now.case, name)]
    if fixed := made_for + fixed:
        raise RunFolderError(
            f"{folder.path}/case.toml has been changed in what the particles were made for ({', '.join(fixed)}); "
            "undo the change, or start a new run"
        )
    names = [name for name in then | tables if then.get(name) != tables.get(name) and name not in now.case.made_for]
    return [f"{name} = {tables.get(name)} (was {then.get(name)})" for name in names]


class _Driver:
    """One run in progress; `info` is what ``run.json`` says of it before."""

    def __init__(self, config: Config, folder: RunFolder, simulation: Simulation, info: dict[str, Any]) -> None:
        self.folder = folder
        self.started = clock.monotonic() - float(info.get("seconds", 0))
        self.provenance = provenance(simulation.threads)
        self.segments: list[dict[str, Any]] = info.get("segments", [])
        self.retries: list[dict[str, Any]] = info.get("retries", [])
        last = self.retries[-1] if self.retries else None
        if last and last["step"] == simulation.step and last["time_step"] < config.case.largest_time_step:
            self.retries.pop()  # killed between its note and the new time step: it has not taken effect
        self.start: dict[str, Any] | None = info.get("start")  # None: an older alsph began it
        self.began = info.get("began", config.case_tables()) if self.retries else config.case_tables()
        self.rewound = self.logged_backflow = False
        self.time_step = math.inf
        self.pause = 0.0
        self._go_on_with(config, simulation)
        if self.start is not None and simulation.step == 0:
            self.start["state_sha256"] = self.saved["state_sha256"]

    def _go_on_with(self, config: Config, simulation: Simulation) -> None:
        """Take a case and a simulation of it, and note from which step on."""
        self.config, self.simulation = config, simulation
        self.bodies = [body["name"] for body in simulation.problem.settings["bodies"]]
        self.surface = config.case.surface_points()
        self.next_output = next_multiple(simulation.time, config.run.output_interval)
        self.next_surface = next_multiple(simulation.time, config.run.surface_interval)
        self.unwritten: list[dict[str, Any]] = []
        self.samples: list[tuple[float, Any]] = []
        self.flushed = self.checkpointed = clock.monotonic()
        self._note_checkpoint(simulation.state())
        self.written = simulation.step or -1
        self.segments = [part for part in self.segments if part["step"] < simulation.step]
        if not self.segments or self.segments[-1]["case"] != config.case_tables():
            self.segments.append({"step": simulation.step, "case": config.case_tables()})

    def run(self, control: Control) -> None:
        """Step to the end time, and leave a valid folder however the run ends."""
        self.deadline = control.deadline
        verb = "resumed" if self.simulation.step else "started"
        self.folder.log(f"{verb} at {self.where}: {describe(self.provenance)}")
        remarks = self.config.case.remarks()
        for remark in remarks:
            self.folder.log(f"remark: {remark}")
        with Reporter(self.config.until, self.simulation.time, enabled=control.progress) as reporter:
            for remark in remarks:
                reporter.say(f"remark: {remark}")
            try:
                with _interruptible(control.stop) as signals:
                    finished = self._work(reporter, control)
            except SolverError:
                raise
            except BaseException as error:
                with contextlib.suppress(AlsphError):
                    self._write_status("interrupted" if isinstance(error, Interrupted) else "failed", str(error))
                raise
        if finished:
            return
        go_on = f"stopped at {self.where}; go on with: alsph resume {self.folder.path}"
        if control.stop.is_set():
            raise Interrupted(go_on, signals[0] if signals else signal.SIGINT)
        raise WalltimeError(f"time limit of {duration(control.walltime)} reached: {go_on}")

    def _work(self, reporter: Reporter, control: Control) -> bool:
        """Step until the end (True), or until interrupted or out of time (False); breakdowns are retried."""
        for attempt in range(control.retry + 1):
            try:
                return self._loop(reporter, control.stop)
            except SolverError as error:
                message = self._rescue(str(error))
                if attempt == control.retry:
                    raise SolverError(message) from None
                self._rewind(message)
        raise AssertionError("the last attempt returns or raises")

    def _loop(self, reporter: Reporter, stop: threading.Event) -> bool:
        if self.simulation.step == 0:
            self._output()
        self._write_status("running")
        while self.simulation.time < self.config.until and not stop.is_set():
            began = clock.monotonic()
            self.simulation.run_until(min(self.next_surface, self.next_output, self.config.until), SLICE_SECONDS)
            reporter.update(self._record())
            self.pause = max(self.pause, clock.monotonic() - began)
            if clock.monotonic() + 2 * self.pause >= self.deadline:
                break
        finished = self.simulation.time >= self.config.until
        self._checkpoint("finished" if finished else "interrupted")
        return finished

    def _record(self) -> dict[str, Any]:
        """Write what is due, and return the new rows of the history."""
        rows, now, time = self.simulation.new_history(keep=False), clock.monotonic(), self.simulation.time
        self.unwritten.append(rows)
        if self.simulation.backflow and not self.logged_backflow:
            self.folder.log(f"warning: {self.simulation.backflow}")
            self.logged_backflow = True
        if len(rows["time_step"]):
            self.time_step = float(rows["time_step"][-1])
        if time >= self.next_surface:
            self.next_surface = next_multiple(time, self.config.run.surface_interval)
            self._sample_surface(rows)
        if time >= min(self.next_output, self.config.until):
            self.next_output = next_multiple(time, self.config.run.output_interval)
            self._output()
        elif now - self.checkpointed >= 60 * self.config.run.checkpoint_minutes:
            self._checkpoint()
        elif now - self.flushed >= self.config.run.flush_seconds:
            self._flush()
        return rows

    def _sample_surface(self, rows: dict[str, Any]) -> None:
        """Sample C_p = (p − p_0) / (½ρU²), with p_0 the pressure at the inlet."""
        if self.surface:
            pressure = self.simulation.sample(self.surface.position)["pressure"]
            self.samples.append((self.simulation.time, 2 * (pressure - rows["inlet_pressure"][-1])))

    def _output(self) -> None:
        self.folder.append_particles(self.simulation.time, self.simulation.snapshot())
        self._checkpoint()

    def _flush(self) -> None:
        if rows := [rows for rows in self.unwritten if len(rows["step"])]:
            self.folder.append_history(
                {name: np.concatenate([part[name] for part in rows]) for name in rows[0]}, self.bodies
            )
        self.unwritten, self.flushed = [], clock.monotonic()

    def _checkpoint(self, status: str = "running") -> None:
        self._flush()
        if self.samples and self.surface:
            times, samples = (np.array(values) for values in zip(*self.samples, strict=True))
            self.folder.append_surface(times, self.surface.angle, samples, self.surface.arrays())
            self.samples = []
        if self.written != self.simulation.step:  # else it is there, and must not displace the one before
            state = self.simulation.state()
            self.folder.write_checkpoint(state, self.config.case_tables(), self.simulation.prescribed)
            self._note_checkpoint(state)
            self.rewound, self.written = False, self.simulation.step
        self._write_status(status)
        self.checkpointed = clock.monotonic()

    def _note_checkpoint(self, state: dict[str, Any]) -> None:
        digest = checkpoint.digest(state)
        self.saved = {"step": self.simulation.step, "time": self.simulation.time, "state_sha256": digest}

    def _rescue(self, message: str) -> str:
        """Keep what can be had of a run that broke down; the last checkpoint stays as it is."""
        message += f"; the last good state, t* = {self.saved['time']:.4g}, is in {self.folder.path / 'checkpoint.h5'}"
        with contextlib.suppress(AlsphError):
            self.unwritten.append(self.simulation.new_history(keep=False))
            self._flush()
            path = self.folder.write_breakdown(self.simulation.breakdown())
            message += f", the particles before and after the step in {path}"
        with contextlib.suppress(AlsphError):
            self._write_status("diverged", message)
        return message

    def _rewind(self, message: str) -> None:
        """Take smaller steps from the newest checkpoint on, or from the one before it if that was no help."""
        if self.rewound and self.folder.has_previous_checkpoint():
            self.folder.drop_newest_checkpoint()
        saved = self.folder.read_checkpoint()
        case = self.config.case
        taken = min(case.largest_time_step, self.time_step / case.particle_spacing)
        step = RETRY_FACTOR * taken
        bound = "courant" if case.courant else "time_step_safety"
        shorter = case.replace(**{"time_step": step, bound: RETRY_FACTOR * getattr(case, bound)})
        config, broke_down = Config(shorter, self.config.run), self.where
        self._go_on_with(config, beginning.restored(config, saved, self.folder))
        self.rewound = True
        self.folder.truncate(self.simulation.step, self.simulation.time)
        self.retries = [retry for retry in self.retries if retry["step"] <= self.simulation.step]
        self.retries.append({"step": self.simulation.step, "time_step": step, "message": message})
        self._write_status("running")
        self.folder.write_config(config)
        self.folder.log(f"retry: back from {broke_down} to {self.where}, with time_step = {step:.4g}")

    def _write_status(self, status: str, message: str = "") -> None:
        seconds = round(clock.monotonic() - self.started, 3)
        facts = {
            "status": status,
            "case": self.config.case.name,
            "message": message,
            "time": self.simulation.time,
            "until": self.config.until,
            "step": self.simulation.step,
            "checkpoint": self.saved,
            "particles": self.simulation.counts,
            "seconds": seconds,
            "peak_memory_bytes": peak_memory(),
            "pid": os.getpid(),
            "case_class": type(self.config.case).__qualname__,
            "inflow_function": self.simulation.inflow is not None,
            "began": self.began,
            "segments": self.segments,
            "retries": self.retries,
        }
        if self.start is not None:
            facts["start"] = self.start
        self.folder.write_info(facts | self.provenance)
        if status != "running":
            self.folder.log(f"{status} at {self.where} after {duration(seconds)}. {message}")

    @property
    def where(self) -> str:
        """Step and time."""
        return f"step {self.simulation.step}, t* = {self.simulation.time:.4g}"


@contextlib.contextmanager
def _interruptible(event: threading.Event) -> Iterator[list[int]]:
    """Have Ctrl-C, SIGTERM and SIGHUP set an event, so that no write is cut short; gives the signals that have come.

    Another one a second later or more interrupts at once; before, it is an echo from the terminal or a wrapper.
    """
    first, numbers = math.inf, []

    def handler(number: int, _frame: FrameType | None) -> None:
        nonlocal first
        if clock.monotonic() > first + 1.0:
            raise Interrupted("stopped at once; `alsph resume` goes on from the last checkpoint", number)
        first = min(first, clock.monotonic())
        numbers.append(number)
        event.set()

    main = threading.current_thread() is threading.main_thread()
    caught = [signal.SIGINT, signal.SIGTERM]
    if getattr(signal, "SIGHUP", None) and signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # as nohup has it
        caught.append(signal.SIGHUP)
    previous = {number: signal.signal(number, handler) for number in caught if main}
    try:
        yield numbers
    finally:
        for number, old in previous.items():
            signal.signal(number, old)
