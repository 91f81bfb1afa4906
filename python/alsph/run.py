"""The driver of a run: stepping, output schedule, checkpoints, and how a run may end."""

import contextlib
import math
import os
import signal
import threading
import time as clock
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from alsph.config import Config
from alsph.errors import AlsphError, RunFolderError, SolverError
from alsph.io import RunFolder, size_of
from alsph.progress import Reporter, duration
from alsph.provenance import describe, peak_memory, provenance
from alsph.results import Run
from alsph.simulation import SLICE_SECONDS, Simulation, next_multiple


def start(config: Config, path: Path, *, force: bool = False, progress: bool = True) -> Run:
    """Run a case from its start in a new run folder; see :meth:`alsph.cases.Case.run`."""
    folder = RunFolder(path)
    folder.check_new(force=force)
    simulation = config.case.simulation(config.run.threads)
    folder.create(config, 2 * size_of(simulation.problem.state))
    if warning := config.case.time_step_warning():
        folder.log(f"warning: {warning}")
    _Driver(config, folder, simulation).run(progress)
    return Run(path)


def resume(path: str | Path, until: float | None = None, threads: int | None = None, *, progress: bool = True) -> Run:
    """Go on with a run from its checkpoint.

    Parameters
    ----------
    path
        The run folder.
    until
        New end time [D/U]; the run's own if None.
    threads
        Number of threads; the run's own if None.
    progress
        Report progress.

    Raises
    ------
    RunFolderError
        If the folder cannot be resumed.
    SolverError, KeyboardInterrupt
        As :meth:`alsph.cases.Case.run`.
    """
    folder = RunFolder(Path(path))
    config, info = folder.config(), folder.info()
    folder.check_idle()
    if unknown := [name for name in config.case.parameter_names() if name not in config.case.model_fields_set]:
        raise RunFolderError(
            f"{path}/case.toml does not say what {', '.join(unknown)} was: the run is of an older version, and the "
            "defaults of this one would change its method; add the values that it was made with, or run it again"
        )
    changes = {name: value for name, value in (("until", until), ("threads", threads)) if value is not None}
    config = Config(config.case, config.run.replace(**changes))
    state = folder.read_checkpoint()
    if state["time"] >= config.until:
        raise RunFolderError(
            f"{path}: has reached its end, t* = {state['time']:.4g}; go on with --until {2 * state['time']:.3g}"
        )
    simulation = Simulation(config.case.problem(state), config.run.threads)
    folder.truncate(simulation.step, simulation.time)
    folder.write_config(config)
    _Driver(config, folder, simulation, float(info.get("seconds", 0))).run(progress)
    return Run(path)


class _Driver:
    """One run in progress; `seconds` is the time that it has taken before."""

    def __init__(self, config: Config, folder: RunFolder, simulation: Simulation, seconds: float = 0.0) -> None:
        self.config, self.folder, self.simulation = config, folder, simulation
        self.bodies = [body["name"] for body in simulation.problem.settings["bodies"]]
        self.surface = config.case.surface_points()
        self.started = clock.monotonic() - seconds
        self.provenance = provenance(simulation.threads)
        self.unwritten: list[dict[str, Any]] = []
        self.flushed = self.checkpointed = clock.monotonic()
        self.next_output = next_multiple(simulation.time, config.run.output_interval)
        self.next_surface = next_multiple(simulation.time, config.run.surface_interval)

    def run(self, progress: bool) -> None:
        """Step to the end time, and leave a valid folder however the run ends."""
        self.folder.log(
            f"{'resumed' if self.simulation.step else 'started'} at {self.where}: {describe(self.provenance)}"
        )
        with Reporter(self.config.until, self.simulation.time, enabled=progress) as reporter:
            try:
                with _interruptible() as interrupted:
                    finished = self._loop(reporter, interrupted)
            except SolverError as error:
                raise SolverError(self._rescue(str(error))) from None
            except BaseException as error:
                with contextlib.suppress(AlsphError):
                    self._write_status("failed", str(error))
                raise
        if not finished:
            raise KeyboardInterrupt(f"stopped at {self.where}; go on with: alsph resume {self.folder.path}")

    def _loop(self, reporter: Reporter, interrupted: threading.Event) -> bool:
        """Step until the end (True) or until interrupted (False)."""
        if self.simulation.step == 0:
            self._output()
        self._write_status("running")
        while self.simulation.time < self.config.until and not interrupted.is_set():
            self.simulation.run_until(min(self.next_surface, self.next_output, self.config.until), SLICE_SECONDS)
            reporter.update(self._record())
        finished = self.simulation.time >= self.config.until
        self._checkpoint("finished" if finished else "interrupted")
        return finished

    def _record(self) -> dict[str, Any]:
        """Write what is due, and return the new rows of the history."""
        rows, now, time = self.simulation.new_history(), clock.monotonic(), self.simulation.time
        self.unwritten.append(rows)
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
            angle, points = self.surface
            pressure = self.simulation.sample(points)["pressure"]
            self.folder.append_surface(self.simulation.time, angle, 2 * (pressure - rows["inlet_pressure"][-1]))

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
        self.folder.write_checkpoint(self.simulation.state())
        self.checkpointed = clock.monotonic()
        self._write_status(status)

    def _rescue(self, message: str) -> str:
        """Keep what can be had of a run that broke down; the last checkpoint stays as it is."""
        kept = self.folder.read_checkpoint()["time"]
        with contextlib.suppress(AlsphError):
            self.unwritten.append(self.simulation.new_history())
            self._flush()
            if self.simulation.time > kept:
                self.folder.append_particles(self.simulation.time, self.simulation.snapshot())
        message += f"; the last good state, t* = {kept:.4g}, is in {self.folder.path / 'checkpoint.h5'}"
        self._write_status("diverged", message)
        return message

    def _write_status(self, status: str, message: str = "") -> None:
        seconds = round(clock.monotonic() - self.started, 3)
        facts = {
            "status": status,
            "case": self.config.case.name,
            "message": message,
            "time": self.simulation.time,
            "until": self.config.until,
            "step": self.simulation.step,
            "particles": self.simulation.counts,
            "seconds": seconds,
            "peak_memory_bytes": peak_memory(),
            "pid": os.getpid(),
        }
        self.folder.write_info(facts | self.provenance)
        if status != "running":
            self.folder.log(f"{status} at {self.where} after {duration(seconds)}. {message}")

    @property
    def where(self) -> str:
        """Step and time."""
        return f"step {self.simulation.step}, t* = {self.simulation.time:.4g}"


@contextlib.contextmanager
def _interruptible() -> Iterator[threading.Event]:
    """Give an event that Ctrl-C and SIGTERM set, so that no write is cut short.

    Another one a second later or more interrupts at once; before, it is an echo from the terminal or a wrapper.
    """
    event, first = threading.Event(), math.inf

    def handler(_number: int, _frame: FrameType | None) -> None:
        nonlocal first
        if clock.monotonic() > first + 1.0:
            raise KeyboardInterrupt
        first = min(first, clock.monotonic())
        event.set()

    main = threading.current_thread() is threading.main_thread()
    previous = {number: signal.signal(number, handler) for number in (signal.SIGINT, signal.SIGTERM) if main}
    try:
        yield event
    finally:
        for number, old in previous.items():
            signal.signal(number, old)
