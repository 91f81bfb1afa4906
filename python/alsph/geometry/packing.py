"""The fluid around a body at the start: as much as there is room for, none on the surface, evenly spaced."""

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import MultiPolygon, Polygon

from alsph.arrays import FloatArray
from alsph.geometry.lattice import inside, lattice, symmetric_centres
from alsph.geometry.particles import neighbour_tree
from alsph.geometry.thin import is_symmetric

BAND = 4.0
"""Particles as far from the body as this [Δx] are moved."""

CLEARANCE = 0.4
"""Least distance from the surface [Δx]."""

WIDTH = 0.6
"""Width of the Gaussian by which particles repel each other [Δx]."""

SWEEPS = 200
STEP = 0.1
EVEN = 1e-6
"""Displacement [Δx] below which particles count as evenly spaced: on a lattice that fits the body they stay."""


def pack(cells: FloatArray, body: Polygon | MultiPolygon, solid: FloatArray, spacing: float) -> FloatArray:
    """Return fluid particles (m, 2) around a body, their number times Δx² being the area that it leaves.

    Those next to the body are taken from where they are most crowded until the number is right, and then repel each
    other until they are evenly spaced. Around a body that is its own mirror image about y = 0 they are so, too; their
    number may then be one off.

    Parameters
    ----------
    cells
        Cell centres (n, 2) of the fluid and the body, which fill a rectangle.
    body
        The body.
    solid
        Its solid particles (k, 2).
    spacing
        Particle spacing Δx.
    """
    symmetric = is_symmetric(body)
    count = round(len(cells) - body.area / spacing**2)
    height = _height(body, cells, BAND * spacing)
    far, near = cells[height > BAND * spacing], cells[(height <= BAND * spacing) & (height > -spacing)]
    sides = _around(_beyond(cells, spacing), body, 2 * BAND * spacing)
    fixed = np.concatenate([_around(far, body, 3 * BAND * spacing), sides, solid])
    near = _thinned(near, fixed, count - len(far), spacing, symmetric)
    return np.asarray(np.concatenate([far, _spread(near, fixed, body, spacing, symmetric)]))


def _height(body: Polygon | MultiPolygon, points: FloatArray, reach: float = np.inf) -> FloatArray:
    """Return how far points (n, 2) lie outside the body, negative inside; infinite beyond `reach` of its bounds."""
    lower, upper = np.split(np.array(body.bounds), 2)
    near = ((points >= lower - reach) & (points <= upper + reach)).all(axis=1)
    distance = shapely.distance(body.boundary, shapely.points(points[near]))
    height = np.full(len(points), np.inf)
    height[near] = np.where(inside(body, points[near]), -distance, distance)
    return height


def _around(points: FloatArray, body: Polygon | MultiPolygon, reach: float) -> FloatArray:
    return np.asarray(points[_height(body, points, reach) < reach])


def _beyond(cells: FloatArray, spacing: float) -> FloatArray:
    """Return the cells around a rectangle of cells, which keep the particles at its sides within it."""
    lower, upper = cells.min(axis=0), cells.max(axis=0)
    counts, middle = np.rint((upper - lower) / spacing).astype(int) + 1, (lower + upper) / 2
    margin = int(np.ceil(4 * WIDTH))
    points = middle + lattice(*(symmetric_centres(count + 2 * margin, spacing) for count in counts))
    return np.asarray(points[(np.abs(points - middle) > (upper - lower + spacing) / 2).any(axis=1)])


def _mirror(points: FloatArray) -> NDArray[np.intp]:
    """Return the index of the mirror image about y = 0 of each point (n, 2)."""
    return np.asarray(neighbour_tree(points).query(points * (1.0, -1.0))[1])


def _thinned(near: FloatArray, fixed: FloatArray, count: int, spacing: float, symmetric: bool) -> FloatArray:
    """Take away the most crowded particles, with their mirror images, until `count` are left."""
    tree = neighbour_tree(near)
    partner = _mirror(near) if symmetric else np.arange(len(near))
    crowd = _weights(near, np.concatenate([near, fixed]), spacing)
    kept = np.ones(len(near), bool)
    while (surplus := int(kept.sum()) - count) > 0:
        # Of equals the one farthest back in the list, so that rounding does not choose.
        most = int(np.flatnonzero(kept & (crowd > crowd[kept].max() - 1e-9))[-1])
        both = {most, int(partner[most])}
        if len(both) > surplus:
            break
        for gone in both:
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


def _spread(
    near: FloatArray, fixed: FloatArray, body: Polygon | MultiPolygon, spacing: float, symmetric: bool
) -> FloatArray:
    """Let the particles repel each other, and the solid and far ones them."""
    partner = _mirror(near) if symmetric else np.arange(len(near))
    flip = np.array([1.0, -1.0 if symmetric else 1.0])
    reach = 4 * WIDTH * spacing
    for _ in range(SWEEPS):
        everyone = np.concatenate([near, fixed])
        pairs = neighbour_tree(near).sparse_distance_matrix(neighbour_tree(everyone), reach, output_type="coo_matrix")
        offset = near[pairs.row] - everyone[pairs.col]
        push = offset * _gaussian(offset, spacing)[:, None]
        force = np.stack([np.bincount(pairs.row, push[:, axis], len(near)) for axis in range(2)], axis=1)
        move = STEP * force / WIDTH
        size = np.hypot(*move.T)[:, None]
        if size.max() < EVEN * spacing:
            break
        near = near + move * np.minimum(1, 0.1 * spacing / np.maximum(size, 1e-300))
        near = _cleared(near, body, CLEARANCE * spacing)
        near = 0.5 * (near + near[partner] * flip) if symmetric else near
    return near


def _cleared(points: FloatArray, body: Polygon | MultiPolygon, least: float) -> FloatArray:
    """Move points that are nearer than `least` to the body out to that distance."""
    height = _height(body, points)
    low = np.flatnonzero(height < least)
    feet = shapely.get_coordinates(shapely.shortest_line(shapely.points(points[low]), body.boundary))[1::2]
    outward = (points[low] - feet) / height[low][:, None]
    points = points.copy()
    points[low] = feet + least * outward
    return points
