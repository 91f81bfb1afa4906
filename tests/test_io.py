import errno
import json
import os
import shutil

import h5py
import numpy as np
import pytest
from alsph import config
from alsph.cases import Cylinder
from alsph.config import Config, RunSettings
from alsph.errors import RunFolderError
from alsph.folder import vtkhdf
from alsph.folder.history import flatten
from alsph.folder.run_folder import RunFolder
from alsph.geometry.surface import circle
from alsph.running.outputs import SurfacePressure
from synthetic import append_surface
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkIOHDF import vtkHDFReader


def particles(count, dimensions=2, seed=0):
    rng = np.random.default_rng(seed)
    return {
        "position": rng.random((count, dimensions)),
        "velocity": rng.random((count, dimensions)),
        "pressure": rng.random(count),
        "velocity_divergence": rng.random(count),
        "vorticity": rng.random(count if dimensions == 2 else (count, 3)),
        "kind": rng.integers(0, 4, count).astype(np.uint8),
        "body": np.zeros(count, np.uint16),
        "id": rng.permutation(count).astype(np.uint64),
    }


@pytest.fixture
def folder(tmp_path, small):
    folder = RunFolder(tmp_path / "run")
    folder.create(Config(small))
    return folder


def read_with_vtk(path):
    """Return the times in the file and a function that reads the particles at one of them."""
    reader = vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS())

    def read(time):
        reader.UpdateTimeStep(time)
        return reader.GetOutput()

    return times, read


@pytest.mark.parametrize("dimensions", [2, 3])
def test_vtk_reads_the_particles_back(folder, dimensions):
    outputs = {0.5 * k: particles(count, dimensions, k) for k, count in enumerate((5, 7, 4))}
    for time, output in outputs.items():
        folder.append_particles(time, output)
    times, read = read_with_vtk(folder.path / "particles.vtkhdf")
    assert times == tuple(outputs)
    for time, output in outputs.items():
        data = read(time)
        count = len(output["kind"])
        assert data.GetNumberOfPoints() == data.GetNumberOfVerts() == data.GetNumberOfCells() == count
        assert [data.GetCell(i).GetPointId(0) for i in range(count)] == list(range(count))
        assert vtk_to_numpy(data.GetPoints().GetData())[:, :dimensions] == pytest.approx(output["position"], abs=1e-6)
        assert data.GetPointData().GetNumberOfArrays() == len(vtkhdf.FIELDS)
        for name in vtkhdf.FIELDS:
            stored = vtk_to_numpy(data.GetPointData().GetArray(name))
            if name == "velocity":
                assert stored.shape == (count, 3)
                stored = stored[:, :dimensions]
            assert stored == pytest.approx(output[name], abs=1e-6)


def test_outputs_later_than_the_checkpoint_are_replaced(folder):
    path = folder.path / "particles.vtkhdf"
    for time in (0.0, 1.0, 2.0):
        folder.append_particles(time, particles(6, seed=int(time)))
    folder.truncate(step=1, time=1.0)
    assert read_with_vtk(path)[0] == (0.0, 1.0)
    folder.append_particles(2.5, particles(3, seed=9))
    times, read = read_with_vtk(path)
    assert times == (0.0, 1.0, 2.5)
    assert vtk_to_numpy(read(2.5).GetPointData().GetArray("id")).tolist() == particles(3, seed=9)["id"].tolist()
    assert read(1.0).GetNumberOfPoints() == 6


def test_file_type_is_as_paraview_expects(folder):
    folder.append_particles(0.0, particles(2))
    with h5py.File(folder.path / "particles.vtkhdf") as file:
        kind = file["VTKHDF"].attrs.get_id("Type")
        assert kind.dtype == np.dtype("S8")
        assert file["VTKHDF"].attrs["Version"].tolist() == [2, 0]


def test_checkpoint_round_trip_to_the_last_bit(folder):
    state = {name: value for name, value in particles(9).items() if name not in ("vorticity", "velocity_divergence")}
    state |= {"time": 1 / 3, "step": 12, "mass_in": 0.1}
    folder.write_checkpoint(state, {"case": "cylinder"})
    found = folder.read_checkpoint()
    read = found.state
    assert (found.case, found.warning) == ({"case": "cylinder"}, "")
    assert read.keys() == state.keys()
    for name, value in state.items():
        assert np.array_equal(read[name], value)
        assert np.asarray(read[name]).dtype == np.asarray(value).dtype


