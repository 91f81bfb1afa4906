"""The problem that is handed to the engine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Problem:
    """All that the engine needs to start.

    Attributes
    ----------
    settings
        The engine's settings (see docs/architecture.md).
    state
        The particles, one array a property, and optionally ``time``, ``step``, ``mass_in``, ``mass_out``.
    coefficient_bodies
        Names of the bodies whose force coefficients are reported, all together.
    reference_area
        A of these coefficients F / (½ρU²A), a length in 2-D [D], an area in 3-D [D²].
    """

    settings: dict[str, Any]
    state: dict[str, Any]
    coefficient_bodies: Sequence[str] = ()
    reference_area: float = 1.0

    @property
    def dimensions(self) -> int:
        """Number of space dimensions, 2 or 3."""
        return int(self.settings["dimensions"])
