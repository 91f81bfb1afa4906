"""Outlines from drawings: SVG, DXF, GeoJSON, and what is wrong with them."""

import builtins
import io
import json
import re

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
        (
            "a.svg",
            SVG.format('<circle r="5" visibility="hidden"/>'),
            "a.svg: holds no curves; .*not show them: 1 circle",
        ),
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


@pytest.mark.parametrize(
    ("name", "content", "place"),
    [
        ("a.svg", SVG.format('<path d="M10 20L60 20L60 70L10 60"/>'), "it ends at (10, 20)"),
        ("a.svg", SVG.format('<path d="M10 20H60V70H10Z"/><path d="M40 60H90V90H40Z"/>'), "overlap at (50, 65)"),
        ("a.svg", SVG.format('<path d="M10 20L50 80L50 20L10 80Z"/>'), "at (30, 50)"),
        ("a.svg", SVG.format('<path d="M10 0L60 20"/>'), "it ends at (10, 0)"),
        ("a.dxf", dxf(lambda _, space: space.add_line((40, 60), (70, 75))), "it ends at (40, 60)"),
        (
            "a.geojson",
            '{"type": "MultiPolygon", "coordinates": [[[[10, 20], [60, 20], [60, 70], [10, 70], [10, 20]]],'
            "[[[40, 60], [90, 60], [90, 90], [40, 90], [40, 60]]]]}",
            "overlap at (50, 65)",
        ),
    ],
)
def test_faults_are_told_by_where_they_are_in_the_drawing(tmp_path, name, content, place):
    with pytest.raises(ConfigError) as refusal:
        drawn(tmp_path, name, content)
    assert place in str(refusal.value), refusal.value


CIRCLES = {
    "arcs": ('<path d="M30 50A20 20 0 1 1 70 50A20 20 0 1 1 30 50Z" transform="{}"/>', 400 * np.pi),
    "circle": ('<circle cx="50" cy="50" r="20" transform="{}"/>', 400 * np.pi),
    "capsule": ('<path d="M20 20H60A10 10 0 0 1 60 40H20A10 10 0 0 1 20 20Z" transform="{}"/>', 800 + 100 * np.pi),
    "rounded": ('<rect x="20" y="20" width="60" height="20" rx="10" transform="{}"/>', 800 + 100 * np.pi),
}


@pytest.mark.parametrize("shape", CIRCLES)
@pytest.mark.parametrize(
    ("transform", "turn"),
    [
        ("skewX(20)", [[1, 0], [np.tan(np.radians(20)), 1]]),
        ("skewY(10)", [[1, np.tan(np.radians(10))], [0, 1]]),
        ("scale(2,0.5) rotate(45)", np.sqrt(0.5) * np.array([[2, 0.5], [-2, 0.5]])),
        ("rotate(45) scale(2,0.5)", np.sqrt(0.5) * np.array([[2, 2], [-0.5, 0.5]])),
        ("matrix(1.2,0.3,-0.5,0.8,3,4)", [[1.2, 0.3], [-0.5, 0.8]]),
    ],
)
def test_arcs_under_any_transform(tmp_path, shape, transform, turn):
    element, area = CIRCLES[shape]
    outline = drawn(tmp_path, "a.svg", SVG.format(element.format(transform)))
    (body,) = outline.polygons
    plain = drawn(tmp_path, "b.svg", SVG.format(element.format(""))).polygons[0].exterior.coords
    turned = np.array(plain) * [1, -1] @ np.array(turn)  # y goes downwards there
    sides = np.ptp(turned, axis=0)
    assert np.ptp(body.exterior.coords, axis=0) == pytest.approx(sides / sides.max(), rel=2e-3)
    extent = float(re.search(r"larger extent is (\S+)", outline.remark)[1])
    assert body.area * extent**2 == pytest.approx(area * abs(np.linalg.det(turn)), rel=2e-3)


@pytest.mark.parametrize(
    ("content", "remark"),
    [
        ('<clipPath id="c"><circle r="8"/></clipPath><rect width="4" height="2" clip-path="url(#c)"/>', "clip-path"),
        ('<rect width="4" height="2" transform="rotate(90)" transform-origin="2 1"/>', "transform-origin"),
        ('<rect width="4" height="2" style="transform: rotate(90deg)"/>', "transform"),
        ('<style>.a { fill: red; mask: url(#m) }</style><rect class="a" width="4" height="2"/>', "mask"),
    ],
)
def test_what_of_a_drawing_is_not_followed_is_told(tmp_path, content, remark):
    assert f"not regarded: {remark}, which may cut or move" in drawn(tmp_path, "a.svg", SVG.format(content)).remark
    plain = '<g transform="rotate(90)"><rect width="4" height="2" style="fill: red"/></g>'
    assert "not regarded" not in drawn(tmp_path, "b.svg", SVG.format(plain)).remark


