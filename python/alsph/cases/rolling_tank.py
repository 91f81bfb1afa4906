"""Water in a tank that rolls."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import shapely
from numpy.typing import ArrayLike
from pydantic import Field

from alsph import reference
from alsph.analysis.measures import Measure, Profile
from alsph.analysis.record import Record
from alsph.arrays import Arrays, FloatArray
from alsph.cases.free_surface import FreeSurface
from alsph.cases.sensors import WallSensors
from alsph.engine.output import Output
from alsph.geometry.domain import Domain, SolidBody
from alsph.geometry.lattice import cell_centres, lattice
from alsph.geometry.packing import Planar
from alsph.geometry.particles import join
from alsph.geometry.solids import open_tank

DEPTH = 0.465
"""H of the experiment, three quarters of a tank 0.92 m long and 0.62 m high [m]."""

SECOND = float(np.sqrt(9.81 / DEPTH))
"""A second [√(H/g)]."""

KILOPASCAL = 1 / (9.81 * DEPTH)
"""A kPa [ρgH]."""

SENSORS = {"P2": (1, 0.17 / DEPTH), "P8": (-1, 0.45 / DEPTH)}
"""End wall, and height above the floor [H], as the examples of PySPH read them from the paper's figure."""

SOURCE = "experiment, Akyildiz and Ünal (2006)"

EXPERIMENT = {"tank_length": 1.978, "tank_height": 1.333, "amplitude": 4.0, "frequency": 0.4354}


