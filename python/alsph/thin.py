"""Bodies as a resolution can carry them: parts that are too thin cut off, and two faces where the rest is thin."""

import numpy as np
import shapely
from shapely import LineString, MultiPolygon, Point, Polygon, affinity

from alsph.geometry import FloatArray, Solid

THINNEST = 2.0
"""Least thickness of a body [Δx]: a layer of solid particles for each face."""

WIDE = np.radians(75)
"""Corners of a wider inner angle stay sharp."""

OPPOSED = -0.85
"""Largest product of the unit normals of two faces of a thin part; at its edges, where they turn away, it has but one."""

CONE = np.radians(45)
"""The opposite face is looked for this far off the normal."""


def carried(shape: Polygon | MultiPolygon, spacing: float) -> Polygon | MultiPolygon:
    """Return what is left of a body when all that is thinner than 2 Δx, such as a sharp trailing edge, is cut off.

    It is the shape opened by a disc (all the discs of that diameter that fit in), but for the tips of its wide corners,
    which stay. It tends to the shape as Δx falls, and is empty where no disc fits in.
    """
    radius = 0.5 * THINNEST * spacing * (1 - 1e-9)  # a plate of just that thickness is carried
    core = shape.buffer(-radius)
    if core.is_empty:
        return core
    opened = core.buffer(radius, quad_segs=32).intersection(shape)
    reach = radius / np.tan(WIDE / 2)  # where a disc in the corner touches its sides
    tips = [shape.intersection(Point(corner).buffer(reach)) for corner in _wide_corners(shape)]
    near = [tip for tip in tips if tip.distance(core) <= radius * (1 / np.sin(WIDE / 2))]
    whole = shapely.union_all([opened, *near]).simplify(1e-4 * spacing)
    if not is_symmetric(shape):
        return whole
    left, _, right, top = whole.bounds
    half = whole.intersection(shapely.box(left, 0, right, top))
    return half.union(_mirror_image(half))


def _wide_corners(shape: Polygon | MultiPolygon) -> FloatArray:
    """Return the convex corners (n, 2) that turn by more than 30 degrees and are wider than `WIDE` inside."""
    corners = [np.empty((0, 2))]
    for polygon in shapely.get_parts(shape):
        points = shapely.get_coordinates(shapely.geometry.polygon.orient(polygon).exterior)[:-1]
        before, after = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
        turn = np.arctan2(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0], (before * after).sum(axis=1))
        corners.append(points[(turn > np.radians(30)) & (turn < np.pi - WIDE)])
    return np.concatenate(corners)


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
    return bool(shape.symmetric_difference(_mirror_image(shape)).area < 1e-9 * shape.area)


def _mirror_image(shape: Polygon | MultiPolygon) -> Polygon | MultiPolygon:
    return affinity.scale(shape, 1, -1, origin=(0, 0))


def mirrored(solid: Solid, spacing: float) -> Solid:
    """Return the upper half of the particles of a symmetric body and its exact mirror image about y = 0."""
    axis = np.abs(solid.position[:, 1]) < 0.05 * spacing
    upper, middle = solid.where((solid.position[:, 1] > 0) & ~axis), solid.where(axis)
    flip = np.array([1.0, -1.0])
    level = np.column_stack([middle.normal[:, 0], np.zeros(len(middle.depth))])
    return Solid(
        np.concatenate([upper.position, upper.position * flip, middle.position * (1.0, 0.0)]),
        np.concatenate([upper.normal, upper.normal * flip, level / np.hypot(*level.T)[:, None].clip(0.5)]),
        np.concatenate([upper.depth, upper.depth, middle.depth]),
    )
