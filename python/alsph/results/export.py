"""Results on grids, in files, and as objects of other libraries, which are needed only when they are asked for."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from alsph.analysis import sampling
from alsph.arrays import AXES, FloatArray
from alsph.errors import ConfigError
from alsph.folder import vtkhdf
from alsph.folder.durable import check_target, replacing
from alsph.geometry.domain import Domain
from alsph.geometry.particles import Snapshot
from alsph.text import shown

if TYPE_CHECKING:
    import pandas
    import pyvista
    import xarray

MOST_POINTS, LARGEST = 20_000_000, 1e15

FORMATS = {"vtkhdf": ".vtkhdf", "netcdf": ".nc", "csv": ".csv"}
"""Formats of grids, and how their files end."""
UNITS = {"velocity": "U", "pressure": "rho U^2", "vorticity": "U/D"}


def table(history: dict[str, FloatArray]) -> pandas.DataFrame:
    """Return the history of a run, one row a step; see :meth:`alsph.Run.to_pandas`."""
    frame: pandas.DataFrame = _library("pandas").DataFrame(history)
    return frame.set_index("time")


@dataclass(frozen=True, eq=False)
class Grid:
    """The fields of a snapshot in the middles of the cells of a regular grid; see :meth:`alsph.Run.to_grid`.

    Attributes
    ----------
    time : float
        tU/D.
    axes : dict of ndarray
        Coordinates along ``x``, ``y`` and, in 3-D, ``z`` [D].
    fields : dict of ndarray
        ``velocity`` (nx, ny, 2) [U], ``pressure`` (nx, ny) [ρU²] and ``vorticity`` (nx, ny) [U/D]; in 3-D velocity
        and vorticity are of shape (nx, ny, nz, 3). NaN in bodies and where there is no fluid.
    """

    time: float
    axes: dict[str, FloatArray]
    fields: dict[str, FloatArray]

    def components(self) -> dict[str, FloatArray]:
        """Return the fields with each component of a vector by itself: ``velocity_x``, ``velocity_y``, ..."""
        found = {}
        for name, values in self.fields.items():
            if values.ndim == len(self.axes):
                found[name] = values
            else:
                found |= {f"{name}_{axis}": values[..., k] for k, axis in enumerate(self.axes)}
        return found

    def to_xarray(self) -> xarray.Dataset:
        """Return the grid as a data set of xarray."""
        names = [*self.axes]
        fields = {
            name: (names, values, {"long_name": name.replace("_", " along "), "units": UNITS[name.split("_")[0]]})
            for name, values in self.components().items()
        }
        coordinates = {name: (name, line, {"units": "D"}) for name, line in self.axes.items()}
        attributes = {"time": self.time, "time_units": "D/U"}
        dataset: xarray.Dataset = _library("xarray").Dataset(fields, coordinates, attributes)
        return dataset.transpose(*reversed(names))

    def save(self, path: str | Path) -> Path:
        """Write the grid to a file, whose suffix says the format, and return its path.

        Parameters
        ----------
        path : path
            ``.vtkhdf``, image data for ParaView 5.12 or later; ``.nc``, NetCDF (``pip install 'alsph[tables]'``); or
            ``.csv``, one row a point.

        Raises
        ------
        ConfigError
            If the format is unknown, or xarray is not installed.
        RunFolderError
            If the file is a link or a special file.
        """
        path = Path(path)
        write = {".vtkhdf": self._write_image, ".nc": self._write_netcdf, ".csv": self._write_csv}
        if path.suffix not in write:
            raise ConfigError(f"{path}: a grid is written to a file that ends in {', '.join(write)}")
        check_target(path)
        with replacing(path) as temporary:
            write[path.suffix](temporary)
        return path

    def _write_image(self, path: Path) -> None:
        origin = [line[0] for line in self.axes.values()]
        spacing = [line[1] - line[0] if len(line) > 1 else 1.0 for line in self.axes.values()]
        vtkhdf.write_image(path, self.time, origin, spacing, self.fields)

    def _write_netcdf(self, path: Path) -> None:
        self.to_xarray().to_netcdf(path, engine="scipy")

    def _write_csv(self, path: Path) -> None:
        points = np.meshgrid(*self.axes.values(), indexing="ij")
        columns = dict(zip(self.axes, points, strict=True)) | self.components()
        rows = np.stack([column.ravel() for column in columns.values()], axis=1)
        np.savetxt(path, rows, "%.9g", ",", header=",".join(columns), comments="")


def grid(
    snapshot: Snapshot,
    own_spacing: float,
    spacing: float | None,
    box: tuple[FloatArray, FloatArray],
    domain: Domain,
) -> Grid:
    """Return the fields of a snapshot on a regular grid; see :meth:`alsph.Run.to_grid`."""
    spacing = own_spacing if spacing is None else spacing
    if not (isinstance(spacing, int | float) and 0 < spacing < LARGEST):
        raise ConfigError(f"spacing = {shown(spacing)}: must be a number above zero [D]")
    lower, upper = box
    cells = np.maximum(1.0, np.round((upper - lower) / spacing))
    if cells.prod() > MOST_POINTS:
        raise ConfigError(f"spacing = {spacing:g}: more than {MOST_POINTS:,} points; use a larger one or a smaller box")
    counts = cells.astype(int)
    axes = {
        name: low + (np.arange(count) + 0.5) * (high - low) / count
        for name, low, high, count in zip(AXES, lower, upper, counts, strict=False)
    }
    points = np.stack([line.ravel() for line in np.meshgrid(*axes.values(), indexing="ij")], axis=1)
    found = sampling.at(snapshot, points, own_spacing, domain)
    turning = found["velocity_gradient"]
    turning = turning - np.swapaxes(turning, 1, 2)  # [:, k, l] is du_k/dx_l - du_l/dx_k
    vorticity = turning[:, 1, 0] if len(axes) == 2 else turning[:, [2, 0, 1], [1, 2, 0]]
    fields = {"velocity": found["velocity"], "pressure": found["pressure"], "vorticity": vorticity}
    solid = sampling.in_solid(snapshot, points)
    for values in fields.values():
        values[solid] = np.nan
    return Grid(
        snapshot.time, axes, {name: values.reshape(*counts, *values.shape[1:]) for name, values in fields.items()}
    )


def cloud(snapshot: Snapshot) -> pyvista.PolyData:
    """Return the particles of a snapshot; see :meth:`alsph.Run.to_pyvista`."""
    points = vtkhdf.three_components(snapshot.position)
    found: pyvista.PolyData = _library("pyvista", "3d").PolyData(points)
    found["velocity"] = vtkhdf.three_components(snapshot.velocity)
    for name in ("pressure", "velocity_divergence", "vorticity", "kind"):
        found[name] = getattr(snapshot, name)
    found.field_data["time"] = [snapshot.time]
    return found


def _library(name: str, extra: str = "tables") -> Any:
    try:
        return import_module(name)
    except ImportError:
        raise ConfigError(f"this needs {name}: pip install {name}, or 'alsph[{extra}]'") from None
