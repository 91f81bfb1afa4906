"""What parallel flows share: a velocity along x that depends on the place across, and the error of its profile."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from alsph.analysis.averages import error_norms
from alsph.analysis.measures import Measure, Profile
from alsph.analysis.record import Record
from alsph.arrays import FloatArray
from alsph.cases.base import Case


class ParallelFlow(Case):
    """Parallel flow between no-slip walls, periodic along x, whose velocity depends on one coordinate across alone."""

    from_start: ClassVar[bool] = True
    source: ClassVar[str]
    coordinate: ClassVar[str]
    """The coordinate, for the axis of a picture."""
    span: ClassVar[tuple[float, float]]
    """What the coordinate goes over [D]."""
    later_names: ClassVar[tuple[str, ...]] = ("velocity at tU/D = ",)

    reynolds: float = Field(default=10.0, gt=0, description="Reynolds number UD/ν [-]")
    resolution: int = Field(default=40, ge=8, description="particles between the walls, D/Δx [-]")
    length: float = Field(default=0.5, gt=0, description="period along the walls, taken to whole spacings [D]")

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if round(self.length * self.resolution) < self.support_layers:
            raise ValueError(f"length = {self.length:g}: shorter than the kernel's support radius; use a longer one")
        return self

    @property
    def _period(self) -> float:
        """The period, to a whole number of spacings [D]."""
        return float(self.whole(self.length))

    @abstractmethod
    def place(self, position: FloatArray) -> FloatArray:
        """Return the coordinate (n,) across of points (n, d) [D]."""

    @abstractmethod
    def profile(self, place: FloatArray, time: float) -> FloatArray:
        """Return the exact velocity (n,) along x [U] at coordinates (n,) [D] and a time [D/U]."""

    @property
    def default_until(self) -> float:
        """A quarter of the diffusion time D²/ν: the flow between plates is then 90 % of the steady one."""
        return 0.25 * self.reynolds

    def exact(self, position: FloatArray, time: float) -> dict[str, FloatArray]:
        """Return the exact ``velocity`` (n, d) [U].

        Parameters
        ----------
        position
            Points (n, d) [D].
        time
            Time [D/U].
        """
        return {"velocity": self.profile(self.place(position), time)[:, None] * np.eye(self.space_dimensions)[0]}

    def measures(self, run: Record) -> list[Measure]:
        """Return the relative error (L2 over the particles) of the velocity in the last snapshot."""
        error = np.nan
        if (run.times > 0).any():
            snapshot = run.snapshot()
            fluid = snapshot.fluid
            exact = self.exact(snapshot.position[fluid], snapshot.time)["velocity"]
            error = error_norms(snapshot.velocity[fluid], exact)["l2"]
        return [Measure("relative L2 error of the velocity", error, 0.0, 0.01, self.source)]

    def profiles(self, run: Record) -> list[Profile]:
        """Return the particles' velocities in the last snapshot over their places."""
        if not len(run.times):
            return []
        snapshot = run.snapshot()
        place, u = self.place(snapshot.position[snapshot.fluid]), snapshot.velocity[snapshot.fluid, 0]
        order, places = np.argsort(place), np.linspace(*self.span, 201)
        exact = places, self.profile(places, snapshot.time)
        name = f"velocity at tU/D = {snapshot.time:.2f}"
        return [Profile(name, (self.coordinate, "$u/U$"), (place[order], u[order]), exact, self.source)]
