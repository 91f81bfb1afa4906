"""Particle arrangements, and the problem that is handed to the engine."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely import Polygon

if TYPE_CHECKING:
    from scipy.spatial import KDTree

FloatArray = NDArray[np.float64]


class Kind(IntEnum):
    """What a particle is."""

    FLUID = 0
    INLET = 1
    OUTLET = 2
    SOLID = 3


@dataclass(frozen=True)
class Problem:
    """All that the engine needs to start.

    Attributes
    ----------
    settings
        The engine's settings (see docs/architecture.md).
    state
        The particles, one array a property, and optionally ``time``, ``step``, ``mass_in``, ``mass_out``, ``next_id``.
    coefficient_bodies
        Names of the bodies whose force coefficients are reported, all together.
    """

    settings: dict[str, Any]
    state: dict[str, Any]
    coefficient_bodies: Sequence[str] = ()

    @property
    def dimensions(self) -> int:
        """Number of space dimensions, 2 or 3."""
        return int(self.settings["dimensions"])


def neighbour_tree(position: FloatArray) -> KDTree:
    """Return a tree to find the neighbours of points among positions (n, d)."""
    from scipy.spatial import KDTree  # half a second that most commands do without

    return KDTree(position)


def particles(
    kind: Kind,
    position: FloatArray,
    velocity: ArrayLike,
    *,
    pressure: ArrayLike = 0.0,
    body: int = 0,
    normal: ArrayLike = 0.0,
    depth: ArrayLike = 0.0,
) -> dict[str, NDArray[Any]]:
    """Return the arrays of n particles of one kind; every other property is broadcast to `position` (n, d)."""
    n = len(position)
    return {
        "position": position,
        "velocity": np.broadcast_to(np.asarray(velocity, float), position.shape).copy(),
        "pressure": np.broadcast_to(np.asarray(pressure, float), n).copy(),
        "kind": np.full(n, kind, np.uint8),
        "body": np.full(n, body, np.uint16),
        "normal": np.broadcast_to(np.asarray(normal, float), position.shape).copy(),
        "depth": np.broadcast_to(np.asarray(depth, float), n).copy(),
    }


def join(*groups: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Concatenate groups of particles."""
    return {name: np.concatenate([group[name] for group in groups]) for name in groups[0]}


def lattice(*axes: FloatArray) -> FloatArray:
    """Return all points (n, d) whose coordinates are taken from the given axes, the last one running fastest."""
    return np.stack([grid.ravel() for grid in np.meshgrid(*axes, indexing="ij")], axis=1)


def cell_centres(count: int, spacing: float) -> FloatArray:
    """Return the centres of `count` cells that start at 0: ``(i + 1/2) spacing``."""
    return spacing * (np.arange(count, dtype=np.float64) + 0.5)


def symmetric_centres(count: int, spacing: float) -> FloatArray:
    """Return the centres of `count` cells about 0, each exactly the negative of its mirror image."""
    return spacing * (np.arange(count, dtype=np.float64) - 0.5 * (count - 1))


@dataclass(frozen=True, eq=False)
class Solid:
    """Where the solid particles of a body or wall lie.

    Attributes
    ----------
    position
        Positions (n, 2).
    normal
        Unit normals (n, 2) of the surface, from the solid into the fluid; zero midway between parallel faces.
    depth
        Distances below the surface (n,).
    """

    position: FloatArray
    normal: FloatArray
    depth: FloatArray

    def where(self, chosen: NDArray[np.bool_]) -> Solid:
        """Return the particles for which `chosen` (n,) is true."""
        return Solid(self.position[chosen], self.normal[chosen], self.depth[chosen])

    def moved(self, offset: FloatArray) -> Solid:
        """Return the particles moved by `offset` (2,)."""
        return Solid(self.position + offset, self.normal, self.depth)

    def particles(self, velocity: ArrayLike = 0.0, body: int = 0) -> dict[str, NDArray[Any]]:
        """Return the arrays of these particles as part of the body with that index."""
        return particles(Kind.SOLID, self.position, velocity, body=body, normal=self.normal, depth=self.depth)


