"""A case of one's own: `alsph run examples/cylinder_array.py --pitch 2 --resolution 10 --until 20`."""

from typing import Any

from alsph.cases import Bodies
from pydantic import Field
from shapely import Point


class CylinderArray(Bodies):
    """Flow past cylinders of diameter D side by side, in one row or in several, each row half a pitch off the last."""

    height: float = Field(default=16.0, gt=0, description="height of the channel [D]")
    pitch: float = Field(default=2.0, gt=1.2, le=6, description="distance between the centres of neighbours [D]")
    columns: int = Field(default=2, ge=1, le=5, description="cylinders in a row across the stream [-]")
    rows: int = Field(default=1, ge=1, le=3, description="rows along the stream [-]")

    def shapes(self) -> list[Any]:
        """Return a circle of 128 points a cylinder, the rows `pitch` apart."""
        centres = [
            (row * self.pitch, (column - (self.columns - 1) / 2 + row % 2 / 2) * self.pitch)
            for row in range(self.rows)
            for column in range(self.columns)
        ]
        return [Point(centre).buffer(0.5, quad_segs=32) for centre in centres]
