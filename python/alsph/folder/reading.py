"""Readers of the files in a run folder; each refuses what it cannot trust with a :class:`RunFolderError`."""

import json
import math
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from alsph.analysis.probes import Probes
from alsph.arrays import FloatArray
from alsph.errors import RunFolderError
from alsph.folder.durable import viewing
from alsph.geometry.particles import Snapshot
from alsph.geometry.surface import Surface
from alsph.memory import free_memory
from alsph.parameters import LARGEST
from alsph.text import contents

LARGEST_EXPANSION = 1032
"""Bytes that deflate makes of one byte at most."""

SURFACE_EXPANSION = 20
"""The same in ``surface.h5``, which alsph does not compress."""

FILTERS = {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32}

DAMAGE = (OSError, LookupError, ValueError, TypeError, AttributeError, RuntimeError, OverflowError)
"""What the readers of HDF5 files raise at damaged ones."""

MOST_BYTES = 2**26
"""Of a text file that says what a run is."""

SNAPSHOT_FIELDS = ("velocity", "pressure", "velocity_divergence", "vorticity", "kind")


@contextmanager
def _refusing(path: Path, *errors: type[Exception]) -> Iterator[None]:
    try:
        yield
    except FileNotFoundError:
        raise RunFolderError(f"{path.parent}: {path.name} is missing; is this a run folder of alsph?") from None
    except MemoryError:
        raise RunFolderError(f"{path}: larger than the memory that is free") from None
    except errors as error:
        raise RunFolderError(f"{path}: unreadable, truncated or being written ({error})") from None


def case(path: Path) -> dict[str, Any]:
    """Read ``case.toml``: the parameters by name, the ``run`` table among them."""
    with _refusing(path, OSError, ValueError, RecursionError):
        content = tomllib.loads(contents(path, MOST_BYTES).decode("utf-8-sig"))
    for name in ("resolution", "reynolds"):
        if not isinstance(content.get(name), (int, float)) or not 0 < content[name] < LARGEST:
            raise RunFolderError(
                f"{path}: {name} is missing, not positive or too large; is this a run folder of alsph?"
            )
    return content


def info(path: Path) -> dict[str, Any]:
    """Read ``run.json``."""
    with _refusing(path, OSError, ValueError, RecursionError):
        content = json.loads(contents(path, MOST_BYTES))
    if not isinstance(content, dict):
        raise RunFolderError(f"{path}: holds no table; is this a run folder of alsph?")
    kinds: dict[str, Any] = {
        "time": (int, float),
        "seconds": (int, float),
        "cpu_seconds": (int, float),
        "step": int,
        "segments": list,
        "retries": list,
        "machine": dict,
        "checkpoint": dict,
        "began": dict,
        "start": dict,
        "case_class": str,
        "ended": dict,
    }
    tables: dict[str, dict[str, Any]] = {
        "segments": {"step": int, "case": dict},
        "retries": {"step": int, "time_step": (int, float)},
        "checkpoint": {"step": int, "time": (int, float), "state_sha256": str},
        "start": {"state_sha256": str},
        "ended": {"step": int, "remark": str},
    }
    found: list[tuple[Any, dict[str, Any], bool]] = [(content, kinds, False)]
    for name, inner in tables.items():
        parts = content.get(name, [])
        found += [(part, inner, True) for part in (parts if isinstance(parts, list) else [parts])]
    with _refusing(path, OverflowError):
        for table, _, _ in found:
            numbers = [value for value in table.values() if isinstance(value, int)] if isinstance(table, dict) else []
            max(map(float, numbers), default=0.0)  # whole numbers have no limit in JSON
    if not all(_of_kinds(table, inner, complete) for table, inner, complete in found):
        raise RunFolderError(f"{path}: damaged, an entry is not of its kind")
    return content


def _of_kinds(table: Any, kinds: dict[str, Any], complete: bool) -> bool:
    """Whether a table's entries are of their kinds and, if it is to be `complete`, all there."""
    return isinstance(table, dict) and all(
        isinstance(table[name], kind) if name in table else not complete for name, kind in kinds.items()
    )