def cylinder_rings(radius: float, spacing: float, layers: int) -> Solid:
    """Place particles on concentric rings about 0 at depths of 1/2, 3/2, ... spacings below the surface.

    The upper half is generated and mirrored, so that the arrangement is exactly symmetric about y = 0.
    """
    normals, depths = [], []
    for depth in cell_centres(layers, spacing):
        if depth >= radius:
            break
        half = max(2, round(np.pi * (radius - depth) / spacing))
        angle = (np.arange(half) + 0.5) * (np.pi / half)
        upper = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        normals.append(np.concatenate([upper, upper * (1.0, -1.0)]))
        depths.append(np.full(2 * half, depth))
    normal, depth = np.concatenate(normals), np.concatenate(depths)
    return Solid(normal * (radius - depth)[:, None], normal, depth)


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


def walls(region: Polygon, spacing: float, layers: int) -> Solid:
    """Place solid particles on the lattice of :func:`cells` around a region of fluid, up to `layers` spacings deep."""
    points = cells(region, spacing, layers)
    distance = shapely.distance(region, shapely.points(points))
    return facing(points[(distance > 0) & (distance < layers * spacing)], region, spacing)


ROOM = 0.75
"""A solid particle is put where the nearest one is farther than this [Δx]."""


def body_layers(shape: Polygon, spacing: float, layers: int) -> Solid:
    """Place solid particles on layers that follow the surface of a body, at depths of 1/2, 3/2, ... spacings.

    What these leave empty between them, such as the middle of a plate 2.5 Δx thick, is filled as far as there is room.
    """
    rings = [_along(ring, spacing) for depth in cell_centres(layers, spacing) for ring in _offset(shape, depth)]
    position = np.concatenate([np.empty((0, 2)), *rings])
    core = shape.buffer(-0.5 * spacing)
    candidates = cells(core, spacing / 8) if not core.is_empty else np.empty((0, 2))
    candidates = candidates[inside(core, candidates)]
    candidates = candidates[shapely.distance(shape.boundary, shapely.points(candidates)) < (layers - 0.5) * spacing]
    while len(candidates):
        room = neighbour_tree(position).query(candidates)[0]
        candidates, room = candidates[room > ROOM * spacing], room[room > ROOM * spacing]
        if len(candidates):
            position = np.concatenate([position, candidates[[room.argmax()]]])
    return facing(position, shape, spacing)


def facing(position: FloatArray, shape: Polygon, spacing: float) -> Solid:
    """Solid particles at `position` with their depths below the boundary of `shape`, and the normals there.

    The normal is the gradient of the depth. On the bisector of a corner, where two boundary points are nearest, it is
    the bisector, so that symmetric arrangements have symmetric normals.
    """

    def depth(points: FloatArray) -> FloatArray:
        return np.asarray(shapely.distance(shape.boundary, shapely.points(points)))

    step = 1e-3 * spacing
    gradient = np.stack([depth(position - e) - depth(position + e) for e in step * np.eye(2)], axis=1)
    size = np.hypot(*gradient.T)[:, None]
    return Solid(
        position, np.divide(gradient, size, out=np.zeros_like(position), where=size > 1e-3 * step), depth(position)
    )


def _offset(shape: Polygon, depth: float) -> list[FloatArray]:
    """Return the vertices (n, 2) of the curves at that depth below the surface of `shape`."""
    parts = shapely.get_parts(shape.buffer(-depth))
    return [shapely.get_coordinates(part.exterior)[:-1] for part in parts if not part.is_empty]


def _along(vertices: FloatArray, spacing: float) -> FloatArray:
    """Return points (m, 2) along a closed curve, about `spacing` apart, one on each corner of more than 30 degrees.

    Without corners, the vertex with the largest x lies midway between two of them.
    """
    edge = np.roll(vertices, -1, axis=0) - vertices
    turn = np.angle(np.exp(1j * np.diff(np.arctan2(*edge.T[::-1]), prepend=np.arctan2(*edge[-1, ::-1]))))
    corners = np.flatnonzero(np.abs(turn) > np.radians(30))
    first = corners[0] if len(corners) else int(vertices[:, 0].argmax())
    closed = np.roll(vertices, -first, axis=0)[np.r_[: len(vertices), 0]]
    ends = np.r_[corners - first, len(vertices)] if len(corners) else np.array([0, len(vertices)])
    points = []
    for start, end in itertools.pairwise(ends):
        side = shapely.LineString(closed[start : end + 1])
        count = max(1, round(side.length / spacing))
        share = (np.arange(count) + (0.0 if len(corners) else 0.5)) / count
        points.append(shapely.get_coordinates(shapely.line_interpolate_point(side, share, normalized=True)))
    return np.concatenate(points)
