"""A cylinder that floats, let go above its draught."""

from __future__ import annotations

import math
from functools import cache, cached_property
from typing import Any, ClassVar, Self

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field, model_validator

from alsph.analysis.measures import Measure, Profile
from alsph.analysis.record import Record
from alsph.arrays import FloatArray
from alsph.cases.free_surface import FreeSurface
from alsph.errors import ConfigError
from alsph.geometry.domain import Domain, SolidBody
from alsph.geometry.lattice import cell_centres, lattice
from alsph.geometry.packing import Immersed, pack
from alsph.geometry.particles import join
from alsph.geometry.rigid import Rigid
from alsph.geometry.solids import Solid, body_layers
from alsph.symbols import Symbols

SOURCE = "linear theory (boundary elements)"

MASS = math.pi / 2
"""Of the cylinder, half as dense as water [ρR²]."""

PANEL = 0.1
"""Length of a boundary element [R]: halving it changes the motion by 1e-4."""

FIRST, SECOND = 4.0, 8.0
"""Times after the first trough, and after the second crest [√(R/g)]."""

STEP = 0.05
"""Time step that linear theory is told at [√(R/g)]."""


@cache
def linear_heave(until: float, depth: float, tank_length: float) -> tuple[FloatArray, FloatArray]:
    """Return the motion of the cylinder in a potential flow that disturbs the surface but little.

    Green's identity on constant elements along the half immersed cylinder, the level surface and the end of the tank,
    with images in the middle and beyond the floor, turns ∂η/∂t = ∂φ/∂y, ∂φ/∂t = −gη and Newton's law into ordinary
    differential equations, which are solved exactly. In a deep and long tank it is the motion of Maskell and Ursell
    (Journal of Fluid Mechanics 44 (1970) 303).

    Parameters
    ----------
    until : float
        Time to follow it to [√(R/g)].
    depth, tank_length : float
        Depth of the water and length of the tank [R].

    Returns
    -------
    time, height : array of shape (n,)
        Times since it was let go [√(R/g)]; the height over its draught, over that at first.
    """
    from scipy.linalg import expm  # half a second that most commands do without

    half = tank_length / 2
    cylinder = -1j * np.exp(1j * np.linspace(0, math.pi / 2, 1 + 2 * round(math.pi / 2 / PANEL)))
    surface = np.linspace(1, half, 1 + round((half - 1) / PANEL)) + 0j
    wall = half - 1j * np.linspace(0, depth, 1 + round(depth / PANEL))
    lines = cylinder, surface, wall
    ends = np.stack([np.concatenate([line[:-1] for line in lines]), np.concatenate([line[1:] for line in lines])])
    size = np.abs(ends[1] - ends[0])
    source = dipole = np.zeros((len(size), len(size)))
    for image, way_round in ((ends, 1), (-ends.conj(), -1), (ends.conj() - 2j * depth, -1), (-ends - 2j * depth, 1)):
        u, v = ((ends.mean(axis=0)[:, None] - end) / ((image[1] - image[0]) / size) for end in (image[1], image[0]))
        source = source + (u * np.log(u) - u - v * np.log(v) + v).real
        dipole = dipole + way_round * np.angle(u / v)
    np.fill_diagonal(dipole, 0.0)
    np.fill_diagonal(dipole, -dipole.sum(axis=1))
    place = np.repeat(np.arange(3), [len(line) - 1 for line in lines])
    below, level = place == 0, place == 1
    # The length of the cylinder's elements along x, or the velocity through them at unit speed.
    across = (ends[1] - ends[0])[below].real
    known = np.column_stack([-dipole[:, level], source[:, below] @ (across / size[below])])
    found = np.linalg.solve(np.where(level, -source, dipole), known)
    force, rise = 2 * across @ found[below], found[level]
    inertia, count = MASS + force[-1], int(level.sum())
    # η, φ at the surface; height and velocity of the cylinder.
    system = np.zeros((2 * count + 2,) * 2)
    system[:count, count:-2], system[:count, -1] = rise[:, :-1], rise[:, -1]
    system[count:-2, :count] = -np.eye(count)
    system[-2, -1] = 1
    system[-1, :count], system[-1, -2] = force[:-1] / inertia, -2 / inertia
    propagator = expm(STEP * system)
    state, heights = np.eye(2 * count + 2)[-2], []
    for _ in range(math.ceil(until / STEP) + 1):
        heights.append(state[-2])
        state = propagator @ state
    return STEP * np.arange(len(heights), dtype=float), np.array(heights)