class History:
    """``history.csv`` of a run that may be going on: what has been added is read, not all of it again."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._forget()

    def _forget(self) -> None:
        self._names: list[str] = []
        self._columns, self._count = np.empty((0, 0)), 0  # with room for more rows than there are
        self._end, self._last = 0, b""  # how far it has been read, and the line there

    def read(self) -> dict[str, FloatArray]:
        """Return the columns, without lines that are cut short; an empty ``time`` if there is no file yet.

        Raises
        ------
        RunFolderError
            If it is unreadable, or times do not increase.
        """
        try:
            if not self.path.exists():
                self._forget()
            elif added := self._added():
                self._append(added)
        except RunFolderError:
            self._forget()
            raise
        return dict(zip(self._names, self._columns[:, : self._count], strict=True)) or {"time": np.empty(0)}

    def _added(self) -> bytes:
        """Return the whole lines that have not been read yet: all of them if it is another file than before."""
        most = int(min(free_memory(), LARGEST)) // 10
        with _refusing(self.path, OSError):
            text = contents(self.path, most, self._end - len(self._last))
            if not text.startswith(self._last):  # cut back or replaced
                self._forget()
                text = contents(self.path, most)
        end = text.rfind(b"\n") + 1
        if text and not (self._names or end):
            raise RunFolderError(f"{self.path}: its first line is cut short; is this a run folder of alsph?")
        return text[len(self._last) : end]

    def _append(self, added: bytes) -> None:
        with _refusing(self.path, UnicodeDecodeError):
            lines = added.decode("utf-8-sig").splitlines()
        if not self._names:
            self._names = lines.pop(0).split(",")
            if "time" not in self._names:
                raise RunFolderError(f"{self.path}: no column 'time' in the first line; is this a run folder of alsph?")
            self._columns = np.empty((len(self._names), 0))
        rows = [line for line in lines if line.count(",") == len(self._names) - 1]
        count = self._count + len(rows)
        if count > self._columns.shape[1]:
            self._columns = np.pad(self._columns[:, : self._count], ((0, 0), (0, len(rows) + count // 4)))
        with _refusing(self.path, ValueError):
            if rows:
                self._columns[:, self._count : count] = np.loadtxt(rows, delimiter=",", ndmin=2).T
        self._check(max(self._count - 1, 0), count)
        self._count = count
        self._end += len(added)
        self._last = added[added.rfind(b"\n", 0, -1) + 1 :]

    def _check(self, first: int, end: int) -> None:
        """Refuse times that do not increase."""
        time = self._columns[self._names.index("time"), first:end]
        if not (increases := np.diff(time) > 0).all():
            row = int(np.argmin(increases))
            told = f"tU/D = {time[row + 1]:.10g} stands behind {time[row]:.10g}"
            raise RunFolderError(f"{self.path}: {told}; the file was edited or damaged")


def history(path: Path) -> dict[str, FloatArray]:
    """Read ``history.csv`` by column, without lines that are cut short; an empty ``time`` if there is no file yet."""
    return History(path).read()


@contextmanager
def _opened(path: Path) -> Iterator[h5py.File]:
    with _refusing(path, *DAMAGE):
        with viewing(path) as file:
            yield file


def sound(file: h5py.Group, name: str, expansion: float = LARGEST_EXPANSION) -> h5py.Dataset:
    """Return an array in an HDF5 file if it can be read without harm.

    What a header says is believed only as far as the bytes of the file bear it out: an array that is larger than they
    can be expanded to (by a factor of `expansion`), lies in another file, or does not consist of plain numbers is
    refused.

    Raises
    ------
    ValueError
        If it is not to be read.
    """
    array = file
    for part in name.split("/"):
        link = array.get(part, getlink=True) if isinstance(array, h5py.Group) else None
        if link is None:
            raise KeyError(f"no {name}")
        if not isinstance(link, h5py.HardLink):
            raise ValueError(f"{name} is a link to elsewhere")
        array = array[part]
    if not isinstance(array, h5py.Dataset) or array.is_virtual or array.external:
        raise ValueError(f"{name} is no array of this file")
    if array.dtype.kind not in "iufb" or array.dtype.hasobject:
        raise ValueError(f"{name} is of type {array.dtype}, not of numbers")
    filters = array.id.get_create_plist()
    if {filters.get_filter(index)[0] for index in range(filters.get_nfilters())} - FILTERS:
        raise ValueError(f"{name} is compressed in a way that alsph does not use")
    stored = array.id.get_storage_size()
    if array.size * array.dtype.itemsize > expansion * stored:
        raise ValueError(f"{name} claims {array.shape} entries, more than its {stored} bytes can hold")
    return array


def rows(array: h5py.Dataset, chosen: slice = slice(None)) -> NDArray[Any]:
    """Read rows of an array, if they fit into the memory that is free as numbers of eight bytes.

    Raises
    ------
    RunFolderError
        If they do not.
    """
    count = len(range(*chosen.indices(array.shape[0]))) if array.ndim else 1
    size, free = count * math.prod(array.shape[1:]) * max(8, array.dtype.itemsize), free_memory()
    if size > free:
        raise RunFolderError(
            f"{array.file.filename}: {array.name} takes {size / 2**30:.1f} GiB of memory, {free / 2**30:.1f} are free"
        )
    return np.asarray(array[chosen])


def surface(path: Path) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Read ``surface.h5``: angle (m,), time (k,) and pressure coefficient (k, m), all empty if there is no file yet."""
    if not path.exists():
        return np.empty(0), np.empty(0), np.empty((0, 0))
    with _opened(path) as file:
        names = ("angle", "time", "pressure_coefficient")
        angle, time, samples = (np.asarray(rows(sound(file, name, SURFACE_EXPANSION)), float) for name in names)
        if angle.ndim != 1 or time.ndim != 1 or samples.ndim != 2 or samples.shape[1] != len(angle):
            raise ValueError(f"shapes {angle.shape}, {time.shape}, {samples.shape} do not match")
    count = min(len(time), len(samples))
    return angle, time[:count], samples[:count]


