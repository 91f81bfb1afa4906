"""Flow past a body in space whose surface is a triangle mesh."""

from __future__ import annotations

import os
from typing import Any, ClassVar

from pydantic import Field, field_validator

from alsph.analysis.measures import Measure
from alsph.analysis.record import Record
from alsph.cases.spatial import Spatial
from alsph.geometry.mesh import Mesh
from alsph.geometry.volume import Volume, cube

CUBE = "cube"


class Body3D(Spatial):
    """Flow past a body in space in a channel with free-slip walls and uniform inflow U: a cube, or a triangle mesh.

    D is the body's largest extent, the side of the cube, unless `scale` is given; its centre of volume lies at
    (upstream, 0, 0), and it is turned about it. The solid particles follow its surface. Shells of a mesh that lie apart
    are one body with common forces, closed cavities are filled with it, and shells that overlap are refused. A body of
    which more than half is thinner than 2 Δx is refused. Force coefficients are formed with its frontal area as it is
    turned.
    """

    name: ClassVar[str] = "body_3d"
    title: ClassVar[str] = "flow past a body of any shape in space, from a triangle mesh"
    made_for: ClassVar[tuple[str, ...]] = ("shape", "scale", "angle_of_attack")

    shape: str | Mesh = Field(
        default=CUBE,
        description="cube, or the file of a closed triangle mesh (.stl, .ply, .obj, .off); in Python also a "
        "trimesh.Trimesh, or vertices (n, 3) and triangles (m, 3)",
    )
    scale: float = Field(default=1.0, gt=0, description="largest extent of the body before it is turned [D]")
    angle_of_attack: float = Field(default=0.0, ge=-180, le=180, description="angle of attack, nose up [degrees]")

    @field_validator("shape", mode="before")
    @classmethod
    def _read(cls, shape: Any) -> str | Mesh:
        if shape == CUBE:
            return CUBE
        if isinstance(shape, dict):
            return Mesh(**shape)
        if isinstance(shape, str | os.PathLike):
            return Mesh.read(shape)
        return shape if isinstance(shape, Mesh) else Mesh.of(shape)

    @property
    def _hint(self) -> str:
        return ", or a smaller scale" if self.scale > 1 else ""

    def volume(self) -> Volume:
        """Return the body, turned by the angle of attack."""
        if isinstance(self.shape, Mesh):
            return self.shape.volume(self.scale, self.angle_of_attack)
        return cube(self.scale, self.angle_of_attack)

    def remarks(self) -> list[str]:
        """Return what is to be said, first of how the file was read."""
        if isinstance(self.shape, str) or not self.shape.remark:
            return super().remarks()
        return [f"mesh: {self.shape.file}: {self.shape.remark}", *super().remarks()]

    def measures(self, run: Record) -> list[Measure]:
        """Return the forces, also the mean lift; of a quarter the drag alone."""
        lift = [] if self.quarter else [Measure("mean lift coefficient", run.lift.mean)]
        return [*super().measures(run), *lift]
