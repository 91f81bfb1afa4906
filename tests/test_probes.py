"""Velocity and pressure at points: as a run goes, of a snapshot, and films."""

import sys

import alsph
import numpy as np
import pytest
from alsph import Run
from alsph.analysis.probes import points
from alsph.cases import Body, Cylinder, TaylorGreen
from alsph.config import Config, RunSettings
from alsph.errors import ConfigError, RunFolderError
from alsph.running.outputs import remarks_of
from alsph.study.declaration import digest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

POINTS = "0.3,0.2; 0.5,0.1:0.5,0.9:9"


def exact(position, time):
    x, y = 2 * np.pi * np.moveaxis(position, -1, 0)
    decay = np.exp(-8 * np.pi**2 * 0.01 * time)
    velocity = np.stack([-np.cos(x) * np.sin(y), np.sin(x) * np.cos(y)], axis=-1) * decay[..., None]
    return velocity, -0.25 * (np.cos(2 * x) + np.cos(2 * y)) * decay**2


@pytest.fixture(scope="module")
def vortices(tmp_path_factory):
    folder = tmp_path_factory.mktemp("probes") / "run"
    case = TaylorGreen(resolution=40)
    return case.run(folder, until=0.2, probes=POINTS, probe_interval=0.02, output_interval=0.05, progress=False)


def test_points_are_single_ones_and_lines():
    assert points(POINTS, 2)[[0, 1, -1]].tolist() == [[0.3, 0.2], [0.5, 0.1], [0.5, 0.9]]
    assert points("1,2 3,4;\n5,6", 2).tolist() == points([[1, 2], [3, 4], [5, 6]], 2).tolist()
    assert points([], 3).shape == (0, 3) and points("1,2,3", 3).shape == (1, 3)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("6", "'6': must be two finite numbers, x and y"),
        ("6,1,2", "must be two finite numbers"),
        ("a,b", "must be two finite numbers"),
        ("nan,1", "must be two finite numbers"),
        ([[1, 2], [3]], "must be a text such as"),
        ("0,0:1,1", "is no line"),
        ("0,0:1,1:1", "is no line"),
        ("0,0:1,1:" + 5000 * "9", "is no line"),
        (5, "must be a text such as"),
        ("0,0:1:3", "must be two finite numbers"),
        ("0,0:1,1:3:4", "is no line"),
        ("0,0:1,1:6000 0,0:1,1:6000", "more than 10000 points"),
        ("2,0.5", r"\[2.0, 0.5\] lies outside of the domain"),
    ],
)
def test_what_is_no_point_is_refused_before_anything_is_written(tmp_path, given, message):
    with pytest.raises(ConfigError, match=message):
        TaylorGreen(resolution=8).run(tmp_path / "run", until=0.02, probes=given, progress=False)
    assert not list(tmp_path.iterdir())


def test_probes_are_near_the_exact_solution(vortices):
    found = vortices.probes
    assert found.position.shape == (10, 2) and found.velocity.shape == (len(found.time), 10, 2)
    assert np.diff(found.time).max() < 0.03 and len(found.time) == 10
    velocity, pressure = exact(found.position, found.time[:, None])
    assert found.velocity == pytest.approx(velocity, abs=0.01)
    assert found.pressure == pytest.approx(pressure, abs=0.04)


def test_a_figure_shows_what_the_probes_recorded(vortices):
    record = vortices.probes
    figure = vortices.plot_probes()
    assert [axes.get_ylabel() for axes in figure.axes] == ["$u/U$", "$v/U$", r"$p\,/\,\rho U^2$"]
    columns = [*np.moveaxis(record.velocity, 2, 0), record.pressure]
    for axes, values in zip(figure.axes, columns, strict=True):
        drawn = np.array([line.get_ydata() for line in axes.lines])
        assert len(drawn) == min(10, len(record.position)) and (drawn[[0, -1]] == values.T[[0, -1]]).all()
    places = [text.get_text() for text in figure.legends[0].get_texts()]
    assert places[0] == ", ".join(f"${axis}/D$ = {at:g}" for axis, at in zip("xy", record.position[0], strict=True))


