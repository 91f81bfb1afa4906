"""Particles: their kinds, their arrays, and those of one time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from alsph.arrays import Arrays, FloatArray
from alsph.errors import ConfigError
from alsph.geometry.domain import Domain

if TYPE_CHECKING:
    from scipy.spatial import KDTree


Field = Literal["vorticity", "pressure", "velocity", "velocity_divergence", "q_criterion", "lambda_2"]
"""A field of particles that is drawn."""


class Kind(IntEnum):
    """What a particle is."""

    FLUID = 0
    INLET = 1
    OUTLET = 2
    SOLID = 3


@dataclass(frozen=True, eq=False)
class Snapshot:
    """The particles at one time, in units of D and U.

    Attributes
    ----------
    time : float
        tU/D.
    position, velocity : ndarray, shape (n, d)
    pressure, velocity_divergence : ndarray, shape (n,)
        In ρU² and U/D.
    vorticity : ndarray, shape (n,) in 2-D, (n, 3) in 3-D
        In U/D.
    kind : ndarray of uint8, shape (n,)
        See :class:`alsph.geometry.particles.Kind`.
    domain : Domain, optional
        The box that the flow is computed in, if it is known, with the sides that are periodic.
    solid : callable, optional
        :meth:`alsph.cases.Case.solid_height` of the case, if it is known.
    """

    time: float
    position: FloatArray
    velocity: FloatArray
    pressure: FloatArray
    velocity_divergence: FloatArray
    vorticity: FloatArray
    kind: NDArray[np.uint8]
    domain: Domain | None = None
    solid: Callable[[FloatArray], FloatArray | None] | None = None

    @property
    def fluid(self) -> NDArray[np.bool_]:
        """Fluid particles, those in the inlet and outlet buffers included, shape (n,)."""
        return np.asarray(self.kind != Kind.SOLID)


def check_part(name: str, snapshot: Snapshot, lower: ArrayLike, upper: ArrayLike, axes: Sequence[int]) -> None:
    """Refuse a part of space, from one corner to the other along these axes [D], that holds nothing of a flow.

    Raises
    ------
    ConfigError
        If it does; the message begins with `name` and says where the flow is.
    """
    own = np.array([snapshot.position.min(axis=0), snapshot.position.max(axis=0)])
    if snapshot.domain is not None:
        sides = np.array([snapshot.domain.lower, snapshot.domain.upper])
        own = np.array([np.minimum(own[0], sides[0]), np.maximum(own[1], sides[1])])
    else:
        sides = own
    if np.any(np.asarray(upper) <= own[0, axes]) or np.any(np.asarray(lower) >= own[1, axes]):
        bounds = ", ".join(f"{'xyz'[axis]} from {sides[0, axis]:g} to {sides[1, axis]:g}" for axis in axes)
        raise ConfigError(f"{name}: lies outside of the domain, {bounds} [D]")


SAME = 1e-3
"""Distance [Δx] within which particles lie at one place."""


def at_one_place(position: FloatArray, solid: NDArray[np.bool_], spacing: float) -> NDArray[np.int_]:
    """Return the indices (2,) of two particles at one place, one of them fluid, or none (0,).

    Solid ones may share a place: those of the two faces of a thin body do. Small cells are compared, by one number
    each that is theirs alone up to rounding, which takes a tenth of the time of a tree.
    """
    cells = np.floor(position / (SAME * spacing) + 1 / np.pi)
    key = sum((column * n**0.5 for column, n in zip(cells.T, (1, 2, 3), strict=False)), np.zeros(len(cells)))
    order = np.argsort(key, kind="stable")
    for first in np.flatnonzero(np.diff(key[order]) == 0):
        pair = order[[first, first + 1]]
        if np.array_equal(*cells[pair]) and not solid[pair].all():
            return pair
    return np.empty(0, int)


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
    body: ArrayLike = 0,
    normal: ArrayLike = 0.0,
    depth: ArrayLike = 0.0,
) -> Arrays:
    """Return the arrays of n particles of one kind; every other property is broadcast to `position` (n, d)."""
    n = len(position)
    return {
        "position": position,
        "velocity": np.broadcast_to(np.asarray(velocity, float), position.shape).copy(),
        "pressure": np.broadcast_to(np.asarray(pressure, float), n).copy(),
        "kind": np.full(n, kind, np.uint8),
        "body": np.broadcast_to(np.asarray(body, np.uint16), n).copy(),
        "normal": np.broadcast_to(np.asarray(normal, float), position.shape).copy(),
        "depth": np.broadcast_to(np.asarray(depth, float), n).copy(),
    }


def join(*groups: Arrays) -> Arrays:
    """Concatenate groups of particles."""
    return {name: np.concatenate([group[name] for group in groups]) for name in groups[0]}
