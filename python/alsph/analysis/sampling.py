"""Particle fields at points, and the momentum balance of a box around a body."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alsph.analysis.record import Record
from alsph.arrays import FloatArray
from alsph.errors import ConfigError
from alsph.geometry.domain import Domain
from alsph.geometry.particles import Kind, Snapshot, neighbour_tree

NEIGHBOURS_PER_DIMENSION = 8
NEIGHBOURS_AT_WALLS = 16  # the same where those do not tell all of a fit, and where walls are mirrors
LARGEST_AMPLIFICATION = 1.5  # sum of the moduli of what particles count in a fit at a wall: 1.2 to 1.4 amid particles
SINGULAR = 1e-5  # directions that the neighbours determine less well than this are left out of a fit
CHUNK = 50_000  # points that fields are interpolated to at a time
REACH = 4.0  # Δx beyond a periodic side that particles are continued to, farther than fits reach
VOID = 1.5  # points further than this many Δx from every particle have no value
FILL_WIDTH = 0.7  # of the Gaussian by which the share of space is told that particles fill [Δx]
DROP = 0.54  # times √d: radius of a particle in the air, how far fluid reaches beyond its outermost particles [Δx]


def _nearest(
    position: FloatArray, points: FloatArray, per_dimension: int = NEIGHBOURS_PER_DIMENSION
) -> tuple[FloatArray, NDArray[np.intp]]:
    """Distances (m, k) from each point to its nearest particles, nearest first, and their indices (m, k)."""
    count = min(per_dimension * points.shape[1], len(position))
    distance, index = neighbour_tree(position).query(points, k=[*range(1, count + 1)])
    return distance, index


def average(position: FloatArray, values: FloatArray, points: FloatArray, spacing: float) -> FloatArray:
    """Gaussian means (m,) of a particle field `values` (n,) at points (m, d): smooth, for pictures and gauges.

    NaN where the nearest particle is further away than 1.5 Δx.
    """
    distance, index = _nearest(position, points)
    weight = np.exp(-2 * (distance / spacing) ** 2)
    with np.errstate(invalid="ignore"):  # far from all particles the weights are zero
        means = (weight * values[index]).sum(axis=1) / weight.sum(axis=1)
    return np.where(distance[:, 0] < VOID * spacing, means, np.nan)


def fill(position: FloatArray, points: FloatArray, spacing: float) -> FloatArray:
    """Share (m,) of the space at points (m, d) that particles fill: 1 inside a body, 1/2 on its surface, 0 far off."""
    distance, _ = _nearest(position, points)
    width = FILL_WIDTH * spacing
    kernel = np.exp(-0.5 * (distance / width) ** 2) / (np.sqrt(2 * np.pi) * width) ** points.shape[1]
    return np.asarray(spacing ** points.shape[1] * kernel.sum(axis=1))


def room(points: FloatArray, domain: Domain, spacing: float) -> FloatArray:
    """Share (m,) of the space at points (m, d), as of :func:`fill`, that lies in a domain, which is open to the air."""
    from scipy.special import ndtr  # slow to load, and most pictures do without

    share = np.ones(len(points))
    for axis, sides in enumerate(domain.boundaries):
        heights = points[:, axis] - domain.lower[axis], domain.upper[axis] - points[:, axis]
        for side, height in zip(sides, heights, strict=True):
            if side == "slip":
                share *= ndtr(height / (FILL_WIDTH * spacing))
    return share


def in_air(snapshot: Snapshot, points: FloatArray, spacing: float) -> tuple[NDArray[np.bool_], FloatArray]:
    """Return which points (m, d) lie beyond a free surface, and the share (m,) of the space there that particles fill.

    Solids, too, fill what is beside a surface. The snapshot's domain is known.
    """
    assert snapshot.domain is not None
    around, _ = with_images(snapshot.position, snapshot.pressure, snapshot.domain, REACH * spacing)
    filled = fill(around, points, spacing)
    free = filled < 0.5 * room(points, snapshot.domain, spacing)
    return free & (distance(around, points) > DROP * np.sqrt(points.shape[1]) * spacing), filled


def distance(position: FloatArray, points: FloatArray) -> FloatArray:
    """Distances (m,) of points (m, d) from the nearest particle."""
    return np.asarray(neighbour_tree(position).query(points)[0])


def in_solid(position: FloatArray, fluid: NDArray[np.bool_], points: FloatArray) -> NDArray[np.bool_]:
    """Whether points (m, d) lie in a body: nearer to one of its particles than to any of the fluid."""
    if fluid.all():
        return np.zeros(len(points), bool)
    _, nearest = neighbour_tree(position).query(points)
    return np.asarray(~fluid[nearest])


def at(snapshot: Snapshot, points: FloatArray, spacing: float, domain: Domain) -> dict[str, FloatArray]:
    """Return velocity and pressure of the fluid of a snapshot, and their gradients, at points (m, d) of a domain.

    See :meth:`alsph.Run.sample`.
    """
    points, snapshot = domain.wrapped(points), replace(snapshot, domain=domain)
    position, fields = _fluid(snapshot, spacing)
    seen = (distance(position, points) <= VOID * spacing) & domain.contains(points, 1e-9 * spacing)
    if domain.meets_air:
        seen[seen] = ~in_air(snapshot, points[seen], spacing)[0]
    values = np.full((len(points), fields.shape[1]), np.nan)
    gradients = np.full((*values.shape, points.shape[1]), np.nan)
    values[seen], gradients[seen] = interpolate_parts(position, fields, points[seen], spacing)
    if domain.meets_air:  # beyond the last particles the fit knows nothing of the air
        values[:, -1] = np.maximum(values[:, -1], min(0.0, float(fields[:, -1].min())))
    return {
        "velocity": values[:, :-1],
        "pressure": values[:, -1],
        "velocity_gradient": gradients[:, :-1],
        "pressure_gradient": gradients[:, -1],
    }


def _fluid(snapshot: Snapshot, spacing: float) -> tuple[FloatArray, FloatArray]:
    """Return positions of the fluid with its images beyond periodic sides, velocity and pressure side by side."""
    fluid = snapshot.fluid
    position, fields = snapshot.position[fluid], np.column_stack([snapshot.velocity[fluid], snapshot.pressure[fluid]])
    return with_images(position, fields, snapshot.domain, REACH * spacing)


def velocity_gradient(snapshot: Snapshot, points: FloatArray, spacing: float) -> FloatArray:
    """Return the velocity gradient (m, d, d) of the fluid of a snapshot at points (m, d), those of buffers too."""
    position, fields = _fluid(snapshot, spacing)
    return interpolate_parts(position, fields[:, :-1], points, spacing)[1]


def with_images(
    position: FloatArray, fields: FloatArray, domain: Domain | None, reach: float
) -> tuple[FloatArray, FloatArray]:
    """Return particles with the images of those at most `reach` away from the periodic sides of a domain, if known."""
    if domain is None:
        return position, fields
    for axis in np.flatnonzero(domain.periodic).tolist():
        shift = np.eye(domain.dimensions)[axis] * domain.size[axis]
        along = position[:, axis]
        near = [along < domain.lower[axis] + reach, along > domain.upper[axis] - reach]
        position = np.concatenate([position, position[near[0]] + shift, position[near[1]] - shift])
        fields = np.concatenate([fields, fields[near[0]], fields[near[1]]])
    return position, fields


def interpolate(
    position: FloatArray, values: FloatArray, points: FloatArray, spacing: float
) -> tuple[FloatArray, FloatArray]:
    """Values and gradients of particle fields at points, by quadratic moving least squares over the nearest particles.

    Exact for quadratic fields.

    Parameters
    ----------
    position : ndarray, shape (n, d)
    values : ndarray, shape (n, k)
        The k fields at the particles.
    points : ndarray, shape (m, d)
    spacing : float
        Particle spacing Δx; the Gaussian weight has the standard deviation Δx.

    Returns
    -------
    values : ndarray, shape (m, k)
    gradients : ndarray, shape (m, k, d)
        Derivative of field k along direction d.
    """
    coefficients, determined = _fit(position, values, points, spacing, NEIGHBOURS_PER_DIMENSION)
    if not determined.all():  # next to walls, in 3-D, the nearest lie in two layers
        coefficients[~determined] = _fit(position, values, points[~determined], spacing, NEIGHBOURS_AT_WALLS)[0]
    return coefficients[:, 0], np.swapaxes(coefficients[:, 1 : points.shape[1] + 1], 1, 2) / spacing


def _fit(
    position: FloatArray, values: FloatArray, points: FloatArray, spacing: float, per_dimension: int
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return the coefficients (m, c, k) of quadratic fits about points, and whether the particles tell all of them."""
    distance, index = _nearest(position, points, per_dimension)
    weight, basis = _basis(distance, position[index] - points[:, None], spacing)
    weighted = np.swapaxes(weight * basis, 1, 2)
    size, direction = np.linalg.eigh(weighted @ basis)
    told = size > SINGULAR * size[:, -1:]
    turned = np.swapaxes(direction, 1, 2) @ (weighted @ values[index])
    share = np.where(told, 1.0 / np.where(told, size, 1.0), 0.0)
    return direction @ (share[..., None] * turned), np.asarray(told.all(axis=1))


