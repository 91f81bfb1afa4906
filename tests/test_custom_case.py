"""A case of another package or of a file: in the command line, in studies, in run folders; what is wrong with one."""

import dataclasses
import functools
import os
import re
import subprocess
import sys
import warnings

import alsph
import numpy as np
import pytest
import shapely
from alsph import cases, config, open_run
from alsph.errors import ConfigError
from alsph.geometry.particles import Kind
from pydantic import Field

HEATED = '''
from typing import ClassVar

from alsph.cases import TaylorGreen
from pydantic import Field


class Heated(TaylorGreen):
    """Vortices of another package.

    They spin faster.
    """

    name: ClassVar[str] = "heated"
    title: ClassVar[str] = "vortices of another package"

    heat: float = Field(default=1.0, gt=0, description="how hot it is [-]")


class Stranger:
    """No case."""
'''

STUDY = """
name = "heat"
title = "Heat"

[base]
case = "heated"
resolution = 8

[base.run]
until = 0.02

[sweep.product]
heat = [1.0, 2.0]
"""


@pytest.fixture
def command(tmp_path):
    """Return a function that runs a command line where the package is installed, with these entry points."""

    def run(*arguments, cases=("heated = my_package:Heated",)):
        site = tmp_path / "site"
        info = site / "my_package-1.0.dist-info"
        info.mkdir(parents=True, exist_ok=True)
        (site / "my_package.py").write_text(HEATED)
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: my_package\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text("\n".join(["[alsph.cases]", *cases]) + "\n")
        path = os.pathsep.join([str(site), *filter(None, sys.path)])
        script = "from alsph.cli import main; main()"
        return subprocess.run(
            [sys.executable, "-c", script, *map(str, arguments)],
            env=os.environ | {"PYTHONPATH": path},
            cwd=tmp_path,
            capture_output=True,
            text=True,
        )

    return run


def test_a_case_of_another_package_is_listed(command):
    assert "heated" in command("cases").stdout


@pytest.mark.parametrize(
    ("name", "recorded"),
    [
        ("heated", 'case = "heated"'),
        ("mine/my_cases.py", 'file = "my_cases.py"\nname = "Heated"'),
        ("mine/my_cases.py:Heated", 'file = "my_cases.py"\nname = "Heated"'),
    ],
)
def test_a_case_of_anothers_is_one_of_alsphs(command, tmp_path, name, recorded):
    packages = ("heated = my_package:Heated",) if name == "heated" else ()
    command = functools.partial(command, cases=packages)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "my_cases.py").write_text(HEATED)
    assert "how hot it is" in command("run", name, "--help").stdout
    run = command("run", name, "--resolution", 8, "--heat", 2, "--until", 0.02, "-o", "run")
    assert run.returncode == 0, run.stderr
    assert recorded in (tmp_path / "run" / "case.toml").read_text()
    (tmp_path / "heat.toml").write_text(STUDY.replace('"heated"', f'"{name}"'))
    study = command("study", "heat.toml", "--jobs", 1)
    assert study.returncode == 0, study.stdout + study.stderr
    other = command("run", name, "--resolution", 8, "--heat", 2, "--until", 0.02, "--initial-run", "run", "-o", "other")
    assert other.returncode == 0 and "another flow" not in other.stderr, other.stderr
    (tmp_path / "mine" / "my_cases.py").unlink()  # the run folder holds what was run
    resumed = command("resume", "run", "--until", 0.04)
    assert resumed.returncode == 0 and "finished" in command("info", "run").stdout, resumed.stderr
    assert "the same to the last bit" in command("repeat", "run").stdout
    (tmp_path / "again.toml").write_text((tmp_path / "run" / "case.toml").read_text())
    assert command("describe", "again.toml", "--no-probe").returncode == 0


