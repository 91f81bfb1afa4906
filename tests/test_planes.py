"""Velocity and pressure on planes as a run goes: recorded as probes are, read back, resumed, refused."""

import os
import signal
import subprocess
import sys
import time

import alsph
import h5py
import numpy as np
import pytest
from alsph import Run
from alsph.analysis.planes import grids
from alsph.cases import Cylinder, TaylorGreen
from alsph.config import Config, RunSettings
from alsph.errors import ConfigError, RunFolderError
from alsph.geometry.domain import Domain
from alsph.running.describe import describe
from alsph.study.declaration import digest

BOX = Domain((0, 0), (2, 1), [("periodic", "periodic")] * 2)
SPACE = Domain((0, 0, 0), (1, 1, 1), [("periodic", "periodic")] * 3)


def lengths(given, domain=BOX, spacing=0.1):
    return [tuple(map(len, axes)) for axes in grids(given, domain, spacing, np.array(domain.size) / 2)]


def test_planes_are_given_by_a_place_or_by_two_corners():
    assert lengths("x=0.5; y=0.2:0.25 0.5,0:1.5,0.5\n0.5,0.3:1.5,0.3:0.2") == [(1, 10), (8, 1), (10, 5), (5, 1)]
    assert lengths(["x", "y=1"]) == lengths("x;y=1") == [(1, 10), (20, 1)]
    assert lengths("z; 0,0.2,0:1,0.2,0.5:0.25; 0,0,0:1,1,1:0.5", SPACE) == [(10, 10, 1), (4, 1, 2), (2, 2, 2)]
    ((x, y),) = grids("1.5,0.5:0.5,0.1:0.2", BOX, 0.1, np.ones(2))  # whichever corner comes first
    assert x == pytest.approx([0.6, 0.8, 1.0, 1.2, 1.4]) and y == pytest.approx([0.2, 0.4])
    ((x, y),) = grids("x", BOX, 0.5, np.array([0.7, 0.5]))
    assert x == [0.7] and y == pytest.approx([0.25, 0.75])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("q=1", "run.planes = 'q=1': must be an axis, x, y, and where"),
        ("z=0.5", "run.planes = 'z=0.5': must be an axis, x, y, and where the plane cuts it, as in y=0.5"),
        ("x=", "must be an axis"),
        ("x=nan", "must be an axis"),
        ("0,0", "must be an axis"),
        ("x=1.5", r"run.planes = 'x=1.5': does not lie in the domain, \[0.0, 0.0\] to \[1.0, 1.0\]"),
        ("0,0:1,2", "does not lie in the domain"),
        ("0.5,0.5:0.5,0.5", "a single point; give it in probes"),
        ("0,0,0:1,1,1", "must be two finite numbers, x and y"),
        ("0,0:1", "must be two finite numbers, x and y"),
        ("x=0.5:0", "must be the distance of its points, a number above zero"),
        ("x=0.5:-1", "must be the distance"),
        ("x=0.5:a", "must be the distance"),
        ("x=0.5:0.1:0.1", "must be the distance"),
        ("x=0.5:1e-300", "more than 200,000 points"),
        ("0,0:1,1:1e-300", "more than 200,000 points"),
        ("x=0.5:8e-6; y=0.5:8e-6", "more than 200,000 points; give those of a plane a larger distance"),
        (5, "planes = 5: must be a text such as"),
        ([[0.5, 0.5]], "must be a text such as"),
    ],
)
def test_what_is_no_plane_is_refused_before_anything_is_written(tmp_path, given, message):
    with pytest.raises(ConfigError, match=message):
        TaylorGreen(resolution=8).run(tmp_path / "run", until=0.02, planes=given, progress=False)
    assert not list(tmp_path.iterdir())


@pytest.fixture(scope="module")
def past_a_cylinder(tmp_path_factory):
    case = Cylinder(resolution=8, length=5, height=4, upstream=2)
    settings = {"until": 0.2, "output_interval": 0.1, "plane_interval": 0.05, "progress": False}
    return case.run(tmp_path_factory.mktemp("planes") / "run", planes="x=3; 1,-1:3,1:0.25", **settings)


