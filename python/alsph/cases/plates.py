"""What flows between plates share: fluid between two parallel plates, and the error of its profile."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, ClassVar, Self

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field, model_validator

from alsph.analysis.averages import error_norms
from alsph.analysis.measures import Measure, Profile
from alsph.analysis.record import Record
from alsph.arrays import FloatArray
from alsph.cases.base import Case
from alsph.geometry.domain import Domain, SolidBody
from alsph.geometry.lattice import cells
from alsph.geometry.particles import Kind, join, particles
from alsph.geometry.solids import walls

TERMS = np.arange(1, 401)[:, None]
"""Indices of the terms of the series (400, 1); those that are left out have decayed after t* = 1e-4 Re."""


class Plates(Case):
    """Flow along x between no-slip plates at y = 0 and y = D, periodic along x."""

    upper_velocity: ClassVar[float]
    source: ClassVar[str]
    later_names: ClassVar[tuple[str, ...]] = ("velocity at tU/D = ",)

    reynolds: float = Field(default=10.0, gt=0, description="Reynolds number UD/ν [-]")
    resolution: int = Field(default=40, ge=8, description="particles between the plates, D/Δx [-]")
    length: float = Field(default=0.5, gt=0, description="period along the plates [D]")

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.whole_cells("length", self.length) < self.support_layers:
            raise ValueError(f"length = {self.length:g}: shorter than the kernel's support radius; use a longer one")
        return self

    @abstractmethod
    def profile(self, y: FloatArray, time: float) -> FloatArray:
        """Return the exact velocity (n,) along x [U] at heights y (n,) [D] and a time [D/U]."""

    def initial_profile(self, y: FloatArray) -> FloatArray:
        """Return the velocity (n,) along x at the start [U] at heights y (n,) [D]: rest."""
        return np.zeros_like(y)

    @property
    def default_until(self) -> float:
        """A quarter of the diffusion time D²/ν: the flow is then 90 % of the steady one."""
        return 0.25 * self.reynolds

    def exact(self, position: FloatArray, time: float) -> dict[str, FloatArray]:
        """Return the exact ``velocity`` (n, 2) [U].

        Parameters
        ----------
        position
            Points (n, 2) [D].
        time
            Time [D/U].
        """
        return {"velocity": self.profile(position[:, 1], time)[:, None] * [1.0, 0.0]}

    def domain(self) -> Domain:
        """Return one period; solid particles close it below and above."""
        return Domain((0, 0), (self.length, 1), [("periodic", "periodic"), ("none", "none")])

    def bodies(self) -> list[SolidBody]:
        """Return the plates, which slide in place."""
        middle = self.length / 2, 0.5
        return [SolidBody("lower", middle), SolidBody("upper", middle, (self.upper_velocity, 0))]

    def particles(self) -> dict[str, NDArray[Any]]:
        """Return a lattice of fluid between the solid particles of the plates."""
        region = shapely.box(0, 0, self.length, 1)
        solid = walls(region, self.particle_spacing, self.support_layers)
        x, y = solid.position.T
        period = (x > 0) & (x < self.length)
        fluid = cells(region, self.particle_spacing)
        return join(
            particles(Kind.FLUID, fluid, self.initial_profile(fluid[:, 1])[:, None] * [1.0, 0.0]),
            solid.where(period & (y < 0)).particles(),
            solid.where(period & (y > 1)).particles([self.upper_velocity, 0.0], body=1),
        )

    def measures(self, run: Record) -> list[Measure]:
        """Return the relative error (L2 over the particles) of the velocity in the last snapshot."""
        error = np.nan
        if (run.times > 0).any():
            snapshot = run.snapshot()
            fluid = snapshot.fluid
            exact = self.exact(snapshot.position[fluid], snapshot.time)["velocity"]
            error = error_norms(snapshot.velocity[fluid], exact)["l2"]
        return [Measure("relative L2 error of the velocity", error, 0.0, 0.01, self.source)]

    def profiles(self, run: Record) -> list[Profile]:
        """Return the particles' velocities in the last snapshot over their heights."""
        if not len(run.times):
            return []
        snapshot = run.snapshot()
        y, u = snapshot.position[snapshot.fluid, 1], snapshot.velocity[snapshot.fluid, 0]
        order, heights = np.argsort(y), np.linspace(0, 1, 201)
        exact = heights, self.profile(heights, snapshot.time)
        name = f"velocity at tU/D = {snapshot.time:.2f}"
        return [Profile(name, ("$y/D$", "$u/U$"), (y[order], u[order]), exact, self.source)]
