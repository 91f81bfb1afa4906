"""A column of water that is let go in a tank."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property
from typing import ClassVar, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from alsph import reference
from alsph.analysis.measures import Measure, Profile
from alsph.analysis.record import Record
from alsph.arrays import Arrays, FloatArray
from alsph.cases.free_surface import FreeSurface, Sensors
from alsph.cases.sensors import WallSensors
from alsph.cases.series import Series
from alsph.engine.output import Output
from alsph.engine.simulation import Simulation
from alsph.errors import ConfigError
from alsph.geometry.domain import Boundary, Domain, SolidBody
from alsph.geometry.lattice import cell_centres, lattice
from alsph.geometry.particles import Kind, join
from alsph.geometry.solids import Solid, open_tank

FRONT = {1.0: 2.947, 2.0: 4.665}
"""Front [H] at times [√(H/g)] of a column 2H long: WCSPH with 400 particles over H, the authors' own
(TrixiParticles.jl, the dam break of its validation)."""


class Column(NamedTuple):
    """The front of a column that was let go in an experiment.

    Attributes
    ----------
    source, curve : str
        Who measured it, and the file of the front over time, ``dam_break_front_CURVE.csv``.
    scale : float
        The file's unit of length [H] and of time [√(H/g)].
    """

    source: str
    curve: str
    scale: float

    def measured(self, wall: float) -> tuple[FloatArray, FloatArray]:
        """Return time (n,) [√(H/g)] and front (n,) [H] before it comes to a wall [H]."""
        time, front = self.scale * reference.table(f"dam_break_front_{self.curve}.csv")
        return time[front < wall], front[front < wall]


COLUMNS = {
    0.5: (
        Column("Martin and Moyce (1952)", "martin_moyce_2", 0.5),
        Column("Koshizuka and Oka (1996)", "koshizuka_oka", 0.5),
    ),
    1.0: (Column("Martin and Moyce (1952)", "martin_moyce_1", 1.0),),
}
"""Experiments with columns of other lengths [H]."""

COMPUTATION = "inviscid SPH, H/Δx = 400 (TrixiParticles)"
"""Where :data:`FRONT` and the curve that it is of come from."""

TERMS = np.arange(1, 200, 2)
"""Numbers of the terms of the Fourier series."""


class Sensor(NamedTuple):
    """A round pressure sensor in the end wall, and what was measured with it.

    Attributes
    ----------
    height, diameter : float
        Of its middle above the floor, and its own [H].
    curve : str
        The file of the pressure over time, ``dam_break_pressure_CURVE.csv``.
    source : str
    """

    height: float
    diameter: float
    curve: str
    source: str

    def measured(self) -> tuple[FloatArray, FloatArray]:
        """Return time (n,) [√(H/g)] and pressure (n,) [ρgH]."""
        time, pressure = reference.curve(f"dam_break_pressure_{self.curve}.csv")
        return time, pressure


LOBOVSKY, BUCHNER = "experiment, Lobovský et al. (2014)", "experiment, Buchner (2002)"

SENSORS = {
    "P1": Sensor(0.01, 0.014, "p1", LOBOVSKY),
    "P3": Sensor(0.1, 0.014, "p3", LOBOVSKY),
    "P4": Sensor(0.267, 0.014, "p4", LOBOVSKY),
    "Buchner's disc": Sensor(0.267, 0.15, "buchner", BUCHNER),
}
"""Those of Lobovský et al. (J. Fluids Struct. 48 (2014) 407), 4.2 mm at 3, 30 and 80 mm with H = 300 mm, and that of
Buchner (thesis, TU Delft 2002), 90 mm at 160 mm with H = 600 mm."""

WINDOWS = ((2.4, 3.5), (3.5, 5.5), (5.5, 7.0))
"""Times [√(H/g)] that impulses are taken between: the impact, the water on the wall, and its fall."""


def impulse_name(sensor: str, window: tuple[float, float]) -> str:
    """Return the name of the measure of ∫ p dt at a sensor."""
    return f"impulse at {sensor}, t = {window[0]:g} to {window[1]:g}, ρgH√(H/g)"


class Front(Series):
    """How far the water of a dam break has come, over time."""

    file = "output_front.csv"
    interval = 0.01

    def __init__(self, case: DamBreak) -> None:
        self.case = case
        super().__init__(["time [√(H/g)]", "front [H]"])

    def values(self, simulation: Simulation) -> FloatArray:
        """Return the present front (1,)."""
        state = simulation.state()
        return np.array([self.case.front(state["position"][state["kind"] == Kind.FLUID])])


class DamBreak(FreeSurface):
    """A column of water H high that is let go in a tank with slip walls (Lobovský et al. 2014: 2H long, 5.366H)."""

    name: ClassVar[str] = "dam_break"
    title: ClassVar[str] = "dam break in a tank"
    inviscid_from: ClassVar[float] = 1000.0
    splashes: ClassVar[bool] = True
    later_names: ClassVar[tuple[str, ...]] = (
        *FreeSurface.later_names,
        "front at t = ",
        "front",
        *(f"front, {each.source}" for columns in COLUMNS.values() for each in columns),
        *(impulse_name(sensor, window) for sensor in SENSORS for window in WINDOWS),
        *(f"pressure at {sensor}" for sensor in SENSORS),
    )
    velocity_max: ClassVar[float] = 2.0

    length: float = Field(default=2.0, gt=0, description="length of the column [H]")
    tank_length: float = Field(default=5.366, gt=0, description="length of the tank [H]")
    tank_height: float = Field(default=3.0, gt=1, description="height above which spray is lost [H]")
    dimensions: Literal[2, 3] = Field(default=2, description="number of space dimensions")
    width: float = Field(default=0.5, gt=0, description="width of column and tank in 3-D [H]")
    walls: Literal["slip", "solid"] = Field(
        default="slip", description="mirrors without friction, or solid particles, to which the water sticks, in 2-D"
    )

    @model_validator(mode="after")
    def _the_tank_holds_the_column(self) -> Self:
        if self.length >= self.tank_length:
            raise ConfigError(f"length = {self.length:g}: does not fit into a tank_length of {self.tank_length:g}")
        self.whole_cells("length", self.length)
        if self.dimensions == 3:
            self.whole_cells("width", self.width)
            if self.walls == "solid":
                raise ConfigError("walls = 'solid': of a tank in 2-D; leave out dimensions = 3, or take walls = 'slip'")
        elif self.width != type(self).model_fields["width"].default:
            raise ConfigError(f"width = {self.width:g}: of a tank in 3-D; give dimensions = 3, too, or leave it out")
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
        lengths = [self.end, *across, self.tank_height]
        wall: Boundary = "none" if self.walls == "solid" else "slip"
        sides: list[tuple[Boundary, Boundary]] = [(wall, wall)] * len(lengths)
        sides[-1] = (wall, "air")
        return Domain([0] * len(lengths), lengths, sides)

    @property
    def end(self) -> float:
        """Where the end wall is [H]: walls of solids stand at whole spacings."""
        return float(self.whole(self.tank_length)) if self.walls == "solid" else self.tank_length

    def bodies(self) -> list[SolidBody]:
        """Return the tank, where it is of solids."""
        return [SolidBody("tank", (0, 0))] if self.walls == "solid" else []

    @property
    def coefficient_bodies(self) -> list[str]:
        """Name of the tank, where it is of solids."""
        return [body.name for body in self.bodies()]

    @property
    def moved_bodies(self) -> list[str]:
        """None: walls that close the domain stay."""
        return []

    @property
    def middle(self) -> FloatArray:
        """Point that slices for pictures go through in 3-D [H]: in the water, as long as there is some."""
        return np.array([self.tank_length / 2, self.width / 2, 0.05])

    @property
    def initial_volume(self) -> float:
        """That of the column [H^d]."""
        return self.length * (self.width if self.dimensions == 3 else 1.0)

    def particles(self) -> Arrays:
        """Return the column at rest, with the pressure of its first instant."""
        cells = [self.whole_cells("length", self.length), self.resolution]
        if self.dimensions == 3:
            cells.insert(1, self.whole_cells("width", self.width))
        position = lattice(*(cell_centres(count, self.particle_spacing) for count in cells))
        water = self.fluid(
            position, np.zeros_like(position), column_pressure(position[:, 0], position[:, -1], self.length)
        )
        return join(water, self._tank.particles()) if self.walls == "solid" else water

    @cached_property
    def _tank(self) -> Solid:
        return open_tank(0, self.end, self.tank_height, self.particle_spacing, self.support_layers)

    def particle_estimate(self) -> int:
        """Return about how many particles there are, with those of the walls."""
        return super().particle_estimate() + (len(self._tank.position) if self.walls == "solid" else 0)

    def front(self, position: FloatArray) -> float:
        """Return how far the water has come [H]: half a spacing before its third foremost particle, or to the wall."""
        return min(float(np.sort(position[:, 0])[-3:][0] + self.particle_spacing / 2), self.end)

    def outputs(self) -> list[Output]:
        """Return the records of the front and of the sensors in the end wall."""
        places = {name: self.disc(sensor.height, sensor.diameter) for name, sensor in SENSORS.items()}
        if self.walls == "solid":
            outward = np.array([-1.0, 0])
            faces = {name: (points, outward) for name, points in places.items()}
            return [Front(self), WallSensors(faces, 0, np.zeros(2), self.particle_spacing)]
        return [Front(self), Sensors(places, self.particle_spacing)]

    def disc(self, height: float, diameter: float) -> FloatArray:
        """Return points (m, d) over a disc in the end wall, in 3-D half-way across, Δx/2 or less apart [H]."""
        count = max(3, math.ceil(2 * diameter / self.particle_spacing))
        across, up = diameter * (lattice(*[cell_centres(count, 1 / count)] * 2) - 0.5).T
        inside = np.hypot(across, up) < diameter / 2
        wall = np.full(inside.sum(), self.end)
        sides = [self.width / 2 + across[inside]] if self.dimensions == 3 else []
        return np.stack([wall, *sides, height + up[inside]], axis=1)

    def measures(self, run: Record) -> list[Measure]:
        """Return the front beside an inviscid computation or experiments, impulses, and what energy was made."""
        rows = [*self._fronts(run), *(self._impulses(run) if self._is_compared else [])]
        return self.compared(rows) + self.energy_measures(run)

    @property
    def _is_compared(self) -> bool:
        return (self.length, self.tank_length) == (2.0, 5.366)

    def _fronts(self, run: Record) -> Iterator[Measure]:
        """Yield the front where the run has come so far: before it meets the wall."""
        time, front = Front.read(run)
        rows = [(at, f"front at t = {at:g}, H", known, COMPUTATION, 0.05) for at, known in FRONT.items()]
        if not self._is_compared:
            rows = []
            for column in COLUMNS.get(self.length, ()):
                curve, source = column.measured(self.end), f"experiment, {column.source}"
                for at in (at for at in FRONT if len(curve[0]) and at <= curve[0][-1]):
                    name = f"front at t = {at:g} beside {column.source}, H"
                    rows.append((at, name, float(np.interp(at, *curve)), source, 0.15))
        near = self.end - 2 * self.particle_spacing  # the foremost particles stop short of the wall
        for at, name, known, source, tolerance in rows:
            if len(time) and time[0] <= at <= time[-1] and (own := float(np.interp(at, time, front[0]))) < near:
                yield Measure(name, own, known, tolerance, source)

    def _impulses(self, run: Record) -> Iterator[Measure]:
        """Yield the impulse at each sensor over the windows that the run covers."""
        time, pressure = Sensors.read(run)
        covered = [(start, end) for start, end in WINDOWS if len(time) and time[0] <= start and end <= time[-1]]
        for (name, sensor), own in zip(SENSORS.items(), pressure, strict=False):
            for window in covered:
                found, measured = impulse((time, own), window), impulse(sensor.measured(), window)
                yield Measure(impulse_name(name, window), found, measured, 0.15, sensor.source)

    def profiles(self, run: Record) -> list[Profile]:
        """Return the front over time, and the pressure at each sensor that the water has met."""
        nothing = np.empty(0), np.empty(0)
        clock = "$t\\sqrt{g/H}$"
        time, front = Front.read(run)
        known = tuple(reference.table("dam_break_front.csv")) if self._is_compared else nothing
        axes = clock, "front $x/H$"
        drawn = [Profile("front", axes, (time, front[0]), known, COMPUTATION)]
        for column in COLUMNS.get(self.length, ()):
            source = f"experiment, {column.source}"
            drawn.append(Profile(f"front, {column.source}", axes, (time, front[0]), column.measured(self.end), source))
        time, pressure = Sensors.read(run)
        for (name, sensor), own in zip(SENSORS.items(), pressure, strict=False):
            known, axes = sensor.measured() if self._is_compared else nothing, (clock, "$p\\,/\\,\\rho gH$")
            drawn.append(Profile(f"pressure at {name}", axes, (time, own), known, sensor.source))
        return [profile for profile in drawn if profile.computed[1].any()]


def impulse(curve: tuple[FloatArray, FloatArray], window: tuple[float, float]) -> float:
    """Return ∫ p dt between two times of a curve that is linear between its points."""
    time = curve[0]
    at = np.array([window[0], *time[(time > window[0]) & (time < window[1])], window[1]])
    pressure = np.interp(at, *curve)
    return float((np.diff(at) * (pressure[1:] + pressure[:-1])).sum() / 2)


def column_pressure(x: FloatArray, y: FloatArray, length: float) -> FloatArray:
    """Return the pressure (n,) of an inviscid column just let go [ρgH]: ∇²p = 0, 0 at its top and its free side.

    That is 1 − y less what the free side takes off, a Fourier series.
    """
    wave = np.pi * TERMS[:, None] / 2
    along = (np.exp(wave * (x - length)) + np.exp(-wave * (x + length))) / (1 + np.exp(-2 * wave * length))
    return np.asarray(1 - y - (2 / wave**2 * np.cos(wave * y) * along).sum(axis=0))
