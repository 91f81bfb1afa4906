"""Where a result comes from: versions, commit, machine."""

import os
import platform
import subprocess
import sys
import time as clock
from importlib.metadata import version
from pathlib import Path
from typing import Any

from alsph.engine import core


def provenance(threads: int) -> dict[str, Any]:
    """Return versions, commit, threads, machine, command and the time of day, for ``run.json``."""
    return {
        "versions": {"alsph": core.VERSION, "python": platform.python_version()}
        | {name: version(name) for name in ("numpy", "h5py")},
        "commit": _commit(),
        "threads": threads,
        "instructions": core.instructions(),
        "machine": {
            "name": platform.node(),
            "system": platform.platform(),
            "processor": _processor(),
            "cores": os.cpu_count(),
        },
        "command": " ".join(sys.argv),
        "written": clock.strftime("%Y-%m-%dT%H:%M:%S%z"),
    }


def describe(facts: dict[str, Any]) -> str:
    """Return the facts of :func:`provenance` in one line, for ``run.log``."""
    versions = ", ".join(f"{name} {number}" for name, number in facts["versions"].items())
    machine = facts["machine"]
    return (
        f"{versions}, commit {facts['commit']}, {facts['threads']} threads, {facts['instructions']} instructions, on "
        f"{machine['name']} ({machine['processor']}, {machine['cores']} cores, {machine['system']}): {facts['command']}"
    )


def peak_memory() -> int | None:
    """Return the peak memory of this process [bytes], None where the system does not tell."""
    if sys.platform == "win32":
        return None
    import resource

    unit = 1 if sys.platform == "darwin" else 1024
    return unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _commit() -> str | None:
    """Commit of the source, with ``+`` where it was changed since; None for an installed package."""
    git = ["git", "-C", str(Path(__file__).parent)]
    try:
        subprocess.run([*git, "ls-files", "--error-unmatch", Path(__file__).name], check=True, capture_output=True)
        output = subprocess.run([*git, "describe", "--always", "--dirty=+"], check=True, capture_output=True, text=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return output.stdout.strip()


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next(
        (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), platform.processor()
    )
