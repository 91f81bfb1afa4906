"""The compiled engine: its functions, the types of its arrays, and its errors as those of the package."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import alsph._alsph as _alsph
from alsph.errors import ConfigError, SolverError

VERSION = _alsph.__version__


def instructions() -> str:
    """Return the instruction set that the engine's loops use on this machine."""
    return _alsph.instructions()


def bytes_per_particle(settings: dict[str, Any]) -> float:
    """Return the engine's estimated memory per particle [bytes]."""
    with translated():
        return _alsph.bytes_per_particle(json.dumps(settings))


def time_step_limits(settings: dict[str, Any], velocity_max: float) -> dict[str, float]:
    """Return bounds of Δt, ``courant``, ``penalty``, ``acoustic``, ``viscous``, ``body_force`` [D/U], and λ_max."""
    with translated():
        return _alsph.time_step_limits(json.dumps(settings), velocity_max)


def kernels() -> dict[str, float]:
    """Return the kernels by name, each with its support radius over the smoothing length."""
    return _alsph.kernels()


TYPES: dict[str, tuple[type[np.generic], int]] = {
    "position": (np.float64, 2),
    "velocity": (np.float64, 2),
    "pressure": (np.float64, 1),
    "kind": (np.uint8, 1),
    "body": (np.uint16, 1),
    "normal": (np.float64, 2),
    "depth": (np.float64, 1),
    "place": (np.uint8, 1),
    "unkept_pressure": (np.float64, 1),
    "id": (np.uint64, 1),
    "pose": (np.float64, 2),
}
"""The arrays of a state: their types and numbers of dimensions."""

OF_BODIES = {"pose"}
"""Those that have a row a body, and not a particle."""


@contextmanager
def translated() -> Iterator[None]:
    """Raise the engine's errors as those of the package."""
    try:
        yield
    except _alsph.ConfigError as error:
        raise ConfigError(str(error)) from None
    except _alsph.SolverError as error:
        raise SolverError(str(error)) from None
    except BaseException as error:
        if type(error).__name__ != "PanicException":  # that of the engine's edge to Python, which it does not export
            raise
        raise SolverError(f"the engine gave up, probably as it was out of memory: {error}") from None


def exact(name: str, values: ArrayLike, kind: type[np.generic], dimensions: int | None = None) -> NDArray[Any]:
    """Return an array of the type that the engine takes, if that changes no value.

    Raises
    ------
    ConfigError
        If it does, or the array has another number of dimensions.
    """
    wanted = "numbers" if kind == np.float64 else f"whole numbers from 0 to {256 ** np.dtype(kind).itemsize - 1}"
    try:
        given = np.asarray(values)
        given = given if given.dtype.kind in "iufb" and not np.ma.is_masked(values) else np.array(None)
        with np.errstate(all="ignore"):
            found = np.ascontiguousarray(given, kind)
        if not np.array_equal(given, found, equal_nan=kind == np.float64):
            raise ValueError
    except (TypeError, ValueError):
        raise ConfigError(f"array `{name}`: must hold {wanted}") from None
    if dimensions and found.ndim != dimensions:
        raise ConfigError(f"array `{name}`: must have {dimensions} dimensions, and has {found.ndim}")
    return found