def probes(path: Path, dimensions: int) -> Probes:
    """Read ``probes.h5`` or ``planes.h5``; all arrays are empty if there is no file."""
    if not path.exists():
        empty = np.empty((0, dimensions))
        return Probes(empty, np.empty(0), empty[None][:0], np.empty((0, 0)))
    with _opened(path) as file:
        names = ("position", "time", "velocity", "pressure")
        arrays = {name: np.asarray(rows(sound(file, name, SURFACE_EXPANSION)), float) for name in names}
        count = min(len(arrays[name]) for name in names[1:])
        position, time, velocity, pressure = arrays["position"], *(arrays[name][:count] for name in names[1:])
        if position.shape[1:] != (dimensions,) or (velocity.shape, pressure.shape) != (
            (count, *position.shape),
            (count, len(position)),
        ):
            raise ValueError(f"shapes {position.shape}, {velocity.shape}, {pressure.shape} do not match")
        return Probes(position, time, velocity, pressure)


def surface_points(path: Path) -> Surface | None:
    """Read the geometry of the points in ``surface.h5``; None if there is no file yet or it is of an older version."""
    if not path.exists():
        return None
    with _opened(path) as file:
        if "position" not in file:
            return None
        names = [field.name for field in fields(Surface) if field.name in file]
        arrays = {name: np.asarray(rows(sound(file, name, SURFACE_EXPANSION)), float) for name in names}
        for name, values in arrays.items():
            if values.shape != (arrays["angle"].size, 2)[: 2 if name in ("position", "normal") else 1]:
                raise ValueError(f"{name} of shape {values.shape} does not match {arrays['angle'].size} points")
        return Surface(**arrays)


def snapshot_times(path: Path) -> FloatArray:
    """Read the times tU/D of the complete snapshots in ``particles.vtkhdf``, none if there is no file yet."""
    if not path.exists():
        return np.empty(0)
    with _opened(path) as file:
        times = rows(sound(file, "VTKHDF/Steps/Values"), slice(int(file["VTKHDF/Steps"].attrs["NSteps"])))
        return np.asarray(times, float)


def snapshot_fields(path: Path, steps: Sequence[int], names: Sequence[str]) -> Iterator[list[FloatArray]]:
    """Read fields of the particles of some snapshots of ``particles.vtkhdf``, of one at a time."""
    with _opened(path) as file:
        for step in steps:
            yield _fields(file, step, [f"PointData/{name}" for name in names])


def _fields(file: h5py.File, step: int, names: Sequence[str]) -> list[FloatArray]:
    root = file["VTKHDF"]
    part = int(sound(root, "Steps/PartOffsets")[step])
    first = int(sound(root, "Steps/PointOffsets")[step])
    own = slice(first, first + int(sound(root, "NumberOfPoints")[part]))
    fields = [np.asarray(rows(sound(root, name), own), float) for name in names]
    if not all(len(values) == own.stop - own.start > 0 for values in fields):
        raise ValueError(f"snapshot {step} is incomplete")
    return fields


def snapshot(path: Path, step: int) -> Snapshot:
    """Read one snapshot of ``particles.vtkhdf``."""
    with _opened(path) as file:
        position, *values = _fields(file, step, ("Points", *(f"PointData/{name}" for name in SNAPSHOT_FIELDS)))
        time = float(sound(file["VTKHDF"], "Steps/Values")[step])
    fields = dict(zip(SNAPSHOT_FIELDS, values, strict=True))
    dimensions = 3 if fields["vorticity"].ndim == 2 else 2
    return Snapshot(
        time=time,
        position=position[:, :dimensions],
        velocity=fields["velocity"][:, :dimensions],
        pressure=fields["pressure"],
        velocity_divergence=fields["velocity_divergence"],
        vorticity=fields["vorticity"],
        kind=fields["kind"].astype(np.uint8),
    )
