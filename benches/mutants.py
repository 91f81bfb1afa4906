"""Faults put into the Python code one at a time, by mutmut, and which of them the quick tests do not notice.

make mutants-python                     # a random sample of each module's mutants
make mutants-python MUTANTS="--modules averages window --sample 1000"

Nothing in the working tree is changed: mutmut works in target/mutants, where the package is called `src` as it wants.
A mutant is tried once, with --again until a test has noticed it; without target/mutants all are tried anew.
"""

import argparse
import json
import os
import random
import subprocess
import sys
import tomllib
from collections import Counter
from pathlib import Path

from mutmut.mutation.file_mutation import mutate_file_contents
from mutmut.stats import status_by_exit_code
from mutmut.utils.format_utils import get_mutant_name

ROOT = Path(__file__).parent.parent
FOLDER = ROOT / "target" / "mutants"
NOTICED = ("killed", "timeout", "segfault")
SURVIVED = ("survived", "no tests")


def main() -> None:
    """Try a sample of each module's mutants, and print a table and what has survived."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--modules", nargs="+", help="names of modules; all of those in pyproject.toml otherwise")
    parser.add_argument("--sample", type=int, default=40, help="mutants a module")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--again", action="store_true", help="try those that have survived again")
    parser.add_argument("--children", type=int, default=1, help="processes at a time")
    arguments = parser.parse_args()
    FOLDER.mkdir(parents=True, exist_ok=True)
    for link, target in (("src", "python"), ("tests", "tests"), ("pyproject.toml", "pyproject.toml")):
        if not (FOLDER / link).is_symlink():
            (FOLDER / link).symlink_to(ROOT / target)
    os.chdir(FOLDER)
    settings = tomllib.loads(Path("pyproject.toml").read_text())["tool"]["mutmut"]
    paths = [Path(path) for path in settings["only_mutate"]]
    if arguments.modules:
        paths = [path for path in paths if path.stem in arguments.modules]
    known = {path: names(path) for path in paths}
    samples = {path: sample(known[path], arguments.sample, arguments.seed) for path in paths}
    done = NOTICED if arguments.again else (*NOTICED, *SURVIVED)
    untried = [name for path in paths for name in samples[path] if results(path).get(name) not in done]
    if untried:
        command = [Path(sys.executable).with_name("mutmut"), "run", "--max-children", str(arguments.children), *untried]
        subprocess.run(command, check=True, env=os.environ | {"PYTHONHASHSEED": "0"})
    report(known, samples)


def names(path: Path) -> list[str]:
    """Return the names of all mutants of a module."""
    return [get_mutant_name(path, name) for name in mutate_file_contents(str(path), path.read_text()).mutant_names]


def sample(known: list[str], count: int, seed: int) -> list[str]:
    """Return a random sample of the mutants, the larger ones holding the smaller."""
    return random.Random(seed).sample(known, len(known))[:count]


def results(path: Path) -> dict[str, str]:
    """Return what became of the mutants of a module."""
    file = Path("mutants") / f"{path}.meta"
    found = json.loads(file.read_text())["exit_code_by_key"] if file.exists() else {}
    return {name: status_by_exit_code[code] for name, code in found.items()}


def report(known: dict[Path, list[str]], samples: dict[Path, list[str]]) -> None:
    """Print what became of the samples, and the difference that each survivor makes."""
    print("| module | mutants | tried | noticed | survived |\n|---|---|---|---|---|")
    survivors = []
    for path, chosen in samples.items():
        became = {name: results(path).get(name, "not checked") for name in chosen}
        count = Counter(status in NOTICED for status in became.values())
        print(f"| {path.stem} | {len(known[path])} | {len(chosen)} | {count[True]} | {count[False]} |")
        survivors += [name for name, status in became.items() if status not in NOTICED]
    for name in survivors:
        print(
            subprocess.run(
                [Path(sys.executable).with_name("mutmut"), "show", name], capture_output=True, text=True
            ).stdout
        )


if __name__ == "__main__":
    main()
