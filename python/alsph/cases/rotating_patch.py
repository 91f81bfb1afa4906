"""A square of fluid that turns as a rigid body at first."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

from alsph.analysis.measures import Measure
from alsph.analysis.record import Record
from alsph.arrays import Arrays, FloatArray
from alsph.cases.free_surface import FreeSurface
from alsph.geometry.domain import Domain
from alsph.geometry.lattice import cell_centres, lattice
from alsph.symbols import Symbols

TERMS = np.arange(1, 80, 2)
"""Numbers of the terms of the Fourier series."""

THIN = 3.0
"""From when on [Ω⁻¹] isolated particles tell of arms that are torn; before, they are those of their tips."""


class RotatingPatch(FreeSurface):
    """A square of side L that turns with the angular velocity Ω, clockwise, without gravity: it grows arms.

    The pressure inside is below that of the air, which tears a fluid apart whose scheme does not hold it together
    (Colagrossi 2003).
    """

    name: ClassVar[str] = "rotating_patch"
    title: ClassVar[str] = "rotating square patch"
    inviscid_from: ClassVar[float] = 1000.0
    symbols: ClassVar[Symbols] = Symbols("L", "ΩL", "Ω⁻¹", "Ω", "Ω²L", "ρΩ²L²", "Ωt")
    gravity: ClassVar[bool] = False
    tension: ClassVar[bool] = True
    later_names: ClassVar[tuple[str, ...]] = (
        *FreeSurface.later_names,
        "angular momentum over its start",
        "kinetic energy over its start",
        "share of isolated particles",
    )

    resolution: int = Field(default=40, ge=8, description="particles per side, L/Δx [-]")

    @property
    def default_until(self) -> float:
        """Before the arms are thinner than a few particles."""
        return 2.0

    def domain(self) -> Domain:
        """Return a box that is open on all sides."""
        return Domain([-4, -4], [4, 4], [("air", "air")] * 2)

    @property
    def initial_volume(self) -> float:
        """That of the square [L²]."""
        return 1.0

    def particles(self) -> Arrays:
        """Return a lattice that turns, with the pressure of its first instant."""
        axis = cell_centres(self.resolution, self.particle_spacing) - 0.5
        position = lattice(axis, axis)
        velocity = np.stack([position[:, 1], -position[:, 0]], axis=1)
        return self.fluid(position, velocity, self.first_pressure(position))

    def first_pressure(self, position: FloatArray) -> FloatArray:
        """Return the pressure (n,) of the first instant [ρΩ²L²]: ∇²p = 2, 0 on the square, a Fourier series."""
        x, y = (np.sin(np.pi * TERMS[:, None] * (x + 0.5)) for x in position.T)
        m, n = np.meshgrid(TERMS, TERMS, indexing="ij")
        size = -32 / (m * n * np.pi**2) / (np.pi**2 * (m**2 + n**2))
        return np.asarray(np.einsum("mn,mk,nk->k", size, x, y))

    def measures(self, run: Record) -> list[Measure]:
        """Return angular momentum and kinetic energy at the end over their start, which an inviscid fluid keeps."""
        rows = self.energy_measures(run)
        if not len(run.times) or run.times[-1] <= 0:
            return rows
        snapshot, start = run.snapshot(), self.particles()
        turned = self._angular_momentum(snapshot.position, snapshot.velocity)
        energy = run.history["kinetic_energy"]
        if run.times[-1] >= THIN:
            alone = float(run.history["isolated"][-1] / run.history["fluid"][-1])
            rows.append(Measure("share of isolated particles", alone, 0.0, 0.01, "a patch without voids"))
        source = "inviscid fluid"
        found = [
            Measure(
                "angular momentum over its start",
                turned / self._angular_momentum(start["position"], start["velocity"]),
                1.0,
                0.005,
                source,
            ),
            Measure("kinetic energy over its start", float(energy[-1] / energy[0]), 1.0, 0.05, source),
        ]
        return self.compared(found) + rows

    @staticmethod
    def _angular_momentum(position: FloatArray, velocity: FloatArray) -> float:
        return float((position[:, 0] * velocity[:, 1] - position[:, 1] * velocity[:, 0]).sum())
