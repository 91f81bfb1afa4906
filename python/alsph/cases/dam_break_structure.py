"""A column of water that is let go in a tank with a tall structure in it."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from pydantic import Field

from alsph import reference
from alsph.analysis.measures import Measure, Profile
from alsph.analysis.record import Record
from alsph.analysis.sampling import average
from alsph.arrays import FloatArray
from alsph.cases.free_surface import GRAVITY
from alsph.cases.obstacle import Obstacle, mean_between
from alsph.cases.series import Series
from alsph.engine.output import Output
from alsph.engine.simulation import Simulation
from alsph.geometry.particles import Kind

DEPTH = 0.3
"""H of the experiment [m]."""

SECOND = (GRAVITY / DEPTH) ** 0.5
"""One second [√(H/g)]."""

NEWTON = 1 / (1000 * GRAVITY * DEPTH**3)
"""One newton [ρgH³], in water."""

METRE_PER_SECOND = (GRAVITY * DEPTH) ** -0.5
"""One metre per second [√(gH)]."""

GAUGE = (0.814 / DEPTH, 0.0, 0.026 / DEPTH)
"""Place of the velocity gauge, in the plane of symmetry in front of the structure [H]."""

SOURCE = "experiment, Yeh and Petroff"

VELOCITY_WINDOWS = ((0.3, 1.7), (1.7, 3.1))
"""Times after the water has come to the gauge that its velocity is averaged between [√(H/g)]."""

FORCE_WINDOWS = ((0.6, 2.0), (2.0, 3.7), (6.6, 7.8))
"""Times after the water has come to the structure that the force is averaged between [√(H/g)]."""

FLOWS = 0.3
"""Velocity from which on the water has come to the gauge [√(gH)]."""

PUSHES = 0.02
"""Force from which on it has come to the structure [ρgH³]."""

INTERVAL = 0.05
"""Times that the force is averaged over for pictures [√(H/g)]."""


def velocity_name(window: tuple[float, float]) -> str:
    """Return the name of the measure of a mean velocity."""
    return f"velocity in front of the structure, mean over {window[0]:g} to {window[1]:g} after the water comes, √(gH)"


def force_name(window: tuple[float, float]) -> str:
    """Return the name of the measure of a mean force."""
    return f"force on the structure, mean over {window[0]:g} to {window[1]:g} after the water comes, ρgH³"


class Velocity(Series):
    """The velocity of the water along x at a gauge over time, in a file of the run folder; NaN while it is dry.

    Parameters
    ----------
    place
        Of the gauge (d,) [H].
    spacing
        Particle spacing Δx [H].
    """

    file = "output_velocity.csv"
    interval = 0.01

    def __init__(self, place: FloatArray, spacing: float) -> None:
        self.place, self.spacing = place, spacing
        super().__init__(["time [√(H/g)]", "velocity [√(gH)]"])

    def values(self, simulation: Simulation) -> FloatArray:
        """Return the present velocity (1,)."""
        state = simulation.state()
        fluid = state["kind"] == Kind.FLUID
        return average(state["position"][fluid], state["velocity"][fluid, 0], self.place[None], self.spacing)


class DamBreakStructure(Obstacle):
    """A column of water H high that is let go in a tank with a tall structure (Yeh and Petroff), 3-D.

    The half up to the plane of symmetry is computed; walls are slip walls, the structure is of solid particles and goes
    on above the tank. All lengths are taken to whole spacings.
    """

    name: ClassVar[str] = "dam_break_structure"
    title: ClassVar[str] = "dam break against a tall structure"
    tank = (1.6 / DEPTH, 0.305 / DEPTH, 0.75 / DEPTH)
    column = 0.4 / DEPTH
    corners = ((0.9 / DEPTH, 0.0, 0.0), (1.02 / DEPTH, 0.06 / DEPTH, 0.75 / DEPTH))
    obstacle: ClassVar[str] = "structure"

    later_names: ClassVar[tuple[str, ...]] = (
        *Obstacle.later_names,
        *map(velocity_name, VELOCITY_WINDOWS),
        *map(force_name, FORCE_WINDOWS),
        "velocity in front of the structure",
        "force on the structure",
    )

    resolution: int = Field(default=30, ge=8, description="particles over the depth of the water, H/Δx [-]")
    bed: float = Field(
        default=0.01 / DEPTH, ge=0, lt=0.5, description="depth of the water on the floor in front of the column [H]"
    )

    @property
    def default_until(self) -> float:
        """Until the wave that comes back has met the structure."""
        return 10.0

    @property
    def wet(self) -> float:
        """Depth of the water that lies on the floor in front of the column [H]."""
        return self.bed

    def remarks(self) -> list[str]:
        """Return what this resolution cannot carry, a layer of water that is thinner than told among it."""
        found, wet = super().remarks(), float(self.whole(self.wet))
        if abs(wet - self.bed) > 0.1 * self.bed:
            told = f"layer: the water on the floor is {wet:.3g} H deep, in whole spacings, not {self.bed:.3g} H"
            found.append(
                f"{told}; multiples of resolution = {math.ceil(1 / self.bed - 1e-9)} have it so, bed = 0 has none"
            )
        return found

    def outputs(self) -> list[Output]:
        """Return the record of the velocity in front of the structure."""
        return [Velocity(np.array(GAUGE), self.particle_spacing)]

    @property
    def _is_the_experiment(self) -> bool:
        told = float(type(self).model_fields["bed"].default)
        return math.isclose(self.bed, told, rel_tol=1e-3) and abs(float(self.whole(self.bed)) - told) < told

    def measures(self, run: Record) -> list[Measure]:
        """Return mean velocities and forces after the water has come beside the experiment, and what energy was made.

        The clocks of the experiment are not those of a column that is let go at once.
        """
        rows: list[Measure] = []
        for own, measured, windows, name in (
            (_velocity(run), _measured("velocity"), VELOCITY_WINDOWS, velocity_name),
            (_force(run), _measured("force"), FORCE_WINDOWS, force_name),
        ):
            for window in windows:
                if len(own[0]) and own[0][-1] >= window[1]:
                    known = mean_between(*measured, *window) if self._is_the_experiment else np.nan
                    rows.append(Measure(name(window), mean_between(*own, *window), known, 0.15, SOURCE))
        return [*rows, *self.energy_measures(run)]

    def profiles(self, run: Record) -> list[Profile]:
        """Return velocity and force over the time since the water has come."""
        drawn = []
        for name, own, measured, unit in (
            ("velocity in front of the structure", _velocity(run), _measured("velocity"), "$u/\\sqrt{gH}$"),
            ("force on the structure", _force(run), _measured("force"), "$F/\\rho gH^3$"),
        ):
            known = measured if self._is_the_experiment else (np.empty(0), np.empty(0))
            axes = ("$t\\sqrt{g/H}$ since the water has come", unit)
            drawn.append(Profile(name, axes, own, known, SOURCE))
        return [profile for profile in drawn if len(profile.computed[0])]


def _velocity(run: Record) -> tuple[FloatArray, FloatArray]:
    """Return time since the water has come to the gauge (k,) and the velocity there (k,); empty before."""
    time, velocity = Velocity.read(run)
    return _since(time, np.nan_to_num(velocity[0]), FLOWS)


def _force(run: Record) -> tuple[FloatArray, FloatArray]:
    """Return time since the water has come to the structure (k,) and the force (k,) on both its halves, smoothed."""
    time = run.history["time"]
    if not len(time):
        return np.empty(0), np.empty(0)
    force = run.history["structure_pressure_force_x"] + run.history["structure_viscous_force_x"]
    impulse = np.concatenate([[0.0], np.cumsum(2 * force * run.history["time_step"])])
    ends = np.arange(0, time[-1], INTERVAL)
    return _since(ends[1:] - INTERVAL / 2, np.diff(np.interp(ends, np.append(0.0, time), impulse)) / INTERVAL, PUSHES)


def _since(time: FloatArray, values: FloatArray, threshold: float) -> tuple[FloatArray, FloatArray]:
    """Return the times (k,) since `values` first exceed a threshold, and the values (k,) from then on."""
    above = np.flatnonzero(values > threshold)
    first = above[0] if len(above) else len(values)
    return time[first:] - (time[first] if len(above) else 0.0), values[first:]


def _measured(name: str) -> tuple[FloatArray, FloatArray]:
    """Return time since the water has come and velocity or force of the experiment."""
    time, value = reference.curve(f"dam_break_structure_{name}.csv")
    time = time * SECOND
    if name == "force":
        return _since(time, value * NEWTON, PUSHES)
    return time, value * METRE_PER_SECOND  # its clock begins then
