"""Flow past a body of any shape in the cylinder's channel."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field, field_validator, model_validator
from shapely import affinity

from alsph import remarks
from alsph.cases.channel import Channel
from alsph.geometry import FloatArray, Solid, body_layers, inside
from alsph.measures import Measure
from alsph.surface import Surface, along, edges

if TYPE_CHECKING:
    from alsph.results import Run


class Body(Channel):
    """Flow past a body of any shape in a channel with free-slip walls and uniform inflow U.

    D is the side of the square, the chord of the airfoil, or the unit of the file's lengths. The body's centroid lies
    at (upstream, 0). The solid particles follow the surface; parts thinner than about 2Δx are badly resolved. Forces
    are formed with D; moments with the chord c, the body's extent along x before it is turned, about the point at c/4.
    """

    name: ClassVar[str] = "body"
    title: ClassVar[str] = "flow past a body of any shape in a channel"
    body_name: ClassVar[str] = "body"
    coefficient_body: ClassVar[str | None] = "body"

    shape: str = Field(
        default="square_cylinder",
        description="square_cylinder, naca0012, or a text file of the closed curve's points, a pair of lengths a line",
    )
    angle_of_attack: float = Field(default=0.0, ge=-180, le=180, description="angle of attack, nose up [degrees]")

    @field_validator("shape")
    @classmethod
    def _known(cls, shape: str) -> str:
        _outline(shape)
        return shape

    @model_validator(mode="after")
    def _fits_in(self) -> Self:
        left, bottom, right, top = self.outline.bounds
        room = min(
            self.upstream + left, self.length - self.upstream - right, bottom + self.height / 2, self.height / 2 - top
        )
        if room < 0.5:
            raise ValueError(f"the body comes within {room:.3g} D of a side of the channel; leave at least 0.5 D")
        return self

    @cached_property
    def outline(self) -> shapely.Polygon:
        """The body, its centroid at the origin, turned by the angle of attack."""
        outline = _outline(self.shape)
        centred = affinity.translate(outline, -outline.centroid.x, -outline.centroid.y)
        return affinity.rotate(centred, -self.angle_of_attack, origin=(0, 0))

    def solid(self) -> Solid:
        """Return layers along the surface."""
        return body_layers(self.outline, self.particle_spacing, self.support_layers)

    def outside(self, points: FloatArray) -> NDArray[np.bool_]:
        """Return which points lie outside the outline."""
        return ~inside(self.outline, points)

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
        return [*super().remarks(), *remarks.thin_parts(self.outline, self.particle_spacing), unknown]

    def measures(self, run: Run) -> list[Measure]:
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
        """Return the pieces of the outline, from the leading edge over the upper side and back below."""
        return along(self.outline, self.angle_of_attack).moved(self.centre)


def _outline(shape: str) -> shapely.Polygon:
    """Return the shape with that name or in that file, in D.

    Raises
    ------
    ValueError
        If there is none, or its curve crosses itself.
    """
    if shape == "square_cylinder":
        return shapely.box(-0.5, -0.5, 0.5, 0.5)
    points = _naca0012() if shape == "naca0012" else _read(shape)
    outline = shapely.Polygon(points)
    if not outline.is_valid or outline.area == 0:
        raise ValueError(f"no simple closed curve: {shapely.is_valid_reason(outline)}")
    return outline


def _naca0012(count: int = 100) -> FloatArray:
    """Return points (2 count, 2) of the NACA 0012 airfoil of chord 1 with a closed trailing edge."""
    x = 0.5 * (1 - np.cos(np.linspace(0, np.pi, count + 1)))
    powers = np.stack([np.sqrt(x), x, x**2, x**3, x**4])
    y = 0.6 * np.array([0.2969, -0.1260, -0.3516, 0.2843, -0.1036]) @ powers
    return np.concatenate([np.stack([x, y], axis=1), np.stack([x, -y], axis=1)[-2:0:-1]])


def _read(path: str) -> FloatArray:
    """Return the two columns (n, 2) of a text file, separated by commas or blanks; its first line may be a title."""
    try:
        lines = Path(path).read_text(encoding="utf-8").replace(",", " ").splitlines()
    except (OSError, UnicodeDecodeError):
        raise ValueError("neither square_cylinder nor naca0012 nor a readable file") from None
    try:
        points = np.loadtxt(lines, ndmin=2)
    except ValueError:
        points = np.loadtxt(lines[1:], ndmin=2)
    if points.shape[1:] != (2,) or len(points) < 3:
        raise ValueError("the file must hold three or more lines of two numbers")
    return points
