"""Snapshots on grids: files that other programs read back, bodies left out, what cannot be written."""

import os
import sys

import alsph as package
import numpy as np
import pytest
import xarray
from alsph.errors import ConfigError, RunFolderError
from alsph.results.export import PlaneRecord
from alsph.units import Units
from synthetic import SHORT, write_flow
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOHDF import vtkHDFReader
from vtkmodules.vtkIOXML import vtkXMLImageDataReader

SPIN = np.array([0.3, -0.2, 0.5])


@pytest.fixture(scope="module")
def cylinder(tmp_path_factory):
    """A shear flow, u = y and v = 2x, past a cylinder; its pressure is 7 all over."""
    return write_flow(tmp_path_factory.mktemp("runs") / "run", SHORT, lambda x, t: x[:, ::-1] * [1, 2], pressure=7.0)


@pytest.fixture(scope="module")
def turning(tmp_path_factory):
    """A flow in 3-D that turns as a whole, on a path that is no lattice's."""
    case = package.cases.TaylorGreen(dimensions=3, resolution=8)
    return write_flow(tmp_path_factory.mktemp("runs") / "run", case, lambda x, t: np.cross(SPIN, x), (0.0, 1.0))


def read_with_vtk(path):
    """Return points, fields by name and time of an image."""
    reader = vtkXMLImageDataReader() if path.suffix == ".vti" else vtkHDFReader()
    reader.SetFileName(str(path))
    reader.Update()
    image = reader.GetOutput()
    points = np.array([image.GetPoint(index) for index in range(image.GetNumberOfPoints())])
    data = image.GetPointData()
    names = [data.GetArrayName(index) for index in range(data.GetNumberOfArrays())]
    time = vtk_to_numpy(image.GetFieldData().GetArray("TimeValue"))
    return points, {name: vtk_to_numpy(data.GetArray(name)) for name in names}, *time


def test_vtk_reads_an_image_back_and_the_body_is_left_out(cylinder, tmp_path):
    path = cylinder.to_grid(1.2, spacing=0.08).save(tmp_path / "flow.vtkhdf")
    points, fields, time = read_with_vtk(path)
    assert time == 1.0 and set(fields) == {"velocity", "pressure", "vorticity"}
    radius = np.hypot(*(points[:, :2] - [SHORT.upstream, 0]).T)
    nothing = np.isnan(fields["pressure"])
    assert radius[nothing].max() < 0.56 and radius[~nothing].min() > 0.44 and nothing.sum() > 100
    assert np.isnan(fields["velocity"][nothing, :2]).all() and np.isnan(fields["vorticity"][nothing]).all()
    x, y = points[~nothing, :2].T
    assert fields["velocity"][~nothing] == pytest.approx(np.stack([y, 2 * x, 0 * x], axis=1), abs=1e-4)
    assert fields["vorticity"][~nothing] == pytest.approx(1.0, abs=1e-3)
    assert fields["pressure"][~nothing] == pytest.approx(7.0)


def test_an_image_in_3d_has_its_axes_in_order(turning, tmp_path):
    box = {"lower": (0.3, 0.35, 0.4), "upper": (0.7, 0.65, 0.6)}
    grid = turning.to_grid(spacing=0.05, **box)
    assert grid.fields["velocity"].shape == (8, 6, 4, 3) and grid.fields["pressure"].shape == (8, 6, 4)
    points, fields, _ = read_with_vtk(grid.save(tmp_path / "flow.vtkhdf"))
    assert points.min(axis=0) == pytest.approx([0.325, 0.375, 0.425])
    assert fields["velocity"] == pytest.approx(np.cross(SPIN, points), abs=1e-5)
    assert fields["vorticity"] == pytest.approx(np.broadcast_to(2 * SPIN, points.shape), abs=1e-4)
    found = turning.to_xarray(spacing=0.05, **box)
    assert found["vorticity_y"].values == pytest.approx(-0.4, abs=1e-4) and found.sizes == {"z": 4, "y": 6, "x": 8}