def test_planes_are_those_of_snapshots_and_leave_the_body_out(past_a_cylinder):
    line, region = past_a_cylinder.planes
    assert line.place == {"x": 3.0} and line.velocity.shape == (4, 32, 2) and line.pressure.shape == (4, 32)
    assert region.place == {} and region.velocity.shape == (4, 8, 8, 2)
    assert line.axes["y"][[0, -1]] == pytest.approx([-2 + 1 / 16, 2 - 1 / 16])
    assert region.time == pytest.approx([0.05, 0.1, 0.15, 0.2], abs=0.03) and np.array_equal(line.time, region.time)
    snapshot = past_a_cylinder.times[-1]
    assert snapshot == region.time[-1]
    grid = past_a_cylinder.to_grid(spacing=0.25, lower=(1, -1), upper=(3, 1))
    for name in ("velocity", "pressure"):
        found, known = getattr(region, name)[-1], grid.fields[name]
        assert np.array_equal(np.isnan(found), np.isnan(known)) and np.isnan(found).any()
        assert found == pytest.approx(known, abs=0.25, nan_ok=True)
        assert np.nanmean(np.abs(found - known)) < 0.02
    x, y = np.meshgrid(*region.axes.values(), indexing="ij")
    assert np.isnan(region.pressure[-1][np.hypot(x - 2, y) < 0.45]).all()


def test_planes_are_data_sets_of_xarray(past_a_cylinder):
    pytest.importorskip("xarray")
    line, region = (plane.to_xarray() for plane in past_a_cylinder.planes)
    assert dict(line.sizes) == {"time": 4, "y": 32} and float(line.x) == 3.0
    assert region.velocity_y.dims == ("time", "y", "x") and region.pressure.attrs["units"] == "rho U^2"
    cell = region.sel(x=2.875, y=0.625, time=0.2, method="nearest")
    assert float(cell.velocity_x) == past_a_cylinder.planes[1].velocity[-1, 7, 6, 0]


def test_a_file_of_planes_tells_which_point_is_of_which(past_a_cylinder):
    with h5py.File(past_a_cylinder.path / "planes.h5") as file:
        assert file["plane"][:].tolist() == [0] * 32 + [1] * 64 and file["velocity"].shape == (4, 96, 2)
        assert file["position"][0] == pytest.approx([3, -2 + 1 / 16])


def test_a_plane_in_space_has_two_axes(tmp_path):
    case = TaylorGreen(dimensions=3, resolution=8)
    run = case.run(tmp_path / "run", until=0.1, planes=["z=0.3:0.25", "y"], plane_interval=0.05, progress=False)
    first, second = run.planes
    assert first.place == {"z": 0.3} and first.velocity.shape[1:] == (4, 4, 3) and [*second.axes] == ["x", "z"]
    assert second.place == {"y": 0.5} and np.isfinite(second.velocity).all()


def test_planes_of_a_resumed_run_are_those_of_a_whole_one(tmp_path):
    case, settings = TaylorGreen(resolution=10), {"planes": "x=0.3", "plane_interval": 0.03, "progress": False}
    whole = case.run(tmp_path / "whole", until=0.4, **settings)
    case.run(tmp_path / "part", until=0.2, **settings)
    part = alsph.resume(tmp_path / "part", until=0.4, progress=False)
    assert same(whole, part) and len(whole.planes[0].time) > 8


