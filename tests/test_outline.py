"""Outlines read from files: every form that they are found in, and refusals by file and line."""

import os
import time as clock
from pathlib import Path

import numpy as np
import pytest
import shapely
from alsph import repeat, resume
from alsph.cases import Body
from alsph.errors import ConfigError
from alsph.geometry.outline import Outline
from hypothesis import assume, given, settings
from hypothesis import strategies as st

SQUARE = "-0.5 -0.5\n0.5 -0.5\n0.5 0.5\n-0.5 0.5\n"
SIDE = 0.5 * (1 - np.cos(np.linspace(0, np.pi, 21)))
HALF = 0.6 * np.sqrt(SIDE) * (1 - SIDE) + 0.002 * SIDE
UPPER, LOWER = np.stack([SIDE, HALF], axis=1), np.stack([SIDE, -0.5 * HALF], axis=1)
FOIL = shapely.Polygon([*UPPER[::-1], *LOWER[1:]])


def rows(points, form="{:.6f} {:.6f}"):
    return "".join(form.format(*point) + "\n" for point in points)


def rings(*radii):
    angle = np.linspace(0, 2 * np.pi, 7)[:-1]
    return "999 999\n".join(rows(0.37 * radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)) for radius in radii)


def read(folder: Path, content: str | bytes) -> Outline:
    path = folder / "foil.txt"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return Outline.read(path)


@pytest.mark.parametrize(
    "content",
    [
        SQUARE,
        SQUARE.replace("\n", "\r\n"),
        SQUARE.replace("\n", "\r"),
        SQUARE.replace("\n", "\n\n"),
        SQUARE.rstrip("\n"),
        SQUARE.replace(" ", "\t"),
        SQUARE.replace(" ", ",\t"),
        SQUARE.replace(" ", ","),
        SQUARE.replace(" ", ";"),
        SQUARE.replace(".", ","),
        SQUARE.replace(" ", ";").replace(".", ","),
        SQUARE.replace(" ", ", ").replace(".", ","),
        SQUARE.replace("-", "\u2212"),
        SQUARE.replace("0.5", "5.0D-01"),
        SQUARE.replace("\n", ",\n"),
        "x,y\n" + SQUARE.replace(" ", ","),
        '"x";"y"\n' + SQUARE.replace(" ", ";"),
        "Square 0012\nsecond title\n\n" + SQUARE,
        SQUARE.replace("\n0.5 0.5", "\n# the right side\n0.5 0.5"),
        "".join(f'"{x}";"{y}"\n' for x, y in map(str.split, SQUARE.splitlines())),
        "# -1 -1\n% a comment\n! another\n// one more\n" + SQUARE.replace("5\n", "5 # a corner\n"),
        "4\n" + SQUARE,
        "4 1\n" + SQUARE,
        "Square\n4\n" + SQUARE,
        "Square\n-2.0 3.0 -2.5 3.5\n" + SQUARE,
        SQUARE + "-0.5 -0.5\n",
        SQUARE + "-0.5 -0.5\n-0.5 -0.5\n",
        SQUARE + "-0.5 -0.5\n999.0 999.0\n",
        "".join(f"{line}\n" for line in SQUARE.splitlines()[::-1]),
        SQUARE + "\nfound in a drawer\n3 of them\n0.5 0.5 -> 0.4 0.4\n",
        SQUARE + "\x1a",
        b"\xef\xbb\xbf" + SQUARE.encode(),
        ("G\u00f6ttingen\n" + SQUARE).encode("latin-1"),
        ("G\u00f6ttingen\n" + SQUARE).encode("utf-16"),
        b"\xfe\xff" + SQUARE.encode("utf-16-be"),
        SQUARE.encode("utf-32"),
    ],
)
def test_a_square_in_any_form_is_the_square(content, tmp_path):
    (square,) = read(tmp_path, content).polygons
    assert square.equals(shapely.box(-0.5, -0.5, 0.5, 0.5))


