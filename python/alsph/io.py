"""The run folder, as it is written: see docs/architecture.md for its files.

Every file is opened, appended to and closed, or written under a temporary name and renamed, so that a run that is cut
leaves a folder that can be read and resumed. Files are not locked, so that a viewer that has one open stops no run.
"""

import csv
import json
import os
import platform
import shutil
import time as clock
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from alsph import config, reading, vtkhdf
from alsph.errors import ConfigError, RunFolderError
from alsph.geometry import FloatArray

AXES = ("x", "y", "z")
SPARE_BYTES = 2 * 2**20
"""Room that must stay free on the disk beside what is written next."""


@dataclass(frozen=True)
class RunFolder:
    """A run folder that is being written.

    Raises
    ------
    RunFolderError
        From every method, if the folder cannot be read or written.
    """

    path: Path

    def check_new(self, *, force: bool) -> None:
        """Check, without touching anything, that the folder can be created (or, with `force`, replaced)."""
        if self.path.exists():
            if not force:
                raise RunFolderError(
                    f"{self.path}: exists already; give another folder, `alsph resume` it, or use --force"
                )
            if not self.path.is_dir() or (any(self.path.iterdir()) and not self._file("run.json").exists()):
                raise RunFolderError(
                    f"{self.path}: not a run folder, so --force does not replace it; give another folder"
                )
            self.check_idle()
        parent = next(parent for parent in self.path.absolute().parents if parent.exists())
        if not parent.is_dir() or not os.access(parent, os.W_OK | os.X_OK):
            raise RunFolderError(f"{self.path}: cannot be created, {parent} is not a folder that can be written to")

    def create(self, configuration: config.Config, size: int = 0) -> None:
        """Create the folder with the resolved configuration if `size` bytes will fit; what it held is removed."""
        self._make_room(size)
        with self._writing():
            if self.path.exists():
                shutil.rmtree(self.path)
            self.path.mkdir(parents=True)
        self.write_config(configuration)

    def write_config(self, configuration: config.Config) -> None:
        """Replace ``case.toml``."""
        with self._writing(), self._replacing("case.toml") as path:
            configuration.save(path)

    def config(self) -> config.Config:
        """Return the resolved configuration."""
        self._require("case.toml")
        try:
            return config.load(self._file("case.toml"))
        except ConfigError as error:
            raise RunFolderError(f"{error}; the folder is damaged or was made by another version") from None

    def check_idle(self) -> None:
        """Check that no other living process on this machine is writing to the folder."""
        info: dict[str, Any] = self.info() if self._file("run.json").exists() else {}
        pid: Any = info.get("pid")
        here = info.get("machine", {}).get("name") == platform.node() and os.name == "posix"
        if info.get("status") != "running" or not here or pid == os.getpid():
            return
        try:
            os.kill(int(pid), 0)
        except (OSError, TypeError, ValueError):
            return
        raise RunFolderError(f"{self.path}: process {pid} is still running it; wait for it or stop it first")

    def info(self) -> dict[str, Any]:
        """Return the content of ``run.json``."""
        return reading.info(self._file("run.json"))

    def write_info(self, info: dict[str, Any]) -> None:
        """Replace ``run.json``."""
        with self._writing(), self._replacing("run.json") as path:
            path.write_text(json.dumps(info, indent=2) + "\n", encoding="utf-8")

    def log(self, line: str) -> None:
        """Append a line to ``run.log``."""
        with self._writing(), self._file("run.log").open("a", encoding="utf-8") as file:
            file.write(f"{clock.strftime('%Y-%m-%d %H:%M:%S')}  {line}\n")

    def append_history(self, rows: dict[str, NDArray[Any]], bodies: list[str]) -> None:
        """Append rows of :meth:`alsph.Simulation.new_history` to ``history.csv``."""
        columns = flatten(rows, bodies)
        self._make_room(2 * size_of(columns))
        with self._writing(), self._file("history.csv").open("a", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            if file.tell() == 0:
                writer.writerow(columns)
            writer.writerows(zip(*(map(_text, column.tolist()) for column in columns.values()), strict=True))

    def append_particles(self, time: float, particles: dict[str, NDArray[Any]]) -> None:
        """Append an output to ``particles.vtkhdf``."""
        self._make_room(size_of(particles))
        with self._writing():
            vtkhdf.append(self._file("particles.vtkhdf"), time, particles)

    def append_surface(self, time: float, angle: FloatArray, pressure_coefficient: FloatArray) -> None:
        """Append a sample of the pressure coefficient (m,) at the angles (m,) [degrees] to ``surface.h5``."""
        self._make_room(pressure_coefficient.nbytes)
        with self._writing(), h5py.File(self._file("surface.h5"), "a", locking=False) as file:
            if "time" not in file:
                file["angle"] = angle
                file.create_dataset(
                    "pressure_coefficient", (0, len(angle)), float, maxshape=(None, len(angle)), chunks=(64, len(angle))
                )
                file.create_dataset("time", (0,), float, maxshape=(None,), chunks=(64,))
            samples = len(file["time"])
            for name, value in (("pressure_coefficient", pressure_coefficient), ("time", time)):
                file[name].resize(samples + 1, axis=0)
                file[name][samples] = value

    def write_checkpoint(self, state: dict[str, Any]) -> None:
        """Replace ``checkpoint.h5``."""
        self._make_room(size_of(state))
        with self._writing(), self._replacing("checkpoint.h5") as path, h5py.File(path, "w") as file:
            for name, value in state.items():
                if np.ndim(value):
                    file.create_dataset(name, data=value, compression="gzip", compression_opts=1, shuffle=True)
                else:
                    file.attrs[name] = value

    def read_checkpoint(self) -> dict[str, Any]:
        """Return the state in ``checkpoint.h5``."""
        self._require("checkpoint.h5")
        try:
            with h5py.File(self._file("checkpoint.h5"), "r") as file:
                state = {name: value.item() for name, value in file.attrs.items()}
                state |= {name: table[()] for name, table in file.items()}
                if not state.keys() >= {"time", "step", "position"}:
                    raise KeyError("no time, step or position")
                return state
        except (OSError, KeyError) as error:
            raise RunFolderError(f"{self._file('checkpoint.h5')}: not a checkpoint, or damaged: {error}") from None

    def truncate(self, step: int, time: float) -> None:
        """Drop the rows, outputs and samples that are later than a checkpoint."""
        with self._writing():
            if self._file("history.csv").exists() and self._file("history.csv").stat().st_size:
                self._truncate_history(step)
            if self._file("particles.vtkhdf").exists():
                vtkhdf.truncate(self._file("particles.vtkhdf"), time)
            if self._file("surface.h5").exists():
                with h5py.File(self._file("surface.h5"), "r+", locking=False) as file:
                    keep = int(np.searchsorted(file["time"][:], time, side="right"))
                    for name in ("pressure_coefficient", "time"):
                        file[name].resize(keep, axis=0)

    def _truncate_history(self, last: int) -> None:
        """Keep the complete rows up to a step."""
        with self._file("history.csv").open(encoding="utf-8") as file, self._replacing("history.csv") as path:
            header = next(file)
            step, columns = header.rstrip().split(",").index("step"), header.count(",")
            complete = (row for row in file if row.endswith("\n") and row.count(",") == columns)
            with path.open("w", encoding="utf-8") as new:
                new.write(header)
                new.writelines(row for row in complete if int(row.split(",")[step]) <= last)

    def _file(self, name: str) -> Path:
        return self.path / name

    def _require(self, name: str) -> None:
        if not self._file(name).is_file():
            raise RunFolderError(f"{self.path}: not a run folder that alsph can use, it has no {name}")

    @contextmanager
    def _replacing(self, name: str) -> Iterator[Path]:
        """Give a temporary path and rename it to `name` at the end."""
        temporary = self._file(f".{name}.new")
        try:
            yield temporary
            temporary.replace(self._file(name))
        finally:
            temporary.unlink(missing_ok=True)

    def _make_room(self, size: int) -> None:
        """Check that `size` bytes will fit, so that no file is left half-written by a full disk."""
        existing = next(folder for folder in (self.path, *self.path.absolute().parents) if folder.exists())
        free, needed = shutil.disk_usage(existing).free, size + SPARE_BYTES
        if free < needed:
            resumable = self._file("checkpoint.h5").exists()
            remedy = f"go on with: alsph resume {self.path}" if resumable else "try again, or use another disk"
            raise RunFolderError(
                f"{self.path}: disk full, {free / 2**20:.1f} MiB are free and {needed / 2**20:.1f} MiB are needed; "
                f"make room and {remedy}"
            )

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise RunFolderError(f"{self.path}: cannot be written: {error}") from None


def size_of(arrays: dict[str, Any]) -> int:
    """Return the size of arrays in memory [bytes]."""
    return sum(np.asarray(array).nbytes for array in arrays.values())


def flatten(rows: dict[str, NDArray[Any]], bodies: list[str]) -> dict[str, NDArray[Any]]:
    """Return the history with vectors split into one column a component, ``BODY_pressure_force_x`` and so on."""
    columns = {}
    for name, values in rows.items():
        if values.ndim == 1:
            columns[name] = values
            continue
        for index, body in enumerate(bodies):
            for component, axis in zip(values[:, index].T, AXES if values.shape[2] > 1 else ("",), strict=False):
                columns[f"{body}_{name}_{axis}".rstrip("_")] = component
    return columns


def _text(value: float) -> str:
    return f"{value:.10g}" if isinstance(value, float) else str(int(value))
