"""A drop that is stretched into an ellipse, with its exact solution."""

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

TURNED = np.arctan(2) / 2
"""Angle by which the lattice is turned against the axes of the flow."""


class EllipticalDrop(FreeSurface):
    """A round drop of radius R with the velocity A₀ (x, −y), without gravity: it becomes an ever longer ellipse."""

    name: ClassVar[str] = "elliptical_drop"
    title: ClassVar[str] = "drop that is stretched into an ellipse"
    inviscid_from: ClassVar[float] = 2000.0
    symbols: ClassVar[Symbols] = Symbols("R", "A₀R", "A₀⁻¹", "A₀", "A₀²R", "ρA₀²R²", "A₀t")
    gravity: ClassVar[bool] = False
    later_names: ClassVar[tuple[str, ...]] = (
        *FreeSurface.later_names,
        "long semi-axis over exact",
        "short semi-axis over exact",
        "pressure at the centre over exact",
        "kinetic energy over its start",
    )

    resolution: int = Field(default=40, ge=8, description="particles per radius, R/Δx [-]")

    @property
    def default_until(self) -> float:
        """When the drop is twice as long as at first."""
        return 0.8

    def domain(self) -> Domain:
        """Return a box that is open on all sides."""
        return Domain([-10, -3], [10, 3], [("air", "air")] * 2)

    @property
    def initial_volume(self) -> float:
        """That of the round drop [R²]."""
        return np.pi

    def particles(self) -> Arrays:
        """Return those particles of a lattice that lie in the circle.

        It is turned to where this flow brings it back onto itself whenever the drop is 2.6 times longer (Kraynik and
        Reinelt, Int. J. Multiphase Flow 18, 1992), so that no particle loses its neighbours; along the axes its columns
        would draw apart for good.
        """
        cells = 4 * self.resolution  # a square that covers the circle however it is turned
        axis = cell_centres(cells, self.particle_spacing) - cells * self.particle_spacing / 2
        x, y = lattice(axis, axis).T
        cosine, sine = np.cos(TURNED), np.sin(TURNED)
        position = np.column_stack([cosine * x - sine * y, sine * x + cosine * y])
        position = position[(position**2).sum(axis=1) < 1]
        return self.fluid(position, position * [1.0, -1.0], (1 - (position**2).sum(axis=1)) / 2)

    def exact(self, time: float) -> tuple[float, float]:
        """Return the long semi-axis a [R] and the strain rate A [A₀]: da/dt = A a, dA/dt = A² (1 − a⁴)/(1 + a⁴)."""
        from scipy.integrate import solve_ivp  # half a second that most commands do without

        def rates(_: float, state: FloatArray) -> list[float]:
            a, rate = state
            return [rate * a, rate**2 * (1 - a**4) / (1 + a**4)]

        a, rate = solve_ivp(rates, (0, time), [1.0, 1.0], rtol=1e-10, atol=1e-12).y[:, -1]
        return float(a), float(rate)

    def measures(self, run: Record) -> list[Measure]:
        """Return semi-axes and pressure at the centre at the last snapshot over the exact ones, and the energy kept."""
        rows = self.energy_measures(run)
        if not len(run.times) or run.times[-1] <= 0:
            return rows
        snapshot = run.snapshot()
        a, rate = self.exact(snapshot.time)
        along, across = 2 * np.sqrt((snapshot.position**2).mean(axis=0))
        middle = (snapshot.position**2).sum(axis=1) < (3 * self.particle_spacing) ** 2
        pressure = snapshot.pressure[middle].mean() * (a**4 + 1) / (rate**2 * a**2)
        energy = run.history["kinetic_energy"]
        source = "exact solution"
        found = [
            Measure("long semi-axis over exact", float(along) / a, 1.0, 0.01, source),
            Measure("short semi-axis over exact", float(across) * a, 1.0, 0.01, source),
            Measure("pressure at the centre over exact", float(pressure), 1.0, 0.05, source),
            Measure("kinetic energy over its start", float(energy[-1] / energy[0]), 1.0, 0.01, source),
        ]
        return self.compared(found) + rows
