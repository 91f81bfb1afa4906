"""Runs beside each other: what differs, the ± of differences, figures, and what cannot be compared."""

import math
import shutil

import alsph as package
import numpy as np
import pytest
from alsph.analysis.averages import Estimate
from alsph.analysis.measures import Profile
from alsph.analysis.window import DEVELOPING
from alsph.config import Config
from alsph.errors import ConfigError, RunFolderError
from alsph.folder.run_folder import RunFolder
from alsph.plotting import profile
from alsph.study.comparison import _difference, _told, compare
from synthetic import SHORT, history, write_flow, write_run

DRAG = "mean drag coefficient"


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Two runs of the same signals at two Reynolds numbers, the second longer."""
    place = tmp_path_factory.mktemp("runs")
    return [write_run(place / "a", end=40.0), write_run(place / "b", SHORT.replace(reynolds=100), end=50.0)]


@pytest.fixture(scope="module")
def vortices(tmp_path_factory):
    case = package.cases.TaylorGreen(resolution=8)
    return write_flow(tmp_path_factory.mktemp("runs") / "vortices", case, lambda x, t: np.zeros_like(x)).path


@pytest.fixture
def begun(tmp_path):
    """A run folder without a step."""
    folder = RunFolder(tmp_path / "begun")
    folder.create(Config(SHORT))
    folder.announce(Config(SHORT))
    return folder.path


def test_only_what_differs_is_told_of_the_parameters(folders):
    found = compare(folders)
    assert found.parameters == {"reynolds": ["200", "100"], "run.until": ["40", "50"]}
    assert list(found.runs) == ["a", "b"]
    assert "All parameters are the same" in str(compare([folders[0], shutil.copytree(folders[0], folders[0] / "c")]))
    shutil.rmtree(folders[0] / "c")


def test_results_are_those_of_info_and_differences_carry_both_uncertainties(folders):
    found = compare(folders)
    first, second = (run.drag.mean for run in found.runs.values())
    assert found.results[DRAG] == [first, second] and str(first) in str(found)
    (difference,) = found.differences[DRAG]
    assert difference == second - first
    assert difference.uncertainty == pytest.approx(math.hypot(first.uncertainty, second.uncertainty))
    reference = found.results[f"{DRAG}, reference"] if f"{DRAG}, reference" in found.results else None
    assert reference is None  # this channel is not that of the reference
    assert "status" not in found.differences and f"{DRAG}, pressure part" in found.differences


@pytest.mark.parametrize(
    ("value", "first", "words"),
    [
        (Estimate(1.5, 0.03), Estimate(1.4, 0.04), "0.100 ± 0.050: 2 times ±"),
        (Estimate(1.43, 0.03), Estimate(1.4, 0.04), "0.030 ± 0.050: within ±"),
        (Estimate(1.5, 0.03, DEVELOPING), Estimate(1.4, 0.04), "0.100 ± 0.050 (still developing): 2 times ±"),
        (Estimate(1.5, math.inf), Estimate(1.4, 0.04), "0.1 ± unknown"),
        (1.5, 1.25, "0.25"),
        (1.5, None, ""),
        (Estimate(math.nan, note="why"), Estimate(1.4, 0.04), ""),
    ],
)
def test_whether_a_difference_is_larger_than_its_uncertainty(value, first, words):
    assert _told(_difference(value, first)) == words


def test_figures_and_table_are_saved(folders, tmp_path):
    found = compare(folders)
    paths = found.save(tmp_path / "out")
    assert {path.name for path in paths} >= {"comparison.md", "forces.png", "spectrum.png"}
    assert all(path.stat().st_size > 1000 for path in paths)
    assert "![forces](forces.png)" in paths[0].read_text()
    upper, _ = found.draw()["forces"].axes
    drawn = [line for line in upper.lines if not line.get_label().startswith("_")]
    assert [line.get_label()[0] for line in drawn] == ["a", "b"]
    for line, run in zip(drawn, found.runs.values(), strict=True):
        assert (line.get_ydata() == run.coefficient("x")).all()


def test_the_legend_of_the_forces_lies_clear_of_the_title(folders):
    figure = compare(folders).draw()["forces"]
    figure.canvas.draw()
    legend, title = figure.axes[0].get_legend().get_window_extent(), figure._suptitle.get_window_extent()
    assert not figure.legends and not legend.overlaps(title)
    assert legend.y0 >= figure.axes[0].get_window_extent().y1


def test_each_reference_is_drawn_once():
    line = np.linspace(0, 1, 5)
    one, other = ((line, line), (line, line**2))
    same = {name: Profile("u", ("x", "y"), one, other, "book") for name in "ab"}
    assert [each.get_label() for each in profile(same).axes[0].lines] == ["a", "b", "reference: book"]
    apart = same | {"c": Profile("u", ("x", "y"), one, one, "book")}
    labels = [each.get_label() for each in profile(apart).axes[0].lines]
    assert labels == ["a", "b", "c", "reference of a: book", "reference of c: book"]


def test_what_cannot_be_compared_is_said(folders, vortices, begun):
    with pytest.raises(ConfigError, match="two run folders or more"):
        compare(folders[:1])
    with pytest.raises(ConfigError, match="two run folders or more"):
        compare(str(folders[0]))
    with pytest.raises(ConfigError, match="given twice"):
        compare([*folders, folders[0] / ".." / "a"])
    with pytest.raises(RunFolderError, match="no such run folder"):
        compare([folders[0], folders[0] / "nowhere"])
    with pytest.raises(RunFolderError, match="no steps recorded yet"):
        compare([begun, shutil.copytree(begun, begun.parent / "other")])
    found = compare([folders[0], vortices])
    assert "different cases, cylinder and taylor_green: they share no measure" in str(found)
    assert found.results[DRAG][1] is None and found.parameters["height"] == ["8", None]


def test_a_run_that_has_not_begun_stands_beside_one_that_has(folders, begun, tmp_path):
    found = compare([begun, folders[0]])
    text = str(found)
    assert "begun: no steps recorded yet, nothing to compare" in text and "(begun): no steps recorded yet" in text
    assert len(found.draw()["forces"].axes[0].lines) == 2  # the other's coefficient and its mean
    assert found.save(tmp_path / "out")


def test_folders_of_one_name_are_told_apart(folders, tmp_path):
    other = shutil.copytree(folders[0], tmp_path / "a")
    assert list(compare([folders[0], other]).runs) == [f"{path.parent.name}/a" for path in (folders[0], other)]


def test_odd_names_do_no_harm(folders, tmp_path):
    other = shutil.copytree(folders[0], tmp_path / "$x^{\x1b[2J|")
    found = compare([folders[0], other])
    assert "\x1b" not in str(found) and r"\|" in str(found)
    assert found.save(tmp_path / "out")


def test_the_command_line_compares(alsph, folders, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, _ = alsph("compare", *folders)
    assert code == 0 and "| reynolds" in out and "b - a" in out
    assert (tmp_path / "runs" / "comparison" / "a_b" / "forces.png").is_file()
    code, _, err = alsph("compare", folders[0], folders[0])
    assert code == 2 and "given twice" in err and len(err.splitlines()) == 1
    code, out, _ = alsph("compare", *folders, "--output", tmp_path / "out")
    assert str(tmp_path / "out" / "comparison.md") in out


def test_bodies_of_as_many_points_are_told_apart(tmp_path):
    paths = []
    for width in (1.0, 1.2):
        square = 0.5 * np.array([[-width, -1], [width, -1], [width, 1], [-width, 1]])
        case = package.cases.Body(shape=square, resolution=8, length=6, height=6, upstream=3)
        paths.append(write_flow(tmp_path / str(width), case, lambda position, time: 0 * position).path)
        RunFolder(paths[-1]).append_history(history(end=0.1), case.coefficient_bodies)
    (row,) = compare(paths).parameters.values()
    assert all("a body of 4 points, SHA-256 " in cell for cell in row) and row[0] != row[1]
