"""Outlines from drawings: SVG, DXF, GeoJSON, and what is wrong with them."""

import builtins
import io
import json

import alsph
import ezdxf
import numpy as np
import pytest
import shapely
from alsph.cases import Body
from alsph.errors import ConfigError
from alsph.geometry.outline import Outline
from shapely import affinity

CHANNEL = {"resolution": 12, "length": 5.0, "height": 4.0, "upstream": 2.0}
SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100">{}</svg>'

L_SHAPE = [(0, 0), (40, 0), (40, 10), (10, 10), (10, 30), (0, 30)]
"""Upwards; a drawing in SVG has it downwards."""


def drawn(folder, name, content):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return Outline.read(path)


def dxf(draw, version="R2010"):
    drawing = ezdxf.new(version)
    draw(drawing, drawing.modelspace())
    stream = io.StringIO()
    drawing.write(stream)
    return stream.getvalue()


def as_drawn(polygon):
    """Return a polygon with its lower left corner at the origin and its larger extent 1."""
    left, bottom, right, top = polygon.bounds
    size = 1 / max(right - left, top - bottom)
    return affinity.scale(affinity.translate(polygon, -left, -bottom), size, size, origin=(0, 0))


def points(shape, flip=1):
    return " ".join(f"{x},{flip * y}" for x, y in shape)


def lines(drawing, space):
    for start, end in zip(L_SHAPE, [*L_SHAPE[1:], L_SHAPE[0]], strict=True):
        space.add_line(start, end)


def block(drawing, space):
    part = drawing.blocks.new("part")
    part.add_lwpolyline(L_SHAPE, close=True)
    space.add_blockref("part", (7, -3), dxfattribs={"xscale": 2, "yscale": 2})


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("l.svg", SVG.format(f'<polygon points="{points(L_SHAPE, -1)}"/>')),
        ("l.SVG", SVG.format(f'<path d="M {points(L_SHAPE, -1)} Z"/>')),
        ("l.svg", SVG.format('<path d="m5 5h40v-10h-30v-20h-10z"/>')),
        ("l.svg", SVG.format(f'<g transform="translate(3 4) scale(2)"><path d="M{points(L_SHAPE, -1)}z"/></g>')),
        ("l.svg", SVG.format('<path d="M0,0 L40,0 L40,-10 L10,-10"/><polyline points="10,-10 10,-30 0,-30 0,0"/>')),
        (
            "l.svg",
            '<?xml version="1.0"?>\n<!-- a drawing -->' + SVG.format(f'<polygon points="{points(L_SHAPE, -1)}"/>'),
        ),
        ("l.dxf", dxf(lambda drawing, space: space.add_lwpolyline(L_SHAPE, close=True))),
        ("l.dxf", dxf(lambda drawing, space: space.add_polyline2d(L_SHAPE, close=True), "R12")),
        ("l.DXF", dxf(lines)),
        ("l.dxf", dxf(block)),
        ("l.geojson", shapely.to_geojson(shapely.Polygon(L_SHAPE))),
        (
            "l.json",
            json.dumps({"type": "Feature", "properties": {}, "geometry": shapely.Polygon(L_SHAPE).__geo_interface__}),
        ),
        ("l.geojson", shapely.to_geojson(shapely.LineString([*L_SHAPE, L_SHAPE[0]]))),
    ],
)
def test_the_same_outline_in_every_form(tmp_path, name, content):
    outline = drawn(tmp_path, name, content)
    (body,) = outline.polygons
    expected = as_drawn(shapely.Polygon(L_SHAPE))
    assert as_drawn(body).symmetric_difference(expected).area < 1e-5
    assert max(body.bounds[2] - body.bounds[0], body.bounds[3] - body.bounds[1]) == pytest.approx(1)
    assert outline.file == name and "its larger extent is " in outline.remark


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("c.svg", SVG.format('<circle cx="50" cy="50" r="20"/>')),
        ("c.svg", SVG.format('<path d="M30 50A20 20 0 0 1 70 50A20 20 0 0 1 30 50Z"/>')),
        ("c.svg", SVG.format('<ellipse rx="2" ry="1" transform="rotate(30) scale(1 2)"/>')),
        ("c.dxf", dxf(lambda drawing, space: space.add_circle((5, 5), 20))),
        (
            "c.dxf",
            dxf(lambda drawing, space: [space.add_arc((1, 2), 7, start, start + 90) for start in (0, 90, 180, 270)]),
        ),
        ("c.dxf", dxf(lambda drawing, space: space.add_lwpolyline([(-1, 0, 0, 0, 1), (1, 0, 0, 0, 1)], close=True))),
    ],
)
def test_circles_are_round(tmp_path, name, content):
    (body,) = drawn(tmp_path, name, content).polygons
    assert body.area == pytest.approx(np.pi / 4, rel=2e-3)
    centre = body.centroid
    corners = shapely.get_coordinates(body.exterior) - [centre.x, centre.y]
    assert np.hypot(*corners.T) == pytest.approx(0.5, abs=1e-3)