class HeavingCylinder(FreeSurface):
    """A cylinder half as dense as water that is let go above its draught, in a tank with slip walls.

    It heaves, and sends waves away, which take its energy. Free to move up and down. Lengths are in the cylinder's
    radius R, velocities in √(gR).
    """

    name: ClassVar[str] = "heaving_cylinder"
    title: ClassVar[str] = "cylinder that heaves"
    symbols: ClassVar[Symbols] = Symbols("R", "√(gR)", "√(R/g)", "√(g/R)", "g", "ρgR", "t√(g/R)")
    later_names: ClassVar[tuple[str, ...]] = (
        "first trough over the lift",
        "second crest over the lift",
        "largest difference over the lift",
        "heave",
    )

    resolution: int = Field(default=20, ge=6, description="particles per radius, R/Δx [-]")
    lift: float = Field(default=0.2, gt=0, lt=1, description="height above its draught that it is let go at [R]")
    depth: float = Field(default=4.0, gt=2, description="depth of the water [R]")
    tank_length: float = Field(default=24.0, gt=4, description="length of the tank [R]")

    @model_validator(mode="after")
    def _stands_on_whole_cells(self) -> Self:
        for name in ("depth", "tank_length"):
            self.whole_cells(name, getattr(self, name))
        if self.depth < 1 - self.lift + self.support_layers * self.particle_spacing:
            raise ConfigError(f"depth = {self.depth:g}: the cylinder would stand on the floor")
        return self

    @property
    def default_until(self) -> float:
        """Two periods."""
        return 12.0

    @property
    def reference_velocity(self) -> float:
        """That of long waves."""
        return math.sqrt(self.depth)

    @property
    def coefficient_bodies(self) -> list[str]:
        """Name of the cylinder."""
        return ["cylinder"]

    def domain(self) -> Domain:
        """Return the tank, whose top is open; the undisturbed level is y = 0."""
        half = self.tank_length / 2
        return Domain((-half, -self.depth), (half, 2.0), [("slip", "slip"), ("slip", "air")])

    def bodies(self) -> list[SolidBody]:
        """Return the cylinder."""
        rigid = Rigid(MASS, MASS / 2, displaced=MASS, free=(False, True, False))
        return [SolidBody("cylinder", (0, self.lift), rigid=rigid)]

    @property
    def _shape(self) -> shapely.Polygon:
        return shapely.Point(0, self.lift).buffer(1.0, quad_segs=16 * self.resolution)

    @cached_property
    def _solid(self) -> Solid:
        return body_layers(self._shape, self.particle_spacing, self.support_layers)

    @property
    def initial_volume(self) -> float:
        """That of the water [R²]."""
        angle = math.acos(self.lift)
        return self.tank_length * self.depth - angle + self.lift * math.sin(angle)

    def particle_estimate(self) -> int:
        """Return about how many particles there are, with those of the cylinder."""
        return super().particle_estimate() + len(self._solid.position)

    def particles(self) -> dict[str, NDArray[Any]]:
        """Return water at rest around the cylinder."""
        columns = self.whole_cells("tank_length", self.tank_length)
        rows = self.whole_cells("depth", self.depth)
        spacing, solid = self.particle_spacing, self._solid
        cells = lattice(cell_centres(columns, spacing) - self.tank_length / 2, cell_centres(rows, spacing) - self.depth)
        cylinder = Immersed(self._shape, self.tank_length * self.depth - self.initial_volume)
        position = pack(cells, cylinder, solid.position, spacing)
        return join(self.fluid(position, np.zeros_like(position), -position[:, 1]), solid.particles())

    def _heave(self, run: Record) -> tuple[FloatArray, FloatArray]:
        """Return times, and heights over the draught over the lift."""
        if "cylinder_displacement_y" not in run.history:
            return np.empty(0), np.empty(0)
        return run.history["time"], 1 + run.history["cylinder_displacement_y"] / self.lift

    def measures(self, run: Record) -> list[Measure]:
        """Return the first trough, the second crest and the largest difference, beside linear theory."""
        time, height = self._heave(run)
        if not len(time) or time[-1] < SECOND:
            return []
        times, linear = linear_heave(time[-1], self.depth, self.tank_length)
        difference = np.abs(height - np.interp(time, times, linear)).max()
        return [
            Measure(
                "first trough over the lift", height[time < SECOND].min(), linear[times < SECOND].min(), 0.1, SOURCE
            ),
            Measure("second crest over the lift", height[time > FIRST].max(), linear[times > FIRST].max(), 0.1, SOURCE),
            Measure("largest difference over the lift", float(difference), 0.0, 0.05, SOURCE),
        ]

    def energy_measures(self, run: Record) -> list[Measure]:
        """Return none: the cylinder has energy, too."""
        return []

    def profiles(self, run: Record) -> list[Profile]:
        """Return the height over time beside linear theory."""
        time, height = self._heave(run)
        if not len(time) or time[-1] <= 0:
            return []
        axes = ("$t\\sqrt{g/R}$", "height of the cylinder over its draught, over the lift")
        return [Profile("heave", axes, (time, height), linear_heave(time[-1], self.depth, self.tank_length), SOURCE)]
