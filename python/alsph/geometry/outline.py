"""Outlines of bodies: closed curves, read from text files in the forms in which such files are found.

A line is a point, two numbers, or it is blank, a comment (``#``, ``%``, ``!``, ``//``), a title or note, whose first
word is no number, a count of points, or it is refused by its number. Blank lines, titles and lines ``999 999`` divide
the points into parts. Which parts make a curve, the shortest edges that close them decide: each part by itself (several
bodies), upper and lower side from the leading edge on (Lednicer's order), or one after the other. A curve that lies
within a body is a hole in it, and one within a hole a body again.
"""

import math
import os
import re
import stat
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import accumulate, chain, pairwise
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from alsph.errors import ConfigError
from alsph.geometry import drawing
from alsph.geometry.shape import Shape
from alsph.text import sha256

LARGEST_FILE = 2**20
"""Size of the largest file that is read [bytes]; outlines have some kilobytes."""
MOST_POINTS, MOST_REPAIRED = 20_000, 2000
"""Most points of a file, and of a curve that meets itself somewhere."""
DEEPEST = 10
"""Most curves that one may lie within."""
LARGEST_NUMBER = 1e6
"""Coordinates beyond it are no lengths in D."""
LONGEST_LINE = 1000
"""Number of characters beyond which a line is of another kind of file."""
SLIVER = 1e-3
"""Largest part of a body that is cut off where its sides cross, as those of airfoils do in their last digits [-]."""
SHORTENED = 0.02
"""How much shorter it may make the body [-]."""
BODIES_APART = (999.0, 999.0)
"""The line that divides bodies in the files of XFOIL and MSES."""

EXPECTED = "an outline is a text file of points, two numbers a line"

COMMENT = re.compile(r"(#|%|!|//).*")
FIELDS = re.compile(r"\s*;\s*|\s*,\s+|\s+,\s*|\s+")
NUMBER = re.compile(r"[-+]?(\d+[.,]?\d*|[.,]\d+)([eEdD][-+]?\d+)?")
NOT_FINITE = re.compile(r"[-+]?(nan|inf|infinity)", re.IGNORECASE)
MISTYPED = re.compile(
    r"(?=.*[\d.,])([-+.,]*[\dOoIl][-+.,\dOoIlSsEeDd]*"  # letters for digits, two signs or decimal points
    r"|[-+.,\d]*\d[a-zµ]+"  # a unit
    r"|(?=.*[.,])[-+.,\deE]*\D?[-+.,\deE]*|[-+.,\deE]*[\W_]?[-+.,\deE]*)",  # one strange character
    re.IGNORECASE,
)
"""A word that is no number and was meant to be one."""


@dataclass(frozen=True)
class Line:
    """A line of a file: its numbers, or what is wrong with it, or neither of them if it is text."""

    number: int
    text: str
    values: tuple[float, ...] = ()
    fault: str = ""
    comma: str = ""
    """What commas are in it: they divide its numbers, or stand for decimal points."""

    @property
    def is_point(self) -> bool:
        """Whether it is a point of a curve."""
        return len(self.values) == 2 and self.values != BODIES_APART

    @property
    def is_text(self) -> bool:
        """Whether it is a title or a note."""
        return bool(self.text) and not self.values and not self.fault


@dataclass
class Part:
    """Points in succession, and what stands before them: a blank line, a title or the end of a body; counts."""

    before: Line
    heading: list[Line]
    points: list[Line] = field(default_factory=list)


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
        name = _shown(os.path.basename(path))
        if drawing.is_drawing(Path(path)):
            bodies, remark = drawing.read(Path(path))
            try:
                found = cls.of(bodies)
            except ConfigError as error:
                raise ConfigError(f"{name}: {error}") from None
            remarks = "; ".join(filter(None, (remark, found.remark)))
            return cls(file=name, sha256=found.sha256, points=found.points, remark=remarks)
        return cls._around(_curves(_text(path), name), name)

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
        return _shown(f"{self.file}: {bodies} of {counts} points{holes}" + (f"; {self.remark}" if self.remark else ""))


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


def _shown(text: str) -> str:
    """Return what a terminal can be given."""
    return "".join(character if character.isprintable() else "?" for character in text)


