"""Water in a tank that sways."""

from __future__ import annotations

from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from alsph import reference
from alsph.analysis.measures import Measure, Profile
from alsph.analysis.record import Record
from alsph.arrays import FloatArray
from alsph.cases.free_surface import FreeSurface, Levels
from alsph.engine.output import Output
from alsph.errors import ConfigError
from alsph.geometry.domain import Domain
from alsph.geometry.lattice import cell_centres, lattice

LINEAR = 0.005
"""Amplitude of the sway [H] up to which linear theory is the reference: it leaves out what is of its square."""

MODES = np.arange(1, 400, 2)
"""Numbers of the modes of linear theory; those that are even are not driven."""

FALTINSEN = {"length": 2.883, "amplitude": 0.05333, "frequency": 1.1953, "phase": 0.0, "gauge": 0.0833}
"""The experiment of Faltinsen, Rognebakke, Lukovsky and Timokha (J. Fluid Mech. 407 (2000) 201, figure 7): a tank of
1.73 m with 0.6 m of water, swayed by 0.032 m every 1.3 s, and a gauge 0.05 m from its left wall."""

CRESTS = {10.4: 0.142 / 0.6, 16.3: 0.109 / 0.6}
"""Crests there [H], of the second and the third wave, at about these times [√(H/g)]."""


class Sloshing(FreeSurface):
    """Water of depth H in a tank with slip walls that sways along x, seen from the tank.

    By default it is the experiment of Faltinsen et al. (2000). With an amplitude of up to 0.005 H the reference is
    linear theory.
    """

    name: ClassVar[str] = "sloshing"
    title: ClassVar[str] = "sloshing in a tank that sways"
    later_names: ClassVar[tuple[str, ...]] = (
        "crest near t = ",
        "largest error of the elevation over the largest",
        "elevation at the gauge",
    )

    length: float = Field(default=2.883, gt=0, description="length of the tank [H]")
    tank_height: float = Field(default=2.5, gt=1, description="height above which spray is lost [H]")
    amplitude: float = Field(default=0.05333, gt=0, description="amplitude A of the sway [H]")
    frequency: float = Field(default=1.1953, gt=0, description="angular frequency ω of the sway [√(g/H)]")
    phase: float = Field(
        default=0.0,
        description="phase φ of the tank, which is at A cos(ωt − φ) [degrees]",
    )
    gauge: float = Field(default=0.0833, ge=0, description="distance of the gauge from the left wall [H]")

    @model_validator(mode="after")
    def _the_gauge_is_in_the_tank(self) -> Self:
        if self.gauge > self.length:
            raise ConfigError(f"gauge = {self.gauge:g}: outside of the tank; its length is {self.length:g}")
        return self

    @property
    def default_until(self) -> float:
        """Five periods."""
        return 5 * 2 * np.pi / self.frequency

    def domain(self) -> Domain:
        """Return the tank, whose top is open."""
        return Domain([0, 0], [self._whole_length, self.tank_height], [("slip", "slip"), ("slip", "air")])

    @property
    def _columns(self) -> int:
        return round(self.length * self.resolution)

    @property
    def _whole_length(self) -> float:
        """The length, to a whole number of particles."""
        return self._columns / self.resolution

    @property
    def initial_volume(self) -> float:
        """That of the water [H²]."""
        return self._whole_length

    def particles(self) -> dict[str, NDArray[Any]]:
        """Return a lattice at rest with the hydrostatic pressure."""
        spacing = self.particle_spacing
        position = lattice(cell_centres(self._columns, spacing), cell_centres(self.resolution, spacing))
        return self.fluid(position, np.zeros_like(position), 1 - position[:, 1])

    def forcing(self, position: FloatArray, time: float) -> ArrayLike | None:
        """Return minus the acceleration of the tank."""
        return [self._size * np.cos(self.frequency * time - np.radians(self.phase)), 0.0]

    @property
    def _size(self) -> float:
        return self.amplitude * self.frequency**2

    def outputs(self) -> list[Output]:
        """Return the record of the level at the gauge."""
        return [Levels([self.gauge], self._whole_length, self.particle_spacing)]

    def linear_level(self, time: FloatArray, x: float) -> FloatArray:
        """Return the elevation (n,) at times (n,) and a place, of linear theory [H].

        Every mode cos kx is an oscillator of ω² = gk tanh kH that the tilted level of rest, x − L/2 in modes, drives.
        """
        wave = np.pi * MODES / self._whole_length
        own, drive = np.sqrt(wave * np.tanh(wave)), self.frequency
        share = -4 / (self._whole_length * wave**2) * own**2 * self._size / (own**2 - drive**2)
        phase, time = np.radians(self.phase), np.asarray(time)[:, None]
        forced = np.cos(drive * time - phase)
        free = np.cos(phase) * np.cos(own * time) + drive / own * np.sin(phase) * np.sin(own * time)
        return np.asarray(((forced - free) * share) @ np.cos(wave * x))

    def measures(self, run: Record) -> list[Measure]:
        """Return the elevation at the gauge beside linear theory, or the crests of the experiment."""
        time, level = Levels.read(run)
        if len(time) < 2:
            return []
        if self.amplitude <= LINEAR:
            exact = self.linear_level(time, self.gauge)
            error = np.abs(level[0] - 1 - exact).max() / np.abs(exact).max()
            return [
                Measure("largest error of the elevation over the largest", float(error), 0.0, 0.03, "linear theory")
            ]
        return [
            Measure(
                f"crest near t = {at:g}, H",
                float((level[0] - 1)[np.abs(time - at) < 1].max()),
                height,
                0.1,
                "experiment (Faltinsen et al. 2000)",
            )
            for at, height in CRESTS.items()
            if self._is_the_experiment and time[-1] > at + 1
        ]

    @property
    def _is_the_experiment(self) -> bool:
        return all(getattr(self, name) == value for name, value in FALTINSEN.items())

    def profiles(self, run: Record) -> list[Profile]:
        """Return the elevation at the gauge over time."""
        time, level = Levels.read(run)
        if not len(time):
            return []
        known, source = (np.empty(0), np.empty(0)), ""
        if self.amplitude <= LINEAR:
            known, source = (time, self.linear_level(time, self.gauge)), "linear theory"
        elif self._is_the_experiment:
            known = tuple(reference.table("sloshing_faltinsen.csv"))
            source = "experiment (Faltinsen et al. 2000)"
        axes = ("$t\\sqrt{g/H}$", "elevation over $H$")
        return [Profile("elevation at the gauge", axes, (time, level[0] - 1), known, source)]
