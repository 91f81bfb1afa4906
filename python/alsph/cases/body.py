"""Flow past a body of any shape in the cylinder's channel."""

from __future__ import annotations

import os
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np
import shapely
from pydantic import Field, field_validator
from shapely import affinity

from alsph.analysis.measures import Measure
from alsph.analysis.record import Record
from alsph.arrays import FloatArray
from alsph.cases.bodies import Bodies
from alsph.errors import ConfigError
from alsph.geometry.naca import NAME, naca
from alsph.geometry.outline import Outline
from alsph.geometry.surface import Surface, along, edges
from alsph.geometry.thin import filled


class Body(Bodies):
    """Flow past a body of any shape in a channel with free-slip walls and uniform inflow U.

    D is the side of the square, the chord of the airfoil, the unit of the file's lengths, or the larger extent of a
    drawing; `scale` multiplies them. A file holds points, two numbers a line, in any of the usual orders and forms, or
    is a drawing (SVG, DXF, GeoJSON); several closed curves are several bodies, and one within another is a hole, which
    fluid fills. The centroid, that of all of them together, lies at (upstream, body_offset). The solid particles follow
    the surface. What is thinner than 2 Δx, such as a sharp trailing edge, is cut off (:attr:`carried`), and holes
    narrower than 4 Δx are filled; a body of which less than half is left is refused.
    Forces are formed with D; moments with the chord c, the body's extent along x before it is turned, about c/4.
    """

    name: ClassVar[str] = "body"
    title: ClassVar[str] = "flow past a body of any shape in a channel"
    body_name: ClassVar[str] = "body"
    made_for: ClassVar[tuple[str, ...]] = ("shape", "holes", "scale", "angle_of_attack")

    shape: str | Outline = Field(
        default="square_cylinder",
        description="square_cylinder, a NACA airfoil of four or five digits, such as naca0012, a text file of "
        "points: one or several closed curves, lengths in D; a drawing (.svg, .dxf, .geojson), its larger extent D; "
        "in Python also arrays of points or shapely's polygons",
    )
    holes: Literal["fluid", "solid"] = Field(
        default="fluid", description="what fills holes in the shape: fluid, closed off from the flow, or solid"
    )
    scale: float | None = Field(
        default=None, gt=0, description="factor by which the lengths of the shape are multiplied; none: 1 [-]"
    )
    angle_of_attack: float = Field(default=0.0, ge=-180, le=180, description="angle of attack, nose up [degrees]")

    @field_validator("shape", mode="before")
    @classmethod
    def _read(cls, shape: Any) -> str | Outline:
        if isinstance(shape, str) and is_name(shape):
            match = NAME.fullmatch(shape)
            named(shape)
            return f"naca{match[1]}" if match else shape
        if isinstance(shape, dict):
            return Outline(**shape)
        if isinstance(shape, str | os.PathLike):
            if not os.path.exists(shape):
                if os.path.splitext(shape)[1]:
                    raise ConfigError("no such file; shapes by name are square_cylinder and NACA airfoils (naca0012)")
                raise ValueError("neither square_cylinder nor a NACA airfoil (naca0012) nor a file that is there")
            return Outline.read(shape)
        return shape if isinstance(shape, Outline) else Outline.of(shape)

    def shapes(self) -> list[shapely.Polygon]:
        """Return the bodies, their centroid at the origin, turned by the angle of attack."""
        return list(shapely.get_parts(self.outline))

    @cached_property
    def outline(self) -> shapely.Polygon | shapely.MultiPolygon:
        """The body, or all bodies together, their centroid at the origin, turned by the angle of attack."""
        polygons = [named(self.shape)] if isinstance(self.shape, str) else self.shape.polygons
        outline = polygons[0] if len(polygons) == 1 else shapely.MultiPolygon(polygons)
        if self.holes == "solid":
            outline = filled(outline)
        if self.scale is not None:
            outline = affinity.scale(outline, self.scale, self.scale, origin=(0, 0))
        centred = affinity.translate(outline, -outline.centroid.x, -outline.centroid.y)
        return affinity.rotate(centred, -self.angle_of_attack, origin=(0, 0))

    @property
    def _hint(self) -> str:
        return "" if self.scale or isinstance(self.shape, str) else ", or say by `scale` what its file's unit is in D"

    def remarks(self) -> list[str]:
        """Return what is to be said, first of how the file was read."""
        if isinstance(self.shape, str) or not self.shape.remark:
            return super().remarks()
        return [f"outline: {self.shape.file}: {self.shape.remark}", *super().remarks()]

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
        return along(self._carried_parts, self.angle_of_attack, (left, right)).moved(self.centre)


def is_name(shape: str) -> bool:
    """Whether a shape is asked for by name, not by the path of a file."""
    return shape == "square_cylinder" or NAME.fullmatch(shape) is not None


def named(shape: str) -> shapely.Polygon:
    """Return the shape of that name.

    Raises
    ------
    ValueError
        If it is named like an airfoil that does not exist.
    """
    match = NAME.fullmatch(shape)
    return naca(match[1]) if match else shapely.box(-0.5, -0.5, 0.5, 0.5)
