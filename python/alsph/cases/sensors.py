"""Pressure sensors in walls of solid particles."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from alsph.arrays import FloatArray
from alsph.cases.series import Series
from alsph.engine.simulation import Simulation
from alsph.geometry.particles import Kind

NEAR = 1.01
"""Distance [Δx] of the solid particles from a sensor whose pressures it feels."""

ALIKE = 0.9
"""Least product of their normals and the sensor's."""


class WallSensors(Series):
    """The pressure at sensors in a wall of solid particles over time, in a file of the run folder; they go with it.

    It is the mean of what the solid particles nearby show: that of the fluid around, continued to them.

    Parameters
    ----------
    sensors
        Place (d,) of each and normal (d,) out of the wall there at the start, by name.
    body, center
        Number of the body that they are in, and its centre (d,).
    spacing
        Particle spacing Δx.
    """

    file = "output_sensors.csv"
    interval = 0.01

    def __init__(
        self, sensors: Mapping[str, tuple[FloatArray, FloatArray]], body: int, center: FloatArray, spacing: float
    ) -> None:
        self.points, self.normals = (np.array(each, float) for each in zip(*sensors.values(), strict=True))
        self.body, self.center, self.spacing = body, np.asarray(center, float), spacing
        super().__init__(["time [√(H/g)]", *(f"{name} [ρgH]" for name in sensors)])

    def values(self, simulation: Simulation) -> FloatArray:
        """Return the present pressures (m,); NaN at a sensor without solid particles."""
        state, dimensions = simulation.state(), self.points.shape[1]
        points, normals = self.points, self.normals
        if "pose" in state:
            from scipy.spatial.transform import Rotation  # takes its time

            way, angle = state["pose"][self.body, :3], state["pose"][self.body, 3:6]
            turn = Rotation.from_rotvec(angle).as_matrix()[:dimensions, :dimensions]
            points = self.center + way[:dimensions] + (points - self.center) @ turn.T
            normals = normals @ turn.T
        solid = (state["kind"] == Kind.SOLID) & (state["body"] == self.body)
        place, outward, pressure = (state[name][solid] for name in ("position", "normal", "pressure"))
        found = []
        for point, normal in zip(points, normals, strict=True):
            near = (np.linalg.norm(place - point, axis=1) < NEAR * self.spacing) & (outward @ normal > ALIKE)
            found.append(pressure[near].mean() if near.any() else np.nan)
        return np.array(found)
