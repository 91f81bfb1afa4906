"""Flow past a sphere."""

from typing import ClassVar

from pydantic import Field

from alsph import reference
from alsph.cases.spatial import Spatial
from alsph.geometry.volume import Volume, sphere
from alsph.reference import Reference


class Sphere(Spatial):
    """Flow past a sphere of diameter D in a channel with free-slip walls and uniform inflow U.

    Up to about Re = 210 it is steady and axisymmetric (Johnson and Patel, J. Fluid Mech. 378 (1999) 19), so that a
    quarter of it will do. In unbounded flow C_D is 1.09 at Re = 100, in this channel, above all since the inflow is
    uniform three diameters before it, 1.133.
    """

    name: ClassVar[str] = "sphere"
    title: ClassVar[str] = "flow past a sphere in a channel"
    body_name: ClassVar[str] = "sphere"

    reynolds: float = Field(default=100.0, gt=0, description="Reynolds number UD/ν [-]")

    @property
    def validated(self) -> tuple[float, float, int]:
        """What has been compared with the results of others."""
        return (100, 100, 8)

    def volume(self) -> Volume:
        """Return a sphere of diameter 1."""
        return sphere(0.5)

    def _reference(self) -> Reference | None:
        """Return the steady flow that finite elements find in a round channel of the same area."""
        known = {} if self.body_offset else self._known("sphere_channel.csv", W_over_D=self.width)
        results = {name: known[column] for name, column in reference.COLUMNS.items() if column in known}
        return Reference(results, "finite elements, steady, round channel of this area") if known else None
