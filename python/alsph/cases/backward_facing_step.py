"""Flow over a backward-facing step in a channel, with the length of the bubble behind it."""

from __future__ import annotations

import math
from typing import ClassVar, Self

import numpy as np
import shapely
from pydantic import Field, model_validator

from alsph import reference
from alsph.analysis import sampling
from alsph.analysis.measures import Measure
from alsph.analysis.record import Record
from alsph.arrays import FloatArray
from alsph.cases.duct import Duct, parabola
from alsph.geometry.lattice import cell_centres, lattice


class BackwardFacingStep(Duct):
    """Flow over a backward-facing step of height D in a channel with no-slip walls; U is the mean inflow velocity.

    The step's edge lies at x = 0, y = D; the channel behind it reaches from y = 0 to y = ED/(E - 1) with the expansion
    ratio E. The inflow is the parabola of the fully developed flow. As in Armaly et al. (J. Fluid Mech. 127 (1983) 473)
    the Reynolds number is formed with twice the height h of the inlet channel, Re = 2hU/ν. Compared is the length of
    the recirculation bubble, with a finite-element solution at E = 2, an inlet channel of 5 D, and Re = 100 and 389.
    """

    name: ClassVar[str] = "backward_facing_step"
    title: ClassVar[str] = "flow over a backward-facing step"
    is_steady: ClassVar[bool] = True
    velocity_max: ClassVar[float] = 1.5

    reynolds: float = Field(default=100.0, gt=0, description="Reynolds number 2hU/ν, h the inlet channel's height [-]")
    resolution: int = Field(default=20, ge=8, description="particles per step height, D/Δx [-]")
    expansion: float = Field(default=2.0, gt=1, description="height of the outlet channel over the inlet channel's [-]")

    @model_validator(mode="after")
    def _fits(self) -> Self:
        for name, length in (("upstream", self.upstream), ("downstream", self.downstream)):
            self.whole_cells(name, length)
        self.whole_cells("expansion: the height of the inlet channel, 1/(expansion - 1)", self.inlet_height)
        return self

    @property
    def default_until(self) -> float:
        """Time by which the flow is steady; it grows with the Reynolds number."""
        return 20.0 + 0.5 * self.reynolds

    @property
    def validated(self) -> tuple[float, float, int]:
        """What has been compared with an independent solution."""
        return (100, 389, 10)

    @property
    def inlet_height(self) -> float:
        """Height h of the inlet channel [D]."""
        return 1.0 / (self.expansion - 1.0)

    @property
    def reynolds_length(self) -> float:
        """Length 2h that the Reynolds number is formed with [D]."""
        return 2.0 * self.inlet_height

    def channel(self, end: float = 0.0) -> shapely.Polygon:
        """Return the channel, longer by `end` [D] on both sides."""
        left, right, top = -self.upstream - end, self.downstream + end, 1.0 + self.inlet_height
        return shapely.box(left, 0, right, top) - shapely.box(left, 0, 0, 1)

    def developed(self, position: FloatArray) -> FloatArray:
        """Return the parabolas (n, 2) of the same flow rate in the inlet channel and behind the step."""
        x, y = position.T
        floor = np.where(x < 0, 1.0, 0.0)
        height = 1.0 + self.inlet_height - floor
        return parabola((y - floor) / height, self.inlet_height / height)

    def measures(self, run: Record) -> list[Measure]:
        """Return the distance from the step at which the flow reattaches, averaged over the last quarter of the run."""
        row = reference.row("step_reattachment.csv", self.reynolds, "Re_D_Umean_2h_over_nu")
        known = row if (self.expansion, self.upstream) == (2.0, 5.0) else None
        length = float(known["x_reattach_over_S"]) if known else math.nan
        source = "independent finite-element solution (alsph/reference)" if known else ""
        return [Measure("reattachment length, D", self.reattachment(run), length, 0.03, source)]

    def reattachment(self, run: Record) -> float:
        """Return where the shear stress on the floor becomes positive for good [D]; NaN where it does not.

        The stress is that of the parabola through zero at the wall and the velocities Δx/2 and 3Δx/2 above it.
        """
        x = cell_centres(self.whole_cells("downstream", self.downstream), self.particle_spacing)
        u = [
            sampling.late_velocity(run, lattice(x, np.array([share * self.particle_spacing])))[:, 0]
            for share in (0.5, 1.5)
        ]
        return last_upward_zero(x, 9 * u[0] - u[1])


def last_upward_zero(x: FloatArray, values: FloatArray) -> float:
    """Return where `values` (n,) last rise through zero, linear between the points `x` (n,); NaN if nowhere."""
    rises = np.flatnonzero((values[:-1] < 0) & (values[1:] >= 0))
    if not len(rises):
        return float("nan")
    k = rises[-1]
    return float(x[k] - values[k] * (x[k + 1] - x[k]) / (values[k + 1] - values[k]))
