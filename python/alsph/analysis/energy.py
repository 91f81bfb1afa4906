"""Kinetic and potential energy over time, and what has taken them."""

from collections.abc import Mapping

import numpy as np

from alsph.arrays import FloatArray

PARTS = {
    "viscosity": "dissipation",
    "artificial viscosity": "artificial_dissipation",
    "penalty": "penalty_dissipation",
    "pressure": "pressure_dissipation",
    "sweeps": "sweep_dissipation",
    "contact": "contact_dissipation",
}
"""Columns of the history that tell what a part of the step takes in unit time, by its name."""

NOTHING = 1e-12
"""Of the energy: as much is rounding."""


def energy(history: Mapping[str, FloatArray]) -> FloatArray:
    """Return kinetic and potential energy after each step (n,) [ρU²D^d]; NaN where a history lacks them."""
    unknown = np.full(len(history["time"]), np.nan)
    return np.asarray(history.get("kinetic_energy", unknown) + history.get("potential_energy", unknown))


def largest_rise(history: Mapping[str, FloatArray]) -> float:
    """Return the largest rise of the energy above its least value before, over its start."""
    total = energy(history)
    return float((total - np.minimum.accumulate(total)).max() / np.abs(total[0]))


def taken(history: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Return what each part of the step has taken of it since the first one (n,) [ρU²D^d], by its name.

    What they sum to is lost, but for what moving bodies and forces of place and time have done and what has left; a
    part that has taken nothing is left out, all are where a history does not tell.
    """
    time = history["time"]
    rates = {name: history[column] for name, column in PARTS.items() if column in history}
    if "pressure" not in rates or not all(np.isfinite(rate[1:]).all() for rate in rates.values()) or not len(time):
        return {}  # an older alsph, which began the run, does not tell
    sums = {name: np.cumsum(rate[1:] * np.diff(time)) for name, rate in rates.items()}
    known = {name: np.concatenate([[0.0], total]) for name, total in sums.items()}
    return {name: total for name, total in known.items() if np.abs(total).max() > NOTHING * np.abs(energy(history)[0])}