def test_several_bodies_keep_their_places_and_what_is_no_curve_is_told(tmp_path):
    content = SVG.format(
        '<circle cx="10" cy="0" r="1"/><rect x="0" y="4" width="2" height="2"/><text x="1" y="1">a</text>'
    )
    outline = drawn(tmp_path, "two.svg", content)
    circle, square = outline.polygons
    assert (circle.centroid.x - square.centroid.x) * 11 == pytest.approx(9)
    assert (circle.centroid.y - square.centroid.y) * 11 == pytest.approx(5)
    assert "left out, for they are no curves: 1 text" in outline.remark
    noted = dxf(lambda drawing, space: [space.add_circle((0, 0), 1), space.add_text("a"), space.add_point((9, 9))])
    assert "1 POINT, 1 TEXT" in drawn(tmp_path, "noted.dxf", noted).remark


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.svg", "", "a.svg: no SVG that can be read"),
        ("a.svg", "<svg", "a.svg: no SVG that can be read"),
        ("a.svg", b"\x00\xff" * 50, "a.svg: no SVG that can be read"),
        ("a.svg", SVG.format(""), "a.svg: holds no curves"),
        ("a.svg", SVG.format("<text>a</text>"), "a.svg: holds no curves"),
        ("a.svg", SVG.format('<polyline points="0,0 1,0 1,1"/>'), r"a curve is not closed, it ends at \(\S+, \S+\)"),
        ("a.svg", SVG.format('<path d="M0 0L1 1L1 0L0 1Z"/>'), "a.svg: .*meets itself"),
        ("a.svg", SVG.format('<circle r="5"/><circle cx="3" r="5"/>'), "curves 1 and 2 overlap"),
        ("a.dxf", "", "a.dxf: holds no curves"),
        ("a.dxf", b"\x00\xff" * 50, "a.dxf: no DXF that can be read"),
        ("a.dxf", "0\nSECTION\n2\nENTITIES\n0\nLINE", "a.dxf: "),
        ("a.dxf", dxf(lambda drawing, space: space.add_text("a")), "a.dxf: holds no curves"),
        ("a.dxf", dxf(lambda drawing, space: space.add_line((0, 0), (1, 1))), "a curve is not closed"),
        ("a.geojson", "{", "a.geojson: no GEOJSON that can be read"),
        ("a.geojson", '{"type": "Point", "coordinates": [1, 2]}', "holds no curves"),
        ("a.geojson", '{"type": "LineString", "coordinates": [[0, 0], [1e400, 1], [1, 0]]}', "a.geojson: "),
    ],
)
def test_what_is_no_outline_is_refused_by_its_file(tmp_path, name, content, message):
    with pytest.raises(ConfigError, match=message) as refusal:
        drawn(tmp_path, name, content)
    assert str(refusal.value).count(name) >= 1 and "\n" not in str(refusal.value)
    with pytest.raises(ConfigError, match="^shape = "):
        Body(shape=str(tmp_path / name))


