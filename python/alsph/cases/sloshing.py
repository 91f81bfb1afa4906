"""Water in a tank that sways."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, model_validator

from alsph import reference
from alsph.analysis.measures import Measure, Profile
from alsph.analysis.record import Record
from alsph.arrays import Arrays, FloatArray
from alsph.cases.free_surface import FreeSurface, Levels
from alsph.engine.output import Output
from alsph.errors import ConfigError
from alsph.geometry.domain import Domain
from alsph.geometry.lattice import cell_centres, lattice

LINEAR = 0.005
"""Amplitude of the sway [H] up to which linear theory is the reference: it leaves out what is of its square."""

SMALL = 0.02
"""Elevation at the gauge [H] up to which it is: near resonance, at 0.14 H, it errs by 12 %."""

IRROTATIONAL = (12, 16)
"""Modes of the theory of an irrotational wave, and those that tell how far to trust it: while both agree within..."""

AGREEMENT = 0.03
"""... this of the largest elevation."""

RESONANT = 1e-7
"""Share of a mode's frequency within which it is driven at it, to rounding."""

STEEP = 2.0
"""Slope of the surface with which such a wave breaks, at the latest."""

MODES = np.arange(1, 400, 2)
"""Numbers of the modes of linear theory; those that are even are not driven."""

FALTINSEN = {"length": 2.883, "amplitude": 0.05333, "frequency": 1.1953, "phase": 0.0, "gauge": 0.0833}
"""The experiment of Faltinsen, Rognebakke, Lukovsky and Timokha (J. Fluid Mech. 407 (2000) 201, figure 7): a tank of
1.73 m with 0.6 m of water, swayed by 0.032 m every 1.3 s, and a gauge 0.05 m from its left wall."""

EXTREMA = {4.7: "crest", 7.8: "trough", 10.4: "crest", 13.2: "trough", 16.3: "crest", 19.0: "trough"}
"""What there is at about these times [√(H/g)]."""
BESIDE = 1.0
"""How far from these a crest or trough is looked for [√(H/g)]."""


def irrotational_level(
    length: float, amplitude: float, frequency: float, phase: float, gauge: float, until: float
) -> tuple[FloatArray, FloatArray]:
    """Return times (n,) and the elevation (n,) at a gauge, of an inviscid irrotational wave of any height.

    Nothing is left out but what breaks or overturns: the theory of linear waves with the surface where it is. It ends
    where it cannot be trusted, within `AGREEMENT` of the largest elevation.

    Parameters
    ----------
    length, amplitude, gauge : float
        Of the tank, of its sway A cos(ωt − φ), and from the left wall to the gauge [H].
    frequency, phase : float
        ω [√(g/H)] and φ [rad].
    until : float
        Where to end, above 0 [√(H/g)].
    """
    time, few = _irrotational_level(IRROTATIONAL[0], length, amplitude, frequency, phase, gauge, until)
    _, many = _irrotational_level(IRROTATIONAL[1], length, amplitude, frequency, phase, gauge, until)
    end = min(len(few), len(many))
    difference = np.abs(few[:end] - many[:end])
    while end and (differs := difference[:end] > AGREEMENT * np.abs(many[:end]).max()).any():
        end = int(differs.argmax())  # what lies behind it does not tell how large the wave is, either
    return time[:end], many[:end]