@pytest.mark.parametrize(
    ("text", "name", "told"),
    [
        (None, "", "'my_cases.py': cannot be read (No such file or directory)"),
        (HEATED, ":Hot", "my_cases.py: has no case 'Hot'; known: Heated"),
        (HEATED, ":Stranger", "my_cases.py: has no case 'Stranger'"),
        ("x = (", "", "my_cases.py: line 1: '(' was never closed"),
        ("import math\n\nmath.sqrt(-1)\n", "", "my_cases.py: line 3: ValueError: "),
        ("import nothing_like_it\n", "", "my_cases.py: line 1: ModuleNotFoundError: No module named 'nothing_like_it'"),
        (
            "from alsph.cases import Bodies\n",
            "",
            "my_cases.py: has no case, a class that derives",
        ),
        ("from alsph.cases import Bodies\nclass Half(Bodies): ...\n", "", "my_cases.py: Half lacks shapes"),
        (
            HEATED + "from alsph.cases import Bodies\nclass Half(Bodies): ...\n",
            ":Half",
            "my_cases.py: Half lacks shapes",
        ),
        (
            "from alsph.cases import Bodies\nclass Five(Bodies):\n    def shapes(self):\n        return 5\n",
            "",
            "Five.shapes() must be points (n, 2)",
        ),
        (HEATED + "class Other(Heated): ...\n", "", "has the cases Heated, Other; say which, as my_cases.py:Heated"),
        (HEATED.replace('"heated"', '"he/ated"'), "", "may hold letters, digits, _ and - only"),
        (HEATED.replace('"heated"', '"cylinder"'), "", "its name, 'cylinder', is that of a case which is there"),
    ],
)
def test_what_is_wrong_with_a_file_is_told(command, tmp_path, text, name, told):
    if text is not None:
        (tmp_path / "my_cases.py").write_text(text)
    done = command("run", f"my_cases.py{name}", "--resolution", 8, cases=())
    assert done.returncode == 2 and told in done.stderr, done.stderr
    assert "Traceback" not in done.stderr and not (tmp_path / "runs").exists()


def test_a_file_stands_alone_and_says_so(command, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "helper.py").write_text("")
    (tmp_path / "mine" / "my_cases.py").write_text("import helper" + HEATED)
    done = command("run", "mine/my_cases.py", "--resolution", 8, "--until", 0.02, "-o", "run", cases=())
    assert done.returncode == 2 and "No module named 'helper'; a run holds my_cases.py alone" in done.stderr


FIELD = '    heat: float = Field(default=1.0, gt=0, description="how hot it is [-]")\n'


@pytest.mark.parametrize(
    ("field", "told"),
    [
        (
            "    sides: tuple[float, float] = (1.0, 2.0)\n",
            "sides = (1.0, 2.0): a parameter of Heated that its file cannot",
        ),
        ("    path: Path = Path('x')\n", "path = PosixPath('x'): a parameter of Heated that its file cannot give back"),
        ("    force: float = 1.0\n", "Heated: its parameter 'force' has the name of an option; give it another one"),
        ("    threads: int = 1\n", "Heated: its parameter 'threads' has the name of an option"),
        ("    case: int = 1\n", "Heated: its parameter 'case' has the name of an option"),
        (FIELD + "    def domain(self):\n        return 1 / 0\n", "ZeroDivisionError"),
        (FIELD + "    @model_validator(mode='after')\n    def ok(self):\n        self.hat\n", "my_cases.py: line"),
        ("    heat: Unknown\n", "name 'Unknown' is not defined"),
    ],
)
def test_what_a_case_cannot_do_is_told_before_anything_is_written(command, tmp_path, field, told):
    text = HEATED.replace(FIELD, field).replace(
        "import Field", "import Field, model_validator\nfrom pathlib import Path"
    )
    assert text != HEATED
    (tmp_path / "my_cases.py").write_text(text)
    done = command("run", "my_cases.py", "--resolution", 8, "--until", 0.02, cases=())
    assert done.returncode != 0 and told in done.stderr, done.stderr
    assert not (tmp_path / "runs").exists()


def test_parameters_that_must_be_given(command, tmp_path):
    (tmp_path / "my_cases.py").write_text(HEATED.replace("default=1.0, ", ""))
    assert "how hot it is" in command("run", "my_cases.py", "--help", cases=()).stdout
    done = command("run", "my_cases.py", "--resolution", 8, "--until", 0.02, cases=())
    assert done.returncode == 2 and "heat: is missing" in done.stderr
    done = command("run", "my_cases.py", "--resolution", 8, "--until", 0.02, "--heat", 2, cases=())
    assert done.returncode == 0, done.stderr
    (tmp_path / "case.toml").write_text('case = "my_cases.py"\nheat = 2.0\nresolution = 8\n')
    assert command("describe", "case.toml", "--no-probe", cases=()).returncode == 0


