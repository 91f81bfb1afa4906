"""A case of another package: in the command line, in files and studies, in run folders, and what is wrong with one."""

import os
import subprocess
import sys

import pytest

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


def test_a_case_of_another_package_is_one_of_alsphs(command, tmp_path):
    assert "heated" in command("cases").stdout
    assert "how hot it is" in command("run", "heated", "--help").stdout
    run = command("run", "heated", "--resolution", 8, "--heat", 2, "--until", 0.02, "-o", "run")
    assert run.returncode == 0, run.stderr
    assert 'case = "heated"' in (tmp_path / "run" / "case.toml").read_text()
    resumed = command("resume", "run", "--until", 0.04)
    assert resumed.returncode == 0 and "finished" in command("info", "run").stdout, resumed.stderr
    assert "the same to the last bit" in command("repeat", "run").stdout
    (tmp_path / "again.toml").write_text((tmp_path / "run" / "case.toml").read_text())
    assert command("describe", "again.toml", "--no-probe").returncode == 0
    (tmp_path / "heat.toml").write_text(STUDY)
    study = command("study", "heat.toml", "--jobs", 1)
    assert study.returncode == 0, study.stdout + study.stderr


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
