import sys
from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from alsph import Run, plotting
from alsph.analysis.loads import PressureCoefficient
from alsph.cases import CASES, Body, Cavity, Cylinder, CylinderPair
from alsph.config import Config
from alsph.errors import ConfigError
from alsph.folder.run_folder import RunFolder
from alsph.geometry.domain import Domain
from alsph.geometry.particles import Kind, Snapshot
from alsph.geometry.plane import Plane
from alsph.plotting.curves import Curve
from alsph.plotting.pictures import _limit
from alsph.plotting.style import line
from alsph.study.results import names
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image
from synthetic import append_surface, history, write_flow, write_run


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return Run(write_run(tmp_path_factory.mktemp("runs") / "shedding", end=40.0))


@pytest.mark.parametrize("name", plotting.FIELDS)
def test_pictures_of_fields(run, name, tmp_path):
    figure = run.plot_field(name, time=20, path=tmp_path / "picture.png")
    axes, bar = figure.axes
    assert (tmp_path / "picture.png").read_bytes().startswith(b"\x89PNG")
    assert axes.get_title() == r"cylinder, Re = 200, $D/\Delta x$ = 10, $tU/D$ = 20.00"
    assert (axes.get_xlim(), axes.get_ylim()) == (pytest.approx((0, 8)), pytest.approx((-4, 4)))
    low, high = axes.images[0].get_clim()
    assert low == (0 if name == "velocity" else -high)
    assert bar.get_ylabel() == plotting.FIELDS[name].label + (", less the inlet's" if name == "pressure" else "")


