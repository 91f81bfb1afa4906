import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from alsph import Run
from alsph.cases import (
    CASES,
    BackwardFacingStep,
    Bodies,
    Body,
    Body3D,
    Cavity,
    Cylinder,
    Poiseuille,
    Sphere,
    StillWater,
    TaylorGreen,
    remarks,
)
from alsph.geometry.thin import carried
from alsph.results.outcome import outcome
from shapely import Point, affinity
from synthetic import write_run


def about(case):
    return remarks.keywords(case.remarks())


@pytest.mark.parametrize("name", [name for name in CASES if name not in ("body", "cylinder_pair", "sphere", "body_3d")])
def test_cases_as_they_come_need_no_remark(name):
    assert CASES[name]().remarks() == []


@pytest.mark.parametrize(
    "case",
    [
        *(Cylinder(reynolds=re, resolution=n) for re in (100, 200) for n in (20, 30)),
        *(Cavity(reynolds=re, resolution=n) for re, n in ((100, 25), (400, 50), (1000, 50), (1000, 150))),
        BackwardFacingStep(reynolds=389, resolution=10),
        Poiseuille(resolution=10),
        TaylorGreen(resolution=100),
        TaylorGreen(dimensions=3, resolution=16),
        Cylinder(height=60.0, upstream=30.0, length=90.0),
        Poiseuille(kernel="wendland_c2", smoothing_ratio=1.75),
    ],
)
def test_what_has_been_compared_with_references_needs_no_remark(case):
    assert case.remarks() == []


@pytest.mark.parametrize(
    ("case", "keywords"),
    [
        (Cylinder(reynolds=200, resolution=10), "coarse"),
        (Cylinder(reynolds=100, resolution=10), "coarse"),
        (Cylinder(reynolds=1e5, resolution=8), "not resolved, not validated"),
        (Cylinder(reynolds=1e7, resolution=8), "not resolved, not validated"),
        (Cylinder(reynolds=1e5, resolution=400), "not validated"),
        (Cylinder(reynolds=40), "not validated"),
        (Cavity(reynolds=1e4, resolution=50), "coarse, not validated"),
        (BackwardFacingStep(reynolds=800), "not validated"),
        (TaylorGreen(dimensions=3, reynolds=1600), "not validated"),
        (Poiseuille(kernel="wendland_c2", smoothing_ratio=1.0), "kernel"),
        (Poiseuille(kernel="wendland_c4"), "kernel"),
        (TaylorGreen(smoothing_ratio=1.1), "kernel"),
        (TaylorGreen(reynolds=1e4, courant=0.3), ""),
        (TaylorGreen(reynolds=1e4, courant=0.35), "compressible"),
        (TaylorGreen(reynolds=1e4, penalty_constant=4.0), "compressible"),
        (Cylinder(length=3.0, height=13.0, upstream=1.5), "short channel"),
        (Cylinder(height=5.0), "narrow channel"),
        (Body(), "not validated"),
        (Sphere(), "coarse"),
        (Sphere(reynolds=300, resolution=30), "not validated"),
        (Body3D(reynolds=100, resolution=20), "not validated"),
        (Body(shape="naca0012"), "thin parts, thin body, not validated"),
    ],
)
def test_what_cannot_be_carried_is_remarked_upon(case, keywords):
    assert about(case) == keywords


def test_remarks_tell_the_numbers_and_the_remedy():
    (coarse,) = Cylinder(reynolds=200, resolution=10).remarks()
    assert "0.849 Δx" in coarse and "resolution = 18 puts two particles into it" in coarse
    assert Cylinder(reynolds=200, resolution=18).remarks() == []
    layer = Cylinder(reynolds=1e5, resolution=8).remarks()[0]
    assert layer.startswith("not resolved: boundary layer of 0.0304 Δx") and "resolution = 396" in layer
    outlet, inlet = Cylinder(length=3.0, height=13.0, upstream=1.5).remarks()
    assert "outlet 1 D behind" in outlet and "slows the stream there by about 11 %" in inlet
    assert Cylinder(reynolds=250, resolution=10).scales() == pytest.approx(
        {"cell Reynolds number, UΔx/ν": 25.0, "thickness of the boundary layer, Δx": 12 / math.sqrt(250)}
    )


def test_the_boundary_layer_is_that_of_the_bodys_own_size(tmp_path):
    half = tmp_path / "half.txt"
    half.write_text("-0.25 -0.25\n0.25 -0.25\n0.25 0.25\n-0.25 0.25\n")
    assert Body(shape=str(half)).boundary_layer == pytest.approx(Cylinder().boundary_layer / math.sqrt(2))