def test_no_record_is_lost_or_doubled_when_a_run_is_killed(tmp_path):
    """Killed once it has written some records: those later than its checkpoint are made again."""
    options = ["--resolution", "16", "--planes", "y=0.25; 0,0:0.5,0.5", "--plane-interval", "0.01"]
    options += ["--checkpoint-minutes", "0.0005", "--threads", "1"]
    command = [sys.executable, "-m", "alsph", "run", "taylor_green", *options]
    subprocess.run([*command, "--until", "1", "--output", tmp_path / "whole"], check=True, capture_output=True)
    process = subprocess.Popen([*command, "--until", "1", "--output", tmp_path / "cut"], stdout=subprocess.DEVNULL)
    while not (tmp_path / "cut" / "planes.h5").exists() and process.poll() is None:
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    before = len(Run(tmp_path / "cut").planes[0].time)
    cut, whole = alsph.resume(tmp_path / "cut", progress=False), Run(tmp_path / "whole")
    assert 0 < before < len(whole.planes[0].time) and same(whole, cut)


def same(whole, part):
    return all(
        np.array_equal(getattr(one, name), getattr(other, name))
        for one, other in zip(whole.planes, part.planes, strict=True)
        for name in ("time", "velocity", "pressure")
    )


def test_planes_are_part_of_the_configuration(alsph, tmp_path):
    options = "--resolution", 8, "--until", 0.1, "--planes", "x=0.5", "--planes", "y", "--plane-interval", 0.05
    code, _, _ = alsph("run", "taylor_green", *options, "--output", tmp_path / "run")
    assert code == 0 and len(Run(tmp_path / "run").planes) == 2
    case = (tmp_path / "run" / "case.toml").read_text()
    assert 'planes = "x=0.5; y"' in case and "plane_interval = 0.05" in case
    (tmp_path / "own.toml").write_text('case = "taylor_green"\nresolution = 8\n[run]\nuntil = 0.1\nplanes = ["x=7"]\n')
    code, _, err = alsph("run", tmp_path / "own.toml", "--output", tmp_path / "other")
    assert code == 2 and "run.planes = 'x=7': does not lie in the domain" in err and len(err.splitlines()) == 1
    case = TaylorGreen()
    assert "plane" not in Config(case).text()
    assert digest(Config(case)) != digest(Config(case, RunSettings(planes="x")))


def test_describe_tells_what_planes_take():
    told = dict(describe(Config(TaylorGreen(resolution=10), RunSettings(planes="x; y", until=2.0)), probe=False))
    assert told["planes"] == "20 points, recorded every 0.5 D/U: about 0.0018 MiB"


def test_a_run_without_planes_has_none_and_force_removes_them(past_a_cylinder, tmp_path):
    case = TaylorGreen(resolution=8)
    case.run(tmp_path / "run", until=0.6, planes="x", progress=False)
    run = case.run(tmp_path / "run", until=0.02, force=True, progress=False)
    assert run.planes == [] and not (run.path / "planes.h5").exists()


def test_planes_before_their_first_record_and_damaged_ones(tmp_path):
    run = TaylorGreen(resolution=8).run(tmp_path / "run", until=0.1, planes="x", plane_interval=5, progress=False)
    assert run.planes[0].velocity.shape == (0, 8, 2)
    (run.path / "planes.h5").write_bytes(b"nothing")
    with pytest.raises(RunFolderError, match="planes.h5"):
        _ = Run(run.path).planes


def test_a_file_of_other_planes_is_told(past_a_cylinder, tmp_path):
    run = Cylinder(resolution=8, length=5, height=4, upstream=2).run(
        tmp_path / "run", until=0.02, planes="x=3", plane_interval=0.01, progress=False
    )
    (run.path / "planes.h5").write_bytes((past_a_cylinder.path / "planes.h5").read_bytes())
    with pytest.raises(RunFolderError, match="its 96 points are not the 32 of the planes in case.toml"):
        _ = Run(run.path).planes


def test_planes_that_were_moved_do_not_take_the_records_of_the_former_ones(tmp_path):
    run = TaylorGreen(resolution=8).run(
        tmp_path / "run", until=0.1, planes="x=0.5", plane_interval=0.05, progress=False
    )
    text = (run.path / "case.toml").read_text()
    (run.path / "case.toml").write_text(text.replace("x=0.5", "x=0.25"))
    with pytest.raises(RunFolderError, match="its 8 points are not the 8 of the planes in case.toml"):
        _ = Run(run.path).planes
