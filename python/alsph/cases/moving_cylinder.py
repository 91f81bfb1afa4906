"""A cylinder that moves through a fluid at rest in a box."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from alsph.arrays import Arrays, FloatArray
from alsph.cases.base import Case
from alsph.geometry.domain import Boundary, Domain, SolidBody
from alsph.geometry.lattice import lattice, symmetric_centres
from alsph.geometry.particles import Kind, join, particles
from alsph.geometry.solids import cylinder_rings

RADIUS = 0.5


class MovingCylinder(Case):
    """A cylinder of diameter D that moves through a fluid at rest in a box, in whose middle it begins.

    How it moves, :meth:`motion` says.
    """

    settles: ClassVar[bool] = False
    velocity_max: ClassVar[float] = 1.5
    sides: ClassVar[tuple[Boundary, Boundary]] = ("slip", "slip")
    """What closes the box along x and y."""

    reynolds: float = Field(default=100.0, gt=0, description="Reynolds number UD/ν [-]")
    resolution: int = Field(default=20, ge=8, description="particles per diameter, D/Δx [-]")
    length: float = Field(default=16.0, gt=2, description="length of the box [D]")
    height: float = Field(default=16.0, gt=2, description="height of the box [D]")

    @property
    def coefficient_bodies(self) -> list[str]:
        """Name of the cylinder."""
        return ["cylinder"]

    def domain(self) -> Domain:
        """Return the box."""
        half = self.length / 2, self.height / 2
        return Domain((-half[0], -half[1]), half, [(side, side) for side in self.sides])

    def bodies(self) -> list[SolidBody]:
        """Return the cylinder."""
        return [SolidBody("cylinder", (0, 0), velocity=None, moves=True)]

    @abstractmethod
    def motion(self, position: FloatArray, time: float) -> ArrayLike:
        """Return how far the cylinder has come [D]."""

    def particles(self) -> Arrays:
        """Return a lattice at rest around the cylinder."""
        spacing = self.particle_spacing
        columns = [self.whole_cells(name, getattr(self, name)) for name in ("length", "height")]
        cells = lattice(*(symmetric_centres(count, spacing) for count in columns))
        cylinder = cylinder_rings(RADIUS, spacing, self.support_layers)
        fluid = cells[np.hypot(*cells.T) >= RADIUS]
        return join(particles(Kind.FLUID, fluid, 0.0), cylinder.particles())

    def solid_height(self, position: FloatArray) -> FloatArray:
        """Return how far points (n, 2) lie outside of the cylinder where it begins [D]."""
        return np.asarray(np.hypot(*position.T) - RADIUS)

    def fluid_volume(self) -> float:
        """Return the area of the box without the cylinder."""
        return self.length * self.height - math.pi * RADIUS**2