def test_of_several_bodies_the_smallest_has_the_thinnest_layer(monkeypatch):
    two = shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.box(2, 0, 2.25, 0.25)])
    monkeypatch.setattr(Body, "outline", two)
    assert Body().boundary_layer == pytest.approx(0.5 * Cylinder().boundary_layer)


ELLIPSE = affinity.scale(shapely.Point(0, 0).buffer(1, quad_segs=64), 0.5, 0.2)


@pytest.mark.parametrize(
    ("shape", "thickness"),
    [
        (shapely.box(0, 0, 1, 1), 1.0),
        (shapely.box(0, 0, 0.04, 1), 0.04),
        (affinity.rotate(shapely.box(0, 0, 0.3, 1), 33), 0.3),
        (shapely.Point(0, 0).buffer(0.5), 1.0),
        (ELLIPSE, 0.4),
        (shapely.box(0, 0, 1, 1) | shapely.box(1, 0.4, 2, 0.45), 0.05),
        (shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.box(2, 0, 2.1, 1)]), 0.1),
        (shapely.Polygon([(0, 0), (1, 0.1), (1, -0.1)]), 0.0),
        (shapely.box(0, 0, 1e-3, 1e-3), 1e-3),
        (shapely.box(0, 0, 1, 1) - shapely.box(0.3, 0.3, 0.7, 0.7), 0.3),  # in the corners discs of 0.35 fit in
        (shapely.Point(0, 0).buffer(0.5) - shapely.Point(0.05, 0).buffer(0.4), 0.05),
        (shapely.Point(0, 0).buffer(0.3) | shapely.Point(0.62, 0).buffer(0.3) | shapely.box(0, -0.1, 0.62, 0.1), 0.2),
    ],
)
def test_thickness_of_the_thinnest_part(shape, thickness):
    assert remarks.thinnest(shape) == pytest.approx(thickness, rel=0.01, abs=2e-3 * thickness + 1e-4)


def test_what_is_cut_off_a_body_and_thin_bodies_are_remarked_upon():
    def said(resolution, **parameters):
        case = Body(resolution=resolution, length=5.0, height=4.0, upstream=2.0, **parameters)
        return [remark for remark in case.remarks() if remark.startswith("thin")]

    cut, thin = said(20, shape="naca0012")
    assert cut.startswith(
        "thin parts: cut off, for they are thinner than 2 Δx: up to 0.41 D of tips, 33 % of the area;"
    )
    assert thin.startswith("thin body: the body is 2.4 Δx at its thickest;") and "resolution = 67 makes it 8 Δx" in thin
    assert not [each for each in said(67, shape="naca0012") if each.startswith("thin body")]
    assert len(said(40, shape="naca0012")) == 2
    (cut,) = said(80, shape="naca0012")
    assert "thin parts" in cut
    assert said(10) == said(8) == []


@pytest.mark.parametrize(("length", "cut_off"), [(0.1, 0.03), (1.0, 0.49)])
def test_a_body_that_falls_to_pieces_is_remarked_upon(length, cut_off):
    """However short the part is that held them together, and though no corner of it lies far from them."""
    one = shapely.box(0, 0, 1, 1)
    bar, other = shapely.box(1, 0.45, 1 + length, 0.55), affinity.translate(one, 1 + length, 0)
    shape = shapely.union_all([one, bar, other])
    (cut,) = remarks.thin("body", shape, carried(shape, 0.1), 0.1)
    assert cut.startswith("thin parts") and f"up to {cut_off} D of tips" in cut and "in 2 pieces" in cut


def test_remarks_of_a_run(tmp_path):
    run = Run(write_run(tmp_path / "run"))
    assert remarks.keywords(run.remarks) == "coarse, narrow channel"
    assert run.summary()["remark 1"] == run.remarks[0]
    short = Run(tmp_path / "run")
    short.window = replace(short.window, edges=short.window.edges[:5], periods=4)
    assert outcome(short, "60") == ["few periods: averaged over 4 of shedding; a longer run tells more"]
    short.window = replace(short.window, settled=False, rule="shedding not periodic yet")
    assert outcome(short, "60") == ["not settled: shedding not periodic yet"]
    short.window = replace(short.window, rule="still developing (drag changes by 2 %); later half of the periods")
    assert outcome(short, "60") == ["still developing: drag changes by 2 %; later half of the periods"]
    info = tmp_path / "run" / "run.json"
    info.write_text('{"status": "diverged", "retries": [{"step": 3, "time_step": 0.01}]}')
    lines = (tmp_path / "run" / "history.csv").read_text().splitlines(keepends=True)
    column = lines[0].split(",").index("cylinder_pressure_force_x")
    cells = [line.rstrip("\n").split(",") for line in lines[1:3000]]
    rows = [",".join([*row[:column], "-9", *row[column + 1 :]]) + "\n" for row in cells]
    (tmp_path / "run" / "history.csv").write_text(lines[0] + "".join(rows))
    broken = Run(tmp_path / "run")
    assert remarks.keywords(broken.remarks).startswith("diverged, retried")
    assert "unphysical" in remarks.keywords(broken.remarks)
    assert broken.remarks[0].startswith("diverged: at tU/D = 29.9") and "of 60" in broken.remarks[0]


