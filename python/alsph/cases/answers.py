"""What the methods of a case answer, looked at where it is asked for: a class of a user's may give anything."""

from __future__ import annotations

import math
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import numpy as np

from alsph.arguments import number, real
from alsph.arrays import Arrays
from alsph.errors import AlsphError, ConfigError
from alsph.geometry.particles import Kind, at_one_place
from alsph.text import shown

Thing = TypeVar("Thing")

ARRAYS = ("position", "velocity", "pressure", "kind", "body", "normal", "depth")
"""What particles have."""


def is_own(thing: object) -> bool:
    """Whether a thing is of a class of the user's."""
    return not type(thing).__module__.startswith("alsph.")


def reason(error: BaseException, file: str) -> str:
    """Say where in a file what went wrong."""
    if isinstance(error, SyntaxError):
        return f"line {error.lineno}: {error.msg}"
    alone = f"; a run holds {file} alone, put it into that, install it, or set PYTHONPATH to where it is"
    hint = alone if isinstance(error, ModuleNotFoundError) else ""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    where, first = f"line {lines[-1]}: " if lines else "", str(error).partition("\n")[0]
    return f"{where}{type(error).__name__}: {first}{hint}"


def place(thing: object) -> str:
    """Return the name of the file, as messages of Python have it, that the class of a thing stands in."""
    kind = type(thing)
    if code := getattr(kind, "code", None):
        return str(code.file)
    if file := getattr(sys.modules.get(kind.__module__), "__file__", None):
        return str(file)
    own = (value for value in vars(kind).values() if getattr(value, "__module__", None) == kind.__module__)
    codes = (getattr(value, "__code__", None) for value in own)
    return next((str(each.co_filename) for each in codes if each is not None), "")


@contextmanager
def told(what: str, thing: object) -> Iterator[None]:
    """Tell of what fails in a class of the user's in a line: what it is, and where it stands.

    Raises
    ------
    ConfigError
        In place of what is raised; errors of alsph's own come out as they are.
    """
    try:
        yield
    except AlsphError:
        raise
    except Exception as error:
        if not is_own(thing):
            raise
        raise ConfigError(f"{what} fails, {reason(error, place(thing))}") from error


def listed(case: object, method: str, kind: Any, ask: Callable[[], Iterable[Thing]]) -> list[Thing]:
    """Return what a method of a case gives as a list, be it a generator.

    Raises
    ------
    ConfigError
        If it fails, gives no list, or one of things of another kind.
    """
    what, name = f"{type(case).__name__}.{method}()", {str: "texts"}.get(kind, f"{kind.__name__}s")
    with told(what, case):
        given: Any = ask()
        found = None if isinstance(given, str | bytes) or not isinstance(given, Iterable) else list(given)
    if found is None:
        raise ConfigError(f"{what} gave {shown(given)}: it must return a list of {name}, which may be empty")
    if odd := [each for each in found if not isinstance(each, kind)]:
        raise ConfigError(f"{what} gave a list with {shown(odd[0])} in it: it must return a list of {name}")
    return found


def particles(case: object, ask: Callable[[], Arrays], spacing: float) -> Arrays:
    """Return the arrays of particles that a case gives.

    Raises
    ------
    ConfigError
        If it fails or gives none, or two of them at one place.
    """
    what = f"{type(case).__name__}.particles()"
    with told(what, case):
        given = ask()
    if not isinstance(given, dict):
        raise ConfigError(f"{what} gave {shown(given)}: it must return the arrays of particles, {', '.join(ARRAYS)}")
    if missing := [name for name in ARRAYS if name not in given]:
        raise ConfigError(f"{what} gave no array `{missing[0]}`: it must return {', '.join(ARRAYS)}")
    if odd := [name for name in ARRAYS if np.shape(given[name])[:1] != np.shape(given["kind"])]:
        numbers = f"{np.shape(given[odd[0]])[:1]} for {np.shape(given['kind'])} particles"
        raise ConfigError(f"{what} gave an array `{odd[0]}` of {numbers}: each has an entry a particle")
    position, kind = np.asarray(given["position"]), np.asarray(given["kind"])
    if position.ndim == 2 and position.dtype.kind == "f" and np.isfinite(position).all():
        if len(pair := at_one_place(position, kind == Kind.SOLID, spacing)):
            kinds = " and ".join(Kind(int(each)).name.lower() for each in kind[pair])
            where = ", ".join(f"{x:.6g}" for x in position[pair[0]])
            raise ConfigError(f"{what} gave two particles at one place, ({where}) [D]: {kinds}; leave one out")
    return given


def end_time(case: object, ask: Callable[[], float]) -> float:
    """Return the time that a case ends at by default.

    Raises
    ------
    ConfigError
        If it is no time above zero.
    """
    what = f"{type(case).__name__}.default_until"
    with told(what, case):
        given = ask()
    return number(what, given, above=0, unit="D/U", finite=True)


def vector(case: object, method: str, dimensions: int, ask: Callable[[], Any]) -> list[float]:
    """Return a vector that a method of a case gives.

    Raises
    ------
    ConfigError
        If it fails, or gives not a finite number for each direction.
    """
    what = f"{type(case).__name__}.{method}()"
    with told(what, case):
        given = ask()
        parts = None if isinstance(given, str | bytes) or not isinstance(given, Iterable) else [*map(real, given)]
    found = [part for part in parts or [] if part is not None and math.isfinite(part)]
    if parts is None or not len(found) == len(parts) == dimensions:
        raise ConfigError(f"{what} gave {shown(given)}: it must return {dimensions} finite numbers")
    return found
