"""Layers of solid particles under a surface."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely import Polygon

from alsph.arrays import Arrays, FloatArray
from alsph.geometry.lattice import cell_centres, cells, extruded, inside
from alsph.geometry.particles import Kind, neighbour_tree, particles


@dataclass(frozen=True, eq=False)
class Solid:
    """Where the solid particles of a body or wall lie.

    Attributes
    ----------
    position
        Positions (n, d).
    normal
        Unit normals (n, d) of the surface, from the solid into the fluid; zero midway between parallel faces.
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
        """Return the particles moved by `offset` (d,)."""
        return Solid(self.position + offset, self.normal, self.depth)

    def extruded(self, columns: FloatArray) -> Solid:
        """Return the particles of a plane, as y and z, at each of the places x (k,)."""
        normal = extruded(np.zeros(len(columns)), self.normal)
        return Solid(extruded(columns, self.position), normal, np.tile(self.depth, len(columns)))

    def mirrored(self) -> Solid:
        """Return the mirror images of the particles about y = 0."""
        flip = np.array([1.0, -1.0])
        return Solid(self.position * flip, self.normal * flip, self.depth)

    def particles(self, velocity: ArrayLike = 0.0, body: ArrayLike = 0) -> Arrays:
        """Return the arrays of these particles as part of the body with that index, or each of its own (n,)."""
        return particles(Kind.SOLID, self.position, velocity, body=body, normal=self.normal, depth=self.depth)


def cylinder_rings(radius: float, spacing: float, layers: int, side: int = 1) -> Solid:
    """Place particles on concentric rings about 0 at depths of 1/2, 3/2, ... spacings below the surface.

    The upper half is generated and mirrored, so that the arrangement is exactly symmetric about y = 0. `side` is 1 if
    the fluid is around the circle, -1 if it is in it.
    """
    normals, depths = [], []
    for depth in cell_centres(layers, spacing):
        if side * depth >= radius:
            break
        half = max(2, round(np.pi * (radius - side * depth) / spacing))
        angle = (np.arange(half) + 0.5) * (np.pi / half)
        upper = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        normals.append(np.concatenate([upper, upper * (1.0, -1.0)]))
        depths.append(np.full(2 * half, depth))
    normal, depth = np.concatenate(normals), np.concatenate(depths)
    return Solid(normal * (radius - side * depth)[:, None], side * normal, depth)


def walls(region: Polygon, spacing: float, layers: int) -> Solid:
    """Place solid particles on the lattice of :func:`cells` around a region of fluid, up to `layers` spacings deep."""
    points = cells(region, spacing, layers)
    distance = shapely.distance(region, shapely.points(points))
    return facing(points[(distance > 0) & (distance < layers * spacing)], region, spacing)


def open_tank(left: float, right: float, height: float, spacing: float, layers: int) -> Solid:
    """Place solid particles around a tank from `left` to `right` with its floor at y = 0, open at the top."""
    tank = walls(shapely.box(left, 0, right, height + 1), spacing, layers)
    return tank.where(tank.position[:, 1] < height)


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
    rings = [ring for part in parts if not part.is_empty for ring in (part.exterior, *part.interiors)]
    return [shapely.get_coordinates(ring)[:-1] for ring in rings]


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
