"""Flow through a plane nozzle: a channel that contracts smoothly, with what it must keep as its measure."""

from __future__ import annotations

import math
from typing import ClassVar, Self

import numpy as np
import shapely
from pydantic import Field, model_validator

from alsph.analysis import sampling
from alsph.analysis.averages import error_norms
from alsph.analysis.measures import Measure, Profile
from alsph.analysis.record import Record
from alsph.arrays import FloatArray
from alsph.cases.duct import Duct, parabola
from alsph.geometry.lattice import cell_centres, lattice, symmetric_centres

STATIONS = 9
"""Sections at which the flow rate is measured, of which the first and last lie half-way along the straight parts."""


class Nozzle(Duct):
    """Flow through a plane nozzle with no-slip walls; D is the height of its outlet channel, U the mean velocity there.

    The height falls from CD to D, with the contraction ratio C, over 0 < x < `transition` as half a wave of a cosine;
    the centre line is y = 0. The inflow is the parabola of the fully developed flow. What a section lets through is UD
    in the steady flow, and far downstream the velocity is the parabola of the outlet channel: both are exact, and
    compared. The parabola takes about 0.05 Re D to come about again.
    """

    name: ClassVar[str] = "nozzle"
    title: ClassVar[str] = "flow through a plane nozzle"
    is_steady: ClassVar[bool] = True
    velocity_max: ClassVar[float] = 1.5

    reynolds: float = Field(default=50.0, gt=0, description="Reynolds number UD/ν, of the outlet channel [-]")
    resolution: int = Field(default=20, ge=8, description="particles across the outlet channel, D/Δx [-]")
    contraction: float = Field(default=2.0, gt=1, le=10, description="height of the inlet over that of the outlet [-]")
    transition: float = Field(default=2.0, gt=0, description="length over which the height falls [D]")
    upstream: float = Field(default=2.0, gt=0, description="length of the inlet channel [D]")
    downstream: float = Field(default=6.0, gt=0, description="length of the outlet channel [D]")

    @model_validator(mode="after")
    def _fits(self) -> Self:
        for name in ("upstream", "transition", "downstream"):
            self.whole_cells(name, getattr(self, name))
        steps = (self.contraction - 1) / 2 * self.resolution
        if abs(steps - round(steps)) > 1e-6:
            whole = [count for count in (math.floor(steps), math.ceil(steps)) if count]
            near = [f"{1 + 2 * count / self.resolution:.6g}" for count in whole]
            told = f"the step on each side, (contraction - 1)/2, is no whole number of spacings (1/{self.resolution})"
            raise ValueError(f"contraction = {self.contraction:g}: {told}; use {' or '.join(near)}")
        return self

    @property
    def outlet(self) -> float:
        """Where the outlet lies, x [D]."""
        return self.transition + self.downstream

    @property
    def default_until(self) -> float:
        """Time by which the flow is steady: what entered at first has left, and the boundary layers have grown."""
        return 2.0 * self.contraction * (self.upstream + self.outlet)

    def height(self, x: FloatArray) -> FloatArray:
        """Return the heights (n,) of the channel at x (n,) [D]."""
        share = np.clip(x / self.transition, 0, 1)
        return np.asarray(1 + (self.contraction - 1) * (1 + np.cos(np.pi * share)) / 2)

    def channel(self, end: float = 0.0) -> shapely.Polygon:
        """Return the channel, longer by `end` [D] on both sides; its walls have 200 sides in the transition."""
        x = np.concatenate([[-self.upstream - end], np.linspace(0, self.transition, 201), [self.outlet + end]])
        wall = np.stack([x, self.height(x) / 2], axis=1)
        return shapely.Polygon(np.concatenate([wall, wall[::-1] * (1.0, -1.0)]))

    def developed(self, position: FloatArray) -> FloatArray:
        """Return the parabolas (n, 2) of the local height, all of the same flow rate."""
        x, y = position.T
        height = self.height(x)
        return parabola(0.5 + y / height, 1 / height)

    def measures(self, run: Record) -> list[Measure]:
        """Return how far the flow rates differ from the inflow's, and the error of the velocity far downstream."""
        _, rate = self._rates(run)
        y, u = self._far(run)
        error = error_norms(u, self._parabola(y))["l2"]
        return [
            Measure("largest error of the flow rate, UD", float(np.abs(rate - 1).max()), 0.0, 0.02, "mass balance"),
            Measure("relative L2 error of the velocity downstream", error, 0.0, 0.02, "exact solution (Poiseuille)"),
        ]

    def profiles(self, run: Record) -> list[Profile]:
        """Return the flow rate along the nozzle and the velocity across the outlet channel, beside the exact ones."""
        (x, rate), (y, u), across = self._rates(run), self._far(run), np.linspace(-0.5, 0.5, 101)
        exact = across, self._parabola(across)
        return [
            Profile("flow rate", ("$x/D$", "$Q/(UD)$"), (x, rate), (x, np.ones_like(x)), "mass balance"),
            Profile("velocity downstream", ("$y/D$", "$u/U$"), (y, u), exact, "exact solution (Poiseuille)"),
        ]

    @staticmethod
    def _parabola(y: FloatArray) -> FloatArray:
        """Return the exact velocity (n,) far downstream at heights y (n,), -1/2 to 1/2 [D]."""
        return 1.5 * (1 - 4 * y**2)

    def _rates(self, run: Record) -> tuple[FloatArray, FloatArray]:
        """Return sections x (k,) and the flow rates (k,) through them, averaged over the last quarter of the run."""
        x = np.linspace(-self.upstream / 2, self.transition + self.downstream / 2, STATIONS)
        count = 4 * self.resolution
        points = lattice(x, symmetric_centres(count, 1 / count))
        points[:, 1] *= self.height(points[:, 0])
        u = sampling.late_velocity(run, points)[:, 0].reshape(STATIONS, count)
        return x, u.mean(axis=1) * self.height(x)

    def _far(self, run: Record) -> tuple[FloatArray, FloatArray]:
        """Return heights y (k,) and the velocities (k,) there 1 D before the outlet, averaged over the same time."""
        y = cell_centres(self.resolution, self.particle_spacing) - 0.5
        return y, sampling.late_velocity(run, lattice(np.array([self.outlet - min(1.0, self.downstream / 2)]), y))[:, 0]
