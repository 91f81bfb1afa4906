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
    """

    settings: dict[str, Any]
    state: dict[str, Any]
    coefficient_bodies: Sequence[str] = ()

    @property
    def dimensions(self) -> int:
        """Number of space dimensions, 2 or 3."""
        return int(self.settings["dimensions"])