@pytest.mark.parametrize(
    ("scheme", "remedy"),
    [
        (None, "more projection_sweeps or max_iterations lower it"),
        ("isph", "more projection_sweeps lower it"),
        ("explicit_isph", "more projection_sweeps lower it"),
        ("wcsph", "a larger sound_speed lowers it"),
        ("edac", "a larger sound_speed lowers it"),
    ],
)
def test_what_makes_a_flow_more_free_of_divergence_is_of_its_scheme(tmp_path, scheme, remedy):
    run = Run(write_run(tmp_path / "run"))
    run.history["divergence_mean"][:] = 0.1
    assert f"not divergence-free: mean |∇·u| = 0.1 U/D; {remedy}" in outcome(run, "60", scheme)
    run.history["surface"] = np.ones_like(run.history["time"])
    (told,) = [remark for remark in outcome(run, "60", scheme) if remark.startswith("not divergence-free")]
    assert told.endswith(remedy.replace(" or max_iterations", "")) and "alone in the air" in told


@pytest.mark.parametrize(
    ("scheme", "idle"),
    [
        (None, ""),
        ("isph", "max_iterations = 7, tolerance = 0.01, viscous_theta = 0.9, time_step_safety = 0.5"),
        ("explicit_isph", "max_iterations = 7, tolerance = 0.01, viscous_theta = 0.9, time_step_safety = 0.5"),
        (
            "wcsph",
            "max_iterations = 7, tolerance = 0.01, viscous_theta = 0.9, time_step_safety = 0.5, "
            "projection_sweeps = 9, sweep_weights = equal, sweep_pressure = rough",
        ),
    ],
)
def test_what_has_no_effect_with_a_scheme_is_told_and_has_none(scheme, idle):
    chosen = {"max_iterations": 7, "tolerance": 0.01, "viscous_theta": 0.9, "time_step_safety": 0.5}
    chosen |= {"projection_sweeps": 9, "sweep_weights": "equal", "sweep_pressure": "rough"}
    plain = Cavity(resolution=10, scheme=scheme)
    case = plain.replace(**chosen)
    told = [remark for remark in case.remarks() if remark.startswith("no effect")]
    assert told == ([f"no effect: {idle}; nothing depends on them with {scheme}"] if idle else [])
    assert not any("no effect" in remark for remark in plain.remarks())
    acting = plain.replace(**{name: value for name, value in chosen.items() if name not in idle})
    states = []
    for each in (acting, case):
        simulation = each.simulation(threads=1)
        simulation.advance(3)
        states.append(simulation.state()["velocity"])
    assert not idle or np.array_equal(*states)


def test_what_has_no_effect_in_a_case_is_told():
    told = StillWater(resolution=10, wall_pressure="adami").remarks()
    assert "no effect: wall_pressure = adami; nothing depends on it in still_water" in told
    for scheme in ("isph", "explicit_isph", "wcsph", "edac"):
        assert not any("no effect" in remark for remark in StillWater(resolution=10, scheme=scheme).remarks())


FAST = {"resolution": 8, "length": 8.0, "height": 6.0, "upstream": 3.0}


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"body_motion": "0, 0.05*sin(2*pi*t/0.5)"}, "body_motion swings while it travels 1.7 D; with less than 5 D"),
        ({"body_motion": "0.5*t, 0.05*sin(2*pi*t), t", "scheme": "wcsph"}, "10 D; with less than 16 D forces err"),
        ({"driving_force": "0, 3 + sin(2*pi*t)"}, "driving_force swings while it travels 3.4 D; with less than 32 D"),
    ],
)
def test_what_swings_faster_than_the_pressure_follows_is_remarked_upon(options, told):
    """Added masses of 0.68 to 1.11 in place of 0.88 to 1.02, and of forces several times the right one."""
    (remark,) = [each for each in Cylinder(**FAST, **options).remarks() if each.startswith("slow pressure")]
    assert told in remark and remark.endswith(", or isph")
    assert not any("slow pressure" in each for each in Cylinder(**FAST, **options | {"scheme": "isph"}).remarks())