def test_history_columns():
    force = np.arange(8.0).reshape(2, 2, 2)
    rows = {"step": np.array([1, 2]), "pressure_force": force, "pressure_torque": force[:, :, :1]}
    columns = flatten(rows, ["a", "b"])
    assert list(columns) == [
        "step",
        *("a_pressure_force_x", "a_pressure_force_y", "b_pressure_force_x", "b_pressure_force_y"),
        *("a_pressure_torque", "b_pressure_torque"),
    ]
    assert columns["b_pressure_force_y"].tolist() == [3.0, 7.0]


def test_history_and_samples_are_cut_at_the_checkpoint(folder):
    for step in (1, 2, 3):
        folder.append_history({"step": np.array([step]), "time": np.array([0.1 * step])}, [])
        append_surface(folder, 0.1 * step, {"angle": np.array([0.0, 90.0])}, [1.0, -step])
    with (folder.path / "history.csv").open("a") as file:
        file.write("4,")
    folder.truncate(2, 0.2, [SurfacePressure(circle(0.5, 72), 0.1, Cylinder(resolution=8))])
    assert (folder.path / "history.csv").read_text() == "step,time\n1,0.1\n2,0.2\n"
    with h5py.File(folder.path / "surface.h5") as file:
        assert file["time"][:] == pytest.approx([0.1, 0.2])
        assert file["pressure_coefficient"][:].tolist() == [[1.0, -1.0], [1.0, -2.0]]
        assert file["angle"][:].tolist() == [0.0, 90.0]


def test_full_disk_is_noticed_before_a_file_is_touched(folder, monkeypatch):
    folder.append_particles(0.0, particles(5))
    usage = shutil.disk_usage(folder.path)._replace(free=1000)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage)
    with pytest.raises(RunFolderError, match="disk full, .* MiB are free and .* MiB are needed"):
        folder.append_particles(1.0, particles(5))
    with h5py.File(folder.path / "particles.vtkhdf") as file:
        assert file["VTKHDF/Steps/Values"][:].tolist() == [0.0]


def test_a_write_that_fails_leaves_the_old_file(folder, monkeypatch):
    folder.write_info({"status": "running"})

    def fail(*_args, **_kwargs):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(json, "dumps", fail)
    with pytest.raises(RunFolderError, match="No space left"):
        folder.write_info({"status": "finished"})
    monkeypatch.undo()
    assert folder.info() == {"status": "running"}
    assert sorted(path.name for path in folder.path.iterdir()) == ["case.toml", "run.json"]


def test_existing_folders(tmp_path, folder):
    with pytest.raises(RunFolderError, match="exists already; give another folder$"):
        folder.check_new(force=False)
    with pytest.raises(RunFolderError, match="not a run folder, so --force does not replace it"):
        folder.check_new(force=True)
    folder.write_info({"status": "finished"})
    with pytest.raises(RunFolderError, match="exists already; give another folder, .*--force"):
        folder.check_new(force=False)
    folder.check_new(force=True)
    (tmp_path / "file").write_text("")
    with pytest.raises(RunFolderError, match="not a folder that can be written to"):
        RunFolder(tmp_path / "file" / "run").check_new(force=False)


def test_read_only_place(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(RunFolderError, match="cannot be created"):
        RunFolder(tmp_path / "run").check_new(force=False)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("case.toml", None, "has no case.toml"),
        ("case.toml", 'case = "cylinder"\nfuture = 1\n', "damaged or was made by another version"),
        ("checkpoint.h5", None, "it has no checkpoint.h5"),
        ("checkpoint.h5", "text", "not a checkpoint, or damaged"),
    ],
)
def test_foreign_and_damaged_folders(folder, name, content, message):
    path = folder.path / name
    path.unlink(missing_ok=True)
    if content:
        path.write_text(content)
    with pytest.raises(RunFolderError, match=message):
        config.of_run(folder.path)
        folder.read_checkpoint()


def test_resolved_configuration_names_the_end(folder):
    assert config.of_run(folder.path).run == RunSettings(until=60.0)
