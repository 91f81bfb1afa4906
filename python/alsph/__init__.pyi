"""What ``import alsph`` offers; each is loaded when it is used first."""

from . import (
    analysis,
    cases,
    config,
    engine,
    errors,
    folder,
    geometry,
    parameters,
    plotting,
    reference,
    results,
    running,
    study,
    units,
    watching,
)
from .engine.simulation import Simulation
from .geometry.domain import Domain, SolidBody
from .geometry.rigid import Rigid
from .results.run import Run, open_run
from .running.repetition import repeat
from .running.start import resume
from .study.autotune import autotune
from .study.comparison import Comparison, compare
from .study.convergence import converge
from .study.schemes import SchemeComparison, compare_schemes
from .study.validation import validate
from .units import Units
from .watching.server import watch

__version__: str

__all__ = [
    "Comparison",
    "Domain",
    "Rigid",
    "Run",
    "SchemeComparison",
    "Simulation",
    "SolidBody",
    "Units",
    "__version__",
    "autotune",
    "cases",
    "compare",
    "compare_schemes",
    "converge",
    "errors",
    "open_run",
    "repeat",
    "resume",
    "study",
    "validate",
    "watch",
    "analysis",
    "config",
    "engine",
    "folder",
    "geometry",
    "parameters",
    "plotting",
    "reference",
    "results",
    "running",
    "units",
    "watching",
]