@pytest.mark.parametrize(
    "options",
    [
        {"body_motion": "0, 0.3*sin(2*pi*t/5)"},
        {"body_motion": "-0.5*t, 0, 2*t"},
        {"body_motion": "0, spline(t, 0,0, 1,0.1, 2,0.3, 3,0.4)"},
        {"driving_force": "0.1, 0"},
        {"driving_force": "0, sin(2*pi*t/20)"},
    ],
)
def test_what_swings_slowly_or_not_at_all_needs_no_remark(options):
    assert not any("slow pressure" in each for each in Cylinder(**FAST, **options).remarks())


@pytest.mark.parametrize("period", [0.3, 1.0, 4.0])
def test_a_period_is_that_of_the_wave(period):
    wave = f"sin(2*pi*t/{period})"
    case = Cylinder(**FAST, body_motion=f"0.2*t + {wave}, t**2*0", driving_force=f"1, 0.5*{wave}")
    assert case.swing_period("motion") == pytest.approx(period, rel=0.05)
    assert case.swing_period("forcing") == pytest.approx(period, rel=0.05)


def test_what_makes_a_fluid_give_way_less_is_of_its_scheme():
    (told,) = remarks.penalty(1.0, "wcsph")
    assert "the speed of sound lets the fluid give way as at a Mach number of 1," in told
    assert told.endswith("take a larger sound_speed")
    assert remarks.penalty(1.0)[0].endswith("take a smaller courant, or a larger penalty_constant")
    slow = Cylinder(scheme="edac", sound_speed=1.0).remarks()
    assert any("larger sound_speed" in remark for remark in slow) and not any("penalty" in each for each in slow)


def test_a_drag_of_rounding_is_not_unphysical(tmp_path):
    def said(drag):
        path = write_run(tmp_path / f"{drag}")
        run = Run(path)
        for name in run.history.keys() & {f"cylinder_{part}_force_x" for part in ("pressure", "viscous")}:
            run.history[name][:] = drag
        return [remark for remark in outcome(run, "60") if remark.startswith("unphysical")]

    assert not said(-1e-10) and said(-1e-3)


def test_fluid_that_comes_back_through_an_outlet_is_remarked_upon(tmp_path):
    """The outlet cuts the wake of a cylinder at Re = 40: it stays full, and the drag is that of a long channel."""
    kwargs = {"reynolds": 40, "resolution": 8, "height": 5.0, "upstream": 2.0, "perturbation": 0.0}
    short, long = (
        Cylinder(length=length, **kwargs).run(tmp_path / f"{length}", until=15, progress=False) for length in (3.5, 6.5)
    )
    (told,) = [remark for remark in short.remarks if remark.startswith("backflow")]
    assert "fluid comes back through" in told and not any("backflow" in remark for remark in long.remarks)
    assert short.history["returning"][-1] > 0 == long.history["returning"][-1]
    assert float(short.drag.mean) == pytest.approx(float(long.drag.mean), rel=0.05)
    fluid = short.history["fluid"]
    assert abs(fluid[-1] / fluid[0] - 1) < 0.02  # no voids


def test_pictures_and_information_carry_the_remarks(tmp_path, alsph):
    path = write_run(tmp_path / "run")
    for figure in (Run(path).plot_forces(), Run(path).plot_field("pressure"), Run(path).plot_pressure_coefficient()):
        assert "coarse: boundary layer of 0.849 Δx" in figure.get_supxlabel()
        assert "puts two particles" not in figure.get_supxlabel()
    assert "coarse: boundary layer of 0.849 Δx" in alsph("info", path)[1]
    code, stdout, _ = alsph("describe", "cylinder", "--reynolds=1e5", "--resolution=8", "--no-probe")
    assert (code, "remark" in stdout, "not resolved: boundary layer of 0.0304 Δx" in stdout) == (0, True, True)
    assert "remark" not in alsph("describe", "cylinder", "--no-probe")[1]


def test_a_field_of_a_case_that_is_not_known_can_be_drawn(tmp_path):
    path = write_run(tmp_path / "run")
    text = (path / "case.toml").read_text()
    (path / "case.toml").write_text(text.replace('case = "cylinder"', 'case = "ones_own"'))
    assert "no remarks: case or history" in Run(path).plot_field("pressure").get_supxlabel()