class RollingTank(FreeSurface):
    """A tank with water of depth H that rolls about the middle of its floor, clockwise first (Akyildiz and Ünal 2006).

    The tank is of solid particles, which move; lengths are taken to whole spacings.
    """

    name: ClassVar[str] = "rolling_tank"
    title: ClassVar[str] = "water in a tank that rolls"
    splashes: ClassVar[bool] = True
    later_names: ClassVar[tuple[str, ...]] = (
        *(f"swing of the pressure at {name}, ρgH" for name in SENSORS),
        *(f"pressure at {name}" for name in SENSORS),
    )

    tank_length: float = Field(default=1.978, gt=0, description="length of the tank [H]")
    tank_height: float = Field(default=1.333, gt=1, description="height of the tank, whose top is open [H]")
    amplitude: float = Field(default=4.0, gt=0, le=30, description="amplitude of the roll [degrees]")
    frequency: float = Field(default=0.4354, gt=0, description="angular frequency of the roll [√(g/H)]")

    @property
    def default_until(self) -> float:
        """Three periods."""
        return 3 * 2 * np.pi / self.frequency

    @property
    def coefficient_bodies(self) -> list[str]:
        """Name of the tank."""
        return ["tank"]

    @property
    def size(self) -> tuple[float, float]:
        """Length and height of the tank, to whole spacings [H]."""
        return float(self.whole(self.tank_length, 2)), float(self.whole(self.tank_height))

    def domain(self) -> Domain:
        """Return a box around the tank as it rolls."""
        length, height = self.size
        wall = (self.support_layers + 1) * self.particle_spacing
        reach = float(np.hypot(length / 2 + wall, height))
        tilt = np.sin(np.radians(self.amplitude))
        return Domain(
            (-reach, -wall - tilt * reach), (reach, height + tilt * reach), [("none", "none"), ("none", "air")]
        )

    def bodies(self) -> list[SolidBody]:
        """Return the tank."""
        return [SolidBody("tank", (0, 0), velocity=None, moves=True)]

    def motion(self, position: FloatArray, time: float) -> ArrayLike:
        """Return how far the tank has turned."""
        return [0.0, 0.0, -np.radians(self.amplitude) * np.sin(self.frequency * time)]

    @property
    def initial_volume(self) -> float:
        """That of the water [H²]."""
        return self.size[0]

    def particle_estimate(self) -> int:
        """Return about how many particles there are, with those of the tank."""
        (length, height), layers = self.size, self.support_layers
        walls = layers * (2 * height + length) * self.resolution + 2 * layers**2
        return super().particle_estimate() + round(walls)

    def particles(self) -> Arrays:
        """Return water at rest in the tank."""
        (length, height), spacing = self.size, self.particle_spacing
        columns = cell_centres(round(length * self.resolution), spacing) - length / 2
        position = lattice(columns, cell_centres(self.resolution, spacing))
        tank = open_tank(-length / 2, length / 2, height, spacing, self.support_layers)
        water = self.fluid(position, np.zeros_like(position), 1 - position[:, 1])
        return join(water, tank.particles())

    def solid_height(self, position: FloatArray) -> FloatArray:
        """Return how far points (n, 2) lie outside of the walls of the tank where it begins [H]."""
        (length, height), wall = self.size, self.support_layers * self.particle_spacing
        outer = shapely.box(-length / 2 - wall, -wall, length / 2 + wall, height)
        return Planar(outer - shapely.box(-length / 2, 0, length / 2, height)).height(position)

    @property
    def has_depth(self) -> bool:
        """Not for gauges, which stay where they are."""
        return False

    def outputs(self) -> list[Output]:
        """Return the record of the sensors in the end walls."""
        half = self.size[0] / 2
        places = {
            name: (np.array([side * half, height]), np.array([-side, 0.0])) for name, (side, height) in SENSORS.items()
        }
        return [WallSensors(places, 0, np.zeros(2), self.particle_spacing)]

    @property
    def _is_the_experiment(self) -> bool:
        return all(getattr(self, name) == value for name, value in EXPERIMENT.items())

    def measures(self, run: Record) -> list[Measure]:
        """Return by how much the pressure swings at the sensors after the first period, beside the experiment."""
        time, pressure = WallSensors.read(run)
        period = 2 * np.pi / self.frequency
        if not len(time):
            return []
        rows = []
        for name, own in zip(SENSORS, pressure, strict=False):
            swings = [_swing(time, own, period) if time[-1] > 2 * period else np.nan]
            swings.append(_swing(*_measured(name), period) if self._is_the_experiment else np.nan)
            rows.append(Measure(f"swing of the pressure at {name}, ρgH", swings[0], swings[1], 0.15, SOURCE))
        return rows

    def profiles(self, run: Record) -> list[Profile]:
        """Return the pressure at the sensors over time."""
        time, pressure = WallSensors.read(run)
        axes, none = ("$t\\sqrt{g/H}$", "$p/\\rho gH$"), (np.empty(0), np.empty(0))
        found = []
        for name, own in zip(SENSORS, pressure, strict=False):
            known, source = (_measured(name), SOURCE) if self._is_the_experiment else (none, "")
            found.append(Profile(f"pressure at {name}", axes, (time, own), known, source))
        return found if len(time) else []


def _measured(name: str) -> tuple[FloatArray, FloatArray]:
    """Return time and pressure of the experiment."""
    time, pressure = reference.table(f"rolling_tank_{name.lower()}.csv")
    return time * SECOND, pressure * KILOPASCAL


def _swing(time: FloatArray, pressure: FloatArray, period: float) -> float:
    """Return half of what lies between the largest and the smallest pressure of a smooth curve after the first period.

    The curve is a Fourier polynomial of three harmonics; digitised points and noise of a spacing have no extrema.
    """
    late = time > period
    waves = 2 * np.pi * np.outer(time[late] / period, np.arange(1, 4))
    terms = np.hstack([np.ones((late.sum(), 1)), np.cos(waves), np.sin(waves)])
    fine = 2 * np.pi * np.outer(np.linspace(0, 1, 401), np.arange(1, 4))
    smooth = np.hstack([np.ones((401, 1)), np.cos(fine), np.sin(fine)])
    curve = smooth @ np.linalg.lstsq(terms, pressure[late], rcond=None)[0]
    return float((curve.max() - curve.min()) / 2)
