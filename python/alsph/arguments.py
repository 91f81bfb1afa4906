"""Numbers, as Python's or NumPy's, texts and paths that functions are called with: checked where they come in."""

import math
import operator
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from alsph.errors import ConfigError
from alsph.text import shown

MOST = 2**62
"""Larger whole numbers do not reach the engine."""


def whole(name: str, value: Any, least: int | None = None) -> int:
    """Return a whole number.

    Raises
    ------
    ConfigError
        If it is none, too large, or less than `least`; the message begins with `name`.
    """
    try:
        number = None if isinstance(value, bool | np.bool_) else operator.index(value)
    except TypeError:
        number = None
    if number is None or (least is not None and number < least):
        bound = "" if least is None else f", {least} or more"
        raise ConfigError(f"{name} = {shown(value)}: must be a whole number{bound}")
    if abs(number) > MOST:
        raise ConfigError(f"{name} = {shown(value)}: too large")
    return number


def ladder(name: str, values: Any) -> list[int]:
    """Return whole numbers above zero, each once, increasing.

    Raises
    ------
    ConfigError
        If they are none; the message begins with `name`.
    """
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise ConfigError(f"{name} = {shown(values)}: must be a list of whole numbers")
    return sorted({whole(name, value, 1) for value in values})


def real(value: Any) -> float | None:
    """Return a value as a number, which may be NaN or infinite; None if it is none, such as a text or an array."""
    try:
        if isinstance(value, str | bytes) or np.ndim(value) or np.iscomplexobj(value):
            return None
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return None


def number(name: str, value: Any, above: float | None = None, unit: str = "", *, finite: bool = False) -> float:
    """Return a number.

    Raises
    ------
    ConfigError
        If it is none, not greater than `above`, or infinite where it must be `finite`; the message begins with `name`
        and ends with `unit`.
    """
    given = None if isinstance(value, bool | np.bool_) else real(value)
    found = math.nan if given is None else given
    if math.isnan(found) or (above is not None and not found > above) or (finite and math.isinf(found)):
        kind = "a finite number" if finite and math.isinf(found) else "a number"
        least = "" if above is None else " above zero" if above == 0 else f" above {above:g}"
        raise ConfigError(f"{name} = {shown(value)}: must be {kind}{least}{f' [{unit}]' if unit else ''}")
    return found


def path_of(name: str, value: Any, what: str = "file") -> Path:
    """Return the path of a file or folder.

    Raises
    ------
    ConfigError
        If it is none; the message begins with `name` and says `what` it must be the path of.
    """
    if isinstance(value, str | os.PathLike) and isinstance(found := os.fspath(value), str):
        return Path(found)
    raise ConfigError(f"{name} = {shown(value)}: must be the path of a {what}")


def text_of(name: str, value: Any) -> str:
    """Return a text that is not empty.

    Raises
    ------
    ConfigError
        If it is none; the message begins with `name`.
    """
    if not (isinstance(value, str) and value.strip()):
        raise ConfigError(f"{name} = {shown(value)}: must be a text")
    return value
