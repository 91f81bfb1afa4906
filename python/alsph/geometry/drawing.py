"""Outlines from drawings: the closed curves of SVG, DXF and GeoJSON files, of which the larger extent becomes D.

Curves within curves are holes in them, by the even-odd rule, whatever a drawing says of its filling.
"""

import io
import json
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import shapely
from numpy.typing import NDArray

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

DEGREES = (
    "GeoJSON is in degrees as a rule: if this is, its degrees are taken as lengths, and a map is to be projected first"
)
"""What is said of coordinates that may be longitudes and latitudes."""

Found = tuple[list[FloatArray], list[str]]
"""The curves of a drawing, each an array (n, 2), and what is to be said of them."""

DEFINITIONS = ("marker", "mask", "symbol")
"""Elements of SVG that are drawn only where others refer to them, of those that svgelements draws where they stand."""

UNREAD = ("clip-path", "mask", "transform-origin", "transform")
"""Attributes and styles of SVG that are not followed, but for the attribute ``transform``."""


PLACE = re.compile(r"\(([-+.e\d]+), ([-+.e\d]+)\)")
"""A place in a message."""


@dataclass
class Frame:
    """Where in a drawing what is read of it lies."""

    corner: FloatArray
    """The lower left one, y upwards (2,)."""
    extent: float
    up: float
    """1, or −1 if y goes downwards in the drawing."""

    def of(self, curve: FloatArray) -> FloatArray:
        """Return points of the drawing, y upwards, with its larger extent 1 and its lower left corner 0."""
        return (curve - self.corner) / self.extent

    def told(self, x: float, y: float) -> str:
        """Return such a point in the drawing's own coordinates."""
        x, y = (np.array([x, y]) * self.extent + self.corner) * (1.0, self.up) + 0.0  # no -0
        return f"({x:.6g}, {y:.6g})"

    def translated(self, text: str) -> str:
        """Return a message with the places in it in the drawing's own coordinates."""
        return PLACE.sub(lambda place: self.told(float(place[1]), float(place[2])), text)


def is_drawing(path: Path) -> bool:
    """Whether a file is one, by its name."""
    return path.suffix.lower() in READERS


