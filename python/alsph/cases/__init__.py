"""The cases, by name. A new case is one file and one entry here."""

from alsph.cases.backward_facing_step import BackwardFacingStep
from alsph.cases.base import Case
from alsph.cases.body import Body
from alsph.cases.cavity import Cavity
from alsph.cases.couette import Couette
from alsph.cases.cylinder import Cylinder
from alsph.cases.poiseuille import Poiseuille
from alsph.cases.pressure_jump import PressureJump
from alsph.cases.taylor_green import TaylorGreen
from alsph.errors import ConfigError
from alsph.parameters import suggest

CASES: dict[str, type[Case]] = {
    case.name: case
    for case in (Cylinder, Body, BackwardFacingStep, Cavity, Poiseuille, Couette, PressureJump, TaylorGreen)
}

__all__ = [
    "CASES",
    "BackwardFacingStep",
    "Body",
    "Case",
    "Cavity",
    "Couette",
    "Cylinder",
    "Poiseuille",
    "PressureJump",
    "TaylorGreen",
    "find",
]


def find(name: str) -> type[Case]:
    """Return the case with that name.

    Raises
    ------
    ConfigError
        If there is none.
    """
    if name not in CASES:
        own = "a case of your own must be put into alsph.cases.CASES before"
        raise ConfigError(f"unknown case '{name}'; {suggest(name, CASES)} ({own})")
    return CASES[name]
