"""Flow past a circular cylinder that rotates in a channel."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from alsph import reference
from alsph.analysis.measures import Measure, Profile
from alsph.analysis.record import Record
from alsph.arrays import FloatArray
from alsph.cases.cylinder import Cylinder
from alsph.reference import Reference

SOURCE = "finite elements in the same channel"
EARLY = (2.0, 4.0)
"""Times [D/U] between which the loads are averaged while the wake behind the impulsive start still grows."""


class RotatingCylinder(Cylinder):
    """Flow past a circular cylinder that rotates in a channel with free-slip walls and uniform inflow U.

    Its surface goes round at a constant speed, from the start on: counterclockwise where that is positive, which pushes
    the cylinder down. The cylinder is round, so that its particles stay in place and have the velocity of the surface
    above them.

    In unbounded flow at Re = 100 the wake sheds vortices up to a surface speed of about 1.8 U (Kang, Choi and Lee,
    Phys. Fluids 11 (1999) 3312).
    """

    name: ClassVar[str] = "rotating_cylinder"
    title: ClassVar[str] = "flow past a cylinder that rotates"
    velocity_max: ClassVar[float] = 2.0
    later_names: ClassVar[tuple[str, ...]] = ()

    reynolds: float = Field(default=100.0, gt=0, description="Reynolds number UD/ν [-]")
    perturbation: float = Field(
        default=0.0, ge=0, le=1, description="largest velocity of an initial vortex about the body [U]"
    )
    side_walls: Literal["slip"] | None = Field(
        default=None, description="sides of the channel: slip, with a uniform inflow U; slip if not given"
    )
    surface_speed: float = Field(
        default=1.0, ge=-4, le=4, description="speed of the surface, counterclockwise where positive [U]"
    )

    @property
    def validated(self) -> tuple[float, float, int]:
        """What has been compared with an independent solution."""
        return (100, 100, 10)

    def remarks(self) -> list[str]:
        """Return what is to be said of the resolution, the method, the channel and the surface's speed."""
        fast = (
            f"not validated: surface_speed = {self.surface_speed:g}, beyond 1 U; at 2 U the drag soon after the start"
        )
        return [
            *super().remarks(),
            *([f"{fast} errs by 16 and 8 % at D/Δx = 10 and 20; refine"] if abs(self.surface_speed) > 1 else []),
        ]

    def sliding(self, position: FloatArray, time: float) -> ArrayLike:
        """Return the velocity of the surface [U]."""
        x, y = (position - self.centre).T
        return 2 * self.surface_speed * np.stack([-y, x], axis=1)

    def measures(self, run: Record) -> list[Measure]:
        """Return the loads soon after the start, then forces and Strouhal number of the flow that has developed."""
        at_rest = not self.perturbation and not run.info.get("start", {}).get("initial_run")
        history, known = run.history, self._loads("start") if at_rest else {}
        time = history["time"]
        within = (time > EARLY[0]) & (time <= EARLY[1])
        whole = len(time) > 0 and time[-1] >= EARLY[1] - self.particle_spacing

        def early(name: str, column: str, *parts: str) -> Measure:
            value = math.nan
            if whole:
                total = np.sum([history[part] for part in parts], axis=0)
                value = float(np.average(total[within], weights=history["time_step"][within]))
            when = f"tU/D from {EARLY[0]:g} to {EARLY[1]:g}"
            return Measure(f"{name}, {when}", value, known.get(column, math.nan), 0.05, SOURCE)

        return [
            early("drag coefficient", "CD_mean", "drag_coefficient"),
            early("lift coefficient", "CL_mean", "lift_coefficient"),
            early("torque, ρU²D²", "torque", "cylinder_pressure_torque", "cylinder_viscous_torque"),
            *super().measures(run),
        ]

    def profiles(self, run: Record) -> list[Profile]:
        """Return the mean pressure coefficient over the angle."""
        found = run.pressure_coefficient
        axes = r"$\theta$ from the front stagnation point [degrees]", "$C_p$"
        return [Profile("pressure coefficient", axes, (found.theta, found.mean), (np.empty(0), np.empty(0)), "")]

    def _reference(self) -> Reference | None:
        known = self._loads("developed")
        names = reference.COLUMNS | {"mean lift coefficient": "CL_mean"}
        return Reference({name: known[column] for name, column in names.items()}, SOURCE) if known else None

    def _loads(self, flow: str) -> dict[str, float]:
        """Return what is known of the flow soon after the start, or of the one that has developed; empty if nothing."""
        if self.body_offset:
            return {}
        known = self._known("rotating_cylinder.csv", flow=flow, speed=abs(self.surface_speed))
        mirrored = math.copysign(1.0, self.surface_speed)
        return known | {name: mirrored * known[name] for name in ("CL_mean", "torque") if known}
