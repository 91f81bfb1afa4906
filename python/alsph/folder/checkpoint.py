"""Checkpoints: all that a run needs to go on to the last bit, in one HDF5 file whose damage is noticed.

The first 512 bytes, which HDF5 leaves to its user, hold the format's name and version and the SHA-256 of all that
follows, so that a damaged file is refused before the HDF5 library sees it. Behind them are the arrays of
:meth:`alsph.Simulation.state`, its numbers as attributes, the case as the bytes of a JSON text and, where rules
prescribe something, what they gave last. Version 1 had neither head nor case.
"""

import hashlib
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np

from alsph.engine.core import OF_BODIES, TYPES
from alsph.engine.prescribed import WORDS, Prescription
from alsph.errors import DamagedError, RunFolderError
from alsph.folder.durable import replacing
from alsph.folder.reading import DAMAGE, rows, sound

VERSION = 2
HEAD_BYTES = 512
NAME = b"alsph checkpoint"
HDF5 = b"\x89HDF\r\n\x1a\n"
CASE = "case"
PRESCRIBED = {"time": "time", "position": "position", "values": "velocity"}
READ_BYTES = 2**20


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """What a checkpoint holds.

    Attributes
    ----------
    state : dict
        See :meth:`alsph.Simulation.state`.
    case : dict, optional
        The tables of the case that the run was made with; None in a checkpoint of version 1.
    warning : str
        Why it is not the newest one.
    prescribed : dict of Prescription
        What each of the rules gave last, by its name; in a checkpoint of an older alsph perhaps not.
    """

    state: dict[str, Any]
    case: dict[str, Any] | None
    warning: str = ""
    prescribed: Mapping[str, Prescription] = field(default_factory=dict)


def write(
    path: Path,
    previous: Path | None,
    state: dict[str, Any],
    case: dict[str, Any],
    prescribed: Mapping[str, Prescription] | None = None,
) -> None:
    """Write a checkpoint; the one that was there becomes `previous`."""
    content = io.BytesIO()  # the HDF5 library does not bear a disk that fails
    with h5py.File(content, "w", userblock_size=HEAD_BYTES) as file:
        file[CASE] = np.frombuffer(json.dumps(case).encode(), np.uint8)
        for name, value in state.items():
            if np.ndim(value):
                file.create_dataset(name, data=value, compression="gzip", compression_opts=1, shuffle=True)
            else:
                file.attrs[name] = value
        for rule, given in (prescribed or {}).items():
            for name, key in PRESCRIBED.items():
                file[f"{rule}_{key}"] = np.atleast_1d(getattr(given, name))
    head = b"%s\nversion %d\nsha256 %s\n" % (NAME, VERSION, _hash(content).encode())
    content.seek(0)
    content.write(head.ljust(HEAD_BYTES, b"\0"))
    with replacing(path, keep=previous) as temporary:
        temporary.write_bytes(content.getbuffer())


def read(path: Path) -> Checkpoint:
    """Read a checkpoint.

    Raises
    ------
    DamagedError
        If it is missing, damaged, or no checkpoint.
    RunFolderError
        If it is of a version to come, or the disk fails.
    """
    try:
        path.open("rb").close()
    except FileNotFoundError:
        raise DamagedError(f"{path.parent}: not a run folder that alsph can resume, it has no {path.name}") from None
    except OSError as error:
        raise RunFolderError(f"{path}: cannot be read: {error.strerror}") from None
    try:
        _check_head(path)
        with h5py.File(path, "r", locking=False) as file:
            state = {name: _number(file, name) for name in file.attrs}
            state |= {name: rows(sound(file, name)) for name in TYPES if name in file}
            case = json.loads(rows(sound(file, CASE)).tobytes()) if CASE in file else None
            prescribed = {rule: _prescription(file, rule) for rule in WORDS if f"{rule}_time" in file}
        if not isinstance(case, dict | None):
            raise ValueError("its case is no table")
        if not state.keys() >= {"time", "step", "position"}:
            raise ValueError("it has no time, step or position")
        return Checkpoint(state, case, prescribed=prescribed)
    except DAMAGE as error:
        raise DamagedError(f"{path}: not a checkpoint, or damaged: {error}") from None


def digest(state: dict[str, Any]) -> str:
    """Return the SHA-256 of a state: two that have the same are the same to the last bit, in whatever order."""
    total = hashlib.sha256()
    order = np.argsort(state["id"]) if "id" in state else slice(None)
    for name in sorted(state):
        value = np.asarray(state[name])
        if name == "unkept_pressure" or (name == "place" and not value.any()):
            continue  # steps do not go on with it, and older versions do not tell; no step has been taken, or the same
        value = np.ascontiguousarray(value[order] if value.ndim and name not in OF_BODIES else value)
        total.update(f"{name} {value.dtype.str} {value.shape}".encode())
        total.update(value.data)
    return total.hexdigest()


def _number(file: h5py.File, name: str) -> Any:
    """Return an attribute that is a number; others are not read."""
    attribute = file.attrs.get_id(name)
    if attribute.dtype.kind not in "iufb" or attribute.shape != ():
        raise ValueError(f"{name} is no number")
    return file.attrs[name].item()


def _prescription(file: h5py.File, rule: str) -> Prescription:
    """Return what a rule gave last."""
    found = (np.asarray(sound(file, f"{rule}_{key}")[()], float) for key in PRESCRIBED.values())
    time, position, values = found
    if time.shape != (1,) or position.ndim != 2 or values.ndim != 2 or len(position) != len(values):
        raise ValueError(f"its {rule} is incomplete")
    return Prescription(float(time[0]), position, values)


def _check_head(path: Path) -> None:
    """Check name, version and checksum."""
    with path.open("rb") as file:
        head = file.read(HEAD_BYTES)
    if head.startswith(HDF5):
        return  # version 1
    lines = head.rstrip(b"\0").split(b"\n")
    if lines[0] != NAME:
        raise ValueError("its first bytes are not those of a checkpoint")
    version = lines[1].removeprefix(b"version ").decode()
    if not version.isdecimal() or int(version) > VERSION:
        raise RunFolderError(
            f"{path}: a checkpoint of version {version}, and this alsph reads up to {VERSION}; use a newer alsph"
        )
    with path.open("rb") as file:
        if lines[2].removeprefix(b"sha256 ") != _hash(file).encode():
            raise ValueError("its checksum does not fit its content")


def _hash(file: BinaryIO) -> str:
    """SHA-256 of what follows the head."""
    total = hashlib.sha256()
    file.seek(HEAD_BYTES)
    while part := file.read(READ_BYTES):
        total.update(part)
    return total.hexdigest()