@pytest.mark.parametrize("text", ["import sys\nsys.exit()\n", "raise SystemExit(3)\n"])
def test_a_file_that_ends_the_process_is_told(command, tmp_path, text):
    (tmp_path / "my_cases.py").write_text(text)
    done = command("run", "my_cases.py", cases=())
    assert done.returncode == 2 and "SystemExit" in done.stderr


def test_lines_may_end_in_any_way(command, tmp_path):
    (tmp_path / "my_cases.py").write_bytes(b"\xef\xbb\xbf" + HEATED.replace("\n", "\r\r\n").encode())
    run = command("run", "my_cases.py", "--resolution", 8, "--until", 0.02, "-o", "run", cases=())
    assert run.returncode == 0 and command("resume", "run", "--until", 0.04, cases=()).returncode == 0


def test_what_classes_of_a_file_are_cases(tmp_path):
    text = HEATED.replace('    name: ClassVar[str] = "heated"\n', "").replace(
        '    title: ClassVar[str] = "vortices of another package"\n', ""
    )
    more = "class _Common(TaylorGreen): ...\nOld = Heated\nclass TGVortex2D(_Common): ...\n"
    (tmp_path / "my_cases.py").write_text(text + more)
    found = cases.find("my_cases.py:TGVortex2D", tmp_path)
    assert (found.name, found.title) == ("tg_vortex2d", "tg_vortex2d")
    found = cases.find("my_cases.py:Heated", tmp_path)
    assert (found.name, found.title) == ("heated", "vortices of another package")
    with pytest.raises(ConfigError, match="has the cases Heated, TGVortex2D; say which"):
        cases.find("my_cases.py", tmp_path)
    with pytest.raises(ConfigError, match="has no case 'Old'"):
        cases.find("my_cases.py:Old", tmp_path)


def test_a_folder_stays_readable_when_its_name_is_taken(tmp_path, monkeypatch):
    (tmp_path / "my_cases.py").write_text(HEATED)
    run = cases.find("my_cases.py", tmp_path)(resolution=8).run(tmp_path / "run", until=0.02, progress=False)
    monkeypatch.setitem(cases.CASES, "heated", cases.TaylorGreen)
    assert open_run(run.path).config.case == run.config.case


def test_another_text_is_another_flow(tmp_path):
    (tmp_path / "my_cases.py").write_text(HEATED)
    run = cases.find("my_cases.py", tmp_path)(resolution=8).run(tmp_path / "run", until=0.02, progress=False)
    (tmp_path / "my_cases.py").write_text(HEATED + "\n# edited\n")
    other = cases.find("my_cases.py", tmp_path)(resolution=8)
    with pytest.warns(RuntimeWarning, match="its case is my_cases.py:Heated as another text of that file has it"):
        other.simulation(initial_run=run.path)


@pytest.mark.parametrize(
    ("table", "told"),
    [
        ({"self": 1}, "case.self: unknown; the table of a case has file, name, sha256, text"),
        ({"file": "a.py", "name": "", "sha256": "", "text": ""}, "case.name = '': must not be empty"),
        ({"file": 3, "name": "A", "sha256": "", "text": ""}, "case.file = 3: must be a text"),
        ({"name": "A"}, "case.file: is missing"),
        ("a\0.py", "cannot be read|not a Python file"),
        (300 * "a" + ".py", "cannot be read"),
    ],
)
def test_hostile_declarations_are_refused(table, told):
    with pytest.raises(ConfigError, match=told):
        config.from_tables({"case": table})


def test_a_run_folder_whose_case_was_changed_is_refused(command, tmp_path):
    (tmp_path / "my_cases.py").write_text(HEATED)
    command("run", "my_cases.py", "--resolution", 8, "--until", 0.02, "-o", "run", cases=())
    path = tmp_path / "run" / "case.toml"
    path.write_text(path.read_text().replace("spin faster", "spin slower"))
    done = command("resume", "run", "--until", 0.04, cases=())
    assert done.returncode == 2 and "my_cases.py: the text is not that which its sha256 is of" in done.stderr


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        ("heated = my_package:Missing", "has no attribute 'Missing'"),
        ("heated = my_package:Stranger", "is no case class whose `name` is 'heated'"),
        ("hot = my_package:Heated", "is no case class whose `name` is 'hot'"),
        ("cylinder = alsph.cases:Body", "is no case class whose `name` is 'cylinder'"),
    ],
)
def test_a_case_that_cannot_be_used_is_told_and_left_out(command, entry, told):
    done = command("cases", cases=(entry,))
    assert done.returncode == 0 and "cylinder" in done.stdout and "another package" not in done.stdout
    assert "is left out" in done.stderr and told in done.stderr