def _basis(distance: FloatArray, away: FloatArray, spacing: float) -> tuple[FloatArray, FloatArray]:
    """Return weights (m, k, 1) of particles and the functions of a quadratic fit there (m, k, c)."""
    weight, offset = np.exp(-0.5 * (distance / spacing) ** 2)[..., None], away / spacing
    first, second = np.triu_indices(offset.shape[-1])
    return weight, np.concatenate([np.ones_like(weight), offset, offset[..., first] * offset[..., second]], axis=-1)


def pressure_on_walls(
    position: FloatArray,
    pressure: FloatArray,
    points: FloatArray,
    spacing: float,
    domain: Domain,
    body_force: FloatArray,
) -> FloatArray:
    """Return the pressure of fluid particles at points of slip walls (m,); NaN where none is within 1.5 Δx.

    Walls are mirrors: beyond them p − g·r goes on as before them, its derivative across vanishing, so that points in
    walls and corners lie amid particles and nothing is extrapolated. There it is a quadratic fit by moving least
    squares, or the mean where that would make much of what particles differ by, as in spray.

    Parameters
    ----------
    position : ndarray, shape (n, d)
    pressure : ndarray, shape (n,)
    points : ndarray, shape (m, d)
    spacing : float
        Particle spacing Δx.
    domain : Domain
        Its sides that are ``slip`` are the walls.
    body_force : ndarray, shape (d,)
        Per unit mass, g; the density is 1.
    """
    reach = REACH * spacing
    near = ((position > points.min(axis=0) - reach) & (position < points.max(axis=0) + reach)).all(axis=1)
    if not near.any():
        return np.full(len(points), np.nan)
    place, head = position[near], (pressure - position @ body_force)[near]
    for axis, sides in enumerate(domain.boundaries):
        for side, plane in zip(sides, (domain.lower[axis], domain.upper[axis]), strict=True):
            if side == "slip":
                close = np.abs(place[:, axis] - plane) < reach
                image = place[close]
                image[:, axis] = 2 * plane - image[:, axis]
                place, head = np.concatenate([place, image]), np.concatenate([head, head[close]])
    distance, index = _nearest(place, points, NEIGHBOURS_AT_WALLS)
    weight, basis = _basis(distance, place[index] - points[:, None], spacing)
    weighted = np.swapaxes(weight * basis, 1, 2)
    share = (np.linalg.pinv(weighted @ basis, SINGULAR, hermitian=True)[:, :1] @ weighted)[:, 0]
    with np.errstate(invalid="ignore"):  # far from all particles the weights are zero
        mean = weight[..., 0] / weight.sum(axis=1)
    sound = np.abs(share).sum(axis=1, keepdims=True) < LARGEST_AMPLIFICATION
    found = (np.where(sound, share, mean) * head[index]).sum(axis=1) + points @ body_force
    return np.where(distance[:, 0] < VOID * spacing, found, np.nan)