def test_all_formats_hold_the_same(cylinder, alsph):
    for to, name in (("vtkhdf", "flow.vtkhdf"), ("vti", "flow.vti"), ("netcdf", "flow.nc"), ("csv", "flow.csv")):
        code, out, _ = alsph("export", cylinder.path, "--to", to, "--spacing", 0.2)
        assert code == 0 and out.strip() == str(cylinder.path / name)
    points, fields, _ = read_with_vtk(cylinder.path / "flow.vtkhdf")
    with xarray.open_dataset(cylinder.path / "flow.nc") as found:
        assert found["velocity_y"].values.ravel() == pytest.approx(fields["velocity"][:, 1], nan_ok=True, abs=1e-5)
        assert found.attrs["time"] == 2.0 and found["pressure"].attrs["units"] == "rho U^2"
    rows = np.genfromtxt(cylinder.path / "flow.csv", delimiter=",", names=True)
    rows = rows[np.lexsort((rows["x"], rows["y"]))]
    assert rows["x"] == pytest.approx(points[:, 0]) and rows["y"] == pytest.approx(points[:, 1])
    assert rows["velocity_x"] == pytest.approx(fields["velocity"][:, 0], nan_ok=True, abs=1e-5)


@pytest.mark.parametrize("run", ["cylinder", "turning"])
def test_images_of_xml_are_those_of_hdf(run, request, tmp_path):
    grid = request.getfixturevalue(run).to_grid(spacing=0.1)
    points, fields, time = read_with_vtk(grid.save(tmp_path / "flow.vtkhdf"))
    again, values, same = read_with_vtk(grid.save(tmp_path / "flow.vti"))
    np.testing.assert_allclose(again, points, atol=1e-12)
    assert same == time and set(values) == set(fields)
    for name, field in fields.items():
        np.testing.assert_array_equal(values[name], field)


def test_force_removes_what_was_exported(cylinder, tmp_path):
    case = package.cases.TaylorGreen(resolution=8)
    run = case.run(tmp_path / "run", until=0.02, progress=False)
    run.to_grid().save(run.path / "flow.nc")
    case.run(run.path, until=0.02, progress=False, force=True)
    assert not (run.path / "flow.nc").exists()


def test_what_cannot_be_exported_is_refused_and_nothing_is_written(cylinder, alsph, tmp_path):
    for options, words in (
        (("--to", "vtu"), "to = 'vtu': unknown; did you mean 'vti'?"),
        (("--output", tmp_path / "flow.vtu"), "ends in .vtkhdf, .vti, .nc, .csv"),
        (("--to", "csv", "--output", tmp_path / "flow.nc"), "in the format csv ends in .csv"),
        (("--spacing", "0"), "spacing = 0.0: must be a number above zero"),
        (("--spacing", "1e-6"), "more than 20,000,000 points"),
    ):
        code, _, err = alsph("export", cylinder.path, *options)
        assert code == 2 and words in err and len(err.splitlines()) == 1
    own = cylinder.path / "output_front.csv"
    own.write_text("time,front\n")
    code, _, err = alsph("export", cylinder.path, "--to", "csv", "--output", own)
    assert code == 2 and "a file of the run itself" in err and own.read_text() == "time,front\n"
    own.unlink()
    os.symlink(tmp_path / "elsewhere", tmp_path / "link.csv")
    with pytest.raises(RunFolderError, match="link"):
        cylinder.to_grid(spacing=0.5).save(tmp_path / "link.csv")
    assert [path.name for path in tmp_path.iterdir()] == ["link.csv"]


def test_particles_for_pyvista(cylinder):
    pytest.importorskip("pyvista")
    cloud, snapshot = cylinder.to_pyvista(0.0), cylinder.snapshot(0.0)
    assert np.allclose(cloud.points[:, :2], snapshot.position) and cloud.n_points == len(snapshot.position)
    assert np.allclose(cloud["velocity"][:, 1], snapshot.velocity[:, 1]) and cloud.field_data["time"][0] == 0.0


def test_without_a_library_its_extra_is_named(cylinder, monkeypatch, tmp_path):
    for name in ("pyvista", "xarray"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ConfigError, match=r"needs pyvista: pip install 'alsph\[3d\]'"):
        cylinder.to_pyvista()
    with pytest.raises(ConfigError, match=r"needs xarray: pip install 'alsph\[tables\]'"):
        cylinder.to_grid(spacing=0.5).save(tmp_path / "flow.nc")
    assert not list(tmp_path.iterdir())


