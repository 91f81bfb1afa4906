"""Points and cells of a square lattice."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from alsph.arrays import FloatArray


def lattice(*axes: FloatArray) -> FloatArray:
    """Return all points (n, d) whose coordinates are taken from the given axes, the last one running fastest."""
    return np.stack([grid.ravel() for grid in np.meshgrid(*axes, indexing="ij")], axis=1)


def extruded(columns: FloatArray, points: FloatArray) -> FloatArray:
    """Return the points (k n, 3) of a plane (n, 2), as y and z, at each of the places x (k,)."""
    return np.concatenate([np.insert(points, 0, x, axis=1) for x in columns])


def cell_centres(count: int, spacing: float) -> FloatArray:
    """Return the centres of `count` cells that start at 0: ``(i + 1/2) spacing``."""
    return spacing * (np.arange(count, dtype=np.float64) + 0.5)


def cell_counts(lower: FloatArray, upper: FloatArray, spacing: float) -> FloatArray:
    """Return how many cells (d,) of about a size cover a box from corner to corner, at least one along each axis."""
    with np.errstate(over="ignore"):  # which is more than anyone has room for
        return np.clip(np.round((upper - lower) / spacing), 1.0, 1e15)


def cell_middles(lower: FloatArray, upper: FloatArray, counts: FloatArray) -> tuple[FloatArray, ...]:
    """Return the middles, along each axis, of the cells that a box from corner to corner is cut into."""
    return tuple(
        low + (np.arange(int(count)) + 0.5) * (high - low) / count
        for low, high, count in zip(lower, upper, counts, strict=True)
    )


def symmetric_centres(count: int, spacing: float) -> FloatArray:
    """Return the centres of `count` cells about 0, each exactly the negative of its mirror image."""
    return spacing * (np.arange(count, dtype=np.float64) - 0.5 * (count - 1))


def cells(region: Polygon, spacing: float, margin: int = 0) -> FloatArray:
    """Return the cell centres (n, 2) of a lattice over the bounds of `region`, with `margin` more cells on each side.

    The lattice starts at the bounds' lower corner; walls along its lines lie midway between two layers of particles.
    """
    left, bottom, right, top = region.bounds
    counts = [round((right - left) / spacing), round((top - bottom) / spacing)]
    axes = [spacing * (np.arange(-margin, count + margin) + 0.5) for count in counts]
    return lattice(left + axes[0], bottom + axes[1])


def inside(region: Polygon, points: FloatArray) -> NDArray[np.bool_]:
    """Return which of the points (n, 2) lie in `region`."""
    return np.asarray(shapely.contains_xy(region, *points.T))