def test_a_picture_shows_the_field_and_the_body_where_they_are(run):
    snapshot = run.snapshot()
    axes = run.plot_field("pressure", limit=0.7, view=(3.0, 5.0, -1.0, 1.0)).axes[0]
    assert axes.images[0].get_clim() == (-0.7, 0.7)
    picture = axes.images[0].get_array()
    nearest = np.hypot(*(snapshot.position - [3.025, 0.025]).T).argmin()
    rows, columns = picture.shape
    inlet = snapshot.pressure[snapshot.kind == Kind.INLET].mean()
    assert picture[rows // 2, 0] == pytest.approx(snapshot.pressure[nearest] - inlet, abs=0.02)
    assert picture.mask[rows // 2, columns // 2] or np.isnan(picture.data[rows // 2, columns // 2])
    outline = np.concatenate([path.vertices for path in axes.collections[0].get_paths()])
    radius = np.hypot(*(outline[np.abs(outline).sum(axis=1) > 0] - [4.0, 0.0]).T)
    assert radius == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_fluid_in_air_ends_where_it_does(dimensions):
    sides = [np.arange(0.05, 1, 0.1)] * dimensions
    water = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, dimensions)
    position = np.concatenate([water, [[0.45] * (dimensions - 1) + [1.45]]])
    n = len(position)
    walls = [("slip", "slip")] * (dimensions - 1) + [("slip", "air")]
    domain = Domain([0] * dimensions, [1] * (dimensions - 1) + [3], walls)
    vorticity = np.zeros((n, 3) if dimensions == 3 else n)
    nothing = np.zeros((n, dimensions)), np.ones(n), np.zeros(n), vorticity, np.zeros(n, np.uint8)
    snapshot = replace(Snapshot(0.0, position, *nothing), domain=domain)
    plane = Plane(1, 0.5) if dimensions == 3 else None
    axes = plotting.field(snapshot, "pressure", 0.1, plane=plane).axes[0]
    assert axes.get_xlim() == pytest.approx((0, 1)) and axes.get_ylim() == pytest.approx((0, 1.6))
    drawn = np.isfinite(np.ma.filled(axes.images[0].get_array(), np.nan))
    height = (np.arange(len(drawn)) + 0.5) * 1.6 / len(drawn)
    assert (
        drawn[height < 0.98].all()
        and not drawn[(height > 1.1) & (height < 1.3)].any()
        and not drawn[height > 1.55].any()
    )
    assert 0.005 < drawn[height > 1.3].mean() * 0.3 < 0.04  # a drop of 0.01


def test_a_picture_of_fluid_without_a_body_and_without_variation():
    position = np.stack(np.meshgrid(np.arange(0.05, 1, 0.1), np.arange(0.05, 1, 0.1)), axis=-1).reshape(-1, 2)
    n = len(position)
    still = Snapshot(0.0, position, np.zeros((n, 2)), *np.zeros((3, n)), np.zeros(n, np.uint8))
    assert plotting.field(still, "vorticity", 0.1).axes[0].images[0].get_clim() == (-1, 1)


def test_a_field_in_few_pixels_has_a_scale_of_its_own():
    picture = np.full((100, 100), 1e-3)
    picture[:5, :5] = 4.0
    assert _limit(picture) == pytest.approx(4.0, abs=0.51)
    picture[:] = np.linspace(0, 1, 10_000).reshape(100, 100)
    assert _limit(picture) == 1.0


def test_fields_that_cannot_be_drawn(run):
    with pytest.raises(ConfigError, match="unknown field 'vortcity'; did you mean 'vorticity'"):
        run.plot_field("vortcity")
    with pytest.raises(ConfigError, match="time = nan: must be a finite number"):
        run.plot_field("pressure", time=np.nan)
    solid = Snapshot(0.0, np.zeros((1, 3)), np.zeros((1, 3)), *np.zeros((3, 1)), np.zeros(1, np.uint8))
    with pytest.raises(ConfigError, match="2-D only"):
        plotting.field(solid, "vorticity", 0.1)


def test_forces_show_the_window_and_ignore_the_impulsive_start(run):
    upper, lower = run.plot_forces().axes
    assert upper.get_ylim()[1] < 2.5
    assert "1.4" in upper.get_title(loc="left") and "Sr = 0.21" in lower.get_title(loc="left")
    window = [patch for patch in upper.patches if "periods" in patch.get_label()]
    assert window[0].get_x() == pytest.approx(run.window.start)


def test_references_are_drawn_where_they_are_known(run, tmp_path):
    assert not [line for axes in run.plot_forces().axes for line in axes.lines if line.get_linestyle() == ":"]
    run = Run(write_run(tmp_path / "run", Cylinder(resolution=8), end=20.0))
    known = {measure.name: measure.reference for measure in run.measures}
    levels = [
        [line.get_ydata()[0] for line in axes.lines if line.get_linestyle() == ":"] for axes in run.plot_forces().axes
    ]
    amplitude = known["lift coefficient amplitude"]
    assert levels == [[known["mean drag coefficient"]], [amplitude, -amplitude]]
    (line,) = [line for line in run.plot_spectrum().axes[1].lines if line.get_linestyle() == ":"]
    assert line.get_xdata()[0] == known["Strouhal number"]
    assert not [line for axes in run.plot_forces(body="cylinder").axes for line in axes.lines if line.get_ls() == ":"]


def test_spectra_of_the_forces_in_the_window(run, tmp_path):
    drag, lift = run.plot_spectrum(tmp_path / "spectrum.png").axes
    (line,) = lift.lines
    strongest = line.get_ydata().argmax()
    assert line.get_xdata()[strongest] == pytest.approx(run.strouhal, abs=1 / (run.window.end - run.window.start))
    assert line.get_ydata()[strongest] == pytest.approx(run.lift.amplitude, rel=0.2)
    assert drag.get_ylabel() == "amplitude of $C_D$"
    assert len(plotting.spectrum({"one": run, "other": run}).axes[1].lines) == 2


def test_pressure_coefficient_with_a_reference(run):
    reference = np.linspace(0, 180, 10), np.cos(np.linspace(0, np.pi, 10))
    axes = run.plot_pressure_coefficient(reference=reference).axes[0]
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["upper side", "lower side", "reference"]
    upper, lower, _ = axes.lines
    assert (upper.get_xdata()[[0, -1]] == lower.get_xdata()[[0, -1]]).all()


def test_figures_of_a_run_that_has_just_begun(run, tmp_path):
    for name in ("case.toml", "run.json"):
        (tmp_path / name).write_bytes((run.path / name).read_bytes())
    begun = Run(tmp_path)
    for figure in (begun.plot_forces(), begun.plot_spectrum(), begun.plot_ledger(), begun.plot_pressure_coefficient()):
        assert isinstance(figure, Figure)
        figure.savefig(tmp_path / "figure.png")
    empty = PressureCoefficient(np.array([0.0, 90.0]), np.full(2, np.nan), np.full(2, np.nan), 0)
    plotting.pressure_coefficient(empty).savefig(tmp_path / "figure.png")


def test_ledger_and_no_global_state(run, tmp_path):
    assert len(run.plot_ledger(tmp_path / "ledger.png").axes) == 8
    assert "matplotlib.pyplot" not in sys.modules


def test_figures_name_case_reynolds_number_and_resolution(run):
    told = r"cylinder, Re = 200, $D/\Delta x$ = 10"
    figures = (
        run.plot_ledger(),
        run.plot_pressure_coefficient(),
        run.plot_spectrum(),
        *map(run.plot_profile, run.profiles),
    )
    assert [figure.get_suptitle() for figure in figures] == [told] * 4
    assert run.plot_forces(body="cylinder").get_suptitle() == f"{told}, cylinder"


def test_the_pressure_of_a_closed_box_is_drawn_less_its_mean(tmp_path):
    """Whatever constant it has, which means nothing."""
    still, pictures = lambda position, time: np.zeros_like(position), []
    for offset in (0.0, 1e3):
        flow = write_flow(tmp_path / f"{offset}", Cavity(resolution=10), still, pressure=offset)
        snapshot = flow.snapshot()
        pressure = snapshot.pressure + np.sin(6 * snapshot.position[:, 0])
        figure = plotting.field(replace(snapshot, pressure=pressure), "pressure", flow.spacing)
        pictures.append(figure.axes[0].images[0])
        assert "less its mean" in figure.axes[1].get_ylabel()
    assert pictures[0].get_clim() == pictures[1].get_clim() == (-1, 1)
    one, other = (np.ma.filled(picture.get_array(), 0) for picture in pictures)
    assert np.allclose(one, other, atol=1e-3)


def test_the_pressure_of_an_open_channel_is_drawn_as_it_is(run):
    figure = run.plot_field("pressure")
    assert "mean" not in figure.axes[1].get_ylabel()


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """Two cylinders, with the pressure coefficient 1 on the lower one and 2 on the upper one."""
    case = CylinderPair(resolution=8, length=8, height=10, upstream=3)
    path = write_flow(tmp_path_factory.mktemp("runs") / "pair", case, lambda position, time: 0 * position).path
    surface = case.surface_points()
    for time in (0.0, 1.0, 2.0):
        append_surface(RunFolder(path), time, surface.arrays(), 1.0 + surface.part)
    rows = history(end=2.0)
    rows |= {name: rows[name].repeat(2, axis=1) for name in rows if name.endswith(("_force", "_torque"))}
    RunFolder(path).append_history(rows, case.coefficient_bodies)
    return Run(path)


def test_one_body_of_several(pair, alsph, tmp_path):
    first, second = pair.profiles
    assert (first.name, second.name) == ("pressure coefficient of body_1", "pressure coefficient of body_2")
    assert (first.computed[1] == 1).all() and (second.computed[1] == 2).all()
    assert second.computed[0][[0, -1]] == pytest.approx([0, 0], abs=0.01) and second.computed[0].max() > 0.99
    axes = pair.plot_pressure_coefficient(body="body_2").axes[0]
    assert {2.0} == {value for line in axes.lines for value in line.get_ydata()}
    assert "body_1, upper side" in [each.get_label() for each in pair.plot_pressure_coefficient().axes[0].lines]
    with pytest.raises(ConfigError, match="did you mean 'body_1'"):
        pair.plot_pressure_coefficient(body="body1")
    code, out, _ = alsph("plot", pair.path, "--body", "body_2", "--format", "svg", "--output", tmp_path / "out")
    made = {path.name for path in (tmp_path / "out").iterdir()}
    assert code == 0 and made >= {
        f"{kind}_of_body_2.svg" for kind in ("forces", "spectrum", "pressure_coefficient")
    } | {"forces.svg", "pressure_coefficient_of_body_1.svg"}


def test_formats_and_resolution_of_figures(pair, alsph, tmp_path):
    sizes = []
    for dpi in (50, 100):
        assert alsph("plot", pair.path, "--dpi", dpi, "--output", tmp_path / f"{dpi}")[0] == 0
        sizes.append(Image.open(tmp_path / f"{dpi}" / "ledger.png").size)
    assert 2 * sizes[0][0] == sizes[1][0]
    for options, words in (
        (("--format", "bmp"), "format = 'bmp': unknown"),
        (("--body", "body"), "body = 'body': unknown"),
    ):
        code, _, err = alsph("plot", pair.path, *options)
        assert code == 2 and words in err and len(err.splitlines()) == 1
    assert alsph("plot", pair.path, "--dpi", 0)[0] == 2


def test_a_study_may_draw_the_pressure_coefficient_of_bodies():
    assert "pressure coefficient" in names(Config(Body(resolution=10)))[1]
    assert "pressure coefficient" in names(Config(Cylinder(reynolds=150)))[1]
    assert "pressure coefficient of body_2" in names(Config(CylinderPair(resolution=10)))[1]


def test_pictures_of_several_runs_tell_the_time_of_each(run):
    pictures = {"one": (run.snapshot(10), run.spacing), "other": (run.snapshot(30), run.spacing)}
    titles = [axes.get_title() for axes in plotting.fields(pictures, ["vorticity"]).axes if axes.get_title()]
    assert titles == ["one, $tU/D$ = 10.00", "other, $tU/D$ = 30.00"]


DEUTERAN = np.array([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]])
PROTAN = np.array([[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]])
"""What of linear RGB those see who lack green or red cones (Machado, Oliveira and Fernandes 2009)."""


