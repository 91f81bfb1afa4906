"""A cylinder that is towed through a fluid at rest, or the same flow seen from the cylinder."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from alsph.analysis.measures import Measure
from alsph.analysis.record import Record
from alsph.arrays import Arrays, FloatArray
from alsph.cases.moving_cylinder import MovingCylinder
from alsph.geometry.domain import Boundary
from alsph.geometry.particles import Kind

START = 1.0
"""Time from which on the drag is averaged [D/U]: what an impulsive start makes of it before does not tell of a flow."""


class TowedCylinder(MovingCylinder):
    """A cylinder that is towed through a fluid at rest at the speed U, from rest at once, in a channel without ends.

    The channel is periodic, so that the same flow can be had with the cylinder at rest in a fluid that begins at the
    speed U: `frame="cylinder"`. Both have the same forces (Galilei).
    """

    name: ClassVar[str] = "towed_cylinder"
    title: ClassVar[str] = "a cylinder towed through a fluid at rest"
    sides: ClassVar[tuple[Boundary, Boundary]] = ("periodic", "slip")

    length: float = Field(default=14.0, gt=2, description="length of the channel [D]")
    height: float = Field(default=13.0, gt=2, description="height of the channel [D]")
    frame: Literal["fluid", "cylinder"] = Field(
        default="fluid", description="what is at rest: the fluid, or the cylinder in a stream along x"
    )

    @property
    def default_until(self) -> float:
        """As far as the channel is long."""
        return self.length

    def motion(self, position: FloatArray, time: float) -> ArrayLike:
        """Return how far the cylinder has come [D]."""
        return [-time if self.frame == "fluid" else 0.0, 0.0]

    def particles(self) -> Arrays:
        """Return a lattice around the cylinder, at rest or with the speed of the stream."""
        state = super().particles()
        state["velocity"][state["kind"] == Kind.FLUID, 0] = 0.0 if self.frame == "fluid" else 1.0
        return state

    def measures(self, run: Record) -> list[Measure]:
        """Return the mean drag coefficient after the start, and its impulse over the momentum that the fluid loses."""
        time, drag = run.history["time"], run.history.get("drag_coefficient", np.empty(0))
        late = time >= START
        mean = float(np.average(drag[late], weights=run.history["time_step"][late])) if late.any() else np.nan
        balance, source = self._balance(run), "momentum of the fluid between two snapshots"
        return [
            Measure(f"mean drag coefficient from tU/D = {START:g} on", mean),
            Measure("impulse of the drag over what the fluid loses", balance, 1.0, 0.02, source),
        ]

    def _balance(self, run: Record) -> float:
        """Nothing but the cylinder acts along the channel, whose walls are slip walls."""
        times = run.times[run.times >= START]
        if len(times) < 2:
            return np.nan
        momentum = [
            float(snapshot.velocity[snapshot.kind == Kind.FLUID, 0].sum()) * self.particle_spacing**2
            for snapshot in (run.snapshot(times[0]), run.snapshot(times[-1]))
        ]
        time, step = run.history["time"], run.history["time_step"]
        force = sum(run.history[f"cylinder_{part}_force_x"] for part in ("pressure", "viscous"))
        middle = time - step / 2  # times are rounded in the file
        between = (middle > times[0]) & (middle < times[-1])
        return float((force * step)[between].sum() / (momentum[0] - momentum[1]))
