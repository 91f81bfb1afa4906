"""What is prescribed at the inlets: a rule for the velocities, what it gave last, and whether they let fluid in."""

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from alsph.arrays import FloatArray
from alsph.errors import ConfigError
from alsph.geometry.lattice import lattice

Inflow = Callable[[FloatArray, float], ArrayLike | None]
"""Velocity (m, d) or (d,) [U] of the inlet particles, from their positions (m, d) [D] and the time [D/U].

None leaves them the velocities that they have.
"""

ROUND_OFF = 1e-9
"""Share of the largest speed below which a velocity out of the domain is none."""

SAMPLES = 16
"""Times, and points along each direction of an inlet, at which rules are told apart."""


@dataclass(frozen=True, eq=False)
class Prescription:
    """What a rule gave before the last step, by which it is known again; without particles before the first one.

    Attributes
    ----------
    time : float
        tU/D.
    position, velocity : ndarray, shape (m, d)
        Of the inlet particles [D], [U].
    """

    time: float
    position: FloatArray
    velocity: FloatArray


def _asked(rule: Inflow, position: FloatArray, time: float) -> FloatArray | None:
    """Return the velocities (m, d) that a rule gives.

    Raises
    ------
    ConfigError
        If they are none.
    """
    velocity = rule(position.copy(), time)
    try:
        return None if velocity is None else np.broadcast_to(np.asarray(velocity, float), position.shape)
    except (TypeError, ValueError):
        raise ConfigError(
            f"inflow: the function must give {position.shape[1]} numbers a position, or as many"
        ) from None


def difference(rule: Inflow | None, then: Prescription | None) -> str:
    """Say how a rule differs from the one that gave `then`, in words; return nothing if it does not."""
    if rule is None:
        return "no inflow function" if then else ""
    if then is None:
        return "an inflow function, of which the run did not tell before"
    if not len(then.position):
        return ""
    now = _asked(rule, then.position, then.time)
    if now is None:
        return "an inflow function that gives no velocities"
    change = float(np.abs(now - then.velocity).max())
    if change <= 1e-12 * max(1.0, float(np.abs(then.velocity).max())):  # another mathematical library's rounding
        return ""
    return f"another inflow: at t* = {then.time:.6g} its velocities differ by up to {change:.3g} U"


def fingerprint(rule: Inflow, domain: dict[str, Any], until: float) -> str:
    """Return a hash of the velocities that a rule gives at points of the inlets and times up to `until` [D/U]."""
    total = hashlib.sha256()
    shares = (np.arange(SAMPLES) + 0.5) / SAMPLES
    lower, upper = np.array(domain["lower"], float), np.array(domain["upper"], float)
    for axis, _, plane in inlets(domain):
        axes = list(lower[:, None] + np.outer(upper - lower, shares))
        axes[axis] = np.array([plane])
        for share in (np.arange(SAMPLES) * 0.618034) % 1:  # no multiples of a period
            velocity = _asked(rule, lattice(*axes), float(share * until))
            # In single precision, which no rounding of another mathematical library reaches.
            total.update(b"" if velocity is None else np.ascontiguousarray(velocity, np.float32).tobytes())
    return total.hexdigest()


def backflow(domain: dict[str, Any], position: FloatArray, velocity: FloatArray, time: float) -> str:
    """Return a warning if velocities prescribed at an inlet point out of the domain in places.

    Parameters
    ----------
    domain
        ``lower``, ``upper`` and ``boundaries`` of the domain.
    position, velocity : ndarray, shape (m, d)
        Of the inlet particles [D], [U].
    time
        tU/D.

    Raises
    ------
    ConfigError
        If they do so on the whole: more fluid would leave through the inlet than enter.
    """
    sides = list(inlets(domain))
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


def inlets(domain: dict[str, Any]) -> Iterator[tuple[int, int, float]]:
    """Yield axis, sign of the inward normal and plane of each side of a domain that is an inlet."""
    for axis, sides in enumerate(domain["boundaries"]):
        for side, sign, plane in zip(sides, (1, -1), (domain["lower"][axis], domain["upper"][axis]), strict=True):
            if side == "inlet":
                yield axis, sign, float(plane)
