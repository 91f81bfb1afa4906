"""A column of water that is let go in a tank with a box on its floor."""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from alsph import reference
from alsph.analysis.measures import Measure, Profile
from alsph.analysis.record import Record
from alsph.arrays import FloatArray
from alsph.cases.dam_break import column_pressure
from alsph.cases.free_surface import FreeSurface
from alsph.cases.sensors import WallSensors
from alsph.engine.output import Output
from alsph.geometry.domain import Domain, SolidBody
from alsph.geometry.lattice import cell_centres, lattice
from alsph.geometry.particles import join
from alsph.geometry.solids import Solid

DEPTH = 0.55
"""H of the experiment [m]."""

TANK = np.array([3.22, 0.5, 1.5]) / DEPTH
"""Half of the tank up to its plane of symmetry, as high as spray may go [H]."""

COLUMN = 1.228 / DEPTH
"""Length of the column [H]."""

BOX = np.array([[2.3955, 0.0, 0.0], [2.5565, 0.2015, 0.161]]) / DEPTH
"""Corners of half of the box [H]."""

SENSORS = {"P1": 0.021 / DEPTH, "P3": 0.101 / DEPTH}
"""Heights of the sensors in the face of the box that the water meets, 0.053 H beside its middle [H]."""

PLACE = 0.029 / DEPTH

SOURCE = "experiment, Kleefsman et al. (2005)"

WINDOWS = ((1.6, 3.0), (3.0, 5.0))
"""Times that pressures are averaged between [√(H/g)]."""


def mean_name(sensor: str, window: tuple[float, float]) -> str:
    """Return the name of the measure of the mean pressure at a sensor."""
    return f"pressure at {sensor}, mean over t = {window[0]:g} to {window[1]:g}, ρgH"


