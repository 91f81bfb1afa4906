"""Drag and lift signals of known settled drag, to try what the ± is worth."""

from collections.abc import Callable

import numpy as np
from alsph.arrays import FloatArray
from alsph.config import Config
from alsph.results.ending import Judgement, judge, next_judgement
from alsph.results.loads import Loads

SETTLED, STROUHAL, LIFT = 1.4, 0.2, 0.6
Signal = Callable[[np.random.Generator, FloatArray], tuple[FloatArray, FloatArray]]


def times(rng, end):
    """Return sample times of a varying step of 0.01 on average."""
    return np.cumsum(0.01 * rng.uniform(0.7, 1.3, int(end / 0.01)))


def shedding(time, strength=1.0):
    """Return drag, about zero, and lift of shedding."""
    phase = 2 * np.pi * STROUHAL * time
    return 0.05 * strength**2 * np.sin(2 * phase), LIFT * strength * np.sin(phase)


def transient(time):
    """Return the impulsive start's drag."""
    return 4 * np.exp(-time / 0.3) - 0.3 * np.exp(-time / 2)


def autoregressive_series(rng, correlation, count):
    """Return numbers of mean zero and variance one, each correlated with the next as given."""
    values = rng.normal(size=count)
    for k in range(1, count):
        values[k] = correlation * values[k - 1] + np.sqrt(1 - correlation**2) * values[k]
    return values


def autoregressive(rng, time, correlation, spread=0.02):
    """Return noise with values one period apart correlated as given, straight in between."""
    knots = np.arange(0, time[-1] + 2 / STROUHAL, 1 / STROUHAL)
    return spread * np.interp(time, knots, autoregressive_series(rng, correlation, len(knots)))


def correlated(correlation):
    """Shedding whose drag wanders from period to period."""

    def signal(rng, time):
        drag, lift = shedding(time)
        return SETTLED + transient(time) + drag + autoregressive(rng, time, correlation), lift

    return signal


def white(rng, time):
    """Shedding with noise from step to step."""
    drag, lift = shedding(time)
    noise = 0.1 * rng.normal(size=(2, len(time)))
    return SETTLED + transient(time) + drag + noise[0], lift + 0.5 * noise[1]


def beating(rng, time):
    """Shedding with two frequencies, whose amplitude and drag beat."""
    phase = rng.uniform(0, 2 * np.pi)
    strength = 1 + 0.2 * np.sin(2 * np.pi * time / rng.uniform(12, 25) + phase)
    drag, lift = shedding(time, strength)
    return SETTLED + transient(time) + drag + 0.1 * (strength - 1), lift


def steady(correlation):
    """No shedding; drag with noise whose correlation time is the given number of units of time."""

    def signal(rng, time):
        noise = np.empty(len(time))
        noise[0] = rng.normal()
        keep = np.exp(-np.diff(time) / correlation)
        kicks = np.sqrt(1 - keep**2) * rng.normal(size=len(keep))
        for k in range(len(keep)):
            noise[k + 1] = keep[k] * noise[k] + kicks[k]
        return SETTLED + transient(time) + 0.02 * noise, 1e-13 * rng.normal(size=len(time))

    return signal


def relaxing(rng, time):
    """No shedding; drag that relaxes in a time between an eighth and one and a half of the run."""
    rate = 1 / (time[-1] * rng.uniform(0.12, 1.5))
    noise = 0.01 * rng.normal(size=len(time))
    return SETTLED + rng.choice([-1, 1]) * 0.2 * np.exp(-rate * time) + noise, 1e-13 * rng.normal(size=len(time))


def drifting(rng, time):
    """Settled shedding over a drag that relaxes slowly."""
    drag, lift = shedding(time)
    rate = 1 / (time[-1] * rng.uniform(0.3, 1.5))
    return SETTLED + transient(time) + drag + 0.08 * np.exp(-rate * time), lift


def wandering_drift(rng, time):
    """The same, with drag that wanders from period to period."""
    drag, lift = drifting(rng, time)
    return drag + autoregressive(rng, time, 0.5, 0.004), lift