def test_snapshots_give_the_same_at_the_same_time(vortices):
    """Two ways: the engine's fit over the kernel's support, and one over the nearest particles of the snapshot."""
    time = vortices.times[-1]
    record = int(np.abs(vortices.probes.time - time).argmin())
    assert vortices.probes.time[record] == time
    found = vortices.sample(vortices.probes.position, time)
    assert found["velocity"] == pytest.approx(vortices.probes.velocity[record], abs=2e-3)
    assert found["pressure"] == pytest.approx(vortices.probes.pressure[record], abs=0.02)
    edges = np.array([[0.03, 0.25], [0.999, 0.4], [0.5, 0.0], [0.25, 1.0], [0.0, 0.0], [1.25, -0.4]])  # periodic
    gradient = vortices.sample(edges, time)["velocity_gradient"]
    x, y = 2 * np.pi * edges.T
    decay = np.exp(-8 * np.pi**2 * 0.01 * time)
    assert gradient[:, 0, 0] == pytest.approx(2 * np.pi * np.sin(x) * np.sin(y) * decay, abs=0.15)
    assert np.trace(gradient, axis1=1, axis2=2) == pytest.approx(0, abs=0.2)


def test_probes_of_a_resumed_run_are_those_of_a_whole_one(tmp_path):
    case, settings = TaylorGreen(resolution=10), {"probes": [[0.2, 0.3]], "probe_interval": 0.03, "progress": False}
    whole = case.run(tmp_path / "whole", until=0.4, **settings)
    case.run(tmp_path / "part", until=0.2, **settings)
    part = alsph.resume(tmp_path / "part", until=0.4, progress=False)
    for name in ("time", "velocity", "pressure"):
        assert np.array_equal(getattr(whole.probes, name), getattr(part.probes, name))


def test_points_of_numpy_are_points(tmp_path):
    across = np.stack([np.full(3, 0.5), np.linspace(0.2, 0.8, 3)], axis=1)
    run = TaylorGreen(resolution=8).run(tmp_path / "run", until=0.1, probes=across, progress=False)
    assert np.array_equal(run.probes.position, across) and run.config.run.probes == across.tolist()


def test_outside_of_the_domain_there_is_nothing(tmp_path):
    run = Body(resolution=10, length=5, height=4, upstream=2).run(tmp_path / "run", until=0.05, progress=False)
    assert np.isnan(run.sample([[5.04, 0.0], [3.0, 2.01]])["velocity"]).all()
    assert np.isfinite(run.sample([[5.0, 0.0], [3.0, 2.0]])["velocity"]).all()


def test_inside_a_body_there_is_nothing(tmp_path):
    body = Body(resolution=10, length=5, height=4, upstream=2)
    inside, outside = [2.0, 0.0], [2.0, 1.0]
    run = body.run(tmp_path / "run", until=0.05, probes=[inside, outside], progress=False)
    assert np.isnan(run.probes.velocity[:, 0]).all() and np.isfinite(run.probes.velocity[:, 1]).all()
    assert np.isnan(run.sample(inside)["pressure"]).all() and np.isfinite(run.sample(outside)["pressure"]).all()
    remark = "probes: 1 of the points lies in a body, as (2, 0): nothing is recorded there; move them"
    assert f"remark: {remark}" in (run.path / "run.log").read_text()


def test_what_a_body_passes_over_has_nothing_in_the_meantime(tmp_path):
    """A plate that turns by a right angle, and goes up."""
    plate = Body(shape=[[-0.5, -0.2], [0.5, -0.2], [0.5, 0.2], [-0.5, 0.2]], resolution=10, length=5, height=4)
    case = plate.replace(upstream=2, body_motion="0, 0.8*t, pi/2*t")
    where = [[2.4, 0.1], [2.0, 0.9], [2.0, 1.2], [2.4, 0.8], [3.5, 1.0]]
    run = case.run(tmp_path / "run", until=1.0, probes=where, probe_interval=0.1, progress=False)
    known = np.isfinite(run.probes.pressure)
    assert (known == np.isfinite(run.probes.velocity).all(axis=2)).all()
    assert known[0].tolist() == [False, True, True, True, True]
    assert known[-1].tolist() == [True, False, False, True, True]


def test_what_lies_on_the_surface_of_a_body_is_recorded(tmp_path):
    body = Body(resolution=10, length=5, height=4, upstream=2)
    edge = [[1.5, 0.0], [2.0, 0.5], [2.5, 0.1], [2.3, -0.5]]
    run = body.run(tmp_path / "run", until=0.2, probes=edge, progress=False)
    assert np.isfinite(run.probes.pressure).all() and "probes" not in "".join(run.remarks)


@given(st.floats(-1, 1), st.floats(-1, 1))
@settings(max_examples=60, deadline=None)
def test_probes_in_a_body_are_remarked_on(x, y):
    """As the true circle has it, but within half a spacing of its surface."""
    case = Cylinder(resolution=10, length=5, height=4, upstream=2)
    beyond = np.hypot(x, y) - 0.5
    if abs(beyond) > 0.05:
        config = Config(case, RunSettings(probes=[[2 + x, y], [4.0, 1.0]]))
        found = [remark for remark in remarks_of(config, case.build().state) if remark.startswith("probes: 1 of")]
        assert bool(found) == (beyond < 0)


