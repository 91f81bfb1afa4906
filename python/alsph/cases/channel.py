"""What the cases of a body in a channel share: inlet, outlet, sides, the flow at the start, the forces."""

from __future__ import annotations

import math
from abc import abstractmethod
from functools import cached_property
from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from alsph import reference
from alsph.analysis.measures import Measure
from alsph.analysis.record import Record
from alsph.arrays import Arrays, FloatArray
from alsph.cases import remarks
from alsph.cases.base import Case
from alsph.cases.duct import parabola
from alsph.engine.prescribed import asked
from alsph.errors import ConfigError
from alsph.geometry.domain import Boundary, Domain, SolidBody
from alsph.geometry.lattice import cell_centres, lattice, symmetric_centres
from alsph.geometry.particles import Kind, join, particles
from alsph.geometry.solids import Solid
from alsph.reference import Reference

SIDES = "sides"
"""Name of the sides that do not let slip, among the bodies."""

CHANNEL = {"reynolds": "Re", "length": "L_over_D", "height": "H_over_D", "upstream": "LU_over_D"}
"""Parameters that the channel of a reference is told by, and their columns."""

BEFORE = ("inlet", "upstream"), ("lower side", "height"), ("back", "width")
"""What the channel begins with along x, y and z, and the parameter that makes more room there."""

BEHIND = ("outlet", "length"), ("upper side", "height"), ("front", "width")
"""What it ends with."""

PARABOLA = 1.5
"""Largest velocity of the parabola over its mean."""


