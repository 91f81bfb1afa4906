"""Points at which a run records velocity and pressure, and places where it records the depth of water, as it goes."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from alsph.arrays import AXES, FloatArray
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

    def columns(self) -> dict[str, FloatArray]:
        """Return all of it as a table, one row for each time and point: time, place, velocity and pressure (k m,)."""
        times, count = len(self.time), len(self.position)
        axes = AXES[: self.position.shape[1]]
        place = {name: np.tile(self.position[:, k], times) for k, name in enumerate(axes)}
        velocity = {f"velocity_{name}": self.velocity[..., k].ravel() for k, name in enumerate(axes)}
        return {"time": np.repeat(self.time, count), **place, **velocity, "pressure": self.pressure.ravel()}

    def __repr__(self) -> str:
        """Say how many points and times there are, and when."""
        if not len(self.time):
            return "Probes(nothing recorded)"
        first, last = self.time[0], self.time[-1]
        return f"Probes({len(self.position)} points, {len(self.time)} times from t* = {first:.4g} to {last:.4g})"


@dataclass(frozen=True, eq=False)
class GaugeRecord:
    """The depth of the water at places over time.

    Attributes
    ----------
    position : ndarray, shape (m, d − 1)
        The places along x, in 3-D along x and y [D].
    time : ndarray, shape (k,)
        Times [D/U].
    depth : ndarray, shape (k, m)
        Depths [D].
    """

    position: FloatArray
    time: FloatArray
    depth: FloatArray


def points(given: str | Sequence[Sequence[float]], dimensions: int, setting: str = "run.probes") -> FloatArray:
    """Return points (m, d) as they are given: one after the other or, in a text, also in lines.

    Parameters
    ----------
    given
        A list of points, or a text such as ``"5,0; 6,-1:6,1:21"``: the point (5, 0), and 21 points from (6, −1) to
        (6, 1).
    dimensions
        Number of coordinates d that each must have.
    setting
        What they are called in messages.

    Raises
    ------
    ConfigError
        If there are others in it.
    """
    parts = [part for part in re.split(r"[;\s]+", given) if part] if isinstance(given, str) else list(given)
    found = [
        _line(part, dimensions, setting) if isinstance(part, str) else checked_point(setting, part, dimensions)[None]
        for part in parts
    ]
    if sum(map(len, found)) > MOST_POINTS:
        raise ConfigError(f"{setting}: more than {MOST_POINTS} points")
    return np.concatenate([np.empty((0, dimensions)), *found])


def _line(text: str, dimensions: int, setting: str) -> FloatArray:
    start, *rest = text.split(":")
    first = checked_point(setting, start.split(","), dimensions, text)
    if not rest:
        return first[None]
    if len(rest) != 2 or not re.fullmatch("[0-9]{1,5}", rest[1]) or not 2 <= int(rest[1]) <= MOST_POINTS:
        point = ",".join("XYZ"[:dimensions])
        told = f"{point}:{point}:COUNT from one point to another, COUNT from 2 to {MOST_POINTS}"
        raise ConfigError(f"{setting}: {shown(text)} is no line, which is {told}")
    return np.linspace(first, checked_point(setting, rest[0].split(","), dimensions, text), int(rest[1]))