def test_a_drawing_that_is_too_large_or_gone(tmp_path):
    with pytest.raises(ConfigError, match="larger than 8 MiB"):
        drawn(tmp_path, "large.svg", " " * (2**23 + 1))
    with pytest.raises(ConfigError, match="gone.svg': no such file"):
        Body(shape="gone.svg")
    (tmp_path / "folder.svg").mkdir()
    with pytest.raises(ConfigError, match="no regular file"):
        Outline.read(tmp_path / "folder.svg")


def test_without_the_library_it_says_what_to_install(tmp_path, monkeypatch):
    known = builtins.__import__

    def missing(name, *rest):
        if name.startswith(("svgelements", "ezdxf")):
            raise ModuleNotFoundError(f"No module named '{name}'", name=name)
        return known(name, *rest)

    monkeypatch.setattr(builtins, "__import__", missing)
    for name in ("a.svg", "a.dxf"):
        with pytest.raises(ConfigError, match=rf"{name}: \.... needs \w+: pip install 'alsph\[drawings\]'"):
            drawn(tmp_path, name, "")


def test_a_run_of_a_drawing_needs_it_no_more(tmp_path):
    path = tmp_path / "l.svg"
    path.write_text(SVG.format(f'<polygon points="{points(L_SHAPE, -1)}"/>'))
    case = Body(shape=str(path), scale=1.25, **CHANNEL)
    left, bottom, right, top = case.outline.bounds
    assert (right - left, top - bottom) == pytest.approx((1.25, 0.9375))
    run = case.run(tmp_path / "run", until=0.05, progress=False)
    path.unlink()
    alsph.resume(run.path, until=0.1, progress=False)
    assert alsph.repeat(run.path, progress=False).same and run.config.case.outline.equals(case.outline)
    assert Body(shape=case.shape, **CHANNEL).outline.bounds[2] == pytest.approx(right / 1.25)


def ring(radius):
    angle = np.linspace(0, 2 * np.pi, 65)
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def nested_lines(drawing, space):
    for side in (10, 4):
        corners = [(-side, -side), (side, -side), (side, side), (-side, side)]
        for start, end in zip(corners, [*corners[1:], corners[0]], strict=True):
            space.add_line(start, end)


@pytest.mark.parametrize(
    ("name", "content", "share"),
    [
        ("a.svg", SVG.format('<circle r="5"/><circle r="2"/>'), 0.16),
        ("a.svg", SVG.format('<path fill-rule="evenodd" d="M0 0h10v10h-10z M3 3h4v4h-4z"/>'), 0.16),
        ("a.svg", SVG.format('<path d="M0 0h10v10h-10z M3 3v4h4v-4z"/>'), 0.16),
        ("a.dxf", dxf(lambda drawing, space: [space.add_circle((1, 2), radius) for radius in (2, 5)]), 0.16),
        ("a.dxf", dxf(nested_lines), 0.16),
        ("a.dxf", dxf(lambda drawing, space: [space.add_lwpolyline(ring(radius)) for radius in (3, 6)]), 0.25),
        ("a.geojson", shapely.to_geojson(shapely.Polygon(ring(2), [ring(1)])), 0.25),
        ("a.geojson", shapely.to_geojson(shapely.MultiPolygon([shapely.Polygon(ring(2), [ring(1)[::-1]])])), 0.25),
    ],
)
def test_a_curve_within_a_curve_is_a_hole(tmp_path, name, content, share):
    outline = drawn(tmp_path, name, content)
    (body,) = outline.polygons
    (hole,) = body.interiors
    whole = shapely.Polygon(body.exterior).area
    assert shapely.Polygon(hole).area == pytest.approx(share * whole, rel=2e-3)
    assert body.area == pytest.approx((1 - share) * whole, rel=2e-3)
    assert "with 1 hole" in str(outline)
    assert Outline(**outline.model_dump()).polygons == outline.polygons