class Channel(Case):
    """Flow past a body in a channel with free-slip walls and uniform inflow U.

    The inlet lies at x = 0 and the centre line at y = 0; lengths are in D, velocities in U. With no-slip sides the
    inflow is the parabola of developed flow, and U its mean.
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
    body_offset: float | None = Field(
        default=None, description="how far the centre of the body lies above the centre line, 0 if not given [D]"
    )
    side_walls: Literal["slip", "no_slip"] | None = Field(
        default=None,
        description="sides of the channel: slip, with a uniform inflow U, or no_slip, with the parabola of mean U; "
        "slip if not given",
    )
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
        room["height"] -= abs(self.centre[1])
        for name, left in (room | {"upstream": self.upstream, "length": self.length - self.upstream}).items():
            if left < 1:
                of = "body_offset" if name == "height" and self.body_offset else name
                told = [each for each in ("length", *self.across, "upstream", "body_offset") if getattr(self, each)]
                known = ", ".join(f"{each} {getattr(self, each):g}" for each in told)
                raise ValueError(
                    f"{of} = {getattr(self, of):g}: the {self.body_name} does not fit; leave at least 1 D from "
                    f"centre to each side ({known})"
                )
        for name in ("length", *self.across):
            self.whole_cells(name, getattr(self, name))
        return self

    def _check_room(self) -> None:
        """Refuse bodies that come too near to inlet, outlet or sides."""
        lower, upper = (corner + self.centre for corner in self._corners)
        half = self.section / 2
        rooms = [
            *zip(BEFORE, lower - np.append(0.0, -half), strict=False),
            *zip(BEHIND, np.append(self.length, half) - upper, strict=False),
        ]
        (side, parameter), room = min(rooms, key=lambda item: item[1])
        if room < self.room - 1e-9:
            one = len(self.coefficient_bodies) == 1
            what, come = (f"the {self.body_name}", "comes") if one else ("the bodies together", "come")
            where = f"within {room:.4g} D of" if room >= 0 else f"{-room:.4g} D beyond"
            extents = zip(upper - lower, ("long", "high", "wide"), strict=False)
            size = " and ".join(f"{extent:.3g} D {way}" for extent, way in extents)
            remedy = f"leave at least {self.room:g} D by a larger {parameter}{self._hint}"
            raise ConfigError(f"{what}, {size}, {come} {where} the {side} of the channel; {remedy}")

    @model_validator(mode="after")
    def _bodies_are_named(self) -> Self:
        names, known = [body.name for body in self.checked_bodies], self.coefficient_bodies
        if names[: len(known)] != known:
            told = f"has {', '.join(names) or 'none'}, and must begin with {', '.join(known)}"
            raise ConfigError(f"{type(self).__name__}.bodies(): {told}, the order of their solid particles")
        return self

    @property
    def _corners(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper corner (d,) of a box around all bodies, relative to their centre [D]."""
        left, bottom, right, top = self.bounds
        return np.array([left, bottom]), np.array([right, top])

    @property
    def room(self) -> float:
        """Least distance of the bodies from inlet, outlet and sides [D]."""
        return 0.5

    @property
    def _hint(self) -> str:
        """What else may help where the bodies do not fit in."""
        return ""

    @property
    def is_confined(self) -> bool:
        """Whether the sides of the channel do not let slip."""
        return self.side_walls == "no_slip"

    @property
    def expected_velocity(self) -> float:
        """Largest velocity that is expected [U]: the parabola's is half as much again as its mean."""
        return self.velocity_max * (PARABOLA if self.is_confined else 1.0)

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
        # Who asks for sides that hold the fluid wants them near.
        near = (0.0, 0.0) if self.is_confined else (self.blockage, self.slowed)
        return [*super().remarks(), *remarks.channel(self.blocked, self.ahead, self._behind, *near)]

    def remarks_until(self, until: float) -> list[str]:
        """Return what is to be said besides of how near ``body_motion`` takes the bodies to the outlet."""
        if self.body_motion is None or remarks.near_outlet(self.blocked, self._behind):
            return []
        backs = dict(zip(self.coefficient_bodies, self._backs, strict=True))
        moved = np.array([backs.get(name, -math.inf) for name in self.moved_bodies])
        times = np.linspace(0, until, 101)
        way = np.array([asked("motion", self.motion, self.moved_centres, time) for time in times])[..., 0]
        outlet = self.length - self.upstream - (moved + way - way[0]).max(axis=1)
        nearest = int(outlet.argmin())
        return remarks.near_outlet(self.blocked, float(outlet[nearest]), f" at t* = {times[nearest]:.4g}")

    @property
    def _backs(self) -> list[float]:
        """How far each body reaches behind the centre [D]."""
        return [self.bounds[2]]

    @property
    def _behind(self) -> float:
        """Distance from the back of the bodies to the outlet [D]."""
        return self.length - self.upstream - self.bounds[2]

    @property
    def ahead(self) -> float:
        """Distance from the inlet to the centre of what slows the stream there [D]."""
        return self.upstream

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
        return np.array([self.upstream, self.body_offset or 0.0, *0 * self.section[1:]])

    def domain(self) -> Domain:
        """Return the channel: inlet at x = 0, outlet at x = length, its sides at y = ± height/2 and z alike."""
        half = self.section / 2
        side: Boundary = "none" if self.is_confined else "slip"
        walls: list[tuple[Boundary, Boundary]] = [(side, side)] * len(half)
        return Domain((0, *-half), (self.length, *half), [("inlet", "outlet"), *walls])

    def bodies(self) -> list[SolidBody]:
        """Return the bodies, at rest; their torques are about the centre."""
        return [SolidBody(name, tuple(self.centre)) for name in self.coefficient_bodies]

    @cached_property
    def checked_bodies(self) -> list[SolidBody]:
        """The bodies, and sides that do not let slip, at rest."""
        sides = [SolidBody(SIDES, tuple(self.centre))] if self.is_confined else []
        return [*(SolidBody.of(body) for body in self.bodies()), *sides]

    @property
    def sliding_bodies(self) -> list[str]:
        """Names of the bodies whose surface may slide: those in place, without the sides."""
        return [name for name in super().sliding_bodies if name != SIDES or not self.is_confined]

    def particles(self) -> Arrays:
        """Return a uniform lattice around the body's solid particles, impulsively started."""
        spacing = self.particle_spacing
        rows = [symmetric_centres(self.whole_cells(name, getattr(self, name)), spacing) for name in self.across]
        buffer = cell_centres(self.buffer_columns, spacing)
        channel = lattice(cell_centres(self.whole_cells("length", self.length), spacing), *rows)
        before, behind = lattice(-buffer, *rows), lattice(self.length + buffer, *rows)
        fluid, solids = self.fluid(channel), [solid.moved(self.centre) for solid in self.solids()]
        return join(
            particles(Kind.FLUID, fluid, self._initial_velocity(fluid)),
            particles(Kind.INLET, before, self._stream(before)),
            particles(Kind.OUTLET, behind, self._stream(behind)),
            *(solid.particles(body=index) for index, solid in enumerate(solids)),
            *(side.particles(body=len(self.checked_bodies) - 1) for side in self._sides()),
        )

    def _sides(self) -> list[Solid]:
        """Return the layers of sides that do not let slip, which go on beyond the buffers; none of others."""
        if not self.is_confined:
            return []
        spacing = self.particle_spacing
        beyond = self.buffer_columns + self.support_layers
        x = cell_centres(self.whole_cells("length", self.length) + 2 * beyond, spacing) - beyond * spacing
        place = lattice(x, cell_centres(self.support_layers, spacing))
        inwards = np.broadcast_to([0.0, -1.0], place.shape).copy()
        upper = Solid(place + [0.0, self.height / 2], inwards, place[:, 1].copy())
        return [upper, upper.mirrored()]

    def _stream(self, position: FloatArray) -> FloatArray:
        """Return the undisturbed flow at positions (n, d): U, or the parabola of that mean."""
        if self.is_confined:
            return parabola(0.5 + position[:, 1] / self.height, np.ones(len(position)))
        return np.broadcast_to(np.eye(self.space_dimensions)[0], position.shape)

    def _within_sides(self, height: FloatArray, position: FloatArray) -> FloatArray:
        """Return how far points (n, d) lie outside of bodies, given it (n,), and of sides that do not let slip [D]."""
        if not self.is_confined:
            return height
        return np.asarray(np.minimum(height, self.height / 2 - np.abs(position[:, 1])))

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

    def _known(self, table: str, **given: float | str) -> dict[str, float]:
        """Return the row of a table of references that is of this channel and what is `given`; empty if none is."""
        own = {column: getattr(self, name) for name, column in CHANNEL.items()}
        return reference.matching(table, own | given)

    def _initial_velocity(self, position: FloatArray) -> FloatArray:
        """Return the stream and a Gaussian vortex (divergence-free) about the body, fastest 0.6 D from its centre."""
        x, y, *z = ((position - self.centre) / 0.6).T
        swirl = self.perturbation * np.exp(0.5 * (1 - x**2 - y**2 - sum(each**2 for each in z)))
        if self.is_confined:  # it vanishes at the sides
            swirl = swirl * (1 - (2 * position[:, 1] / self.height) ** 2)
        about = np.stack([-swirl * y, swirl * x, *(0 * each for each in z)], axis=1)
        return np.asarray(self._stream(position) + about)
