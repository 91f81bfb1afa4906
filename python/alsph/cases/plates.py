"""What flows between plates share: fluid between two parallel plates."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

import numpy as np
import shapely

from alsph.arrays import Arrays, FloatArray
from alsph.cases.parallel_flow import ParallelFlow
from alsph.geometry.domain import Domain, SolidBody
from alsph.geometry.lattice import cells
from alsph.geometry.particles import Kind, join, particles
from alsph.geometry.solids import walls

TERMS = np.arange(1, 401)[:, None]
"""Indices of the terms of the series (400, 1); those that are left out have decayed after t* = 1e-4 Re."""


class Plates(ParallelFlow):
    """Flow along x between no-slip plates at y = 0 and y = D, periodic along x."""

    upper_velocity: ClassVar[float]
    coordinate: ClassVar[str] = "$y/D$"
    span: ClassVar[tuple[float, float]] = (0.0, 1.0)

    def place(self, position: FloatArray) -> FloatArray:
        """Return the height y (n,) of points (n, 2) [D]."""
        return position[:, 1]

    @abstractmethod
    def profile(self, y: FloatArray, time: float) -> FloatArray:
        """Return the exact velocity (n,) along x [U] at heights y (n,) [D] and a time [D/U]."""

    def initial_profile(self, y: FloatArray) -> FloatArray:
        """Return the velocity (n,) along x at the start [U] at heights y (n,) [D]: rest."""
        return np.zeros_like(y)

    def domain(self) -> Domain:
        """Return one period; solid particles close it below and above."""
        return Domain((0, 0), (self._period, 1), [("periodic", "periodic"), ("none", "none")])

    def bodies(self) -> list[SolidBody]:
        """Return the plates, which slide in place."""
        middle = self._period / 2, 0.5
        return [SolidBody("lower", middle), SolidBody("upper", middle, (self.upper_velocity, 0))]

    def particles(self) -> Arrays:
        """Return a lattice of fluid between the solid particles of the plates."""
        region = shapely.box(0, 0, self._period, 1)
        solid = walls(region, self.particle_spacing, self.support_layers)
        x, y = solid.position.T
        period = (x > 0) & (x < self._period)
        fluid = cells(region, self.particle_spacing)
        return join(
            particles(Kind.FLUID, fluid, self.initial_profile(fluid[:, 1])[:, None] * [1.0, 0.0]),
            solid.where(period & (y < 0)).particles(),
            solid.where(period & (y > 1)).particles([self.upper_velocity, 0.0], body=1),
        )
