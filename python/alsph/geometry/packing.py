"""The fluid around a body at the start: as much as there is room for, none on the surface, evenly spaced."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import MultiPolygon, Polygon

from alsph.arrays import FloatArray
from alsph.geometry.lattice import inside, lattice, symmetric_centres
from alsph.geometry.particles import neighbour_tree
from alsph.geometry.thin import filled, is_symmetric, pockets

BAND = 4.0
"""Particles as far from the body as this [Δx] are moved."""

CLEARANCE = 0.4
"""Least distance from the surface [Δx]."""

WIDTH = 0.6
"""Width of the Gaussian by which particles repel each other [Δx]."""

SWEEPS = {2: 200, 3: 60}
"""Moves, by dimension: more neighbours come to rest sooner."""

STEP = 0.1
EVEN = 1e-6
"""Displacement [Δx] below which particles count as evenly spaced: on a lattice that fits the body they stay."""


class Region(Protocol):
    """What of a body the fluid around it depends on, in d dimensions."""

    @property
    def corners(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper corner (d,) of a box around it."""

    @property
    def volume(self) -> float:
        """Its area or volume."""

    @property
    def flips(self) -> Sequence[FloatArray]:
        """Factors (d,) of the coordinates of mirror images that are the body itself."""

    def height(self, points: FloatArray) -> FloatArray:
        """Return how far points (n, d) lie outside (n,), negative inside."""

    def feet(self, points: FloatArray) -> FloatArray:
        """Return the points (n, d) of its surface that are nearest to points outside."""


