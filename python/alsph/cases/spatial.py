"""Flow past a body in space, in a channel of rectangular section with free-slip walls."""

from __future__ import annotations

from abc import abstractmethod
from functools import cached_property
from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from alsph.analysis.measures import Measure
from alsph.analysis.record import Record
from alsph.arrays import Arrays, FloatArray
from alsph.cases import remarks
from alsph.cases.channel import Channel
from alsph.errors import ConfigError
from alsph.geometry.domain import Domain
from alsph.geometry.packing import height_over, pack
from alsph.geometry.solids import Solid
from alsph.geometry.volume import Volume


class Spatial(Channel):
    """Flow past a body in space in a channel with free-slip walls and uniform inflow U.

    What a case of one's own says of the body is its :class:`~alsph.geometry.volume.Volume`. The inlet lies at x = 0 and
    the axis of the channel at y = z = 0; lengths are in D, velocities in U. Forces are formed with the body's frontal
    area.
    """

    in_space: ClassVar[int] = 3
    across: ClassVar[tuple[str, ...]] = ("height", "width")
    body_name: ClassVar[str] = "body"

    resolution: int = Field(default=10, gt=0, description="particles per reference length, D/Δx; at least 8 [-]")
    length: float = Field(default=9.0, gt=0, description="length of the channel [D]")
    height: float = Field(default=6.0, gt=0, description="height of the channel, along y [D]")
    width: float = Field(default=6.0, gt=0, description="width of the channel, along z [D]")
    upstream: float = Field(default=3.0, gt=0, description="distance from the inlet to the centre of the body [D]")
    perturbation: float = Field(
        default=0.0,
        ge=0,
        le=1,
        description="largest velocity of an initial vortex about the body that starts shedding; 0: symmetric [U]",
    )
    side_walls: Literal["slip"] | None = Field(
        default=None, description="sides of the channel: slip, with a uniform inflow U; slip if not given"
    )
    quarter: bool = Field(
        default=False,
        description="compute a quarter of the flow, y and z above 0, for flows that are symmetric in both; forces are "
        "those on a quarter of the body, the drag coefficient that of the whole",
    )

    @abstractmethod
    def volume(self) -> Volume:
        """Return the body, about 0."""

    @property
    def default_until(self) -> float:
        """The time in which steady flow settles near a body."""
        return 15.0

    @model_validator(mode="after")
    def _is_symmetric(self) -> Self:
        if self.quarter and len(self._volume.flips) < 2:
            raise ValueError(f"quarter = true: the {self.body_name} is not its own mirror image in y and in z")
        for name in ("body_offset", "perturbation"):
            if self.quarter and (value := getattr(self, name)):
                raise ValueError(f"quarter = true: not with {name} = {value:g}, which leaves the flow no symmetry")
        return self

    @property
    def planes_of_symmetry(self) -> tuple[int, ...]:
        """Axes y and z, of a quarter."""
        return (1, 2) if self.quarter else ()

    @cached_property
    def _volume(self) -> Volume:
        return self.volume()

    @property
    def reference_area(self) -> float:
        """Frontal area, of the quarter if that is computed [D²]."""
        return self._volume.frontal_area * self.computed_share

    @property
    def computed_share(self) -> float:
        """Share of the body that is computed."""
        return 0.25 if self.quarter else 1.0

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Left, bottom, right and top of the body, relative to its centre [D]."""
        (left, bottom, _), (right, top, _) = self._corners
        return float(left), float(bottom), float(right), float(top)

    @property
    def _corners(self) -> tuple[FloatArray, FloatArray]:
        return self._volume.corners

    @property
    def room(self) -> float:
        """Least distance of the body from inlet, outlet and sides [D]: Δx, which is known when its particles are."""
        return self.particle_spacing

    @property
    def size(self) -> float:
        """Largest extent of the body [D]."""
        return self._volume.size

    @property
    def blockage(self) -> float:
        """Share of the channel's section that the body blocks [-]."""
        return float(self._volume.frontal_area / np.prod(self.section))

    @property
    def slowed(self) -> float:
        """Share by which a sphere of the body's extent across the stream slows the stream at the inlet [-]."""
        return float((0.5 * self.blocked / self.upstream) ** 3)

    @cached_property
    def _solids(self) -> list[Solid]:
        if refusal := remarks.refusal(self._thin):
            raise ConfigError(refusal)
        return [self._volume.solid(self.particle_spacing, self.support_layers)]

    @cached_property
    def _thin(self) -> list[str]:
        """What is to be said of thin parts: many distances, so it is found once."""
        return remarks.thin_in_space(self.body_name, self._volume, self.particle_spacing)

    def remarks(self) -> list[str]:
        """Return what is to be said of the resolution, the method, the channel and parts of the body."""
        return [*super().remarks(), *self._thin, *([] if self.validated else remarks.unknown())]

    def measures(self, run: Record) -> list[Measure]:
        """Return the forces on the body and the Strouhal number; of a quarter the drag alone."""
        return [measure for measure in super().measures(run) if "drag" in measure.name or not self.quarter]

    def solid_height(self, position: FloatArray) -> FloatArray:
        """Return how far points (n, 3) lie outside of the body [D]."""
        return height_over(self._volume, position - self.centre, self.particle_spacing)

    def solids(self) -> list[Solid]:
        """Return layers that follow the surface."""
        return self._solids

    def fluid(self, cells: FloatArray) -> FloatArray:
        """Return fluid evenly spaced around the body, as much as it leaves of the cells."""
        (solid,) = self._solids
        around = pack(cells - self.centre, self._volume, solid.position, self.particle_spacing)
        return np.asarray(self.centre + around)

    def fluid_volume(self) -> float:
        """Return the volume of the channel without the body."""
        return float(self.length * np.prod(self.section) - self._volume.volume) * self.computed_share

    def domain(self) -> Domain:
        """Return the channel, or its quarter."""
        domain = super().domain()
        return Domain((0, 0, 0), domain.upper, domain.boundaries) if self.quarter else domain

    def particles(self) -> Arrays:
        """Return a lattice around the body's solid particles, impulsively started."""
        self._check_room()
        found = super().particles()
        kept = (found["position"][:, 1:] > 0).all(axis=1) if self.quarter else slice(None)
        return {name: values[kept] for name, values in found.items()}
