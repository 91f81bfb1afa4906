"""Bodies, in space above all, whose surface is known by the distance from it, and the particles under it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from alsph.arrays import FloatArray
from alsph.geometry.lattice import lattice, symmetric_centres
from alsph.geometry.packing import pack, spread
from alsph.geometry.particles import neighbour_tree
from alsph.geometry.solids import Solid

PROBES = 2000
"""Number of points at which a body is compared with its mirror images."""

SETTLED = 0.01
"""How far from its layer a solid particle may be [Δx]; one that cannot come so near, in an edge, is left out."""

OUTSIDE = 3
"""Number of layers outside a body."""

NEAR = 1e-9
"""Distance over the size of a body at which a point lies on its surface."""

STEEP = 0.9
"""Least slope of the distance, 1 everywhere but where several points of the surface are as near."""


@dataclass(frozen=True, eq=False)
class Volume:
    """A body in d dimensions, given by the signed distance of points from its surface.

    Attributes
    ----------
    distance : callable
        Takes points (n, d) [D] and gives how far they lie outside of the body (n,) [D], negative inside.
    lower, upper : ndarray, shape (d,)
        Corners of a box around the body [D].
    volume, frontal_area : float
        Its volume [D^d] and the area of its shadow along x [D^(d-1)].
    nearest : callable, optional
        Takes points (n, d) and gives their distances (n,) and the points of the surface that are nearest (n, d); by
        default they are found from the slope of the distance.
    """

    distance: Callable[[FloatArray], FloatArray]
    lower: FloatArray
    upper: FloatArray
    volume: float
    frontal_area: float
    nearest: Callable[[FloatArray], tuple[FloatArray, FloatArray]] | None = None

    @property
    def corners(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper corner (d,) of the box [D]."""
        return self.lower, self.upper

    @property
    def size(self) -> float:
        """Largest extent of the box [D]."""
        return float((self.upper - self.lower).max())

    @cached_property
    def flips(self) -> Sequence[FloatArray]:
        """Factors (d,) of y and of z that make mirror images in planes through 0 that are the body itself."""
        points = np.random.default_rng(0).uniform(self.lower, self.upper, (PROBES, len(self.lower)))
        flips = 1.0 - 2.0 * np.eye(len(self.lower))[1:]
        here = self.height(points)
        return [flip for flip in flips if np.abs(self.height(points * flip) - here).max() < 1e-9 * self.size]

    def height(self, points: FloatArray) -> FloatArray:
        """Return how far points (n, d) lie outside of the body (n,), negative inside [D]."""
        return np.asarray(self.distance(points))

    def surface(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the heights (n,) of points (n, d) and their gradient (n, d), the normal of the surface nearest by."""
        if self.nearest is not None:
            height, feet = self.nearest(points)
            return height, (points - feet) / np.where(np.abs(height) < NEAR * self.size, np.inf, height)[:, None]
        step = 1e-4 * self.size
        sides = [
            self.height(points + step * axis) - self.height(points - step * axis) for axis in np.eye(len(self.lower))
        ]
        return self.height(points), np.stack(sides, axis=1) / (2 * step)

    def feet(self, points: FloatArray) -> FloatArray:
        """Return the points (n, d) of the surface that are nearest to points (n, d)."""
        return self.nearest(points)[1] if self.nearest else self._at(points, np.zeros(len(points)))

    def solid(self, spacing: float, layers: int) -> Solid:
        """Place solid particles on layers that follow the surface, at depths of 1/2, 3/2, ... spacings, evenly spaced.

        Each layer gets as many as a lattice has points in the shell of its thickness. Layers outside hold them in place
        while they are spread.
        """
        height = self.height(cells := self._cells(spacing, OUTSIDE))
        near = np.abs(height) < np.where(height < 0, layers, OUTSIDE) * spacing
        start, held = cells[near], (np.floor(height[near] / spacing) + 0.5) * spacing
        position = spread(start, start[:0], spacing, lambda points: self._at(points, held), self.flips)[held < 0]
        depth = -held[held < 0]
        found, slope = self.surface(position)
        steepness = np.linalg.norm(slope, axis=1)
        kept = (np.abs(found + depth) < SETTLED * spacing) & (steepness > STEEP)
        return Solid(position, slope / np.maximum(steepness, STEEP)[:, None], depth).where(kept)

    def left(self, thickness: float) -> float:
        """Return the share of the volume that balls of that diameter [D] reach without leaving the body."""
        cell, radius = thickness / 6, thickness / 2
        points = self._cells(cell)
        height = self.height(points)
        core, inside = points[height < cell / 2 - radius], points[height < 0]  # half a cell is what the lattice misses
        if not len(core):
            return 0.0
        return float(np.mean(neighbour_tree(core).query(inside)[0] < radius + cell / 2))

    @property
    def thickness(self) -> float:
        """Diameter of about the largest ball in the body [D]."""
        return float(-2 * self.height(self._cells(self.size / 60)).min())

    def _cells(self, spacing: float, margin: int = 0) -> FloatArray:
        """Centres (n, d) of the cells that fit into the box, with so many more on each side.

        Faces of the body that lie in those of the box are then midway between them.
        """
        counts = np.maximum(1, np.rint((self.upper - self.lower) / spacing).astype(int)) + 2 * margin
        middle = (self.lower + self.upper) / 2
        return middle + lattice(*(symmetric_centres(count, spacing) for count in counts))

    def _at(self, points: FloatArray, height: FloatArray) -> FloatArray:
        """Return the points (n, d) moved along the normal to heights (n,) over the surface."""
        for _ in range(2):
            found, slope = self.surface(points)
            points = points + (height - found)[:, None] * slope
        return points


def nose_up(angle: float) -> FloatArray:
    """Return the matrix (3, 3) that turns vectors by an angle of attack [degrees] about z."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def cube(side: float, angle: float) -> Volume:
    """Return a cube about 0 (lengths in D), turned nose up by an angle of attack [degrees]."""
    turned = nose_up(angle)
    across = abs(turned[0, 0]) + abs(turned[0, 1])
    corner = 0.5 * side * np.array([across, across, 1.0])

    def distance(points: FloatArray) -> FloatArray:
        beyond = np.abs(points @ turned) - 0.5 * side
        return np.asarray(np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0))

    return Volume(distance, -corner, corner, side**3, side**2 * across)


def sphere(radius: float) -> Volume:
    """Return a sphere about 0 (lengths in D)."""
    corner = np.full(3, radius)

    def distance(points: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.norm(points, axis=1) - radius)

    return Volume(distance, -corner, corner, 4 / 3 * np.pi * radius**3, np.pi * radius**2)


def ring_of_fluid(inner: float, outer: float, resolution: int, solid: FloatArray) -> FloatArray:
    """Return as many evenly spaced particles (n, 2) as the ring between two radii about 0 has room for.

    Parameters
    ----------
    inner, outer
        The radii [D].
    resolution
        Particles per reference length, D/Δx.
    solid
        Positions of the solid particles beyond both (m, 2).
    """

    def height(points: FloatArray) -> FloatArray:
        radius = np.hypot(*points.T)
        return np.asarray(np.minimum(outer - radius, radius - inner))

    spacing, count = 1.0 / resolution, math.ceil(2 * outer * resolution - 1e-6)
    square, ring = (count * spacing) ** 2, np.pi * (outer**2 - inner**2)
    corner = np.full(2, count * spacing / 2)
    cells = lattice(*[symmetric_centres(count, spacing)] * 2)
    return pack(cells, Volume(height, -corner, corner, square - ring, 1.0), solid, spacing)
