"""Flow past a circular cylinder in a channel with free-slip walls: the problem of Kolukisa et al. (2021)."""

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from alsph.cases.channel import Channel
from alsph.geometry import FloatArray, Solid, cylinder_rings

RADIUS = 0.5


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
    coefficient_body: ClassVar[str | None] = "cylinder"

    def solid(self) -> Solid:
        """Return concentric rings."""
        return cylinder_rings(RADIUS, self.particle_spacing, self.support_layers)

    def outside(self, points: FloatArray) -> NDArray[np.bool_]:
        """Return which points are at least a radius from the centre."""
        return np.asarray(np.hypot(*points.T) >= RADIUS)

    def surface_points(self) -> tuple[FloatArray, FloatArray]:
        """Return 72 points on the cylinder, every 5 degrees from the front stagnation point over the upper side."""
        angle = np.arange(0.0, 360.0, 5.0)
        radians = np.radians(angle)
        return angle, self.centre + RADIUS * np.stack([-np.cos(radians), np.sin(radians)], axis=1)
