"""A column of water that is let go in a tank with a box on its floor."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from alsph import reference
from alsph.analysis.measures import Measure, Profile
from alsph.analysis.record import Record
from alsph.arrays import FloatArray
from alsph.cases.obstacle import Obstacle, mean_between
from alsph.cases.sensors import WallSensors
from alsph.engine.output import Output

DEPTH = 0.55
"""H of the experiment [m]."""

SENSORS = {"P1": 0.021 / DEPTH, "P3": 0.101 / DEPTH}
"""Heights of the sensors in the face of the box that the water meets, 0.053 H beside its middle [H]."""

PLACE = 0.029 / DEPTH

SOURCE = "experiment, Kleefsman et al. (2005)"

WINDOWS = ((1.6, 3.0), (3.0, 5.0))
"""Times that pressures are averaged between [√(H/g)]."""


def mean_name(sensor: str, window: tuple[float, float]) -> str:
    """Return the name of the measure of the mean pressure at a sensor."""
    return f"pressure at {sensor}, mean over t = {window[0]:g} to {window[1]:g}, ρgH"


class DamBreakObstacle(Obstacle):
    """A column of water H high that is let go in a tank with a box on its floor (Kleefsman et al. 2005), 3-D.

    The half up to the plane of symmetry is computed; walls are slip walls, the box is of solid particles. All lengths
    are taken to whole spacings.
    """

    name: ClassVar[str] = "dam_break_obstacle"
    title: ClassVar[str] = "dam break against a box"
    tank = (3.22 / DEPTH, 0.5 / DEPTH, 1.5 / DEPTH)
    column = 1.228 / DEPTH
    corners = ((2.3955 / DEPTH, 0.0, 0.0), (2.5565 / DEPTH, 0.2015 / DEPTH, 0.161 / DEPTH))
    later_names: ClassVar[tuple[str, ...]] = (
        *Obstacle.later_names,
        *(f"time of arrival at {name}, √(H/g)" for name in SENSORS),
        *(mean_name(name, window) for name in SENSORS for window in WINDOWS),
        *(f"pressure at {name}" for name in SENSORS),
    )

    @property
    def default_until(self) -> float:
        """Until the water has fallen back from the box."""
        return 6.0

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
                    means = [mean_between(time, own, start, end), mean_between(at, measured, start, end)]
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
