"""Schemes of a case beside each other: which parameters each gets, tables and figures, runs used again, breakdowns."""

import json
import math
import shutil

import alsph as package
import pytest
from alsph.cases import Cylinder, Sphere, TaylorGreen
from alsph.cases.method import SCHEMES
from alsph.config import Config, RunSettings
from alsph.errors import ConfigError
from alsph.results.run import Run
from alsph.study.comparison import CPU
from alsph.study.schemes import _declared, compare_schemes

VORTICES = TaylorGreen(reynolds=50, resolution=8)
SHORT = {"until": 0.1, "output_interval": 0.05}
RATE = "decay rate of the kinetic energy, U/D"


def configs(case, schemes=SCHEMES, resolutions=(), **parameters):
    """Return the cases that would be run, by scheme."""
    points = _declared(Config(case).tables(), schemes, resolutions, parameters).points()
    return {point.config.case.scheme: point.config.case for point in points}


@pytest.mark.parametrize("before", [*SCHEMES, None])
def test_each_scheme_gets_its_own_defaults_whatever_the_case_had(before):
    for scheme, case in configs(Cylinder(scheme=before)).items():
        assert case == Cylinder(scheme=scheme)
    for scheme, case in configs(Sphere(scheme=before)).items():
        assert case == Sphere(scheme=scheme)


def test_what_a_case_says_of_its_own_scheme_stays_with_it():
    paper = Cylinder(algorithm=2, max_iterations=5)
    found = configs(paper, ["alsph", "isph"])
    assert found["alsph"] == paper.replace(scheme="alsph") and found["alsph"].time_step == 0.0508
    assert found["isph"] == Cylinder(scheme="isph", algorithm=2, max_iterations=5)  # it has the frame, too
    slow = configs(Cylinder(scheme="wcsph", sound_speed=20.0), ["edac", "isph"])
    assert slow["edac"].sound_speed == 20 and slow["isph"].sound_speed is None


def test_parameters_go_to_the_schemes_that_have_them():
    found = configs(Cylinder(courant=0.2), ["alsph", "isph", "edac"], penalty_constant=50.0, sound_speed=15.0)
    assert found["alsph"] == Cylinder(scheme="alsph", penalty_constant=50.0)
    assert found["isph"] == Cylinder(scheme="isph", courant=0.2)
    assert found["edac"] == Cylinder(scheme="edac", courant=0.2, sound_speed=15.0)
    sweeps = configs(Cylinder(), ["alsph", "isph"], projection_sweeps=4, time_step=0.03)
    assert [case.projection_sweeps for case in sweeps.values()] == [4, 4]
    assert [case.time_step for case in sweeps.values()] == [0.03, 0.03]


@pytest.mark.parametrize(
    ("schemes", "parameters", "message"),
    [
        (["alsph", "ispg"], {}, "schemes = 'ispg': unknown; did you mean 'isph'?"),
        (["alsph", "euler"], {}, "known: alsph, isph, explicit_isph, wcsph, edac"),
        (["alsph", ""], {}, "schemes = '': unknown"),
        (["alsph", 3], {}, "schemes = 3: unknown"),
        (["alsph", "alsph"], {}, "schemes = alsph: a comparison takes two or more of alsph, isph"),
        ("wcsph", {}, "schemes = wcsph: a comparison takes two or more"),
        ([], {}, "schemes = none: a comparison takes two or more"),
        (["isph", "edac"], {"penalty_constant": 50.0}, "penalty_constant: of the scheme alsph, which is not compared"),
        (["isph", "edac"], {"scheme": "edac"}, "scheme = 'edac': give schemes, which are compared"),
        (["isph", "edac"], {"solver": "x"}, "solver = 'x': must be 'bicgstab'"),
        (["isph", "edac"], {"reynold": 100.0}, "did you mean 'reynolds'?"),
        (["isph", "edac"], {"until": -1.0}, "run.until = -1.0: must be greater than 0"),
    ],
)
def test_what_cannot_be_compared_is_refused_before_anything_is_run(tmp_path, schemes, parameters, message):
    with pytest.raises(ConfigError) as error:
        compare_schemes(VORTICES, schemes, output=tmp_path / "out", progress=False, **parameters)
    assert message in str(error.value) and not (tmp_path / "out").exists()


def test_resolutions_and_cases_that_cannot_be_used_are_refused(tmp_path):
    with pytest.raises(ConfigError, match="resolution = 2: must be greater than or equal to 8"):
        compare_schemes(VORTICES, ["isph", "edac"], [2, 8], tmp_path, progress=False)
    with pytest.raises(ConfigError, match="must be a case such as"):
        compare_schemes("taylor_green", ["isph", "edac"], output=tmp_path)


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """Two schemes at two resolutions."""
    place = tmp_path_factory.mktemp("studies")
    return compare_schemes(VORTICES, ["alsph", "wcsph"], [10, 8, 10], place, progress=False, **SHORT)


def test_each_scheme_and_resolution_is_a_row_of_numbers(compared):
    assert [(row.scheme, row.resolution) for row in compared.rows] == [
        ("alsph", 8),
        ("wcsph", 8),
        ("alsph", 10),
        ("wcsph", 10),
    ]
    for row in compared.rows:
        history = row.run.history
        assert row.measures[RATE].reference == pytest.approx(16 * math.pi**2 / 50)
        assert row.numbers["mean |∇·u| D/U"] == row.run.divergence.mean > 0
        assert row.numbers["steps a D/U"] == len(history["time"]) / history["time"][-1]
        assert row.numbers[CPU] == row.run.info["cpu_seconds"] / history["time"][-1] > 0
        assert 0 < row.numbers["noise of p, /ρU²"] < 1 and "noise of C_D" not in row.numbers
    table = str(compared).splitlines()
    (rates,) = [line for line in table if line.startswith("| reference")]
    assert "3.1583" in rates and f"{100 * compared.rows[0].measures[RATE].error:+.2g} %" in table[2]