def _text(path: str | os.PathLike[str]) -> str:
    """Return the text of a file of any of the usual encodings."""
    try:
        about = os.stat(path)
        if not stat.S_ISREG(about.st_mode):
            raise ConfigError(f"{path}: not a file but a folder, a device or a pipe")
        if about.st_size > LARGEST_FILE:
            raise ConfigError(
                f"{path}: has {about.st_size / 2**20:,.0f} MiB; the text file of an outline has "
                f"{LARGEST_FILE / 2**20:.0f} MiB at most"
            )
        with Path(path).open("rb") as file:
            content = file.read(LARGEST_FILE)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from None
    except ValueError as error:
        raise error if isinstance(error, ConfigError) else ConfigError(f"{path!r}: no name of a file") from None
    marks = {b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe\0\0": "utf-32", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
    encodings = [encoding for mark, encoding in marks.items() if content.startswith(mark)] or ["utf-8", "latin-1"]
    for encoding in encodings:
        try:
            text = content.decode(encoding)
        except UnicodeDecodeError:
            continue
        if not re.search(r"[\x00-\x08\x0e-\x19\x1b-\x1f\x7f]", text):
            return text.rstrip("\x1a")  # the end of a file in DOS
    raise ConfigError(f"{path}: not a text file; {EXPECTED}")


def _line(number: int, raw: str) -> Line:
    """Tell what a line of a file is."""
    text = raw.strip()
    for part in (text, COMMENT.sub("", text).strip()):
        fields = FIELDS.split(part.replace('"', "").replace("\u2212", "-").rstrip(",; \t"))
        divides = len(fields) == 1 and "," in fields[0]
        if divides:
            fields = fields[0].split(",")
        if all(NUMBER.fullmatch(word) for word in fields) and (part == text or len(fields) == 2):
            values = tuple(float(re.sub("[dD]", "e", word).replace(",", ".")) for word in fields)
            if max(map(abs, values)) < LARGEST_NUMBER:
                comma = "divide numbers" if divides else "are decimal points" if "," in "".join(fields) else ""
                return Line(number, text, values, comma=comma)
            return Line(number, text, fault=f"no lengths in D, numbers below {LARGEST_NUMBER:g} expected")
        if not part:
            return Line(number, "")  # a comment
    words = FIELDS.split(text)
    if len(words) == 1:
        words = text.split(",")
    numbers = [word for word in words if NUMBER.fullmatch(word) or NOT_FINITE.fullmatch(word)]
    if len(numbers) == len(words) > 1:
        return Line(number, text, fault="finite numbers expected")
    if NUMBER.fullmatch(words[0]) or (1 < len(words) < 4 and all(MISTYPED.fullmatch(word) for word in words)):
        return Line(number, text, fault="two numbers expected")
    return Line(number, text)


def _curves(text: str, name: str) -> list[list[Line]]:
    """Return the points of each closed curve in the text of a file."""
    rows = re.split(r"\r\n?|\n", text)
    if len(rows) > 3 * MOST_POINTS:
        raise ConfigError(
            f"{name}: has {len(rows):,} lines; an outline has {MOST_POINTS:,} points at most, thin it out"
        )
    if len(longest := max(rows, key=len)) > LONGEST_LINE:
        raise ConfigError(f"{name}:{rows.index(longest) + 1}: a line of {len(longest):,} characters; {EXPECTED}")
    lines = [_line(number, row) for number, row in enumerate(rows, 1)]
    sections: list[list[Part]] = []
    for part in _parts(lines, name):
        if not sections or part.before.values == BODIES_APART:
            sections.append([])
        sections[-1].append(part)
    return [curve for section in sections for curve in _joined(_without_counts(section, name), name)]


def _parts(lines: list[Line], name: str) -> list[Part]:
    """Return the points between blank lines, titles and the like."""
    end = max((index + 1 for index, line in enumerate(lines) if line.is_point), default=0)
    if not end:
        fault = next((line for line in lines if line.fault or line.values), None)
        raise _refusal(name, fault) if fault else ConfigError(f"{name}: holds no points; {EXPECTED}")
    parts = [Part(Line(0, ""), [])]
    for line in lines[:end]:
        if line.is_point:
            parts[-1].points.append(line)
        elif line.fault or (line.values and line.values != BODIES_APART and parts[-1].points):
            raise _refusal(name, line)
        elif line.values and line.values != BODIES_APART:
            parts[-1].heading.append(line)
        elif parts[-1].points:
            parts.append(Part(line, []))
        elif line.text and parts[-1].before.values != BODIES_APART:
            parts[-1].before = line
    notes = False
    for line in lines[end:]:
        notes |= line.is_text
        if (line.fault or line.values) and line.values != BODIES_APART and not notes:
            raise _refusal(name, line)
    points = [point for part in parts for point in part.points]
    if len(points) > MOST_POINTS:
        raise ConfigError(f"{name}: holds {len(points):,} points; {MOST_POINTS:,} are the most, thin them out")
    commas = [point for point in points if point.comma]
    if odd := next((point for point in commas if point.comma != commas[0].comma), None):
        raise _refusal(name, odd, f"commas {odd.comma} here, and {commas[0].comma} in line {commas[0].number}")
    return parts


def _without_counts(parts: list[Part], name: str) -> list[Part]:
    """Check and take out the numbers of points, and the limits of the flow that MSES has in its files."""
    first, *points = [point for part in parts for point in part.points]
    coordinates = np.array([point.values for point in points] or [first.values])
    lower, upper = coordinates.min(axis=0), coordinates.max(axis=0)
    for part in parts:
        for line in part.heading:
            limits = np.array(line.values)
            if len(limits) == 4 and (limits[::2] < lower).all() and (upper < limits[1::2]).all():
                continue
            if len(limits) != 1 or limits[0] not in (len(part.points), len(points) + 1):
                raise _refusal(name, line, f"{len(part.points)} points follow" if len(limits) == 1 else "")
    count, other = first.values
    whole = count.is_integer() and other.is_integer() and count >= 3 and other >= 0
    if not whole or len(points) < 3 or any(point.values == first.values for point in points):
        return parts
    fits = len(points) in (count, count + other)
    far = ((first.values < 2 * lower - upper) | (first.values > 2 * upper - lower)).any()
    if fits != far and (fits or other > 0):
        raise _refusal(
            name, first, f"a count of points ({len(points)} follow) or a point? Take it out or begin elsewhere"
        )
    if not fits or not far:
        return parts
    parts[0].points = points[: len(parts[0].points) - 1]
    parts = [part for part in parts if part.points]
    if other == 0 or len(points) != count + other:
        return parts
    if len(parts) == 1:
        return [Part(parts[0].before, [], points[: int(count)]), Part(Line(0, ""), [], points[int(count) :])]
    if int(count) not in accumulate(len(part.points) for part in parts):
        raise _refusal(name, first, f"{' and '.join(str(len(part.points)) for part in parts)} points follow")
    return parts


PLAIN = 0.1
"""Parts of a file are one curve if the edges between them are shorter than this part of those that close each."""


def _joined(parts: list[Part], name: str) -> list[list[Line]]:
    """Return the curves that the parts of a section make: those that the shortest edges close."""
    runs = [part.points for part in parts]
    pairs = list(zip(runs[::2], runs[1::2], strict=False))
    in_turn = math.fsum(_gap(one[-1], two[0]) for one, two in zip(runs, [*runs[1:], runs[0]], strict=True))
    one_curve = [list(chain(*runs))]
    ways = [(in_turn, one_curve)]
    if len(runs) % 2 == 0 and min(map(len, runs)) > 1:
        both_ends = math.fsum(_gap(one[end], two[end]) for one, two in pairs for end in (0, -1))
        ways.insert(0, (both_ends, [one[::-1] + two for one, two in pairs]))
    if min(map(len, runs)) > 2:
        ways.insert(0, (math.fsum(_gap(run[-1], run[0]) for run in runs), runs))
    cost, curves = min(ways, key=lambda way: way[0])
    apart = next((each for each, way in ways if way is runs), math.inf)
    if curves is not runs and cost > PLAIN * apart:
        fault = (
            "begins a curve that may be one with the others, or a body of its own: repeat its first point at its end"
        )
        raise _refusal(name, runs[1][0], fault)
    title = next((part.before for part in parts[1:] if part.before.is_text), None)
    if title and curves is one_curve:
        raise _refusal(name, title, "text within a curve")
    return curves


def _gap(one: Line, two: Line) -> float:
    """Distance between two points."""
    return math.dist(one.values, two.values)


def _refusal(name: str, line: Line, fault: str = "") -> ConfigError:
    text = _shown(line.text if len(line.text) < 60 else f"{line.text[:60]}...")
    return ConfigError(f'{name}:{line.number}: "{text}": {fault or line.fault or "two numbers expected"}')


def _closed(curve: list[Line], name: str) -> tuple[shapely.Polygon, str]:
    """Return the body that a curve goes around, and what of it was left out: what its sides cut off by crossing."""
    points = [point for before, point in pairwise([curve[-1], *curve]) if point.values != before.values]
    if len(points) < 3:
        raise _refusal(name, curve[0], "begins a curve of too few points, three or more are needed")
    drawn = shapely.Polygon([point.values for point in points])
    size = math.dist(drawn.bounds[:2], drawn.bounds[2:])
    if drawn.is_valid and drawn.area > 1e-9 * size**2:
        return drawn, ""
    edges = shapely.linestrings([[one.values, two.values] for one, two in pairwise([*points, points[0]])])
    x, y = map(float, (shapely.is_valid_reason(drawn).partition("[")[2].rstrip("]") or "nan nan").split())
    parts = _parts_of(drawn, edges)
    area = sum(part.area for part in parts)
    if parts and not area > 1e-9 * size**2:
        raise _refusal(name, points[0], "begins a curve that encloses no area")
    body = max(parts, key=lambda part: part.area, default=drawn)
    lost, shorter = 1 - body.area / (area or math.inf), (drawn.length - body.length) / 2 / size
    if body.interiors or lost > SLIVER or shorter > SHORTENED:
        nearest = np.argsort(shapely.distance(edges, shapely.Point(x, y)), kind="stable")[:2]
        one, two = sorted((points[index] for index in nearest), key=lambda point: point.number)
        remedy = "; a hole is a curve of its own: put a blank line before it" if body.interiors else ""
        fault = f"the curve meets itself after this line and after line {two.number}, at ({x:.6g}, {y:.6g}){remedy}"
        raise _refusal(name, one, fault)
    if max(lost, shorter) < 1e-6:
        return body, ""
    return body, f"its sides cross at ({x:.4g}, {y:.4g}), and {100 * shorter:.2g} % of its length is cut off there"


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
