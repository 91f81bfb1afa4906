"""Decaying Taylor-Green vortices in a periodic box, with their exact solution in 2-D."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from alsph import reference
from alsph.analysis import averages
from alsph.analysis.measures import Measure, Profile
from alsph.analysis.record import Record
from alsph.arrays import Arrays, FloatArray
from alsph.cases.base import Case
from alsph.errors import ConfigError
from alsph.geometry.domain import Domain
from alsph.geometry.lattice import cell_centres, lattice
from alsph.geometry.particles import Kind, particles

EARLY = 0.05
"""Time [D/U] up to which the transfer to smaller vortices adds less than 0.5 % to the decay rate in 3-D."""


class TaylorGreen(Case):
    """Decaying Taylor-Green vortices in a periodic square or cube of side D; U is the largest initial velocity."""

    name: ClassVar[str] = "taylor_green"
    title: ClassVar[str] = "decaying Taylor-Green vortices in a periodic box"
    from_start: ClassVar[bool] = True
    of_the_start: ClassVar[tuple[str, ...]] = ("perturbation", "seed")
    later_names: ClassVar[tuple[str, ...]] = ("largest error of the kinetic energy over its start",)

    resolution: int = Field(default=50, ge=8, description="particles per side of the box, D/Δx [-]")
    dimensions: Literal[2, 3] = Field(default=2, description="number of space dimensions")
    perturbation: float = Field(
        default=0.0, ge=0, le=0.5, description="random displacement of the initial lattice, at most [Δx]"
    )
    seed: int = Field(default=0, ge=0, description="seed of the random displacement")

    @property
    def default_until(self) -> float:
        """One time unit."""
        return 1.0

    @property
    def space_dimensions(self) -> int:
        """2 or 3, as the parameter `dimensions` says."""
        return self.dimensions

    @property
    def validated(self) -> tuple[float, float, int] | None:
        """What has been compared with an independent solution in 3-D; in 2-D each run is, with the exact one."""
        return (100, 100, 16) if self.dimensions == 3 else None

    def domain(self) -> Domain:
        """Return the periodic unit box."""
        d = self.dimensions
        return Domain([0] * d, [1] * d, [("periodic", "periodic")] * d)

    def particles(self) -> Arrays:
        """Return a lattice, displaced at random if asked for, with the initial velocity and pressure."""
        position = lattice(*[cell_centres(self.resolution, self.particle_spacing)] * self.dimensions)
        shift = self.perturbation * self.particle_spacing
        position = (position + np.random.default_rng(self.seed).uniform(-shift, shift, position.shape)) % 1.0
        initial = self._initial_2d(position) if self.dimensions == 2 else self._initial_3d(position)
        return particles(Kind.FLUID, position, initial["velocity"], pressure=initial["pressure"])

    def exact(self, position: FloatArray, time: float) -> dict[str, FloatArray]:
        """Return the exact ``velocity`` (n, 2) [U] and ``pressure`` (n,) [ρU²].

        Parameters
        ----------
        position
            Points (n, 2) [D].
        time
            Time [D/U].

        Raises
        ------
        ConfigError
            In 3-D, where no exact solution is known.
        """
        if self.dimensions == 3:
            raise ConfigError("dimensions = 3: the exact solution is known in 2-D only")
        decay = np.exp(-8 * np.pi**2 * time / self.reynolds)
        initial = self._initial_2d(position)
        return {"velocity": decay * initial["velocity"], "pressure": decay**2 * initial["pressure"]}

    @staticmethod
    def _initial_2d(position: FloatArray) -> dict[str, FloatArray]:
        x, y = 2 * np.pi * position.T
        velocity = np.stack([-np.cos(x) * np.sin(y), np.sin(x) * np.cos(y)], axis=1)
        return {"velocity": velocity, "pressure": -0.25 * (np.cos(2 * x) + np.cos(2 * y))}

    @staticmethod
    def _initial_3d(position: FloatArray) -> dict[str, FloatArray]:
        x, y, z = 2 * np.pi * position.T
        velocity = np.stack([np.sin(x) * np.cos(y), -np.cos(x) * np.sin(y), 0 * z], axis=1) * np.cos(z)[:, None]
        return {"velocity": velocity, "pressure": (np.cos(2 * x) + np.cos(2 * y)) * (np.cos(2 * z) + 2) / 16}

    def measures(self, run: Record) -> list[Measure]:
        """Return the decay rate of the kinetic energy and, where the solution is known, the error of the field.

        In 2-D the rate is 4νk² at all times, with k = 2π/D. In 3-D it is 6νk² at first, since the initial velocity is
        an eigenfunction of the Laplacian and convection keeps the energy. Vortex stretching then raises it, by a factor
        of 1 + 5/36 (kUt)² where viscosity does not yet count (Taylor and Green, Proc. R. Soc. A 158, 499, 1937); so the
        rate is taken over 0.05 D/U only, with the energy of the start, 1/8.
        """
        time, energy = run.history["time"], run.history.get("kinetic_energy", np.empty(0))
        if self.dimensions == 2:
            rate = averages.decay_rate(time, energy)
            return [
                Measure("decay rate of the kinetic energy, U/D", rate, self._decay_rate, 0.01, "exact solution"),
                Measure("error of the velocity at the last output, L1", self._error(run), 0.0, 0.01, "exact solution"),
            ]
        early = time <= EARLY
        rate = averages.decay_rate(np.r_[0.0, time[early]], np.r_[0.125, energy[early]])
        name = "initial decay rate of the kinetic energy, U/D"
        measures = [Measure(name, rate, self._decay_rate, 0.03, "exact initial rate")]
        for profile in self.profiles(run) if time.size else ():
            known, expected = profile.reference
            error = (
                np.abs(np.interp(known, time, energy) - expected).max(where=known >= time[0], initial=0) / expected[0]
            )
            name = "largest error of the kinetic energy over its start"
            measures.append(Measure(name, float(error), 0.0, 0.02, profile.source))
        return measures

    def profiles(self, run: Record) -> list[Profile]:
        """Return the kinetic energy over time, where it is known."""
        time = run.history["time"]
        if self.dimensions == 2:
            exact = time, 0.25 * np.exp(-self._decay_rate * time)
            source = "exact solution"
        elif self.reynolds == 100:
            known, energy, _ = reference.table("taylor_green_3d_Re100.csv")
            reached = known <= time.max(initial=0.0)
            exact = known[reached], energy[reached]
            source = "Fourier spectral method"
        else:
            return []
        computed = time, run.history.get("kinetic_energy", np.empty(0))
        return [Profile("kinetic energy", ("$tU/D$", r"$E\,/\,\rho U^2 D^d$"), computed, exact, source)]

    @property
    def _decay_rate(self) -> float:
        """Exact decay rate of the kinetic energy [U/D]: at all times in 2-D, at first in 3-D."""
        return float(2 * self.dimensions * (2 * np.pi) ** 2 / self.reynolds)

    def _error(self, run: Record) -> float:
        """Mean modulus of the error of the velocity over that of the velocity, at the last output."""
        if not run.times.size:
            return float("nan")
        last = run.snapshot()
        return averages.error_norms(last.velocity, self.exact(last.position, last.time)["velocity"])["l1"]