def test_grids_in_si_are_those_in_d_and_u_times_the_factors(tmp_path, alsph):
    units = Units(length=0.02, velocity=0.01, density=1000.0, kinematic_viscosity=1e-6)
    case = SHORT.replace(units=units, reynolds=units.reynolds)
    run = write_flow(tmp_path / "run", case, lambda x, t: x[:, ::-1] * [1, 2], pressure=7.0)
    plain = run.to_grid(derived=["q_criterion"])
    grid = plain.in_si(run.units)
    factors = {"velocity": 0.01, "pressure": 0.1, "vorticity": 0.5, "q_criterion": 0.25}
    for name, factor in factors.items():
        np.testing.assert_allclose(grid.fields[name], plain.fields[name] * factor)
    assert grid.time == pytest.approx(plain.time * 2) and grid.axes["x"] == pytest.approx(plain.axes["x"] * 0.02)
    told = grid.to_xarray()
    assert {name: told[name].units for name in ("x", "velocity_x", "pressure", "vorticity", "q_criterion")} == {
        "x": "m",
        "velocity_x": "m/s",
        "pressure": "Pa",
        "vorticity": "1/s",
        "q_criterion": "1/s^2",
    }
    assert (told.time_units, plain.to_xarray().pressure.units) == ("s", "rho U^2")
    code, _, stderr = alsph("export", run.path, "--si", "--to", "csv")
    assert code == 0, stderr
    rows = np.genfromtxt(run.path / "flow_si.csv", delimiter=",", names=True)
    assert rows["x"].max() == pytest.approx(plain.axes["x"].max() * 0.02)
    assert np.nanmax(rows["pressure"]) == pytest.approx(np.nanmax(plain.fields["pressure"]) * 0.1)


def test_a_plane_record_in_si():
    units = Units(length=2.0, velocity=3.0, density=5.0, kinematic_viscosity=1.0)
    found = PlaneRecord(np.ones(2), {"x": np.ones(3)}, {"y": 1.0}, np.ones((2, 3, 2)), np.ones((2, 3))).in_si(units)
    assert (found.time == 2 / 3).all() and (found.axes["x"] == 2).all() and found.place == {"y": 2.0}
    assert (found.velocity == 3).all() and (found.pressure == 45).all()
    assert found.to_xarray().velocity_y.units == "m/s"


def test_a_run_without_units_is_not_exported_in_si(cylinder, alsph):
    code, _, stderr = alsph("export", cylinder.path, "--si")
    assert code == 2 and "does not know its units" in stderr


def test_figures_of_a_run_with_units_say_what_they_are(tmp_path):
    units = Units(length=0.02, velocity=0.01, density=1000.0, kinematic_viscosity=1e-6)
    case = SHORT.replace(units=units, reynolds=units.reynolds)
    run = write_flow(tmp_path / "run", case, lambda x, t: x[:, ::-1] * [1, 2], pressure=7.0)
    said = run.plot_field("pressure").get_supxlabel().replace("\n", " ")
    assert said.endswith("D = 0.02 m, U = 0.01 m/s, D/U = 2 s, ρU² = 0.1 Pa")


def test_what_is_in_si_is_not_scaled_again_and_the_runs_own_files_stay(cylinder, alsph):
    units = Units(length=2.0, velocity=3.0, density=5.0, kinematic_viscosity=1.0)
    grid = cylinder.to_grid().in_si(units)
    with pytest.raises(ConfigError, match="in SI already"):
        grid.in_si(units)
    with pytest.raises(ConfigError, match="a run that was given none has none"):
        cylinder.to_grid().in_si(cylinder.units)
    own = cylinder.path / "particles.vtkhdf"
    before = own.read_bytes()
    code, _, stderr = alsph("export", cylinder.path, "-o", own)
    assert code == 2 and "a file of the run itself" in stderr and own.read_bytes() == before
    made = cylinder.path.parent / "made" / "of_it" / "flow.csv"  # as figures and films do
    code, _, stderr = alsph("export", cylinder.path, "--spacing", 1, "-o", made)
    assert code == 0 and made.is_file(), stderr
    code, _, stderr = alsph("export", cylinder.path, "--spacing", 1, "-o", "/proc/x.csv")
    assert code == 2 and "/proc/x.csv" in stderr and ".new" not in stderr
