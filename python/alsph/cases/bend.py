"""Flow through a plane bend of 90 degrees, with the forces on it, and what it costs in pressure."""

from __future__ import annotations

import math
from typing import ClassVar, Self

import numpy as np
import shapely
from numpy.typing import ArrayLike
from pydantic import Field, model_validator

from alsph import reference
from alsph.analysis import sampling
from alsph.analysis.averages import error_norms
from alsph.analysis.measures import Measure, Profile
from alsph.analysis.record import Record
from alsph.arrays import FloatArray
from alsph.cases.duct import Duct, parabola
from alsph.geometry.domain import Domain, SolidBody
from alsph.geometry.lattice import cell_centres

STATIONS = 3
"""Sections of each of the three parts at which the flow rate is measured."""

FINE = 4
"""Points per particle spacing across a section."""


class Bend(Duct):
    """Flow through a plane channel that turns by 90 degrees; D is its height, U the mean velocity.

    The inlet lies at x = -upstream and the outlet at y = downstream; in between the walls are arcs about the origin,
    of the radii R = `inner_radius` and R + D. The inflow is the parabola of the fully developed flow. In the steady
    flow each section lets UD through, the velocity far downstream is that parabola again, and the force on the bend is
    what pressure, friction and momentum in its first and last section leave: all three are exact. The pressure that the
    bend costs is compared with finite elements for the radii and Reynolds numbers of `bend_pressure.csv`.
    """

    name: ClassVar[str] = "bend"
    title: ClassVar[str] = "flow through a plane bend of 90 degrees"
    is_steady: ClassVar[bool] = True
    velocity_max: ClassVar[float] = 2.0
    later_names: ClassVar[tuple[str, ...]] = ("force on the bend",)

    reynolds: float = Field(default=50.0, gt=0, description="Reynolds number UD/ν [-]")
    resolution: int = Field(default=20, ge=8, description="particles across the channel, D/Δx [-]")
    inner_radius: float = Field(default=0.5, ge=0, description="radius of the inner wall, 0 for a sharp edge [D]")
    upstream: float = Field(default=3.0, gt=0, description="length of the inlet channel [D]")
    downstream: float = Field(default=6.0, gt=0, description="length of the outlet channel [D]")

    @model_validator(mode="after")
    def _fits(self) -> Self:
        for name in ("upstream", "downstream", "inner_radius"):
            self.whole_cells(name, getattr(self, name))
        return self

    @property
    def arc(self) -> float:
        """Length of the bend along its middle [D]."""
        return math.pi / 2 * (self.inner_radius + 0.5)

    @property
    def default_until(self) -> float:
        """Time by which the flow is steady: what entered at first has left, and the boundary layers have grown."""
        return 2.0 * (self.upstream + self.arc + self.downstream)

    def domain(self) -> Domain:
        """Return the bounds of the channel, its inlet on the left and its outlet at the top."""
        outer = self.inner_radius + 1
        return Domain((-self.upstream, -outer), (outer, self.downstream), [("inlet", "none"), ("none", "outlet")])

    def channel(self, end: float = 0.0) -> shapely.Polygon:
        """Return the channel, longer by `end` [D] on both sides; its arcs have 200 sides."""
        angle = np.linspace(-np.pi / 2, 0, 201)
        arc = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        inner, outer = self.inner_radius, self.inner_radius + 1
        left, top = -self.upstream - end, self.downstream + end
        ends = [[left, -outer]], [[outer, top], [inner, top]], [[left, -inner]]
        return shapely.Polygon(np.concatenate([ends[0], outer * arc, ends[1], inner * arc[::-1], ends[2]]))

    def developed(self, position: FloatArray) -> FloatArray:
        """Return the parabolas (n, 2) across the straight parts and the arc between them."""
        toward = np.stack([np.maximum(position[:, 0], 0), np.minimum(position[:, 1], 0)], axis=1)
        radius = np.hypot(*toward.T)
        along = toward[:, ::-1] * (-1, 1) / radius[:, None]
        return np.asarray(along * parabola(radius - self.inner_radius, np.ones(len(position)))[:, :1])

    def bodies(self) -> list[SolidBody]:
        """Return the walls of the straight parts and those of the bend, at rest."""
        return [SolidBody("walls", (0, 0)), SolidBody("bend", (0, 0))]

    def wall(self, position: FloatArray) -> ArrayLike:
        """Return 1 for the walls of the bend, 0 for the others."""
        return (position[:, 0] > 0) & (position[:, 1] < 0)

    def measures(self, run: Record) -> list[Measure]:
        """Return the errors of mass and momentum balance, of the velocity downstream, and the pressure drop."""
        _, rate = self._rates(run)
        y, u = self._far(run)
        error = error_norms(u, self._parabola(y))["l2"]
        drop, straight = self._pressure_drop(run)
        expected, source = self._known_excess()
        return [
            Measure("largest error of the flow rate, UD", float(np.abs(rate - 1).max()), 0.0, 0.02, "mass balance"),
            Measure("relative L2 error of the velocity downstream", error, 0.0, 0.02, "exact solution (Poiseuille)"),
            Measure("force on the bend, error", self._imbalance(run), 0.0, 0.04, "momentum balance of the bend"),
            Measure("pressure drop, ρU²", drop, straight + expected, 0.02, source),
            Measure("pressure drop beyond that of a straight channel, ρU²", drop - straight),
        ]

    def profiles(self, run: Record) -> list[Profile]:
        """Return the flow rate along the channel and the velocity across its end, beside the exact ones."""
        (s, rate), (x, u), across = self._rates(run), self._far(run), np.linspace(0, 1, 101)
        exact = across, self._parabola(across)
        return [
            Profile("flow rate", ("$s/D$", "$Q/(UD)$"), (s, rate), (s, np.ones_like(s)), "mass balance"),
            Profile("velocity downstream", ("$(x - R)/D$", "$v/U$"), (x, u), exact, "exact solution (Poiseuille)"),
        ]

    def _known_excess(self) -> tuple[float, str]:
        """Return the pressure that the bend costs beyond a straight channel [ρU²], and whose value that is; or NaN."""
        if self.upstream < 3 or self.downstream < 6:
            return math.nan, ""
        for row in reference.rows("bend_pressure.csv"):
            if (float(row["Re"]), float(row["R_over_D"])) == (self.reynolds, self.inner_radius):
                return float(row["excess"]), "independent finite-element solution (alsph/reference)"
        return math.nan, ""

    @staticmethod
    def _parabola(share: FloatArray) -> FloatArray:
        """Return the exact velocity (n,) far downstream at shares (n,) of the height."""
        return np.asarray(parabola(share, np.ones_like(share))[:, 0])

    @property
    def _before(self) -> float:
        """Distance before the bend of the section that the pressure drop begins at [D]."""
        return self.upstream / 2

    @property
    def _behind(self) -> float:
        """Distance behind the bend of the section that it ends at, and the velocity is compared in [D]."""
        return self.downstream - min(1.0, self.downstream / 2)

    def _section(self, s: float) -> tuple[FloatArray, FloatArray]:
        """Return points (n, 2) across the channel at the distance s along its middle from the bend, and the normal."""
        share = cell_centres(FINE * self.resolution, self.particle_spacing / FINE)
        angle = np.clip(s / self.arc, 0, 1) * np.pi / 2 - np.pi / 2
        outward, normal = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        beyond = s - np.clip(s, 0, self.arc)
        return (self.inner_radius + share)[:, None] * outward + beyond * normal, normal

    def _rates(self, run: Record) -> tuple[FloatArray, FloatArray]:
        """Return distances s (k,) from the bend along the middle and the flow rates (k,) through the sections there."""
        middle = (np.arange(STATIONS) + 0.5) / STATIONS
        s = np.concatenate([-self._before * (1 - middle), self.arc * middle, self.arc + self._behind * middle])
        sections = [self._section(place) for place in s]
        return s, np.array([(sampling.late_velocity(run, points) @ normal).mean() for points, normal in sections])

    def _far(self, run: Record) -> tuple[FloatArray, FloatArray]:
        """Return shares (k,) of the height and the velocities (k,) there near the outlet."""
        points, normal = self._section(self.arc + self._behind)
        return points[:, 0] - self.inner_radius, sampling.late_velocity(run, points) @ normal

    def _pressure_drop(self, run: Record) -> tuple[float, float]:
        """Return how far the pressure falls over the bend and what is before and behind, and that without a bend."""
        first, last = (self._section(s)[0] for s in (-self._before, self.arc + self._behind))
        before, behind = (sampling.late_fields(run, points)[0][:, 2].mean() for points in (first, last))
        return float(before - behind), 12 / self.reynolds * (self._before + self.arc + self._behind)

    def _imbalance(self, run: Record) -> float:
        """Return by how much the recorded force on the bend is not what its two sections leave, over that."""
        history = run.history
        if not len(run.times) or not len(history["time"]):
            return math.nan
        late = history["time"] >= 0.75 * run.times[-1]
        parts = [[f"bend_{part}_force_{axis}" for part in ("pressure", "viscous")] for axis in "xy"]
        recorded = np.array([sum(history[name][late].mean() for name in names) for names in parts])
        left = self._through(run, 0.0) - self._through(run, self.arc)
        return float(np.hypot(*(recorded - left)) / np.hypot(*left))

    def _through(self, run: Record, s: float) -> FloatArray:
        """Return what momentum (2,) the flow and its stresses carry through a section [ρU²D]."""
        points, normal = self._section(s)
        values, gradients = sampling.late_fields(run, points)
        velocity, strain = values[:, :2], gradients[:, :2] + np.swapaxes(gradients[:, :2], 1, 2)
        flux = velocity * (velocity @ normal)[:, None] + values[:, 2:] * normal - strain @ normal / self.reynolds
        return np.asarray(flux.mean(axis=0))
