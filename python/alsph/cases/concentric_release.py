"""A cylinder that is let go in the middle of another: what it drags along of the fluid is known exactly."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np
from pydantic import Field, model_validator

from alsph.analysis.measures import Measure
from alsph.analysis.record import Record
from alsph.arrays import Arrays, FloatArray
from alsph.cases.base import Case
from alsph.geometry.domain import Domain, SolidBody
from alsph.geometry.particles import Kind, join, particles
from alsph.geometry.rigid import Rigid
from alsph.geometry.solids import cylinder_rings
from alsph.geometry.volume import ring_of_fluid
from alsph.symbols import Symbols

RADIUS = 0.5

COURANT = 0.02
"""Courant number where none is given: pressure that travels as waves is to cross the vessel often in 0.1 √(D/g)."""
SOURCE = "exact, of a fluid without viscosity: (m - ρA) g / (m + C_a ρA), C_a = (b² + a²)/(b² - a²)"


class ConcentricRelease(Case):
    """A free cylinder of diameter D that begins to sink or rise in the fluid at rest in a round vessel around it.

    Velocities are in U = √(gD) and times in √(D/g). Gravity acts on the cylinder alone, less its buoyancy: the
    hydrostatic pressure is left out of p. The fluid answers with the mass that it drags along, C_a = 5/3 times that of
    the fluid displaced where the vessel is twice as wide.
    """

    name: ClassVar[str] = "concentric_release"
    title: ClassVar[str] = "release of a cylinder in a round vessel"
    settles: ClassVar[bool] = False
    inviscid_from: ClassVar[float] = 3000.0
    symbols: ClassVar[Symbols] = Symbols("D", "√(gD)", "√(D/g)", "√(g/D)", "g", "ρgD", "t√(g/D)")

    reynolds: float = Field(default=1e4, gt=0, description="Reynolds number UD/ν [-]")
    resolution: int = Field(default=20, ge=8, description="particles across the cylinder, D/Δx [-]")
    density_ratio: float = Field(default=2.0, gt=0, description="density of the cylinder over that of the fluid [-]")
    courant: float | None = Field(
        default=None,
        gt=0,
        le=1,
        description=f"Courant number u_max Δt/Δx of a step, which the penalty follows; if not given {COURANT:g}, or "
        "none where time_step or penalty_constant are [-]",
    )
    vessel: float = Field(default=2.0, gt=1.3, description="diameter of the vessel [D]")

    @model_validator(mode="before")
    @classmethod
    def _first_instants(cls, values: dict[str, Any]) -> dict[str, Any]:
        given = any(values.get(name) is not None for name in ("courant", "time_step", "penalty_constant"))
        return values if given else values | {"courant": COURANT}

    @property
    def default_until(self) -> float:
        """As long as it takes to fall some hundredths of the gap."""
        return 0.5

    @property
    def coefficient_bodies(self) -> list[str]:
        """Name of the cylinder."""
        return ["cylinder"]

    def domain(self) -> Domain:
        """Return a square around the vessel, which closes it."""
        radius = self.vessel / 2 + 0.1
        return Domain((-radius, -radius), (radius, radius), [("none", "none")] * 2)

    def bodies(self) -> list[SolidBody]:
        """Return the cylinder, which is free, and the vessel."""
        displaced = math.pi * RADIUS**2
        mass = self.density_ratio * displaced
        rigid = Rigid(mass, 0.5 * mass * RADIUS**2, displaced, force=(0, displaced - mass))
        return [SolidBody("cylinder", (0, 0), rigid=rigid), SolidBody("vessel", (0, 0))]

    def fluid_volume(self) -> float:
        """Return the area between cylinder and vessel."""
        return math.pi * ((self.vessel / 2) ** 2 - RADIUS**2)

    def particle_estimate(self) -> int:
        """Return about how many particles there are."""
        hollow = max(0.0, RADIUS * self.resolution - self.support_layers)
        return round(np.pi * ((self.vessel / 2 * self.resolution + self.support_layers) ** 2 - hollow**2))

    def particles(self) -> Arrays:
        """Return evenly spaced fluid at rest between rings of solid particles."""
        spacing, layers = self.particle_spacing, self.support_layers
        inner = cylinder_rings(RADIUS, spacing, layers)
        outer = cylinder_rings(self.vessel / 2, spacing, layers, side=-1)
        solid = np.concatenate([inner.position, outer.position])
        fluid = ring_of_fluid(RADIUS, self.vessel / 2, self.resolution, solid)
        return join(particles(Kind.FLUID, fluid, 0.0), inner.particles(), outer.particles(body=1))

    def solid_height(self, position: FloatArray) -> FloatArray:
        """Return how far points (n, 2) lie between cylinder and vessel at the start [D]."""
        radius = np.hypot(*position.T)
        return np.asarray(np.minimum(radius - RADIUS, self.vessel / 2 - radius))

    @property
    def added_mass_coefficient(self) -> float:
        """Mass that the cylinder drags along at its centre over that of the fluid displaced [-]."""
        outer, inner = (self.vessel / 2) ** 2, RADIUS**2
        return (outer + inner) / (outer - inner)

    @property
    def acceleration(self) -> float:
        """That of the cylinder at the start, in a fluid without viscosity, upwards [g]."""
        return (1 - self.density_ratio) / (self.density_ratio + self.added_mass_coefficient)

    def measures(self, run: Record) -> list[Measure]:
        """Return the mean acceleration over the first tenth of √(D/g), in which the cylinder moves but little."""
        time, velocity = run.history["time"], run.history.get("cylinder_velocity_y", np.empty(0))
        name = "acceleration over the first 0.1 √(D/g), g"
        if not len(velocity) or time[-1] < 0.1:
            return [Measure(name, math.nan)]
        found = float(np.interp(0.1, time, velocity) / 0.1)
        return self.compared([Measure(name, found, self.acceleration, 0.03, SOURCE)])