@pytest.mark.parametrize(
    "content",
    [
        "Selig\n" + rows([*UPPER[::-1], *LOWER[1:]]),
        "clockwise\n" + rows([*LOWER[::-1], *UPPER[1:]]),
        "closed blunt edge\n" + rows([*UPPER[::-1], *LOWER[1:], UPPER[-1]]),
        "doubled points\n" + rows([UPPER[-1], *UPPER[::-1], *LOWER, LOWER[-1]]),
        "divided at the nose\n" + rows(UPPER[::-1]) + "\n" + rows(LOWER),
        "Lednicer\n 21. 21.\n\n" + rows(UPPER) + "\n" + rows(LOWER),
        "Lednicer\n 21 21\n" + rows(UPPER) + rows(LOWER),
        "Lednicer without counts\n\n" + rows(UPPER) + "\n" + rows(LOWER),
        "Lednicer, lower side first\n\n" + rows(LOWER) + "\n\n" + rows(UPPER),
        "Upper side\n" + rows(UPPER) + "Lower side\n" + rows(LOWER),
    ],
)
def test_an_airfoil_in_any_order_is_the_airfoil(content, tmp_path):
    (foil,) = read(tmp_path, content).polygons
    assert foil.symmetric_difference(FOIL).area < 1e-6
    assert foil.area == pytest.approx(FOIL.area, rel=1e-5)


@pytest.mark.parametrize(
    "content",
    [
        rows([*UPPER, *LOWER[::-1], UPPER[0]]) + "\n{other}",
        rows([*UPPER, *LOWER[:0:-1]]) + "\n{other}",
        rows([*UPPER, *LOWER[::-1]]) + " 999.0 999.0\n{other}",
        "Main\n" + rows([*UPPER, *LOWER[:0:-1]]) + "999. 999.\nFlap\n{other}",
        "Main\n" + rows([*UPPER, *LOWER[:0:-1]]) + "Flap\n{other}",
        "Main\n 21. 21.\n\n" + rows(UPPER) + "\n" + rows(LOWER) + "999 999\n{other}",
    ],
)
@pytest.mark.parametrize("other", ["2 -0.5\n3 -0.5\n3 0.5\n2 0.5\n", "2 -0.5\n3 -0.5\n3 0.5\n2 0.5\n2 -0.5\n"])
def test_several_outlines_in_a_file_are_several_bodies(content, other, tmp_path):
    outline = read(tmp_path, content.format(other=other))
    foil, square = outline.polygons
    assert foil.symmetric_difference(FOIL).area < 1e-6
    assert square.equals(shapely.box(2, -0.5, 3, 0.5))
    assert "2 bodies of 4" in str(outline)


