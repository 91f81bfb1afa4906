"""What the wheel, the conda package, the container and the development container are made of fits together."""

import fnmatch
import json
import re
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parent.parent
CONDA_NAMES = {"matplotlib-base": "matplotlib"}


def toml(name):
    return tomllib.loads((ROOT / name).read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def recipe():
    return yaml.safe_load((ROOT / "recipe" / "recipe.yaml").read_text(encoding="utf-8"))


def wanted(requirements):
    """Return the versions by the names of packages, of Python's form or conda's."""
    parts = [re.fullmatch(r"([\w-]+) *(.*)", text).groups() for text in requirements]
    return {CONDA_NAMES.get(name, name): version for name, version in parts}


def test_the_conda_package_needs_what_the_wheel_does(recipe):
    project = toml("pyproject.toml")
    runs = {"python": project["project"]["requires-python"]} | wanted(project["project"]["dependencies"])
    assert wanted(recipe["requirements"]["run"]) == runs
    assert wanted(recipe["requirements"]["host"]).items() >= wanted(project["build-system"]["requires"]).items()


def test_versions_are_the_same(recipe):
    version = toml("Cargo.toml")["package"]["version"]
    assert recipe["context"]["version"] == version
    assert yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))["version"] == version


def test_the_container_is_given_what_the_wheel_is_built_from():
    ignored = (ROOT / ".dockerignore").read_text().splitlines()
    cargo, project = toml("Cargo.toml"), toml("pyproject.toml")["project"]
    files = ["Cargo.toml", "Cargo.lock", "pyproject.toml", "python/alsph/__init__.py", cargo["lib"]["path"]]
    files += [project["readme"], *project["license-files"]]
    files += [f"benches/{each['name']}.rs" for each in cargo["bench"]]
    files += [f"tests/{each['name']}.rs" for each in cargo["test"]]
    for file in files:
        assert (ROOT / file).is_file()
        assert not [rule for rule in ignored if fnmatch.fnmatch(file, rule) or file.startswith(f"{rule}/")], file


def test_the_container_runs_alsph_and_not_as_root():
    lines = (ROOT / "Dockerfile").read_text().splitlines()
    last = lines[max(number for number, line in enumerate(lines) if line.startswith("FROM ")) :]
    assert 'ENTRYPOINT ["alsph"]' in last
    (user,) = [line.split()[1] for line in last if line.startswith("USER ")]
    assert user not in ("0", "root")


def test_the_development_container_makes_a_target_that_there_is():
    container = json.loads((ROOT / ".devcontainer" / "devcontainer.json").read_text())
    command, target = container["postCreateCommand"].split()
    assert command == "make" and re.search(rf"^{target}:", (ROOT / "Makefile").read_text(), re.M)
