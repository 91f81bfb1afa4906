"""Columns of water that are let go in a tank with a box on its floor, in 3-D."""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from alsph.arrays import Arrays, FloatArray
from alsph.cases.dam_break import column_pressure
from alsph.cases.free_surface import FreeSurface
from alsph.geometry.domain import Domain, SolidBody
from alsph.geometry.lattice import cell_centres, lattice
from alsph.geometry.particles import join
from alsph.geometry.solids import Solid

Corner = tuple[float, float, float]


class Obstacle(FreeSurface):
    """A column of water H high that is let go in a tank with a box on its floor, 3-D.

    The half up to the plane of symmetry, y = 0, is computed; walls are slip walls, the box is of solid particles. All
    lengths are taken to whole spacings.
    """

    in_space: ClassVar[int] = 3
    velocity_max: ClassVar[float] = 2.5
    splashes: ClassVar[bool] = True
    tank: ClassVar[Corner]
    """Half of the tank up to its plane of symmetry, as high as spray may go [H]."""
    column: ClassVar[float]
    """Length of the column [H]."""
    corners: ClassVar[tuple[Corner, Corner]]
    """Corners of half of the box [H]; what reaches to the top of the tank goes on above it."""
    obstacle: ClassVar[str] = "box"
    """Name of the body."""

    resolution: int = Field(default=20, ge=8, description="particles over the depth of the water, H/Δx [-]")

    @property
    def wet(self) -> float:
        """Depth of the water that lies on the floor in front of the column [H]."""
        return 0.0

    @property
    def middle(self) -> FloatArray:
        """Point that slices for pictures go through [H]: beside the plane of symmetry."""
        return np.array([self.tank[0] / 2, 0.05, 0.05])

    def _cells(self, lengths: ArrayLike) -> NDArray[np.int_]:
        return np.asarray(np.rint(np.asarray(lengths) * self.resolution), int)

    @property
    def box(self) -> FloatArray:
        """Corners (2, 3) of half of the box [H]."""
        return self.whole(self.corners)

    def domain(self) -> Domain:
        """Return half of the tank, whose top is open."""
        return Domain((0, 0, 0), tuple(self.whole(self.tank)), [("slip", "slip"), ("slip", "slip"), ("slip", "air")])

    def bodies(self) -> list[SolidBody]:
        """Return the box."""
        return [SolidBody(self.obstacle, tuple(self.box.mean(axis=0) * [1, 0, 1]))]

    @property
    def coefficient_bodies(self) -> list[str]:
        """Name of the box."""
        return [self.obstacle]

    @property
    def computed_share(self) -> float:
        """Share of the box that is computed."""
        return 0.5

    @property
    def planes_of_symmetry(self) -> tuple[int, ...]:
        """Axis y."""
        return (1,)

    @property
    def initial_volume(self) -> float:
        """That of half of the water [H³]."""
        return float(self.tank[1] * (self.column + (self.tank[0] - self.column) * self.whole(self.wet)))

    def particle_estimate(self) -> int:
        """Return about how many particles there are, with those of the box."""
        return super().particle_estimate() + len(self._solid.position)

    def particles(self) -> Arrays:
        """Return the water at rest, the column with the pressure of its first instant, and the box."""
        length, width, _ = self._cells(self.tank)
        position = lattice(*(cell_centres(count, self.particle_spacing) for count in (length, width, self.resolution)))
        x, y, z = position.T
        (left, _, _), (right, side, _) = self.box
        behind = x < self.whole(self.column)
        before = (z < self.whole(self.wet)) & ~((x > left) & (x < right) & (y < side))
        pressure = self.whole(self.wet) - z
        pressure[behind] = column_pressure(x[behind], z[behind], self.column)
        wet = behind | before
        water = self.fluid(position[wet], np.zeros_like(position[wet]), pressure[wet])
        return join(water, self._solid.particles(np.zeros(3)))

    def _depths(self, position: FloatArray) -> FloatArray:
        """Return how far points (n, 3) lie behind each face of the box (4, n) [H]; a lid of the tank is none."""
        (left, _, _), (right, side, top) = self.box
        x, y, z = position.T
        above = np.inf if top >= self.whole(self.tank)[2] else top
        return np.stack([x - left, right - x, side - y, above - z])

    def solid_height(self, position: FloatArray) -> FloatArray:
        """Return how far points (n, 3) lie outside of the box, beyond the farthest of its faces [H]."""
        return np.asarray(-self._depths(position).min(axis=0))

    @cached_property
    def _solid(self) -> Solid:
        """Cells of the box, which stands on the floor and reaches to the plane of symmetry."""
        axes = (cell_centres(count, self.particle_spacing) for count in self._cells(self.box[1] - self.box[0]))
        position = lattice(*axes) + self.box[0]
        depths = self._depths(position)
        normals = np.array([[-1.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
        least = depths.min(axis=0)
        near = depths < least + 1e-6 * self.particle_spacing  # in edges and corners the bisector
        normal = near.T.astype(float) @ normals
        size = np.linalg.norm(normal, axis=1, keepdims=True)
        kept = least < self.support_layers * self.particle_spacing
        return Solid(position, np.divide(normal, size, out=np.zeros_like(normal), where=size > 0), least).where(kept)


def mean_between(time: FloatArray, value: FloatArray, start: float, end: float) -> float:
    """Return the mean of a curve, values (n,) at times (n,), between two times."""
    return float(np.interp(np.linspace(start, end, 1001), time, value).mean())
