"""The run folder, as it is written: see docs/architecture.md for its files.

Whatever cuts a run, it can be resumed: see :mod:`alsph.folder.durable`. One process at a time writes to a
folder, which holds its lock; the files themselves are not locked, so that a viewer that has one open stops no run.
"""

import itertools
import json
import os
import platform
import re
import shutil
import stat
import time as clock
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import filelock

from alsph.arrays import Arrays, size_of
from alsph.engine.output import Output
from alsph.engine.prescribed import Prescription
from alsph.errors import DamagedError, OtherPointsError, RunFolderError
from alsph.folder import checkpoint, history, reading, vtkhdf
from alsph.folder.checkpoint import Checkpoint
from alsph.folder.durable import flush, is_plain, replacing
from alsph.folder.reading import DAMAGE
from alsph.text import printable

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

LOCK = ".lock"
CHECKPOINTS = ("checkpoint.h5", "checkpoint.previous.h5")
START = "start.h5"
"""The particles that a run began with, in the form of a checkpoint, where they are not its case's own."""
MARKS = ("case.toml", "run.json")
"""What tells that a folder is a run folder."""
OWN = re.compile(
    r"\.?(case\.toml|run\.json|run\.log|\.?lock|(checkpoint(\.previous)?|history|particles|surface|(probes|flow)(_si)?|planes|gauges|start|breakdown)(\.damaged\d*)?"
    r"\.(h5|csv|vtkhdf|vti|nc))(\.new|\.journal)?"
    r"|(ledger|gauges|((forces|spectrum|pressure_coefficient)(_of_\w+)?)|pressure|vorticity|velocity(_divergence|_at_tu_d_\w+|_at_\d+_degrees_\w+)?|q_criterion|lambda_2|kinetic_energy"
    r"|[uv]_at_[xy]_d_2|front(_\w+_19\d\d)?|pressure_at_\w+|elevation_at_the_gauge(_experiment)?|heave|flow_rate|velocity_downstream"
    r"|force_coefficient_over_the_last_period|(velocity_in_front_of|force_on)_the_structure|velocity_of_the_sphere"
    r")\.(png|pdf|svg|gif|mp4|webm)"
)
"""Names of the files that alsph makes in a run folder and its figures, and removes when the folder is replaced."""
GOING_ON = ("starting", "running")
"""What ``run.json`` says of a run that goes on."""
UNFINISHED = (*GOING_ON, "interrupted")
"""What ``run.json`` says of a run that goes on or can go on."""
SPARE_BYTES = 2 * 2**20
"""Room that must stay free on the disk beside what is written next."""
PATIENCE_SECONDS = 2.0
"""How long the lock of a folder is waited for: a killed process holds it while the system clears it away."""


class Declared(Protocol):
    """What a run folder is made for: a case and its settings (:class:`alsph.config.Config`)."""

    @property
    def name(self) -> str:
        """Name of the case."""

    @property
    def until(self) -> float:
        """End time [D/U]."""

    def text(self) -> str:
        """Return all parameters as TOML."""