def test_bodies_have_forces_of_their_own_that_add_up(tmp_path):
    (tmp_path / "two.txt").write_text("0 0\n.5 0\n.5 .5\n0 .5\n\n1.5 0\n2 0\n2 .5\n1.5 .5\n")
    case = Body(shape=tmp_path / "two.txt", resolution=8, length=5, height=4, upstream=2.5, perturbation=0)
    assert case.outline.centroid.coords[0] == pytest.approx((0, 0))
    state = case.particles()
    assert [
        shapely.box(*case.outlines[k].bounds).contains(shapely.MultiPoint(at))
        for k, at in enumerate(
            state["position"][(state["kind"] == 3) & (state["body"] == k)] - case.centre for k in range(2)
        )
    ] == [True, True]
    run = case.run(tmp_path / "run", until=0.2, progress=False)
    assert run.bodies == ["body_1", "body_2"] and run.body == "body_1, body_2"
    loads = [run.coefficient("x", body=body) for body in run.bodies]
    assert all(np.abs(load).min() > 0.1 for load in loads) and not np.allclose(*loads)
    assert run.history["drag_coefficient"] == pytest.approx(loads[0] + loads[1], rel=1e-8)
    assert run.coefficient("x") == pytest.approx(loads[0] + loads[1], rel=1e-8)
    assert run.drag.mean == pytest.approx(sum(run.load("x", body=body).mean for body in run.bodies), rel=1e-6)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (SQUARE.replace("-0.5 -0.5", "-0.5 -O.5"), r'foil\.txt:1: "-0.5 -O.5": two numbers expected'),
        (SQUARE.replace("-0.5 0.5", "-O.5 0.5"), r'foil\.txt:4: "-O.5 0.5": two numbers expected'),
        (SQUARE.replace("0.5 0.5\n-", "0.5, o.5\n-"), r"foil\.txt:3: .*: two numbers expected"),
        (SQUARE.replace("0.5 -0.5\n", "0.5mm -0.5mm\n"), r"foil\.txt:1: .*: two numbers expected"),
        (SQUARE.replace("0.5 0.5\n-", "0.5.1 0.5\n-"), r"foil\.txt:3: .*: two numbers expected"),
        (SQUARE.replace("0.5 0.5\n-", "0.5 0.5X\n-"), r"foil\.txt:3: .*: two numbers expected"),
        (SQUARE.replace("0.5 0.5\n-", "0.5\n-"), r'foil\.txt:3: "0.5": two numbers expected'),
        (SQUARE.replace("-0.5 -0.5", "-0.5 -0.5 0"), r'foil\.txt:1: "-0.5 -0.5 0": two numbers expected'),
        (SQUARE.replace("\n", " 0.0\n"), r"foil\.txt:1: .*: two numbers expected"),
        (SQUARE.replace("0.5 0.5\n-", "0.5 0.5 a\n-"), r"foil\.txt:3: .*: two numbers expected"),
        (SQUARE.replace("0.5 0.5\n-", "here\n-"), r'foil\.txt:3: "here": text within a curve'),
        (SQUARE + "0.3 a\n", r'foil\.txt:5: "0.3 a": two numbers expected'),
        (SQUARE + "0.3\n", r'foil\.txt:5: "0.3": two numbers expected'),
        (SQUARE.replace("0.5 0.5\n-", "inf 0.5\n-"), r"foil\.txt:3: .*: finite numbers expected"),
        (SQUARE.replace("-0.5 -0.5", "nan -0.5"), r"foil\.txt:1: .*: finite numbers expected"),
        (SQUARE.replace("0.5 0.5\n-", "1e999 0.5\n-"), r"foil\.txt:3: .*: no lengths in D"),
        ("0,5 0,5\n1,5 0,5\n1,5\n1,5 1,5\n", r"foil\.txt:3: .*: commas divide numbers here, and are decimal points in"),
        ("Square\n-2.0 3.0 -2.5 3.5\n5\n" + SQUARE, r'foil\.txt:3: "5": 4 points follow'),
        ("5\n" + SQUARE, r'foil\.txt:1: "5": 4 points follow'),
        ("20 22\n" + rows(UPPER) + "\n" + rows(LOWER), r'foil\.txt:1: "20 22": 21 and 21 points follow'),
        ("5 1\n" + SQUARE, r'foil\.txt:1: "5 1": a count of points \(4 follow\) or a point\?'),
        ("4 1\n3 3\n1 3\n0 1\n2 0\n", r'foil\.txt:1: "4 1": a count of points \(4 follow\) or a point\?'),
        ("0 0\n1 0\n", r"foil\.txt:1: .*: begins a curve of too few points"),
        ("0 0\n1 0\n0 0\n", r"foil\.txt:1: .*: begins a curve of too few points"),
        ("0 0\n1 0\n2 0\n", r"foil\.txt:1: .*: begins a curve that encloses no area"),
        ("0 0\n1 1\n2 2\n1 1\n", r"foil\.txt:1: .*: begins a curve that encloses no area"),
        ("-1 -1\n1 1\n1 -1\n-1 1\n", r'foil\.txt:1: "-1 -1": .* after line 3, at \(0, 0\)'),
        (SQUARE + SQUARE, r"foil\.txt:\d: .*the curve meets itself"),
        ("0 0\n3 0\n1 0\n1 1\n", r"foil\.txt:\d: .*the curve meets itself"),
        (
            SQUARE.replace("5\n", "5\t\x9b31m\n").encode("latin-1"),
            r'foil\.txt:1: "-0.5 -0.5\?\?31m": two numbers expected',
        ),
        ("", r"foil\.txt: holds no points"),
        ("only\nwords\n", r"foil\.txt: holds no points"),
        ("solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n", r"foil\.txt: holds no points"),
        ("<svg><path d='" + 300 * "M0 0L1 0" + "'/></svg>", r"foil\.txt:1: a line of .* characters"),
        (b"\x89PNG\r\n\x1a\n\0\0", r"foil\.txt: not a text file"),
        (b"\xff\xfe" + SQUARE.encode(), r"foil\.txt: (not a text file|holds no points)"),
        (SQUARE + "\n0 0\n1 0\n1 1\n0 1\n0 0\n", r"foil\.txt: curves 1 and 2 overlap at"),
        (SQUARE + "\n0.5 -0.5\n1 -0.5\n1 0.5\n0.5 0.5\n0.5 -0.5\n", r"foil\.txt: curves 1 and 2 touch at \(0.5, "),
        (SQUARE + "999 999\n0 0\n.5 0\n0 .1\n", r"foil\.txt: curves 1 and 2 overlap at"),
        (
            "0 0\n.5 .1\n1 0\n0 0\n.5 -.1\n1 0\n",
            r"foil\.txt:.*its first point comes again in line 4: if a side begins there, put a blank line before it",
        ),
        (rings(*range(1, 13)), r"foil\.txt: curve 1 lies within more than 10 others"),
        ("0 0\n3 0\n3 3\n0 3\n0 0\n1 1\n1 2\n2 2\n2 1\n1 1\n", r"foil\.txt:1: .*meets itself .*a hole"),
    ],
)
def test_what_is_no_outline_is_refused_by_its_line(content, problem, tmp_path):
    with pytest.raises(ConfigError, match=problem) as refusal:
        read(tmp_path, content)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("scale", [1.0, 0.001, 30.0])
