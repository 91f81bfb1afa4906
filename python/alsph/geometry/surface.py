"""Points along the outlines of bodies, where the surface pressure is sampled, by side and distance along the chord."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely import MultiPolygon, Polygon, affinity
from shapely.ops import substring

from alsph.arrays import FloatArray

PIECES = 144
"""Pieces that a closed curve is divided into at least."""


@dataclass(frozen=True, eq=False)
class Surface:
    """The surface of one or several bodies in pieces, those of each closed curve one after the other.

    Attributes
    ----------
    angle : ndarray, shape (m,)
        Degrees from the front over the upper side, seen from the origin of the outlines.
    position, normal : ndarray, shape (m, 2)
        Middle of each piece [D], and unit normal out of the body.
    length : ndarray, shape (m,)
        Length of each piece [D].
    part : ndarray, shape (m,)
        Number of the closed curve that a piece belongs to, from 0.
    side : ndarray, shape (m,)
        1 on the upper side and -1 on the lower one.
    arc : ndarray, shape (m,)
        Distance from the leading edge along the side [D].
    chord : ndarray, shape (m,), or None
        x/c, the distance behind the foremost point along the chord, which turns with the body; None where the surface
        is told by its angle.
    """

    angle: FloatArray
    position: FloatArray
    normal: FloatArray
    length: FloatArray
    part: FloatArray
    side: FloatArray
    arc: FloatArray
    chord: FloatArray | None = None

    def arrays(self) -> dict[str, FloatArray]:
        """Return the attributes by name, without those that are None."""
        return {
            field.name: getattr(self, field.name) for field in fields(self) if getattr(self, field.name) is not None
        }

    def moved(self, offset: FloatArray) -> Surface:
        """Return the surface moved by `offset` (2,)."""
        return replace(self, position=self.position + offset)

    def integral(self, values: FloatArray) -> FloatArray:
        """Return ∮ f n ds (2,) of values f (m,) in the middles of the pieces; exact for a linear f and polygons."""
        return np.asarray((values * self.length) @ self.normal)


def circle(radius: float, count: int) -> Surface:
    """Return a circle about 0 in `count` pieces, the first of them at the front."""
    angle = np.arange(count, dtype=np.float64) * (360.0 / count)
    radians = np.radians(angle)
    normal = np.stack([-np.cos(radians), np.sin(radians)], axis=1)
    whole = np.ones(count)
    return Surface(
        angle=angle,
        position=radius * normal,
        normal=normal,
        length=whole * (2 * np.pi * radius / count),
        part=0 * whole,
        side=np.where(angle <= 180, 1.0, -1.0),
        arc=radius * np.minimum(radians, 2 * np.pi - radians),
    )


def along(outline: Polygon | MultiPolygon, turn: float = 0.0, chord: ArrayLike | None = None) -> Surface:
    """Return the surface of bodies: each curve's from its leading edge over the upper side and back below.

    The edges of an outline, divided where they are long, are the pieces.

    Parameters
    ----------
    outline
        The bodies, nose up by the angle `turn` about the origin.
    turn
        Angle between chord and abscissa [degrees]. Leading and trailing edge are where an outline begins and ends along
        the chord, in the middle of a face across it.
    chord
        Where the chord, or that of each outline, begins and ends along itself, (2,) or (k, 2); that of all together if
        None.
    """
    upright = affinity.rotate(outline, turn, origin=(0, 0))
    pieces = [
        np.column_stack([piece, np.full(len(piece), index)])
        for index, polygon in enumerate(shapely.get_parts(upright))
        for piece in _sides(polygon)
    ]
    x, y, normal_x, normal_y, length, side, arc, part = np.concatenate(pieces).T
    ends = np.asarray(upright.bounds[::2] if chord is None else chord, float)
    left, right = np.broadcast_to(ends, (shapely.get_num_geometries(upright), 2))[part.astype(int)].T
    cos, sin = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    turned = np.array([[cos, -sin], [sin, cos]])  # rows of points times this are turned clockwise
    position = np.stack([x, y], axis=1) @ turned
    return Surface(
        angle=np.asarray(np.degrees(np.arctan2(position[:, 1], -position[:, 0])).round(9) % 360.0),
        position=position,
        normal=np.stack([normal_x, normal_y], axis=1) @ turned,
        length=length,
        part=part,
        side=side,
        arc=arc,
        chord=(x - left) / (right - left),
    )


def _sides(polygon: Polygon) -> list[FloatArray]:
    """Return the pieces (m, 7) of the upper side to the trailing edge and of the lower one back.

    The columns are position, normal, length, side and distance from the leading edge.
    """
    curve = shapely.get_coordinates(polygon.exterior)
    curve = curve[::-1] if shapely.is_ccw(polygon.exterior) else curve
    ring, twice = shapely.LineString(curve), shapely.LineString(np.concatenate([curve, curve[1:]]))
    front, rear = (ring.project(shapely.Point(edge)) for edge in edges(polygon))
    rear += ring.length if rear < front else 0.0
    sides = []
    for side, start, end in ((1.0, front, rear), (-1.0, rear, front + ring.length)):
        line = shapely.segmentize(substring(twice, start, end), ring.length / PIECES)
        vertices = shapely.get_coordinates(line)
        edge = np.diff(vertices, axis=0)
        length = np.hypot(*edge.T)
        kept = length > 1e-12 * ring.length
        middle, edge, length = (0.5 * (vertices[1:] + vertices[:-1]))[kept], edge[kept], length[kept]
        walked = np.cumsum(length) - 0.5 * length
        arc = walked if side > 0 else length.sum() - walked
        normal = np.stack([-edge[:, 1], edge[:, 0]], axis=1) / length[:, None]
        sides.append(np.column_stack([middle, normal, length, np.full(len(length), side), arc]))
    return sides


def edges(outline: Polygon | MultiPolygon) -> tuple[FloatArray, FloatArray]:
    """Return the foremost and the rearmost point (2,) of an outline, in the middle of a face that lies there."""
    points = shapely.get_coordinates(outline)
    x, y = points.T
    near = 1e-9 * np.ptp(x)
    front, rear = (y[np.abs(x - end) <= near] for end in (x.min(), x.max()))
    return np.array([x.min(), np.ptp(front) / 2 + front.min()]), np.array([x.max(), np.ptp(rear) / 2 + rear.min()])
