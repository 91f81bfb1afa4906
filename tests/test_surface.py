import json

import h5py
import numpy as np
import pytest
import shapely
from alsph import Run
from alsph.cases import Body, Cylinder, CylinderPair
from alsph.config import Config, RunSettings
from alsph.errors import ConfigError, RunFolderError
from alsph.folder.run_folder import RunFolder
from alsph.geometry.surface import along, circle, edges
from shapely import affinity
from synthetic import append_surface, history, write_run

SLOPE = np.array([0.3, -0.7])
CAMBERED = "1 0.001\n0.7 0.09\n0.4 0.13\n0.1 0.08\n0 0\n0.1 0.01\n0.4 0.05\n0.7 0.04\n1 -0.001\n"
ELLIPSE = affinity.scale(shapely.Point(0, 0).buffer(1, quad_segs=32), 0.5, 0.2)
TWO = shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.box(2, 0.5, 3, 1)])


@pytest.mark.parametrize("turn", [0.0, 12.0, -170.0])
@pytest.mark.parametrize("shape", [Body().outline, Body(shape="naca0012").outline, ELLIPSE, TWO])
def test_a_linear_pressure_pushes_with_its_gradient_times_the_area(shape, turn):
    surface = along(affinity.rotate(shape, -turn, origin=(0, 0)), turn)
    assert surface.integral(surface.position @ SLOPE + 3.0) == pytest.approx(shape.area * SLOPE, rel=1e-9)
    assert surface.length.sum() == pytest.approx(shape.length)
    assert np.hypot(*surface.normal.T) == pytest.approx(1)


def test_a_circle_too():
    surface = circle(0.5, 72)
    assert surface.integral(surface.position @ SLOPE + 3.0) == pytest.approx(np.pi / 4 * SLOPE)


@pytest.mark.parametrize("turn", [0.0, 10.0, -60.0])
def test_sides_and_chord_turn_with_the_body(turn):
    surface = Body(shape="naca0012", angle_of_attack=turn, height=6.0).surface_points()
    outline, (carried,) = Body(shape="naca0012").outline, Body(shape="naca0012").carried
    back = np.array(
        [[np.cos(np.radians(turn)), np.sin(np.radians(turn))], [-np.sin(np.radians(turn)), np.cos(np.radians(turn))]]
    )
    upright = (surface.position - [4, 0]) @ back
    assert (np.sign(upright[:, 1]) == surface.side).all()
    assert surface.chord == pytest.approx(upright[:, 0] - outline.bounds[0])
    for side, order in ((1, 1), (-1, -1)):
        arc = surface.arc[surface.side == side]
        assert (order * np.diff(arc) > 0).all() and arc.max() == pytest.approx(carried.length / 2, rel=0.01)


def test_both_sides_of_a_symmetric_section_mirror():
    surface = Body(shape="naca0012").surface_points()
    upper, lower = surface.side > 0, surface.side < 0
    assert surface.chord[upper] == pytest.approx(surface.chord[lower][::-1], abs=1e-12)
    assert surface.position[upper] == pytest.approx(surface.position[lower][::-1] * [1, -1], abs=1e-12)


def test_sides_of_a_cambered_section_are_told_by_the_edges_not_by_height(tmp_path):
    path = tmp_path / "foil.txt"
    path.write_text(CAMBERED)
    case = Body(shape=str(path), resolution=160)
    surface = case.surface_points()
    inside = (surface.side < 0) & (surface.chord > 0.1) & (surface.chord < 0.9)
    assert (surface.position[inside, 1] + case.outline.centroid.y > surface.position[0, 1]).any()  # above the nose
    assert (surface.normal[inside, 1] < 0).all() and case.chord == pytest.approx(1)


def test_faces_across_the_chord_are_parted_in_their_middle():
    surface = Body().surface_points()
    front = surface.chord == 0
    assert front.sum() == 36 and (surface.side[front] == np.sign(surface.position[front, 1])).all()
    assert [list(edge) for edge in edges(shapely.box(0, 0, 3, 1))] == [[0, 0.5], [3, 0.5]]


