"""Start-up of flow through a pipe, with its exact transient: walls in space."""

from typing import ClassVar

import numpy as np
from pydantic import Field

from alsph.arrays import Arrays, FloatArray
from alsph.cases.parallel_flow import ParallelFlow
from alsph.geometry.domain import Domain, SolidBody
from alsph.geometry.lattice import cell_centres, extruded, lattice, symmetric_centres
from alsph.geometry.packing import pack
from alsph.geometry.particles import Kind, join, particles
from alsph.geometry.solids import cylinder_rings
from alsph.geometry.volume import Volume

RADIUS = 0.5
TERMS = 200
"""Terms of the series; those that are left out have decayed after t* = 1e-5 Re."""


class Pipe(ParallelFlow):
    """Flow through a round pipe of diameter D that a body force 16U²/(Re D) along x drives from rest.

    It tends to the paraboloid with the velocity U on the axis (Hagen and Poiseuille); the exact transient is a series
    of Bessel functions (P. Szymanski, J. Math. Pures Appl. 11 (1932) 67). It is the test of curved walls in 3-D.
    """

    name: ClassVar[str] = "pipe"
    title: ClassVar[str] = "start-up of Hagen-Poiseuille flow through a pipe, 3-D"
    in_space: ClassVar[int] = 3
    source: ClassVar[str] = "exact solution (series of Bessel functions)"
    coordinate: ClassVar[str] = "$r/D$"
    span: ClassVar[tuple[float, float]] = (0.0, RADIUS)

    resolution: int = Field(default=20, ge=8, description="particles across the pipe, D/Δx [-]")

    @property
    def default_until(self) -> float:
        """A time in which the flow comes within 2 % of the steady one, 0.16 D²/ν."""
        return 0.16 * self.reynolds

    def body_force(self) -> list[float]:
        """Return the force that keeps the paraboloid moving."""
        return [16 / self.reynolds, 0.0, 0.0]

    def place(self, position: FloatArray) -> FloatArray:
        """Return the distance r (n,) of points (n, 3) from the axis [D]."""
        return np.asarray(np.hypot(*position[:, 1:].T))

    def profile(self, place: FloatArray, time: float) -> FloatArray:
        """Return the exact velocity (n,) along x [U] at distances (n,) from the axis [D] and a time [D/U]."""
        from scipy.special import j0, j1, jn_zeros  # slow to load, and most commands do without

        zeros, s = jn_zeros(0, TERMS)[:, None], place / RADIUS
        decay = np.exp(-(zeros**2) * time / (RADIUS**2 * self.reynolds))
        return np.asarray(1 - s**2 - (8 * j0(zeros * s) / (zeros**3 * j1(zeros)) * decay).sum(axis=0))

    def domain(self) -> Domain:
        """Return one period; the wall closes it around."""
        return Domain(
            (0, -RADIUS, -RADIUS),
            (self._period, RADIUS, RADIUS),
            [("periodic", "periodic"), ("none", "none"), ("none", "none")],
        )

    def bodies(self) -> list[SolidBody]:
        """Return the wall, at rest."""
        return [SolidBody("wall", (self._period / 2, 0, 0))]

    def particle_estimate(self) -> int:
        """Return about how many particles there are."""
        radius = RADIUS * self.resolution + self.support_layers
        return round(self._period * self.resolution * np.pi * radius**2)

    def particles(self) -> Arrays:
        """Return sections of evenly spaced fluid and of rings of wall, one behind the other."""
        spacing = self.particle_spacing
        wall = cylinder_rings(RADIUS, spacing, self.support_layers, side=-1)
        cells = lattice(*[symmetric_centres(self.resolution, spacing)] * 2)
        corner = np.full(2, RADIUS)
        outside = Volume(lambda points: RADIUS - np.hypot(*points.T), -corner, corner, 1 - np.pi * RADIUS**2, 1.0)
        section = pack(cells, outside, wall.position, spacing)
        columns = cell_centres(round(self.length * self.resolution), spacing)
        return join(particles(Kind.FLUID, extruded(columns, section), 0.0), wall.extruded(columns).particles())
