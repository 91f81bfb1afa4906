"""Planes through a flow in 3-D, which pictures show it on."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from alsph.arrays import AXES, FloatArray
from alsph.errors import ConfigError
from alsph.geometry.particles import Kind, Snapshot
from alsph.text import shown


@dataclass(frozen=True)
class Plane:
    """A plane, in 2-D a line, that is normal to an axis.

    Attributes
    ----------
    axis : {0, 1, 2}
        The axis, x, y or z.
    place : float
        Where the plane cuts it [D].
    """

    axis: int
    place: float

    @classmethod
    def of(cls, given: str | None, middle: FloatArray, setting: str = "plane") -> Plane:
        """Return the plane of a text such as ``z=0.5``; ``y`` alone, or ``z`` if None, through the point `middle` (d,).

        In 2-D it is a line. `setting` is what the text is called in the message.

        Raises
        ------
        ConfigError
            If it is no such text.
        """
        name, equals, number = str("z" if given is None else given).replace(" ", "").partition("=")
        try:
            axis = AXES[: len(middle)].index(name or "?")
            place = float(number) if equals else float(middle[axis])
        except ValueError:
            place = np.nan
        if not np.isfinite(place):
            last = AXES[len(middle) - 1]
            raise ConfigError(
                f"{setting} = {shown(given)}: must be an axis, {', '.join(AXES[: len(middle)])}, and where the plane "
                f"cuts it, as in {last}=0.5 [D]"
            )
        return cls(axis, place)

    @property
    def across(self) -> list[int]:
        """The two axes in the plane."""
        return [axis for axis in range(3) if axis != self.axis]

    def near(self, snapshot: Snapshot, spacing: float) -> Snapshot:
        """Return the particles within 2 Δx of the plane, with the vorticity's component normal to it.

        Raises
        ------
        ConfigError
            If the plane is not in the fluid.
        """
        along, fluid = snapshot.position[:, self.axis], snapshot.kind == Kind.FLUID
        if not along[fluid].min() - spacing < self.place < along[fluid].max() + spacing:
            name, ends = AXES[self.axis], along[fluid]
            raise ConfigError(
                f"plane = {name}={self.place:g}: no fluid there; it lies between {name} = {ends.min():.3g} and "
                f"{ends.max():.3g}"
            )
        near = np.abs(along - self.place) < 2 * spacing
        chosen = ("position", "velocity", "pressure", "velocity_divergence", "kind")
        return replace(
            snapshot,
            vorticity=snapshot.vorticity[near, self.axis],
            **{name: getattr(snapshot, name)[near] for name in chosen},
        )

    def points(self, points: FloatArray) -> FloatArray:
        """Return the points (n, 3) in space of points (n, 2) of the plane."""
        return np.insert(points, self.axis, self.place, axis=1)