@pytest.mark.parametrize("way", ['opacity="0"', 'fill="none" stroke="none"', 'fill="none"', 'style="fill:none"'])
def test_what_a_drawing_lets_nobody_see_is_left_out(tmp_path, way):
    outline = drawn(tmp_path, "a.svg", SVG.format(f'<rect {way} width="90" height="90"/><rect width="4" height="2"/>'))
    (body,) = outline.polygons
    assert body.area == pytest.approx(0.5) and "does not show them: 1 rect" in outline.remark
    seen = '<rect fill="none" stroke="black" width="4" height="2"/>'
    assert drawn(tmp_path, "b.svg", SVG.format(seen)).polygons[0].area == pytest.approx(0.5)


def test_closed_curves_drawn_twice_are_taken_once(tmp_path):
    def with_its_hatch(drawing, space):
        space.add_lwpolyline(SQUARE, close=True)
        space.add_hatch().paths.add_polyline_path(SQUARE[::-1], is_closed=True)

    (body,) = drawn(tmp_path, "a.dxf", dxf(with_its_hatch)).polygons
    assert body.area == pytest.approx(1.0)
    twice = '<circle r="5"/><circle r="5"/>'
    assert len(drawn(tmp_path, "a.svg", SVG.format(twice)).polygons) == 1


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


SQUARE = [(0, 0), (2, 0), (2, 2), (0, 2)]


def sides(space, corners, left=0):
    for (x0, y0), (x1, y1) in zip(corners, [*corners[1:], corners[0]], strict=True):
        space.add_line((x0 + left, y0), (x1 + left, y1))


def square_beside_doubled_lines(drawing, space):
    space.add_lwpolyline(SQUARE, close=True)
    sides(space, SQUARE, left=5)
    sides(space, SQUARE[::-1], left=5)


def circle_around_doubled_lines(drawing, space):
    space.add_circle((1, 1), 4)
    sides(space, SQUARE)
    sides(space, SQUARE)


def test_lines_drawn_twice_are_taken_once(tmp_path):
    square, doubled = drawn(tmp_path, "a.dxf", dxf(square_beside_doubled_lines)).polygons
    assert (square.area, doubled.area) == pytest.approx((4 / 49, 4 / 49), rel=1e-5) and doubled.bounds[
        0
    ] == pytest.approx(5 / 7, rel=1e-5)
    (body,) = drawn(tmp_path, "a.dxf", dxf(circle_around_doubled_lines)).polygons
    assert body.area == pytest.approx(np.pi / 4 - 4 / 64, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "content", "place"),
    [
        ("a.dxf", dxf(lambda drawing, space: sides(space, [(5, 1), (6, 2), (6, 1), (5, 2)])), r"\(5, 1\)"),
        (
            "a.svg",
            SVG.format('<path d="M0 0h20v20h-20z"/><path d="M50 3L70 20L70 3L50 20"/><path d="M50 20L50 3"/>'),
            r"\(50, 3\)",
        ),
        (
            "a.dxf",
            dxf(lambda drawing, space: [sides(space, SQUARE), sides(space, [(7, 1), (8, 1), (9, 1)])]),
            r"\(7, 1\)",
        ),
    ],
)
def test_open_curves_that_meet_themselves_are_refused_where_they_are(tmp_path, name, content, place):
    with pytest.raises(ConfigError, match=f"{name}: a curve through {place} meets itself; draw it"):
        drawn(tmp_path, name, content)


def a_layer(switch):
    def draw(drawing, space):
        getattr(drawing.layers.add("notes"), switch)()
        space.add_lwpolyline(SQUARE, close=True)
        space.add_circle((9, 9), 1, dxfattribs={"layer": "Notes"})

    return draw


def unseen(drawing, space):
    space.add_lwpolyline(SQUARE, close=True)
    space.add_circle((9, 9), 1, dxfattribs={"invisible": 1})


def a_block_on_a_frozen_layer(drawing, space):
    drawing.layers.add("notes").freeze()
    drawing.blocks.new("inner").add_circle((9, 9), 1)
    drawing.blocks.new("outer").add_blockref("inner", (0, 0), dxfattribs={"layer": "notes"})
    space.add_lwpolyline(SQUARE, close=True)
    space.add_blockref("outer", (0, 0))


HIDDEN = '<path d="M0 0h20v20h-20z"/>{}'


