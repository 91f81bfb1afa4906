"""Particle arrangements, and the problem that is handed to the engine."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
    coefficient_body
        Name of the body whose force coefficients are reported, if any.
    """

    settings: dict[str, Any]
    state: dict[str, Any]
    coefficient_body: str | None = None

    @property
    def dimensions(self) -> int:
        """Number of space dimensions, 2 or 3."""
        return int(self.settings["dimensions"])


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


@dataclass(frozen=True)
class Rings:
    """Solid particles of a circular cylinder.

    Attributes
    ----------
    position
        Positions relative to the centre (n, 2).
    normal
        Outward unit normals (n, 2).
    depth
        Distances below the surface (n,).
    """

    position: FloatArray
    normal: FloatArray
    depth: FloatArray


def cylinder_rings(radius: float, spacing: float, layers: int) -> Rings:
    """Place particles on concentric rings at depths of 1/2, 3/2, ... spacings below the surface.

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
    return Rings(normal * (radius - depth)[:, None], normal, depth)
