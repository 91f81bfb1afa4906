"""Flow past bodies of any shape in the cylinder's channel: what a case of one's own says of them is their outlines."""

from __future__ import annotations

from abc import abstractmethod
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
import shapely
from pydantic import model_validator
from shapely import LineString

from alsph.analysis.measures import Measure, Profile
from alsph.analysis.record import Record
from alsph.arrays import FloatArray
from alsph.cases import remarks
from alsph.cases.channel import Channel
from alsph.errors import ConfigError
from alsph.geometry.domain import SolidBody
from alsph.geometry.lattice import inside
from alsph.geometry.outline import Outline
from alsph.geometry.packing import Planar, height_over, pack_around
from alsph.geometry.solids import Solid
from alsph.geometry.surface import Surface, along
from alsph.geometry.thin import carried, pockets, solids


class Bodies(Channel):
    """Flow past bodies of any shape in a channel with free-slip walls and uniform inflow U.

    The solid particles follow the surfaces. What is thinner than 2 Δx, such as a sharp trailing edge, is cut off
    (:attr:`carried`); a body of which that leaves less than half is refused. Holes of 4 Δx and more are filled with
    fluid, at rest at first. Forces are formed with D, and are those of all bodies together as well as of each.
    """

    body_name: ClassVar[str] = "body"

    @abstractmethod
    def shapes(self) -> list[Any]:
        """Return the outline of each body, an array of points (n, 2) or a polygon of shapely.

        Lengths are in D, and the origin is the point (upstream, body_offset) of the channel.
        """

    @cached_property
    def outline(self) -> shapely.Polygon | shapely.MultiPolygon:
        """The body, or all bodies together."""
        try:
            polygons = Outline.of(self.shapes()).polygons
        except ConfigError as error:
            raise ConfigError(f"{type(self).__name__}.shapes() {error}") from None
        return polygons[0] if len(polygons) == 1 else shapely.MultiPolygon(polygons)

    @model_validator(mode="after")
    def _fits_in(self) -> Self:
        self._check_room()
        return self

    @property
    def outlines(self) -> list[shapely.Polygon]:
        """The single bodies of :attr:`outline`."""
        return list(shapely.get_parts(self.outline))

    @property
    def thickness(self) -> float:
        """Extent of the bodies across the stream [D]."""
        _, bottom, _, top = self.bounds
        return top - bottom

    @cached_property
    def carried(self) -> list[shapely.Polygon | shapely.MultiPolygon]:
        """The single bodies without what is too thin for the resolution."""
        return [carried(outline, self.particle_spacing) for outline in self.outlines]

    @property
    def coefficient_bodies(self) -> list[str]:
        """``body``, or ``body_1``, ``body_2``, ... where there are several."""
        count = len(self.outlines)
        return ["body"] if count == 1 else [f"body_{number}" for number in range(1, count + 1)]

    def middles(self) -> dict[str, FloatArray]:
        """Return the middle (2,) of each body by its name, where there are several [D]."""
        if len(self.outlines) == 1:
            return {}
        left, bottom, right, top = shapely.bounds(self.outlines).T
        middles = np.stack([left + right, bottom + top], axis=1) / 2 + self.centre
        return dict(zip(self.coefficient_bodies, middles, strict=True))

    def bodies(self) -> list[SolidBody]:
        """Return the bodies, at rest; torques on one are about the centre, on each of several about its middle."""
        middles = self.middles()
        return [SolidBody(name, tuple(middles.get(name, self.centre))) for name in self.coefficient_bodies]

    @property
    def moment_point(self) -> FloatArray:
        """Point (2,) that moments are about if no other is given [D]: of several bodies (upstream, body_offset)."""
        return self.centre if self.middles() else super().moment_point

    @cached_property
    def _refusal(self) -> str:
        """Why the resolution does not carry the bodies, empty if it does."""
        return remarks.refusal(self.remarks())

    @cached_property
    def _solids(self) -> list[Solid]:
        if self._refusal:
            raise ConfigError(self._refusal)
        return solids(self.carried, self.particle_spacing, self.support_layers)

    def solids(self) -> list[Solid]:
        """Return layers along the surface of each body, with two faces where it is thin.

        Raises
        ------
        ConfigError
            If a body is too thin for the resolution.
        """
        return self._solids

    def fluid_volume(self) -> float:
        """Return the area of the fluid; of bodies that are refused now, of which older runs may be, roughly [D²]."""
        if self._refusal:
            return float(self.length * self.height - shapely.union_all(self.carried).area)
        return super().fluid_volume()

    def fluid(self, cells: FloatArray) -> FloatArray:
        """Return fluid evenly spaced around the bodies, as much as they leave of the cells."""
        position = np.concatenate([solid.position for solid in self._solids])
        bodies = shapely.union_all(self.carried)
        return np.asarray(self.centre + pack_around(cells - self.centre, bodies, position, self.particle_spacing))

    def solid_height(self, position: FloatArray) -> FloatArray:
        """Return how far points (n, 2) lie outside of the bodies as carried [D]."""
        bodies = Planar(shapely.union_all(self._sampled))
        return self._within_sides(height_over(bodies, position - self.centre, self.particle_spacing), position)

    def _initial_velocity(self, position: FloatArray) -> FloatArray:
        """Return the velocity (n, 2) at the start: none in holes."""
        holes = pockets(shapely.union_all(self.carried))
        enclosed = inside(shapely.union_all(holes), position - self.centre)
        return np.where(enclosed[:, None], 0.0, super()._initial_velocity(position))

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Left, bottom, right and top of the bodies, relative to the point (upstream, body_offset) [D]."""
        left, bottom, right, top = self.outline.bounds
        return left, bottom, right, top

    @property
    def size(self) -> float:
        """Larger extent of the body, of the smallest one if there are several [D]."""
        lower, upper = np.split(shapely.bounds(shapely.get_parts(self.outline)), 2, axis=1)
        return float((upper - lower).max(axis=1).min())

    @property
    def _backs(self) -> list[float]:
        return [float(right) for *_, right, _ in shapely.bounds(self.outlines)]

    @property
    def blocked(self) -> float:
        """How much of the channel's height the bodies block, what stands behind another but once [D]."""
        sides = [LineString([(0, bottom), (0, top)]) for _, bottom, _, top in shapely.bounds(self.outlines)]
        return float(shapely.union_all(sides).length)

    @property
    def ahead(self) -> float:
        """Distance from the inlet to the centre of what slows the stream there: one of the bodies, or all [D]."""
        return self._slowing[1]

    @property
    def slowed(self) -> float:
        """Share by which the bodies slow the stream at the inlet, one of them or all, as cylinders would [-]."""
        return self._slowing[0]

    @property
    def _slowing(self) -> tuple[float, float]:
        whole = (super().slowed, self.upstream)
        left, bottom, right, top = shapely.bounds(self.outlines).T
        ahead = self.upstream + (left + right) / 2
        each = (0.5 * (top - bottom) / ahead) ** 2
        return max([whole, *zip(each.tolist(), ahead.tolist(), strict=True)] if len(each) > 1 else [whole])

    def scales(self) -> dict[str, float]:
        """Return those of the flow and the thickness of the body's thinnest part."""
        thinnest = remarks.thinnest(self.outline) / self.particle_spacing
        return super().scales() | {"thickness of the thinnest part, Δx": thinnest}

    def remarks(self) -> list[str]:
        """Return what is to be said of the resolution, the method, the channel and parts of the body."""
        thin = [
            remark
            for name, outline, left in zip(self.coefficient_bodies, self.outlines, self.carried, strict=True)
            for remark in remarks.thin(name, outline, left, self.particle_spacing)
        ]
        near = remarks.gaps(self.coefficient_bodies, self.carried, self.particle_spacing)
        pockets = remarks.holes(self.outlines, self.carried)
        several = remarks.several(self.coefficient_bodies)
        return [*super().remarks(), *several, *thin, *near, *self._slots, *pockets, *remarks.unknown(bool(several))]

    @cached_property
    def _slots(self) -> list[str]:
        return [
            remark
            for name, left in zip(self.coefficient_bodies, self.carried, strict=True)
            for remark in remarks.slots(name, left, self.particle_spacing)
        ]

    def measures(self, run: Record) -> list[Measure]:
        """Return the forces on all bodies together, the Strouhal number, and the mean forces on each of several."""
        several = self.coefficient_bodies if len(self.coefficient_bodies) > 1 else []
        return [
            *super().measures(run),
            *(
                Measure(f"mean {kind} coefficient of {name}", run.load(axis, name).mean)
                for name in several
                for kind, axis in (("drag", "x"), ("lift", "y"))
            ),
        ]

    def profiles(self, run: Record) -> list[Profile]:
        """Return the mean pressure coefficient of each body over x/c, from the leading edge above and back below."""
        names = self.coefficient_bodies
        found, empty = [], np.empty(0)
        for name in names:
            computed, coefficient = (empty, empty), run.pressure_coefficient
            if coefficient.surface:
                coefficient = coefficient.of([k for k, each in enumerate(self.surface_bodies) if each == name])
            if coefficient.surface and coefficient.surface.chord is not None:
                computed = coefficient.surface.chord, coefficient.mean
            title = "pressure coefficient" + f" of {name}" * (len(names) > 1)
            found.append(Profile(title, ("$x/c$", "$C_p$"), computed, (empty, empty), ""))
        return found

    def surface_points(self) -> Surface:
        """Return the pieces of the bodies as carried, from the foremost point over the upper side and back below.

        The chord of each is its own.
        """
        bodies = zip(self.outlines, self._sampled, strict=True)
        chords = [outline.bounds[::2] for outline, body in bodies for _ in shapely.get_parts(body)]
        return along(self._carried_parts, 0.0, chords).moved(self.centre)

    @property
    def surface_bodies(self) -> list[str]:
        """Name of the body that each closed curve of the surface is of; one that is cut into parts has several."""
        named = zip(self.coefficient_bodies, self._sampled, strict=True)
        return [name for name, body in named for _ in shapely.get_parts(body)]

    @property
    def _sampled(self) -> list[shapely.Polygon | shapely.MultiPolygon]:
        return [outline if left.is_empty else left for outline, left in zip(self.outlines, self.carried, strict=True)]

    @property
    def _carried_parts(self) -> shapely.MultiPolygon:
        return shapely.MultiPolygon([part for body in self._sampled for part in shapely.get_parts(body)])
