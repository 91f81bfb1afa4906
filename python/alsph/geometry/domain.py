"""The domain of a flow, what closes its sides, and the solid bodies in it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields
from typing import Any, Literal, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray

from alsph.arrays import AXES, FloatArray
from alsph.errors import ConfigError
from alsph.geometry.points import checked_point, numbers
from alsph.geometry.rigid import Rigid
from alsph.parameters import choose, suggest
from alsph.text import shown

Boundary = Literal["none", "slip", "periodic", "inlet", "outlet", "air"]
"""What closes a side: nothing (but solid particles beyond it), a free-slip wall, the opposite side, open ends, or
the air beyond a free surface."""

Made = TypeVar("Made", "Domain", "SolidBody")


@dataclass(frozen=True)
class Domain:
    """The box that a flow is computed in, and what closes each of its sides.

    Parameters
    ----------
    lower, upper : sequence of float, shape (d,)
        Its corners [D].
    boundaries : sequence of pairs
        What closes the lower and the upper side along x, y and in 3-D z: ``none``, where solid particles lie beyond
        it, ``slip``, a free-slip wall, ``periodic``, both sides, ``inlet`` or ``outlet``, whose buffers lie outside, or
        ``air``, beyond a free surface: what crosses it is lost.

    Raises
    ------
    ConfigError
        If there is no such box.

    Examples
    --------
    >>> Domain((0, -2), (9, 2), [("inlet", "outlet"), ("slip", "slip")]).size
    (9.0, 4.0)
    """

    lower: Sequence[float]
    upper: Sequence[float]
    boundaries: Sequence[Sequence[Boundary]]

    def __post_init__(self) -> None:
        """Check the box and its sides."""
        lower = numbers(self.lower)
        if lower.shape not in ((2,), (3,)):
            raise ConfigError(f"domain.lower = {shown(self.lower)}: must be two or three finite numbers [D]")
        upper = checked_point("domain.upper", self.upper, len(lower))
        for axis, low, high in zip(AXES, lower, upper, strict=False):
            if not low < high:
                raise ConfigError(f"domain: lower = {low:g} does not lie below upper = {high:g} along {axis}")
        _keep(self, "lower", tuple(lower.tolist()))
        _keep(self, "upper", tuple(upper.tolist()))
        _keep(self, "boundaries", _checked_sides(self.boundaries, len(lower)))

    @classmethod
    def of(cls, given: Domain | Mapping[str, Any]) -> Domain:
        """Return a domain that is given as one, or as the table that cases had in its place in older versions."""
        return _made(cls, given)

    @property
    def dimensions(self) -> int:
        """Number of space dimensions, 2 or 3."""
        return len(self.lower)

    @property
    def size(self) -> tuple[float, ...]:
        """Length along each direction [D]."""
        return tuple(high - low for low, high in zip(self.lower, self.upper, strict=True))

    @property
    def periodic(self) -> NDArray[np.bool_]:
        """Which directions (d,) are periodic."""
        return np.array(["periodic" in pair for pair in self.boundaries])

    @property
    def is_open(self) -> bool:
        """Whether fluid enters or leaves through a side."""
        return any(side in ("inlet", "outlet") for pair in self.boundaries for side in pair)

    @property
    def meets_air(self) -> bool:
        """Whether a side is open to the air."""
        return any("air" in pair for pair in self.boundaries)

    def inlets(self) -> Iterator[tuple[int, int, float]]:
        """Yield axis, sign of the inward normal and plane of each side that is an inlet."""
        for axis, sides in enumerate(self.boundaries):
            for side, sign, plane in zip(sides, (1, -1), (self.lower[axis], self.upper[axis]), strict=True):
                if side == "inlet":
                    yield axis, sign, plane

    def beyond(self, kind: Boundary, points: FloatArray) -> FloatArray:
        """Return how far points (m, d) lie beyond sides of that kind (m,), negative inside; -inf without any [D]."""
        found = np.full(len(points), -np.inf)
        for axis, sides in enumerate(self.boundaries):
            for side, sign, plane in zip(sides, (1, -1), (self.lower[axis], self.upper[axis]), strict=True):
                if side == kind:
                    found = np.maximum(found, sign * (plane - points[:, axis]))
        return found

    def wrapped(self, points: FloatArray) -> FloatArray:
        """Return points (m, d) with those beyond periodic sides at the same places within."""
        lower = np.array(self.lower)
        beyond = self.periodic & ((points < lower) | (points > np.array(self.upper)))
        return np.where(beyond, lower + (points - lower) % self.size, points)

    def contains(self, points: FloatArray, margin: float = 0.0) -> NDArray[np.bool_]:
        """Return which points (m, d) lie in it, or at most `margin` beyond it [D]; d may be fewer than its own."""
        lower, upper = (np.array(corner[: points.shape[1]]) for corner in (self.lower, self.upper))
        inside = (points >= lower - margin) & (points <= upper + margin)
        return np.asarray(inside.all(axis=1))

    def settings(self) -> dict[str, Any]:
        """Return it as the engine takes it (docs/architecture.md)."""
        return {
            "lower": list(self.lower),
            "upper": list(self.upper),
            "boundaries": [list(pair) for pair in self.boundaries],
        }


@dataclass(frozen=True)
class SolidBody:
    """A body or wall: the solid particles that have its place in the list of a case's bodies.

    Parameters
    ----------
    name : str
        Name, as in ``NAME_pressure_force_x``.
    center : sequence of float, shape (d,)
        Point that its torques are taken about [D].
    velocity : sequence of float, shape (d,), optional
        Velocity of its particles [U]; at rest if not given. None: the velocities that `Case.particles` gives them; of
        a body that moves those of its motion.
    moves : bool
        Whether its particles go along with that velocity; those of a plate that slides in its own plane need not.
        Without a velocity the body moves as :meth:`alsph.cases.driven.Driven.motion` says, or freely if it is `rigid`.
    belt : (from, to), optional
        Coordinates along its velocity between which the particles of a body that moves go round [D], as on a belt.
    rigid : Rigid, optional
        What the body is, if the fluid moves it; it `moves` then, and has no `velocity`.

    Raises
    ------
    ConfigError
        If there is no such body.

    Examples
    --------
    >>> SolidBody("lid", (0.5, 0.5), velocity=(1, 0)).velocity
    (1.0, 0.0)
    """

    name: str
    center: Sequence[float]
    velocity: Sequence[float] | None = ()
    moves: bool = False
    belt: Sequence[float] | None = None
    rigid: Rigid | None = None

    def __post_init__(self) -> None:
        """Check the name, the vectors, and that what they are of can be."""
        name = self.name
        if not isinstance(name, str) or not name.strip() or not name.isprintable() or "," in name:
            raise ConfigError(f"body {shown(name)}: its name must be a text without commas and line breaks")
        center = numbers(self.center)
        if center.shape not in ((2,), (3,)):
            raise ConfigError(f"body '{name}': center = {shown(self.center)}: must be two or three finite numbers [D]")
        _keep(self, "center", tuple(center.tolist()))
        if self.velocity is not None:
            given = (0.0,) * len(center) if isinstance(self.velocity, tuple) and not self.velocity else self.velocity
            velocity = checked_point(f"body '{name}': velocity", given, len(center))
            _keep(self, "velocity", tuple(velocity.tolist()))
        if self.rigid is not None:
            if not isinstance(self.rigid, Rigid):
                raise ConfigError(
                    f"body '{name}': rigid = {shown(self.rigid)}: must be a Rigid(mass, inertia, displaced)"
                )
            self.rigid.settings(len(center))
            _keep(self, "moves", True)
            _keep(self, "velocity", None)
        if not isinstance(self.moves, bool):
            raise ConfigError(f"body '{name}': moves = {shown(self.moves)}: must be True or False")
        if self.belt is not None:
            belt = numbers(self.belt)
            if belt.shape != (2,) or not belt[0] < belt[1] or not self.moves or self.velocity is None:
                told = "must be two numbers, the lower one first, of a body that moves with a velocity"
                raise ConfigError(f"body '{name}': belt = {shown(self.belt)}: {told}")
            _keep(self, "belt", tuple(belt.tolist()))

    @classmethod
    def of(cls, given: SolidBody | Mapping[str, Any]) -> SolidBody:
        """Return a body that is given as one, or as the table that cases had in its place in older versions."""
        return _made(cls, given)

    def settings(self) -> dict[str, Any]:
        """Return it as the engine takes it (docs/architecture.md)."""
        velocity = None if self.velocity is None else list(self.velocity)
        belt = {} if self.belt is None else {"belt": list(self.belt)}
        free = {} if self.rigid is None else {"rigid": self.rigid.settings(len(self.center))}
        return {"name": self.name, "velocity": velocity, "moves": self.moves, "center": list(self.center)} | belt | free


def _keep(record: object, name: str, value: object) -> None:
    """Set what has been checked in a frozen record that is being made."""
    object.__setattr__(record, name, value)


def _checked_sides(given: Any, dimensions: int) -> tuple[tuple[Boundary, ...], ...]:
    pairs = list(given) if isinstance(given, list | tuple) else []
    if len(pairs) != dimensions or not all(isinstance(pair, list | tuple) and len(pair) == 2 for pair in pairs):
        example = '[("inlet", "outlet"), ("slip", "slip")]' if dimensions == 2 else '[("periodic", "periodic")] * 3'
        told = f"must be {dimensions} pairs, the lower and the upper side of each direction, as {example}"
        raise ConfigError(f"domain.boundaries = {shown(given)}: {told}")
    for axis, pair in zip(AXES, pairs, strict=False):
        for side in pair:
            choose(f"domain.boundaries along {axis}", side, get_args(Boundary))
        if (pair[0] == "periodic") != (pair[1] == "periodic"):
            raise ConfigError(f"domain.boundaries along {axis} = {shown(pair)}: periodic must be both sides, or none")
    return tuple(tuple(pair) for pair in pairs)


def _made(kind: type[Made], given: object) -> Made:
    """Return a domain or body, made of a table of its fields if it is that."""
    if isinstance(given, kind):
        return given
    known = {each.name: each.default is MISSING for each in fields(kind)}
    if not isinstance(given, Mapping):
        raise ConfigError(f"{shown(given)}: must be a {kind.__name__}({', '.join(known)})")
    for name in given:
        if name not in known:
            raise ConfigError(f"{kind.__name__}: {shown(name)} is unknown; {suggest(str(name), known)}")
    if missing := [name for name, needed in known.items() if needed and name not in given]:
        raise ConfigError(f"{kind.__name__}: lacks {', '.join(missing)}; it is {kind.__name__}({', '.join(known)})")
    return kind(**given)
