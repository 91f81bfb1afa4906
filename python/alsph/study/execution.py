"""Running a study: what is ready is handed to local processes or to a Dask cluster, and watched through its folders."""

import json
import math
import os
import subprocess
import sys
import time as clock
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any, Protocol

from alsph.arguments import number, whole
from alsph.errors import AlsphError, ConfigError, RunFolderError, WalltimeError
from alsph.study.board import Board
from alsph.study.declaration import RUNS, Point, Study, load, with_starts
from alsph.study.results import Results, check_names
from alsph.study.state import ENDED, State, states
from alsph.study.worker import perform, stop_request
from alsph.text import shown

POLL_SECONDS = 0.5


def run(
    study: str | Path | Study,
    output: str | Path = "runs/studies",
    *,
    preset: str | None = None,
    jobs: int | None = None,
    threads: int = 1,
    scheduler: str | None = None,
    walltime: float = math.inf,
    progress: bool = True,
) -> Results:
    """Make the runs of a study that are missing, and tabulate and draw its results.

    Run folders are named by a hash of the case and the run's settings and lie in ``output/runs``, so that runs are used
    again, resumed where they were cut, and shared between studies. Tables and figures go to ``output/NAME``. A run that
    diverges is a result; one that fails otherwise is reported, and tried again next time.

    Parameters
    ----------
    study
        Name of a study that comes with alsph, a TOML file (see :func:`load`), or a :class:`Study`.
    output
        Folder for runs and results; with a `scheduler`, one that all its workers see under the same path.
    preset
        Preset of the study; its first one if None.
    jobs
        Runs at a time; as many as there are cores for if None. On a cluster its workers' threads decide.
    threads
        Threads of each run.
    scheduler
        Address of a Dask scheduler, for instance ``tcp://127.0.0.1:8786``; local processes if None.
    walltime
        Seconds after which all runs write a checkpoint and the study ends.
    progress
        Report progress.

    Returns
    -------
    Results

    Raises
    ------
    ConfigError, RunFolderError
        If the study or the folder cannot be used.
    KeyboardInterrupt
        At Ctrl-C, after all runs have written a checkpoint.
    WalltimeError
        When the wall time is used up, likewise.
    """
    deadline = clock.monotonic() + number("walltime", walltime, above=0, unit="s")
    if not isinstance(study, Study | str | Path):
        raise ConfigError(f"study = {shown(study)}: must be the name of a study, a TOML file, or a Study")
    study = study if isinstance(study, Study) else load(study, preset)
    output = Path(output)
    points = study.points()
    found = states(points, output)
    left = [point for point in points if found[point.name].status not in ENDED]
    if left:  # else there is nothing to lose
        check_names(study, points)
    jobs = _jobs(jobs, threads) if scheduler is None else 0
    try:
        (output / RUNS).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunFolderError(f"{output}: cannot be created ({error.strerror})") from None
    pool = _LocalPool(jobs) if scheduler is None else _DaskPool(scheduler)
    failures = {}
    runs = list({point.name: point for point in [*with_starts(left), *points]}.values())
    with pool, Board(study, runs, output, enabled=progress) as board:
        failures = _Schedule(runs, output.absolute(), threads, pool, board).work(deadline)
    results = Results.of(study, points, output, failures)
    results.save()
    return results