@cache
def _irrotational_level(
    modes: int, length: float, amplitude: float, frequency: float, phase: float, gauge: float, until: float
) -> tuple[FloatArray, FloatArray]:
    """Return it with φ = Σ a_k cosh ky cos kx, whose values on the surface, and η, are what is followed in time.

    There ∂η/∂t = v − u ∂η/∂x and dφ/dt = −gη − ½(u² + v²) + v ∂η/∂t + Aω² cos(ωt − φ) x, x beginning at the left wall.
    """
    from scipy.integrate import solve_ivp  # half a second that most commands do without

    x = cell_centres(3 * modes, length / (3 * modes))
    k = np.pi / length * np.arange(modes)
    cosine, sine = np.cos(np.outer(x, k)), np.sin(np.outer(x, k))
    transform = np.linalg.pinv(cosine)

    def rates(time: float, state: FloatArray) -> FloatArray:
        level, potential = state.reshape(2, modes)
        height = 1 + cosine @ level
        rising, falling = np.exp(np.outer(height - 1, k)), np.exp(-np.outer(height + 1, k))
        even, odd = (rising + falling) / (1 + np.exp(-2 * k)), (rising - falling) / (1 + np.exp(-2 * k))  # over cosh k
        share = k * np.linalg.lstsq(even * cosine, cosine @ potential, rcond=1e-12)[0]
        u, v = -(even * sine) @ share, (odd * cosine) @ share
        rise = v + (sine @ (k * level)) * u
        push = amplitude * frequency**2 * np.cos(frequency * time - phase) * x
        return np.concatenate([transform @ rise, transform @ (1 - height - (u**2 + v**2) / 2 + v * rise + push)])

    def breaks(time: float, state: FloatArray) -> float:
        return STEEP - float(np.abs(sine @ (k * state[:modes])).max())

    breaks.terminal = True  # type: ignore[attr-defined]
    times = np.arange(0, until, 0.01)
    with np.errstate(all="ignore"):  # a wave that breaks
        solved = solve_ivp(rates, (0, until), np.zeros(2 * modes), t_eval=times, rtol=1e-6, atol=1e-8, events=breaks)
    return solved.t, np.cos(k * gauge) @ solved.y[:modes]


