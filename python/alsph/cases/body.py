"""Flow past a body of any shape in the cylinder's channel."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
import shapely
from pydantic import Field, field_validator, model_validator
from shapely import affinity

from alsph.analysis.measures import Measure
from alsph.analysis.record import Record
from alsph.arrays import FloatArray
from alsph.cases import remarks
from alsph.cases.channel import Channel
from alsph.cases.remarks import TOO_THIN
from alsph.errors import ConfigError
from alsph.geometry.outline import Outline
from alsph.geometry.packing import pack
from alsph.geometry.solids import Solid
from alsph.geometry.surface import Surface, along, edges
from alsph.geometry.thin import carried, solid


class Body(Channel):
    """Flow past a body of any shape in a channel with free-slip walls and uniform inflow U.

    D is the side of the square, the chord of the airfoil, or the unit of the file's lengths. A file holds points, two
    numbers a line, in any of the usual orders and forms; several closed curves are several bodies. The centroid, that
    of all of them together, lies at (upstream, 0). The solid particles follow the surface. What is thinner than 2 Δx,
    such as a sharp trailing edge, is cut off (:attr:`carried`); a body of which that leaves nothing is refused. Forces
    are formed with D; moments with the chord c, the body's extent along x before it is turned, about the point at c/4.
    """

    name: ClassVar[str] = "body"
    title: ClassVar[str] = "flow past a body of any shape in a channel"
    body_name: ClassVar[str] = "body"
    made_for: ClassVar[tuple[str, ...]] = ("shape", "angle_of_attack")

    shape: str | Outline = Field(
        default="square_cylinder",
        description="square_cylinder, naca0012, or a text file of points: one or several closed curves, lengths in D; "
        "in Python also arrays of points or shapely's polygons",
    )
    angle_of_attack: float = Field(default=0.0, ge=-180, le=180, description="angle of attack, nose up [degrees]")

    @field_validator("shape", mode="before")
    @classmethod
    def _read(cls, shape: Any) -> str | Outline:
        if isinstance(shape, str) and shape in SHAPES:
            return shape
        if isinstance(shape, dict):
            return Outline(**shape)
        if isinstance(shape, str | os.PathLike):
            if not os.path.exists(shape):
                raise ValueError(f"neither {' nor '.join(SHAPES)} nor a file that is there")
            return Outline.read(shape)
        return shape if isinstance(shape, Outline) else Outline.of(shape)

    @model_validator(mode="after")
    def _fits_in(self) -> Self:
        left, bottom, right, top = self.outline.bounds
        room = min(
            self.upstream + left, self.length - self.upstream - right, bottom + self.height / 2, self.height / 2 - top
        )
        if room < 0.5:
            raise ValueError(
                f"the body, {right - left:.3g} D long and {top - bottom:.3g} D high, comes within {room:.3g} D of a "
                "side of the channel; leave at least 0.5 D"
            )
        return self

    @cached_property
    def outline(self) -> shapely.Polygon | shapely.MultiPolygon:
        """The body, or all bodies together, their centroid at the origin, turned by the angle of attack."""
        polygons = [SHAPES[self.shape]()] if isinstance(self.shape, str) else self.shape.polygons
        outline = polygons[0] if len(polygons) == 1 else shapely.MultiPolygon(polygons)
        centred = affinity.translate(outline, -outline.centroid.x, -outline.centroid.y)
        return affinity.rotate(centred, -self.angle_of_attack, origin=(0, 0))

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

    @cached_property
    def _solids(self) -> list[Solid]:
        if too_thin := [remark for remark in self.remarks() if remark.startswith(TOO_THIN)]:
            raise ConfigError(too_thin[0])
        return [solid(outline, self.particle_spacing, self.support_layers) for outline in self.carried]

    def solids(self) -> list[Solid]:
        """Return layers along the surface of each body, with two faces where it is thin.

        Raises
        ------
        ConfigError
            If a body is too thin for the resolution.
        """
        return self._solids

    def fluid(self, cells: FloatArray) -> FloatArray:
        """Return fluid evenly spaced around the bodies, as much as they leave of the cells."""
        position = np.concatenate([solid.position for solid in self._solids])
        bodies = shapely.union_all(self.carried)
        return np.asarray(self.centre + pack(cells - self.centre, bodies, position, self.particle_spacing))

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Left, bottom, right and top of the outline, relative to its centroid [D]."""
        left, bottom, right, top = self.outline.bounds
        return left, bottom, right, top

    @property
    def size(self) -> float:
        """Larger extent of the body, of the smallest one if there are several [D]."""
        lower, upper = np.split(shapely.bounds(shapely.get_parts(self.outline)), 2, axis=1)
        return float((upper - lower).max(axis=1).min())

    def scales(self) -> dict[str, float]:
        """Return those of the flow and the thickness of the body's thinnest part."""
        thinnest = remarks.thinnest(self.outline) / self.particle_spacing
        return super().scales() | {"thickness of the thinnest part, Δx": thinnest}

    def remarks(self) -> list[str]:
        """Return what is to be said of the resolution, the method, the channel and parts of the body."""
        unknown = "not validated: flow past this body; it has not been compared with the results of others"
        thin = [
            remark
            for name, outline, left in zip(self.coefficient_bodies, self.outlines, self.carried, strict=True)
            for remark in remarks.thin(name, outline, left, self.particle_spacing)
        ]
        return [*super().remarks(), *thin, unknown]

    def measures(self, run: Record) -> list[Measure]:
        """Return the forces, among them what a body at an angle has: mean lift and moment; and the Strouhal number."""
        return [
            *super().measures(run),
            Measure("mean lift coefficient", run.lift.mean),
            Measure("mean pitching moment coefficient about c/4", run.moment().mean),
        ]

    @property
    def chord(self) -> float:
        """Extent c along the abscissa before the body is turned [D]."""
        left, _, right, _ = self._upright.bounds
        return float(right - left)

    @property
    def moment_point(self) -> FloatArray:
        """The quarter-chord point (2,) [D]: c/4 behind the foremost point, on the line to the rearmost one."""
        front, rear = edges(self._upright)
        quarter = affinity.rotate(shapely.Point(0.75 * front + 0.25 * rear), -self.angle_of_attack, origin=(0, 0))
        return np.array([quarter.x, quarter.y]) + self.centre

    @property
    def _upright(self) -> shapely.Polygon:
        return affinity.rotate(self.outline, self.angle_of_attack, origin=(0, 0))

    def surface_points(self) -> Surface:
        """Return the pieces of the bodies as carried, from the leading edge over the upper side and back below."""
        left, _, right, _ = self._upright.bounds
        bodies = [outline if left.is_empty else left for outline, left in zip(self.outlines, self.carried, strict=True)]
        parts = shapely.MultiPolygon([part for body in bodies for part in shapely.get_parts(body)])
        return along(parts, self.angle_of_attack, (left, right)).moved(self.centre)


def _square_cylinder() -> shapely.Polygon:
    return shapely.box(-0.5, -0.5, 0.5, 0.5)


def _naca0012(count: int = 100) -> shapely.Polygon:
    """Return the NACA 0012 airfoil of chord 1 with a closed trailing edge and 2 count points."""
    x = 0.5 * (1 - np.cos(np.linspace(0, np.pi, count + 1)))
    powers = np.stack([np.sqrt(x), x, x**2, x**3, x**4])
    y = 0.6 * np.array([0.2969, -0.1260, -0.3516, 0.2843, -0.1036]) @ powers
    return shapely.Polygon(np.concatenate([np.stack([x, y], axis=1), np.stack([x, -y], axis=1)[-2:0:-1]]))


SHAPES: dict[str, Callable[[], shapely.Polygon]] = {"square_cylinder": _square_cylinder, "naca0012": _naca0012}
"""The shapes that have a name."""
