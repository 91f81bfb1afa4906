"""A pressure jump in a uniform stream, which an incompressible fluid does not keep."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from pydantic import Field

from alsph.analysis.measures import Measure
from alsph.analysis.record import Record
from alsph.arrays import Arrays
from alsph.cases.base import Case
from alsph.geometry.domain import Domain
from alsph.geometry.lattice import cell_centres, lattice
from alsph.geometry.particles import Kind, particles


class PressureJump(Case):
    """Fluid in a square of side D that streams along y with U; at first p = ρU² in its left half, 0 in its right half.

    Free-slip walls bound it along x; it is periodic along y. In an incompressible fluid the uniform stream is the only
    solution: the jump is gone at once and moves nothing. The iterations of ALSPH answer as a fluid with a speed of
    sound of about sqrt(max_iterations C_BV) U does: waves run to and fro, and die out. Compared with zero are what is
    left of the jump, and of the motion that it has caused, at the end.

    The set-up is our own. The stream is there because the penalty r_AL follows u_max: in fluid at rest it would vanish.
    """

    name: ClassVar[str] = "pressure_jump"
    title: ClassVar[str] = "pressure jump in a uniform stream"
    from_start: ClassVar[bool] = True

    resolution: int = Field(default=40, ge=8, description="particles per side of the square, D/Δx [-]")

    @property
    def default_until(self) -> float:
        """Time by which the waves have died out."""
        return 2.0

    def domain(self) -> Domain:
        """Return the unit square."""
        return Domain((0, 0), (1, 1), [("slip", "slip"), ("periodic", "periodic")])

    def particles(self) -> Arrays:
        """Return a lattice in the stream, its left half under pressure."""
        position = lattice(*[cell_centres(self.resolution, self.particle_spacing)] * 2)
        return particles(Kind.FLUID, position, [0.0, 1.0], pressure=position[:, 0] < 0.5)

    def measures(self, run: Record) -> list[Measure]:
        """Return the jump that is left in the last snapshot, and the kinetic energy of the motion against the stream.

        The energy's unit is (Δp/2)²/(2ρU²) D², of which a fluid with a speed of sound U would make motion.
        """
        jump = energy = np.nan
        if len(run.times):
            snapshot = run.snapshot()
            left = snapshot.position[:, 0] < 0.5
            jump = abs(snapshot.pressure[left].mean() - snapshot.pressure[~left].mean())
            energy = 4 * ((snapshot.velocity - [0.0, 1.0]) ** 2).sum(axis=1).mean()
        source = "an incompressible fluid keeps neither"
        return [
            Measure("pressure jump, ρU²", float(jump), 0.0, 0.01, source),
            Measure("kinetic energy against the stream, ρU²D²/8", float(energy), 0.0, 1e-4, source),
        ]