@dataclass
class RunFolder:
    """A run folder that is being written.

    Raises
    ------
    RunFolderError
        From every method, if the folder cannot be read or written.
    """

    path: Path
    _claim: os.stat_result | None = field(default=None, init=False, repr=False)

    def check_new(self, *, force: bool, configuration: Declared | None = None) -> None:
        """Check, without touching anything, that the folder can be created (or, with `force`, replaced)."""
        if self.path.exists():
            found = {entry.name for entry in self.path.iterdir()} if self.path.is_dir() else {self.path.name}
            if found - {LOCK}:
                is_run = self._is_replaceable(configuration)
                if not force:
                    ways = ", `alsph resume` it, or use --force (in Python force=True)" if is_run else ""
                    raise RunFolderError(f"{self.path}: exists already; give another folder{ways}")
                if not is_run:
                    raise RunFolderError(
                        f"{self.path}: not a run folder, so --force does not replace it, without its "
                        f"{' and '.join(MARKS)}; give another folder"
                    )
        parent = next(parent for parent in self.path.absolute().parents if parent.exists())
        if not parent.is_dir() or not os.access(parent, os.W_OK | os.X_OK):
            raise RunFolderError(f"{self.path}: cannot be created, {parent} is not a folder that can be written to")

    def _is_replaceable(self, configuration: Declared | None) -> bool:
        """Whether the folder is that of a run, or was about to become that of this one when it was cut."""
        case, info = (self._file(name) for name in MARKS)
        try:
            if info.exists():
                return case.is_file() and "status" in reading.info(info)
            return configuration is not None and case.read_bytes() == configuration.text().encode()
        except (OSError, RunFolderError):
            return False

    @contextmanager
    def claimed(self) -> Iterator[None]:
        """Hold the folder, which is made if it does not exist; another process that wants to write to it is refused."""
        with self._writing():
            self.path.mkdir(parents=True, exist_ok=True)
            self._check_entries()
            lock = filelock.FileLock(self._file(LOCK), timeout=PATIENCE_SECONDS, fallback_to_soft=False)
            try:
                lock.acquire()
            except filelock.Timeout:
                raise RunFolderError(f"{self.path}: {self._holder()}; wait for it or stop it first") from None
            self._claim = self._file(LOCK).stat()
        try:
            yield
        finally:
            self._claim = None
            lock.release()

    def _check_entries(self) -> None:
        """Refuse a folder through which files elsewhere would be written."""
        for entry in self.path.iterdir():
            if not is_plain(entry, stat.S_ISREG, stat.S_ISDIR):
                raise RunFolderError(
                    f"{entry}: a link or a special file; alsph does not write to a folder that has one"
                )

    def is_busy(self) -> bool | None:
        """Whether a living process, wherever it is, holds the folder; None where that cannot be told."""
        try:
            if fcntl is None:
                if self._file(LOCK).exists():
                    with filelock.FileLock(self._file(LOCK), timeout=0, fallback_to_soft=False):
                        pass
            else:  # a lock that is shared with others who look, and needs no right to write
                with self._file(LOCK).open("rb") as file:
                    fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
            return False
        except (BlockingIOError, filelock.Timeout):
            return True
        except FileNotFoundError:
            return False
        except OSError:  # a lock that cannot be read
            return None

    def _holder(self) -> str:
        """Who is at work in the folder, in words."""
        info = self.last_info()
        machine = info.get("machine")
        name = machine.get("name") if isinstance(machine, dict) else None
        return f"process {info.get('pid', '?')} on {name or 'a machine not known'} is still running it"

    def create(self, configuration: Declared, size: int = 0) -> None:
        """Begin with the resolved configuration if `size` bytes will fit; alsph's own files of before are removed."""
        self._make_room(size)
        outputs = [re.escape(str(name)) for name in self.last_info().get("outputs", ())]
        own = re.compile("|".join([OWN.pattern, *(rf"\.?{name}(\.new|\.journal)?" for name in outputs)]))
        with self._writing():
            self.path.mkdir(parents=True, exist_ok=True)
            if self._file("run.json").exists():
                self.announce(configuration)  # before the run that it tells of is no more
            for path in [*self.path.iterdir(), *self._file("figures").glob("*")]:
                # What tells that this is a run folder stays, so that a cut leaves one.
                if own.fullmatch(path.name) and path.name not in (*MARKS, LOCK) and not path.is_dir():
                    path.unlink()
            with suppress(OSError):  # unless there is something of the user's in it
                self._file("figures").rmdir()
        self.write_config(configuration)

    def announce(self, configuration: Declared) -> None:
        """Replace ``run.json`` by that of a run before its first step."""
        facts = {"status": "starting", "case": configuration.name, "until": configuration.until}
        self.write_info(facts | {"pid": os.getpid(), "machine": {"name": platform.node()}})

    def write_config(self, configuration: Declared) -> None:
        """Replace ``case.toml``."""
        with self._writing(), replacing(self._file("case.toml")) as path:
            path.write_bytes(configuration.text().encode())

    def info(self) -> dict[str, Any]:
        """Return the content of ``run.json``."""
        return reading.info(self._file("run.json"))

    def last_info(self) -> dict[str, Any]:
        """Return the same, or nothing where it is missing or damaged: what a run can go on without."""
        try:
            return self.info()
        except RunFolderError:
            return {}

    def write_info(self, info: dict[str, Any]) -> None:
        """Replace ``run.json``."""
        with self._writing(), replacing(self._file("run.json")) as path:
            path.write_text(json.dumps(info, indent=2) + "\n", encoding="utf-8")

    def log(self, line: str) -> None:
        """Append a line to ``run.log``."""
        with self._writing(), self._file("run.log").open("a", encoding="utf-8") as file:
            file.write(f"{clock.strftime('%Y-%m-%d %H:%M:%S')}  {printable(line)}\n")

    def append_history(self, rows: Arrays, bodies: list[str]) -> None:
        """Append rows of :meth:`alsph.Simulation.new_history` to ``history.csv``.

        That of an older alsph is given the columns that it lacks first.
        """
        columns = history.flatten(rows, bodies)
        path = self._file("history.csv")
        with self._writing():
            known = history.names(path)
        missing = [name for name in columns if name not in known]
        self._make_room(2 * size_of(columns) + (2 * path.stat().st_size if known and missing else 0))
        with self._writing():
            if known and missing:
                history.widen(path, missing)
            history.append(path, columns, [*known, *missing])

    def append_particles(self, time: float, particles: Arrays) -> None:
        """Append an output to ``particles.vtkhdf``."""
        self.append("particles.vtkhdf", lambda path: vtkhdf.append(path, time, particles), size_of(particles))

    def append(self, name: str, append: Callable[[Path], None], size: int = 0) -> None:
        """Append `size` bytes to a file; one that has been damaged since is set aside, and a new one begun."""
        self._make_room(size)
        path = self._file(name)
        with self._writing():
            if remark := _unless_damaged(path, append):
                self.log(f"warning: {remark}")
                warnings.warn(f"{self.path}: {remark}", RuntimeWarning, stacklevel=2)
                append(path)

    def append_output(self, output: Output) -> None:
        """Append what an output has recorded.

        Raises
        ------
        RunFolderError
            If it fails, whatever its error: it names the output.
        """
        if OWN.fullmatch(output.file):
            self.append(output.file, output.append)
        else:
            self._make_room(0)
            self._ask(output, output.append)

    def _ask(self, output: Output, change: Callable[[Path], None]) -> None:
        """Let an output that is not alsph's change its file."""
        with self._writing():
            try:
                change(self._file(output.file))
            except Exception as error:
                raise RunFolderError(f"{self.path}: output {output.file}: {type(error).__name__}: {error}") from error

    def write_breakdown(self, outputs: list[tuple[float, Arrays]]) -> Path:
        """Replace ``breakdown.vtkhdf``: the particles before and after the step that broke down."""
        self._make_room(sum(size_of(particles) for _, particles in outputs))
        path = self._file("breakdown.vtkhdf")
        with self._writing(), replacing(path) as temporary:
            for time, particles in outputs:
                vtkhdf.append(temporary, time, particles)
        return path

    def write_start(self, state: dict[str, Any], case: dict[str, Any]) -> None:
        """Write ``start.h5``."""
        self._make_room(size_of(state))
        with self._writing():
            checkpoint.write(self._file(START), None, state, case)

    def read_start(self) -> dict[str, Any] | None:
        """Return the particles that the run began with, None if they are those of its case."""
        return checkpoint.read(self._file(START)).state if self._file(START).exists() else None

    def write_checkpoint(
        self, state: dict[str, Any], case: dict[str, Any], prescribed: Mapping[str, Prescription] | None = None
    ) -> None:
        """Write ``checkpoint.h5``; the one before is kept. The history up to it is made safe first."""
        self._make_room(size_of(state))
        with self._writing():
            if self._file("history.csv").exists():
                flush(self._file("history.csv"))
            checkpoint.write(self._file(CHECKPOINTS[0]), self._file(CHECKPOINTS[1]), state, case, prescribed)

    def has_checkpoint(self) -> bool:
        """Whether there is a checkpoint, be it damaged."""
        return any(self._file(name).exists() for name in CHECKPOINTS)

    def read_checkpoint(self) -> Checkpoint:
        """Return the newest checkpoint that is sound."""
        errors: list[DamagedError] = []
        for name in CHECKPOINTS:
            try:
                found = checkpoint.read(self._file(name))
            except DamagedError as error:
                errors.append(error)
                continue
            damaged = errors and self._file(CHECKPOINTS[0]).exists()
            return replace(found, warning=f"{errors[0]}; going back to {name}") if damaged else found
        raise errors[0]

    def has_previous_checkpoint(self) -> bool:
        """Whether there is one before the newest."""
        return self._file(CHECKPOINTS[1]).exists()

    def drop_newest_checkpoint(self) -> None:
        """Let the checkpoint before the newest take its place."""
        with self._writing():
            self._file(CHECKPOINTS[1]).replace(self._file(CHECKPOINTS[0]))
            flush(self.path)

    def set_damaged_aside(self) -> None:
        """Keep the newest checkpoint, which is damaged, from displacing the sound one before it."""
        with self._writing():
            self._file(CHECKPOINTS[0]).replace(self._file("checkpoint.damaged.h5"))

    def truncate(self, step: int, time: float, outputs: Iterable[Output] = ()) -> list[str]:
        """Drop the rows, particles and `outputs` later than a checkpoint, all of them before the first step.

        Returns
        -------
        list of str
            Which files were damaged; they are set aside under another name.
        """
        damaged = []
        with self._writing():
            parts: dict[str, Callable[[Path], None]] = {
                "history.csv": lambda path: history.truncate(path, step),
                "particles.vtkhdf": lambda path: vtkhdf.truncate(path, time),
            }
            outputs = list(outputs)
            parts |= {
                output.file: partial(output.truncate, time=time) for output in outputs if OWN.fullmatch(output.file)
            }
            if step == 0:
                for name in (*parts, *(output.file for output in outputs)):
                    self._file(name).unlink(missing_ok=True)
            for output in outputs:
                if output.file not in parts and self._file(output.file).exists():
                    self._ask(output, partial(output.truncate, time=time))
            for name, cut in parts.items():
                if self._file(name).exists() and (remark := _unless_damaged(self._file(name), cut)):
                    damaged.append(remark)
        return damaged

    def _file(self, name: str) -> Path:
        return self.path / name

    def _make_room(self, size: int) -> None:
        """Check that `size` bytes will fit, so that no file is left half-written by a full disk."""
        existing = next(folder for folder in (self.path, *self.path.absolute().parents) if folder.exists())
        free, needed = shutil.disk_usage(existing).free, size + SPARE_BYTES
        if free < needed:
            resumable = self.has_checkpoint()
            remedy = f"go on with: alsph resume {self.path}" if resumable else "try again, or use another disk"
            raise RunFolderError(
                f"{self.path}: disk full, {free / 2**20:.1f} MiB are free and {needed / 2**20:.1f} MiB are needed; "
                f"make room and {remedy}"
            )

    @contextmanager
    def _writing(self) -> Iterator[None]:
        if self._claim and not _is_still(self._claim, self._file(LOCK)):
            raise RunFolderError(f"{self.path}: was removed or replaced under the run, which has nowhere to write to")
        try:
            yield
        except OSError as error:
            raise RunFolderError(f"{self.path}: cannot be written: {error}") from None


def _is_still(stat: os.stat_result, path: Path) -> bool:
    """Whether a path leads to the same file as before."""
    try:
        return os.path.samestat(stat, path.stat())
    except OSError:
        return False


def _unless_damaged(path: Path, change: Callable[[Path], None]) -> str:
    """Change a file; if it is damaged, set it aside under another name and return what to say of it."""
    there = path.exists()
    try:
        change(path)
    except DAMAGE as error:
        if not there or (isinstance(error, OSError) and error.errno is not None):  # the disk's, not the file's
            raise
        why, mark = f"is damaged ({error})", "damaged"
        if isinstance(error, OtherPointsError):
            why, mark = str(error), "former"
        names = (path.with_name(f"{path.stem}.{mark}{number or ''}{path.suffix}") for number in itertools.count())
        aside = next(name for name in names if not name.exists())
        path.replace(aside)
        return f"{path.name} {why} and is set aside as {aside.name}"
    return ""