def as_seen(colours, eyes):
    """Return colours (n, 3) in CIELAB as eyes see them."""
    rgb = np.array([to_rgb(colour) for colour in colours])
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    seen = np.clip(linear @ eyes.T, 0, 1)
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    x, y, z = np.cbrt(np.maximum(seen @ to_xyz.T / to_xyz.sum(axis=1), 0.008856)).T
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=1)


def nearest_colours(colours):
    """Return the least distance of two colours to any of three kinds of eyes."""
    seen = (as_seen(colours, eyes) for eyes in (np.eye(3), DEUTERAN, PROTAN))
    return min(np.linalg.norm(lab[:, None] - lab, axis=2)[np.triu_indices(len(lab), 1)].min() for lab in seen)


def test_the_colour_blind_tell_curves_apart():
    assert nearest_colours(plotting.PALETTE) > 10 > 5 > nearest_colours([f"C{k}" for k in range(6)])


def test_curves_of_a_figure_differ_in_more_than_colour(run):
    several = {name: run for name in ("one", "two", "three", "four", "five", "six", "seven")}
    for axes in (*plotting.coefficients(several).axes, plotting.spectrum(several).axes[1], *run.plot_forces().axes):
        drawn = [each for each in axes.lines if each.get_linestyle() == "-"]
        assert len({each.get_marker() for each in drawn}) == len(drawn) > 2
        assert all(0 < len(each.get_markevery()) <= 8 for each in drawn)
    (alone,) = plotting.spectrum({"one": run}).axes[1].lines
    assert alone.get_marker() == "None"


