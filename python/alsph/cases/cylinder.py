"""Flow past a circular cylinder in a channel with free-slip walls: the problem of Kolukisa et al. (2021)."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from alsph import reference
from alsph.analysis.measures import Measure, Profile
from alsph.analysis.record import Record
from alsph.arrays import FloatArray
from alsph.cases.channel import Channel
from alsph.geometry.solids import Solid, cylinder_rings
from alsph.geometry.surface import Surface, circle
from alsph.reference import Reference

RADIUS = 0.5
FAR = {"height": 60.0, "upstream": 15.0, "length": 40.0}
"""Dimensions [D] from which on the sides no longer act on the cylinder."""

UNKNOWN = "not validated: this channel; what has no slip or is off centre is compared as confined_cylinder comes"


class Cylinder(Channel):
    """Flow past a circular cylinder of diameter D in a channel with free-slip walls and uniform inflow U.

    The defaults are the channel of Kolukisa, Ozbulut and Yildiz (Symmetry 2021, 13, 472). The inlet lies at x = 0 and
    the centre line at y = 0; lengths are in D, velocities in U.

    This channel is narrow. Values for a cylinder in unbounded flow, such as those of Qu et al. (2013) for Re = 100,
    C_D = 1.317, C_L rms = 0.225 and Sr = 0.165, hold in a domain of 60 D and more: `height=60, upstream=30, length=90`.
    """

    name: ClassVar[str] = "cylinder"
    title: ClassVar[str] = "flow past a circular cylinder in a channel"
    body_name: ClassVar[str] = "cylinder"
    later_names: ClassVar[tuple[str, ...]] = (
        "largest error of the pressure coefficient beyond 10 degrees",
        "pressure coefficient",
    )

    @property
    def validated(self) -> tuple[float, float, int]:
        """What has been compared with an independent solution."""
        return (100, 300, 10)

    def remarks(self) -> list[str]:
        """Return what is to be said of the resolution, the method and the channel."""
        unknown = (self.is_confined or self.body_offset) and self._reference() is None
        return [*super().remarks(), *([UNKNOWN] if unknown else [])]

    def solids(self) -> list[Solid]:
        """Return concentric rings."""
        return [cylinder_rings(RADIUS, self.particle_spacing, self.support_layers)]

    def fluid(self, cells: FloatArray) -> FloatArray:
        """Return the cells whose centres are at least a radius from that of the cylinder."""
        return np.asarray(cells[np.hypot(*(cells - self.centre).T) >= RADIUS])

    def solid_height(self, position: FloatArray) -> FloatArray:
        """Return how far points (n, 2) lie outside of the cylinder [D]."""
        return self._within_sides(np.hypot(*(position - self.centre).T) - RADIUS, position)

    def surface_points(self) -> Surface:
        """Return 72 points on the cylinder, every 5 degrees from the front stagnation point over the upper side."""
        return circle(RADIUS, 72).moved(self.centre)

    def fluid_volume(self) -> float:
        """Return the area of the channel without the cylinder."""
        return self.length * self.height - math.pi * RADIUS**2

    def measures(self, run: Record) -> list[Measure]:
        """Return forces and Strouhal number, and the error of the pressure coefficient where its curve is known.

        With a rule, such as that of a surface that slides, also the mean lift.
        """
        measures = super().measures(run)
        if self.rules:
            known = self._reference() or Reference({}, "")
            lift = known.results.get("mean lift coefficient", math.nan)
            measures.append(Measure("mean lift coefficient", run.lift.mean, lift, 0.02, known.source))
        for profile in self.profiles(run):
            if not profile.reference[0].size or not profile.computed[0].size:
                continue
            (angle, mean), expected = profile.computed, np.interp(profile.computed[0], *profile.reference)
            error = np.abs(mean - expected)[angle > 10].max()
            name = "largest error of the pressure coefficient beyond 10 degrees"
            measures.append(Measure(name, float(error), 0.0, 0.05, profile.source))
        return measures

    def profiles(self, run: Record) -> list[Profile]:
        """Return the mean pressure coefficient over the angle, the mean of both sides."""
        known, found = self._reference(), run.pressure_coefficient
        angle, mean = np.empty(0), np.empty(0)
        if found.theta.size:
            upper = found.theta <= 180
            lower = np.interp(360 - found.theta[upper], found.theta, found.mean, period=360)
            angle, mean = found.theta[upper], (found.mean[upper] + lower) / 2
        axes = r"$\theta$ from the front stagnation point [degrees]", "$C_p$"
        expected = known.pressure_coefficient if known else None
        reference, source = (expected, known.source) if known and expected else ((np.empty(0), np.empty(0)), "")
        return [Profile("pressure coefficient", axes, (angle, mean), reference, source)]

    def _reference(self) -> Reference | None:
        """Return the independent solution of this flow, None where there is none."""
        if self.is_confined or self.body_offset:
            return None
        if (self.length, self.height, self.upstream) == (14.0, 13.0, 4.0):
            return reference.cylinder_in_channel(self.reynolds)
        if all(getattr(self, name) >= least for name, least in FAR.items()):
            return reference.unconfined_cylinder(self.reynolds)
        return None
