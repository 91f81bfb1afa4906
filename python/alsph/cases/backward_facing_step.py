"""Flow over a backward-facing step in a channel, with the length of the bubble behind it."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Self

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field, model_validator

from alsph import reference
from alsph.analysis import sampling
from alsph.analysis.measures import Measure
from alsph.analysis.record import Record
from alsph.arrays import FloatArray
from alsph.cases.base import Case
from alsph.geometry.domain import Domain, SolidBody
from alsph.geometry.lattice import cell_centres, cells, inside, lattice
from alsph.geometry.particles import Kind, join, particles
from alsph.geometry.solids import walls


class BackwardFacingStep(Case):
    """Flow over a backward-facing step of height D in a channel with no-slip walls; U is the mean inflow velocity.

    The step's edge lies at x = 0, y = D; the channel behind it reaches from y = 0 to y = ED/(E - 1) with the expansion
    ratio E. The inflow is the parabola of the fully developed flow. As in Armaly et al. (J. Fluid Mech. 127 (1983) 473)
    the Reynolds number is formed with twice the height h of the inlet channel, Re = 2hU/ν. Compared is the length of
    the recirculation bubble, with a finite-element solution at E = 2, an inlet channel of 5 D, and Re = 100 and 389.
    """

    name: ClassVar[str] = "backward_facing_step"
    title: ClassVar[str] = "flow over a backward-facing step"
    velocity_max: ClassVar[float] = 1.5

    reynolds: float = Field(default=100.0, gt=0, description="Reynolds number 2hU/ν, h the inlet channel's height [-]")
    resolution: int = Field(default=20, ge=8, description="particles per step height, D/Δx [-]")
    expansion: float = Field(default=2.0, gt=1, description="height of the outlet channel over the inlet channel's [-]")
    upstream: float = Field(default=5.0, gt=0, description="length of the inlet channel [D]")
    downstream: float = Field(default=20.0, gt=0, description="length of the channel behind the step [D]")

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

    def domain(self) -> Domain:
        """Return the bounds of the channel: inlet and outlet; solid particles close the rest."""
        top = 1.0 + self.inlet_height
        return Domain((-self.upstream, 0), (self.downstream, top), [("inlet", "outlet"), ("none", "none")])

    def bodies(self) -> list[SolidBody]:
        """Return the walls, at rest."""
        return [SolidBody("walls", (0, 0))]

    def particle_estimate(self) -> int:
        """Return about how many particles there are, solid and buffers included."""
        buffers = 2 * (self.buffer_columns + self.support_layers)
        length = (self.upstream + self.downstream) * self.resolution + buffers
        area = self.inlet_height * length + self.downstream * self.resolution + buffers / 2
        return round(area * self.resolution + 2 * self.support_layers * (length + self.resolution / 2))

    def particles(self) -> dict[str, NDArray[Any]]:
        """Return a lattice in the channel and its buffers, each with its developed flow, between solid walls."""
        spacing, buffer = self.particle_spacing, self.buffer_columns * self.particle_spacing
        end = buffer + self.support_layers * spacing
        channel = self._channel(end)
        solid = walls(channel, spacing, self.support_layers)
        x = solid.position[:, 0]
        points = cells(channel, spacing)
        points = points[inside(channel, points)]
        before, behind = -self.upstream - points[:, 0], points[:, 0] - self.downstream
        groups = {
            Kind.FLUID: (before < 0) & (behind < 0),
            Kind.INLET: (before > 0) & (before < buffer),
            Kind.OUTLET: (behind > 0) & (behind < buffer),
        }
        return join(
            *(particles(kind, points[chosen], self._developed(points[chosen])) for kind, chosen in groups.items()),
            solid.where((x > -self.upstream - end) & (x < self.downstream + end)).particles(),
        )

    def _channel(self, end: float) -> shapely.Polygon:
        """Return the channel, longer by `end` [D] on both sides."""
        left, right, top = -self.upstream - end, self.downstream + end, 1.0 + self.inlet_height
        return shapely.box(left, 0, right, top) - shapely.box(left, 0, 0, 1)

    def _developed(self, position: FloatArray) -> FloatArray:
        """Return the parabolas (n, 2) of the same flow rate in the inlet channel and behind the step."""
        x, y = position.T
        floor = np.where(x < 0, 1.0, 0.0)
        height = 1.0 + self.inlet_height - floor
        share = (y - floor) / height
        return np.stack([6 * self.inlet_height / height * share * (1 - share), 0 * y], axis=1)

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
