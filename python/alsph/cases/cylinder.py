"""Flow past a circular cylinder in a channel with free-slip walls: the problem of Kolukisa et al. (2021)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator, model_validator

from alsph import reference
from alsph.cases.base import Case
from alsph.geometry import FloatArray, Kind, cell_centres, cylinder_rings, join, lattice, particles, symmetric_centres
from alsph.measures import Measure, Profile
from alsph.reference import Reference

if TYPE_CHECKING:
    from alsph.results import Run

RADIUS = 0.5
FAR = {"height": 60.0, "upstream": 15.0}
"""Dimensions [D] from which on the sides no longer act on the cylinder."""


class Cylinder(Case):
    """Flow past a circular cylinder of diameter D in a channel with free-slip walls and uniform inflow U.

    The defaults are the channel of Kolukisa, Ozbulut and Yildiz (Symmetry 2021, 13, 472). The inlet lies at x = 0 and
    the centre line at y = 0; lengths are in D, velocities in U.
    """

    name: ClassVar[str] = "cylinder"
    title: ClassVar[str] = "flow past a circular cylinder in a channel"
    default_until: ClassVar[float] = 60.0
    velocity_max: ClassVar[float] = 1.5
    coefficient_body: ClassVar[str | None] = "cylinder"

    reynolds: float = Field(default=200.0, gt=0, description="Reynolds number UD/ν [-]")
    resolution: int = Field(default=20, gt=0, description="particles per diameter, D/Δx; at least 8 [-]")
    length: float = Field(default=14.0, gt=0, description="length of the channel [D]")
    height: float = Field(default=13.0, gt=0, description="height of the channel [D]")
    upstream: float = Field(default=4.0, gt=0, description="distance from the inlet to the centre of the cylinder [D]")
    perturbation: float = Field(
        default=0.1,
        ge=0,
        le=1,
        description="largest velocity of an initial vortex about the cylinder that starts shedding; 0: symmetric [U]",
    )

    @field_validator("resolution")
    @classmethod
    def _resolved(cls, resolution: int) -> int:
        if resolution < 8:
            raise ValueError("too coarse for the body; use 8 or more")
        return resolution

    @model_validator(mode="after")
    def _fits(self) -> Cylinder:
        for name, room in (
            ("height", self.height / 2),
            ("upstream", self.upstream),
            ("length", self.length - self.upstream),
        ):
            if room < 1:
                raise ValueError(
                    f"{name} = {getattr(self, name):g}: the cylinder does not fit; leave at least 1 D from centre to "
                    f"each side (length {self.length:g}, height {self.height:g}, upstream {self.upstream:g})"
                )
        self.whole_cells("length", self.length)
        self.whole_cells("height", self.height)
        return self

    @property
    def space_dimensions(self) -> int:
        """Always 2."""
        return 2

    def domain(self) -> dict[str, Any]:
        """Return the channel: inlet at x = 0, outlet at x = length, free-slip walls at y = ± height/2."""
        return {
            "lower": [0.0, -self.height / 2],
            "upper": [self.length, self.height / 2],
            "boundaries": [["inlet", "outlet"], ["slip", "slip"]],
        }

    def bodies(self) -> list[dict[str, Any]]:
        """Return the cylinder."""
        return [{"name": "cylinder", "velocity": [0.0, 0.0], "moves": False, "center": [self.upstream, 0.0]}]

    @property
    def buffer_columns(self) -> int:
        """Length of the inlet and outlet buffers, 6h, in particle spacings."""
        return int(np.ceil(6 * self.smoothing_ratio - 1e-9))

    def particle_estimate(self) -> int:
        """Return about how many particles there are, solid and buffers included."""
        return round((self.length * self.resolution + 2 * self.buffer_columns) * self.height * self.resolution)

    def particles(self) -> dict[str, NDArray[Any]]:
        """Return a uniform lattice around rings of solid particles, impulsively started."""
        spacing, centre = self.particle_spacing, np.array([self.upstream, 0.0])
        rows = symmetric_centres(self.whole_cells("height", self.height), spacing)
        buffer = cell_centres(self.buffer_columns, spacing)
        channel = lattice(cell_centres(self.whole_cells("length", self.length), spacing), rows)
        fluid = channel[np.hypot(*(channel - centre).T) >= RADIUS]
        rings = cylinder_rings(RADIUS, spacing, self.support_layers)
        return join(
            particles(Kind.FLUID, fluid, self._initial_velocity(fluid)),
            particles(Kind.INLET, lattice(-buffer, rows), [1.0, 0.0]),
            particles(Kind.OUTLET, lattice(self.length + buffer, rows), [1.0, 0.0]),
            particles(Kind.SOLID, centre + rings.position, [0.0, 0.0], normal=rings.normal, depth=rings.depth),
        )

    def _initial_velocity(self, position: FloatArray) -> FloatArray:
        """Uniform flow and a Gaussian vortex (divergence-free) about the cylinder, fastest just off its surface."""
        x, y = ((position - [self.upstream, 0.0]) / (1.2 * RADIUS)).T
        swirl = self.perturbation * np.exp(0.5 * (1 - x**2 - y**2))
        return np.stack([1.0 - swirl * y, swirl * x], axis=1)

    def surface_points(self) -> tuple[FloatArray, FloatArray]:
        """Return 72 points on the cylinder, every 5 degrees from the front stagnation point over the upper side."""
        angle = np.arange(0.0, 360.0, 5.0)
        radians = np.radians(angle)
        return angle, np.array([self.upstream, 0.0]) + RADIUS * np.stack([-np.cos(radians), np.sin(radians)], axis=1)

    def fluid_volume(self) -> float:
        """Return the area of the channel without the cylinder."""
        return self.length * self.height - math.pi * RADIUS**2

    def measures(self, run: Run) -> list[Measure]:
        """Return forces and Strouhal number, and the error of the pressure coefficient where its curve is known."""
        known = self._reference() or Reference({}, "")
        computed = {
            "mean drag coefficient": (run.drag.mean, 0.02),
            "mean drag coefficient, pressure part": (run.drag.pressure, 0.03),
            "mean drag coefficient, viscous part": (run.drag.viscous, 0.03),
            "rms lift coefficient": (run.lift.rms, 0.05),
            "lift coefficient amplitude": (run.lift.amplitude, 0.05),
            "Strouhal number": (run.strouhal, 0.01),
        }
        measures = [
            Measure(name, value, known.results.get(name, math.nan), tolerance, known.source)
            for name, (value, tolerance) in computed.items()
        ]
        for profile in self.profiles(run):
            (angle, mean), expected = profile.computed, np.interp(profile.computed[0], *profile.reference)
            error = np.abs(mean - expected)[angle > 10].max()
            name = "largest error of the pressure coefficient beyond 10 degrees"
            measures.append(Measure(name, float(error), 0.0, 0.05, profile.source))
        return measures

    def profiles(self, run: Run) -> list[Profile]:
        """Return the mean pressure coefficient over the angle, the mean of both sides, where its curve is known."""
        known, found = self._reference(), run.pressure_coefficient
        if known is None or known.pressure_coefficient is None or not found.theta.size:
            return []
        upper = found.theta <= 180
        lower = np.interp(360 - found.theta[upper], found.theta, found.mean, period=360)
        computed = found.theta[upper], (found.mean[upper] + lower) / 2
        axes = r"$\theta$ from the front stagnation point [degrees]", "$C_p$"
        return [Profile("pressure coefficient", axes, computed, known.pressure_coefficient, known.source)]

    def _reference(self) -> Reference | None:
        """Return the independent solution of this flow, None where there is none."""
        if (self.length, self.height, self.upstream) == (14.0, 13.0, 4.0):
            return reference.cylinder_in_channel(self.reynolds)
        if all(getattr(self, name) >= least for name, least in FAR.items()):
            return reference.unconfined_cylinder(self.reynolds)
        return None
