"""Loads, divergence and surface pressure of a run, averaged over the window that is found for it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cached_property

import numpy as np

from alsph.analysis import averages
from alsph.analysis.averages import Estimate, Window
from alsph.analysis.loads import Divergence, Load, PressureCoefficient
from alsph.arrays import AXES, FloatArray
from alsph.errors import ConfigError, RunFolderError
from alsph.folder import reading
from alsph.geometry.particles import Kind
from alsph.geometry.points import checked_point
from alsph.parameters import choose
from alsph.results.fields import Fields
from alsph.text import shown

MOST_SNAPSHOTS = 12
"""Of which the divergence at the end of a step is taken."""


class Loads(Fields):
    """The part of :class:`alsph.Run` that averages over time."""

    @property
    def bodies(self) -> list[str]:
        """Names of the bodies that forces were recorded for."""
        suffix = "_pressure_force_x"
        return [name.removesuffix(suffix) for name in self.history if name.endswith(suffix)]

    @property
    def body(self) -> str | None:
        """Name of the body in the flow that drag and lift are those of, or names of several; None between walls."""
        return ", ".join(self.config.case.coefficient_bodies) or None

    def _chosen(self, body: str | None, part: str) -> tuple[list[str], tuple[str, ...]]:
        """Return the bodies and the parts that a load is the sum of."""
        choose("part", part, ("total", "pressure", "viscous"))
        if body is not None:
            choose("body", body, self.bodies or [known.name for known in self.config.case.checked_bodies])
        free = {known.name for known in self.config.case.checked_bodies if known.rigid}
        walls = [name for name in self.bodies if name not in free][:1]
        names = [body] if body else self.config.case.coefficient_bodies or walls
        return names, ("pressure", "viscous") if part == "total" else (part,)

    def coefficient(self, axis: str, part: str = "total", body: str | None = None) -> FloatArray:
        """Force coefficient in every step, F / (½ρU²A), A the case's :attr:`~alsph.cases.Case.reference_area`.

        Parameters
        ----------
        axis : {"x", "y", "z"}
            Direction of the force; drag is ``x`` and lift ``y``.
        part : {"total", "pressure", "viscous"}
        body : str, optional
            Name of the body; if None those of :attr:`body` together, or between walls the first that is not free.

        Returns
        -------
        ndarray, shape (steps,)
            NaN if the run has no body.

        Raises
        ------
        ConfigError
            If there is no such direction, part or body.
        """
        return 2.0 * self._force(axis, part, body) / self.config.case.reference_area

    def _force(self, axis: str, part: str, body: str | None) -> FloatArray:
        """Force in every step (steps,) [ρU²D^(d-1)], arguments as in :meth:`coefficient`."""
        axes = [name for name in AXES if name != "z" or self.config.case.space_dimensions == 3]
        if axis not in axes:
            raise ConfigError(f"axis = {shown(axis)}: unknown; known: {', '.join(axes)}; the drag is x and the lift y")
        names, parts = self._chosen(body, part)
        columns = [self.history.get(f"{name}_{each}_force_{axis}") for each in parts for name in names or [""]]
        missing = np.full(len(self.history["time"]), np.nan)
        return sum((missing if column is None else column for column in columns), np.zeros_like(missing))

    @cached_property
    def window(self) -> Window:
        """Averaging window, found from the lift and the drag (see :func:`alsph.analysis.window.averaging_window`)."""
        time = self.history["time"]
        if not self.config.case.settles:
            return averages.whole_record(time)
        missing = np.full(len(time), np.nan)
        drag, lift = (self.coefficient(axis) for axis in "xy") if self.body else (missing, missing)
        return averages.averaging_window(time, drag, lift, self.config.case.thickness if self.body else 1.0)

    @cached_property
    def drag(self) -> Load:
        """Drag coefficient of the body, of all bodies together if there are several."""
        return self.load("x")

    @cached_property
    def lift(self) -> Load:
        """Lift coefficient of the body, of all bodies together if there are several."""
        return self.load("y")

    def load(self, axis: str, body: str | None = None) -> Load:
        """Force coefficient of a body along an axis over the averaging window (arguments as in :meth:`coefficient`)."""
        return self._load(*(self.coefficient(axis, part, body) for part in ("total", "pressure", "viscous")))

    def _load(self, total: FloatArray, pressure: FloatArray, viscous: FloatArray) -> Load:
        return Load(
            mean=self._measure(averages.mean, total),
            rms=self._measure(averages.root_mean_square, total),
            amplitude=self._measure(averages.amplitude, total),
            pressure=self._measure(averages.mean, pressure),
            viscous=self._measure(averages.mean, viscous),
        )

    def moment_coefficient(
        self, part: str = "total", body: str | None = None, about: Sequence[float] | None = None
    ) -> FloatArray:
        """Pitching moment coefficient of a body in every step, M / (½ρU²c²), nose up positive, in 2-D.

        The flow comes from the left, so that nose up is clockwise. c is the case's :attr:`~alsph.cases.Case.chord`.

        Parameters
        ----------
        part : {"total", "pressure", "viscous"}
        body : str, optional
            Name of the body; all of those that drag and lift are of, if None.
        about : (x, y), optional
            Point that the moment is about, which stays where it is [D]; if None, that of the case: a quarter of the
            chord behind the leading edge of a ``body``, the centre of a cylinder. That goes along with a body that
            moves, unless it is that of several.

        Returns
        -------
        ndarray, shape (steps,)
            NaN if the run has no body.

        Raises
        ------
        ConfigError
            If there is no such part or body, or `about` is no point.
        """
        case = self.config.case
        names, parts = self._chosen(body, part)
        point = case.moment_point if about is None else checked_point("about", about)
        centres = {each.name: each.center for each in case.checked_bodies}
        missing = np.full(len(self.history["time"]), np.nan)
        moment = np.zeros_like(missing) if names else missing
        for name in names:
            for each in parts:
                moment += self.history.get(f"{name}_{each}_torque", missing)
            x, y = np.subtract(centres.get(name, np.nan), point)
            if about is None and len(names) == 1:
                turned = self.history.get(f"{name}_angle", 0.0)
                x, y = x * np.cos(turned) - y * np.sin(turned), x * np.sin(turned) + y * np.cos(turned)
            else:
                x, y = (
                    way + self.history.get(f"{name}_displacement_{axis}", 0.0) for way, axis in ((x, "x"), (y, "y"))
                )
            moment += x * self._force("y", part, name) - y * self._force("x", part, name)
        return -2.0 * moment / case.chord**2

    def moment(self, about: Sequence[float] | None = None, body: str | None = None) -> Load:
        """Pitching moment coefficient over the averaging window (arguments as in :meth:`moment_coefficient`)."""
        return self._load(*(self.moment_coefficient(part, body, about) for part in ("total", "pressure", "viscous")))

    @cached_property
    def strouhal(self) -> Estimate:
        """Strouhal number fD/U of the lift."""
        return self._measure(averages.strouhal, self.coefficient("y"))

    @cached_property
    def averaged(self) -> dict[str, Estimate]:
        """What a body is averaged for: mean drag C_D' and, with shedding, rms lift C_L' and Strouhal number Sr."""
        drag = {"C_D'": self._measure(averages.mean, self.coefficient("x"))}
        if not self.window.periods:
            return drag
        return drag | {"C_L'": self._measure(averages.root_mean_square, self.coefficient("y")), "Sr": self.strouhal}

    @cached_property
    def divergence(self) -> Divergence:
        """Velocity divergence over the averaging window."""
        columns = (self.history.get(f"divergence_{name}", np.empty(0)) for name in ("mean", "sum", "max"))
        mean, total, largest = (self._measure(averages.mean, column) for column in columns)
        return Divergence(mean, total, largest, self._divergence_at_end())

    def _divergence_at_end(self) -> Estimate:
        """Return the mean |∇·u| of the fluid in snapshots of the window, in some of them where they are many."""
        found = []
        with suppress(RunFolderError):  # without particles forces can be judged all the same
            inside = np.flatnonzero(self.window.holds(self.times) & (self.times > 0))  # at the start no step has ended
            some, names = inside[:: 1 + len(inside) // MOST_SNAPSHOTS].tolist(), ("velocity_divergence", "kind")
            parts = reading.snapshot_fields(self.file("particles.vtkhdf"), some, names) if len(some) else []
            found = [np.abs(divergence[kind == Kind.FLUID]).mean() for divergence, kind in parts]
        if not found:
            return Estimate(np.nan, note="no snapshot between these times")
        return Estimate(np.mean(found), note=f"of {len(found)} snapshots")

    @cached_property
    def pressure_coefficient(self) -> PressureCoefficient:
        """Mean pressure coefficient (22) on the surface."""
        angle, time, samples = reading.surface(self.file("surface.h5"))
        mean, deviation = averages.mean_profile(time, samples, self.window)
        inside = np.count_nonzero(self.window.holds(time))
        surface = reading.surface_points(self.file("surface.h5"))
        if surface is None:  # of an older version, be it at the same points
            case = self.config.case.surface_points()
            surface = case if case and np.array_equal(case.angle, angle) else None
        return PressureCoefficient(angle, mean, deviation, int(inside), self.window.developing, surface)

    def _measure(self, measure: Callable[[FloatArray, FloatArray, Window], Estimate], values: FloatArray) -> Estimate:
        if np.isnan(values).all():
            return Estimate(np.nan, note="no steps recorded yet" if len(values) == 0 else "no body to measure")
        found = measure(self.history["time"], values, self.window)
        return found if self.config.case.settles else Estimate(found, note=self.window.rule)
