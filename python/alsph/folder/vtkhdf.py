"""Particles over time as one temporal VTKHDF PolyData file, and grids as ImageData, which ParaView opens (format 2.0).

Every output of particles appends one part: its points, one vertex cell a point, and the point data. What is valid is
what the attribute ``NSteps`` counts.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from alsph.arrays import Arrays
from alsph.folder.durable import growing
from alsph.folder.reading import sound

TOPOLOGIES = ("Vertices", "Lines", "Polygons", "Strips")
FIELDS: dict[str, type[np.generic]] = {
    "velocity": np.float32,
    "pressure": np.float32,
    "velocity_divergence": np.float32,
    "vorticity": np.float32,
    "kind": np.uint8,
    "id": np.int64,
    "body": np.uint16,
}
"""Point data and the types they are stored with."""

FIELDS_OF_SURFACES: dict[str, type[np.generic]] = {"place": np.uint8}
"""Those of a fluid with a free surface."""


def append(path: Path, time: float, particles: Arrays) -> None:
    """Append the particles at one time to the file, and create it if it does not exist.

    Parameters
    ----------
    path
        The file.
    time
        The time [D/U].
    particles
        The arrays of :meth:`alsph.Simulation.snapshot`; vectors get a third component 0 in 2-D.
    """
    told = FIELDS | {name: dtype for name, dtype in FIELDS_OF_SURFACES.items() if name in particles}
    columns = {name: np.asarray(particles[name], dtype) for name, dtype in told.items()}
    columns["velocity"] = three_components(columns["velocity"])
    points = three_components(np.asarray(particles["position"], np.float32))
    with growing(path) as file:
        root = file["VTKHDF"] if "VTKHDF" in file else _create(file, points, columns)
        _append_part(root, time, points, columns)


def truncate(path: Path, time: float) -> None:
    """Drop the outputs later than `time`."""
    with growing(path) as file:
        steps = file["VTKHDF/Steps"]
        values = sound(steps, "Values")
        keep = int(np.searchsorted(values[: steps.attrs["NSteps"]], time, side="right"))
        steps.attrs["NSteps"] = keep
        values.resize(keep, axis=0)


def write_image(
    path: Path, time: float, origin: Sequence[float], spacing: Sequence[float], fields: Mapping[str, NDArray[Any]]
) -> None:
    """Write fields at the points of a regular grid as VTKHDF ImageData.

    Parameters
    ----------
    path
        The file.
    time
        The time [D/U], in the field data.
    origin, spacing
        First point and distances, (d,) each [D].
    fields
        Arrays of shape (nx, ny) or (nx, ny, nz), of vectors with an axis more.
    """
    dimensions = len(origin)
    counts = [*next(iter(fields.values())).shape[:dimensions], *[1] * (3 - dimensions)]
    with h5py.File(path, "w") as file:
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = np.array([2, 0])
        root.attrs.create("Type", b"ImageData", dtype=h5py.string_dtype("ascii", len("ImageData")))
        root.attrs["WholeExtent"] = np.array([end for count in counts for end in (0, count - 1)])
        root.attrs["Origin"] = np.array([*origin, 0.0][:3], float)
        root.attrs["Spacing"] = np.array([*spacing, 1.0][:3], float)
        root.attrs["Direction"] = np.eye(3).ravel()
        root["FieldData/TimeValue"] = np.array([time])
        for name, values in fields.items():
            vector = three_components(values) if values.ndim > dimensions else values
            table = vector.swapaxes(0, dimensions - 1).astype(np.float32)  # of dimension 2 in 2-D, as readers want it
            root.create_dataset(f"PointData/{name}", data=table, compression="gzip", shuffle=True)


def _create(file: h5py.File, points: NDArray[Any], columns: Arrays) -> h5py.Group:
    root = file.create_group("VTKHDF")
    root.attrs["Version"] = np.array([2, 0])
    root.attrs.create("Type", b"PolyData", dtype=h5py.string_dtype("ascii", len("PolyData")))
    _table(root, "NumberOfPoints", np.zeros(0, np.int64))
    _table(root, "Points", points)
    for name, column in columns.items():
        _table(root, f"PointData/{name}", column)
        _table(root, f"Steps/PointDataOffsets/{name}", np.zeros(0, np.int64))
    for topology in TOPOLOGIES:
        for name in ("NumberOfCells", "NumberOfConnectivityIds", "Connectivity", "Offsets"):
            _table(root, f"{topology}/{name}", np.zeros(0, np.int64))
    _table(root, "Steps/Values", np.zeros(0))
    for name in ("PartOffsets", "NumberOfParts", "PointOffsets"):
        _table(root, f"Steps/{name}", np.zeros(0, np.int64))
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        _table(root, f"Steps/{name}", np.zeros((0, len(TOPOLOGIES)), np.int64))
    root["Steps"].attrs["NSteps"] = 0
    return root


def _append_part(root: h5py.Group, time: float, points: NDArray[Any], columns: Arrays) -> None:
    part, count = int(root["Steps"].attrs["NSteps"]), len(points)
    start = int(root["NumberOfPoints"][:part].sum())
    _write(root["NumberOfPoints"], part, count)
    _write(root["Points"], start, points)
    for name, column in columns.items():
        if name in FIELDS_OF_SURFACES and name not in root["PointData"]:
            continue  # the file of an older version
        _write(root[f"PointData/{name}"], start, column)
        _write(root[f"Steps/PointDataOffsets/{name}"], part, start)
    for topology in TOPOLOGIES:
        cells, first = (count, start) if topology == "Vertices" else (0, 0)
        _write(root[f"{topology}/NumberOfCells"], part, cells)
        _write(root[f"{topology}/NumberOfConnectivityIds"], part, cells)
        _write(root[f"{topology}/Connectivity"], first, np.arange(cells))
        _write(root[f"{topology}/Offsets"], first + part, np.arange(cells + 1))
    steps = root["Steps"]
    _write(steps["Values"], part, time)
    _write(steps["PartOffsets"], part, part)
    _write(steps["NumberOfParts"], part, 1)
    _write(steps["PointOffsets"], part, start)
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        _write(steps[name], part, [[start, 0, 0, 0]])
    steps.attrs["NSteps"] = part + 1


def _table(root: h5py.Group, name: str, like: NDArray[Any]) -> None:
    """Create an empty table that can grow, with rows of the shape and type of `like`."""
    row = like.shape[1:]
    root.create_dataset(
        name,
        (0, *row),
        like.dtype,
        maxshape=(None, *row),
        chunks=(16384 if name.startswith(("Point", "Vert")) else 1024, *row),
        compression="gzip",
        shuffle=True,
    )


def _write(table: h5py.Dataset, start: int, rows: Any) -> None:
    """Write rows from row `start` on and drop what was there."""
    rows = np.atleast_1d(rows)
    table.resize(start + len(rows), axis=0)
    table[start:] = rows


def three_components(vectors: NDArray[Any]) -> NDArray[Any]:
    """Return vectors (..., d) with a third component 0 in 2-D."""
    return np.pad(vectors, [(0, 0)] * (vectors.ndim - 1) + [(0, 3 - vectors.shape[-1])])