@pytest.mark.parametrize(
    ("name", "content", "left_out"),
    [
        ("a.dxf", dxf(a_layer("off")), "1 CIRCLE"),
        ("a.dxf", dxf(a_layer("freeze")), "1 CIRCLE"),
        ("a.dxf", dxf(unseen), "1 CIRCLE"),
        ("a.dxf", dxf(a_block_on_a_frozen_layer), "1 CIRCLE"),
        ("a.svg", SVG.format(HIDDEN.format('<mask id="m"><circle cx="90" r="5"/></mask>')), "1 mask"),
        ("a.svg", SVG.format(HIDDEN.format('<symbol id="s"><circle cx="90" r="5"/></symbol>')), "1 symbol"),
        ("a.svg", SVG.format(HIDDEN.format('<circle cx="90" r="5" visibility="hidden"/>')), "1 circle"),
        ("a.svg", SVG.format(HIDDEN.format('<g style="visibility:hidden"><circle cx="90" r="5"/></g>')), "1 circle"),
        ("a.svg", SVG.format(HIDDEN.format('<g display="none"><circle r="5" display="inline"/></g>')), "1 group"),
    ],
)
def test_what_a_drawing_does_not_show_is_left_out_and_told(tmp_path, name, content, left_out):
    outline = drawn(tmp_path, name, content)
    (square,) = outline.polygons
    assert square.area == pytest.approx(1)
    assert outline.remark.endswith(f"; left out, for the drawing does not show them: {left_out}")


def test_blocks_on_layers_that_are_shown_are_shown_with_their_layer_0(tmp_path):
    def draw(drawing, space):
        drawing.layers.get("0").off()
        drawing.blocks.new("part").add_lwpolyline(SQUARE, close=True)
        space.add_blockref("part", (0, 0), dxfattribs={"layer": "parts"})

    (square,) = drawn(tmp_path, "a.dxf", dxf(draw)).polygons
    assert square.area == pytest.approx(1)


@pytest.mark.parametrize("kind", ["defs", "symbol"])
def test_what_an_svg_uses_is_no_left_out_curve(tmp_path, kind):
    content = f'<{kind}><path id="p" d="M0 0h20v20h-20z"/></{kind}><use href="#p"/><use href="#p" x="60"/>'
    outline = drawn(tmp_path, "a.svg", SVG.format(content.replace("<symbol>", '<symbol id="s">')))
    assert [body.area for body in outline.polygons] == pytest.approx(2 * [1 / 16])
    assert "no curves" not in outline.remark
    lost = drawn(tmp_path, "a.svg", SVG.format(HIDDEN.format('<use href="#gone"/>')))
    assert lost.remark.endswith("left out, for they are no curves: 1 use")


def feature(shape):
    return {"type": "Feature", "properties": {}, "geometry": shape and shape.__geo_interface__}


def test_geojson_that_may_be_in_degrees_says_so(tmp_path):
    def remark(shape, **members):
        collection = {"type": "FeatureCollection", "features": [feature(shape)], **members}
        return drawn(tmp_path, "a.geojson", json.dumps(collection)).remark

    def system(name):
        return {"type": "name", "properties": {"name": f"urn:ogc:def:crs:{name}"}}

    islet, map_in_metres = shapely.box(10.0, 60.0, 10.02, 60.01), shapely.box(5e5, 6e6, 5.01e5, 6.001e6)
    told = "its degrees are taken as lengths, and a map is to be projected first"
    assert told in remark(islet) and told in remark(islet, crs=system("OGC:1.3:CRS84"))
    assert told in remark(shapely.box(-180, -90, 180, 90))
    assert told not in remark(map_in_metres) and told not in remark(shapely.box(0, 0, 1, 91))
    assert told not in remark(islet, crs=system("EPSG::25832"))


def test_features_without_a_geometry_are_left_out(tmp_path):
    features = [feature(None), feature(shapely.box(0, 0, 200, 200))]
    collection = json.dumps({"type": "FeatureCollection", "features": features})
    outline = drawn(tmp_path, "a.geojson", collection)
    assert len(outline.polygons) == 1 and "left out, for they are no curves: 1 Feature without" in outline.remark
    with pytest.raises(ConfigError, match="holds no curves; .*1 Feature without geometry"):
        drawn(tmp_path, "a.geojson", json.dumps(feature(None)))


def test_entities_that_are_not_known_are_left_out(tmp_path):
    """They have no layer."""
    known = dxf(lambda drawing, space: space.add_circle((1, 1), 4))
    text = known.decode() if isinstance(known, bytes) else known
    assert "\nCIRCLE\n" in text
    text = text.replace("0\nCIRCLE\n", "0\nFOOBAR\n  5\nFFFF\n100\nAcDbFoobar\n  0\nCIRCLE\n", 1)
    (body,) = drawn(tmp_path, "a.dxf", text.encode() if isinstance(known, bytes) else text).polygons
    assert body.area == pytest.approx(np.pi / 4, rel=1e-3)
