"""Where rigid bodies are and how they move, of a rule that tells how far they have come."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from alsph.arrays import FloatArray
from alsph.engine.prescribed import Prescription, Rule, asked
from alsph.errors import ConfigError

INTERVAL = 1e-3
"""Between the times of which velocities and accelerations are formed, to fourth order [D/U]."""

FIRST = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / (12 * INTERVAL)
SECOND = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / (12 * INTERVAL**2)


def poses(rule: Rule, centres: FloatArray, time: float) -> FloatArray:
    """Return the poses (b, 30) of bodies that a rule moves from where they are at the time 0.

    Parameters
    ----------
    rule
        Gives their displacements (b, d) [D], or with rotation vectors behind them (b, 3) in 2-D, (b, 6) in 3-D [rad].
    centres
        Their centres at the start (b, d) [D].
    time
        Time [D/U].

    Returns
    -------
    ndarray
        Displacement, rotation vector, velocity, angular velocity, acceleration and angular acceleration, each of three
        components, and four of three that only free bodies have.
    """
    start = _placed(rule, centres, 0.0)
    way, turn = zip(*(_placed(rule, centres, time + k * INTERVAL) for k in range(-2, 3)), strict=True)
    angle, away = _about_one_axis(start[1], turn) if centres.shape[1] == 2 else _in_space(start[1], turn)
    rates = [np.tensordot(weights, np.stack(of), 1) for weights in (FIRST, SECOND) for of in (way, away)]
    return np.hstack([way[2] - start[0], angle, *rates, np.zeros((len(centres), 12))])


def _about_one_axis(start: FloatArray, turn: Sequence[FloatArray]) -> tuple[FloatArray, list[FloatArray]]:
    """Return the rotation vector since the start, and those at other times from the middle one on."""
    return turn[2] - start, [each - turn[2] for each in turn]  # angles add up, and go on beyond a turn


def _in_space(start: FloatArray, turn: Sequence[FloatArray]) -> tuple[FloatArray, list[FloatArray]]:
    """Return the same where axes may be any."""
    from scipy.spatial.transform import Rotation  # takes its time

    now = Rotation.from_rotvec(turn[2])
    away = [(Rotation.from_rotvec(each) * now.inv()).as_rotvec() for each in turn]
    return (now * Rotation.from_rotvec(start).inv()).as_rotvec(), away


def answering_poses(
    rule: Rule, centres: FloatArray, prescribed: dict[str, Prescription]
) -> Callable[[float], FloatArray]:
    """Return what the engine asks of a rule for motions, whose last answer is kept."""

    def answer(time: float) -> FloatArray:
        prescribed["motion"] = Prescription(time, centres, np.array(asked("motion", rule, centres, time)))
        return poses(rule, centres, time)

    return answer


def is_rigid(body: Mapping[str, Any]) -> bool:
    """Whether a body of the engine's settings moves as a rigid one."""
    return bool(body["moves"] and body["velocity"] is None)


def _placed(rule: Rule, centres: FloatArray, time: float) -> tuple[FloatArray, FloatArray]:
    """Return displacement and rotation vector, three components each."""
    values = asked("motion", rule, centres, time)
    assert values is not None
    if not np.isfinite(values).all():
        asked_for = f"it is asked for up to {2 * INTERVAL:g} before and after each step"
        raise ConfigError(f"motion: is not finite at t* = {time:.6g}; {asked_for}")
    dimensions = centres.shape[1]
    way, turn = np.zeros((len(centres), 3)), np.zeros((len(centres), 3))
    way[:, :dimensions] = values[:, :dimensions]
    if values.shape[1] > dimensions:
        turn[:, -(values.shape[1] - dimensions) :] = values[:, dimensions:]
    return way, turn
