"""Flow between two cylinders, one in the other, that turn, with its exact transient: a closed ring of fluid."""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar

import numpy as np
from pydantic import Field

from alsph.analysis.averages import error_norms
from alsph.analysis.measures import Measure, Profile
from alsph.analysis.record import Record
from alsph.arrays import Arrays, FloatArray
from alsph.cases.base import Case
from alsph.geometry.domain import Domain, SolidBody
from alsph.geometry.particles import Kind, join, particles
from alsph.geometry.solids import cylinder_rings
from alsph.geometry.volume import ring_of_fluid

TERMS = 60
"""Terms of the series; those that are left out have decayed after t* = 1e-3 Re."""

SOURCE = "exact solution (series of Bessel functions)"


class TaylorCouette(Case):
    """Flow between two concentric cylinders that turn; D is the width of the gap, U the speed of the inner surface.

    The fluid starts from rest and tends to u = Ar + B/r; the exact transient is a series of Bessel functions, which
    those of order 1 that vanish at both cylinders make. In 2-D this flow is stable at any Reynolds number. The outer
    surface has the speed `outer_velocity`, against the inner one where that is negative.
    """

    name: ClassVar[str] = "taylor_couette"
    title: ClassVar[str] = "start-up of flow between turning cylinders"
    from_start: ClassVar[bool] = True
    later_names: ClassVar[tuple[str, ...]] = ("velocity at tU/D = ",)

    reynolds: float = Field(default=10.0, gt=0, description="Reynolds number UD/ν [-]")
    resolution: int = Field(default=20, ge=8, description="particles across the gap, D/Δx [-]")
    inner_radius: float = Field(default=0.5, ge=0.25, le=20, description="radius of the inner cylinder [D]")
    outer_velocity: float = Field(default=0.0, ge=-1, le=1, description="speed of the outer surface [U]")

    @property
    def outer_radius(self) -> float:
        """Radius of the outer cylinder [D]."""
        return self.inner_radius + 1

    @property
    def default_until(self) -> float:
        """A quarter of the diffusion time D²/ν: the flow is then within 10 % of the steady one."""
        return 0.25 * self.reynolds

    def domain(self) -> Domain:
        """Return the square around the outer cylinder, which closes it."""
        radius = self.outer_radius
        return Domain((-radius, -radius), (radius, radius), [("none", "none")] * 2)

    def bodies(self) -> list[SolidBody]:
        """Return the cylinders; their particles stay in place, and have the velocity of the surface above them."""
        return [SolidBody("inner", (0, 0), velocity=None), SolidBody("outer", (0, 0), velocity=None)]

    def particle_estimate(self) -> int:
        """Return about how many particles there are."""
        hollow = max(0.0, self.inner_radius * self.resolution - self.support_layers)
        return round(np.pi * ((self.outer_radius * self.resolution + self.support_layers) ** 2 - hollow**2))

    def particles(self) -> Arrays:
        """Return evenly spaced fluid at rest between rings of solid particles."""
        spacing, layers = self.particle_spacing, self.support_layers
        inner = cylinder_rings(self.inner_radius, spacing, layers)
        outer = cylinder_rings(self.outer_radius, spacing, layers, side=-1)
        solid = np.concatenate([inner.position, outer.position])
        fluid = ring_of_fluid(self.inner_radius, self.outer_radius, self.resolution, solid)
        return join(
            particles(Kind.FLUID, fluid, 0.0),
            inner.particles(_around(inner.position)),
            outer.particles(self.outer_velocity * _around(outer.position), body=1),
        )

    def solid_height(self, position: FloatArray) -> FloatArray:
        """Return how far points (n, 2) lie in the gap [D]."""
        radius = np.hypot(*position.T)
        return np.asarray(np.minimum(radius - self.inner_radius, self.outer_radius - radius))

    @property
    def steady(self) -> tuple[float, float]:
        """A and B of the steady velocity Ar + B/r [U/D, UD]."""
        a, b = self.inner_radius, self.outer_radius
        return (self.outer_velocity * b - a) / (b**2 - a**2), a * b * (b - self.outer_velocity * a) / (b**2 - a**2)

    @cached_property
    def _series(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return wave numbers and, of each term, its coefficient and the coefficient of its torque on both (2, k)."""
        from scipy.optimize import brentq  # slow to load, and most commands do without
        from scipy.special import j1

        a, b = self.inner_radius, self.outer_radius
        places = np.linspace(0.05, (TERMS + 1) * np.pi, 40 * TERMS)
        values = _mode(places, a, b)
        changes = np.flatnonzero(np.diff(np.sign(values)))[:TERMS]
        waves = np.array([brentq(_mode, places[k], places[k + 1], args=(a, b), xtol=1e-14) for k in changes])
        ratio = j1(waves * a) / j1(waves * b)
        slopes = -2 / np.pi * np.stack([1 / a + 0 * ratio, ratio / b])  # by the Wronskian of J and Y
        coefficients = (a * slopes[0] - self.outer_velocity * b * slopes[1]) / (2 / np.pi**2 * (ratio**2 - 1))
        return waves, coefficients, slopes

    def speed(self, radius: FloatArray, time: float) -> FloatArray:
        """Return the exact velocity (n,) around the axis [U] at radii (n,) [D] and a time [D/U]."""
        first, second = self.steady
        waves, coefficients, _ = self._series
        terms = (
            coefficients * np.exp(-(waves**2) * time / self.reynolds) * _mode(waves, self.inner_radius, radius[:, None])
        )
        return np.asarray(first * radius + second / radius - terms.sum(axis=1))

    def torques(self, time: FloatArray) -> FloatArray:
        """Return the exact torques (2, n) of the fluid on the inner and the outer cylinder at times (n,) [ρU²D²]."""
        waves, coefficients, slopes = self._series
        decay = coefficients * np.exp(-np.outer(time, waves**2) / self.reynolds)
        radii = np.array([[self.inner_radius], [self.outer_radius]])
        shear = -2 * self.steady[1] / radii**2 - slopes @ decay.T
        return np.asarray(np.array([[1.0], [-1.0]]) * 2 * np.pi * radii**2 * shear / self.reynolds)

    def exact(self, position: FloatArray, time: float) -> dict[str, FloatArray]:
        """Return the exact ``velocity`` (n, 2) [U] at positions (n, 2) [D] and a time [D/U]."""
        speed = self.speed(np.hypot(*position.T), time)
        return {"velocity": _around(position) * speed[:, None]}

    def measures(self, run: Record) -> list[Measure]:
        """Return the error of the velocity in the last snapshot, and of the outer torque over the last quarter."""
        error = np.nan
        if (run.times > 0).any():
            snapshot = run.snapshot()
            exact = self.exact(snapshot.position[snapshot.fluid], snapshot.time)["velocity"]
            error = error_norms(snapshot.velocity[snapshot.fluid], exact)["l2"]
        return [
            Measure("relative L2 error of the velocity", error, 0.0, 0.02, SOURCE),
            *(
                Measure(f"torque on the {name} cylinder, ρU²D²", recorded, exact, 0.03, SOURCE)
                for name, recorded, exact in zip(("inner", "outer"), *self._mean_torques(run), strict=True)
            ),
        ]

    def _mean_torques(self, run: Record) -> list[list[float]]:
        """Return recorded and exact torques on both cylinders, averaged over the last quarter of the time."""
        history = run.history
        if not len(history["time"]):
            return [[np.nan] * 2] * 2
        late = history["time"] >= 0.75 * history["time"][-1]
        parts = [[f"{body.name}_{part}_torque" for part in ("pressure", "viscous")] for body in self.bodies()]
        recorded = np.array([sum(history[name][late].mean() for name in names) for names in parts])
        return [recorded.tolist(), self.torques(history["time"][late]).mean(axis=1).tolist()]

    def profiles(self, run: Record) -> list[Profile]:
        """Return the particles' velocities around the axis in the last snapshot over their distance from it."""
        if not len(run.times):
            return []
        snapshot = run.snapshot()
        position, velocity = snapshot.position[snapshot.fluid], snapshot.velocity[snapshot.fluid]
        radius, speed = np.hypot(*position.T), (velocity * _around(position)).sum(axis=1)
        order, radii = np.argsort(radius), np.linspace(self.inner_radius, self.outer_radius, 201)
        name = f"velocity at tU/D = {snapshot.time:.2f}"
        exact = radii, self.speed(radii, snapshot.time)
        return [Profile(name, ("$r/D$", r"$u_\theta/U$"), (radius[order], speed[order]), exact, SOURCE)]


def _mode(wave: FloatArray, inner: float, radius: FloatArray | float) -> FloatArray:
    """Return J(kr) Y(ka) - Y(kr) J(ka) of order 1, which vanishes at r = a."""
    from scipy.special import j1, y1  # slow to load, and most commands do without

    return np.asarray(j1(wave * radius) * y1(wave * inner) - y1(wave * radius) * j1(wave * inner))


def _around(position: FloatArray) -> FloatArray:
    """Return the unit vectors (n, 2) around the axis at positions (n, 2)."""
    x, y = position.T
    return np.asarray(np.stack([-y, x], axis=1) / np.hypot(x, y)[:, None])