@pytest.mark.parametrize(
    ("measures", "told"),
    [
        ("[Measure('peak', run.history['u_max'][-1])]", "KeyError: 'u_max'; correct the file that defines it"),
        ("[('peak', 1.0)]", "Heated.measures() gave a list with ('peak', 1.0) in it"),
    ],
)
def test_measures_that_fail_leave_the_rest_of_the_results(command, tmp_path, measures, told):
    text = HEATED.replace(FIELD, FIELD + f"\n    def measures(self, run):\n        return {measures}\n")
    (tmp_path / "my_cases.py").write_text("from alsph.analysis.measures import Measure\n" + text)
    done = command("run", "my_cases.py", "--resolution", 8, "--until", 0.05, "-o", "run", cases=())
    assert done.returncode == 0 and "mean velocity divergence" in done.stdout, done.stderr
    assert "no measures: Heated.measures() " in done.stdout and told in done.stdout
    assert command("resume", "run", "--until", 0.1, cases=()).returncode == 0


class Turning(cases.Couette):
    """A wall whose particles go their own ways, if its body lets them."""

    keeps: bool = Field(default=False, description="whether the body has no velocity of its own")

    def bodies(self):
        return [dataclasses.replace(body, velocity=None) if self.keeps else body for body in super().bodies()]

    def particles(self):
        state = super().particles()
        solid = state["kind"] == Kind.SOLID
        state["velocity"][solid, 0] = 0.25
        return state


@pytest.mark.filterwarnings("ignore:Field name")  # what pydantic says of it
def test_a_parameter_that_would_be_ignored_is_refused(tmp_path):
    """Coefficients are formed with what the class says, or nothing says it."""
    text = "from typing import ClassVar\n\nfrom alsph.cases import Cylinder\n\n\nclass Half(Cylinder):\n    {}\n"
    (tmp_path / "own.py").write_text(text.format("reference_area: float = 2.0"))
    with pytest.raises(ConfigError, match="'reference_area' is a property of Case, no parameter; make it a property"):
        cases.find(f"{tmp_path}/own.py:Half")
    (tmp_path / "other.py").write_text(text.format("reference_area: ClassVar[float] = 2.0"))
    drag = {}
    for model in (cases.Cylinder, cases.find(f"{tmp_path}/other.py:Half")):
        run = model(resolution=8).run(tmp_path / model.__name__, until=0.1, progress=False)
        drag[model.__name__] = run.drag.mean
    assert drag["Cylinder"] == pytest.approx(2 * drag["Half"])


def test_velocities_of_solid_particles_that_are_not_used_are_warned_of():
    case = Turning(resolution=8)
    body = case.bodies()[0]
    with pytest.warns(UserWarning, match=rf"Turning: .*'{body.name}' are not used.*say None there"):
        simulation = case.simulation(threads=1)
    simulation.advance(1)
    state = simulation.state()
    lower = (state["kind"] == Kind.SOLID) & (state["body"] == 0)
    assert np.allclose(state["velocity"][lower], body.velocity)  # indeed
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        kept = case.replace(keeps=True).simulation(threads=1)
        for model in (cases.Couette, cases.Cavity, cases.CylinderPair, cases.BackwardFacingStep):
            model(resolution=10).build()
    kept.advance(1)
    state = kept.state()
    assert np.allclose(state["velocity"][state["kind"] == Kind.SOLID], [0.25, 0.0])


class Two(cases.Bodies):
    """Two squares, of which a list tells the names."""

    called: list[str] = ["body_1", "body_2"]

    def shapes(self):
        return [shapely.box(x, -0.5, x + 1, 0.5) for x in (-1.5, 0.5)]

    def bodies(self):
        return [alsph.SolidBody(name, self.centre) for name in self.called]


@pytest.mark.parametrize("names", [["body_2", "body_1"], ["body_1"], ["hull", "rudder"], []])
def test_bodies_must_be_called_as_their_loads_are(names):
    told = f"Two.bodies(): has {', '.join(names) or 'none'}, and must begin with body_1, body_2"
    with pytest.raises(ConfigError, match=re.escape(told)):
        Two(called=names)
    assert Two(called=["body_1", "body_2", "mast"]).checked_bodies[2].name == "mast"
