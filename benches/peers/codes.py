"""The codes that are compared, each in an environment of its own."""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ENVIRONMENTS = HERE / "environments"

ALSPH = str(HERE.parents[1])

# Name: interpreter, packages, driver.
CODES = {
    "alsph": (sys.executable, [ALSPH], "alsph_peer.py"),
    "pysph": (sys.executable, ["pysph==1.0b2", ALSPH], "pysph_peer.py"),
    "sphinxsys": (sys.executable, [ALSPH], "sphinxsys_peer.py"),
    "jax-sph": ("python3.10", ["jax-sph==0.1.0", "scipy"], "jax_sph_peer.py"),
}


def environment(name: str, folder: Path) -> str:
    """Return the interpreter of a code's environment, made if it is not there."""
    interpreter, packages, _ = CODES[name]
    python = folder / name / "bin" / "python"
    if not (folder / name / "ready").exists():
        subprocess.run([interpreter, "-m", "venv", "--clear", str(folder / name)], check=True)
        subprocess.run([str(python), "-m", "pip", "install", "--quiet", *packages], check=True)
        (folder / name / "ready").touch()
    return str(python)


def measure(name: str, arguments: list[str], folder: Path, driver: str | None = None) -> dict[str, Any] | None:
    """Run one code once; return what a driver, by default its own, prints, or None, with a message, if it fails."""
    try:
        python = environment(name, folder)
    except (OSError, subprocess.CalledProcessError) as error:
        print(f"{name} could not be installed: {error}", file=sys.stderr)
        return None
    # One thread each; the drivers of this folder must not shadow installed packages.
    limits = {"OMP_NUM_THREADS": "1", "JAX_PLATFORMS": "cpu", "PYTHONSAFEPATH": "1"}
    command = [python, str(HERE / (driver or CODES[name][2])), *arguments]
    with tempfile.TemporaryDirectory(dir=folder) as output:
        done = subprocess.run(command, cwd=output, env=os.environ | limits, capture_output=True, text=True)
    if done.returncode:
        print(f"{name} {' '.join(arguments)} failed:\n{done.stderr[-800:]}", file=sys.stderr)
        return None
    return json.loads(done.stdout.splitlines()[-1])