@pytest.mark.parametrize("points", [0, 1, 2, 3, 1_000_000])
def test_markers_of_any_number_of_points_lie_on_them(points):
    for logarithmic in (False, True):
        every = line(3, 5, points, logarithmic=logarithmic)["markevery"]
        assert all(0 <= index < points for index in every) and (points == 0 or len(every))


@pytest.mark.parametrize("name", plotting.FIELDS)
def test_colours_of_fields_rise_evenly_and_those_of_signed_ones_from_the_middle(name):
    """In lightness, as all eyes see it: jet does not."""
    style = plotting.FIELDS[name]
    lightness = as_seen(matplotlib.colormaps[style.colours](np.linspace(0, 1, 101))[:, :3], np.eye(3))[:, 0]
    if style.signed:
        assert lightness.argmax() == 50 and lightness[50] > 95
        lightness = np.concatenate([lightness[:51], 200 - lightness[51:]])
    assert np.diff(lightness).min() > -0.2


@pytest.mark.parametrize("name", CASES)
def test_bodies_that_a_case_tells_of_are_where_its_particles_are(name):
    case = CASES[name](resolution=10)
    state = case.particles()
    height, solid = case.solid_height(state["position"]), state["kind"] == Kind.SOLID
    if height is None:
        pytest.skip("the particles themselves are drawn")
    assert height[~solid].min() > -1e-9 and height[solid].max() < 1e-9
    assert height[solid].max() > -0.8 * case.particle_spacing  # the first layer is right under the surface


