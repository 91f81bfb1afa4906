"""What flows through channels with no-slip walls of any outline share: the walls, the fluid and its buffers."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
import shapely
from numpy.typing import ArrayLike
from pydantic import Field

from alsph.arrays import Arrays, FloatArray
from alsph.cases.base import Case
from alsph.geometry.domain import Domain, SolidBody
from alsph.geometry.lattice import cells, inside
from alsph.geometry.packing import Planar
from alsph.geometry.particles import Kind, join, particles
from alsph.geometry.solids import walls


class Duct(Case):
    """Flow through a channel with no-slip walls, from an inlet at x = -upstream to an outlet.

    Each subclass says what the channel is, a polygon, and the developed flow that it begins with.
    """

    upstream: float = Field(default=5.0, gt=0, description="length of the inlet channel [D]")
    downstream: float = Field(default=20.0, gt=0, description="length of the outlet channel [D]")

    @abstractmethod
    def channel(self, end: float = 0.0) -> shapely.Polygon:
        """Return the channel, longer by `end` [D] on both sides."""

    @abstractmethod
    def developed(self, position: FloatArray) -> FloatArray:
        """Return the velocities (n, 2) at the start, and those of the inlet for good, at positions (n, 2)."""

    def domain(self) -> Domain:
        """Return the bounds of the channel: inlet and outlet, here along x; solid particles close the rest."""
        left, bottom, right, top = self.channel().bounds
        return Domain((left, bottom), (right, top), [("inlet", "outlet"), ("none", "none")])

    def bodies(self) -> list[SolidBody]:
        """Return the walls, at rest."""
        return [SolidBody("walls", (0, 0))]

    @property
    def _buffer(self) -> float:
        """Length of the buffers [D]."""
        return self.buffer_columns * self.particle_spacing

    @property
    def _end(self) -> float:
        """How far the walls reach beyond inlet and outlet [D]."""
        return self._buffer + self.support_layers * self.particle_spacing

    def particle_estimate(self) -> int:
        """Return about how many particles there are, solid and buffers included."""
        channel, depth = self.channel(self._end), self.support_layers * self.particle_spacing
        closed = [[side == "none" for side in sides] for sides in self.checked_domain.boundaries]
        (left, right), (bottom, top) = depth * np.array(closed) * (-1, 1) + np.reshape(channel.bounds, (2, 2)).T
        solid = channel.buffer(depth).intersection(shapely.box(left, bottom, right, top)) - channel
        return round(float(self.channel(self._buffer).area + solid.area) / self.particle_spacing**2)

    def particles(self) -> Arrays:
        """Return a lattice in the channel and its buffers, each with its developed flow, between solid walls."""
        spacing, buffer = self.particle_spacing, self._buffer
        channel = self.channel(self._end)
        solid = walls(channel, spacing, self.support_layers)
        points = cells(channel, spacing)
        points = points[inside(channel, points)]
        before, behind = self._beyond(points)
        groups = {
            Kind.FLUID: (before < 0) & (behind < 0),
            Kind.INLET: (before > 0) & (before < buffer),
            Kind.OUTLET: (behind > 0) & (behind < buffer),
        }
        solid = solid.where(np.max(self._beyond(solid.position), axis=0) < self._end)
        return join(
            *(particles(kind, points[chosen], self.developed(points[chosen])) for kind, chosen in groups.items()),
            solid.particles(body=self.wall(solid.position)),
        )

    def solid_height(self, position: FloatArray) -> FloatArray:
        """Return how far points (n, 2) lie in the channel [D]."""
        return -Planar(self.channel(self._end)).height(position)

    def wall(self, position: FloatArray) -> ArrayLike:
        """Return which of :meth:`bodies` the solid particles at positions (n, 2) belong to, by its place there."""
        return 0

    def _beyond(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return how far points (n, 2) lie beyond the inlet and beyond the outlet [D]."""
        return self.checked_domain.beyond("inlet", points), self.checked_domain.beyond("outlet", points)


def parabola(share: FloatArray, mean: FloatArray) -> FloatArray:
    """Return the velocities (n, 2) of the developed flow at shares (n,) of a channel's height, with that mean."""
    return np.stack([6 * mean * share * (1 - share), 0 * share], axis=1)
