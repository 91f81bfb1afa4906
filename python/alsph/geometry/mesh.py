"""Closed triangle meshes: read from files, kept as text, and the distances from them."""

from __future__ import annotations

import math
import os
from functools import cached_property
from io import StringIO
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from alsph.arrays import FloatArray
from alsph.errors import ConfigError
from alsph.geometry.shape import Shape
from alsph.geometry.volume import Volume, nose_up
from alsph.text import printable, sha256, shown

FORMATS = (".stl", ".ply", ".obj", ".off")
LARGEST_FILE = 2**28
"""Size of the largest file that is read [bytes]."""
MOST_TRIANGLES = 50_000
"""A run folder holds them as text, some 40 bytes a triangle."""
FAR = 100.0
"""How many extents from the origin a mesh is brought there for its integrals, which lose their digits otherwise."""
UNREADABLE = "holds no triangles that can be read; is it whole, and of the format that its name says?"


class Mesh(Shape):
    """The triangles of a closed surface. A run folder holds them, and so needs no file beside it."""

    FORMS: ClassVar[str] = "must be a trimesh.Trimesh, or vertices (n, 3) and triangles (m, 3) of their indices"

    triangles: str = Field(description="a line `v x y z` a vertex, and `f i j k` a triangle, as in an OBJ file")
    remark: str = Field(default="", description="what became of the parts of the surface, if it has several")

    @model_serializer(mode="wrap")
    def _as_before(self, whole: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave out what a mesh of one shell has not, so that it is that of older run folders."""
        return {name: value for name, value in whole(self).items() if value != ""}

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Self:
        """Read a file: STL, PLY, OBJ or OFF.

        Raises
        ------
        ConfigError
            If it holds no closed surface, or some that overlap; the message names the file.
        """
        trimesh = _library()
        name = printable(os.path.basename(path))
        if not os.path.isfile(path):
            raise ConfigError(f"{shown(path)}: no such file")
        if os.path.getsize(path) > LARGEST_FILE:
            raise ConfigError(f"{name}: larger than {LARGEST_FILE >> 20} MiB; reduce the number of triangles")
        kind = os.path.splitext(path)[1].lower()
        if kind not in FORMATS:
            raise ConfigError(f"{name}: a mesh is a file of triangles, {', '.join(FORMATS)}")
        try:
            with open(path, "rb") as file:
                found = trimesh.load_mesh(file, file_type=kind[1:], process=True)
        except Exception:  # whatever the reader of the format raises
            raise ConfigError(f"{name}: {UNREADABLE}") from None
        return cls._of(found, name)

    @classmethod
    def of(cls, shape: Any) -> Self:
        """Return the mesh of a ``trimesh.Trimesh``, or of vertices (n, 3) and triangles (m, 3)."""
        trimesh = _library()
        if not isinstance(shape, trimesh.Trimesh):
            try:
                vertices, triangles = shape
                shape = trimesh.Trimesh(np.asarray(vertices, float), np.asarray(triangles, int))
            except Exception:
                raise ConfigError(f"mesh: {cls.FORMS}") from None
        return cls._of(shape, "<mesh>")

    @classmethod
    def _of(cls, mesh: Any, name: str) -> Self:
        if not hasattr(mesh, "faces") or not len(mesh.faces):
            raise ConfigError(f"{name}: {UNREADABLE}")
        if not np.isfinite(mesh.vertices).all():
            raise ConfigError(f"{name}: has a vertex that is no finite number")
        if len(mesh.faces) > MOST_TRIANGLES:
            raise ConfigError(
                f"{name}: {len(mesh.faces)} triangles, more than {MOST_TRIANGLES}; reduce them, by Decimate in Blender "
                "or MeshLab"
            )
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
        mesh.update_faces(mesh.nondegenerate_faces())
        mesh.remove_unreferenced_vertices()
        if not mesh.is_watertight:
            edges = np.sort(mesh.edges, axis=1)
            counts = np.unique(edges, axis=0, return_counts=True)[1]
            raise ConfigError(
                f"{name}: is not closed, {np.count_nonzero(counts != 2)} edges are not those of two triangles; "
                "close it in the program that it comes from"
            )
        mesh.fix_normals()
        remark = _of_one_body(mesh, name)
        far = float(np.abs(mesh.vertices).max() / np.ptp(mesh.vertices, axis=0).max())
        digits = min(9 + math.ceil(math.log10(max(far, 1.0))), 17)  # nine of the body, wherever it lies
        lines = [" ".join(["v", *(f"{x:.{digits}g}" for x in vertex)]) for vertex in mesh.vertices]
        lines += [f"f {i} {j} {k}" for i, j, k in mesh.faces + 1]
        text = "\n".join([*lines, ""])
        return cls(file=name, sha256=sha256(text), triangles=text, remark=remark)

    @model_validator(mode="after")
    def _sound(self) -> Self:
        if sha256(self.triangles) != self.sha256:
            raise ValueError(f"{self.file}: the triangles are not those of the SHA-256 beside them")
        return self

    @cached_property
    def surface(self) -> Any:
        """The triangles as a ``trimesh.Trimesh``, in the unit of the file."""
        return _library().load_mesh(StringIO(self.triangles), file_type="obj", process=False)

    def __str__(self) -> str:
        """Return the name of the file, the number of triangles and what is to be said of them."""
        return "; ".join(filter(None, (f"{self.file}: {len(self.surface.faces)} triangles", self.remark)))

    def volume(self, scale: float, angle: float = 0.0) -> Volume:
        """Return the body, its larger extent `scale` [D], turned nose up about its centre of volume, which lies at 0.

        Parameters
        ----------
        scale
            Largest extent along x, y or z before it is turned [D].
        angle
            Angle of attack [degrees].
        """
        mesh = self.surface
        extent, middle = float(np.ptp(mesh.vertices, axis=0).max()), mesh.bounds.mean(axis=0)
        if np.abs(middle).max() > FAR * extent:
            mesh = mesh.copy().apply_translation(-middle)
        vertices = (np.asarray(mesh.vertices) - mesh.center_mass) * (scale / extent) @ nose_up(angle).T
        triangles = np.asarray(mesh.faces, np.int64)

        def nearest(points: FloatArray) -> tuple[FloatArray, FloatArray]:
            return _nearest(vertices, triangles, points)

        return Volume(
            distance=lambda points: nearest(points)[0],
            lower=vertices.min(axis=0),
            upper=vertices.max(axis=0),
            volume=float(mesh.volume) * (scale / extent) ** 3,
            frontal_area=_shadow(vertices, triangles),
            nearest=nearest,
        )


def _library() -> Any:
    try:
        import igl
        import trimesh
    except ImportError:
        raise ConfigError("a mesh needs the packages trimesh and libigl; pip install 'alsph[meshes]'") from None
    del igl
    return trimesh


def _of_one_body(mesh: Any, name: str) -> str:
    """Take the shells out of a mesh that lie within others, and return what is to be said of those that it has.

    Raises
    ------
    ConfigError
        If shells overlap.
    """
    import igl
    from igl.predicates import find_self_intersections

    shells = _library().graph.connected_component_labels(mesh.face_adjacency, node_count=len(mesh.faces))
    firsts = np.unique(shells, return_index=True)[1]
    vertices, triangles = np.array(mesh.vertices, float), np.array(mesh.faces, np.int64)
    pairs = find_self_intersections(vertices, triangles)[1]
    own = pairs[shells[pairs[:, 0]] == shells[pairs[:, 1]]]
    crossing = ""
    if len(own):
        x, y, z = mesh.triangles_center[own[0, 0]]
        where = f"{len(own)} pairs of its triangles cross, as near ({x:.4g}, {y:.4g}, {z:.4g})"
        crossing = f"{where}: what lies beyond them may be taken for fluid; mend it in the program that made it"
    if len(firsts) == 1:
        return crossing
    overlapping = pairs[shells[pairs[:, 0]] != shells[pairs[:, 1]]]
    if len(overlapping):
        one, two = sorted(shells[overlapping[0]] + 1)
        x, y, z = mesh.triangles_center[overlapping[0, 0]]
        raise ConfigError(
            f"{name}: its shells {one} and {two} overlap near ({x:.4g}, {y:.4g}, {z:.4g}); unite them in the program "
            "that made it, e.g. by a boolean union"
        )
    outside = mesh.triangles_center[firsts] + 1e-6 * mesh.extents.max() * mesh.face_normals[firsts]
    within = igl.winding_number(vertices, triangles, outside) > 0.5
    mesh.update_faces(~within[shells])
    mesh.remove_unreferenced_vertices()
    filled, apart = np.count_nonzero(within), np.count_nonzero(~within)
    remarks = [
        f"{filled} of its {len(firsts)} shells, within others, left out: the body is solid there, without a cavity",
        f"its {apart} shells, apart from each other, are one body: drag and lift are those of all of them together",
    ]
    told = [remark for remark, holds in zip(remarks, (filled, apart > 1), strict=True) if holds]
    return "; ".join([*told, *filter(None, [crossing])])


def _nearest(vertices: FloatArray, triangles: NDArray[np.int64], points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the signed distances (n,) of points (n, 3) from a mesh, and its nearest points (n, 3)."""
    import igl

    kind = igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
    distance, _, feet, _ = igl.signed_distance(np.ascontiguousarray(points), vertices, triangles, kind)
    return np.asarray(distance), np.asarray(feet)


def _shadow(vertices: FloatArray, triangles: NDArray[np.int64]) -> float:
    """Return the area of the shadow along x."""
    import shapely

    corners = vertices[triangles][:, :, 1:]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    seen = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] > 0
    return float(shapely.union_all(shapely.polygons(corners[seen])).area)