def read(path: Path) -> tuple[list[shapely.Polygon], str, Frame]:
    """Return what the curves of a drawing go around, what is to be said of it, and where in the drawing that lies.

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
        curves, said = READERS[path.suffix.lower()](content)
    except ImportError as error:
        suffix = path.suffix.lower()
        raise ConfigError(f"{name}: {suffix} needs {error.name}: pip install 'alsph[drawings]'") from None
    except Exception as error:  # whatever another library makes of a bad file
        raise ConfigError(f"{name}: no {path.suffix[1:].upper()} that can be read: {printable(str(error))}") from None
    curves = [curve for curve in curves if len(curve) > 1]
    if not curves:
        told = "; ".join(["outlines are closed paths, polylines, circles or polygons", *said])
        raise ConfigError(f"{name}: holds no curves; {told}")
    if len(curves) > MOST_CURVES:
        raise ConfigError(f"{name}: holds {len(curves):,} curves; {MOST_CURVES:,} are the most, draw outlines alone")
    points = np.concatenate(curves)
    lower, upper = points.min(axis=0), points.max(axis=0)
    extent = float((upper - lower).max())
    if not np.isfinite(points).all() or not extent > 0:
        raise ConfigError(f"{name}: its coordinates are no lengths")
    svg = path.suffix.lower() == ".svg"
    frame = Frame(lower, extent, -1.0 if svg else 1.0)
    bodies = _closed([frame.of(curve) for curve in curves], frame, name)
    unit = "pixels of 1/96 inch" if svg else "units of the file"
    size = f"its larger extent is {extent:.6g} {unit}, and D, or as many D as `scale` says"
    return bodies, "; ".join([size, *said]), frame


def _closed(curves: list[FloatArray], frame: Frame, name: str) -> list[shapely.Polygon]:
    """Return what the curves go around; those that are open are joined where their ends meet, each taken once."""
    ends = [float(np.hypot(*(curve[-1] - curve[0]))) for curve in curves]
    drawn = [
        shapely.Polygon(curve) for curve, gap in zip(curves, ends, strict=True) if gap < MEETING and len(curve) > 3
    ]
    closed = [*dict(zip(shapely.normalize(_coarse(drawn)), drawn, strict=True)).values()]
    rest = [curve for curve, gap in zip(curves, ends, strict=True) if gap >= MEETING]
    if not rest:
        return closed
    lines = _coarse([shapely.LineString(curve) for curve in rest])
    once = dict(zip(shapely.normalize(lines), lines, strict=True))  # whichever way they are drawn
    found, cuts, dangles, crossing = shapely.polygonize_full(list(once.values()))
    ending = "is not closed, it ends at {}; close it, or take it out"
    meeting = "through {} meets itself; draw it without a crossing, and each of its lines once"
    for parts, fault in ((dangles, ending), (cuts, ending), (crossing, meeting)):
        if not parts.is_empty:
            tips = np.concatenate([curve[[0, -1]] for curve in rest])
            tip = min(tips, key=lambda tip: float(np.hypot(*(tip - shapely.get_coordinates(parts)[0]))))
            raise ConfigError(f"{name}: a curve {fault.format(frame.told(*tip))}")
    return [*closed, *(shapely.Polygon(part.exterior) for part in shapely.get_parts(found))]


def _coarse(shapes: Sequence[shapely.Geometry]) -> NDArray[np.object_]:
    """Return shapes to the distance within which curves meet, so that those that are drawn twice are the same."""
    return np.asarray(shapely.set_precision(shapes, MEETING, mode="pointwise"))


def _svg(content: bytes) -> Found:
    import svgelements

    tree = ElementTree.fromstring(content)
    curves: list[FloatArray] = []
    other, hidden = Counter[str](), _undrawn(tree)
    # Not reified: an arc that is skewed would be wrong, and one of a circle refused.
    drawing = svgelements.SVG.parse(io.BytesIO(ElementTree.tostring(tree)), reify=False, parse_display_none=True)
    for element in _displayed(drawing, hidden):
        kind = type(element).__name__.lower()
        if not isinstance(element, svgelements.Shape):
            other[kind] += isinstance(element, svgelements.Text | svgelements.Image | svgelements.Use)
        elif _is_invisible(element):
            hidden[kind] += 1
        else:
            path, to = svgelements.Path(element), element.transform
            turn = np.array([[to.a, to.b], [to.c, to.d]], float)
            curves += [_sampled(svgelements.Path(part)) @ turn + [to.e, to.f] for part in path.as_subpaths()]
    said = _left_out(other, hidden)
    if unread := [name for name in UNREAD if name in {*_properties(tree)}]:
        said.append(f"not regarded: {', '.join(unread)}, which may cut or move what is drawn; apply it in the drawing")
    return [curve * [1.0, -1.0] for curve in curves if len(curve)], said


def _properties(tree: ElementTree.Element) -> Iterable[str]:
    """Yield the attributes of all elements but ``transform``, and the properties that they have by CSS."""
    for element in tree.iter():
        yield from (name for name in element.keys() if name != "transform")
        style = element.get("style", "")
        if element.tag.rpartition("}")[2] == "style":
            style = (element.text or "").replace("{", ";")
        yield from (part.partition(":")[0].strip() for part in style.split(";"))


def _is_invisible(element: Any) -> bool:
    """Whether an element of svgelements says that nothing is seen of it."""
    values = element.values
    unfilled = str(values.get("fill")) == "none" and str(values.get("stroke", "none")) == "none"
    return unfilled or values.get("visibility") in ("hidden", "collapse") or str(values.get("opacity")) in ("0", "0%")


def _displayed(element: Any, hidden: Counter[str]) -> Iterable[Any]:
    """Return what an element of svgelements is made of, without what it says it does not display."""
    if element.values.get("display") == "none":
        hidden[type(element).__name__.lower()] += 1
    elif isinstance(element, list) and element:  # groups are lists, and what refers to one
        for part in element:
            yield from _displayed(part, hidden)
    else:
        yield element


def _undrawn(drawing: ElementTree.Element) -> Counter[str]:
    """Put definitions into `defs`, where they are not drawn, and return of what kinds those are that nothing uses."""
    used = {value for element in drawing.iter() for name, value in element.items() if name.endswith("href")}
    unused = Counter[str]()
    for parent in [element for element in drawing.iter() if not element.tag.endswith("defs")]:
        for place, child in enumerate(parent):
            kind = child.tag.rpartition("}")[2]
            if kind in DEFINITIONS:
                parent[place] = ElementTree.Element(child.tag.replace(kind, "defs"))
                parent[place].append(child)
                if f"#{child.get('id')}" not in used:
                    unused[kind] += 1
    return unused


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
    paths, other, hidden = [], Counter[str](), Counter[str]()
    off = {layer.dxf.name.lower() for layer in drawing.layers if layer.is_off() or layer.is_frozen()}

    def is_hidden(entity: Any) -> bool:
        block, layer = entity.source_block_reference, entity.dxf.get("layer", "0").lower()
        within = block is not None and is_hidden(block)
        own = layer in off and (block is None or layer != "0")  # layer 0 of a block is that which the block is put on
        return bool(entity.dxf.get("invisible", 0) or own or within)

    def shown(entities: Iterable[Any]) -> Iterable[Any]:
        for entity in entities:
            if is_hidden(entity):
                hidden[entity.dxftype()] += 1
            else:
                yield entity

    for entity in shown(ezdxf.disassemble.recursive_decompose(shown(drawing.modelspace()))):
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
    return curves, _left_out(other, hidden)


def _geojson(content: bytes) -> Found:
    drawing = json.loads(content)
    features = drawing.get("features", [drawing]) if isinstance(drawing, dict) else None
    if not (isinstance(features, list) and all(isinstance(feature, dict) for feature in features)):
        raise ValueError("it holds no GeoJSON object, or features that are none")
    there = [json.dumps(feature) for feature in features if feature.get("geometry", feature) is not None]
    curves, other = [], Counter({"Feature without geometry": len(features) - len(there)})
    for part in _all_parts(shapely.from_geojson(np.array(there, object))):
        if isinstance(part, shapely.Polygon):
            curves += [shapely.get_coordinates(ring) for ring in (part.exterior, *part.interiors)]
        elif isinstance(part, shapely.LineString):
            curves.append(shapely.get_coordinates(part))
        else:
            other[part.geom_type] += 1
    system = str(drawing.get("crs") or "CRS84")
    geographic = "CRS84" in system or "4326" in system
    may_be_degrees = curves and geographic and (np.abs(np.concatenate(curves)) <= [180, 90]).all()
    return curves, [*([DEGREES] if may_be_degrees else []), *_left_out(other, Counter())]


def _all_parts(geometry: Any) -> Iterable[shapely.Geometry]:
    for part in shapely.get_parts(geometry):
        yield from _all_parts(part) if hasattr(part, "geoms") else (part,)


def _left_out(other: Counter[str], hidden: Counter[str]) -> list[str]:
    return [
        f"left out, for {why}: " + ", ".join(f"{count} {name}" for name, count in sorted(found.items()))
        for why, found in (("they are no curves", +other), ("the drawing does not show them", +hidden))
        if found
    ]


READERS: dict[str, Callable[[bytes], Found]] = {".svg": _svg, ".dxf": _dxf, ".geojson": _geojson, ".json": _geojson}
"""What reads a drawing, by the end of the file's name."""