def growing(rng, time):
    """Shedding cut before its amplitude has settled."""
    strength = 1 / (1 + np.exp(-0.3 * (time - time[-1] * rng.uniform(0.9, 1.4))))
    drag, lift = shedding(time, strength)
    return SETTLED - 0.25 * (1 - strength**2) + transient(time) + drag, lift


# length of the run, signal
ESTIMATED: dict[str, tuple[float, Signal]] = {
    "white noise, 10 periods": (60, white),
    "periods uncorrelated, 10": (60, correlated(0.0)),
    "periods uncorrelated, 30": (160, correlated(0.0)),
    "periods AR(1) 0.7, 10": (60, correlated(0.7)),
    "periods AR(1) 0.7, 30": (160, correlated(0.7)),
    "periods AR(1) 0.9, 10": (60, correlated(0.9)),
    "periods AR(1) 0.9, 30": (160, correlated(0.9)),
    "beating": (80, beating),
    "few periods, AR(1) 0.5": (32, correlated(0.5)),
    "steady, correlation time 0.2": (40, steady(0.2)),
    "steady, correlation time 2": (40, steady(2.0)),
}
DEVELOPING: dict[str, tuple[float, Signal]] = {
    "relaxing": (40, relaxing),
    "drift under shedding": (40, drifting),
    "the same, and noise": (60, wandering_drift),
    "growing": (25, growing),
}


def record(time, drag, lift, of: Config) -> Loads:
    """Return a run of a cylinder that has recorded these coefficients."""
    run = Loads()
    run.config = of
    columns = {f"cylinder_{part}_force_{axis}": 0 * time for part in ("pressure", "viscous") for axis in "xy"}
    columns |= {"cylinder_pressure_force_x": drag / 2, "cylinder_pressure_force_y": lift / 2}
    run.history = {"time": time, **columns}
    return run


def judgements(signal: Signal, of: Config, seed=0) -> list[tuple[float, Judgement]]:
    """Return when a run with such a signal is judged, and how, up to the judgement with which it ends."""
    rng, found, time = np.random.default_rng(seed), [], 0.0
    sampled = times(rng, of.until + 1)
    drag, lift = signal(rng, sampled)
    while not found or not found[-1][1].ended:
        time = min(next_judgement(time), of.until)
        past = slice(np.searchsorted(sampled, time) + 1)
        found.append((time, judge(record(sampled[past], drag[past], lift[past], of), of)))
    return found


def varying(correlation, spread, of_lift=0.0):
    """Shedding whose drag, and amplitude of the lift, wander from period to period by shares of 1.4 and of itself."""

    def signal(rng, time):
        drag, lift = shedding(time)
        strength = 1 + autoregressive(rng, time, correlation, of_lift)
        return SETTLED * (1 + autoregressive(rng, time, correlation, spread)) + transient(time) + drag, strength * lift

    return signal


def slow(time_constant):
    """Shedding over a drag that relaxes slowly, and wanders a little from period to period."""

    def signal(rng, time):
        drag, lift = varying(0.5, 0.003)(rng, time)
        return drag + 0.08 * np.exp(-time / time_constant), lift

    return signal


def beginning(rng, time):
    """Shedding that begins at tU/D of 30."""
    strength = 1 / (1 + np.exp(-0.3 * (time - 30)))
    drag, lift = shedding(time, strength)
    noise = 0.003 * rng.normal(size=(2, len(time)))
    return SETTLED - 0.25 * (1 - strength**2) + transient(time) + drag + noise[0], lift + noise[1]


def quiet(rng, time):
    """No shedding, and noise from step to step."""
    return SETTLED + transient(time) + 0.005 * rng.normal(size=len(time)), 1e-13 * rng.normal(size=len(time))


ENDED: dict[str, Signal] = {
    "white noise": white,
    "periods uncorrelated, 0.5 %": varying(0.0, 0.005),
    "periods AR(1) 0.5, 0.5 %": varying(0.5, 0.005),
    "periods AR(1) 0.9, 0.5 %": varying(0.9, 0.005),
    "periods AR(1) 0.5, 0.2 %, lift 1 %": varying(0.5, 0.002, 0.01),
    "drag relaxes in 20 D/U": slow(20.0),
    "drag relaxes in 60 D/U": slow(60.0),
    "shedding begins at 30 D/U": beginning,
    "steady": quiet,
}