def test_bodies_follow_each_other():
    surface = along(TWO)
    assert (np.diff(surface.part) >= 0).all() and set(surface.part) == {0, 1}
    assert surface.chord.max() == pytest.approx(1) and surface.chord[surface.part == 0].max() == pytest.approx(1 / 3)
    case = CylinderPair(resolution=10)
    ends = [np.ptp(case.surface_points().chord[case.surface_points().part == part]) for part in (0, 1)]
    assert ends == pytest.approx([1, 1], abs=1e-3)


def write_body(path, case, coefficient, *, geometry=True, torque=0.0):
    """Write the run folder of a body with a constant pressure coefficient (m,) and torque."""
    folder = RunFolder(path)
    folder.create(Config(case, RunSettings(until=10.0)))
    (path / "run.json").write_text(json.dumps({"status": "finished", "case": "body"}))
    rows = history(10.0)
    folder.append_history(rows | {"pressure_torque": np.full_like(rows["pressure_torque"], torque)}, ["body"])
    surface = case.surface_points()
    arrays = surface.arrays() if geometry else {}
    for time in np.arange(0.0, 10.0, 0.5):
        append_surface(folder, time, {"angle": surface.angle} | arrays, coefficient(surface))
    return Run(path)


def test_the_pressure_coefficient_of_a_body_and_its_force(tmp_path):
    case = Body(shape="naca0012", angle_of_attack=10.0)
    run = write_body(tmp_path / "run", case, lambda surface: surface.position @ SLOPE)
    found = run.pressure_coefficient
    assert found.force() == pytest.approx(-case.carried[0].area * SLOPE)
    assert found.force(0) == pytest.approx(found.force()) and found.force(1) == pytest.approx([0, 0])
    assert (found.surface.chord == case.surface_points().chord).all()


def test_the_picture_has_suction_up_and_both_sides_over_the_chord(tmp_path):
    case = Body(shape="naca0012", angle_of_attack=10.0)
    run = write_body(
        tmp_path / "run", case, lambda surface: np.where(surface.side > 0, -1.0, 0.5) * (1 - surface.chord)
    )
    over_chord, over_arc = run.plot_pressure_coefficient(tmp_path / "picture.png").axes
    assert over_chord.yaxis_inverted() and over_arc.yaxis_inverted()
    assert over_chord.get_xlabel() == "$x/c$" and "s/D" in over_arc.get_xlabel()
    upper, lower = over_chord.lines
    assert (upper.get_label(), lower.get_label()) == ("upper side", "lower side")
    assert upper.get_ydata() == pytest.approx(upper.get_xdata() - 1, abs=1e-3)
    assert lower.get_ydata() == pytest.approx(0.5 * (1 - lower.get_xdata()), abs=1e-3)
    assert np.ptp(over_arc.lines[0].get_xdata()) == pytest.approx(case.carried[0].length / 2, abs=0.02)


def test_folders_of_older_versions_have_no_geometry(tmp_path):
    old = Run(write_run(tmp_path / "cylinder"))  # written without one, at the points that a cylinder still has
    ideal = 1 - 2 * np.sin(np.radians(old.pressure_coefficient.theta)) ** 2
    assert old.pressure_coefficient.force() == pytest.approx(
        -circle(0.5, 72).integral(old.pressure_coefficient.mean), abs=1e-12
    )
    assert circle(0.5, 72).integral(ideal) == pytest.approx([0, 0], abs=1e-12)
    foil = Body(shape="naca0012")
    body = write_body(tmp_path / "body", foil, lambda surface: surface.position @ SLOPE, geometry=False)
    with h5py.File(tmp_path / "body" / "surface.h5", "a") as file:
        file["angle"][:] = file["angle"][:] + 0.5
    assert np.isnan(body.pressure_coefficient.force()).all()
    assert "degrees" in body.plot_pressure_coefficient().axes[0].get_xlabel()


