"""Outlines of bodies: closed curves, listed as points (:mod:`alsph.geometry.listing`) or drawn (`drawing`).

A curve that lies within a body is a hole in it, and one within a hole a body again.
"""

import math
import os
from collections.abc import Iterable, Sequence
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from alsph.errors import ConfigError
from alsph.geometry import drawing
from alsph.geometry.listing import LARGEST_NUMBER, MOST_POINTS, Line, curves, decoded, printable, refusal
from alsph.geometry.shape import Shape
from alsph.text import sha256

MOST_REPAIRED = 2000
"""Most points of a curve that meets itself somewhere."""
DEEPEST = 10
"""Most curves that one may lie within."""
OPEN = 3.0
"""How many times as long as the longest other edge that is which closes a curve of which is said that it is open."""
SLIVER = 1e-3
"""Largest part of a body that is cut off where its sides cross, as those of airfoils do in their last digits [-]."""
SHORTENED = 0.02
"""How much shorter it may make the body [-]."""


class Outline(Shape):
    """The closed curves of one body or of several. A run folder holds them, and so needs no file beside it."""

    FORMS: ClassVar[str] = "must be points (n, 2) of a closed curve, a list of such arrays, or shapely's polygons"

    points: str = Field(description="a point a line, x and y [D], and a blank line between two curves")
    remark: str = Field(default="", description="what was left out")

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Self:
        """Read a file, of points or a drawing (:mod:`alsph.geometry.drawing`).

        Raises
        ------
        ConfigError
            If it holds no outline; the message names file and line.
        """
        name = printable(os.path.basename(path))
        if drawing.is_drawing(Path(path)):
            bodies, remark, frame = drawing.read(Path(path))
            try:
                found = cls.of(bodies)
            except ConfigError as error:
                fault = frame.translated(str(error).removeprefix("points: "))
                raise ConfigError(f"{name}: {fault}; {remark}") from None
            remarks = "; ".join(filter(None, (remark, frame.translated(found.remark))))
            return cls(file=name, sha256=found.sha256, points=found.points, remark=remarks)
        return cls._around(curves(decoded(path), name), name)

    @classmethod
    def of(cls, shape: ArrayLike | Sequence[ArrayLike] | shapely.Geometry) -> Self:
        """Return the outline of a shape made in Python.

        Parameters
        ----------
        shape
            The points (n, 2) of a closed curve [D], a list of such arrays, or a polygon or multipolygon of shapely.

        Raises
        ------
        ConfigError
            If it is no outline; the message names the point.
        """
        try:
            curves = [np.asarray(curve, float) for part in _in_shape(shape) for curve in _corners(part)]
        except ConfigError:
            raise
        except Exception:  # whatever an object of another library does
            raise ConfigError(cls.FORMS) from None
        if not curves or any(curve.ndim != 2 or curve.shape[1] != 2 or not len(curve) for curve in curves):
            raise ConfigError(cls.FORMS)
        if not all((np.abs(curve) <= LARGEST_NUMBER).all() for curve in curves):
            raise ConfigError(f"coordinates must be finite and at most {LARGEST_NUMBER:g} D")
        if sum(map(len, curves)) > MOST_POINTS:
            raise ConfigError(f"has more than {MOST_POINTS} points")
        lines = (
            [Line(number, f"{x!r} {y!r}", (x, y)) for number, (x, y) in enumerate(curve.tolist(), 1)]
            for curve in curves
        )
        return cls._around(lines, "points")

    @classmethod
    def _around(cls, curves: Iterable[list[Line]], name: str) -> Self:
        bodies, remarks = zip(*(_closed(curve, name) for curve in curves), strict=True)
        all_corners = [shapely.get_coordinates(body.exterior)[:-1].tolist() for body in bodies]
        points = "\n".join("".join(f"{x!r} {y!r}\n" for x, y in corners) for corners in all_corners)
        return cls(file=name, sha256=sha256(points), points=points, remark="; ".join(filter(None, remarks)))

    @model_validator(mode="after")
    def _sound(self) -> Self:
        if self.sha256 != sha256(self.points):
            raise ValueError(f"{self.file}: the points are not those that their sha256 is of")
        curves = self.curves
        for number, curve in enumerate(curves, 1):
            if not curve.is_valid or not curve.area > 0:
                raise ValueError(f"{self.file}: curve {number} is no simple closed curve")
        _check_apart(curves, self.file)
        return self

    @cached_property
    def curves(self) -> list[shapely.Polygon]:
        """What each curve goes around, in the order and the coordinates of the file [D]."""
        try:
            blocks = [block.splitlines() for block in self.points.rstrip("\n").split("\n\n")]
            return [shapely.Polygon([[float(word) for word in line.split()] for line in block]) for block in blocks]
        except (ValueError, TypeError):
            raise ValueError(f"{self.file}: its points are not two numbers a line, three or more a curve") from None

    @cached_property
    def polygons(self) -> list[shapely.Polygon]:
        """The bodies with their holes, in the order and the coordinates of the file [D]."""
        curves = self.curves
        inner, outer = shapely.STRtree(curves).query(curves, predicate="within")
        depth = np.bincount(inner)  # each lies in itself, too
        holes: dict[int, list[shapely.LinearRing]] = {body: [] for body in np.flatnonzero(depth % 2 == 1).tolist()}
        for hole, body in zip(inner.tolist(), outer.tolist(), strict=True):
            if body in holes and depth[hole] == depth[body] + 1:
                holes[body].append(curves[hole].exterior)
        return [shapely.Polygon(curves[body].exterior, rings) for body, rings in holes.items()]

    def __str__(self) -> str:
        """Name the file and tell what was found in it."""
        counts = ", ".join(str(len(polygon.exterior.coords) - 1) for polygon in self.polygons)
        bodies = "a body" if len(self.polygons) == 1 else f"{len(self.polygons)} bodies"
        count = len(self.curves) - len(self.polygons)
        holes = f" with {count} hole{'s' * (count > 1)}" if count else ""
        remark = f"; {self.remark}" if self.remark else ""
        return printable(f"{self.file}: {bodies} of {counts} points{holes}{remark}")


