"""Text files of points, in the forms in which outlines are found, and the curves that their points make.

A line is a point, two numbers, or it is blank, a comment (``#``, ``%``, ``!``, ``//``), a title or note, whose first
word is no number, a count of points, or it is refused by its number. Blank lines, titles and lines ``999 999`` divide
the points into parts. Which parts make a curve, the shortest edges that close them decide: each part by itself (several
bodies), upper and lower side from the leading edge on (Lednicer's order), or one after the other.
"""

import math
import os
import re
import stat
from dataclasses import dataclass, field
from itertools import accumulate, chain
from pathlib import Path

import numpy as np

from alsph.errors import ConfigError

LARGEST_FILE = 2**20
"""Size of the largest file that is read [bytes]; outlines have some kilobytes."""
MOST_POINTS = 20_000
"""Most points of a file."""
LARGEST_NUMBER = 1e6
"""Coordinates beyond it are no lengths in D."""
LONGEST_LINE = 1000
"""Number of characters beyond which a line is of another kind of file."""
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


def printable(text: str) -> str:
    """Return what a terminal can be given."""
    return "".join(character if character.isprintable() else "?" for character in text)


def decoded(path: str | os.PathLike[str]) -> str:
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


def curves(text: str, name: str) -> list[list[Line]]:
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
        raise refusal(name, fault) if fault else ConfigError(f"{name}: holds no points; {EXPECTED}")
    parts = [Part(Line(0, ""), [])]
    for line in lines[:end]:
        if line.is_point:
            parts[-1].points.append(line)
        elif line.fault or (line.values and line.values != BODIES_APART and parts[-1].points):
            raise refusal(name, line)
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
            raise refusal(name, line)
    points = [point for part in parts for point in part.points]
    if len(points) > MOST_POINTS:
        raise ConfigError(f"{name}: holds {len(points):,} points; {MOST_POINTS:,} are the most, thin them out")
    commas = [point for point in points if point.comma]
    if odd := next((point for point in commas if point.comma != commas[0].comma), None):
        raise refusal(name, odd, f"commas {odd.comma} here, and {commas[0].comma} in line {commas[0].number}")
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
                raise refusal(name, line, f"{len(part.points)} points follow" if len(limits) == 1 else "")
    count, other = first.values
    whole = count.is_integer() and other.is_integer() and count >= 3 and other >= 0
    if not whole or len(points) < 3 or any(point.values == first.values for point in points):
        return parts
    fits = len(points) in (count, count + other)
    far = ((first.values < 2 * lower - upper) | (first.values > 2 * upper - lower)).any()
    if fits != far and (fits or other > 0):
        raise refusal(
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
        raise refusal(name, first, f"{' and '.join(str(len(part.points)) for part in parts)} points follow")
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
        raise refusal(name, runs[1][0], fault)
    title = next((part.before for part in parts[1:] if part.before.is_text), None)
    if title and curves is one_curve:
        raise refusal(name, title, "text within a curve")
    return curves


def _gap(one: Line, two: Line) -> float:
    """Distance between two points."""
    return math.dist(one.values, two.values)


def refusal(name: str, line: Line, fault: str = "") -> ConfigError:
    """Return the refusal of a line of the file `name`: what is wrong with it if it does not say so itself."""
    text = printable(line.text if len(line.text) < 60 else f"{line.text[:60]}...")
    return ConfigError(f'{name}:{line.number}: "{text}": {fault or line.fault or "two numbers expected"}')