def _jobs(jobs: int | None, threads: int) -> int:
    """Return the number of local runs at a time: never more threads than cores."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    threads = whole("threads", threads, 1)
    if jobs is None:
        return max(1, cores // threads)
    if whole("jobs", jobs, 1) > 1 and jobs * threads > cores:
        raise ConfigError(
            f"jobs = {jobs}: {jobs} runs of {threads} threads each on {cores} cores; "
            f"use jobs = {max(1, cores // threads)} or less, 1 at least"
        )
    return jobs


class _Pool(Protocol):
    """Where runs are made."""

    def submit(self, tables: dict[str, Any], path: str) -> Any:
        """Start :func:`perform`, as soon as there is room, and return a future with ``done()`` and ``result()``."""

    def __enter__(self) -> Any: ...

    def __exit__(self, *_: Any) -> None: ...


class _LocalPool:
    """Processes on this machine, a fresh one for each run, so that none inherits threads and none takes others down."""

    def __init__(self, jobs: int) -> None:
        self._threads = ThreadPoolExecutor(jobs)

    def __enter__(self) -> "_LocalPool":
        return self

    def __exit__(self, *_: Any) -> None:
        self._threads.shutdown(cancel_futures=True)

    def submit(self, tables: dict[str, Any], path: str) -> "Future[str]":
        return self._threads.submit(self._perform, tables, path)

    @staticmethod
    def _perform(tables: dict[str, Any], path: str) -> str:
        # A session of its own: Ctrl-C reaches the study alone, which then asks its runs to stop.
        done = subprocess.run(
            [sys.executable, "-m", "alsph.study.worker", path, str(os.getpid())],
            input=json.dumps(tables),
            capture_output=True,
            text=True,
            errors="replace",
            start_new_session=True,
        )
        if done.returncode:
            reason = (done.stderr.strip().splitlines() or ["no message"])[-1]
            how = f"signal {-done.returncode}" if done.returncode < 0 else f"exit code {done.returncode}"
            raise RunFolderError(f"{path}: its process ended with {how}: {reason}")
        return done.stdout.split()[-1]


class _DaskPool:
    """The workers of a Dask cluster. A run whose worker dies is given to another one, which resumes it."""

    def __init__(self, scheduler: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise ConfigError(
                "scheduler: Dask is not installed; install alsph with its extra: pip install '.[cluster]'"
            ) from None
        try:
            self._client = Client(scheduler, timeout="10s", set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            raise ConfigError(f"scheduler = {scheduler!r}: no Dask scheduler answers there ({error})") from None

    def __enter__(self) -> "_DaskPool":
        return self

    def __exit__(self, *_: Any) -> None:
        self._client.close()

    def submit(self, tables: dict[str, Any], path: str) -> Any:
        return self._client.submit(perform, tables, path, pure=False)


class _Schedule:
    """The runs of a study on their way through a pool."""

    def __init__(self, points: list[Point], output: Path, threads: int, pool: _Pool, board: Board) -> None:
        self.points, self.output, self.threads, self.pool, self.board = points, output, threads, pool, board
        self.futures: dict[str, Any] = {}
        self.failures: dict[str, str] = {}

    def work(self, deadline: float) -> dict[str, str]:
        """Make all runs; return the messages of those that failed."""
        for point in self.points:
            stop_request(self._folder(point)).unlink(missing_ok=True)
        try:
            while self._advance():
                if clock.monotonic() >= deadline:
                    raise WalltimeError("time limit reached; each run goes on when the study is run again")
                clock.sleep(POLL_SECONDS)
        except BaseException as error:
            self._stop()
            if isinstance(error, KeyboardInterrupt):
                raise KeyboardInterrupt(
                    "stopped; each run goes on from its checkpoint when the study is run again"
                ) from None
            raise
        return self.failures

    def _advance(self) -> bool:
        """Hand out what is ready and take in what is done; return whether anything is left."""
        self._take_in()
        found = self.states()
        elsewhere = False
        for point in self.points:
            status = found[point.name].status
            if point.name in self.futures or point.name in self.failures or status in ENDED:
                continue
            if status == "running":  # another study makes it: wait for that
                elsewhere = True
            elif all(found[other.name].status == "finished" for other in (point.after, point.start) if other):
                tables = point.tables(self.output / RUNS)
                tables["run"] |= {"threads": self.threads}
                self.futures[point.name] = self.pool.submit(tables, str(self._folder(point)))
        self.board.update(found)
        return bool(self.futures) or elsewhere

    def _take_in(self) -> None:
        for name, future in list(self.futures.items()):
            if future.done():
                del self.futures[name]
                try:
                    if (how := future.result()) == "stopped":
                        self.failures[name] = "was stopped"
                except Exception as error:  # whatever befell one run, the others go on
                    self.failures[name] = str(error) if isinstance(error, AlsphError) else repr(error)
                else:
                    self.board.ended(name, how)
                if name in self.failures:
                    self.board.say(f"failed: {self.board.labels[name]}: {self.failures[name]}")

    def states(self) -> dict[str, State]:
        """States of the runs; those that failed in this session are not tried again in it."""
        return states(self.points, self.output, self.failures)

    def _folder(self, point: Point) -> Path:
        return self.output / RUNS / point.name

    def _stop(self) -> None:
        """Have all runs write a checkpoint and end; the requests stay for those that see them late."""
        self.board.say("stopping: each run writes a checkpoint")
        found = self.states()
        for name, future in self.futures.items():
            stop_request(self.output / RUNS / name).touch()
            if found[name].status != "running":
                future.cancel()
        while not all(future.done() for future in self.futures.values()):
            clock.sleep(POLL_SECONDS)
