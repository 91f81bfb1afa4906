"""The cases, by name: those of alsph, one file and one entry here each, and those of other packages.

A package adds a case by an entry point of the group ``alsph.cases``, with the name of the case::

    [project.entry-points."alsph.cases"]  # in its pyproject.toml
    heated = "my_package.heated:Heated"

Then it is in the command line, in files, studies and run folders as any other. So is, without a package, the class
``Heated`` of a file ``my_cases.py`` under the name ``my_cases.py:Heated`` (:mod:`alsph.cases.source`).
"""

import warnings
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from alsph.cases import source
from alsph.cases.backward_facing_step import BackwardFacingStep
from alsph.cases.base import Case
from alsph.cases.bend import Bend
from alsph.cases.bodies import Bodies
from alsph.cases.body import Body
from alsph.cases.body_3d import Body3D
from alsph.cases.cavity import Cavity
from alsph.cases.channel import Channel
from alsph.cases.concentric_release import ConcentricRelease
from alsph.cases.confined_cylinder import ConfinedCylinder
from alsph.cases.couette import Couette
from alsph.cases.cylinder import Cylinder
from alsph.cases.cylinder_pair import CylinderPair
from alsph.cases.dam_break import DamBreak
from alsph.cases.dam_break_obstacle import DamBreakObstacle
from alsph.cases.dam_break_structure import DamBreakStructure
from alsph.cases.elliptical_drop import EllipticalDrop
from alsph.cases.floating_box import FloatingBox
from alsph.cases.free_surface import FreeSurface
from alsph.cases.heaving_cylinder import HeavingCylinder
from alsph.cases.moving_cylinder import MovingCylinder
from alsph.cases.nozzle import Nozzle
from alsph.cases.oscillating_cylinder import OscillatingCylinder
from alsph.cases.pipe import Pipe
from alsph.cases.poiseuille import Poiseuille
from alsph.cases.pressure_jump import PressureJump
from alsph.cases.pulsating_channel import PulsatingChannel
from alsph.cases.rolling_tank import RollingTank
from alsph.cases.rotating_cylinder import RotatingCylinder
from alsph.cases.rotating_patch import RotatingPatch
from alsph.cases.settling_sphere import SettlingSphere
from alsph.cases.sloshing import Sloshing
from alsph.cases.spatial import Spatial
from alsph.cases.sphere import Sphere
from alsph.cases.standing_wave import StandingWave
from alsph.cases.still_water import StillWater
from alsph.cases.taylor_couette import TaylorCouette
from alsph.cases.taylor_green import TaylorGreen
from alsph.cases.towed_cylinder import TowedCylinder
from alsph.errors import ConfigError
from alsph.geometry.domain import Domain, SolidBody
from alsph.parameters import suggest
from alsph.text import shown

CASES: dict[str, type[Case]] = {
    case.name: case
    for case in (
        *(Cylinder, ConfinedCylinder, CylinderPair, Body, Sphere, Body3D, BackwardFacingStep, Nozzle, Bend, Cavity),
        *(Poiseuille, Couette, TaylorCouette, PulsatingChannel, Pipe, PressureJump, TaylorGreen),
        *(RotatingCylinder, OscillatingCylinder, TowedCylinder, ConcentricRelease, SettlingSphere),
        *(
            DamBreak,
            DamBreakObstacle,
            DamBreakStructure,
            StandingWave,
            StillWater,
            Sloshing,
            RollingTank,
            FloatingBox,
            HeavingCylinder,
            EllipticalDrop,
            RotatingPatch,
        ),
    )
}

__all__ = [
    "CASES",
    "BackwardFacingStep",
    "Bend",
    "Bodies",
    "Body",
    "Body3D",
    "Case",
    "Cavity",
    "Channel",
    "ConcentricRelease",
    "ConfinedCylinder",
    "Couette",
    "DamBreak",
    "DamBreakObstacle",
    "DamBreakStructure",
    "Cylinder",
    "CylinderPair",
    "Domain",
    "EllipticalDrop",
    "FloatingBox",
    "FreeSurface",
    "HeavingCylinder",
    "MovingCylinder",
    "Nozzle",
    "OscillatingCylinder",
    "Pipe",
    "Poiseuille",
    "PressureJump",
    "PulsatingChannel",
    "RollingTank",
    "RotatingCylinder",
    "RotatingPatch",
    "SettlingSphere",
    "Sloshing",
    "SolidBody",
    "Spatial",
    "Sphere",
    "StandingWave",
    "StillWater",
    "TaylorCouette",
    "TaylorGreen",
    "TowedCylinder",
    "find",
]


def __dir__() -> list[str]:
    """Return the names to complete, without those of the files that the cases stand in."""
    return sorted(__all__)


def _add_installed() -> None:
    """Add the cases of other packages; one that cannot be loaded, or has a name that is taken, is told and left out."""
    for entry in entry_points(group="alsph.cases"):
        try:
            model = entry.load()
            if not (isinstance(model, type) and issubclass(model, Case) and model.name == entry.name):
                raise TypeError(f"{entry.value} is no case class whose `name` is '{entry.name}'")
            if CASES.setdefault(entry.name, model) is not model:
                raise ValueError("there is a case of this name")
        except Exception as error:  # whatever another package does wrong
            warnings.warn(f"case '{entry.name}' of {entry.value} is left out: {error}", RuntimeWarning, stacklevel=2)


_add_installed()


def find(name: str | dict[str, Any], *folders: Path) -> type[Case]:
    """Return a case.

    Parameters
    ----------
    name
        Its name, ``FILE.py:CLASS`` or, from a run folder, the fields of :class:`alsph.cases.source.Source`.
    *folders
        Where the path of the file may start from; the present folder if none is given.

    Raises
    ------
    ConfigError
        If there is none, or its file cannot be run.
    """
    if isinstance(name, dict):
        return source.Source.of(name).model()
    if not isinstance(name, str):
        raise ConfigError(f"case = {shown(name)}: must be the name of a case, or FILE.py:CLASS")
    if source.is_reference(name):
        model = source.read(name, *folders)
        if model.name in CASES:
            told = (
                f"{source.shown_name(model.declaration())}: its name, '{model.name}', is that of a case which is there"
            )
            raise ConfigError(f"{told}; give it one of its own")
        return model
    if name not in CASES:
        own = "a case of your own is FILE.py:CLASS, an entry point of its package, or put into alsph.cases.CASES before"
        if (Path(name) / "case.toml").is_file():
            raise ConfigError(f"'{name}' is a run folder, not a case; its case is {shown(f'{name}/case.toml')}")
        raise ConfigError(f"unknown case '{name}'; {suggest(name, CASES)} ({own})")
    return CASES[name]
