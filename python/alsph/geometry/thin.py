"""Bodies as a resolution can carry them: parts that are too thin cut off, and two faces where the rest is thin.

Holes that are too narrow are filled.
"""

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import LineString, MultiPolygon, Point, Polygon, affinity

from alsph.arrays import FloatArray
from alsph.geometry.solids import Solid, body_layers, facing

THINNEST = 2.0
"""Least thickness of a body [Δx]: a layer of solid particles for each face."""

NARROWEST_HOLE = 4.0
"""Least diameter of the largest disc in a hole [Δx] that is filled with fluid."""

WIDE = np.radians(75)
"""Corners of a wider inner angle stay sharp."""

ROUGH = 0.01
"""Depth of notches [Δx], such as the noise of measured outlines, whose edges are no corners."""

OPPOSED = -0.85
"""Largest product of the unit normals of two faces of a thin part; its edges, where they turn away, have but one."""

AXIS = 0.25
"""Solid particles of a symmetric body that are nearer to its axis than this [Δx] are put on it."""

CONE = np.radians(45)
"""The opposite face is looked for this far off the normal."""


def carried(shape: Polygon | MultiPolygon, spacing: float) -> Polygon | MultiPolygon:
    """Return what is left of a body when all that is thinner than 2 Δx, such as a sharp trailing edge, is cut off.

    It is the shape opened by a disc (all the discs of that diameter that fit in), but for the tips of its wide corners,
    which stay; holes narrower than 4 Δx are filled before. It tends to the shape as Δx falls, and is empty where no
    disc fits in.
    """
    radius = 0.5 * THINNEST * spacing * (1 - 1e-3)  # a plate of just that thickness is carried
    shape = _without_narrow_holes(shape, spacing)
    core = shape.buffer(-radius)
    if core.is_empty:
        return core
    opened = core.buffer(radius, quad_segs=32).intersection(shape)
    reach = radius / np.tan(WIDE / 2)  # where a disc in the corner touches its sides
    corners = _wide_corners(shape.simplify(ROUGH * spacing))
    tips = [shape.intersection(Point(corner).buffer(reach)) for corner in corners]
    near = [tip for tip in tips if tip.distance(core) <= radius * (1 / np.sin(WIDE / 2))]
    whole = shapely.union_all([opened, *near]).simplify(1e-4 * spacing)
    parts = [part for part in shapely.get_parts(whole) if part.intersects(core)]  # the disc fits into no other
    whole = parts[0] if len(parts) == 1 else MultiPolygon(parts)
    if not is_symmetric(shape):
        return whole
    left, _, right, top = whole.bounds
    half = whole.intersection(shapely.box(left, 0, right, top))
    return half.union(_mirror_image(half))


def _without_narrow_holes(shape: Polygon | MultiPolygon, spacing: float) -> Polygon | MultiPolygon:
    """Return a shape with those of its holes filled that are too narrow for fluid."""
    narrow = [hole for hole in holes(shape) if thickness(hole) < NARROWEST_HOLE * spacing * (1 - 1e-3)]
    return shape.union(shapely.union_all(narrow)) if narrow else shape


def holes(shape: Polygon | MultiPolygon) -> list[Polygon]:
    """Return the holes of a shape."""
    return [Polygon(ring) for part in shapely.get_parts(shape) for ring in part.interiors]


def pockets(shape: Polygon | MultiPolygon) -> list[Polygon]:
    """Return what of the holes of a shape is left by parts of it that lie in them."""
    left = shapely.union_all(holes(shape)).difference(shape)
    return [part for part in shapely.get_parts(left) if part.area > 0]


def filled(shape: Polygon | MultiPolygon) -> Polygon | MultiPolygon:
    """Return a shape with its holes filled, and what lies in them."""
    parts = [Polygon(part.exterior) for part in shapely.get_parts(shape)]
    outer = [part for part in parts if not any(other.contains_properly(part) for other in parts)]
    return outer[0] if len(outer) == 1 else MultiPolygon(outer)


def _wide_corners(shape: Polygon | MultiPolygon) -> FloatArray:
    """Return the convex corners (n, 2) that turn by more than 30 degrees and are wider than `WIDE` inside."""
    corners = [np.empty((0, 2))]
    parts = [shapely.geometry.polygon.orient(part) for part in shapely.get_parts(shape)]
    for ring in (ring for part in parts for ring in (part.exterior, *part.interiors)):
        points = shapely.get_coordinates(ring)[:-1]
        before, after = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
        turn = np.arctan2(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0], (before * after).sum(axis=1))
        corners.append(points[(turn > np.radians(30)) & (turn < np.pi - WIDE)])
    return np.concatenate(corners)


def thickness(shape: Polygon) -> float:
    """Return the diameter of the largest disc in a shape."""
    return float(2 * shapely.maximum_inscribed_circle(shape, tolerance=1e-3 * np.sqrt(shape.area)).length)


