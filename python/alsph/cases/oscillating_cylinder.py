"""A cylinder that oscillates in a fluid at rest."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from alsph import reference
from alsph.analysis import sampling
from alsph.analysis.measures import Measure, Profile
from alsph.analysis.record import Record
from alsph.arrays import FloatArray
from alsph.cases.discretised import LONG
from alsph.cases.moving_cylinder import MovingCylinder

KNOWN = {"reynolds": 100.0, "keulegan_carpenter": 5.0}
MORISON = {"drag coefficient of Morison": 2.03, "inertia coefficient of Morison": 1.457}
HARMONICS = np.array([1, 3, 5])
"""Of which the largest force is taken: those that a flow has which is the same, mirrored, half a period later."""

PHASES = (180, 210, 330)
"""Phases 360 t/T [degrees] at which the velocity beside the cylinder was measured."""

STATIONS = (-0.6, 0.0, 0.6, 1.2)
"""And the places x [D] where it was."""

BESIDE = 0.01
"""How far [T] a snapshot may be from such a phase: the cylinder's velocity changes by at most 0.06 U in so much."""

EXPERIMENT = "experiment (Dütsch et al. 1998)"
SOURCE = "vorticity and stream function on a log-polar grid to 40 D, extrapolated"


def profile_name(phase: int, component: str, x: float) -> str:
    """Return the name of a profile of the velocity."""
    return f"velocity at {phase} degrees, {component} at x = {x:g} D"


