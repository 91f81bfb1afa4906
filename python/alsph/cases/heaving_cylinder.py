"""A cylinder that floats, let go above its draught."""

from __future__ import annotations

import math
from functools import cached_property
from typing import ClassVar, Self

import numpy as np
import shapely
from pydantic import Field, model_validator

from alsph.analysis.measures import Measure, Profile
from alsph.analysis.record import Record
from alsph.arrays import Arrays, FloatArray
from alsph.cases.free_surface import FreeSurface
from alsph.cases.heave import SOURCE, linear_heave
from alsph.errors import ConfigError
from alsph.geometry.domain import Domain, SolidBody
from alsph.geometry.lattice import cell_centres, lattice
from alsph.geometry.packing import Immersed, pack
from alsph.geometry.particles import join
from alsph.geometry.rigid import Rigid
from alsph.geometry.solids import Solid, body_layers
from alsph.symbols import Symbols

MASS = math.pi / 2
"""Of the cylinder, half as dense as water [ρR²]."""

ELEMENTS = 32
"""Boundary elements along a quarter of its circle: twice as many change the motion by 1e-4."""

SECTION = tuple((-1j * np.exp(1j * np.linspace(0, math.pi / 2, ELEMENTS + 1))).tolist())
"""Ends of these [R]."""

FIRST, SECOND = 4.0, 8.0
"""Times after the first trough, and after the second crest [√(R/g)]."""


class HeavingCylinder(FreeSurface):
    """A cylinder half as dense as water that is let go above its draught, in a tank with slip walls.

    It heaves, and sends waves away, which take its energy. Free to move up and down. Lengths are in the cylinder's
    radius R, velocities in √(gR).
    """

    name: ClassVar[str] = "heaving_cylinder"
    title: ClassVar[str] = "cylinder that heaves"
    symbols: ClassVar[Symbols] = Symbols("R", "√(gR)", "√(R/g)", "√(g/R)", "g", "ρgR", "t√(g/R)")
    later_names: ClassVar[tuple[str, ...]] = (
        "first trough over the lift",
        "second crest over the lift",
        "largest difference over the lift",
        "heave",
    )

    resolution: int = Field(default=20, ge=6, description="particles per radius, R/Δx [-]")
    lift: float = Field(default=0.2, gt=0, lt=1, description="height above its draught that it is let go at [R]")
    depth: float = Field(default=4.0, gt=2, description="depth of the water [R]")
    tank_length: float = Field(default=24.0, gt=4, description="length of the tank [R]")

    @model_validator(mode="after")
    def _stands_on_whole_cells(self) -> Self:
        for name in ("depth", "tank_length"):
            self.whole_cells(name, getattr(self, name))
        if self.depth < 1 - self.lift + self.support_layers * self.particle_spacing:
            raise ConfigError(f"depth = {self.depth:g}: the cylinder would stand on the floor")
        return self

    @property
    def default_until(self) -> float:
        """Two periods."""
        return 12.0

    @property
    def reference_velocity(self) -> float:
        """That of long waves."""
        return math.sqrt(self.depth)

    @property
    def coefficient_bodies(self) -> list[str]:
        """Name of the cylinder."""
        return ["cylinder"]

    def domain(self) -> Domain:
        """Return the tank, whose top is open; the undisturbed level is y = 0."""
        half = self.tank_length / 2
        return Domain((-half, -self.depth), (half, 2.0), [("slip", "slip"), ("slip", "air")])

    def bodies(self) -> list[SolidBody]:
        """Return the cylinder."""
        rigid = Rigid(MASS, MASS / 2, displaced=MASS, free=(False, True, False))
        return [SolidBody("cylinder", (0, self.lift), rigid=rigid)]

    @property
    def _shape(self) -> shapely.Polygon:
        return shapely.Point(0, self.lift).buffer(1.0, quad_segs=16 * self.resolution)

    @cached_property
    def _solid(self) -> Solid:
        return body_layers(self._shape, self.particle_spacing, self.support_layers)

    @property
    def initial_volume(self) -> float:
        """That of the water [R²]."""
        angle = math.acos(self.lift)
        return self.tank_length * self.depth - angle + self.lift * math.sin(angle)

    def particle_estimate(self) -> int:
        """Return about how many particles there are, with those of the cylinder."""
        return super().particle_estimate() + len(self._solid.position)

    def particles(self) -> Arrays:
        """Return water at rest around the cylinder."""
        columns = self.whole_cells("tank_length", self.tank_length)
        rows = self.whole_cells("depth", self.depth)
        spacing, solid = self.particle_spacing, self._solid
        cells = lattice(cell_centres(columns, spacing) - self.tank_length / 2, cell_centres(rows, spacing) - self.depth)
        cylinder = Immersed(self._shape, self.tank_length * self.depth - self.initial_volume)
        position = pack(cells, cylinder, solid.position, spacing)
        return join(self.fluid(position, np.zeros_like(position), -position[:, 1]), solid.particles())

    def solid_height(self, position: FloatArray) -> FloatArray:
        """Return how far points (n, 2) lie outside of the cylinder where it begins [R]."""
        return np.asarray(np.hypot(*(position - [0, self.lift]).T) - 1.0)

    def linear_heave(self, until: float) -> tuple[FloatArray, FloatArray]:
        """Return times [√(R/g)] and heights over the draught over the lift, of linear theory."""
        return linear_heave(until, SECTION, MASS, self.depth, self.tank_length)

    def _heave(self, run: Record) -> tuple[FloatArray, FloatArray]:
        """Return times, and heights over the draught over the lift."""
        if "cylinder_displacement_y" not in run.history:
            return np.empty(0), np.empty(0)
        return run.history["time"], 1 + run.history["cylinder_displacement_y"] / self.lift

    def measures(self, run: Record) -> list[Measure]:
        """Return the first trough, the second crest and the largest difference, beside linear theory."""
        time, height = self._heave(run)
        if not len(time) or time[-1] < SECOND:
            return []
        times, linear = self.linear_heave(time[-1])
        difference = np.abs(height - np.interp(time, times, linear)).max()
        return [
            Measure(
                "first trough over the lift", height[time < SECOND].min(), linear[times < SECOND].min(), 0.1, SOURCE
            ),
            Measure("second crest over the lift", height[time > FIRST].max(), linear[times > FIRST].max(), 0.1, SOURCE),
            Measure("largest difference over the lift", float(difference), 0.0, 0.05, SOURCE),
        ]

    def profiles(self, run: Record) -> list[Profile]:
        """Return the height over time beside linear theory."""
        time, height = self._heave(run)
        if not len(time) or time[-1] <= 0:
            return []
        axes = ("$t\\sqrt{g/R}$", "height of the cylinder over its draught, over the lift")
        return [
            Profile(
                "heave",
                axes,
                (time, height),
                linear_heave(time[-1], SECTION, MASS, self.depth, self.tank_length),
                SOURCE,
            )
        ]