def test_sides_that_cross_in_their_last_digits_are_cut_there_and_it_is_told(scale, tmp_path):
    crossed = [(1, 0.0005), *UPPER[-2::-1], *LOWER[1:-1], (1, 0.0015)]
    outline = read(tmp_path, rows(scale * np.array(crossed), "{:.9f} {:.9f}"))
    (foil,) = outline.polygons
    assert foil.area == pytest.approx(scale**2 * shapely.Polygon([*UPPER[:-1], *LOWER[-2:0:-1]]).area, rel=0.01)
    assert "% of its length is cut off" in str(outline)
    with pytest.raises(ConfigError, match="the curve meets itself"):
        read(tmp_path, rows([*UPPER[-3::-1], *LOWER[1:-1], (0.6, 0.2)]))


def test_an_open_curve_is_closed_and_it_is_told(tmp_path):
    angle = np.linspace(0, np.pi, 31)
    half = np.stack([0.5 * np.cos(angle), 0.3 * np.sin(angle)], axis=1)
    outline = read(tmp_path, rows(half))
    told = "it is open, and was closed by an edge from (-0.5, 0) to (0.5, 0), 19 times as long as any other"
    assert outline.remark == told and outline.polygons[0].area == pytest.approx(0.15 * np.pi / 2, rel=0.01)
    assert f"outline: foil.txt: {told}" in Body(shape=outline, length=6, height=5, upstream=2).remarks()
    for closed in (SQUARE, rows(FOIL.exterior.coords), rows([*half, [0.0, 0.0]])):
        assert read(tmp_path, closed).remark == ""


def test_a_body_in_other_units_is_told_of_scale(tmp_path):
    with pytest.raises(ConfigError, match="100 D long and 40 D high, comes 46 D beyond the inlet.*by `scale` what"):
        Body(shape=read(tmp_path, "0 0\n100 0\n100 40\n0 40\n"))
    assert Body(shape=read(tmp_path, "0 0\n100 0\n100 40\n0 40\n"), scale=0.01).size == 1.0
    with pytest.raises(
        ConfigError, match="within 0.25 D of the inlet of the channel; leave at least 0.5 D by a larger upstream$"
    ):
        Body(shape=shapely.box(0, 0, 3, 1), scale=1.0, upstream=1.75)


def test_no_folder_device_pipe_or_giant_is_read(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with (tmp_path / "giant").open("wb") as file:
        file.truncate(2**33)
    start = clock.monotonic()
    for path in (tmp_path, tmp_path / "pipe", "/dev/zero", "/dev/null", "/dev/stdin"):
        with pytest.raises(ConfigError, match="not a file but a folder, a device or a pipe|neither"):
            Body(shape=str(path))
    with pytest.raises(ConfigError, match="has 8,192 MiB.* 1 MiB"):
        Body(shape=tmp_path / "giant")
    for path in ("", "no\0file", 300 * "a", "missing"):
        with pytest.raises(ConfigError, match="neither|a folder"):
            Body(shape=path)
    with pytest.raises(ConfigError, match="must be points"):
        Body(shape=5)
    (tmp_path / "long").write_text("0 0\n" + 2**19 * "1" + "!! 1\n")
    with pytest.raises(ConfigError, match="long:2: a line of"):
        Body(shape=tmp_path / "long")
    assert clock.monotonic() - start < 2


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (rows(np.random.default_rng(1).random((2000, 2))), "the curve meets itself"),
        ("".join(f"{k % 2} {k % 3}\n" for k in range(19_000)), "the curve meets itself"),
        ("".join(f"{k % 2} {k % 3}\n" for k in range(200_000)), "has 200,001 lines"),
        ("".join(f"0 0\n{k} 0\n{k} 5\n0 0\n\n" for k in range(1, 3000)), "overlap"),
        (rings(*range(3000, 0, -1)), "curve 12 lies within more than 10 others"),
        ("".join(f"{k} 0\n" for k in range(25_000)), "holds 25,000 points"),
    ],
    ids=["random", "zigzag", "long", "bodies", "nested", "many"],
)
def test_what_takes_long_to_sort_out_is_refused_soon(content, problem, tmp_path):
    start = clock.monotonic()
    with pytest.raises(ConfigError, match=problem):
        read(tmp_path, content)
    assert clock.monotonic() - start < 10