class Sloshing(FreeSurface):
    """Water of depth H in a tank with slip walls that sways along x, seen from the tank.

    By default it is the experiment of Faltinsen et al. (2000). With an amplitude of up to 0.005 H and an elevation of
    up to 0.02 H the reference is linear theory, else that of an irrotational wave of any height as long as it does not
    break.
    """

    name: ClassVar[str] = "sloshing"
    title: ClassVar[str] = "sloshing in a tank that sways"
    later_names: ClassVar[tuple[str, ...]] = (
        *(f"{before}{kind} near t = " for kind in ("crest", "trough") for before in ("", "time of the ")),
        "largest error of the elevation over the largest",
        "elevation at the gauge",
        "elevation at the gauge, experiment",
    )

    length: float = Field(default=2.883, gt=0, description="length of the tank [H]")
    tank_height: float = Field(default=2.5, gt=1, description="height above which spray is lost [H]")
    amplitude: float = Field(default=0.05333, gt=0, description="amplitude A of the sway [H]")
    frequency: float = Field(default=1.1953, gt=0, description="angular frequency ω of the sway [√(g/H)]")
    phase: float = Field(
        default=0.0,
        description="phase φ of the tank, which is at A cos(ωt − φ) [degrees]",
    )
    gauge: float = Field(default=0.0833, ge=0, description="distance of the gauge from the left wall [H]")

    @model_validator(mode="after")
    def _the_gauge_is_in_the_tank(self) -> Self:
        if self.gauge > self.length:
            raise ConfigError(f"gauge = {self.gauge:g}: outside of the tank; its length is {self.length:g}")
        return self

    @property
    def default_until(self) -> float:
        """Five periods."""
        return 5 * 2 * np.pi / self.frequency

    def domain(self) -> Domain:
        """Return the tank, whose top is open."""
        return Domain([0, 0], [self._whole_length, self.tank_height], [("slip", "slip"), ("slip", "air")])

    @property
    def _whole_length(self) -> float:
        """The length, to a whole number of particles."""
        return float(self.whole(self.length))

    @property
    def initial_volume(self) -> float:
        """That of the water [H²]."""
        return self._whole_length

    def particles(self) -> Arrays:
        """Return a lattice at rest with the hydrostatic pressure."""
        spacing = self.particle_spacing
        position = lattice(
            cell_centres(round(self.length * self.resolution), spacing), cell_centres(self.resolution, spacing)
        )
        return self.fluid(position, np.zeros_like(position), 1 - position[:, 1])

    def forcing(self, position: FloatArray, time: float) -> ArrayLike | None:
        """Return minus the acceleration of the tank."""
        return [self._size * np.cos(self.frequency * time - np.radians(self.phase)), 0.0]

    @property
    def _size(self) -> float:
        return self.amplitude * self.frequency**2

    def outputs(self) -> list[Output]:
        """Return the record of the level at the gauge."""
        return [Levels([self.gauge], self.domain(), self.particle_spacing)]

    def linear_level(self, time: FloatArray, x: float) -> FloatArray:
        """Return the elevation (n,) at times (n,) and a place, of linear theory [H].

        Every mode cos kx is an oscillator of ω² = gk tanh kH that the tilted level of rest, x − L/2 in modes, drives;
        one that is driven at its own frequency grows with time.
        """
        wave = np.pi * MODES / self._whole_length
        own, drive = np.sqrt(wave * np.tanh(wave)), self.frequency
        share = -4 / (self._whole_length * wave**2) * own**2 * self._size
        phase, time = np.radians(self.phase), np.asarray(time)[:, None]
        forced = np.cos(drive * time - phase)
        free = np.cos(phase) * np.cos(own * time) + drive / own * np.sin(phase) * np.sin(own * time)
        grows = np.abs(own - drive) < RESONANT * drive
        resonant = time * np.sin(drive * time - phase) + np.sin(phase) * np.sin(drive * time) / drive
        answer = np.where(grows, resonant / (2 * drive), (forced - free) / np.where(grows, 1, own**2 - drive**2))
        return np.asarray((answer * share) @ np.cos(wave * x))

    def measures(self, run: Record) -> list[Measure]:
        """Return the elevation at the gauge beside theory, linear or not, and the crests beside the experiment's."""
        time, level = Levels.read(run)
        if len(time) < 2:
            return []
        (until, exact), theory, within = self._theory(time)
        rows = []
        if len(until) > 1:
            error = np.abs(np.interp(until, time, level[0]) - 1 - exact).max() / np.abs(exact).max()
            rows = [Measure("largest error of the elevation over the largest", float(error), 0.0, within, theory)]
        if self._is_the_experiment:
            rows += self._extrema(time, level[0] - 1)
        return rows

    def _extrema(self, time: FloatArray, level: FloatArray) -> Iterator[Measure]:
        """Yield height and time of each crest and trough that the run covers, beside the experiment's."""
        source, measured = "experiment (Faltinsen et al. 2000)", reference.table("sloshing_faltinsen.csv")
        for at, kind in EXTREMA.items():
            if time[-1] > at + BESIDE:
                found, known = _extremum(time, level, at, kind), _extremum(measured[0], measured[1], at, kind)
                yield Measure(f"{kind} near t = {at:g}, H", found[1], known[1], 0.1, source)
                within = 0.03 * 2 * np.pi / self.frequency / known[0]
                yield Measure(f"time of the {kind} near t = {at:g}, √(H/g)", found[0], known[0], within, source)

    def _theory(self, time: FloatArray) -> tuple[tuple[FloatArray, FloatArray], str, float]:
        """Return times and elevation of theory up to the last of these times, which it is, and how near it is to be."""
        level = self.linear_level(time, self.gauge)
        if self.amplitude <= LINEAR and np.abs(level).max() <= SMALL:
            return (time, level), "linear theory", 0.03
        size = (self._whole_length, self.amplitude, self.frequency, np.radians(self.phase), self.gauge)
        return irrotational_level(*size, float(time[-1])), "theory of an irrotational wave", 0.05

    @property
    def _is_the_experiment(self) -> bool:
        return all(getattr(self, name) == value for name, value in FALTINSEN.items())

    def profiles(self, run: Record) -> list[Profile]:
        """Return the elevation at the gauge over time."""
        time, level = Levels.read(run)
        if len(time) < 2:
            return []
        axes, here = ("$t\\sqrt{g/H}$", "elevation over $H$"), (time, level[0] - 1)
        known, source, _ = self._theory(time)
        drawn = [Profile("elevation at the gauge", axes, here, known, source)]
        if self._is_the_experiment:
            known, source = tuple(reference.table("sloshing_faltinsen.csv")), "experiment (Faltinsen et al. 2000)"
            drawn.append(Profile("elevation at the gauge, experiment", axes, here, known, source))
        return drawn


def _extremum(time: FloatArray, level: FloatArray, at: float, kind: str) -> tuple[float, float]:
    """Return time and height of the crest or trough about a time."""
    near = np.flatnonzero(np.abs(time - at) < BESIDE)
    place = near[level[near].argmax() if kind == "crest" else level[near].argmin()]
    return float(time[place]), float(level[place])
