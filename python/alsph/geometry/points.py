"""Points and boxes as users give them, checked in one place."""

from __future__ import annotations

import numpy as np

from alsph.arrays import FloatArray
from alsph.errors import ConfigError
from alsph.text import shown

COORDINATES = {1: "a finite number, x", 2: "two finite numbers, x and y", 3: "three finite numbers, x, y and z"}


def numbers(given: object) -> FloatArray:
    """Return what is given as an array of finite numbers; an empty one if it is none."""
    try:
        found = np.array(given, float)
    except (TypeError, ValueError, OverflowError):
        return np.empty(0)
    return found if np.isfinite(found).all() else np.empty(0)


def checked_point(name: str, given: object, dimensions: int = 2, text: str = "") -> FloatArray:
    """Return a point or vector (d,).

    Parameters
    ----------
    name
        What it is called in the message.
    given
        Its coordinates.
    dimensions
        How many it must have.
    text
        What the coordinates are of, to be shown in their place.

    Raises
    ------
    ConfigError
        If it is none.
    """
    found = numbers(given)
    if found.shape != (dimensions,):
        raise ConfigError(f"{name} = {shown(text or given)}: must be {COORDINATES[dimensions]}")
    return found


def checked_points(given: object, dimensions: int) -> FloatArray:
    """Return points (m, d), of which one may be given by its coordinates alone.

    Raises
    ------
    ConfigError
        If they are none.
    """
    found = np.atleast_2d(numbers(given))
    if found.ndim != 2 or found.shape[1] != dimensions:
        raise ConfigError(f"points: must be points of {dimensions} finite numbers, an array (m, {dimensions}) [D]")
    return found


def checked_box(lower: object, upper: object, dimensions: int) -> tuple[FloatArray, FloatArray]:
    """Return the corners of a box, both (d,).

    Raises
    ------
    ConfigError
        If they are none.
    """
    box = numbers(lower), numbers(upper)
    if not box[0].shape == box[1].shape == (dimensions,) or not np.all(box[0] < box[1]):
        raise ConfigError(
            f"box from {shown(lower)} to {shown(upper)}: needs corners of {dimensions} finite numbers, "
            "the lower one first"
        )
    return box