def solids(shapes: Sequence[Polygon | MultiPolygon], spacing: float, layers: int) -> list[Solid]:
    """Place particles along the surface of each carried body; those of two that are mirror images are so, too."""
    made: list[Solid] = []
    for shape in shapes:
        image = _mirror_image(shape)
        twin = next((other for other, outline in zip(made, shapes, strict=False) if _are_same(outline, image)), None)
        made.append(twin.mirrored() if twin else solid(shape, spacing, layers))
    return made


def solid(shape: Polygon | MultiPolygon, spacing: float, layers: int) -> Solid:
    """Place particles along the surface of a carried body, up to `layers` deep, with two faces where it is thin.

    Those of a body that is its own mirror image about y = 0 are so, too.
    """
    position = np.concatenate([body_layers(part, spacing, layers).position for part in shapely.get_parts(shape)])
    if not is_symmetric(shape):
        return with_both_faces(_with_normals(facing(position, shape, spacing), shape), shape, layers * spacing)
    axis = np.abs(position[:, 1]) < AXIS * spacing
    upper = position[(position[:, 1] > 0) & ~axis]
    middle = np.sort(position[axis, 0])
    middle = middle[np.diff(middle, prepend=-np.inf) > 2 * AXIS * spacing]  # of a pair about the axis, one
    half = facing(np.concatenate([upper, np.stack([middle, 0 * middle], axis=1)]), shape, spacing)
    half.normal[len(upper) :, 1] = 0
    half = with_both_faces(_with_normals(half, shape), shape, layers * spacing)
    flip, above = np.array([1.0, -1.0]), half.position[:, 1] > 0
    half.normal[~above] = np.sign(half.normal[~above] * [1, 0])  # of two faces that are as near, the mean
    return Solid(
        np.concatenate([half.position, half.position[above] * flip]),
        np.concatenate([half.normal, half.normal[above] * flip]),
        np.concatenate([half.depth, half.depth[above]]),
    )


def _with_normals(solid: Solid, shape: Polygon | MultiPolygon) -> Solid:
    """Give particles midway between parallel faces, which have no normal, that of one of the two."""
    normal = solid.normal.copy()
    for k in np.flatnonzero(np.hypot(*normal.T) < 0.5):
        offset = _nearest(shape.boundary, solid.position[k]) - solid.position[k]
        normal[k] = offset / np.hypot(*offset)
    return Solid(solid.position, normal, solid.depth)


def with_both_faces(solid: Solid, shape: Polygon | MultiPolygon, reach: float) -> Solid:
    """Add a particle of the opposite face at the place of each whose opposite face is within `reach`.

    The fluid on each face then has a wall of its own there (``rust/faces.rs``).
    """
    found = [
        (k, *opposite)
        for k, place in enumerate(zip(solid.position, solid.normal, strict=True))
        if (opposite := _opposite(shape, *place, reach)) is not None
    ]
    if not found:
        return solid
    chosen = np.array([k for k, *_ in found])
    return Solid(
        np.concatenate([solid.position, solid.position[chosen]]),
        np.concatenate([solid.normal, [normal for _, normal, _ in found]]),
        np.concatenate([solid.depth, [depth for *_, depth in found]]),
    )


def _opposite(
    shape: Polygon | MultiPolygon, position: FloatArray, normal: FloatArray, reach: float
) -> tuple[FloatArray, float] | None:
    """Return normal (2,) and depth of the face on the other side of a place in a body, None if there is none near."""
    through = shape.boundary.intersection(LineString([position, position - reach * normal]))
    if through.is_empty:
        return None
    exit_ = _nearest(through, position) + 1e-6 * reach * normal
    facing = _nearest(shape.boundary, exit_) - exit_
    if facing @ normal > OPPOSED * np.hypot(*facing):
        return None
    angle = np.arctan2(*-normal[::-1]) + np.linspace(-CONE, CONE, 9)
    cone = Polygon([position, *(position + 1.1 * reach * np.stack([np.cos(angle), np.sin(angle)], axis=1))])
    offset = _nearest(shape.boundary.intersection(cone), position) - position
    depth = float(np.hypot(*offset))
    return offset / depth, depth


def _nearest(curve: shapely.Geometry, place: FloatArray) -> FloatArray:
    """Return the point (2,) of a curve that is nearest to a place."""
    return np.asarray(shapely.get_coordinates(shapely.shortest_line(Point(place), curve))[1])


def is_symmetric(shape: Polygon | MultiPolygon) -> bool:
    """Return whether a shape is its own mirror image about y = 0."""
    return _are_same(shape, _mirror_image(shape))


def _are_same(shape: Polygon | MultiPolygon, other: Polygon | MultiPolygon) -> bool:
    return bool(shape.symmetric_difference(other).area < 1e-9 * shape.area)


def _mirror_image(shape: Polygon | MultiPolygon) -> Polygon | MultiPolygon:
    return affinity.scale(shape, 1, -1, origin=(0, 0))
