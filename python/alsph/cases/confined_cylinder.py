"""Flow past a circular cylinder between no-slip sides: the benchmarks 2D-1 and 2D-2 of Schäfer and Turek (1996)."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

from pydantic import Field

from alsph import reference
from alsph.analysis.measures import Measure
from alsph.analysis.record import Record
from alsph.cases.cylinder import Cylinder
from alsph.reference import Reference


class ConfinedCylinder(Cylinder):
    """Flow past a circular cylinder of diameter D in a channel with no-slip sides, U the mean of the parabolic inflow.

    The defaults are the benchmark 2D-2 of Schäfer and Turek (Notes Numer. Fluid Mech. 52 (1996) 547): the cylinder lies
    0.05 D below the centre line, and at Re = 100 sheds vortices. `reynolds=20` is their steady flow, 2D-1. The height
    must be a whole number of spacings, so D/Δx = 10, 20, 30 and so on.
    """

    name: ClassVar[str] = "confined_cylinder"
    title: ClassVar[str] = "flow past a cylinder between no-slip sides (Schäfer and Turek)"
    later_names: ClassVar[tuple[str, ...]] = ("pressure coefficient",)

    reynolds: float = Field(default=100.0, gt=0, description="Reynolds number UD/ν [-]")
    length: float = Field(default=22.0, gt=0, description="length of the channel [D]")
    height: float = Field(default=4.1, gt=0, description="height of the channel [D]")
    upstream: float = Field(default=2.0, gt=0, description="distance from the inlet to the centre of the body [D]")
    body_offset: float = Field(
        default=-0.05, description="how far the centre of the body lies above the centre line [D]"
    )
    side_walls: Literal["no_slip"] = Field(default="no_slip", description="sides of the channel: no_slip")

    @property
    def validated(self) -> tuple[float, float, int]:
        """What has been compared with an independent solution."""
        return (20, 100, 10)

    def measures(self, run: Record) -> list[Measure]:
        """Return the forces, among them the mean lift, and the Strouhal number."""
        known = self._reference() or Reference({}, "")
        lift = known.results.get("mean lift coefficient", math.nan)
        mean = Measure("mean lift coefficient", run.lift.mean, lift, 0.5, known.source)
        return [measure for measure in super().measures(run) if measure.name != mean.name] + [mean]

    def _reference(self) -> Reference | None:
        known = self._known("cylinder_confined.csv", offset_over_D=self.body_offset)
        names = reference.COLUMNS | {"mean lift coefficient": "CL_mean"}
        results = {name: known[column] for name, column in names.items() if known}
        return Reference(results, "finite elements in the same channel") if known else None
