"""A sphere that sinks or rises in a fluid at rest."""

from __future__ import annotations

import math
from functools import cached_property
from typing import ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from alsph import reference
from alsph.analysis.measures import Measure, Profile
from alsph.analysis.record import Record
from alsph.arrays import Arrays, FloatArray
from alsph.cases.base import Case
from alsph.errors import ConfigError
from alsph.geometry.domain import Domain, SolidBody
from alsph.geometry.lattice import cell_centres, lattice, symmetric_centres
from alsph.geometry.packing import pack
from alsph.geometry.particles import Kind, join, particles
from alsph.geometry.rigid import Rigid
from alsph.geometry.volume import Volume, sphere

RADIUS = 0.5
END = 2.0
"""Distance of the sphere's centre from the end of the column that it begins at, and about where a run ends [D]."""

WIDE = 6.0
"""Width of a column whose sides raise the drag by some 1 % [D]."""

START = 6.0
"""Way in which it comes to its velocity [D]."""

DRAG = "C_D at the settling velocity"
"""Formed with this velocity and πD²/4, not with U: no force follows from it by ½ρU²A."""


class SettlingSphere(Case):
    """A free sphere of diameter D that settles from rest in a column with free-slip walls.

    U = √(|s - 1| gD) with the density ratio s of sphere and fluid, so that UD/ν is the Galileo number. The weight less
    the buoyancy acts on the sphere; the hydrostatic pressure is left out of p. A quarter of the column is computed, in
    which the flow is symmetric up to a Reynolds number of the sphere of about 210. At the settling velocity V the drag
    is the weight, C_D V² = 4/3; no coefficients are formed with U.
    """

    name: ClassVar[str] = "settling_sphere"
    title: ClassVar[str] = "a sphere that settles in a column"
    in_space: ClassVar[int] = 3
    settles: ClassVar[bool] = False
    picture_axis: ClassVar[str] = "y"
    velocity_max: ClassVar[float] = 1.5
    later_names: ClassVar[tuple[str, ...]] = (
        "settling velocity over the last two diameters, U",
        "Reynolds number of the sphere",
        DRAG,
        "velocity of the sphere",
    )

    reynolds: float = Field(default=90.8, gt=0, description="Galileo number UD/ν, U = √(|s - 1| gD) [-]")
    resolution: int = Field(default=10, ge=8, description="particles per diameter, D/Δx [-]")
    density_ratio: float = Field(default=2.0, gt=0, description="density of the sphere over that of the fluid, s [-]")
    height: float = Field(default=14.0, gt=5, description="height of the column [D]")
    width: float = Field(default=6.0, gt=2, description="width of the column [D]")

    @model_validator(mode="after")
    def _settles(self) -> Self:
        if self.density_ratio == 1:
            raise ConfigError("density_ratio = 1: the sphere neither sinks nor rises")
        return self

    @property
    def default_until(self) -> float:
        """Until it is near the other end, if its velocity is about U and it takes 2 D/U to get there."""
        return self.height - 2 * END + 2

    @property
    def sinks(self) -> bool:
        """Whether the sphere is heavier than the fluid."""
        return self.density_ratio > 1

    @property
    def reference_area(self) -> float:
        """Frontal area of the quarter [D²]."""
        return self.computed_share * math.pi * RADIUS**2

    @property
    def middle(self) -> FloatArray:
        """Point that slices for pictures go through [D]: the centre of the sphere at the start."""
        return self.centre

    @property
    def computed_share(self) -> float:
        """Share of the sphere that is computed."""
        return 0.25

    @property
    def planes_of_symmetry(self) -> tuple[int, ...]:
        """Axes x and y."""
        return (0, 1)

    @property
    def centre(self) -> FloatArray:
        """Centre of the sphere at the start (3,) [D]."""
        return np.array([0.0, 0.0, self.height - END if self.sinks else END])

    def domain(self) -> Domain:
        """Return a quarter of the column."""
        half = self.width / 2
        return Domain((0, 0, 0), (half, half, self.height), [("slip", "slip")] * 3)

    def bodies(self) -> list[SolidBody]:
        """Return the quarter of the sphere, which moves up and down alone."""
        displaced = self.computed_share * math.pi / 6
        mass = self.density_ratio * displaced
        rigid = Rigid(
            mass,
            0.4 * mass * RADIUS**2 * np.eye(3),
            displaced,
            force=(0, 0, -displaced if self.sinks else displaced),
            free=(False, False, True, False, False, False),
            added_mass=0.6 * displaced,
        )
        return [SolidBody("sphere", tuple(self.centre), rigid=rigid)]

    @cached_property
    def _volume(self) -> Volume:
        return sphere(RADIUS)

    def fluid_volume(self) -> float:
        """Return the volume of the quarter of the column without the sphere."""
        return self.width**2 / 4 * self.height - math.pi / 24

    def particles(self) -> Arrays:
        """Return a lattice at rest around the sphere."""
        spacing = self.particle_spacing
        across = symmetric_centres(2 * self.whole_cells("width / 2", self.width / 2), spacing)
        along = cell_centres(self.whole_cells("height", self.height), spacing)
        solid = self._volume.solid(spacing, self.support_layers)
        fluid = pack(lattice(across, across, along) - self.centre, self._volume, solid.position, spacing) + self.centre
        found = join(particles(Kind.FLUID, fluid, np.zeros(3)), solid.moved(self.centre).particles(np.zeros(3)))
        kept = (found["position"][:, :2] > 0).all(axis=1)
        return {name: values[kept] for name, values in found.items()}

    def solid_height(self, position: FloatArray) -> FloatArray:
        """Return how far points (n, 3) lie outside of the sphere where it begins [D]."""
        return np.asarray(np.linalg.norm(position - self.centre, axis=1) - RADIUS)

    @property
    def no_reference(self) -> str:
        """Say that the column is too narrow."""
        if self.width >= WIDE:
            return ""
        return f"it is of a sphere far from all walls, and holds within 2 % in columns {WIDE:g} D wide or more"

    def measures(self, run: Record) -> list[Measure]:
        """Return the settling velocity over the last two diameters, and C_D there."""
        way, speed = (np.abs(run.history.get(f"sphere_{name}_z", np.empty(0))) for name in ("displacement", "velocity"))
        if not len(way) or way[-1] < START:
            return []
        late = way > way[-1] - 2
        velocity = float(np.average(speed[late], weights=run.history["time_step"][late]))
        drag, own = 4 / 3 / velocity**2, velocity * self.reynolds
        known = reference.table("sphere_drag.csv")
        expected = float(np.interp(own, *known)) if known[0][0] <= own <= known[0][-1] else math.nan
        found = [
            Measure("settling velocity over the last two diameters, U", velocity),
            Measure("Reynolds number of the sphere", own),
            Measure(DRAG, drag, expected, 0.05, "Johnson and Patel (1999), a sphere far from all walls"),
        ]
        return self.compared(found)

    def profiles(self, run: Record) -> list[Profile]:
        """Return the velocity over time."""
        if "sphere_velocity_z" not in run.history:
            return []
        none = np.empty(0), np.empty(0)
        axes = ("$tU/D$", "$V/U$")
        return [
            Profile("velocity of the sphere", axes, (run.history["time"], run.history["sphere_velocity_z"]), none, "")
        ]
