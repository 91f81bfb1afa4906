"""Points at which a run records velocity and pressure as it goes."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from alsph.arrays import FloatArray
from alsph.errors import ConfigError
from alsph.geometry.points import checked_point
from alsph.text import shown

MOST_POINTS = 10_000


@dataclass(frozen=True, eq=False)
class Probes:
    """Velocity and pressure at points over time.

    Attributes
    ----------
    position : ndarray, shape (m, d)
        The points [D].
    time : ndarray, shape (k,)
        Times [D/U].
    velocity : ndarray, shape (k, m, d)
        Velocities [U]; NaN where there is no fluid.
    pressure : ndarray, shape (k, m)
        Pressures [ρU²]; NaN where there is no fluid.
    """

    position: FloatArray
    time: FloatArray
    velocity: FloatArray
    pressure: FloatArray


def points(given: str | Sequence[Sequence[float]], dimensions: int) -> FloatArray:
    """Return points (m, d) as they are given: one after the other or, in a text, also in lines.

    Parameters
    ----------
    given
        A list of points, or a text such as ``"5,0; 6,-1:6,1:21"``: the point (5, 0), and 21 points from (6, −1) to
        (6, 1).
    dimensions
        Number of coordinates d that each must have.

    Raises
    ------
    ConfigError
        If there are others in it.
    """
    parts = [part for part in re.split(r"[;\s]+", given) if part] if isinstance(given, str) else list(given)
    found = [_line(part, dimensions) if isinstance(part, str) else _numbers(part, dimensions)[None] for part in parts]
    if sum(map(len, found)) > MOST_POINTS:
        raise ConfigError(f"run.probes: more than {MOST_POINTS} points")
    return np.concatenate([np.empty((0, dimensions)), *found])


def _line(text: str, dimensions: int) -> FloatArray:
    start, *rest = text.split(":")
    first = _numbers(start.split(","), dimensions, text)
    if not rest:
        return first[None]
    if len(rest) != 2 or not re.fullmatch("[0-9]{1,5}", rest[1]) or not 2 <= int(rest[1]) <= MOST_POINTS:
        raise ConfigError(f"run.probes: {shown(text)} is no line, which is X,Y:X,Y:COUNT from one point to another")
    return np.linspace(first, _numbers(rest[0].split(","), dimensions, text), int(rest[1]))


def _numbers(words: Sequence[object], dimensions: int, text: str = "") -> FloatArray:
    return checked_point("run.probes", words, dimensions, text)
