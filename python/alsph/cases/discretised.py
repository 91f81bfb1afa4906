"""A flow at a resolution: the engine's settings, and what follows of them before anything is computed."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from alsph.arrays import FloatArray
from alsph.cases import answers
from alsph.cases.driven import RULES, Driven
from alsph.cases.method import DIFFUSION, SCHEMES, goes_with
from alsph.engine.core import bytes_per_particle, time_step_limits
from alsph.errors import ConfigError
from alsph.geometry.domain import SolidBody
from alsph.memory import check

VELOCITY_LIMIT = 50.0
"""Speed [U] that no flow here comes near: a particle beyond it tells of a breakdown."""


LONG = 5.0
"""Way [D] that pressure travels in a period of a body that oscillates: with less its force is not that of an
incompressible fluid. Where waves go to and fro, it is that over the domain (docs/reliability.md)."""

ACTING = {
    **dict.fromkeys(("max_iterations", "tolerance", "viscous_theta", "time_step_safety"), ("alsph",)),
    **dict.fromkeys(("projection_sweeps", "sweep_weights", "sweep_pressure"), set(SCHEMES) - {*DIFFUSION}),
}
"""The schemes in which a parameter that all take has an effect, of those that have none in some."""


class Discretised(Driven):
    """The part of :class:`alsph.cases.Case` that says how fine a flow is computed, how fast and at what cost."""

    velocity_max: ClassVar[float] = 1.0
    """Expected largest velocity in U, for estimates of the time step."""

    resolution: int = Field(default=20, ge=8, description="particles per reference length, D/Δx [-]")

    @property
    def particle_spacing(self) -> float:
        """Particle spacing Δx [D]."""
        return 1.0 / self.resolution

    def whole(self, lengths: ArrayLike, count: int = 1) -> FloatArray:
        """Return lengths to the nearest multiple of `count` particle spacings [D]."""
        return np.asarray(count * np.rint(np.asarray(lengths) / count * self.resolution) / self.resolution)

    def whole_cells(self, name: str, length: float) -> int:
        """Return how many particle spacings a `length` [D] is; it must be a whole number of them.

        Raises
        ------
        ValueError
            If it is not, with the lengths next to it that are.
        """
        cells = length * self.resolution
        if abs(cells - round(cells)) > 1e-6:
            near = [f"{count / self.resolution:.6g}" for count in (np.floor(cells), np.ceil(cells)) if count > 0]
            raise ValueError(
                f"{name} = {length:g}: not a whole number of particle spacings (1/{self.resolution}); "
                f"use {' or '.join(near)}"
            )
        return round(cells)

    @property
    def without_effect(self) -> list[str]:
        """Parameters that are not as they are by default, and that nothing depends on with the scheme."""
        scheme = self.scheme or "alsph"
        return [name for name, schemes in ACTING.items() if scheme not in schemes and self._is_chosen(name)]

    def _is_chosen(self, name: str) -> bool:
        """Whether a parameter has another value than by default with the scheme."""
        default = goes_with(self.scheme).get(name, type(self).model_fields[name].default)
        return getattr(self, name) not in (None, default)

    def settings(self) -> dict[str, Any]:
        """Return the engine's settings (see docs/architecture.md)."""
        return self.method_settings() | {
            "dimensions": self.space_dimensions,
            "velocity_limit": VELOCITY_LIMIT,
            "particle_spacing": self.particle_spacing,
            "density": 1.0,
            "kinematic_viscosity": self.kinematic_viscosity,
            "body_force": answers.vector(self, "body_force", self.space_dimensions, self.body_force),
            "time_step": self.largest_time_step * self.particle_spacing,
            "domain": self.checked_domain.settings(),
            "bodies": [body.settings() | self._ruled(body) for body in self.checked_bodies],
        }

    def _ruled(self, body: SolidBody) -> dict[str, Any]:
        """Return what is to be changed in the settings of a body that a rule tells of."""
        if "motion" in self.rules and body.name in self.moved_bodies:
            return {"velocity": None, "moves": True}
        if body.moves and body.velocity is None and not body.rigid:
            told = "give it a velocity, make it rigid, or say how it moves by `motion` or `body_motion`"
            raise ConfigError(f"{self.name}: body '{body.name}' moves, and nothing says how; {told}")
        return {"velocity": None} if "sliding" in self.rules and body.name in self.sliding_bodies else {}

    @property
    def expected_velocity(self) -> float:
        """Largest velocity that is expected [U]."""
        return self.velocity_max

    @property
    def largest_time_step(self) -> float:
        """Upper bound of the time step, which all steps have that are not adaptive [Δx/U]."""
        if self.time_step or not self.courant:
            return self.time_step or math.nan
        return self.courant / (1.0 if self.adaptive_time_step else self.expected_velocity)

    def memory(self) -> float:
        """Return the estimated peak memory of a simulation [bytes]."""
        return bytes_per_particle(self.settings()) * self.particle_estimate()

    def time_step_limits(self) -> dict[str, float]:
        """Return the bounds of ΔtU/Δx at the expected largest velocity; those that do not apply are infinite.

        ``courant`` is the one asked for, ``penalty``, ``acoustic``, ``viscous`` and ``body_force`` are limits of
        stability.
        """
        limits = time_step_limits(self.settings(), self.expected_velocity)
        names = ("courant", "penalty", "acoustic", "viscous", "body_force")
        return {name: limits[name] / self.particle_spacing for name in names}

    def expected_time_step(self) -> float:
        """Return the time step at the expected largest velocity [Δx/U]."""
        if not self.adaptive_time_step:
            return self.largest_time_step
        limits = self.time_step_limits()
        limits["penalty"] *= self.time_step_safety
        return min(self.largest_time_step, *limits.values())

    def expected_penalty_constant(self) -> float:
        """Return C_BV = (c/u_max)² at the expected largest velocity, c the speed of sound of penalty or scheme.

        It is infinite with a Poisson equation for the pressure.
        """
        if self.is_projection:
            return math.inf
        if self.scheme == "explicit_isph":
            share = self.expected_time_step() / self.time_step_limits()["acoustic"]
            return float((share * self.settings()["scheme"]["mach_number"]) ** -2)
        if self.is_weakly_compressible:
            return float((self.settings()["scheme"]["sound_speed"] / self.expected_velocity) ** 2)
        if self.penalty_constant is not None:
            return self.penalty_constant
        largest = time_step_limits(self.settings(), self.expected_velocity)["lambda_max"]
        return (self.expected_time_step() * self.expected_velocity) ** -2 / largest

    @cached_property
    def slow_pressure(self) -> list[str]:
        """Remarks on expressions by which a body swings, or a force on it, faster than the pressure can follow."""
        if not self.coefficient_bodies or self.is_projection or self.checked_domain.meets_air:
            return []
        speed, side = self.expected_velocity * self.expected_penalty_constant() ** 0.5, max(self.checked_domain.size)
        found = []
        for name in ("motion", "forcing"):
            if RULES[name] not in self._driven_by or not self.checked_bodies:
                continue
            rings = self.is_weakly_compressible
            least = LONG if name == "motion" and not rings else (2 if name == "motion" else 4) * side
            if (way := speed * self.swing_period(name)) < least:
                told = f"{RULES[name]} swings while it travels {way:.2g} D; with less than {least:.3g} D forces err"
                known = "by 10 % and more" if name == "motion" else "by a tenth to several times their size"
                remedy = "a larger sound_speed" if rings else "a smaller courant"
                found.append(f"slow pressure: {told} {known}; take {remedy}, or isph")
        return found

    def time_step_warning(self) -> str | None:
        """Return a warning if steps are to be taken above the stability law, which it names."""
        limits = self.time_step_limits()
        binding = min(limits, key=lambda name: limits[name])
        step = self.largest_time_step
        if step <= limits[binding] or (self.adaptive_time_step and self.adaptive_until is None):
            return None
        law = "courant limit" if binding == "courant" else f"{binding.replace('_', ' ')} stability limit"
        return self.symbols(
            f"time_step = {step:.4g} lies above the {law} "
            f"{limits[binding]:.4g} (ΔtU/Δx at u_max = {self.expected_velocity:g} U); "
            "expect divergence: lower time_step or switch adaptive_time_step on"
        )

    def particle_estimate(self) -> int:
        """Return about how many particles :meth:`particles` makes, without making them.

        By default, those that fill the domain, the buffers of its inlets and outlets, and walls beyond sides that
        nothing else closes.
        """
        beyond = {"inlet": self.buffer_columns, "outlet": self.buffer_columns, "none": self.support_layers}
        domain = self.checked_domain
        columns = [
            length / self.particle_spacing + sum(beyond.get(side, 0) for side in sides)
            for length, sides in zip(domain.size, domain.boundaries, strict=True)
        ]
        return round(math.prod(columns))

    def check_memory(self, threads: int | None = None) -> None:
        """Refuse what would not fit into the memory that is free, as :meth:`build` does."""
        try:
            particles, memory = self.particle_estimate(), self.memory()
            check(f"resolution = {self.resolution}", particles, memory / max(particles, 1), threads)
        except OverflowError:
            raise ConfigError(
                f"{self.name}: more particles than can be counted; lower the resolution or the size"
            ) from None