def test_table_and_figures_are_saved(compared):
    text = (compared.path / "comparison.md").read_text()
    assert text.startswith("# Schemes of taylor_green\n\n| scheme") and "![cost](cost.png)" in text
    assert "threads: 1" in text and compared.rows[0].run.info["machine"]["processor"] in text
    assert {path.name for path in compared.save()} == {"comparison.md", "cost.png", "kinetic_energy.png"}
    pictures = compared.draw()
    first, second = pictures["cost"].axes
    assert first.get_xscale() == first.get_yscale() == "log"
    assert second.get_ylabel() == "error of the velocity at the last output, L1"
    for line, scheme in zip(first.lines, ("alsph", "wcsph"), strict=True):
        rows = [row for row in compared.rows if row.scheme == scheme]
        assert line.get_label() == scheme
        assert list(line.get_xdata()) == [row.numbers[CPU] for row in rows]
        assert list(line.get_ydata()) == [abs(row.measures[RATE].error) for row in rows]
    drawn = [line.get_label() for line in pictures["kinetic_energy"].axes[0].lines]
    assert drawn[:2] == ["alsph", "wcsph"]


def test_runs_are_used_again_and_only_what_is_missing_is_run(compared, alsph, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folders = {row.folder: (row.folder / "run.json").stat().st_mtime_ns for row in compared.rows}
    path = tmp_path / "vortices.toml"
    path.write_text(
        'case = "taylor_green"\nscheme = "isph"\nreynolds = 50\n[run]\nuntil = 0.1\noutput_interval = 0.05\n'
    )
    line = ("compare", path, "--schemes=alsph, wcsph", "--resolution", 8, "--resolution", 10, "-o")
    code, stdout, _ = alsph(*line, compared.path.parent)
    assert (code, str(compared.path / "comparison.md") in stdout.splitlines()[-1]) == (0, True)
    assert {folder: (folder / "run.json").stat().st_mtime_ns for folder in folders} == folders
    assert not [*tmp_path.glob("runs")]


def test_the_case_may_stand_behind_the_schemes_and_folders_are_compared_as_before(compared, alsph, tmp_path):
    code, _, stderr = alsph("compare", "--schemes", "alsph", "taylor_green")
    assert (code, "two or more of alsph" in stderr) == (2, True)
    code, _, stderr = alsph("compare", "taylor_green")
    assert (code, "alsph compare taylor_green --schemes alsph,isph" in stderr) == (2, True)
    code, stdout, _ = alsph("compare", *[row.folder for row in compared.rows[:2]], "-o", tmp_path)
    assert (code, "| scheme" in stdout, CPU in stdout) == (0, True, True)


def test_a_run_that_breaks_down_is_a_row_that_says_so(tmp_path):
    steps = {"time_step": 0.6, "adaptive_time_step": False, "until": 1.0}
    found = compare_schemes(VORTICES, ["wcsph", "isph"], output=tmp_path, progress=False, **steps)
    broken, sound = found.rows
    assert broken.status.startswith("diverged at tU/D = ") and sound.status == "finished"
    assert not broken.measures and not broken.numbers and sound.measures
    assert found.results.complete and f"| {broken.status}" in str(found)
    assert "wcsph, D/Δx = 8: " in str(found) and "--retry" in str(found)
    assert (found.path / "cost.png").exists()


def test_a_run_that_cannot_be_read_is_a_row_that_says_so(compared, tmp_path):
    shutil.copytree(compared.path.parent, tmp_path / "copy")
    damaged = tmp_path / "copy" / "runs" / compared.rows[0].folder.name
    (damaged / "particles.vtkhdf").write_bytes(b"nothing")
    found = compare_schemes(VORTICES, ["alsph", "wcsph"], [8, 10], tmp_path / "copy", progress=False, **SHORT)
    assert [row.status for row in found.rows] == ["cannot be read", "finished", "finished", "finished"]
    assert "particles.vtkhdf" in found.to_markdown()


def test_seconds_of_the_processor_go_on_with_a_run_and_are_not_made_up(tmp_path):
    folder = tmp_path / "run"
    spent = VORTICES.run(folder, until=0.1, progress=False, threads=1).info["cpu_seconds"]
    assert spent >= 0
    path = folder / "run.json"
    info = json.loads(path.read_text())
    path.write_text(json.dumps(info | {"cpu_seconds": 1000.0}))
    package.resume(folder, until=0.2, progress=False)
    assert 1000 <= Run(folder).info["cpu_seconds"] < 1100
    path.write_text(json.dumps({name: value for name, value in info.items() if name != "cpu_seconds"}))
    package.resume(folder, until=0.3, progress=False)  # begun by an alsph that did not tell
    assert "cpu_seconds" not in Run(folder).info
    assert math.isnan(package.compare([folder, VORTICES.run(tmp_path / "b", until=0.1, progress=False)]).costs[CPU][0])


def test_settings_of_the_runs_and_of_the_case_are_taken_alike():
    config = Config(VORTICES, RunSettings(until=0.5, output_interval=0.25))
    points = _declared(config.tables(), ["isph", "edac"], [], {"until": 0.2, "reynolds": 20.0}).points()
    assert {(p.config.until, p.config.run.output_interval, p.config.case.reynolds) for p in points} == {(0.2, 0.25, 20)}