def test_a_run_without_probes_has_none_and_keeps_its_name(tmp_path):
    run = TaylorGreen(resolution=8).run(tmp_path / "run", until=0.02, progress=False)
    assert run.probes.velocity.shape == (0, 0, 2) and not (run.path / "probes.h5").exists()
    assert "probe" not in Config(TaylorGreen()).text()
    assert digest(Config(TaylorGreen())) != digest(Config(TaylorGreen(), RunSettings(probes="0,0")))


def test_a_damaged_file_is_told(tmp_path):
    run = TaylorGreen(resolution=8).run(tmp_path / "run", until=0.02, probes=[[0.5, 0.5]], progress=False)
    (run.path / "probes.h5").write_bytes(b"nothing")
    with pytest.raises(RunFolderError, match="probes.h5"):
        _ = alsph.open_run(run.path).probes


@pytest.mark.parametrize(
    ("wrong", "message"),
    [([[0, 0, 0]], "must be points of 2 finite numbers"), ("here", "must be points"), ([[np.nan, 0]], "finite")],
)
def test_points_of_a_snapshot_are_checked(vortices, wrong, message):
    with pytest.raises(ConfigError, match=message):
        vortices.sample(wrong)


def test_a_film_has_a_picture_of_each_snapshot(vortices, tmp_path):
    done = []
    film = vortices.animate("vorticity", tmp_path / "film.gif", fps=10, progress=lambda *counts: done.append(counts))
    with Image.open(film) as gif:
        assert gif.n_frames == len(vortices.times) == len(done) == done[-1][0] and gif.info["duration"] == 100
        first = np.asarray(gif.convert("RGB"))
        gif.seek(gif.n_frames - 1)
        assert np.abs(first.astype(int) - np.asarray(gif.convert("RGB"))).max() > 10
    assert vortices.animate("pressure", every=2) == vortices.path / "figures" / "pressure.gif"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"path": "film.png"}, "a film ends in .gif, .mp4 or .webm"),
        ({"every": 0}, "every = 0"),
        ({"fps": "a"}, "fps = 'a': must be a number"),
        ({"start": "a"}, "start = 'a': must be a number"),
        ({"fps": 1e9}, "fps = 1e"),
        ({"start": 0.19}, "needs two snapshots or more, and there are 1"),
        ({"name": "colour"}, "unknown field 'colour'"),
        ({"limit": -1.0}, "limit = -1.0"),
    ],
)
def test_what_is_wrong_with_a_film_is_told(vortices, tmp_path, monkeypatch, options, message):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError, match=message):
        vortices.animate(**{"path": "film.gif"} | options)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("kind", ["mp4", "WEBM"])
def test_a_film_may_be_a_video(vortices, tmp_path, kind):
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    film = vortices.animate(path=tmp_path / f"film.{kind}", every=np.int64(2), fps=25)
    assert ffmpeg.count_frames_and_secs(str(film))[0] == 3


def test_a_gif_says_what_it_cannot_play(vortices, tmp_path):
    with pytest.warns(UserWarning, match="33.3 a second"):
        vortices.animate(path=tmp_path / "film.gif", fps=30, every=3)


def test_a_video_needs_a_library(vortices, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(ConfigError, match="needs imageio-ffmpeg: pip install"):
        vortices.animate(path=tmp_path / "film.mp4")
    assert not list(tmp_path.iterdir())


def test_a_history_is_a_table(vortices):
    frame = vortices.to_pandas()
    assert frame.index.name == "time" and list(frame.index) == list(vortices.history["time"])
    assert frame["kinetic_energy"].iloc[-1] == vortices.history["kinetic_energy"][-1]


def test_a_snapshot_is_a_grid(vortices, tmp_path):
    grid = vortices.to_xarray(spacing=0.1, lower=(0.2, 0.3), upper=(0.8, 0.7))
    assert dict(grid.sizes) == {"y": 4, "x": 6} and grid.x.values[[0, -1]] == pytest.approx([0.25, 0.75])
    there = vortices.sample([[0.45, 0.35]])
    cell = grid.isel(x=2, y=0)
    assert float(cell.velocity_y) == pytest.approx(there["velocity"][0, 1])
    x, y = (2 * np.pi * values for values in np.meshgrid(grid.x, grid.y))
    decay = np.exp(-8 * np.pi**2 * 0.01 * grid.attrs["time"])
    assert grid.velocity_x.values == pytest.approx(-np.cos(x) * np.sin(y) * decay, abs=0.01)
    assert grid.vorticity.values == pytest.approx(4 * np.pi * np.cos(x) * np.cos(y) * decay, abs=0.25)
    assert dict(vortices.to_xarray().sizes) == {"y": 40, "x": 40}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"spacing": 0.0}, "spacing = 0.0"),
        ({"spacing": 10**400}, "spacing = 1000"),
        ({"lower": "ab"}, "box from 'ab'"),
        ({"spacing": 1e-12}, "more than 20,000,000 points"),
        ({"lower": (1, 1)}, "the lower one first"),
    ],
)
def test_what_is_no_grid_is_refused(vortices, options, message):
    with pytest.raises(ConfigError, match=message):
        vortices.to_xarray(**options)


