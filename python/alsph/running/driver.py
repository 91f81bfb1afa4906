"""One run in progress: steps, outputs, checkpoints and retries."""

import contextlib
import math
import os
import signal
import threading
import time as clock
from typing import Any

import numpy as np

from alsph.config import Config
from alsph.engine.simulation import Simulation
from alsph.engine.times import SLICE_SECONDS, next_multiple
from alsph.errors import AlsphError, Interrupted, SolverError, WalltimeError
from alsph.folder import checkpoint
from alsph.folder.reading import History
from alsph.folder.run_folder import RunFolder
from alsph.results.ending import judge, next_judgement
from alsph.results.run import Run
from alsph.running import beginning
from alsph.running.control import Control, interruptible
from alsph.running.outputs import outputs_of, record, remarks_of
from alsph.running.progress import Reporter
from alsph.running.provenance import describe, peak_memory, provenance
from alsph.text import duration

RETRY_FACTOR = 0.5
"""By how much a retry shortens the time step and its share of the stability law."""


class Driver:
    """One run in progress; `info` is what ``run.json`` says of it before."""

    def __init__(self, config: Config, folder: RunFolder, simulation: Simulation, info: dict[str, Any]) -> None:
        self.folder = folder
        self.started = clock.monotonic() - float(info.get("seconds", 0))
        spent = info.get("cpu_seconds", math.nan if "seconds" in info else 0.0)  # an older alsph did not tell
        self.cpu_started = clock.process_time() - float(spent)
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
        self.remarks = remarks_of(config, simulation.state())
        if self.start is not None and simulation.step == 0:
            self.start["state_sha256"] = self.saved["state_sha256"]

    def _go_on_with(self, config: Config, simulation: Simulation) -> None:
        """Take a case and a simulation of it, and note from which step on."""
        self.config, self.simulation = config, simulation
        self.bodies = [body["name"] for body in simulation.problem.settings["bodies"]]
        self.outputs = outputs_of(config)
        self.due = [next_multiple(simulation.time, output.interval) for output in self.outputs]
        self.next_output = next_multiple(simulation.time, config.run.output_interval)
        self.next_judgement = self._next_judgement()
        self.recorded = History(self.folder.path / "history.csv")
        self.ended: dict[str, Any] = {}
        self.unwritten: list[dict[str, Any]] = []
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
        for remark in self.remarks:
            self.folder.log(f"remark: {remark}")
        at_most = self.config.converges
        with Reporter(self.config.until, self.simulation.time, at_most=at_most, enabled=control.progress) as reporter:
            for remark in self.remarks:
                reporter.say(f"remark: {remark}")
            try:
                with interruptible(control.stop) as signals:
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
        while not self._over and not stop.is_set():
            began = clock.monotonic()
            stops = (*self.due, self.next_output, self.next_judgement, self.config.until)
            self.simulation.run_until(min(stops), SLICE_SECONDS)
            reporter.update(self._record(reporter))
            self.pause = max(self.pause, clock.monotonic() - began)
            if clock.monotonic() + 2 * self.pause >= self.deadline:
                break
        self._checkpoint("finished" if self._over else "interrupted")
        return self._over

    @property
    def _over(self) -> bool:
        return bool(self.ended) or self.simulation.time >= self.config.until

    def _record(self, reporter: Reporter) -> dict[str, Any]:
        """Write what is due, and return the new rows of the history."""
        rows, now, time = self.simulation.new_history(keep=False), clock.monotonic(), self.simulation.time
        self.unwritten.append(rows)
        if self.simulation.backflow and not self.logged_backflow:
            self.folder.log(f"warning: {self.simulation.backflow}")
            self.logged_backflow = True
        if len(rows["time_step"]):
            self.time_step = float(rows["time_step"][-1])
        if time >= self.next_judgement:
            self._judge(reporter)
        for number, output in enumerate(self.outputs):
            if time >= self.due[number]:
                self.due[number] = next_multiple(time, output.interval)
                record(output, self.simulation, rows)
        if time >= self.next_output or self._over:
            self.next_output = next_multiple(time, self.config.run.output_interval)
            self._output()
        elif now - self.checkpointed >= 60 * self.config.run.checkpoint_minutes:
            self._checkpoint()
        elif now - self.flushed >= self.config.run.flush_seconds:
            self._flush()
        return rows

    def _next_judgement(self) -> float:
        """Return when the run is judged next, which one with an end time never is."""
        return min(next_judgement(self.simulation.time), self.config.until) if self.config.converges else math.inf

    def _judge(self, reporter: Reporter) -> None:
        """Ask whether the run has converged.

        That it has is told by ``run.json`` before there is a checkpoint from which the run could go on all the same.
        """
        self._flush()
        self.next_judgement = self._next_judgement()
        run = Run(self.folder.path)
        run.config, run.history = self.config, self.recorded.read()
        found = judge(run, self.config)
        reporter.judged(str(found), found.end)
        if found.ended:
            self.ended = {"why": found.ended, "remark": found.remark, "step": self.simulation.step}
            self.ended["settings"] = self.config.ending
            self._write_status("running")
            self.folder.log(found.remark)
            reporter.say(found.remark)

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
        for output in self.outputs:
            self.folder.append_output(output)
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
        message += "; --retry 3 goes back and on with half the step, again and again"
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
        self.folder.truncate(self.simulation.step, self.simulation.time, self.outputs)
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
            "until": self.simulation.time if self.ended else self.config.until,
            "step": self.simulation.step,
            "checkpoint": self.saved,
            "particles": self.simulation.counts,
            "seconds": seconds,
            "peak_memory_bytes": peak_memory(),
            "pid": os.getpid(),
            "case_class": type(self.config.case).__qualname__,
            "rules": sorted(self.simulation.rules),
            "began": self.began,
            "outputs": [output.file for output in self.outputs],
            "segments": self.segments,
            "retries": self.retries,
        }
        if math.isfinite(self.cpu_started):
            facts["cpu_seconds"] = round(clock.process_time() - self.cpu_started, 3)
        if self.start is not None:
            facts["start"] = self.start
        if self.ended:
            facts["ended"] = self.ended
        self.folder.write_info(facts | self.provenance)
        if status != "running":
            self.folder.log(f"{status} at {self.where} after {duration(seconds)}. {message}")

    @property
    def where(self) -> str:
        """Step and time."""
        return f"step {self.simulation.step}, t* = {self.simulation.time:.4g}"
