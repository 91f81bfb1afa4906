"""Bodies that the fluid moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from alsph.arguments import number
from alsph.errors import ConfigError
from alsph.geometry.points import numbers
from alsph.text import shown

ADDED_MASS = 1.5
"""Mass that a body is taken to drag along, over that of the fluid in its place, if it is not said: that of a cylinder
between walls twice its size. The motion is stable from half of the right one, less the body's mass, upwards."""


@dataclass(frozen=True)
class Rigid:
    """What moves freely: M dV/dt = F, I dΩ/dt + Ω × IΩ = T, with the fluid's force and torque and those given here.

    Parameters
    ----------
    mass : float
        Mass M [ρD³, in 2-D ρD² a length D].
    inertia : float or array of shape (3, 3)
        Moment of inertia about the body's centre, which is its centre of mass [ρD⁵, in 2-D ρD⁴ a length D]; in 3-D the
        tensor, as it is at the start.
    displaced : float
        Mass of the fluid in its place, by which what it drags along is estimated, see `added_mass`.
    force : sequence of float, optional
        A constant force, for instance its weight less its buoyancy where the fluid has no weight [ρU²D², in 2-D ρU²D].
    stiffness, damping : sequence of float, optional
        Of springs and dampers to where it was at the start, along each direction [ρU²D, ρUD²; in 2-D ρU², ρUD].
    free : sequence of bool, optional
        Along which directions (d,) it can move, and then about which axes it can turn (1,), in 3-D (3,); all if not
        given.
    added_mass, added_inertia : float, optional
        About the mass, and the moment of inertia, of the fluid that it drags along. They make no difference to smooth
        motion; an error of the acceleration falls in a step to |added - right| / (own + added), and a body that is
        lighter than the fluid needs them. By default 1.5 `displaced`, and that times the square of half an extent that
        a disc or ball of that mass has.

    Raises
    ------
    ConfigError
        If there is no such body.

    Examples
    --------
    >>> Rigid(mass=0.4, inertia=0.05, displaced=0.785).settings(2)["free"]
    [True, True, True]
    """

    mass: float
    inertia: ArrayLike
    displaced: float
    force: Sequence[float] = ()
    stiffness: Sequence[float] = ()
    damping: Sequence[float] = ()
    free: Sequence[bool] = ()
    added_mass: float | None = None
    added_inertia: float | None = None

    def settings(self, dimensions: int) -> dict[str, Any]:
        """Return it as the engine takes it (docs/architecture.md).

        Raises
        ------
        ConfigError
            If it is no body in so many dimensions.
        """
        turns = 1 if dimensions == 2 else 3
        vectors = {}
        for name in ("force", "stiffness", "damping"):
            given = getattr(self, name)
            vectors[name] = self._vector(name, given if len(np.atleast_1d(given)) else [0.0] * dimensions, dimensions)
        free = list(np.atleast_1d(np.asarray(self.free, object))) or [True] * (dimensions + turns)
        if len(free) != dimensions + turns or not all(isinstance(each, bool | np.bool_) for each in free):
            told = f"must be {dimensions} directions and {turns} axes, True or False each"
            raise ConfigError(f"rigid: free = {shown(self.free)}: {told}")
        if not any(free):
            raise ConfigError(f"rigid: free = {shown(self.free)}: a body that cannot move at all needs no `rigid`")
        for name in ("stiffness", "damping"):
            if min(vectors[name]) < 0:
                raise ConfigError(f"rigid: {name} = {shown(getattr(self, name))}: must not be negative")
        own = {name: self._number(name, above=0.0) for name in ("mass", "displaced")}
        length = (own["displaced"] / np.pi) ** 0.5 if dimensions == 2 else (own["displaced"] * 0.75 / np.pi) ** (1 / 3)
        mass = ADDED_MASS * own["displaced"] if self.added_mass is None else self._number("added_mass")
        inertia = 0.25 * mass * length**2 if self.added_inertia is None else self._number("added_inertia")
        return vectors | {
            "mass": own["mass"],
            "inertia": self._vector("inertia", np.ravel(self.inertia), turns**2),
            "free": [bool(each) for each in free],
            "added_mass": mass,
            "added_inertia": inertia,
        }

    def _number(self, name: str, above: float | None = None) -> float:
        found = number(f"rigid: {name}", getattr(self, name), above, finite=True)
        if found < 0:
            raise ConfigError(f"rigid: {name} = {shown(getattr(self, name))}: must not be negative")
        return found

    def _vector(self, name: str, given: object, count: int) -> list[float]:
        vector = numbers(given)
        if vector.shape != (count,) or not np.isfinite(vector).all():
            raise ConfigError(f"rigid: {name} = {shown(given)}: must be {count} finite numbers")
        return [float(each) for each in vector]