def test_a_library_that_is_not_there_is_told(vortices, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ConfigError, match="this needs pandas: pip install 'alsph"):
        vortices.to_pandas()


def test_probes_given_several_times_are_joined(alsph, tmp_path):
    options = "--resolution", 8, "--until", 0.1, "--output", tmp_path / "run"
    code, _, _ = alsph("run", "taylor_green", "--probes", "0.5,0.5", *options, "--probes", "0.2,0.2:0.8,0.2:3")
    assert code == 0
    assert Run(tmp_path / "run").probes.position == pytest.approx(
        np.array([[0.5, 0.5], [0.2, 0.2], [0.5, 0.2], [0.8, 0.2]])
    )
    code, _, err = alsph("run", "taylor_green", "--probes", "0.5,0.5", *options, "--probes", "x", "--force")
    assert code == 2 and "probes" in err and len(err.splitlines()) == 1


def test_probes_as_a_table(vortices, alsph, tmp_path):
    found = vortices.probes
    columns = found.columns()
    assert list(columns) == ["time", "x", "y", "velocity_x", "velocity_y", "pressure"]
    row = 2 * len(found.position) + 1
    assert columns["time"][row] == found.time[2] and columns["y"][row] == found.position[1, 1]
    assert columns["velocity_y"][row] == found.velocity[2, 1, 1] and columns["pressure"][row] == found.pressure[2, 1]
    code, stdout, stderr = alsph("export", vortices.path, "--probes", "-o", tmp_path / "probes.csv")
    assert code == 0 and "probes.csv" in stdout, stderr
    assert stderr == "time in D/U, length in D, velocity in U, pressure in rho U^2\n"
    read = np.genfromtxt(tmp_path / "probes.csv", delimiter=",", names=True)
    for name, values in columns.items():
        np.testing.assert_allclose(read[name], values, rtol=1e-8, atol=1e-12)
    points, times = found.velocity.shape[1], len(found.time)
    assert repr(found).startswith(f"Probes({points} points, {times} times from t* = 0.0")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--probes", "--time", "0"], "--probes: not with --time"),
        (["--probes", "--to", "netcdf"], "--probes: not with --to"),
        (["--probes", "-o", "probes.nc"], "ends in .csv"),
        (["--probes", "--si"], "does not know its units"),
    ],
)
def test_what_of_probes_cannot_be_written(vortices, alsph, arguments, message):
    code, _, stderr = alsph("export", vortices.path, *arguments)
    assert code == 2 and message in stderr


def test_a_run_without_probes_has_none_to_write(alsph, tmp_path):
    run = TaylorGreen(resolution=8).run(tmp_path / "run", until=0.02, progress=False)
    assert repr(run.probes) == "Probes(nothing recorded)"
    code, _, stderr = alsph("export", run.path, "--probes")
    assert code == 2 and "has no probes" in stderr
    case = TaylorGreen(resolution=8, units=WATER)
    told = case.run(tmp_path / "si", until=0.1, probes=[[0.2, 0.3]], probe_interval=0.02, progress=False)
    code, _, stderr = alsph("export", told.path, "--probes", "--si")
    assert code == 0, stderr
    read = np.genfromtxt(told.path / "probes_si.csv", delimiter=",", names=True)
    assert np.atleast_1d(read["x"])[0] == pytest.approx(0.2 * 0.02)
    assert read["pressure"] == pytest.approx(told.probes.pressure[:, 0] * 0.1)
    assert read["velocity_x"] == pytest.approx(told.probes.velocity[:, 0, 0] * 0.01)


WATER = {"length": 0.02, "velocity": 0.01, "density": 1000.0, "kinematic_viscosity": 1e-6}
