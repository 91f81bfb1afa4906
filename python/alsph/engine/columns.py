"""Columns of the history that not every run has."""

from typing import Any

from alsph.arrays import AXES
from alsph.engine.motion import is_rigid

OF_MOTION = ("displacement", "velocity", "angle", "angular_velocity")
"""Those that tell how bodies move."""

OF_SURFACES = (
    *(f"{part}_dissipation" for part in ("artificial", "penalty", "pressure", "sweep", "contact")),
    *(f"angular_momentum_{axis}" for axis in AXES),
)
"""Those of a fluid with a free surface."""

OF_SPACE = ("angular_momentum_x", "angular_momentum_y")
"""Those that say nothing in 2-D."""


def left_out(settings: dict[str, Any]) -> set[str]:
    """Return the columns that say nothing of a flow with these settings of the engine."""
    absent = set() if any(is_rigid(body) for body in settings["bodies"]) else {*OF_MOTION}
    absent |= {*OF_SPACE} if settings["dimensions"] == 2 else set()
    return absent if settings.get("free_surface") else absent | {*OF_SURFACES}