def test_samples_at_other_points_are_set_aside(tmp_path):
    folder = RunFolder(tmp_path / "run")
    folder.create(Config(Cylinder()))
    append_surface(folder, 0.1, {"angle": np.array([0.0, 90.0])}, np.zeros(2))
    with pytest.warns(
        RuntimeWarning, match="surface.h5 holds samples at other points and is set aside as surface.former"
    ):
        append_surface(folder, 0.2, {"angle": np.array([0.0, 80.0]), "part": np.zeros(2)}, np.ones(2))
    assert (tmp_path / "run" / "surface.former.h5").exists()
    with h5py.File(tmp_path / "run" / "surface.h5") as file:
        assert file["time"][:].tolist() == [0.2] and "part" in file


def test_damaged_geometry_is_refused(tmp_path):
    run = write_body(tmp_path / "run", Body(), lambda surface: surface.side)
    for name, values in (
        ("normal", np.zeros((3, 2))),
        ("position", np.zeros(144)),
        ("side", np.zeros(())),
        ("arc", None),
    ):
        with h5py.File(tmp_path / "run" / "surface.h5", "a") as file:
            kept = file[name][()]
            del file[name]
            if values is not None:
                file[name] = values
        with pytest.raises(RunFolderError, match="surface.h5: unreadable"):
            _ = Run(run.path).pressure_coefficient
        with h5py.File(tmp_path / "run" / "surface.h5", "a") as file:
            file.pop(name, None)
            file[name] = kept
    assert Run(run.path).pressure_coefficient.samples > 0


def test_moments_about_any_point(tmp_path):
    case = Body(shape="naca0012", angle_of_attack=10.0)
    run = write_body(tmp_path / "run", case, lambda surface: surface.side, torque=0.25)
    drag, lift = run.coefficient("x"), run.coefficient("y")
    assert run.moment_coefficient(about=(4.0, 0.0)) == pytest.approx(-0.5)  # counterclockwise is nose down
    # A lift that acts a distance a before the point lifts the nose; so does a drag that acts above it.
    ahead = run.moment_coefficient(about=(4.5, 0.0)) - run.moment_coefficient(about=(4.0, 0.0))
    assert ahead == pytest.approx(0.5 * lift)
    above = run.moment_coefficient(about=(4.0, -0.5)) - run.moment_coefficient(about=(4.0, 0.0))
    assert above == pytest.approx(0.5 * drag)
    viscous = run.moment_coefficient("viscous", about=(4.5, 0.0))
    assert viscous == pytest.approx(0.5 * run.coefficient("y", "viscous"))
    quarter = run.moment()
    assert quarter.mean == pytest.approx(run.moment(about=case.moment_point).mean)
    assert run.summary()["mean pitching moment coefficient about c/4"] == quarter.mean
    assert quarter.pressure + quarter.viscous == pytest.approx(quarter.mean)
    with pytest.raises(ConfigError, match="body = 'other': unknown; known: body"):
        run.moment(body="other")
    for point in ((1, 2, 3), (1,), 1.0, "x", (0, float("nan"))):
        with pytest.raises(ConfigError, match="about = .*: must be two finite numbers"):
            run.moment(about=point)


def test_the_chord_of_a_file_is_its_extent_and_normalises_moments(tmp_path):
    path = tmp_path / "plate.txt"
    path.write_text("0 0\n2 0\n2 0.5\n0 0.5\n")
    case = Body(shape=str(path), angle_of_attack=90.0)
    assert case.chord == pytest.approx(2)
    assert case.moment_point == pytest.approx([4.0, 0.5])  # the nose points up
    run = write_body(tmp_path / "run", case, lambda surface: surface.side, torque=0.25)
    assert run.moment_coefficient(about=(4.0, 0.0)) == pytest.approx(-0.5 / 4)
    assert Cylinder().moment_point == pytest.approx([4, 0])