def drawn(figure):
    """Return the vertices (n, 2) of what a picture shows as solid."""
    return np.concatenate(
        [np.empty((0, 2)), *(path.vertices for each in figure.axes[0].collections for path in each.get_paths())]
    )


def test_a_picture_has_the_corners_of_a_body_and_none_in_those_of_a_box(tmp_path):
    def still(position, time):
        return np.zeros_like(position)

    square = Body(shape="square_cylinder", resolution=10, length=6, height=5, upstream=2)
    flow = write_flow(tmp_path / "square", square, still)
    shown = drawn(flow.plot_field("velocity"))
    corners = np.array([[1.5, -0.5], [2.5, -0.5], [1.5, 0.5], [2.5, 0.5]])
    assert np.hypot(*(shown[:, None] - corners).T).min(axis=1) == pytest.approx(0, abs=0.03)
    assert len(drawn(write_flow(tmp_path / "box", Cavity(resolution=10), still).plot_field("velocity"))) == 0


def test_a_body_that_has_moved_is_drawn_where_its_particles_are(tmp_path):
    cylinder = Cylinder(resolution=10, length=8, height=8)
    snapshot = write_flow(tmp_path / "run", cylinder, lambda position, time: 0 * position).snapshot()
    solid = ~snapshot.fluid
    gone = ~solid & (np.hypot(*(snapshot.position - [4.5, 0.0]).T) < 0.5)
    moved = {name: getattr(snapshot, name)[~gone] for name in ("velocity", "pressure", "velocity_divergence")}
    moved |= {"vorticity": snapshot.vorticity[~gone], "kind": snapshot.kind[~gone]}
    position = (snapshot.position + np.where(solid, 0.5, 0.0)[:, None] * [1, 0])[~gone]
    shown = drawn(plotting.field(replace(snapshot, position=position, **moved), "velocity", 0.1))
    radius = np.hypot(*(shown - [4.5, 0.0]).T)
    assert np.median(radius) == pytest.approx(0.5, abs=0.05)


