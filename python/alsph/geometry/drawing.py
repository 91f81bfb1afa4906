"""Outlines from drawings: the closed curves of SVG, DXF and GeoJSON files, of which the larger extent becomes D.

Curves within curves are holes in them, by the even-odd rule, whatever a drawing says of its filling.
"""

import io
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from alsph.arrays import FloatArray
from alsph.errors import ConfigError
from alsph.text import contents, printable

LARGEST_FILE = 2**23
"""Size of the largest drawing that is read [bytes]."""

CURVED = 48
"""Edges that an arc or a Bézier curve of a drawing becomes at least."""

SAGITTA = 1e-4
"""How far they may be from the curve, over the drawing's extent."""

MEETING = 1e-6
"""Distance over the drawing's extent within which curves that end there meet."""

MOST_CURVES = 5000

Found = tuple[list[FloatArray], list[str]]
"""The curves of a drawing, each an array (n, 2), and what was left out of it."""


def is_drawing(path: Path) -> bool:
    """Whether a file is one, by its name."""
    return path.suffix.lower() in READERS


def read(path: Path) -> tuple[list[shapely.Polygon], str]:
    """Return what the curves of a drawing go around, its larger extent 1, y upwards, and what is to be said of it.

    Raises
    ------
    ConfigError
        If it cannot be read, needs a library that is not there, or holds a curve that is not closed.
    """
    name = printable(path.name)
    try:
        content = contents(path, LARGEST_FILE)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from None
    try:
        curves, left_out = READERS[path.suffix.lower()](content)
    except ImportError as error:
        suffix = path.suffix.lower()
        raise ConfigError(f"{name}: {suffix} needs {error.name}: pip install 'alsph[drawings]'") from None
    except Exception as error:  # whatever another library makes of a bad file
        raise ConfigError(f"{name}: no {path.suffix[1:].upper()} that can be read: {printable(str(error))}") from None
    curves = [curve for curve in curves if len(curve) > 1]
    if not curves:
        raise ConfigError(f"{name}: holds no curves; outlines are closed paths, polylines, circles or polygons")
    if len(curves) > MOST_CURVES:
        raise ConfigError(f"{name}: holds {len(curves):,} curves; {MOST_CURVES:,} are the most, draw outlines alone")
    points = np.concatenate(curves)
    lower, upper = points.min(axis=0), points.max(axis=0)
    extent = float((upper - lower).max())
    if not np.isfinite(points).all() or not extent > 0:
        raise ConfigError(f"{name}: its coordinates are no lengths")
    bodies = _closed([(curve - lower) / extent for curve in curves], lambda at: at * extent + lower, name)
    unit = "pixels of 1/96 inch" if path.suffix.lower() == ".svg" else "units of the file"
    size = f"its larger extent is {extent:.6g} {unit}, and D, or as many D as `scale` says"
    return bodies, "; ".join([size, *left_out])


def _closed(curves: list[FloatArray], back: Callable[[FloatArray], FloatArray], name: str) -> list[shapely.Polygon]:
    """Return what the curves go around; those that are open are joined where their ends meet."""
    ends = [float(np.hypot(*(curve[-1] - curve[0]))) for curve in curves]
    closed = [
        shapely.Polygon(curve) for curve, gap in zip(curves, ends, strict=True) if gap < MEETING and len(curve) > 3
    ]
    rest = [curve for curve, gap in zip(curves, ends, strict=True) if gap >= MEETING]
    if not rest:
        return closed
    lines = shapely.set_precision([shapely.LineString(curve) for curve in rest], MEETING)
    found, cuts, dangles, _ = shapely.polygonize_full(lines)
    for loose in (dangles, cuts):
        if not loose.is_empty:
            x, y = back(shapely.get_coordinates(loose)[0])
            raise ConfigError(f"{name}: a curve is not closed, it ends at ({x:.6g}, {y:.6g}); close it, or take it out")
    return [*closed, *(shapely.Polygon(part.exterior) for part in shapely.get_parts(found))]


def _svg(content: bytes) -> Found:
    import svgelements

    drawing = svgelements.SVG.parse(io.BytesIO(content), reify=True)
    curves, other = [], Counter[str]()
    for element in drawing.elements():
        if isinstance(element, svgelements.Shape):
            path = svgelements.Path(element)
            path.reify()
            curves += [_sampled(svgelements.Path(part)) for part in path.as_subpaths()]
        elif isinstance(element, svgelements.Text | svgelements.Image | svgelements.Use) and not isinstance(
            element, svgelements.Group
        ):
            other[type(element).__name__.lower()] += 1
    return [curve * [1.0, -1.0] for curve in curves if len(curve)], _left_out(other)


def _sampled(path: Any) -> FloatArray:
    """Return points along a path of svgelements, from segment to segment."""
    points: list[tuple[float, float]] = []
    for segment in path:
        kind = type(segment).__name__
        if kind != "Move" and segment.start is not None and not points:
            points.append((segment.start.x, segment.start.y))
        if kind in ("Move", "Line", "Close"):
            if segment.end is not None:
                points.append((segment.end.x, segment.end.y))
        else:
            shares = np.linspace(0, 1, CURVED + 1)[1:]
            points += [(point.x, point.y) for point in map(segment.point, shares)]
    return np.array(points, float).reshape(-1, 2)


def _dxf(content: bytes) -> Found:
    import ezdxf
    import ezdxf.disassemble
    import ezdxf.path
    import ezdxf.recover

    drawing, _ = ezdxf.recover.read(io.BytesIO(content))
    paths, other = [], Counter[str]()
    for entity in ezdxf.disassemble.recursive_decompose(drawing.modelspace()):
        try:
            paths.append(ezdxf.path.make_path(entity))
        except TypeError:  # a text, a dimension, a point
            other[entity.dxftype()] += 1
    vertices = np.array([(at.x, at.y) for path in paths for at in path.control_vertices()]).reshape(-1, 2)
    extent = float(np.ptp(vertices, axis=0).max()) if len(vertices) else 1.0
    curves = [
        np.array([(at.x, at.y) for at in part.flattening(max(SAGITTA * extent, 1e-300), segments=4)]).reshape(-1, 2)
        for path in paths
        for part in path.sub_paths()
        if len(part)
    ]
    return curves, _left_out(other)


def _geojson(content: bytes) -> Found:
    geometry = shapely.from_geojson(content.decode("utf-8-sig"))
    curves, other = [], Counter[str]()
    for part in _all_parts(geometry):
        if isinstance(part, shapely.Polygon):
            curves += [shapely.get_coordinates(ring) for ring in (part.exterior, *part.interiors)]
        elif isinstance(part, shapely.LineString):
            curves.append(shapely.get_coordinates(part))
        else:
            other[part.geom_type] += 1
    return curves, _left_out(other)


def _all_parts(geometry: shapely.Geometry) -> Iterable[shapely.Geometry]:
    for part in shapely.get_parts(geometry):
        yield from _all_parts(part) if hasattr(part, "geoms") else (part,)


def _left_out(other: Counter[str]) -> list[str]:
    names = ", ".join(f"{count} {name}" for name, count in sorted(other.items()))
    return [f"left out, for they are no curves: {names}"] if names else []


READERS: dict[str, Callable[[bytes], Found]] = {".svg": _svg, ".dxf": _dxf, ".geojson": _geojson, ".json": _geojson}
"""What reads a drawing, by the end of the file's name."""