def test_four_pieces_of_a_circle():
    found = circle(2.0, 4)
    assert found.angle.tolist() == [0, 90, 180, 270] and found.side.tolist() == [1, 1, 1, -1]
    assert found.position == pytest.approx(np.array([[-2, 0], [0, 2], [2, 0], [0, -2]]))
    assert found.normal == pytest.approx(found.position / 2)
    assert found.length == pytest.approx(4 * [np.pi]) and found.arc == pytest.approx([0, np.pi, 2 * np.pi, np.pi])
    assert found.part.tolist() == [0, 0, 0, 0] and "chord" not in found.arrays()
    assert set(along(TWO).arrays()) == {*found.arrays(), "chord"}
    moved = found.moved(np.array([10.0, 20.0]))
    assert moved.position == pytest.approx(found.position + [10, 20]) and moved.normal is found.normal


def test_the_pieces_of_a_box_go_around_it_from_the_middle_of_its_front():
    box = shapely.box(-1, -0.5, 2, 0.5)
    pieces = along(box)
    count = len(pieces.arc) // 2
    assert pieces.length.max() < 8 / 144 + 1e-9 and pieces.length.min() > 0.5 * 8 / 144
    upper, lower = pieces.side[:count], pieces.side[count:]
    assert (upper == 1).all() and (lower == -1).all() and len(lower) == count
    walked = np.cumsum(pieces.length) - pieces.length / 2
    assert pieces.arc == pytest.approx(np.where(pieces.side > 0, walked, 8 - walked))
    x, y = pieces.position.T
    across = np.abs(x - 0.5) > 1.5 - 1e-9
    assert pieces.arc[across] == pytest.approx(np.where(x[across] < 0, np.abs(y[across]), 4 - np.abs(y[across])))
    assert pieces.arc[~across] == pytest.approx(x[~across] + 1.5)
    assert pieces.normal[across] == pytest.approx(np.stack([np.sign(x[across]), 0 * x[across]], axis=1))
    assert pieces.normal[~across] == pytest.approx(np.stack([0 * y[~across], np.sign(y[~across])], axis=1))
    assert pieces.chord == pytest.approx((x + 1) / 3)
    assert pieces.angle == pytest.approx(np.degrees(np.arctan2(y, -x)) % 360)
    assert pieces.angle[0] < 10 and pieces.angle[-1] > 350
    assert along(box, chord=(-2.0, 3.0)).chord == pytest.approx((x + 2) / 5)


@pytest.mark.parametrize("turn", [25.0, -100.0])
@pytest.mark.parametrize("orient", [1, -1])
def test_pieces_turn_with_their_body_whichever_way_it_is_drawn(turn, orient):
    body = shapely.Polygon([(0, 0), (3, 0.5), (3, 1), (1, 2)][::orient])
    upright, turned = along(body), along(affinity.rotate(body, -turn, origin=(0, 0)), turn)
    back = affinity.rotate(shapely.MultiPoint(turned.position), turn, origin=(0, 0))
    assert shapely.get_coordinates(back) == pytest.approx(upright.position)
    back = affinity.rotate(shapely.MultiPoint(turned.normal), turn, origin=(0, 0))
    assert shapely.get_coordinates(back) == pytest.approx(upright.normal)
    for name in ("length", "part", "side", "arc", "chord"):
        assert getattr(turned, name) == pytest.approx(getattr(upright, name))
    ends = upright.position + 1e-3 * upright.normal
    assert not shapely.contains_xy(body, *ends.T).any()
    assert upright.position[0] == pytest.approx([0, 0], abs=0.1) and upright.side[0] == 1
    rear = upright.position[np.flatnonzero(np.diff(upright.side))[0]]
    assert rear == pytest.approx([3, 0.75], abs=0.1)