def test_a_picture_goes_on_across_periodic_sides():
    position = np.stack(np.meshgrid(np.arange(0.05, 1, 0.1), np.arange(0.05, 1, 0.1)), axis=-1).reshape(-1, 2)
    wave, n = np.sin(2 * np.pi * position[:, 0]), len(position)
    box = Domain((0, 0), (1, 1), [("periodic", "periodic")] * 2)
    flow = Snapshot(0.0, position, np.zeros((n, 2)), wave, *np.zeros((2, n)), np.zeros(n, np.uint8))
    view, x = (0.0, 1.0, 0.0, 1.0), (np.arange(20) + 0.5) / 20

    def row(domain):
        image = plotting.field(replace(flow, domain=domain), "pressure", 0.1, view=view).axes[0].images[0]
        return np.ma.filled(image.get_array(), np.nan)[10]

    inside = row(box)
    assert inside == pytest.approx(inside[5] * np.sin(2 * np.pi * x) / np.sin(2 * np.pi * x[5]), abs=0.03)
    assert abs(row(None) - inside)[0] > 0.03


MOVING = [
    *("floating_box", "rolling_tank", "heaving_cylinder", "oscillating_cylinder", "towed_cylinder", "settling_sphere")
]


@pytest.mark.parametrize("name", MOVING)
def test_a_body_that_moves_is_drawn_by_its_outline_where_it_has_come_to(tmp_path, name):
    model = CASES[name]
    case = model(resolution=10 if model.in_space == 2 else 8)
    run = case.run(tmp_path / "run", until=0.3, output_interval=0.3, progress=False)
    snapshot, spacing = run.snapshot(), case.particle_spacing
    height = snapshot.solid(snapshot.position)
    solid, start = ~snapshot.fluid, run.snapshot(0.0)
    begun = start.position[~start.fluid]
    assert np.abs(snapshot.position[solid].mean(axis=0) - begun.mean(axis=0)).max() > 1e-6
    first = start.solid(begun)
    np.testing.assert_allclose(np.sort(height[solid]), np.sort(first), atol=2e-3 * spacing)
    assert height[~solid].min() > -0.25 * spacing


def test_outlines_turn_with_the_body(tmp_path):
    case = CASES["rolling_tank"](resolution=10)
    run = case.run(tmp_path / "run", until=1.0, output_interval=1.0, progress=False)
    angle = case.motion(np.zeros((1, 2)), run.snapshot().time)[2]
    assert abs(angle) > 0.02
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    inner = np.array([[0.0, -1e-3], [0.0, 1e-3]]) @ turn.T  # on both sides of the floor
    assert np.sign(run.snapshot().solid(inner)).tolist() == [-1, 1]


def test_a_long_legend_takes_nothing_from_panels_and_title():
    widths = []
    for label in ("a", "a label that is longer than most of those that there are, by far"):
        figure = plotting.panels({"y": [Curve(label, [0, 1], [0, 1])]}, "x")
        plotting.head(figure, "cylinder, Re = 200, resolution = 20")
        figure.draw_without_rendering()
        (legend,) = figure.legends
        widths.append(figure.axes[0].get_window_extent().width / figure.dpi)
        assert figure.get_suptitle() and figure._suptitle.get_window_extent().x1 < legend.get_window_extent().x0
        assert legend.get_window_extent().x1 < figure.bbox.x1
    assert widths[1] == pytest.approx(widths[0], rel=0.2)


def test_a_curve_has_one_colour_in_all_panels():
    first = [Curve("alsph", [0.3, 0.6], [1, 2]), Curve("isph", [0.4], [2])]
    figure = plotting.panels({"a": first, "b": first[1:]}, "cost", ("x", "y"))
    looks = [{line.get_label(): (line.get_color(), line.get_marker()) for line in axes.lines} for axes in figure.axes]
    assert looks[0]["isph"] == looks[1]["isph"] != looks[0]["alsph"]
    figure.canvas.draw()
    assert "0.4" in [label.get_text() for label in figure.axes[0].xaxis.get_ticklabels(minor=True)]
