"""What is prescribed by rules of place and time, by what they gave last they are known again, and what inlets let in.

The rules, by name: ``inflow``, the velocity of the inlet particles [U]; ``forcing``, a body force per unit mass beside
the constant one [U²/D]; ``sliding``, the velocity of the surfaces of bodies that stay in place [U]; ``motion``, how far
bodies have come [D] and turned [rad], whose centres at the start are the positions.
"""

import contextlib
import hashlib
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from alsph.arrays import FloatArray
from alsph.errors import ConfigError
from alsph.geometry.domain import Domain
from alsph.geometry.lattice import lattice
from alsph.geometry.particles import neighbour_tree

Rule = Callable[[FloatArray, float], ArrayLike | None]
"""Vectors (m, d), or one (d,), from positions (m, d) [D] and the time [D/U].

None, of an inflow, leaves the inlet particles the velocities that they have.
"""

WORDS = {
    "inflow": "inflow",
    "forcing": "body force",
    "sliding": "velocity of surfaces",
    "motion": "motion of bodies",
}
"""What the rules prescribe."""

FAILED = ": the function failed"
"""What the note on an exception says that a rule has raised."""

KEPT = 256
"""Of how many positions, and as many where it is largest, it is kept what a body force or sliding surface was."""

ROUND_OFF = 1e-9
"""Share of the largest speed below which a velocity out of the domain is none."""

THROUGH = 0.27
"""Largest component of a velocity through a surface, over the speed; a circle of 12 edges that turns has 0.26."""

FLAT = np.cos(np.radians(40))
"""Least product of the unit normals of neighbours on a surface; at corners it is not known what is along it."""

SAMPLES = 16
"""Times, and points along each direction of an inlet, at which rules are told apart."""


