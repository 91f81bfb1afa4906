"""A column of water that is let go in a tank."""

from __future__ import annotations

from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from alsph import reference
from alsph.analysis.measures import Measure, Profile
from alsph.analysis.record import Record
from alsph.arrays import FloatArray
from alsph.cases.free_surface import FreeSurface
from alsph.errors import ConfigError
from alsph.geometry.domain import Boundary, Domain
from alsph.geometry.lattice import cell_centres, lattice

FRONT = {1.0: 2.947, 2.0: 4.665}
"""Front [H] at times [√(H/g)] of a column 2H long: WCSPH with 400 particles over H, the authors' own
(TrixiParticles.jl, the dam break of its validation)."""

FRONT_SPEED = {1.0: 1.49, 2.0: 1.86}
"""Its speed there [√(gH)], for outputs that are not just then."""

TERMS = np.arange(1, 200, 2)
"""Numbers of the terms of the Fourier series."""


class DamBreak(FreeSurface):
    """A column of water H high that is let go in a tank with slip walls (Lobovský et al. 2014: 2H long, 5.366H)."""

    name: ClassVar[str] = "dam_break"
    title: ClassVar[str] = "dam break in a tank"
    later_names: ClassVar[tuple[str, ...]] = (*FreeSurface.later_names, "front at t = ")
    velocity_max: ClassVar[float] = 2.0

    length: float = Field(default=2.0, gt=0, description="length of the column [H]")
    tank_length: float = Field(default=5.366, gt=0, description="length of the tank [H]")
    tank_height: float = Field(default=3.0, gt=1, description="height above which spray is lost [H]")
    dimensions: Literal[2, 3] = Field(default=2, description="number of space dimensions")
    width: float = Field(default=0.5, gt=0, description="width of column and tank in 3-D [H]")
    packing_relaxation: float = Field(
        default=0.05, ge=0, le=1, description="share of a number density above the lattice's that a step takes off [-]"
    )

    @model_validator(mode="after")
    def _the_tank_holds_the_column(self) -> Self:
        if self.length >= self.tank_length:
            raise ConfigError(f"length = {self.length:g}: does not fit into a tank_length of {self.tank_length:g}")
        self.whole_cells("length", self.length)
        if self.dimensions == 3:
            self.whole_cells("width", self.width)
        return self

    @property
    def default_until(self) -> float:
        """Until the front is near the far wall."""
        return 2.0

    @property
    def space_dimensions(self) -> int:
        """2 or 3, as the parameter `dimensions` says."""
        return self.dimensions

    def domain(self) -> Domain:
        """Return the tank, whose top is open."""
        across = [self.width] if self.dimensions == 3 else []
        lengths = [self.tank_length, *across, self.tank_height]
        sides: list[tuple[Boundary, Boundary]] = [("slip", "slip")] * len(lengths)
        sides[-1] = ("slip", "air")
        return Domain([0] * len(lengths), lengths, sides)

    @property
    def middle(self) -> FloatArray:
        """Point that slices for pictures go through in 3-D [H]: in the water, as long as there is some."""
        return np.array([self.tank_length / 2, self.width / 2, 0.05])

    @property
    def initial_volume(self) -> float:
        """That of the column [H^d]."""
        return self.length * (self.width if self.dimensions == 3 else 1.0)

    def particles(self) -> dict[str, NDArray[Any]]:
        """Return the column at rest, with the pressure of its first instant."""
        cells = [self.whole_cells("length", self.length), self.resolution]
        if self.dimensions == 3:
            cells.insert(1, self.whole_cells("width", self.width))
        position = lattice(*(cell_centres(count, self.particle_spacing) for count in cells))
        return self.fluid(position, np.zeros_like(position), self.first_pressure(position))

    def first_pressure(self, position: FloatArray) -> FloatArray:
        """Return the pressure (n,) of an inviscid column just let go [ρgH]: ∇²p = 0, 0 at its top and its free side.

        That is 1 − y less what the free side takes off, a Fourier series.
        """
        x, y = position[:, 0], position[:, -1]
        wave, end = np.pi * TERMS[:, None] / 2, self.length
        along = (np.exp(wave * (x - end)) + np.exp(-wave * (x + end))) / (1 + np.exp(-2 * wave * end))
        return np.asarray(1 - y - (2 / wave**2 * np.cos(wave * y) * along).sum(axis=0))

    def front(self, position: FloatArray) -> float:
        """Return how far the water has come [H]: half a spacing before its third foremost particle, or to the wall."""
        return min(float(np.sort(position[:, 0])[-3:][0] + self.particle_spacing / 2), self.tank_length)

    def measures(self, run: Record) -> list[Measure]:
        """Return the front beside an inviscid computation, before it meets the wall, and what energy was made."""
        rows = [self._front_at(run, at) for at in FRONT] if self._is_compared else []
        return [row for row in rows if row] + self.energy_measures(run)

    @property
    def _is_compared(self) -> bool:
        return (self.length, self.tank_length) == (2.0, 5.366)

    def _front_at(self, run: Record, at: float) -> Measure | None:
        near = [time for time in run.times if abs(time - at) < 0.05]
        if not near:
            return None
        front = self.front(run.snapshot(near[0]).position) - FRONT_SPEED[at] * (near[0] - at)
        return Measure(f"front at t = {at:g}, H", front, FRONT[at], 0.05, "inviscid SPH, H/Δx = 400 (TrixiParticles)")

    def profiles(self, run: Record) -> list[Profile]:
        """Return the front over time."""
        times = np.asarray(run.times)
        fronts = np.array([self.front(run.snapshot(time).position) for time in times])
        known = tuple(reference.table("dam_break_front.csv")) if self._is_compared else (np.empty(0), np.empty(0))
        axes = ("$t\\sqrt{g/H}$", "front $x/H$")
        return [Profile("front", axes, (times, fronts), known, "TrixiParticles, H/Δx = 400")]