@pytest.mark.parametrize("more", [0, 1])
def test_a_curve_of_the_most_points_is_read_and_one_more_refused(more, tmp_path):
    angle = 2 * np.pi * np.arange(20_000 + more) / (20_000 + more)
    content = rows(np.stack([np.cos(angle), np.sin(angle)], axis=1), "{:.12f} {:.12f}")
    if more:
        with pytest.raises(ConfigError, match="20,001 points"):
            read(tmp_path, content)
    else:
        (disc,) = read(tmp_path, content).polygons
        assert len(disc.exterior.coords) == 20_001 and disc.area == pytest.approx(np.pi, rel=1e-6)


def test_a_point_that_might_be_a_count_and_comes_again_is_a_point(tmp_path):
    (box,) = read(tmp_path, "4 0\n4 1\n0 1\n0 0\n4 0\n").polygons
    assert box.equals(shapely.box(0, 0, 4, 1))


def test_a_count_of_all_points_does_not_join_two_bodies(tmp_path):
    other = SQUARE.replace("0.5 ", "1.5 ").replace("-1.5 ", "1.0 ")
    one, two = read(tmp_path, f"8 0\n{SQUARE}\n{other}").polygons
    assert one.equals(shapely.box(-0.5, -0.5, 0.5, 0.5)) and two.equals(shapely.box(1, -0.5, 1.5, 0.5))


STARS = st.lists(st.floats(0.2, 1.0), min_size=3, max_size=30)


def star(radii: list[float]) -> np.ndarray:
    """Return the corners of a curve around 0 that has no side through it."""
    angle = 2 * np.pi * (np.arange(len(radii)) + 0.3) / len(radii)
    return np.array(radii)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


