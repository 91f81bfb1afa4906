"""Water at rest in a tank."""

from __future__ import annotations

from typing import ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from alsph.analysis.measures import Measure
from alsph.analysis.record import Record
from alsph.arrays import Arrays
from alsph.cases.free_surface import FreeSurface
from alsph.geometry.domain import Domain
from alsph.geometry.lattice import cell_centres, lattice


class StillWater(FreeSurface):
    """Water of depth H at rest in a tank with slip walls: what moves is the scheme's doing."""

    name: ClassVar[str] = "still_water"
    title: ClassVar[str] = "water at rest in a tank"
    later_names: ClassVar[tuple[str, ...]] = (
        "largest velocity, √(gH)",
        "rise of the level, Δx",
        "error of the pressure, rms, ρgH",
    )

    length: float = Field(default=1.0, gt=0, description="length of the tank [H]")

    @model_validator(mode="after")
    def _is_of_whole_cells(self) -> Self:
        self.whole_cells("length", self.length)
        return self

    @property
    def default_until(self) -> float:
        """Long enough for what the scheme stirs up to grow."""
        return 50.0

    def domain(self) -> Domain:
        """Return the tank, whose top is open."""
        return Domain([0, 0], [self.length, 2], [("slip", "slip"), ("slip", "air")])

    @property
    def initial_volume(self) -> float:
        """That of the water [H²]."""
        return self.length

    def particles(self) -> Arrays:
        """Return a lattice at rest with the hydrostatic pressure."""
        columns = self.whole_cells("length", self.length)
        spacing = self.particle_spacing
        position = lattice(cell_centres(columns, spacing), cell_centres(self.resolution, spacing))
        return self.fluid(position, np.zeros_like(position), 1 - position[:, 1])

    def measures(self, run: Record) -> list[Measure]:
        """Return the largest velocity, the rise of the level and the error of the pressure at the last snapshot."""
        if not len(run.times) or run.times[-1] <= 0:
            return []
        snapshot, source = run.snapshot(), "hydrostatics"
        level = snapshot.position[:, 1].max() + self.particle_spacing / 2 - 1
        error = np.sqrt(np.mean((snapshot.pressure - (1 - snapshot.position[:, 1])) ** 2))
        speed = np.linalg.norm(snapshot.velocity, axis=1).max()
        return [
            Measure("largest velocity, √(gH)", float(speed), 0.0, 1e-3, source),
            Measure("rise of the level, Δx", float(level / self.particle_spacing), 0.0, 0.1, source),
            Measure("error of the pressure, rms, ρgH", float(error), 0.0, 0.01, source),
        ]