def _in_shape(shape: Any) -> list[Any]:
    """Return the curves and polygons of a shape: itself, or those that it is a list of."""
    if isinstance(shape, shapely.Geometry) or np.ndim(np.asarray(shape, object)) == 2:
        return [shape]
    return list(shape)


def _corners(part: Any) -> list[Any]:
    """Return the closed curves of a part of a shape."""
    if not isinstance(part, shapely.Geometry):
        if np.iscomplexobj(np.asarray(part)):
            raise ConfigError("coordinates must be two real numbers a point")
        return [part]
    polygons = list(shapely.get_parts(part))
    if not all(isinstance(polygon, shapely.Polygon) for polygon in polygons):
        raise ConfigError(f"must be of polygons, not {part.geom_type}")
    rings = [ring for polygon in polygons for ring in (polygon.exterior, *polygon.interiors)]
    return [shapely.get_coordinates(ring)[:-1] for ring in rings]


def _closed(curve: list[Line], name: str) -> tuple[shapely.Polygon, str]:
    """Return the body that a curve goes around, and what of it was left out: what its sides cut off by crossing."""
    points = [point for before, point in pairwise([curve[-1], *curve]) if point.values != before.values]
    if len(points) < 3:
        raise refusal(name, curve[0], "begins a curve of too few points, three or more are needed")
    drawn = shapely.Polygon([point.values for point in points])
    size = math.dist(drawn.bounds[:2], drawn.bounds[2:])
    if drawn.is_valid and drawn.area > 1e-9 * size**2:
        return drawn, _closing(curve)
    edges = shapely.linestrings([[one.values, two.values] for one, two in pairwise([*points, points[0]])])
    x, y = map(float, (shapely.is_valid_reason(drawn).partition("[")[2].rstrip("]") or "nan nan").split())
    parts = _parts_of(drawn, edges)
    area = sum(part.area for part in parts)
    if parts and not area > 1e-9 * size**2:
        raise refusal(name, points[0], "begins a curve that encloses no area")
    body = max(parts, key=lambda part: part.area, default=drawn)
    lost, shorter = 1 - body.area / (area or math.inf), (drawn.length - body.length) / 2 / size
    if body.interiors or lost > SLIVER or shorter > SHORTENED:
        nearest = np.argsort(shapely.distance(edges, shapely.Point(x, y)), kind="stable")[:2]
        one, two = sorted((points[index] for index in nearest), key=lambda point: point.number)
        again = [point.number for point in points[1:] if point.values == points[0].values]
        remedy = "; a hole is a curve of its own: put a blank line before it" if body.interiors else ""
        if again and not remedy:
            remedy = (
                f"; its first point comes again in line {again[0]}: if a side begins there, put a blank line before it"
            )
        fault = f"the curve meets itself after this line and after line {two.number}, at ({x:.6g}, {y:.6g}){remedy}"
        raise refusal(name, one, fault)
    if max(lost, shorter) < 1e-6:
        return body, ""
    return body, f"its sides cross at ({x:.4g}, {y:.4g}), and {100 * shorter:.2g} % of its length is cut off there"


def _closing(curve: list[Line]) -> str:
    """Say by what edge a curve was closed whose points end far from where they began; nothing if they do not."""
    lengths = [math.dist(one.values, two.values) for one, two in pairwise(curve)]
    last = math.dist(curve[-1].values, curve[0].values)
    if last < OPEN * max(lengths):
        return ""
    ends = " to ".join(f"({x:.4g}, {y:.4g})" for x, y in np.round([curve[-1].values, curve[0].values], 9) + 0.0)
    return f"it is open, and was closed by an edge from {ends}, {last / max(lengths):.0f} times as long as any other"


def _parts_of(drawn: shapely.Polygon, edges: NDArray[np.object_]) -> list[shapely.Polygon]:
    """Return what a curve that meets itself goes around; nothing if it does so often, which takes long to sort out."""
    if len(edges) > MOST_REPAIRED:
        return []
    meetings = shapely.STRtree(edges).query(edges, predicate="intersects").shape[1] - 3 * len(edges)
    if meetings > 40:
        return []
    return list(shapely.get_parts(shapely.make_valid(drawn, method="structure", keep_collapsed=False)))


def _check_apart(curves: list[shapely.Polygon], name: str) -> None:
    """Refuse curves that meet, by what they go around; one may lie within another."""
    tree = shapely.STRtree(curves)
    for one, curve in enumerate(curves):
        around = 0
        for two in tree.query(curve, predicate="intersects").tolist():
            around += curves[two].contains_properly(curve)
            if around > DEEPEST:
                raise ValueError(f"{name}: curve {one + 1} lies within more than {DEEPEST} others; leave some out")
            inner, outer = sorted((curve, curves[two]), key=lambda each: each.area)
            if one >= two or outer.contains_properly(inner):
                continue
            common = inner.intersection(outer)
            x, y = common.representative_point().coords[0]
            how = "overlap" if common.area > 0 else "touch"
            raise ValueError(
                f"{name}: curves {one + 1} and {two + 1} {how} at ({x:.6g}, {y:.6g}); make them one, or part them"
            )
