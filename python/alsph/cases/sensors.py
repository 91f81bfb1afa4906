"""Pressure sensors in walls of solid particles."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from alsph.arrays import FloatArray
from alsph.cases.series import Series
from alsph.engine.simulation import Simulation
from alsph.geometry.particles import Kind

NEAR = 1.2
"""Distance along the wall [Δx] of the solid particles from a sensor whose pressures it feels."""

ALIKE = 0.7
"""Least product of their normals and the sensor's: those of edges, whose normal is the bisector, are among them."""


class WallSensors(Series):
    """The pressure at sensors in a wall of solid particles over time, in a file of the run folder; they go with it.

    It is what the first row of solid particles nearby shows, that of the fluid around continued to them: a linear fit
    along the wall, of a sensor with a size the mean over its points.

    Parameters
    ----------
    sensors
        Place (d,) of each, or points (k, d) over its extent, and normal (d,) out of the wall there at the start, by
        name.
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
        self.sensors = [
            (*np.unique(np.atleast_2d(np.asarray(place, float)), axis=0, return_counts=True), np.asarray(normal, float))
            for place, normal in sensors.values()
        ]
        self.body, self.center, self.spacing = body, np.asarray(center, float), spacing
        super().__init__(["time [√(H/g)]", *(f"{name} [ρgH]" for name in sensors)])

    def values(self, simulation: Simulation) -> FloatArray:
        """Return the present pressures (m,); NaN at a sensor without solid particles."""
        state, dimensions = simulation.state(), len(self.center)
        way, turn = np.zeros(dimensions), np.eye(dimensions)
        if "pose" in state:
            from scipy.spatial.transform import Rotation  # takes its time

            way, angle = state["pose"][self.body, :dimensions], state["pose"][self.body, 3:6]
            turn = Rotation.from_rotvec(angle).as_matrix()[:dimensions, :dimensions]
        solid = (state["kind"] == Kind.SOLID) & (state["body"] == self.body)
        place, outward, pressure = (state[name][solid] for name in ("position", "normal", "pressure"))
        place, outward = self.center + (place - self.center - way) @ turn, outward @ turn  # as at the start
        found = []
        for points, weights, normal in self.sensors:
            face = (np.abs((place - points[0]) @ normal) < self.spacing) & (outward @ normal > ALIKE)
            values = [self._felt(place[face] - point, normal, pressure[face]) for point in points]
            found.append(np.average(values, weights=weights))
        return np.array(found)

    def _felt(self, away: FloatArray, normal: FloatArray, pressure: FloatArray) -> float:
        """Return the pressure at a point, of solids (n, d) away from it [D] in the face; NaN without any nearby."""
        along = (away - (away @ normal)[:, None] * normal) / self.spacing
        near = np.linalg.norm(along, axis=1) < NEAR
        return _fitted(along[near], pressure[near]) if near.any() else np.nan


def _fitted(away: FloatArray, pressure: FloatArray) -> float:
    """Return the value at 0 of a linear fit to pressures (n,) at places (n, d) [Δx]: the nearer the heavier.

    Of the slopes that the places cannot tell it has none, and it is not below the air unless one of the pressures is.
    """
    weight = (1 - ((away / NEAR) ** 2).sum(axis=1)) ** 2
    middle, mean = (np.average(each, axis=0, weights=weight) for each in (away, pressure))
    root = np.sqrt(weight)
    slope = np.linalg.lstsq(root[:, None] * (away - middle), root * (pressure - mean), rcond=1e-6)[0]
    return float(max(mean - middle @ slope, min(pressure.min(), 0.0)))