@dataclass(frozen=True, eq=False)
class Planar:
    """A :class:`Region` of the plane."""

    body: Polygon | MultiPolygon

    @property
    def corners(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper corner (2,)."""
        lower, upper = np.split(np.array(self.body.bounds), 2)
        return lower, upper

    @property
    def volume(self) -> float:
        """Its area."""
        return float(self.body.area)

    @cached_property
    def flips(self) -> Sequence[FloatArray]:
        """That about y = 0, if it is its own image."""
        return [np.array([1.0, -1.0])] if is_symmetric(self.body) else []

    def height(self, points: FloatArray) -> FloatArray:
        """Return how far points (n, 2) lie outside (n,), negative inside."""
        distance = shapely.distance(self.body.boundary, shapely.points(points))
        return np.asarray(np.where(inside(self.body, points), -distance, distance))

    def feet(self, points: FloatArray) -> FloatArray:
        """Return the points (n, 2) of its outline that are nearest to points (n, 2)."""
        lines = shapely.shortest_line(shapely.points(points), self.body.boundary)
        return np.asarray(shapely.get_coordinates(lines)[1::2])


@dataclass(frozen=True, eq=False)
class Enclosed(Planar):
    """What closes off fluid that fills the polygon `body`, as a :class:`Region` of the box of cells of area `box`."""

    box: float

    @property
    def corners(self) -> tuple[FloatArray, FloatArray]:
        """Those of the whole plane: it goes on around the fluid."""
        return np.full(2, -np.inf), np.full(2, np.inf)

    @property
    def volume(self) -> float:
        """The area of the box but for the fluid."""
        return self.box - super().volume

    def height(self, points: FloatArray) -> FloatArray:
        """Return how far points (n, 2) lie in the fluid (n,), negative outside of it."""
        return -super().height(points)


@dataclass(frozen=True, eq=False)
class Immersed(Planar):
    """A body of the plane that reaches out of the box of cells, where its area is `within`."""

    within: float

    @property
    def volume(self) -> float:
        """Its area in the box."""
        return self.within


def pack_around(cells: FloatArray, bodies: Polygon | MultiPolygon, solid: FloatArray, spacing: float) -> FloatArray:
    """Return fluid particles (m, 2) around bodies of the plane and in their holes, as :func:`pack` does."""
    found = [pack(cells, Planar(filled(bodies)), solid, spacing)]
    for pocket in pockets(bodies):
        lower, upper = np.split(np.array(pocket.bounds), 2)
        margin = np.ceil(4 * WIDTH + 1) * spacing
        box = cells[((cells > lower - margin) & (cells < upper + margin)).all(axis=1)]
        found.append(pack(box, Enclosed(pocket, len(box) * spacing**2), solid, spacing))
    return np.concatenate(found)


def pack(cells: FloatArray, body: Region, solid: FloatArray, spacing: float) -> FloatArray:
    """Return fluid particles (m, d) around a body, their number times Δx^d being the volume that it leaves.

    Those next to the body are taken from where they are most crowded until the number is right, and then repel each
    other until they are evenly spaced. Around a body that is its own mirror image they are so, too; their number may
    then be a few off.

    Parameters
    ----------
    cells
        Cell centres (n, d) of the fluid and the body, which fill a box.
    body
        The body.
    solid
        Its solid particles (k, d).
    spacing
        Particle spacing Δx.
    """
    count = round(len(cells) - body.volume / spacing ** cells.shape[1])
    height = height_over(body, cells, BAND * spacing)
    far, near = cells[height > BAND * spacing], cells[(height <= BAND * spacing) & (height > -spacing)]
    sides = _around(_beyond(cells, spacing), body, 2 * BAND * spacing)
    fixed = np.concatenate([_around(far, body, 3 * BAND * spacing), sides, solid])
    near = _thinned(near, fixed, count - len(far), spacing, body.flips)

    def cleared(points: FloatArray) -> FloatArray:
        return _cleared(points, body, CLEARANCE * spacing)

    return np.asarray(np.concatenate([far, spread(near, fixed, spacing, cleared, body.flips)]))


def height_over(body: Region, points: FloatArray, reach: float = np.inf) -> FloatArray:
    """Return how far points (n, d) lie outside the body, negative inside; infinite beyond `reach` of its bounds."""
    lower, upper = body.corners
    near = ((points >= lower - reach) & (points <= upper + reach)).all(axis=1)
    height = np.full(len(points), np.inf)
    height[near] = body.height(points[near])
    return height


def _around(points: FloatArray, body: Region, reach: float) -> FloatArray:
    return np.asarray(points[height_over(body, points, reach) < reach])


def _beyond(cells: FloatArray, spacing: float) -> FloatArray:
    """Return the cells around a box of cells, which keep the particles at its sides within it."""
    lower, upper = cells.min(axis=0), cells.max(axis=0)
    counts, middle = np.rint((upper - lower) / spacing).astype(int) + 1, (lower + upper) / 2
    margin = int(np.ceil(4 * WIDTH))
    points = middle + lattice(*(symmetric_centres(count + 2 * margin, spacing) for count in counts))
    return np.asarray(points[(np.abs(points - middle) > (upper - lower + spacing) / 2).any(axis=1)])


def _partners(points: FloatArray, flips: Sequence[FloatArray]) -> list[NDArray[np.intp]]:
    """Return the indices of the mirror images of the points (n, d), by flip."""
    tree = neighbour_tree(points)
    return [np.asarray(tree.query(points * flip)[1]) for flip in flips]


def _thinned(
    near: FloatArray, fixed: FloatArray, count: int, spacing: float, flips: Sequence[FloatArray]
) -> FloatArray:
    """Take away the most crowded particles, with their mirror images, until `count` are left."""
    tree = neighbour_tree(near)
    partners = _partners(near, flips)
    crowd = _weights(near, np.concatenate([near, fixed]), spacing)
    kept = np.ones(len(near), bool)
    while (surplus := int(kept.sum()) - count) > 0:
        # Of equals the one farthest back in the list, so that rounding does not choose.
        most = int(np.flatnonzero(kept & (crowd > crowd[kept].max() - 1e-9))[-1])
        images = {most}
        for partner in partners:
            images |= {int(partner[image]) for image in images}
        if len(images) > surplus:
            break
        for gone in images:
            kept[gone] = False
            around = np.array(tree.query_ball_point(near[gone], 4 * WIDTH * spacing))
            crowd[around] -= _gaussian(near[around] - near[gone], spacing)
    return near[kept]


def _gaussian(offset: FloatArray, spacing: float) -> FloatArray:
    return np.asarray(np.exp(-0.5 * (offset**2).sum(axis=-1) / (WIDTH * spacing) ** 2))


def _weights(points: FloatArray, others: FloatArray, spacing: float) -> FloatArray:
    """Return the sum of the Gaussians of `others` at each of the points."""
    near = neighbour_tree(others).query_ball_point(points, 4 * WIDTH * spacing)
    return np.array([_gaussian(others[j] - point, spacing).sum() for point, j in zip(points, near, strict=True)])


def spread(
    near: FloatArray,
    fixed: FloatArray,
    spacing: float,
    held: Callable[[FloatArray], FloatArray],
    flips: Sequence[FloatArray],
) -> FloatArray:
    """Let particles repel each other until they are evenly spaced.

    Parameters
    ----------
    near, fixed
        The particles (n, d), and others (k, d) that repel them.
    spacing
        Particle spacing Δx.
    held
        Puts the particles back where they may be, after each move.
    flips
        Factors (d,) of the coordinates of mirror images that the arrangement is to stay of itself.

    Returns
    -------
    ndarray, shape (n, d)
    """
    partners = _partners(near, flips)
    d = near.shape[1]
    reach, stiffness = 4 * WIDTH * spacing, (np.sqrt(2 * np.pi) * WIDTH) ** (d - 2)
    for _ in range(SWEEPS[d]):
        everyone = np.concatenate([near, fixed])
        pairs = neighbour_tree(near).sparse_distance_matrix(neighbour_tree(everyone), reach, output_type="coo_matrix")
        offset = near[pairs.row] - everyone[pairs.col]
        push = offset * _gaussian(offset, spacing)[:, None]
        force = np.stack([np.bincount(pairs.row, push[:, axis], len(near)) for axis in range(d)], axis=1)
        move = STEP / stiffness * force / WIDTH
        size = np.hypot.reduce(move, axis=1)[:, None]
        if size.max() < EVEN * spacing:
            break
        near = held(near + move * np.minimum(1, 0.1 * spacing / np.maximum(size, 1e-300)))
        for partner, flip in zip(partners, flips, strict=True):
            near = 0.5 * (near + near[partner] * flip)
    return near


def _cleared(points: FloatArray, body: Region, least: float) -> FloatArray:
    """Move points that are nearer than `least` to the body out to that distance."""
    height = height_over(body, points, least)
    low = np.flatnonzero(height < least)
    feet = body.feet(points[low])
    points = points.copy()
    points[low] = feet + least * ((points[low] - feet) / height[low][:, None])
    return points