class OscillatingCylinder(MovingCylinder):
    """A cylinder that oscillates along x in a fluid at rest: x = -A sin(2πt/T); U is its largest speed 2πA/T.

    At Re = 100 and KC = UT/D = 5 the flow is periodic and symmetric (Dütsch et al., J. Fluid Mech. 360, 1998, 249),
    and the force is known; so are velocities at 180, 210 and 330 degrees, for which a run needs snapshots every twelfth
    of a period (--output-interval 0.416667). Drag and inertia coefficients are those of Morison's formula,
    F = -c_d ρDV|V|/2 - c_m ρπD²/4 dV/dt with the velocity V of the cylinder, fitted to the last whole period.
    """

    name: ClassVar[str] = "oscillating_cylinder"
    title: ClassVar[str] = "a cylinder that oscillates in a fluid at rest"
    later_names: ClassVar[tuple[str, ...]] = (
        "largest force coefficient",
        *MORISON,
        "force coefficient over the last period",
        *(f"velocity at {phase} degrees, rms difference, U" for phase in PHASES),
        *(profile_name(phase, name, x) for phase in PHASES for x in STATIONS for name in "uv"),
    )

    keulegan_carpenter: float = Field(default=5.0, gt=0, description="Keulegan-Carpenter number KC = UT/D [-]")

    @property
    def period(self) -> float:
        """T [D/U]."""
        return self.keulegan_carpenter

    @property
    def default_until(self) -> float:
        """Three periods."""
        return 3 * self.period

    def remarks(self) -> list[str]:
        """Return what is to be borne in mind: pressure that answers as waves not much longer than the cylinder."""
        length = self.period * self.expected_penalty_constant() ** 0.5
        if self.scheme not in (None, "alsph") or length >= LONG:
            return super().remarks()
        told = f"it travels {length:.2g} D in a period; with less than {LONG:g} D the added mass is some 10 % wrong"
        return [*super().remarks(), f"slow pressure: {told}; take a smaller courant"]

    def motion(self, position: FloatArray, time: float) -> ArrayLike:
        """Return how far the cylinder has come [D]."""
        turn = 2 * np.pi / self.period
        return [-np.sin(turn * time) / turn, 0.0]

    def last_period(self, run: Record) -> tuple[FloatArray, FloatArray, FloatArray] | None:
        """Return t/T from 0 to 1, force coefficient and velocity of the last whole period; None before the first."""
        time = run.history["time"]
        count = math.floor((time[-1] + 0.5 * self.particle_spacing) / self.period) if len(time) else 0
        if count < 1 or "cylinder_velocity_x" not in run.history:
            return None
        within = (time > (count - 1) * self.period) & (time <= count * self.period)
        share = time[within] / self.period - (count - 1)
        return share, run.history["drag_coefficient"][within], run.history["cylinder_velocity_x"][within]

    def measures(self, run: Record) -> list[Measure]:
        """Return force coefficients over the last whole period, and how far velocities are from the experiment's."""
        last = self.last_period(run)
        if last is None:
            return []
        share, force, velocity = last
        turn = 2 * np.pi / self.period
        acceleration = turn * np.sin(2 * np.pi * share)
        terms = np.stack([-velocity * np.abs(velocity), -np.pi / 2 * acceleration], axis=1)
        fitted = np.linalg.lstsq(terms, force, rcond=None)[0]
        known = self.is_known
        waves = 2 * np.pi * np.outer(share, HARMONICS)
        smooth = np.hstack([np.cos(waves), np.sin(waves)])
        smooth = smooth @ np.linalg.lstsq(smooth, force, rcond=None)[0]
        return [
            Measure(
                "largest force coefficient", float(np.abs(smooth).max()), 3.25 if known else math.nan, 0.05, SOURCE
            ),
            *(
                Measure(name, float(value), expected if known else math.nan, 0.05, SOURCE)
                for (name, expected), value in zip(MORISON.items(), fitted, strict=True)
            ),
            *(
                Measure(
                    f"velocity at {phase} degrees, rms difference, U",
                    float(np.sqrt(np.nanmean((computed - measured) ** 2))),
                    0.0,
                    0.1,
                    EXPERIMENT,
                )
                for phase, (_, computed, measured) in self._velocities(run).items()
            ),
        ]

    def _velocities(self, run: Record) -> dict[int, tuple[FloatArray, FloatArray, FloatArray]]:
        """Return places (x, y, component) (3, n), velocity [U] (n,) and that of the experiment (n,), by phase.

        Of the last period, at the phases that there are snapshots of. Points in the cylinder have NaN.
        """
        last = math.floor(run.times[-1] / self.period + BESIDE) if self.is_known and len(run.times) else 0
        phase, x, component, y, measured = reference.table("oscillating_cylinder_profiles.csv")
        found = {}
        for each in PHASES if last else ():
            snapshot = run.snapshot((last - 1 + each / 360) * self.period)
            if abs(snapshot.time / self.period - (last - 1 + each / 360)) > BESIDE:
                continue
            here = phase == each
            points, axis = np.stack([x, y], axis=1)[here], component[here].astype(int)
            velocity = sampling.at(snapshot, points, run.spacing, self.domain())["velocity"]
            velocity[sampling.in_solid(snapshot.position, snapshot.fluid, points)] = np.nan
            found[each] = np.stack([x, y, component])[:, here], velocity[np.arange(len(axis)), axis], measured[here]
        return found

    def profiles(self, run: Record) -> list[Profile]:
        """Return the force coefficient over the last whole period, and velocities beside the cylinder."""
        last = self.last_period(run)
        if last is None:
            return []
        known, source = (np.empty(0), np.empty(0)), ""
        if self.is_known:
            share, force, *_ = reference.table("oscillating_cylinder_force.csv")
            known, source = (share, force), SOURCE
        axes = ("$t/T$", "$C_x$")
        drawn = [Profile("force coefficient over the last period", axes, last[:2], known, source)]
        for phase, ((x, y, component), computed, measured) in self._velocities(run).items():
            for station in STATIONS:
                for k, name in enumerate("uv"):
                    here = np.flatnonzero((x == station) & (component == k))
                    here = here[np.argsort(y[here])]
                    title = profile_name(phase, name, station)
                    labels = ("$y/D$", f"${name}/U$")
                    drawn.append(
                        Profile(title, labels, (y[here], computed[here]), (y[here], measured[here]), EXPERIMENT)
                    )
        return drawn

    @property
    def is_known(self) -> bool:
        """Whether the force of this flow is known."""
        return all(getattr(self, name) == value for name, value in KNOWN.items())