@dataclass(frozen=True, eq=False)
class Prescription:
    """What a rule gave before the last step, by which it is known again; without particles before the first one.

    Attributes
    ----------
    time : float
        tU/D.
    position, values : ndarray, shape (m, d)
        Where, and what.
    """

    time: float
    position: FloatArray
    values: FloatArray

    @classmethod
    def nothing_yet(cls, time: float, dimensions: int) -> Self:
        """Return that of a rule that has not been asked."""
        return cls(time, np.empty((0, dimensions)), np.empty((0, dimensions)))

    @classmethod
    def of(cls, time: float, position: FloatArray, values: FloatArray) -> Self:
        """Return what is kept of what a rule gave."""
        spread = np.arange(0, len(position), max(1, -(-len(position) // KEPT)))
        largest = np.argsort(-np.abs(values).max(axis=1), kind="stable")[:KEPT]
        some = np.union1d(spread, largest)
        return cls(time, position[some], values[some])


def asked(name: str, rule: Rule, position: FloatArray, time: float) -> FloatArray | None:
    """Return the vectors (m, d) that a rule gives, of a motion perhaps with rotations (m, d + 1 or 6); None if none.

    Raises
    ------
    ConfigError
        If they are none; the message says where the rule stands. What the rule itself raises comes out as it is, with
        a note that says so, too.
    """
    try:
        values = rule(position.copy(), time)
    except Exception as error:
        *_, frame = traceback.extract_tb(error.__traceback__)
        told = f"{frame.filename}: line {frame.lineno}: {type(error).__name__}: {error}"
        error.add_note(f"{name}{FAILED} at t* = {time:.6g}: {told}")
        raise
    if values is None and name == "inflow":
        return None
    vectors = np.empty(0)
    if not (values is None or np.ma.is_masked(values)):
        with contextlib.suppress(TypeError, ValueError):
            given = np.asarray(values)
            vectors = vectors if given.dtype.kind == "c" else given.astype(float)
    dimensions = position.shape[1]
    numbers = [dimensions, 3 if dimensions == 2 else 6] if name == "motion" else [dimensions]
    if vectors.shape[-1:] not in {(number,) for number in numbers} or vectors.shape[:-1] not in {
        (),
        position.shape[:1],
    }:
        told = " or ".join(map(str, numbers))
        code = getattr(rule, "__code__", None)
        where = f"{code.co_filename}: line {code.co_firstlineno}: " if code else ""
        gave = f"an array {vectors.shape}" if vectors.size else f"a {type(values).__name__} that is none"
        raise ConfigError(
            f"{where}{name}: the function must give {told} numbers a position, or {told} that hold for all of the "
            f"{len(position)}, and gave {gave}"
        )
    return np.broadcast_to(vectors, (len(position), vectors.shape[-1]))


def answering(name: str, rule: Rule, prescribed: dict[str, Prescription]) -> Callable[[FloatArray, float], FloatArray]:
    """Return what the engine asks: a rule, whose last answers are kept. It holds no simulation, which holds it."""

    def answer(position: FloatArray, time: float) -> FloatArray:
        values = np.ascontiguousarray(asked(name, rule, position, time))
        prescribed[name] = Prescription.of(time, position, values)
        return values

    return answer


def difference(rules: Mapping[str, Rule], then: Mapping[str, Prescription]) -> str:
    """Say how rules differ from those that gave `then`, in words; return nothing if they do not."""
    return "; ".join(filter(None, (_difference(name, rules.get(name), then.get(name)) for name in WORDS)))


def _difference(name: str, rule: Rule | None, then: Prescription | None) -> str:
    what = WORDS[name]
    if rule is None:
        return f"no function for the {what}" if then else ""
    if then is None:
        return f"a function for the {what}, of which the run did not tell before"
    if not len(then.position):
        return ""
    now = asked(name, rule, then.position, then.time)
    if now is None:
        return f"a function for the {what} that gives no velocities"
    if now.shape != then.values.shape:
        return f"another {what}: of {now.shape[1]} numbers, where it had {then.values.shape[1]}"
    change = float(np.abs(now - then.values).max())
    if change <= 1e-12 * max(1.0, float(np.abs(then.values).max())):  # another mathematical library's rounding
        return ""
    return f"another {what}: at t* = {then.time:.6g} its values differ by up to {change:.3g}"


def fingerprint(name: str, rule: Rule, domain: Domain, until: float, centres: FloatArray | None = None) -> str:
    """Return a hash of what a rule gives at times up to `until` [D/U] and at points of the domain or its inlets.

    With `centres` (b, d), of bodies that a motion moves, what it gives there.
    """
    total = hashlib.sha256()
    for points in [centres] if centres is not None else _points(name, domain):
        for time in _times(until):
            values = asked(name, rule, points, time)
            # In single precision, which no rounding of another mathematical library reaches.
            total.update(b"" if values is None else np.ascontiguousarray(values, np.float32).tobytes())
    return total.hexdigest()


def _times(until: float) -> list[float]:
    """Return the times at which rules are told apart [D/U]: no multiples of a period."""
    return [float(share * until) for share in (np.arange(SAMPLES) * 0.618034) % 1]


def _points(name: str, domain: Domain) -> list[FloatArray]:
    """Return points of a domain, or for an inflow of each of its inlets."""
    shares = (np.arange(SAMPLES) + 0.5) / SAMPLES
    lower, upper = np.array(domain.lower), np.array(domain.upper)
    axes = list(lower[:, None] + np.outer(upper - lower, shares))
    grids = [axes]
    if name == "inflow":
        grids = [
            [np.array([plane]) if k == axis else values for k, values in enumerate(axes)]
            for axis, _, plane in domain.inlets()
        ]
    return [lattice(*grid) for grid in grids]


def asymmetry(name: str, rule: Rule, domain: Domain, until: float, axis: int, centres: FloatArray) -> str:
    """Say where a rule is not its own mirror image in the plane through 0 normal to an axis; return nothing if it is.

    Parameters
    ----------
    name, rule
        What is prescribed, and by what.
    domain
        The domain, whose other half is the mirror image.
    until
        Latest of the times at which the rule is asked [D/U].
    axis
        0, 1 or 2.
    centres
        Of the bodies that a motion moves (b, d) [D].
    """
    flip = 1.0 - 2.0 * np.eye(domain.dimensions)[axis]
    for points in [centres] if name == "motion" else _points(name, domain):
        begun = [asked(name, rule, each, 0.0) if name == "motion" else None for each in (points, flip * points)]
        for time in _times(until):
            found = [asked(name, rule, each, time) for each in (points, flip * points)]
            here, there = (
                None if now is None else now - (0.0 if first is None else first)
                for now, first in zip(found, begun, strict=True)
            )
            if here is None or there is None:
                continue
            # What turns is mirrored as an axial vector.
            turned = -flip if domain.dimensions == 3 else np.array([-1.0])
            image = np.concatenate([flip, turned])[: here.shape[1]] * there
            apart = np.abs(here - image).max(axis=1)
            if (apart > ROUND_OFF * np.abs(here).max()).any():
                at = int(np.nanargmax(apart))
                values, mirrored, where = (
                    "(" + ", ".join(f"{number:.4g}" for number in each) + ")"
                    for each in (here[at] + 0.0, image[at] + 0.0, points[at] + 0.0)
                )
                return f"at {where} and t* = {time:.4g} it gives {values}, where its mirror image has {mirrored}"
    return ""


def backflow(domain: Domain, position: FloatArray, velocity: FloatArray, time: float) -> str:
    """Return a warning if velocities prescribed at an inlet point out of the domain in places.

    Parameters
    ----------
    domain
        The domain.
    position, velocity : ndarray, shape (m, d)
        Of the inlet particles [D], [U].
    time
        tU/D.

    Raises
    ------
    ConfigError
        If they do so on the whole: more fluid would leave through the inlet than enter; or if one is no finite number.
    """
    if not (known := np.isfinite(velocity).all(axis=1)).all():
        place, found = (f"({', '.join(f'{x:.4g}' for x in row[~known][0])})" for row in (position, velocity))
        raise ConfigError(f"inflow: the velocity at {place} and t* = {time:.4g} is {found}; all must be finite")
    sides = list(domain.inlets())
    if not sides or not len(position):
        return ""
    depth = np.stack([sign * (position[:, axis] - plane) for axis, sign, plane in sides])
    nearest, out = depth.argmin(axis=0), -ROUND_OFF * np.abs(velocity).max()
    warning = ""
    for index, (axis, sign, plane) in enumerate(sides):
        inward = sign * velocity[nearest == index, axis]
        where = f"through the inlet {'xyz'[axis]} = {plane:g} at t* = {time:.4g}"
        if len(inward) and inward.mean() < out:
            raise ConfigError(
                f"inflow: backflow, the mean velocity {where} is {-inward.mean():.3g} U out of the domain; an inlet "
                "takes fluid in: turn the velocity round, or make this side an outlet"
            )
        if (inward < out).any():
            warning = warning or (
                f"inflow: backflow {where}: {np.count_nonzero(inward < out)} of {len(inward)} particles have a "
                f"velocity out of the domain, up to {-inward.min():.3g} U; an inlet takes fluid in: expect errors "
                "near it, and a breakdown if this lasts"
            )
    return warning


def crossing(rule: Rule, place: FloatArray, normal: FloatArray, until: float) -> str:
    """Say where surfaces would move through themselves at times up to `until` [D/U]; return nothing if they do not.

    Parameters
    ----------
    rule
        Gives the velocity of surfaces [U].
    place, normal : ndarray, shape (m, d)
        Places on surfaces [D], at least three, and the unit normals there.
    until
        Time [D/U].
    """
    _, near = neighbour_tree(place).query(place, k=3)
    flat = np.einsum("mkd,md->mk", normal[near], normal).min(axis=1) > FLAT
    place, normal = place[flat], normal[flat]
    for time in _times(until):
        velocity = asked("sliding", rule, place, time)
        assert velocity is not None
        through = np.abs((velocity * normal).sum(axis=1))
        if through.max(initial=0.0) > THROUGH * np.linalg.norm(velocity, axis=1).max(initial=0.0):
            where = ", ".join(f"{x:.4g}" for x in place[through.argmax()])
            return f"a component of {through.max():.3g} U through the surface at ({where}), t* = {time:.4g}"
    return ""
