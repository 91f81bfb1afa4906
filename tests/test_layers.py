"""Engine and package lie on floors: a file or folder uses those below it, and none another of its own floor."""

import ast
import graphlib
import re
from pathlib import Path

import pytest

RUST = Path(__file__).parents[1] / "rust"

FLOORS = (
    ("base",),
    ("kernel",),
    ("settings",),
    ("particles",),
    ("halo", "neighbours"),
    ("discretisation", "faces"),
    ("motion",),
    ("frame",),
    ("forcing",),
    ("boundary", "breakdown"),
    ("interpolation", "surface"),
    ("flow", "poisson"),
    ("loads", "shifting"),
    ("scheme",),
    ("report",),
    ("simulation",),
    ("python", "lib"),
)
FLOOR = {name: height for height, names in enumerate(FLOORS) for name in names}


def used(text: str) -> set[str]:
    """Return the modules of the crate that a source file names, but for those of its documentation and its tests."""
    code = re.sub(r"//.*", "", text.split("#[cfg(test)]")[0])
    assert "crate::{" not in code, "one line a module, so that this test can read it"
    return set(re.findall(r"\bcrate::([a-z_]+)\b", code))


def test_the_engine_has_no_arrow_up():
    modules = {path.relative_to(RUST).parts[0].removesuffix(".rs"): set() for path in RUST.rglob("*.rs")}
    assert set(modules) == set(FLOOR)
    for path in RUST.rglob("*.rs"):
        modules[path.relative_to(RUST).parts[0].removesuffix(".rs")] |= used(path.read_text())
    up = [
        f"{name} uses {other}"
        for name, others in sorted(modules.items())
        for other in sorted(others - {name})
        if FLOOR[other] >= FLOOR[name]
    ]
    assert not up


def test_an_arrow_up_is_noticed():
    assert used("use crate::scheme::Alsph;\n/// [`crate::report`]\n#[cfg(test)]\nuse crate::kernel;") == {"scheme"}


def defined(folder: Path) -> dict[str, Path]:
    """Return the files of a folder of the crate by the names that its ``mod.rs`` hands on, and by their own."""
    files = {path.stem: path for path in folder.glob("*.rs") if path.stem != "mod"}
    for module, names in re.findall(
        r"^pub(?:\(crate\))? use (\w+)::\{?([^;}]*)\}?;", (folder / "mod.rs").read_text(), re.M
    ):
        files |= {name: files[module] for name in re.findall(r"\w+", names) if module in files}
    return files


def test_no_files_of_a_folder_of_the_engine_use_each_other():
    circles = []
    for folder in {path.parent for path in RUST.rglob("mod.rs")}:
        files, name = defined(folder), ".".join(folder.relative_to(RUST).parts)
        graph = {}
        for path in set(files.values()):
            code = re.sub(r"//.*", "", path.read_text().split("#[cfg(test)]")[0])
            within = re.findall(
                rf"\bcrate::{name.replace('.', '::')}::(\w+|{{[^}}]*}})|\bsuper::(\w+|{{[^}}]*}})", code
            )
            words = {word for pair in within for word in re.findall(r"\w+", "".join(pair))}
            graph[path.stem] = {files[word].stem for word in words if word in files} - {path.stem}
        try:
            graphlib.TopologicalSorter(graph).prepare()
        except graphlib.CycleError as error:
            circles.append(error.args[1])
    assert not circles


def test_a_circle_in_a_folder_is_noticed():
    files = defined(RUST / "boundary")
    assert (
        files["Walls"] == files["solid"] == RUST / "boundary" / "solid.rs" and files["surface_area"].stem == "profile"
    )


PYTHON = Path(__file__).parents[1] / "python" / "alsph"

PYTHON_FLOORS = (
    ("_alsph", "arrays", "text"),
    ("errors", "tables"),
    ("arguments", "memory", "parameters", "expressions", "symbols"),
    ("geometry", "reference", "run_settings", "units"),
    ("analysis", "engine"),
    ("cases", "folder"),
    ("config",),
    ("results",),
    ("plotting", "running"),
    ("study", "watching"),
    ("__init__",),
    ("cli",),
    ("__main__",),
)
PYTHON_FLOOR = {name: height for height, names in enumerate(PYTHON_FLOORS) for name in names}

DOORS = {
    ("cases.base", "running.beginning"),  # Case.simulation
    ("cases.base", "running.control"),  # Case.run
    ("cases.base", "running.start"),
    ("cases.base", "plotting"),  # Case.draw
    ("cases.base", "results.run"),  # the type of what Case.run returns
    ("results.run", "plotting"),  # Run.plot_...
}
"""Where a class of a lower floor offers what a higher one does, by an import that is made when it is called."""


def imported(source: str) -> set[str]:
    """Return the files of the package that a source file imports, wherever in it, by their dotted names in it."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "alsph":
            base = node.module.removeprefix("alsph").removeprefix(".")
            names = [".".join(filter(None, (base, each.name))) for each in node.names]
            found |= {name if is_file(name) else base or "__init__" for name in names}
        elif isinstance(node, ast.Import):
            found |= {each.name.removeprefix("alsph.") for each in node.names if each.name.startswith("alsph.")}
    return found


def is_file(name: str) -> bool:
    """Whether the dotted name is that of a file or folder of the package, its compiled module included."""
    path = PYTHON / name.replace(".", "/")
    return name == "_alsph" or path.is_dir() or path.with_suffix(".py").is_file()


@pytest.fixture(scope="module")
def imports():
    """Files of the package and what each imports, but through the doors."""
    found = {}
    for path in PYTHON.rglob("*.py"):
        name = ".".join(path.relative_to(PYTHON).with_suffix("").parts).removesuffix(".__init__")
        found[name] = imported(path.read_text()) - {name}
    assert DOORS <= {(name, other) for name, others in found.items() for other in others}
    return {name: {other for other in others if (name, other) not in DOORS} for name, others in found.items()}


def test_the_package_has_no_arrow_up(imports):
    folder = {name: name.split(".")[0] for others in imports.values() for name in others} | {
        name: name.split(".")[0] for name in imports
    }
    assert set(folder.values()) == set(PYTHON_FLOOR)
    up = [
        f"{name} imports {other}"
        for name, others in sorted(imports.items())
        for other in sorted(others)
        if folder[name] != folder[other] and PYTHON_FLOOR[folder[other]] >= PYTHON_FLOOR[folder[name]]
    ]
    assert not up


def test_the_package_has_no_circle(imports):
    assert [*graphlib.TopologicalSorter(imports).static_order()]


def test_only_the_engines_files_know_the_compiled_module(imports):
    knowing = {name for name, others in imports.items() if "_alsph" in others}
    assert knowing == {"__init__", "engine.core", "engine.simulation"}


def test_imports_are_found_wherever_they_are():
    source = "from alsph import study, Run\nfrom alsph.engine.simulation import Simulation\n"
    source += "def f():\n    import alsph.text"
    assert imported(source) == {"study", "__init__", "engine.simulation", "text"}