def interpolate_parts(
    position: FloatArray, values: FloatArray, points: FloatArray, spacing: float
) -> tuple[FloatArray, FloatArray]:
    """Return what :func:`interpolate` does, in parts, so that any number of points fits into memory."""
    parts = [points[first : first + CHUNK] for first in range(0, max(len(points), 1), CHUNK)]
    found = [interpolate(position, values, part, spacing) for part in parts]
    own, gradients = (np.concatenate(each) for each in zip(*found, strict=True))
    return own, gradients


def late_velocity(run: Record, points: FloatArray, share: float = 0.25) -> FloatArray:
    """Fluid velocities (m, d) at points, as :func:`late_fields` has them."""
    return late_fields(run, points, share)[0][:, :-1]


def late_fields(run: Record, points: FloatArray, share: float = 0.25) -> tuple[FloatArray, FloatArray]:
    """Fluid velocity and pressure at points, averaged over the snapshots in the last `share` of the run; NaN without.

    Parameters
    ----------
    run : Record
    points : ndarray, shape (m, d)
        Points in the fluid [D].
    share : float
        Share of the time reached.

    Returns
    -------
    values : ndarray, shape (m, d + 1)
        The components of the velocity, and the pressure.
    gradients : ndarray, shape (m, d + 1, d)
        Derivative of field k along direction l at [:, k, l].
    """
    m, d = points.shape
    values, gradients = np.zeros((m, d + 1)), np.zeros((m, d + 1, d))
    late = run.times[run.times >= (1 - share) * run.times[-1:]]
    for snapshot in map(run.snapshot, late):
        found = interpolate(*_fluid(snapshot, run.spacing), points, run.spacing)
        values, gradients = values + found[0], gradients + found[1]
    count = len(late) or np.nan
    return values / count, gradients / count


