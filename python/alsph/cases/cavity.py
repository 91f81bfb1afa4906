"""Lid-driven cavity: the steady flow in a square box whose top slides."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np
import shapely
from pydantic import Field

from alsph import reference
from alsph.analysis import sampling
from alsph.analysis.measures import Measure, Profile
from alsph.analysis.record import Record
from alsph.arrays import Arrays, FloatArray
from alsph.cases import remarks
from alsph.cases.base import Case
from alsph.geometry.domain import Domain, SolidBody
from alsph.geometry.lattice import cell_centres, cells, lattice
from alsph.geometry.particles import Kind, join, particles
from alsph.geometry.solids import Solid, walls

BOX = shapely.box(0, 0, 1, 1)
LINE = np.linspace(0, 1, 401)[1:-1]
CENTRE_LINES = np.concatenate(
    [np.stack([np.full_like(LINE, 0.5), LINE], 1), np.stack([LINE, np.full_like(LINE, 0.5)], 1)]
)
"""Points (m, 2) on the vertical centre line, then as many on the horizontal one [D]."""


def on_centre_lines(velocity: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return u on the vertical and v on the horizontal centre line, of velocities (m, 2) at `CENTRE_LINES`."""
    vertical, horizontal = np.split(velocity, 2)
    return vertical[:, 0], horizontal[:, 1]


SOURCE = "independent high-order solution"


class Cavity(Case):
    """Flow in a square cavity of side D, driven by its lid at y = D, which slides along x with the velocity U.

    The fluid starts from rest and comes to a steady state. Compared are the velocities on the centre lines with
    independent solutions at Re = 100, 400 and 1000. The steady flow is stable in 2-D up to a Reynolds number of about
    8000.
    """

    name: ClassVar[str] = "cavity"
    title: ClassVar[str] = "lid-driven cavity"
    is_steady: ClassVar[bool] = True

    resolution: int = Field(default=50, ge=8, description="particles per side of the cavity, D/Δx [-]")
    lid: Literal["slides", "in_place"] = Field(
        default="slides", description="whether the particles of the lid go along with it, or stay, as they once did"
    )

    @property
    def default_until(self) -> float:
        """Time by which the flow is steady; it grows with the Reynolds number."""
        return 20.0 + self.reynolds / 25

    @property
    def validated(self) -> tuple[float, float, int]:
        """What has been compared with an independent solution."""
        return (100, 1000, 25)

    @property
    def boundary_layer(self) -> float:
        """As in the flow past a cylinder of the cavity's size: the vortex in it fills it [D]."""
        return remarks.LAYER * math.sqrt(self.kinematic_viscosity)

    def domain(self) -> Domain:
        """Return the cavity; solid particles close all sides."""
        return Domain((0, 0), (1, 1), [("none", "none")] * 2)

    def bodies(self) -> list[SolidBody]:
        """Return the walls at rest, and the lid.

        The lid reaches over both corners. A lid between resting corners tears away from one of them, which sucks fluid
        into the wall.
        """
        slides = self.lid == "slides"
        lid = SolidBody("lid", (0.5, 0.5), (1, 0), moves=slides, belt=self._belt if slides else None)
        return [SolidBody("walls", (0.5, 0.5)), lid]

    @property
    def _belt(self) -> list[float]:
        """Where the lid begins and ends, a layer farther than the fluid sees [D]."""
        beyond = (self.support_layers + 1) * self.particle_spacing
        return [-beyond, 1 + beyond]

    def particles(self) -> Arrays:
        """Return a lattice of fluid at rest and the solid particles around it."""
        solid = walls(BOX, self.particle_spacing, self.support_layers)
        below = solid.position[:, 1] < 1
        lid = self._plate() if self.lid == "slides" else solid.where(~below)
        return join(
            particles(Kind.FLUID, cells(BOX, self.particle_spacing), 0.0),
            solid.where(below).particles(),
            lid.particles([1.0, 0.0], body=1),
        )

    def _plate(self) -> Solid:
        """Return a lid that is the same all along, so that it may slide."""
        spacing, layers = self.particle_spacing, self.support_layers
        x = self._belt[0] + cell_centres(self.resolution + 2 * (layers + 1), spacing)
        position = lattice(x, 1 + cell_centres(layers, spacing))
        return Solid(position, np.broadcast_to([0.0, -1.0], position.shape).copy(), position[:, 1] - 1)

    def measures(self, run: Record) -> list[Measure]:
        """Return the extrema of the velocities on the centre lines, averaged over the last quarter of the run."""
        known = reference.row("cavity_extrema.csv", self.reynolds) or {}
        u, v = self._centre_lines(run)
        extrema = {
            "umin": ("smallest u at x = D/2, U", u.min()),
            "vmax": ("largest v at y = D/2, U", v.max()),
            "vmin": ("smallest v at y = D/2, U", v.min()),
        }
        tolerance = 0.01 if self.reynolds <= 100 else 0.02 if self.reynolds <= 400 else 0.04
        return [
            Measure(name, float(value), float(known.get(column, math.nan)), tolerance, SOURCE if known else "")
            for column, (name, value) in extrema.items()
        ]

    def profiles(self, run: Record) -> list[Profile]:
        """Return u(y) at x = D/2 and v(x) at y = D/2, averaged over the last quarter of the run."""
        name = f"cavity_Re{self.reynolds:g}_profile101.csv"
        known = (reference.FOLDER / name).exists()
        station, u, v = reference.table(name) if known else np.empty((3, 0))
        source = SOURCE if known else ""
        computed_u, computed_v = self._centre_lines(run)
        return [
            Profile("u at x = D/2", ("$y/D$", "$u/U$"), (LINE, computed_u), (station, u), source),
            Profile("v at y = D/2", ("$x/D$", "$v/U$"), (LINE, computed_v), (station, v), source),
        ]

    @staticmethod
    def _centre_lines(run: Record) -> tuple[FloatArray, FloatArray]:
        """Return u at x = D/2 and v at y = D/2 along `LINE`."""
        return on_centre_lines(sampling.late_velocity(run, CENTRE_LINES))