def test_a_figure_without_remarks_has_no_footer(tmp_path):
    case = Cylinder(reynolds=200, resolution=20)
    run = Run(write_run(tmp_path / "run", case))
    assert run.remarks == [] and run.plot_forces().get_supxlabel() == ""
    assert np.isfinite(run.drag.mean)


def test_a_study_says_before_it_runs_what_its_cases_cannot_carry(tmp_path, alsph):
    assert remarks.tally(["coarse, kernel", "", "coarse"]) == "coarse: 2 of 3 runs, kernel: 1 of 3 runs"
    stdout = alsph("study", "run", "time-step", "--preset", "quick", "--dry-run", "-o", tmp_path)[1]
    assert "remarks: coarse: 20 of 20 runs" in stdout


def test_gaps_that_are_not_resolved():
    class Two(Bodies):
        """Two cylinders side by side.

        Apart.
        """

        gap: float = 1.0

        def shapes(self):
            return [Point(0, side * (0.5 + self.gap / 2)).buffer(0.5) for side in (-1, 1)]

    def said(gap):
        return [remark for remark in Two(gap=gap, resolution=10).remarks() if remark.startswith("narrow gap")]

    assert said(0.5) == []
    assert said(0.3) == [
        "narrow gap: 3 Δx between body_1 and body_2; the flow there is not resolved, use a finer resolution"
    ]
    assert said(0.05) == ["narrow gap: 0.5 Δx between body_1 and body_2; nothing flows there, use a finer resolution"]
    assert (Two.name, Two.title) == ("two", "two cylinders side by side")


BLOCK = shapely.box(-0.8, -0.6, 0.8, 0.6)


def slit(width, depth=1.0):
    return BLOCK - shapely.box(0.8 - depth, -width / 2, 2, width / 2)


def notch(angle):
    return BLOCK - shapely.Polygon(
        [(0.1, 0), (1.1, -np.tan(np.radians(angle / 2))), (1.1, np.tan(np.radians(angle / 2)))]
    )


RING = Point(0, 0).buffer(0.8) - Point(0, 0).buffer(0.5)
ANGLES, RADII = np.arange(10) * np.pi / 5, np.tile([0.5, 0.2], 5)
STAR = shapely.Polygon(np.stack([RADII * np.cos(ANGLES), RADII * np.sin(ANGLES)], axis=1))


@pytest.mark.parametrize(
    ("shape", "told"),
    [
        (slit(0.05), "up to 0.5 Δx within the body; nothing flows there, use a finer resolution"),
        (slit(0.15), "up to 1.5 Δx within the body; the flow there is not resolved, use a finer resolution"),
        (slit(0.39), "up to 3.9 Δx within the body; the flow there is not resolved, use a finer resolution"),
        (
            slit(0.12) - shapely.box(-2, -0.39, 0, -0.27),
            "up to 1.2 Δx within the body, the narrowest of 2 slots; the flow",
        ),
        (RING - shapely.box(0, -0.1, 2, 0.1), "up to 4 Δx within the body; the flow there is not resolved"),
        (notch(20), "up to 1.9 Δx within the body; the flow there is not resolved"),
        (slit(0.41), ""),
        (slit(0.15, depth=0.2), ""),
        (notch(45), ""),
        (RING, ""),
        (RING - shapely.box(0, -0.25, 2, 0.25), ""),
        (BLOCK - shapely.box(0, 0, 2, 2), ""),
        (STAR, ""),
        (Point(0, 0).buffer(0.5), ""),
    ],
)
def test_a_slot_in_a_body_is_a_gap_that_is_not_resolved(shape, told):
    found = remarks.slots("body", carried(shape, 0.1), 0.1)
    assert [remark[: len("narrow gap: " + told)] for remark in found] == ["narrow gap: " + told] * bool(told)


def test_slots_are_among_the_remarks_on_bodies():
    assert "narrow gap" in about(Body(shape=slit(0.15), resolution=10))
    assert "narrow gap" not in about(Body(shape=slit(0.15), resolution=40))


@pytest.mark.parametrize("resolution", [8, 15, 33, 100])
@pytest.mark.parametrize("name", ["naca0012", "naca6412", "naca23012"])
def test_airfoils_have_no_slots(name, resolution):
    assert "narrow gap" not in about(Body(shape=name, angle_of_attack=7, resolution=resolution))


def test_a_class_of_the_users_says_what_it_inherits():
    class Slow(Cavity):
        """A slow lid."""

    assert Slow().remarks()[-1].startswith("not validated: Slow has what it does not say itself from Cavity")
    assert not any("does not say itself" in remark for remark in Cavity().remarks())