@settings(max_examples=150, deadline=None)
@given(
    radii=STARS,
    separator=st.sampled_from([" ", "\t", "  ", ", ", ";", " ; "]),
    decimal=st.sampled_from([".", ","]),
    form=st.sampled_from(["{:.6f}", "{: .6f}", "{:.7e}", "{:+.6f}"]),
    ends=st.sampled_from(["\n", "\r\n", "\r"]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1"]),
    head=st.sampled_from(["", "a title\n", "Gö 797\n\nx y\n", "# x y\n", "\n\n"]),
    tail=st.sampled_from(["", "\n", "\na note of 2020\n1 2 3\n", "! end\n", "999.0 999.0\n"]),
    turn=st.sampled_from([1, -1]),
    closed=st.booleans(),
    counted=st.booleans(),
    doubled=st.booleans(),
)
def test_any_curve_in_any_form_is_read(
    radii, separator, decimal, form, ends, encoding, head, tail, turn, closed, counted, doubled, tmp_path_factory
):
    points = star(radii)[::turn]
    points = np.concatenate([points, points[: int(closed)]])
    points = points.repeat(2, axis=0) if doubled else points
    body = rows(points, f"{form}{separator}{form}").replace(".", decimal)
    count = f"{len(points)}\n" if counted else ""
    content = (head + count + body + tail).replace("\n", ends).encode(encoding)
    (curve,) = read(tmp_path_factory.mktemp("foil"), content).polygons
    assert curve.symmetric_difference(shapely.Polygon(star(radii))).area < 1e-5
    assert len(curve.exterior.coords) == len(radii) + 1


@settings(max_examples=200, deadline=None)
@given(
    radii=STARS,
    where=st.integers(0, 10**6),
    place=st.integers(0, 10**6),
    mistake=st.sampled_from(["O", "o", "l", "..", "x", "--", "'", "_", ":", " ", " 0.5 ", ",,"]),
    separator=st.sampled_from([" ", ",", ";"]),
    title=st.sampled_from(["", "a title\n"]),
)
def test_a_typing_error_anywhere_is_refused_by_its_line(
    radii, where, place, mistake, separator, title, tmp_path_factory
):
    lines = rows(star(radii), f"{{:.4f}}{separator}{{:.4f}}").splitlines()
    where %= len(lines)
    place %= len(lines[where])
    before, after = lines[where][:place], lines[where][place:]
    assume(before[-1:].isdigit() and after[0] in "0123456789.")
    lines[where] = before + mistake + after
    with pytest.raises(ConfigError, match=rf"foil\.txt:{where + 1 + bool(title)}: "):
        read(tmp_path_factory.mktemp("foil"), title + "\n".join(lines) + "\n")


def test_open_curves_that_may_be_one_body_or_two_are_refused(tmp_path):
    path = tmp_path / "two.txt"
    path.write_text("0 0\n1 0\n1 1\n0 1\n\n-.3 0\n-1.3 0\n-1.3 1\n-.3 1\n")
    with pytest.raises(ConfigError, match='two.txt:6: "-.3 0": .*repeat its first point'):
        Outline.read(path)
    path.write_text("0 0\n1 0\n1 1\n0 1\n0 0\n\n-.3 0\n-1.3 0\n-1.3 1\n-.3 1\n-.3 0\n")
    assert len(Outline.read(path).polygons) == 2


ELLIPSE = np.stack([0.5 * np.cos(np.arange(60) * np.pi / 30), 0.25 * np.sin(np.arange(60) * np.pi / 30)], axis=1)


def test_shapes_made_in_python_are_bodies_that_run_resume_and_repeat(tmp_path):
    case = Body(shape=ELLIPSE, resolution=8, length=5.0, height=4.0, upstream=2.0)
    assert case == case.replace(shape=shapely.Polygon(ELLIPSE)) == case.replace(shape=[ELLIPSE.tolist()])
    run = case.run(tmp_path / "run", until=0.05, threads=1, progress=False)
    assert run.config.case == case
    assert run.config.case.outline.area == pytest.approx(shapely.Polygon(ELLIPSE).area)
    assert resume(run.path, until=0.1, progress=False).status == "finished"
    assert repeat(run.path).same
    polygons = [shapely.Polygon(ELLIPSE), shapely.Polygon(ELLIPSE + [0, 1])]
    pair = Body(shape=shapely.MultiPolygon(polygons))
    assert pair == pair.replace(shape=polygons) == pair.replace(shape=[ELLIPSE, ELLIPSE + [0, 1]])
    assert Body(shape=[ELLIPSE, ELLIPSE[::2] + [0, 1]]).shape.polygons[1].area > 0
    assert [body.name for body in pair.bodies()] == ["body_1", "body_2"]


@pytest.mark.parametrize(
    ("shape", "problem"),
    [
        (3, "must be points (n, 2) of a closed curve"),
        ([], "must be points (n, 2) of a closed curve"),
        (np.zeros((3, 3)), "must be points (n, 2) of a closed curve"),
        ([["a", "b"], ["c", "d"]], "must be points (n, 2) of a closed curve"),
        ({"x": [1.0], "y": [2.0]}, "unknown parameter"),
        ([[10**400, 0], [1, 0], [0, 1]], "must be points (n, 2) of a closed curve"),
        (ELLIPSE * 1j, "coordinates must be two real numbers"),
        (ELLIPSE[:2], 'points:1: "0.5 0.0": begins a curve of too few points'),
        (ELLIPSE * [1, np.nan], "coordinates must be finite"),
        (np.zeros((20_001, 2)), "has more than 20000 points"),
        ([ELLIPSE, ELLIPSE], "curves 1 and 2 overlap"),
        ([[0, 0], [1, 1], [1, 0], [0, 1]], "the curve meets itself"),
        (shapely.Point(0, 0), "must be of polygons, not Point"),
        (shapely.Polygon(ELLIPSE, [ELLIPSE + [0.2, 0]]), "curves 1 and 2"),
    ],
)
def test_what_is_no_shape_is_refused(shape, problem):
    with pytest.raises(ConfigError) as error:
        Body(shape=shape)
    assert problem in str(error.value)
