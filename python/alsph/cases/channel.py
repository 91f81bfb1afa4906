"""What the cases of a body in a channel share: inlet, outlet, free-slip walls, the flow at the start, the forces."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator, model_validator

from alsph.analysis.measures import Measure
from alsph.analysis.record import Record
from alsph.arrays import FloatArray
from alsph.cases import remarks
from alsph.cases.base import Case
from alsph.geometry.domain import Boundary, Domain, SolidBody
from alsph.geometry.lattice import cell_centres, lattice, symmetric_centres
from alsph.geometry.particles import Kind, join, particles
from alsph.geometry.solids import Solid
from alsph.reference import Reference


class Channel(Case):
    """Flow past a body in a channel with free-slip walls and uniform inflow U.

    The inlet lies at x = 0 and the centre line at y = 0; lengths are in D, velocities in U.
    """

    velocity_max: ClassVar[float] = 1.5
    of_the_start: ClassVar[tuple[str, ...]] = ("perturbation",)
    body_name: ClassVar[str]
    across: ClassVar[tuple[str, ...]] = ("height",)
    """Parameters that are the extents of the channel along y, and along z in 3-D."""

    reynolds: float = Field(default=200.0, gt=0, description="Reynolds number UD/ν [-]")
    resolution: int = Field(default=20, gt=0, description="particles per reference length, D/Δx; at least 8 [-]")
    length: float = Field(default=14.0, gt=0, description="length of the channel [D]")
    height: float = Field(default=13.0, gt=0, description="height of the channel [D]")
    upstream: float = Field(default=4.0, gt=0, description="distance from the inlet to the centre of the body [D]")
    perturbation: float = Field(
        default=0.1,
        ge=0,
        le=1,
        description="largest velocity of an initial vortex about the body that starts shedding; 0: symmetric [U]",
    )

    @field_validator("resolution")
    @classmethod
    def _resolved(cls, resolution: int) -> int:
        if resolution < 8:
            raise ValueError("too coarse for the body; use 8 or more")
        return resolution

    @model_validator(mode="after")
    def _fits(self) -> Self:
        room = {name: getattr(self, name) / 2 for name in self.across}
        for name, left in (room | {"upstream": self.upstream, "length": self.length - self.upstream}).items():
            if left < 1:
                known = ", ".join(f"{each} {getattr(self, each):g}" for each in ("length", *self.across, "upstream"))
                raise ValueError(
                    f"{name} = {getattr(self, name):g}: the {self.body_name} does not fit; leave at least 1 D from "
                    f"centre to each side ({known})"
                )
        for name in ("length", *self.across):
            self.whole_cells(name, getattr(self, name))
        return self

    @property
    def section(self) -> FloatArray:
        """Extents of the channel across the stream (d - 1,) [D]."""
        return np.array([getattr(self, name) for name in self.across])

    @property
    def coefficient_bodies(self) -> list[str]:
        """Names of the bodies that drag and lift are those of, all together."""
        return [self.body_name]

    @abstractmethod
    def solids(self) -> list[Solid]:
        """Return the solid particles of each body, relative to the centre."""

    @abstractmethod
    def fluid(self, cells: FloatArray) -> FloatArray:
        """Return the positions (m, 2) of the fluid, given the cell centres (n, 2) of the whole channel."""

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Left, bottom, right and top of the body, relative to its centre [D]."""
        return -0.5, -0.5, 0.5, 0.5

    @property
    def size(self) -> float:
        """Larger extent of the body, of the smallest one if there are several [D]."""
        return 1.0

    @property
    def boundary_layer(self) -> float:
        """That at the front of a cylinder of the body's larger extent [D]."""
        return remarks.LAYER * math.sqrt(self.kinematic_viscosity * self.size)

    def remarks(self) -> list[str]:
        """Return what is to be said of the resolution, the method and the channel."""
        behind = self.length - self.upstream - self.bounds[2]
        return [*super().remarks(), *remarks.channel(self.blocked, self.upstream, behind, self.blockage, self.slowed)]

    @property
    def blocked(self) -> float:
        """How much of the channel's height the body blocks [D]."""
        _, bottom, _, top = self.bounds
        return top - bottom

    @property
    def blockage(self) -> float:
        """Share of the channel's section that the body blocks [-]."""
        return self.blocked / self.height

    @property
    def slowed(self) -> float:
        """Share by which a cylinder of the body's extent across the stream slows the stream at the inlet [-]."""
        return (0.5 * self.blocked / self.upstream) ** 2

    @property
    def default_until(self) -> float:
        """Some ten shedding periods."""
        return 60.0

    @property
    def centre(self) -> FloatArray:
        """Centre of the body (d,) [D]."""
        return np.array([self.upstream, *0 * self.section])

    def domain(self) -> Domain:
        """Return the channel: inlet at x = 0, outlet at x = length, free-slip walls at y = ± height/2 and z alike."""
        half = self.section / 2
        walls: list[tuple[Boundary, Boundary]] = [("slip", "slip")] * len(half)
        return Domain((0, *-half), (self.length, *half), [("inlet", "outlet"), *walls])

    def bodies(self) -> list[SolidBody]:
        """Return the bodies, at rest; their torques are about the centre."""
        return [SolidBody(name, tuple(self.centre)) for name in self.coefficient_bodies]

    def particles(self) -> dict[str, NDArray[Any]]:
        """Return a uniform lattice around the body's solid particles, impulsively started."""
        spacing = self.particle_spacing
        rows = [symmetric_centres(self.whole_cells(name, getattr(self, name)), spacing) for name in self.across]
        buffer = cell_centres(self.buffer_columns, spacing)
        channel = lattice(cell_centres(self.whole_cells("length", self.length), spacing), *rows)
        stream = np.eye(self.space_dimensions)[0]
        fluid = self.fluid(channel)
        return join(
            particles(Kind.FLUID, fluid, self._initial_velocity(fluid)),
            particles(Kind.INLET, lattice(-buffer, *rows), stream),
            particles(Kind.OUTLET, lattice(self.length + buffer, *rows), stream),
            *(solid.moved(self.centre).particles(body=index) for index, solid in enumerate(self.solids())),
        )

    def measures(self, run: Record) -> list[Measure]:
        """Return the forces on the body and the Strouhal number."""
        known = self._reference() or Reference({}, "")
        computed = {
            "mean drag coefficient": (run.drag.mean, 0.02),
            "mean drag coefficient, pressure part": (run.drag.pressure, 0.03),
            "mean drag coefficient, viscous part": (run.drag.viscous, 0.03),
            "rms lift coefficient": (run.lift.rms, 0.05),
            "lift coefficient amplitude": (run.lift.amplitude, 0.05),
            "Strouhal number": (run.strouhal, 0.01),
        }
        return [
            Measure(name, value, known.results.get(name, math.nan), tolerance, known.source)
            for name, (value, tolerance) in computed.items()
        ]

    def _reference(self) -> Reference | None:
        """Return the independent solution of this flow, None where there is none."""
        return None

    def _initial_velocity(self, position: FloatArray) -> FloatArray:
        """Uniform flow and a Gaussian vortex (divergence-free) about the body, fastest 0.6 D from its centre."""
        x, y, *z = ((position - self.centre) / 0.6).T
        swirl = self.perturbation * np.exp(0.5 * (1 - x**2 - y**2 - sum(each**2 for each in z)))
        return np.stack([1.0 - swirl * y, swirl * x, *(0 * each for each in z)], axis=1)