def initial_state(state: dict[str, Any], run: Record, *, outlet: bool = True) -> dict[str, Any]:
    """Particles with the velocity and pressure of the last snapshot of another run.

    Solids keep what they have, the inlet's particles their velocities, which are prescribed, and the outlet's their
    pressures; so do particles further than 1.5 Δx of that run from all its fluid.

    Parameters
    ----------
    state : dict
        Particles of a case at its start, one array a property.
    run : Record
        The other run, at any resolution and of any Reynolds number.
    outlet : bool
        Whether the outlet's particles take its velocities, too; where not, they let out what its own inflow brings.

    Raises
    ------
    ConfigError
        If the run is of another number of dimensions.
    RunFolderError
        If it has no complete snapshot.
    """
    snapshot = run.snapshot()
    dimensions, own = snapshot.position.shape[1], state["position"].shape[1]
    if dimensions != own:
        raise ConfigError(f"initial_run = '{run.path}': it is in {dimensions}-D and this case in {own}-D")
    source, fields = _fluid(snapshot, run.spacing)
    near = distance(source, state["position"]) < VOID * run.spacing
    takers = {"velocity": [Kind.FLUID, *[Kind.OUTLET] * outlet], "pressure": [Kind.FLUID, Kind.INLET]}
    started = state | {name: state[name].copy() for name in takers}
    chosen = np.flatnonzero(near & (state["kind"] != Kind.SOLID))
    for some in np.array_split(chosen, 1 + len(chosen) // CHUNK):
        values, _ = interpolate(source, fields, state["position"][some], run.spacing)
        for name, columns in (("velocity", values[:, :-1]), ("pressure", values[:, -1])):
            taking = np.isin(state["kind"][some], takers[name])
            started[name][some[taking]] = columns[taking]
    return started


def control_volume(
    position: FloatArray,
    velocity: FloatArray,
    pressure: FloatArray,
    box: tuple[FloatArray, FloatArray],
    spacing: float,
    density: float,
    viscosity: float,
    body_force: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Force on the fluid in a box from outside and its momentum, whose balance gives the force on the body inside.

    The force on the body is ``force - d(momentum)/dt``: what comes in through the faces, and by the body force, less
    what stays in the fluid.

    Parameters
    ----------
    position, velocity : ndarray, shape (n, d)
        Fluid particles.
    pressure : ndarray, shape (n,)
    box : (lower, upper), two ndarrays of shape (d,)
        Corners; the faces must lie in the fluid.
    spacing, density, viscosity : float
        Particle spacing Δx, density ρ and kinematic viscosity ν.
    body_force : ndarray, shape (n, d), optional
        Per unit mass.

    Returns
    -------
    force, momentum : ndarray, shape (d,)
    """
    lower, upper = box
    dimensions = len(lower)
    fields = np.column_stack([velocity, pressure])
    surface = np.zeros(dimensions)
    for axis, sign, points, area in faces(lower, upper, spacing):
        value, gradient = interpolate(position, fields, points, spacing)
        face_velocity, face_pressure = value[:, :dimensions], value[:, dimensions]
        rate = gradient[:, :dimensions, :]
        traction = density * viscosity * (rate[:, :, axis] + rate[:, axis, :])
        traction -= density * face_velocity * face_velocity[:, [axis]]
        traction[:, axis] -= face_pressure
        surface += sign * area * traction.sum(axis=0)
    centre, half = (lower + upper) / 2, (upper - lower) / 2
    share = np.clip((half - np.abs(position - centre)) / spacing + 0.5, 0, 1).prod(axis=1)
    mass = density * spacing**dimensions * share
    return surface if body_force is None else surface + mass @ body_force, mass @ velocity


def faces(lower: FloatArray, upper: FloatArray, spacing: float) -> Iterator[tuple[int, int, FloatArray, float]]:
    """Yield the faces of a box: axis and sign of the outward normal, midpoints (m, d) of its tiles, area of a tile."""
    counts = np.ceil((upper - lower) / spacing).astype(int)
    steps = (upper - lower) / counts
    for axis in range(len(lower)):
        lines = [lo + step * (np.arange(n) + 0.5) for lo, step, n in zip(lower, steps, counts, strict=True)]
        for sign, plane in ((-1, lower[axis]), (1, upper[axis])):
            lines[axis] = np.array([plane])
            grid = np.meshgrid(*lines, indexing="ij")
            yield axis, sign, np.stack([g.ravel() for g in grid], axis=1), float(steps.prod() / steps[axis])
