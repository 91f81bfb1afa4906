"""What drives a flow: its domain and bodies, the body force, and rules of place and time."""

from __future__ import annotations

import ast
import math
from abc import abstractmethod
from collections.abc import Container
from functools import cached_property
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, model_validator

from alsph.arrays import FloatArray
from alsph.cases.dimensional import Dimensional
from alsph.cases.method import Method
from alsph.engine.prescribed import WORDS, Rule, asked, asymmetry
from alsph.errors import ConfigError
from alsph.expressions import VectorExpression
from alsph.geometry.domain import Domain, SolidBody
from alsph.text import shown

RULES = {
    "inflow": "inlet_velocity",
    "forcing": "driving_force",
    "sliding": "surface_velocity",
    "motion": "body_motion",
}
"""What a case may prescribe by place and time: a method in Python, and the parameter that holds an expression."""

SWINGS, SHORT = 200, 1e-3
"""Number of times at which it is asked how a rule swings, and the step by which its rate is told [D/U]."""

LEAST_RATE = 1e-6
"""Rate below which nothing swings [U²/D, U³/D²]."""


class Driven(Dimensional):
    """The part of :class:`alsph.cases.Case` that says what pushes the fluid: walls, inlets, forces.

    What depends on place and time is prescribed by rules: methods of a case, or parameters that hold expressions.
    """

    name: ClassVar[str]

    inlet_velocity: str | None = Field(
        default=None,
        description="velocity at the inlets by place and time, as '1 + 0.2*sin(2*pi*t/5), 0'; none: the case's own [U]",
    )
    driving_force: str | None = Field(
        default=None, description="a further body force per unit mass by place and time, as '0.1*sin(t), 0' [U²/D]"
    )
    surface_velocity: str | None = Field(
        default=None,
        description="velocity of the surfaces of bodies in place, by place and time, along them, as "
        "'-2*y, 2*(x - 4)' of a circle about (4, 0) that turns [U]",
    )

    body_motion: str | None = Field(
        default=None,
        description="how far bodies have come by time, in 2-D also how far they have turned, as "
        "'-0.8*sin(2*pi*t/5), 0, 0.1*t'; x and y are those of their centres at the start [D, rad]",
    )

    @model_validator(mode="after")
    def _expressions_are_vectors(self) -> Self:
        for name in self._expressions:
            method = next(method for method, parameter in RULES.items() if parameter == name)
            if self._overrides(method):
                raise ConfigError(f"{name}: {type(self).__name__} says that itself, by its method `{method}`")
        if self.inlet_velocity is not None and not any(self.checked_domain.inlets()):
            raise ConfigError(f"inlet_velocity = {shown(self.inlet_velocity)}: {self.name} has no inlet")
        if self.body_motion is not None and not self.moved_bodies:
            raise ConfigError(f"body_motion = {shown(self.body_motion)}: {self.name} has no body to move")
        if self.surface_velocity is not None and not self.sliding_bodies:
            raise ConfigError(f"surface_velocity = {shown(self.surface_velocity)}: {self.name} has no body in place")
        self.refuse_what_is_not_symmetric(self._expressions)
        return self

    @property
    def default_until(self) -> float:
        """End time of a run that is given none [D/U]: by default twice the longest side of the domain over U."""
        return 2.0 * max(self.checked_domain.size)

    def refuse_what_is_not_symmetric(self, names: Container[str]) -> None:
        """Refuse rules that are not their own mirror images where a part up to planes of symmetry is computed.

        Parameters
        ----------
        names
            Parameters, or names of methods, that the rules stand in which are looked at.
        """
        for name, rule in self.rules.items() if self.planes_of_symmetry else ():
            parameter = RULES[name]
            if parameter not in names and name not in names:
                continue
            for axis in self.planes_of_symmetry:
                found = asymmetry(name, rule, self.checked_domain, self.default_until, axis, self.moved_centres)
                if found:
                    text = getattr(self, parameter)
                    given = f"{type(self).__name__}.{name}" if text is None else f"{parameter} = {shown(text)}"
                    told = f"the {WORDS[name]} is not symmetric in {'xyz'[axis]} = 0, up to which the flow is computed"
                    raise ConfigError(self.symbols(f"{given}: {told}: {found}"))

    @property
    def planes_of_symmetry(self) -> tuple[int, ...]:
        """Axes normal to the planes through 0 that end what is computed, beyond which the flow is its mirror image."""
        return ()

    @property
    def space_dimensions(self) -> int:
        """Number of space dimensions, 2 or 3."""
        return self.in_space

    @abstractmethod
    def domain(self) -> Domain:
        """Return the domain and what closes its sides."""

    def bodies(self) -> list[SolidBody]:
        """Return the solid bodies."""
        return []

    @cached_property
    def checked_domain(self) -> Domain:
        """What :meth:`domain` gives, which in older cases is a table."""
        domain = Domain.of(self.domain())
        if domain.dimensions != self.space_dimensions:
            told = f"its domain is in {domain.dimensions}-D and the case in {self.space_dimensions}-D"
            raise ConfigError(f"{self.name}: {told}; correct `domain` or `space_dimensions`")
        return domain

    @cached_property
    def checked_bodies(self) -> list[SolidBody]:
        """What :meth:`bodies` gives, which in older cases are tables."""
        return [SolidBody.of(body) for body in self.bodies()]

    @property
    def moved_bodies(self) -> list[str]:
        """Names of the bodies that :meth:`motion` moves."""
        told = [body.name for body in self.checked_bodies if body.moves and body.velocity is None and not body.rigid]
        free = {body.name for body in self.checked_bodies if body.rigid}
        return told or [name for name in self.coefficient_bodies if name not in free]

    @property
    def sliding_bodies(self) -> list[str]:
        """Names of the bodies whose surface :meth:`sliding` moves: those in place."""
        return [body.name for body in self.checked_bodies if not body.moves]

    @property
    def moved_centres(self) -> FloatArray:
        """Their centres at the start (b, d) [D]."""
        moved = self.moved_bodies
        centres = [body.center for body in self.checked_bodies if body.name in moved]
        return np.array(centres, float).reshape(-1, self.space_dimensions)

    @property
    def coefficient_bodies(self) -> list[str]:
        """Names of the bodies that drag and lift are those of, all together."""
        return []

    def body_force(self) -> list[float]:
        """Return the body force per unit mass (d,) [U²/D]."""
        return [0.0] * self.space_dimensions

    def inflow(self, position: FloatArray, time: float) -> ArrayLike | None:
        """Return the velocity of the inlet particles, which is asked for before every step.

        A case without this method gives them their velocities in :meth:`particles`: they keep them and hand them on to
        those that follow, unless ``inlet_velocity`` is given.

        Parameters
        ----------
        position
            Any positions (m, d) [D].
        time
            Any time [D/U].

        Returns
        -------
        array or None
            Velocities (m, d), or one (d,), by position and time alone [U]; None: those that they have.
        """
        return self._given("inlet_velocity", position, time)

    def forcing(self, position: FloatArray, time: float) -> ArrayLike | None:
        """Return a body force per unit mass beside :meth:`body_force`, which is asked for in every step.

        By default it is ``driving_force``, if that is given. The time step does not follow it.

        Parameters
        ----------
        position
            Any positions (n, d) [D].
        time
            Any time [D/U].

        Returns
        -------
        array
            Forces (n, d), or one (d,), by position and time alone [U²/D].
        """
        return self._given("driving_force", position, time)

    def body_force_at(self, position: FloatArray, time: float) -> FloatArray:
        """Return the whole body force per unit mass (n, d) at positions (n, d) [D] and a time [D/U]: [U²/D]."""
        constant = np.broadcast_to(np.array(self.body_force(), float), position.shape)
        rule = self.rules.get("forcing")
        changing = asked("forcing", rule, position, time) if rule else None
        return constant if changing is None else constant + changing

    def sliding(self, position: FloatArray, time: float) -> ArrayLike | None:
        """Return the velocity of the surfaces of bodies that stay in place, which is asked for in every step.

        The positions are those of the surface above each solid particle.
        By default it is ``surface_velocity``, if that is given. It takes the place of the ``velocity`` of those of
        :meth:`bodies` that do not move. Arguments and velocities are as those of :meth:`inflow`.
        """
        return self._given("surface_velocity", position, time)

    def motion(self, position: FloatArray, time: float) -> ArrayLike | None:
        """Return how far bodies have come and turned, which is asked for in every step.

        By default it is ``body_motion``, if that is given. It moves those of :meth:`bodies` that say ``moves=True`` and
        ``velocity=None``, and if none does those whose forces are reported.

        Parameters
        ----------
        position
            Centres of bodies at the start (b, d) [D].
        time
            Any time [D/U], also a little before 0.

        Returns
        -------
        array
            Displacements (b, d), or (d,) for all, from where they are drawn, with what it gives at the time 0 taken off
            [D]; or with the angles behind them that they have turned about their centres, (b, 3) in 2-D and as rotation
            vectors (b, 6) in 3-D [rad].
        """
        return self._given("body_motion", position, time)

    def swing_period(self, name: str) -> float:
        """Return the mean period of a ``motion`` or ``forcing`` that swings [D/U]; infinite if it does not.

        It is 2π times the rms of what it swings by, velocity or force, over that of its rate, where the first body is.
        """
        centres = self.moved_centres if name == "motion" else np.array([self.checked_bodies[0].center], float)
        times = np.linspace(0, 1, SWINGS) * self.default_until + 2 * SHORT
        steps = (-SHORT, 0.0, SHORT)
        found = [[asked(name, self.rules[name], centres, time + step) for step in steps] for time in times]
        before, now, after = np.moveaxis(np.array(found)[:, :, 0, : self.space_dimensions], 1, 0)
        swing, rate = now, (after - before) / (2 * SHORT)
        if name == "motion":
            swing, rate = rate, (after - 2 * now + before) / SHORT**2
        size, change = (float(np.sqrt((each**2).sum(axis=1).mean())) for each in (swing - swing.mean(axis=0), rate))
        return 2 * math.pi * size / change if change > LEAST_RATE else math.inf

    def _given(self, name: str, position: FloatArray, time: float) -> FloatArray | None:
        expression = self._expressions.get(name)
        return expression(position, time) if expression else None

    @cached_property
    def _expressions(self) -> dict[str, VectorExpression]:
        """The vectors that are given as expressions, by parameter."""
        numbers = {
            name: float(value)
            for name in type(self).model_fields
            if name not in Method.model_fields
            and isinstance(value := getattr(self, name), int | float)
            and not isinstance(value, bool)
        }
        found = {}
        for name in RULES.values():
            if (text := getattr(self, name)) is not None:
                try:
                    components = self._components(text) if name == "body_motion" else self.space_dimensions
                    found[name] = VectorExpression(text, components, numbers)
                except ValueError as error:
                    raise ConfigError(f"{name} = {shown(text)}: {error}") from None
        return found

    def _components(self, text: str) -> int:
        """Return the number of components of a motion: with rotation, if more than the directions are written."""
        try:
            whole = ast.parse(text.strip(), mode="eval").body
        except (SyntaxError, ValueError, MemoryError, RecursionError):
            return self.space_dimensions
        written = len(whole.elts) if isinstance(whole, ast.Tuple) else 1
        turns = 3 if self.space_dimensions == 2 else 6
        return turns if written == turns else self.space_dimensions

    @property
    def rules(self) -> dict[str, Rule]:
        """What the case prescribes by functions of place and time: ``inflow``, ``forcing``, ``sliding``, ``motion``."""
        return {
            name: getattr(self, name)
            for name, parameter in RULES.items()
            if self._overrides(name) or getattr(self, parameter) is not None
        }

    @property
    def is_driven(self) -> bool:
        """Whether an expression, not of the class's own, makes the flow another one than its references are of."""
        return bool(self._driven_by)

    @property
    def is_moved(self) -> bool:
        """Whether an expression, not of the class's own, moves bodies."""
        return "body_motion" in self._driven_by

    @property
    def _driven_by(self) -> list[str]:
        return [name for name in self._expressions if getattr(self, name) != type(self).model_fields[name].default]

    @classmethod
    def _overrides(cls, name: str) -> bool:
        return getattr(cls, name) is not getattr(Driven, name)
