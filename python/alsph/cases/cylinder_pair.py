"""Flow past two cylinders, side by side, one behind the other, or staggered."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from pydantic import Field
from shapely import Point

from alsph.cases.bodies import Bodies


class CylinderPair(Bodies):
    """Flow past two equal cylinders of diameter D in a channel with free-slip walls and uniform inflow U.

    The first, ``body_1``, is the one upstream or below; (upstream, body_offset) lies midway between them. Loads are
    those of both together, and of each.
    """

    name: ClassVar[str] = "cylinder_pair"
    title: ClassVar[str] = "flow past two cylinders, side by side or in tandem"

    made_for: ClassVar[tuple[str, ...]] = ("pitch", "stagger")

    length: float = Field(default=16.0, gt=0, description="length of the channel [D]")
    height: float = Field(default=20.0, gt=0, description="height of the channel [D]")
    upstream: float = Field(default=5.0, gt=0, description="distance from the inlet to midway between them [D]")
    pitch: float = Field(default=3.0, gt=1.0, le=10, description="distance between their centres [D]")
    stagger: float = Field(
        default=90.0,
        ge=0,
        le=90,
        description="angle of the line through their centres to the stream; 0: tandem, 90: side by side [degrees]",
    )

    def shapes(self) -> list[Any]:
        """Return two circles of 128 points."""
        angle = np.radians(self.stagger)
        along, across = np.round(0.5 * self.pitch * np.array([np.cos(angle), np.sin(angle)]), 12)
        return [Point(sign * along, sign * across).buffer(0.5, quad_segs=32) for sign in (-1, 1)]
