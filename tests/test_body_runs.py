"""The outline of a body is part of its case: a run folder needs nothing else, and no run goes on with another one."""

import hashlib
import json
import os
import tomllib

import pytest
from alsph import config, study
from alsph.cases import Body, Cylinder
from alsph.config import Config
from alsph.errors import ConfigError, RunFolderError
from alsph.folder.checkpoint import read as read_checkpoint
from alsph.folder.checkpoint import write as write_checkpoint
from alsph.results.run import Run
from alsph.running.start import resume
from alsph.study import Study, Sweep

SQUARE = "-0.5 -0.5\n0.5 -0.5\n0.5 0.5\n-0.5 0.5\n"
WEDGE = "0 0\n1 0.5\n1 -0.5\n"
CHANNEL = {"resolution": 8, "length": 5.0, "height": 4.0, "upstream": 2.0, "perturbation": 0.0}
OPTIONS = [f"--{name}={value}" for name, value in CHANNEL.items()]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Return a folder with the files square.txt and wedge.txt that is gone to."""
    folder = tmp_path / "here"
    folder.mkdir()
    (folder / "square.txt").write_text(SQUARE)
    (folder / "wedge.txt").write_text(WEDGE)
    monkeypatch.chdir(folder)
    return folder


def test_a_run_folder_needs_no_file_beside_it(folder, tmp_path, monkeypatch, alsph):
    assert alsph("run", "body", "--shape=square.txt", *OPTIONS, "--until=0.1", "-o", "run")[0] == 0
    (tmp_path / "away").mkdir()
    moved = (folder / "run").rename(tmp_path / "away" / "run")
    (folder / "square.txt").write_text(WEDGE)
    monkeypatch.chdir(tmp_path)
    assert "outline: square.txt: a body of 4 points" in (moved / "run.log").read_text()
    held = tomllib.loads((moved / "case.toml").read_text())["shape"]
    assert held["file"] == "square.txt" and held["points"] == SQUARE
    assert held["sha256"] == hashlib.sha256(SQUARE.encode()).hexdigest()
    for command in (["info"], ["plot", "--field=pressure"], ["resume", "--until=0.2"], ["repeat"], ["info"]):
        code, output, error = alsph(command[0], moved, *command[1:])
        assert code == 0, error
    assert Run(moved).history["time"][-1] >= 0.2
    assert Run(moved).config.case.outline.area == pytest.approx(1)


@pytest.mark.parametrize("changes", [{"shape": "wedge.txt"}, {"angle_of_attack": 20.0}, {"shape": "naca0012"}])
def test_no_run_goes_on_with_another_body(folder, changes):
    case = Body(shape="square.txt", **CHANNEL)
    run = case.run("run", until=0.1, progress=False)
    Config(case.replace(**changes), run.config.run).save(run.path / "case.toml")
    (name,) = changes
    with pytest.raises(RunFolderError, match=rf"changed in what the particles were made for \({name}\)"):
        resume("run", until=0.2, progress=False)


def test_points_that_were_changed_in_a_run_folder_are_noticed(folder, alsph):
    run = Body(shape="square.txt", **CHANNEL).run("run", until=0.05, progress=False)
    path = run.path / "case.toml"
    path.write_text(path.read_text().replace("0.5 0.5\n-0.5", "0.6 0.5\n-0.5"))
    code, _, error = alsph("info", "run")
    assert code == 2 and "not those that their sha256 is of" in error and len(error) < 500


def test_a_case_with_another_shape_has_its_outline(folder):
    case = Body(shape="square.txt", **CHANNEL)
    assert case.replace(shape="wedge.txt").outline.area == pytest.approx(0.5)
    assert case.replace(shape="naca0012") == Body(shape="naca0012", **CHANNEL)
    os.remove("square.txt")
    finer = case.replace(resolution=10)
    assert finer.shape == case.shape and finer.outline.equals(case.outline)
    assert config.from_tables(json.loads(json.dumps(Config(case).tables()))).case == case


def test_a_path_in_a_file_is_relative_to_that_file(folder, tmp_path, monkeypatch, alsph):
    (folder / "case.toml").write_text(
        'case = "body"\nshape = "wedge.txt"\nlength = 5.0\nheight = 4.0\nupstream = 2.0\n'
    )
    (folder / "study.toml").write_text(
        'name = "wedges"\n[base]\ncase = "body"\nshape = "wedge.txt"\n[sweep.product]\n'
        'shape = ["wedge.txt", "square.txt"]'
    )
    monkeypatch.chdir(tmp_path)
    (tmp_path / "wedge.txt").write_text(SQUARE)
    assert config.load("here/case.toml").case.outline.area == pytest.approx(0.5)
    wedge, square = study.load("here/study.toml").points()
    assert (wedge.config.case.outline.area, square.config.case.outline.area) == pytest.approx((0.5, 1))
    assert wedge.label == "shape wedge.txt"
    assert "wedge.txt: a body of 3 points" in alsph("describe", "here/case.toml", "--no-probe")[1]
    other = alsph("describe", "here/case.toml", "--no-probe", "--shape=wedge.txt")[1]
    assert "wedge.txt: a body of 4 points" in other


def test_a_study_makes_another_run_of_an_edited_file(folder, tmp_path):
    def point():
        base = {"case": "body", "shape": str(folder / "foil.txt"), **CHANNEL}
        (point,) = Study(name="edited", base=base, sweep=Sweep(sets=[{"reynolds": 50}])).points()
        return point.name

    (folder / "foil.txt").write_text(SQUARE)
    square = point()
    (folder / "foil.txt").write_text(WEDGE)
    assert point() != square
    (folder / "foil.txt").write_text("a title, and other digits\n" + SQUARE.replace("0.5", "0.500"))
    assert point() == square


def old_run(folder):
    """Make a run folder as alsph made them when they had the path of the outline only."""
    run = Body(shape="square.txt", **CHANNEL).run("run", until=0.1, progress=False)
    Config(Body(**CHANNEL), run.config.run).save(run.path / "case.toml")
    text = (run.path / "case.toml").read_text().replace('"square_cylinder"', '"square.txt"')
    (run.path / "case.toml").write_text(text)
    saved = read_checkpoint(run.path / "checkpoint.h5")
    previous = run.path / "checkpoint.previous.h5"
    write_checkpoint(run.path / "checkpoint.h5", previous, saved.state, saved.case | {"shape": "square.txt"})
    previous.unlink()
    return folder / "run"


def test_a_run_folder_of_old_opens_where_its_outline_is(folder, tmp_path, monkeypatch, alsph):
    path = old_run(folder)
    assert alsph("info", "run")[0] == 0
    monkeypatch.chdir(tmp_path)
    code, _, error = alsph("info", path)
    assert code == 2 and "square.txt': no such file" in error and "go to where it was run" in error
    (path / "square.txt").write_text(SQUARE)
    assert alsph("info", path)[0] == 0
    resume(path, until=0.2, progress=False)
    (path / "square.txt").unlink()
    assert Run(path).config.case.outline.area == pytest.approx(1)


@pytest.mark.parametrize("shape", ["/dev/zero", "/dev", "square.txt"])
def test_a_hostile_run_folder_ends_in_one_line(shape, folder, small, alsph):
    run = Cylinder(**CHANNEL).run("run", until=0.05, progress=False)
    Config(Body(**CHANNEL), run.config.run).save(run.path / "case.toml")
    (folder / "square.txt").unlink()
    os.mkfifo("square.txt")
    text = (run.path / "case.toml").read_text().replace('"square_cylinder"', f'"{shape}"')
    (run.path / "case.toml").write_text(text)
    code, _, error = alsph("info", "run")
    assert code == 2 and "a folder, a device or a pipe" in error and len(error.strip().splitlines()) == 1


def test_the_message_of_an_unknown_shape_names_what_there_is():
    with pytest.raises(
        ConfigError,
        match="shape = 'wedge.dat': no such file; shapes by name are square_cylinder and NACA airfoils",
    ):
        Body(shape="wedge.dat")


def test_names_that_no_file_can_have_are_refused_in_a_file_too(tmp_path):
    path = tmp_path / "case.toml"
    for name in (3000 * "a", "no\\u0000file", "a/b/c", "\\u001b[31m"):
        path.write_text(f'case = "body"\nshape = "{name}"\n')
        with pytest.raises(ConfigError, match="neither square_cylinder nor a NACA airfoil"):
            config.load(path)