class DamBreakObstacle(FreeSurface):
    """A column of water H high that is let go in a tank with a box on its floor (Kleefsman et al. 2005), 3-D.

    The half up to the plane of symmetry is computed; walls are slip walls, the box is of solid particles. All lengths
    are taken to whole spacings.
    """

    name: ClassVar[str] = "dam_break_obstacle"
    title: ClassVar[str] = "dam break against a box"
    in_space: ClassVar[int] = 3
    velocity_max: ClassVar[float] = 2.5
    splashes: ClassVar[bool] = True
    later_names: ClassVar[tuple[str, ...]] = (
        *FreeSurface.later_names,
        *(f"time of arrival at {name}, √(H/g)" for name in SENSORS),
        *(mean_name(name, window) for name in SENSORS for window in WINDOWS),
        *(f"pressure at {name}" for name in SENSORS),
    )

    resolution: int = Field(default=20, ge=8, description="particles over the depth of the water, H/Δx [-]")

    @property
    def default_until(self) -> float:
        """Until the water has fallen back from the box."""
        return 6.0

    @property
    def middle(self) -> FloatArray:
        """Point that slices for pictures go through [H]: beside the plane of symmetry."""
        return np.array([TANK[0] / 2, PLACE, 0.05])

    def _whole(self, lengths: FloatArray) -> FloatArray:
        return np.asarray(np.round(lengths * self.resolution) / self.resolution)

    @property
    def box(self) -> FloatArray:
        """Corners (2, 3) of half of the box [H]."""
        return self._whole(BOX)

    def domain(self) -> Domain:
        """Return half of the tank, whose top is open."""
        return Domain((0, 0, 0), tuple(self._whole(TANK)), [("slip", "slip"), ("slip", "slip"), ("slip", "air")])

    def bodies(self) -> list[SolidBody]:
        """Return the box."""
        return [SolidBody("box", tuple(self.box.mean(axis=0) * [1, 0, 1]))]

    @property
    def coefficient_bodies(self) -> list[str]:
        """Name of the box."""
        return ["box"]

    @property
    def initial_volume(self) -> float:
        """That of half of the column [H³]."""
        return float(COLUMN * TANK[1])

    def particle_estimate(self) -> int:
        """Return about how many particles there are, with those of the box."""
        return super().particle_estimate() + len(self._solid.position)

    def particles(self) -> dict[str, NDArray[Any]]:
        """Return the column at rest with the pressure of its first instant, and the box."""
        counts = np.rint([COLUMN * self.resolution, TANK[1] * self.resolution, self.resolution]).astype(int)
        position = lattice(*(cell_centres(count, self.particle_spacing) for count in counts))
        water = self.fluid(position, np.zeros_like(position), column_pressure(position[:, 0], position[:, -1], COLUMN))
        return join(water, self._solid.particles(np.zeros(3)))

    @cached_property
    def _solid(self) -> Solid:
        """Cells of the box, which stands on the floor and reaches to the plane of symmetry."""
        (left, _, _), (right, side, top) = self.box
        counts = np.rint((self.box[1] - self.box[0]) * self.resolution).astype(int)
        position = lattice(*(cell_centres(count, self.particle_spacing) for count in counts)) + self.box[0]
        x, y, z = position.T
        depths = np.stack([x - left, right - x, side - y, top - z])
        normals = np.array([[-1.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
        least = depths.min(axis=0)
        near = depths < least + 1e-6 * self.particle_spacing  # in edges and corners the bisector
        normal = near.T.astype(float) @ normals
        size = np.linalg.norm(normal, axis=1, keepdims=True)
        kept = least < self.support_layers * self.particle_spacing
        return Solid(position, np.divide(normal, size, out=np.zeros_like(normal), where=size > 0), least).where(kept)

    def outputs(self) -> list[Output]:
        """Return the record of the sensors."""
        face = self.box[0, 0]
        places = {name: (np.array([face, PLACE, height]), np.array([-1.0, 0, 0])) for name, height in SENSORS.items()}
        return [WallSensors(places, 0, np.zeros(3), self.particle_spacing)]

    def measures(self, run: Record) -> list[Measure]:
        """Return arrival and mean pressures at the sensors beside the experiment, and what energy was made."""
        return [*self._at_sensors(run), *self.energy_measures(run)]

    def _at_sensors(self, run: Record) -> list[Measure]:
        time, pressure = WallSensors.read(run)
        rows: list[Measure] = []
        for name, own in zip(SENSORS, pressure, strict=False):
            at, measured = reference.table(f"dam_break_obstacle_{name.lower()}.csv")
            found = [_arrival(time, own), _arrival(at, measured)]
            if len(time) and time[-1] > 2.0:
                rows.append(Measure(f"time of arrival at {name}, √(H/g)", found[0], found[1], 0.05, SOURCE))
            for start, end in WINDOWS:
                if len(time) and time[-1] >= end:
                    means = [_mean(time, own, start, end), _mean(at, measured, start, end)]
                    label = mean_name(name, (start, end))
                    rows.append(Measure(label, means[0], means[1], 0.15, SOURCE))
        return rows

    def profiles(self, run: Record) -> list[Profile]:
        """Return the pressure at the sensors over time."""
        time, pressure = WallSensors.read(run)
        axes = ("$t\\sqrt{g/H}$", "$p/\\rho gH$")
        found = []
        for name, own in zip(SENSORS, pressure, strict=False):
            at, measured = reference.table(f"dam_break_obstacle_{name.lower()}.csv")
            found.append(Profile(f"pressure at {name}", axes, (time, own), (at, measured), SOURCE))
        return found if len(time) else []


def _arrival(time: FloatArray, pressure: FloatArray) -> float:
    """Return when a pressure first exceeds 0.3."""
    above = np.flatnonzero(pressure > 0.3)
    return float(time[above[0]]) if len(above) else np.nan


def _mean(time: FloatArray, pressure: FloatArray, start: float, end: float) -> float:
    return float(np.interp(np.linspace(start, end, 1001), time, pressure).mean())
