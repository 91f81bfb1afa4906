import numpy as np
import pytest
import shapely
from alsph import cases, plotting
from alsph.cases import CASES, Body, remarks
from alsph.config import Config
from alsph.geometry.particles import Kind
from alsph.plotting.setup import CLOSED_BY, KINDS
from alsph.run_settings import RunSettings
from matplotlib.collections import EllipseCollection
from matplotlib.colors import to_rgba
from shapely import Point, affinity

TAPERED = shapely.Polygon([(0.6, 0.0), (-0.4, 0.15), (-0.4, -0.15)])
PLATE = shapely.union_all([Point(0, 0).buffer(0.4), shapely.box(0, -0.06, 1.2, 0.06)])


def circles(axes):
    """Return the numbers of circles that are drawn of each kind of particles."""
    drawn = [each for each in axes.collections if isinstance(each, EllipseCollection)]
    assert [tuple(each.get_facecolor()[0]) for each in drawn] == [to_rgba(colour) for colour in KINDS.values()]
    return [len(each.get_offsets()) for each in drawn]


@pytest.mark.parametrize("name", CASES)
def test_the_start_of_every_case_is_drawn_with_all_its_particles_and_sides(name):
    case = CASES[name](resolution=8 if CASES[name].in_space == 3 else 10)
    figure, state = case.draw(), case.particles()
    whole = figure.axes[0]
    found = dict(zip(KINDS, circles(whole), strict=True))
    count = {kind: int((state["kind"] == kind).sum()) for kind in Kind}
    flat = case.space_dimensions == 2
    assert all(found[kind] == count[kind] if flat else found[kind] <= count[kind] for kind in Kind)
    assert found[Kind.FLUID] > 0
    sides = {CLOSED_BY[side] for pair in case.domain().boundaries[:2] for side in pair}
    assert sides <= {text.get_text() for text in whole.texts} or not flat
    assert len(figure.axes) == 1 + bool(case.coefficient_bodies)


@pytest.mark.parametrize(
    ("shape", "tip", "end"),
    [
        (TAPERED, (0.6, 0.0), None),
        (affinity.rotate(TAPERED, 90, origin=(0, 0)), (0.0, 0.6), None),
        (PLATE, (1.2, 0.06), (1.2, 0.06)),
    ],
)
def test_the_thinnest_part_is_drawn_where_it_is(shape, tip, end):
    spacing = 1 / 20
    found = remarks.thinnest_tip(shape, remarks.thinnest(shape), spacing)
    assert np.abs(found) == pytest.approx(tip, abs=spacing)
    case = Body(shape=shape, resolution=20, length=7, height=5, upstream=2)
    figure = case.draw()
    name = figure.axes[2].get_title()
    assert name == ("thinnest part: an edge" if shape is not PLATE else "thinnest part: 2.4 Δx")
    left, right = figure.axes[2].get_xlim()
    bottom, top = figure.axes[2].get_ylim()
    there = np.array([left + right, bottom + top]) / 2 - case.centre
    assert Point(there).distance(case.carried[0].boundary) < 1e-9
    there += np.array(shape.centroid.coords[0])
    if end:
        assert np.abs(there) == pytest.approx(end, abs=0.5 * spacing)
    else:
        assert 0.1 < np.hypot(*(there - found)) < 0.5  # before the tip that is cut off


def test_a_body_without_thin_parts_has_no_picture_of_them():
    assert [axes.get_title() for axes in Body(resolution=10).draw().axes][1:] == ["bodies"]


def test_recorded_points_are_drawn():
    case = cases.Cylinder(resolution=10)
    figure = plotting.start(case, points=Config(case, RunSettings(probes="6,0.5; 8,0")).probes)
    points = [line.get_xydata().tolist() for line in figure.axes[0].lines if line.get_marker() == "+"]
    assert points == [[[6, 0.5], [8, 0]]]


def test_the_surface_is_that_of_the_body():
    figure = cases.Cylinder(resolution=20).draw()
    surface = max((line.get_xydata() for line in figure.axes[1].lines), key=len)
    assert np.hypot(*(surface - [4, 0]).T) == pytest.approx(0.5, abs=1e-3)


def test_the_labels_have_the_names_of_the_case():
    assert cases.DamBreak(resolution=10).draw().axes[0].get_xlabel() == "$x/H$"


def test_the_command_line_draws(alsph, tmp_path):
    target = tmp_path / "new" / "start.svg"
    code, stdout, stderr = alsph("describe", "cylinder", "--resolution", 10, "--no-probe", "--draw", target)
    assert (code, stdout.splitlines()[0]) == (0, str(target)), stderr
    assert target.read_text().startswith("<?xml")
    code, stdout, _ = alsph("describe", "cylinder", "--resolution", 10, "--no-probe", "--draw", tmp_path / "start")
    assert (code, stdout.splitlines()[0]) == (0, str(tmp_path / "start.png"))


@pytest.mark.parametrize("target", ["", ".", "/", "start.docx"])
def test_a_picture_goes_to_a_file(alsph, target):
    code, _, stderr = alsph("describe", "cylinder", "--resolution", 10, "--no-probe", "--draw", target)
    assert code == 2 and "--draw = " in stderr and "must be a file that ends in png, pdf, svg" in stderr


def test_a_body_that_is_refused_is_drawn_all_the_same(alsph, tmp_path):
    target = tmp_path / "thin.png"
    words = ["--shape", "naca0012", "--resolution", 10, "--no-probe", "--draw", target]
    code, stdout, stderr = alsph("describe", "body", *words)
    assert code == 2 and stdout.strip() == str(target) and "too thin" in stderr and target.stat().st_size > 5_000
    case = Body(shape="naca0012", resolution=10)
    figure = case.draw()
    assert not sum(circles(figure.axes[0])) and len(figure.axes[1].lines) >= 1


def test_points_off_the_plane_are_not_drawn_on_it():
    case = cases.Sphere(resolution=8, length=5.0, height=4.0, width=4.0, upstream=2.0)
    figure = plotting.start(case, points=np.array([[3.0, 0.5, 0.0], [3.0, 1.0, 1.5]]))
    (marked,) = [line.get_xydata().tolist() for line in figure.axes[0].lines if line.get_marker() == "+"]
    assert marked == [[3.0, 0.5]]
