"""An output that a case outside the package adds: written, cut and resumed, replaced, and refused."""

import csv

import numpy as np
import pytest
from alsph import cases, resume
from alsph.analysis import sampling
from alsph.cases import TaylorGreen
from alsph.errors import ConfigError, RunFolderError
from alsph.folder.durable import replacing


class Gauge:
    """The pressure at a point."""

    file = "output_gauge.csv"
    interval = 0.01

    def __init__(self, point):
        self.point, self.rows = point, []

    def record(self, simulation, rows):
        """Keep time and pressure."""
        pressure = simulation.sample([self.point])["pressure"][0]
        self.rows.append((simulation.time, pressure))
        assert rows["time"][-1] == simulation.time

    def append(self, path):
        """Append what has been kept."""
        with path.open("a", newline="") as file:
            csv.writer(file).writerows(self.rows)
        self.rows = []

    def truncate(self, path, time):
        """Drop later rows."""
        rows = [row for row in path.read_text().splitlines(True) if row.endswith("\n")]
        with replacing(path) as new:
            new.write_text("".join(row for row in rows if float(row.split(",")[0]) <= time))


class Gauged(TaylorGreen):
    """Vortices with a gauge."""

    name = "gauged"
    title = "vortices with a gauge"

    def outputs(self):
        """Return the gauge."""
        return [Gauge([0.25, 0.25])]


@pytest.fixture
def case(monkeypatch):
    """Return a case that is known by its name."""
    monkeypatch.setitem(cases.CASES, "gauged", Gauged)
    return Gauged(resolution=16)


def test_a_cut_run_leaves_the_output_of_a_whole_one(case, tmp_path):
    whole = case.run(tmp_path / "whole", until=0.2, threads=1, progress=False)
    case.run(tmp_path / "cut", until=0.09, threads=1, progress=False)
    late = tmp_path / "cut" / "output_gauge.csv"
    with late.open("a") as file:
        file.write("0.15,7.0\n0")  # later than the checkpoint, and torn
    resume(tmp_path / "cut", until=0.2, progress=False)
    rows = (whole.path / "output_gauge.csv").read_text()
    assert late.read_text() == rows
    times, pressure = np.loadtxt(rows.splitlines(), delimiter=",").T
    assert (np.diff(times) > 0).all() and len(times) >= 5
    last = whole.snapshot(times[-1])
    assert last.time == pytest.approx(times[-1])
    again, _ = sampling.interpolate(
        last.position, last.pressure[:, None], np.array([[0.25, 0.25]]), case.particle_spacing
    )
    assert pressure[-1] == pytest.approx(again.item(), abs=0.02)


def test_a_folder_that_is_replaced_keeps_no_old_output(case, tmp_path):
    case.run(tmp_path / "run", until=0.05, progress=False)
    (tmp_path / "run" / "output_film.mp4").write_text("the user's own")
    TaylorGreen(resolution=8).run(tmp_path / "run", until=0.02, force=True, progress=False)
    assert not (tmp_path / "run" / "output_gauge.csv").exists()
    assert (tmp_path / "run" / "output_film.mp4").exists()


def test_what_fails_in_an_output_is_told_with_its_name(case, tmp_path, monkeypatch):
    monkeypatch.setattr(Gauge, "append", lambda self, path: path.write_text(3))
    with pytest.raises(RunFolderError, match="output output_gauge.csv: TypeError"):
        case.run(tmp_path / "run", until=0.02, progress=False)


def test_two_outputs_of_a_file_are_refused(case, tmp_path, monkeypatch):
    monkeypatch.setattr(Gauged, "outputs", lambda self: [Gauge([0.2, 0.2]), Gauge([0.3, 0.3])])
    with pytest.raises(ConfigError, match="2 outputs have the file output_gauge.csv"):
        case.run(tmp_path / "run", until=0.02, progress=False)


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("file", "gauge.csv", "output_NAME"),
        ("interval", 0.0, "above zero"),
        ("interval", "0.1", "above zero"),
        ("file", 3, "output_NAME"),
    ],
)
def test_an_output_that_cannot_be_is_refused_before_anything_is_written(case, tmp_path, monkeypatch, name, value, text):
    monkeypatch.setattr(Gauge, name, value)
    with pytest.raises(ConfigError, match=text):
        case.run(tmp_path / "run", until=0.02, progress=False)
    assert not (tmp_path / "run").exists()
