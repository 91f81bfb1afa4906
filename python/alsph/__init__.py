"""Augmented Lagrangian SPH: incompressible flow with particles, without a pressure Poisson solve.

Examples
--------
>>> import alsph
>>> case = alsph.cases.Cylinder(reynolds=200, resolution=20)
>>> run = case.run("runs/re200", until=60, threads=2)  # doctest: +SKIP
"""

try:
    from alsph._alsph import __version__
except ImportError as error:
    raise ImportError(
        "alsph's engine is not built (or was built for another Python): in the source folder run "
        f"`maturin develop --release` for development, or `pip install .` to install it [{error}]"
    ) from error

from alsph import cases, errors, study
from alsph.engine.simulation import Simulation
from alsph.results.run import Run
from alsph.running.repetition import repeat
from alsph.running.start import resume
from alsph.study.autotune import autotune
from alsph.study.convergence import converge
from alsph.study.validation import validate

open_run = Run
"""Open a run folder: ``alsph.open_run("runs/re200")``."""

__all__ = [
    "Run",
    "Simulation",
    "__version__",
    "autotune",
    "cases",
    "converge",
    "errors",
    "open_run",
    "repeat",
    "resume",
    "study",
    "validate",
]
