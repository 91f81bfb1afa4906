"""Planes on which a run records velocity and pressure as it goes: points of regular grids, recorded as probes are."""

import re
from collections.abc import Sequence

import numpy as np

from alsph.arrays import FloatArray
from alsph.errors import ConfigError
from alsph.geometry.domain import Domain
from alsph.geometry.lattice import cell_counts, cell_middles
from alsph.geometry.plane import Plane
from alsph.geometry.points import checked_point, numbers
from alsph.text import shown

MOST_POINTS = 200_000
"""Of all planes together: 6 MB a record in 3-D."""


def grids(
    given: str | Sequence[str], domain: Domain, spacing: float, middle: FloatArray
) -> list[tuple[FloatArray, ...]]:
    """Return the coordinates along x, y and, in 3-D, z of the points of each plane.

    Parameters
    ----------
    given
        Planes, one after the other, such as ``"x=3"``, through the whole domain, ``"y"``, through the middle, or
        ``"1,-1:4,1"``, from corner to corner: in 2-D a region or line, in 3-D a plane, line or box; ``":0.1"`` after
        one is the distance of its points. They are the middles of cells that cover it.
    domain
        The domain of the flow.
    spacing
        Distance of the points where none is given [D].
    middle
        Point (d,) that a plane without a place goes through.

    Raises
    ------
    ConfigError
        If one is no plane of the domain, or they have too many points.
    """
    text = given if isinstance(given, str) else ";".join(given)
    boxes = [_box(part, domain, spacing, middle) for part in re.split(r"[;\s]+", text) if part]
    counts = [cell_counts(*box) for box in boxes]
    if sum(float(count.prod()) for count in counts) > MOST_POINTS:
        raise ConfigError(
            f"run.planes: more than {MOST_POINTS:,} points; give those of a plane a larger distance, as in x=3:0.1 [D]"
        )
    return [cell_middles(lower, upper, count) for (lower, upper, _), count in zip(boxes, counts, strict=True)]


def _box(text: str, domain: Domain, spacing: float, middle: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Return the corners of a plane and the distance of its points."""
    place, *rest = text.split(":")
    if "," in place and rest:
        points = [
            checked_point("run.planes", part.split(","), domain.dimensions, text) for part in (place, rest.pop(0))
        ]
        lower, upper = np.sort(points, axis=0)
    else:
        plane = Plane.of(place, middle, "run.planes")
        lower, upper = np.array([domain.lower, domain.upper])
        lower[plane.axis] = upper[plane.axis] = plane.place
    distance = numbers(rest[0] if rest else spacing)
    if len(rest) > 1 or distance.shape or distance <= 0:
        raise ConfigError(
            f"run.planes = {shown(text)}: what follows the last colon must be the distance of its points, a number "
            "above zero [D]"
        )
    if not domain.contains(np.array([lower, upper])).all():
        box = f"{list(domain.lower)} to {list(domain.upper)} [D]"
        raise ConfigError(f"run.planes = {shown(text)}: does not lie in the domain, {box}")
    if (lower == upper).all():
        raise ConfigError(f"run.planes = {shown(text)}: a single point; give it in probes, or two corners that differ")
    return lower, upper, float(distance)
