"""What cases of a fluid with a free surface share."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, model_validator

from alsph.analysis.energy import PARTS, energy, largest_rise, taken
from alsph.analysis.measures import Measure
from alsph.analysis.probes import GaugeRecord
from alsph.analysis.record import Record
from alsph.analysis.sampling import pressure_on_walls
from alsph.arrays import Arrays, FloatArray
from alsph.cases.base import Case
from alsph.cases.series import Series, names
from alsph.engine.prescribed import asked
from alsph.engine.simulation import Simulation
from alsph.errors import ConfigError, OtherPointsError, RunFolderError
from alsph.geometry.domain import Domain
from alsph.geometry.particles import Kind, particles
from alsph.symbols import GENERAL, WATER, Symbols

COURANT = 0.2
"""Courant number of a step where none is given: the shortest waves of the surface are those of gravity."""

SIDES = ("slip", "periodic", "air", "none")
"""What closes the sides of a domain in which there is a free surface."""

ENERGY = "largest rise of the energy over its start"
"""Name of the measure of what energy was made."""

TAKEN = "share of the energy lost to "
"""Names of the measures of what energy was lost begin so."""

GRAVITY = 9.81
"""That of the earth [m/s²]."""


class Levels(Series):
    """The depth of the water at gauges over time, in a file of the run folder.

    It is what lies in a column around the gauge, over its width: spray counts as what it is, and the level is smooth.
    Where a body lies in the column the depth is less by it.

    Parameters
    ----------
    gauges
        Their places along x, in 3-D along x and y (m, 2) [D].
    domain
        The tank; beyond its sides the water goes on as in a mirror, or from the opposite one where they are periodic,
        but not beyond those that are open to the air.
    spacing
        Particle spacing Δx [D].
    symbols
        What the case calls D and D/U.

    Raises
    ------
    ConfigError
        If gauges and domain are not of the same number of directions.
    """

    file = "output_levels.csv"
    interval = 0.05

    def __init__(
        self, gauges: ArrayLike | Sequence[Sequence[float]], domain: Domain, spacing: float, symbols: Symbols = WATER
    ) -> None:
        found = np.asarray(gauges, float)
        self.gauges, self.domain, self.spacing = found.reshape(len(found), -1), domain, spacing
        if self.gauges.shape[1] != domain.dimensions - 1:
            raise ConfigError("gauges: each needs a place along x, in a tank in 3-D along x and y")
        places = [
            "; ".join(f"{axis} = {at:g} {symbols.length}" for axis, at in zip("xy", gauge, strict=False))
            for gauge in self.gauges
        ]
        super().__init__([symbols("time [D/U]"), *(symbols(f"depth at {place} [D]") for place in places)])

    def values(self, simulation: Simulation) -> FloatArray:
        """Return the present depths (m,)."""
        state = simulation.state()
        return self.depth(state["position"][state["kind"] == Kind.FLUID])

    def depth(self, position: FloatArray) -> FloatArray:
        """Return the depth (m,) at the gauges of fluid particles at positions (n, d).

        The column reaches four spacings to each side, along x and y alike, and ends softly.
        """
        if position.shape[1] != self.domain.dimensions:
            raise ConfigError(f"gauges: they are of a tank in {self.domain.dimensions}-D")
        share = np.ones((len(self.gauges), len(position)))
        for axis in range(self.gauges.shape[1]):
            along, sides = position[:, axis], (self.domain.lower[axis], self.domain.upper[axis])
            if self.domain.periodic[axis]:
                images = along + (sides[1] - sides[0]) * np.array([[0], [-1], [1]])
            else:
                closed = [side for side, kind in zip(sides, self.domain.boundaries[axis], strict=True) if kind != "air"]
                images = np.stack([along, *(2 * side - along for side in closed)])
            away = np.abs(images - self.gauges[:, None, [axis]]) / (4 * self.spacing)
            share *= np.where(away < 1, 1 + np.cos(np.pi * away), 0.0).sum(axis=1) / 8
        return np.asarray(share.sum(axis=1) * self.spacing)


class Gauges(Levels):
    """The depth of the water at the `gauges` of a run.

    Raises
    ------
    ValueError
        If a file that is to go on is of other gauges.
    """

    file = "gauges.csv"

    @classmethod
    def of(cls, case: Case, places: FloatArray) -> Gauges:
        """Return those at places (m, d − 1) of a case."""
        return cls(places, case.checked_domain, case.particle_spacing, case.symbols)

    @classmethod
    def recorded(cls, run: Record, case: Case, places: FloatArray) -> GaugeRecord:
        """Return what a run has recorded at places (m, d − 1), :attr:`alsph.Run.gauges`."""
        if not len(places):
            return GaugeRecord(places, np.empty(0), np.empty((0, 0)))
        path = run.file(cls.file)
        try:
            cls.of(case, places).check(path)
        except OtherPointsError as error:
            raise RunFolderError(f"{path}: {error} in case.toml, which is of another run or was changed") from None
        time, depth = cls.read(run)
        return GaugeRecord(places, time, depth.T)

    def check(self, path: Path) -> None:
        """Refuse a file of other gauges."""
        if (known := names(path)) and known != self.columns:
            raise OtherPointsError(f"holds {', '.join(known[1:])}; the gauges are at other places")

    def append(self, path: Path) -> None:
        """Append what has been kept to the file."""
        self.check(path)
        super().append(path)

    def truncate(self, path: Path, time: float) -> None:
        """Drop what is later than `time`."""
        self.check(path)
        super().truncate(path, time)


class Sensors(Series):
    """The mean pressure over sensors in slip walls over time, in a file of the run folder.

    Where a sensor is dry it feels the air, and no less than that unless the fluid may be in tension.

    Parameters
    ----------
    sensors
        Points (k, d) over the extent of each, by name [H].
    spacing
        Particle spacing Δx [H].
    """

    file = "output_sensors.csv"
    interval = 0.01

    def __init__(self, sensors: Mapping[str, FloatArray], spacing: float) -> None:
        self.points, self.spacing = np.concatenate([*sensors.values()]), spacing
        self.ends = np.cumsum([*map(len, sensors.values())])[:-1]
        super().__init__(["time [√(H/g)]", *(f"{name} [ρgH]" for name in sensors)])

    def values(self, simulation: Simulation) -> FloatArray:
        """Return the present pressures (m,)."""
        state, settings = simulation.state(), simulation.problem.settings
        fluid = state["kind"] == Kind.FLUID
        force = np.array(settings["body_force"])
        if rule := simulation.rules.get("forcing"):  # that of a tank which sways
            force = force + np.asarray(asked("forcing", rule, self.points, simulation.time)).mean(axis=0)
        found = pressure_on_walls(
            state["position"][fluid],
            state["pressure"][fluid],
            self.points,
            self.spacing,
            Domain.of(settings["domain"]),
            force,
        )
        wet = np.nan_to_num(found)
        felt = wet if settings["free_surface"]["tension"] else np.maximum(wet, 0.0)
        return np.array([part.mean() for part in np.split(felt, self.ends)])


class FreeSurface(Case):
    """A fluid with a free surface, beyond which is air of no pressure.

    In cases with gravity g = 1 and, if `symbols` says nothing else, D is H, the depth of the fluid, U = √(gH) and times
    are in √(H/g). A step is that of
    its scheme with operators that keep momentum and energy where a particle has no neighbours (docs/free_surface.md);
    inlets and outlets are not there yet.
    """

    symbols: ClassVar[Symbols] = WATER
    settles: ClassVar[bool] = False
    picture_axis: ClassVar[str] = "y"
    idle: ClassVar[tuple[str, ...]] = ("tolerance", "viscous_theta", "wall_pressure", "laplacian_correction")
    later_names: ClassVar[tuple[str, ...]] = (ENERGY, *(f"{TAKEN}{name}" for name in PARTS))
    usual_sound_speed: ClassVar[float] = 20.0
    gravity: ClassVar[bool] = True
    """Whether the body force (0, −1), in 3-D (0, 0, −1), acts."""
    tension: ClassVar[bool] = False
    """Whether the pressure may fall below that of the air, as in a fluid that turns."""
    splashes: ClassVar[bool] = False
    """Whether impacts press particles together, which `packing_relaxation` takes apart."""

    reynolds: float = Field(default=1e6, gt=0, description="Reynolds number UD/ν [-]")
    scheme: Literal["alsph", "isph", "explicit_isph", "wcsph", "edac"] | None = Field(
        default=None,
        description="augmented Lagrangian SPH, projection ISPH, explicit ISPH, weakly compressible SPH or entropically "
        "damped artificial compressibility; alsph if not given",
    )
    sound_speed: float | None = Field(
        default=None, gt=0, description="speed of sound of wcsph and edac, 20 if not given [U]"
    )
    density_relaxation: Literal[0] | None = Field(default=None, description="none: see packing_relaxation")
    courant: float | None = Field(
        default=None,
        gt=0,
        le=1,
        description="Courant number of a step, which the penalty follows: the larger of u_max and U times Δt/Δx; 0.2 "
        "if not given, or none where time_step, penalty_constant or, with alsph, algorithm 2 are [-]",
    )
    projection_sweeps: int = Field(
        default=4,
        ge=0,
        le=1000,
        description="projection sweeps after the iterations of a step; with isph and explicit_isph 1 if not given, "
        "with wcsph and edac none [-]",
    )
    algorithm: Literal["midpoint", 2] = Field(
        default="midpoint", description="derivatives in the middle of the step, or at initial positions"
    )
    shifting: Literal["none"] = Field(default="none", description="none: it would feed thin jets with energy")
    velocity_laplacian: Literal["scalar"] = Field(default="scalar", description="viscous term per component")
    viscous_order: Literal[2] = Field(default=2, description="order of the viscous term in Δx")
    wall_velocity: Literal["adami", "morris", "paper"] = Field(
        default="adami", description="velocity that solid particles show to the viscous term"
    )
    sweep_weights: Literal["chebyshev", "equal"] | None = Field(
        default="equal", description="how far each projection sweep goes"
    )
    sweep_pressure: Literal["rough"] = Field(default="rough", description="what the pressure keeps of the sweeps")
    pressure_gradient: Literal["adjoint", "conservative"] | None = Field(
        default=None,
        description="pressure gradient: minus the adjoint of the divergence, nearer in waves, or the plain sum over "
        "pairs, which keeps angular momentum, too, and rest beside bodies; by default the one without bodies, the "
        "other with them",
    )
    packing_relaxation: float | None = Field(
        default=None,
        ge=0,
        le=1,
        description="share of a number density above the lattice's that a step takes off; if not given 0.05 where "
        "water splashes, 0.015 of wcsph and edac, whose steps are short, else 0 [-]",
    )
    artificial_viscosity: float = Field(
        default=0.05,
        ge=0,
        le=1,
        description="viscosity against what velocities do from particle to particle; a linear flow does not feel it, "
        "a smooth one in fourth order [UΔx]",
    )

    @classmethod
    def __pydantic_init_subclass__(cls, **options: Any) -> None:
        """Call D and U so in a class without gravity that says nothing else."""
        if cls.symbols is WATER and not cls.gravity:
            cls.symbols = GENERAL
        super().__pydantic_init_subclass__(**options)

    @model_validator(mode="before")
    @classmethod
    def _step_of_a_surface(cls, values: dict[str, Any]) -> dict[str, Any]:
        given = any(values.get(name) is not None for name in ("courant", "time_step", "penalty_constant"))
        paper = values.get("algorithm") == 2 and values.get("scheme") in (None, "alsph")
        return values if given or paper else values | {"courant": COURANT}

    @property
    def reference_velocity(self) -> float:
        """The least that u_max counts in the time step [U]."""
        return 1.0

    @property
    def has_depth(self) -> bool:
        """Where gravity acts."""
        return self.gravity

    def body_force(self) -> list[float]:
        """Return gravity, which points down the last axis [U²/D], if it acts."""
        return [0.0] * (self.space_dimensions - 1) + [-1.0 if self.gravity else 0.0]

    def settings(self) -> dict[str, Any]:
        """Return the engine's settings (see docs/architecture.md)."""
        sides = {side for pair in self.checked_domain.boundaries for side in pair}
        if other := sorted(sides.difference(SIDES)):
            raise ConfigError(f"{self.name}: a side is '{other[0]}'; with a free surface take {' or '.join(SIDES)}")
        relaxation = (0.015 if self.is_weakly_compressible else 0.05) if self.splashes else 0.0
        return super().settings() | {
            "free_surface": {
                "reference_velocity": self.reference_velocity,
                "pressure_gradient": self.pressure_gradient or ("conservative" if self.checked_bodies else "adjoint"),
                "tension": self.tension,
                "packing_relaxation": relaxation if self.packing_relaxation is None else self.packing_relaxation,
                "artificial_viscosity": self.artificial_viscosity,
            }
        }

    @property
    def initial_volume(self) -> float:
        """About the volume of the fluid at the start [D^d], without making its particles; by default the domain's."""
        return math.prod(self.checked_domain.size)

    def particle_estimate(self) -> int:
        """Return about how many particles there are: those of the fluid."""
        return round(self.initial_volume * float(self.resolution) ** self.space_dimensions)

    def fluid(self, position: FloatArray, velocity: FloatArray, pressure: FloatArray) -> Arrays:
        """Return fluid particles, whose pressure is not below that of the air unless tension is allowed."""
        pressure = pressure if self.tension else np.maximum(pressure, 0.0)
        return particles(Kind.FLUID, position, velocity, pressure=pressure)

    def remarks(self) -> list[str]:
        """Return what this resolution and method cannot carry, and units of another gravity than that of the earth."""
        found = super().remarks()
        if self.gravity and self.units and abs(self.units.factor("acceleration") / GRAVITY - 1) > 0.01:
            told = f"units: they make g = {self.units.factor('acceleration'):.3g} m/s²"
            velocity = (GRAVITY * self.units.length) ** 0.5
            found.append(f"{told}; on earth units_velocity is √(gH) = {velocity:.4g}")
        return found

    def measures(self, run: Record) -> list[Measure]:
        """Return what energy was made."""
        return self.energy_measures(run)

    def energy_measures(self, run: Record) -> list[Measure]:
        """Return the largest rise of kinetic and potential energy above their least value before, over their start.

        And what each part of a step has taken of it, if the history tells. None where a force that depends on time or
        bodies that move do work, too.
        """
        moved = "forcing" in self.rules or any(body.moves or body.rigid for body in self.checked_bodies)
        if moved or not len(run.history.get("potential_energy", [])):
            return []
        start = np.abs(energy(run.history)[0])
        lost = [Measure(TAKEN + name, float(part[-1] / start)) for name, part in taken(run.history).items()]
        return [Measure(ENERGY, largest_rise(run.history), 0.0, 0.01, "energy is only lost"), *lost]
