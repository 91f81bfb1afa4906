"""Results on grids, in files, and as objects of other libraries, which are needed only when they are asked for."""

from __future__ import annotations

import math
import re
from abc import abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from alsph.analysis import sampling
from alsph.analysis.probes import Probes
from alsph.analysis.vortices import DERIVED, vorticity
from alsph.arguments import number, path_of
from alsph.arrays import AXES, FloatArray
from alsph.errors import ConfigError, RunFolderError
from alsph.folder import vtkhdf
from alsph.folder.durable import check_target, replacing
from alsph.folder.run_folder import OWN
from alsph.geometry.domain import Domain
from alsph.geometry.lattice import cell_counts, cell_middles, lattice
from alsph.geometry.particles import Snapshot
from alsph.parameters import choose
from alsph.symbols import GENERAL, Symbols
from alsph.text import shown
from alsph.units import QUANTITIES, Quantity, Units

if TYPE_CHECKING:
    import pandas
    import pyvista
    import xarray

MOST_POINTS = 20_000_000

FORMATS = {"vtkhdf": ".vtkhdf", "vti": ".vti", "netcdf": ".nc", "csv": ".csv"}
"""Formats of grids, and how their files end."""
UNITS = {"velocity": "U", "pressure": "rho U^2", "vorticity": "U/D", **dict.fromkeys(DERIVED, "U^2/D^2")}
IN_SI: dict[str, tuple[Quantity, int]] = {
    "time": ("time", 1),
    "length": ("length", 1),
    "velocity": ("velocity", 1),
    "pressure": ("pressure", 1),
    "vorticity": ("rate", 1),
    **dict.fromkeys(DERIVED, ("rate", 2)),
}
"""Quantity of each field, and its exponent."""

EXPORTED = re.compile(r"(flow(_si)?\.(vtkhdf|vti|nc|csv))|(probes(_si)?\.csv)")
"""Files of a run folder that may be written again."""


def table(history: dict[str, FloatArray]) -> pandas.DataFrame:
    """Return the history of a run, one row a step; see :meth:`alsph.Run.to_pandas`."""
    frame: pandas.DataFrame = _library("pandas").DataFrame(history)
    return frame.set_index("time")


class InUnits:
    """What has times, axes and fields in D, U and ρ, and can be put into SI."""

    time: Any
    axes: dict[str, FloatArray]
    si: bool

    def in_si(self, units: Units) -> Self:
        """Return it in SI: lengths in m, velocities in m/s, pressures in Pa, times in s.

        Parameters
        ----------
        units : Units
            What D, U and ρ are, as ``run.units``.

        Raises
        ------
        ConfigError
            If it is so already, or there are no units.
        """
        if self.si:
            raise ConfigError("in_si: it is in SI already")
        if not isinstance(units, Units):
            raise ConfigError(f"in_si: units = {shown(units)}: must be alsph.Units; a run that was given none has none")
        axes = {name: line * _factor("length", units) for name, line in self.axes.items()}
        own: Any = self  # a dataclass
        time = self.time * _factor("time", units)
        found: Self = replace(own, time=time, axes=axes, si=True, **self._scaled(units))
        return found

    @abstractmethod
    def _scaled(self, units: Units) -> dict[str, Any]:
        """Return all else that has a unit, in SI."""


@dataclass(frozen=True, eq=False)
class Grid(InUnits):
    """The fields of a snapshot in the middles of the cells of a regular grid; see :meth:`alsph.Run.to_grid`.

    Attributes
    ----------
    time : float
        tU/D.
    axes : dict of ndarray
        Coordinates along ``x``, ``y`` and, in 3-D, ``z`` [D].
    fields : dict of ndarray
        ``velocity`` (nx, ny, 2) [U], ``pressure`` (nx, ny) [ρU²] and ``vorticity`` (nx, ny) [U/D]; in 3-D velocity
        and vorticity are of shape (nx, ny, nz, 3). Also ``q_criterion`` and ``lambda_2`` [U²/D²], of the shape of the
        pressure, if they were asked for. NaN in bodies and where there is no fluid.
    symbols : Symbols
        What units are told in.
    si : bool
        Whether all is in SI (:meth:`in_si`).
    """

    time: float
    axes: dict[str, FloatArray]
    fields: dict[str, FloatArray]
    symbols: Symbols = GENERAL
    si: bool = False

    def _scaled(self, units: Units) -> dict[str, Any]:
        return {"fields": {name: values * _factor(name, units) for name, values in self.fields.items()}}

    def components(self) -> dict[str, FloatArray]:
        """Return the fields with each component of a vector by itself: ``velocity_x``, ``velocity_y``, ..."""
        return dict(_components(self.fields, len(self.axes)))

    def to_xarray(self) -> xarray.Dataset:
        """Return the grid as a data set of xarray."""
        dataset = _dataset(self.axes, self.fields, self.symbols, self.si)
        return dataset.assign_attrs(time=self.time, time_units=_unit("time", self.symbols, self.si))

    def save(self, path: str | Path) -> Path:
        """Write the grid to a file, whose suffix says the format, and return its path.

        Parameters
        ----------
        path : path
            ``.vtkhdf``, image data for ParaView 5.12 or later; ``.vti``, the same for any (``alsph[3d]``);
            ``.nc``, NetCDF (``pip install 'alsph[tables]'``); or ``.csv``, one row a point.

        Raises
        ------
        ConfigError
            If the format is unknown, or a library that it needs is not installed.
        RunFolderError
            If the file is a link or a special file.
        """
        path = path_of("path", path)
        write = {
            ".vtkhdf": self._write_image,
            ".vti": self._write_xml_image,
            ".nc": self._write_netcdf,
            ".csv": self._write_csv,
        }
        if path.suffix not in write:
            raise ConfigError(f"{path}: a grid is written to a file that ends in {', '.join(write)}")
        _check(path)
        with replacing(path) as temporary:
            write[path.suffix](temporary)
        return path

    def _frame(self) -> tuple[list[float], list[float]]:
        """Return the first point and the distances of points along the axes."""
        lines = self.axes.values()
        return [line[0] for line in lines], [line[1] - line[0] if len(line) > 1 else 1.0 for line in lines]

    def _write_image(self, path: Path) -> None:
        vtkhdf.write_image(path, self.time, *self._frame(), self.fields)

    def _write_xml_image(self, path: Path) -> None:
        origin, spacing = self._frame()
        counts = [*map(len, self.axes.values())]
        more = 3 - len(counts)
        image = _library("pyvista", "3d").ImageData(
            dimensions=counts + [1] * more, spacing=spacing + [1.0] * more, origin=origin + [0.0] * more
        )
        for name, values in self.fields.items():
            vector = vtkhdf.three_components(values) if values.ndim > len(counts) else values
            table = vector.reshape(math.prod(counts), -1, order="F")  # the first axis fastest
            image.point_data[name] = table.astype(np.float32)
        image.field_data["TimeValue"] = [self.time]
        writer = import_module("vtkmodules.vtkIOXML").vtkXMLImageDataWriter()
        writer.SetFileName(str(path))
        writer.SetInputData(image)
        if not writer.Write():
            raise RunFolderError(f"{path}: cannot be written; is the disk full?")

    def _write_netcdf(self, path: Path) -> None:
        self.to_xarray().to_netcdf(path, engine="scipy")

    def _write_csv(self, path: Path) -> None:
        points = np.meshgrid(*self.axes.values(), indexing="ij")
        _write_columns(dict(zip(self.axes, points, strict=True)) | self.components(), path)


@dataclass(frozen=True, eq=False)
class PlaneRecord(InUnits):
    """Velocity and pressure that a run recorded on a plane, at points of a grid; NaN in bodies; see `planes`.

    Attributes
    ----------
    time : ndarray, shape (k,)
        Times [D/U].
    axes : dict of ndarray
        Coordinates along the axes that the plane extends along, of ``x``, ``y`` and ``z`` [D].
    place : dict of float
        Its place on the others [D].
    velocity : ndarray, shape (k, ..., d)
        Velocities [U], with an axis for each of `axes`.
    pressure : ndarray, shape (k, ...)
        Pressures [ρU²].
    symbols : Symbols
        What units are told in.
    si : bool
        Whether all is in SI (:meth:`in_si`).
    """

    time: FloatArray
    axes: dict[str, FloatArray]
    place: dict[str, float]
    velocity: FloatArray
    pressure: FloatArray
    symbols: Symbols = GENERAL
    si: bool = False

    def _scaled(self, units: Units) -> dict[str, Any]:
        length = _factor("length", units)
        return {
            "place": {name: at * length for name, at in self.place.items()},
            "velocity": self.velocity * _factor("velocity", units),
            "pressure": self.pressure * _factor("pressure", units),
        }

    def to_xarray(self) -> xarray.Dataset:
        """Return the record as a data set of xarray.

        Raises
        ------
        ConfigError
            If xarray is not installed.
        """
        axes = {"time": self.time, **self.axes}
        fields = {"velocity": self.velocity, "pressure": self.pressure}
        return _dataset(axes, fields, self.symbols, self.si).assign_coords(self.place)


def plane_records(found: Probes, grids: list[tuple[FloatArray, ...]], symbols: Symbols) -> list[PlaneRecord]:
    """Return what was recorded on each plane, given by the coordinates of its points along x, y and z.

    Raises
    ------
    RunFolderError
        If it was recorded on others.
    """
    counts = [math.prod(map(len, axes)) for axes in grids]
    points = np.concatenate([found.position[:0], *(lattice(*axes) for axes in grids)])
    same = points.shape == found.position.shape and np.allclose(points, found.position, rtol=0, atol=1e-9)
    if len(found.time) and not same:
        raise RunFolderError(
            f"planes.h5: its {len(found.position)} points are not the {len(points)} of the planes in case.toml; "
            "one of the two files is of another run, or case.toml was changed"
        )
    ends, records = np.cumsum([0, *counts]), []
    for axes, first, end in zip(grids, ends[:-1], ends[1:], strict=True):
        extended = {name: line for name, line in zip(AXES, axes, strict=False) if len(line) > 1}
        place = {name: float(line[0]) for name, line in zip(AXES, axes, strict=False) if len(line) == 1}
        shape = len(found.time), *map(len, extended.values())
        velocity = found.velocity[:, first:end].reshape(*shape, len(axes))
        pressure = found.pressure[:, first:end].reshape(shape)
        records.append(PlaneRecord(found.time, extended, place, velocity, pressure, symbols))
    return records


def _components(fields: dict[str, FloatArray], axes: int) -> Iterator[tuple[str, FloatArray]]:
    """Yield fields on a number of axes by name, each component of a vector by itself."""
    for name, values in fields.items():
        if values.ndim == axes:
            yield name, values
        else:
            yield from ((f"{name}_{axis}", values[..., k]) for k, axis in enumerate(AXES[: values.shape[-1]]))


def save_probes(found: Probes, path: str | Path, units: Units | None = None) -> Path:
    """Write what probes recorded to a CSV file, one row for each time and point, and return its path.

    Parameters
    ----------
    found : Probes
    path : path
        The file.
    units : Units, optional
        What D, U and ρ are, to have it in SI.

    Raises
    ------
    ConfigError
        If nothing was recorded, or the file does not end in .csv.
    RunFolderError
        If the file is a link or a special file.
    """
    path = path_of("path", path)
    if path.suffix != ".csv":
        raise ConfigError(f"{path}: what probes recorded is written to a file that ends in .csv")
    if not len(found.time):
        raise ConfigError("nothing was recorded: the run has no probes")
    columns = found.columns()
    if units:
        of = {name: "length" for name in AXES} | {name: name.partition("_")[0] for name in columns if name not in AXES}
        columns = {name: values * _factor(of[name], units) for name, values in columns.items()}
    _check(path)
    with replacing(path) as temporary:
        _write_columns(columns, temporary)
    return path


def _check(path: Path) -> None:
    """Make the folder of a file, which cannot be one that a run needs."""
    path.parent.mkdir(parents=True, exist_ok=True)
    own = OWN.fullmatch(path.name) or (path.name.startswith("output_") and path.exists())
    if (path.parent / "run.json").is_file() and own and not EXPORTED.fullmatch(path.name):
        raise RunFolderError(f"{path}: a file of the run itself; choose another name")
    check_target(path)


def _write_columns(columns: dict[str, FloatArray], path: Path) -> None:
    rows = np.stack([column.ravel() for column in columns.values()], axis=1)
    np.savetxt(path, rows, "%.9g", ",", header=",".join(columns), comments="")


def _factor(field: str, units: Units) -> float:
    """Return what one unit of a field, or of a time or length, is in SI."""
    quantity, power = IN_SI[field]
    return units.factor(quantity) ** power


def _unit(field: str, symbols: Symbols, si: bool) -> str:
    """Return the unit of a field, or of a time or length."""
    if si:
        quantity, power = IN_SI[field]
        unit = QUANTITIES[quantity][0]
        return unit if power == 1 else f"{unit}^{power}"
    return symbols(UNITS[field]) if field in UNITS else symbols.time if field == "time" else symbols.length


def told_units(fields: Iterable[str], symbols: Symbols = GENERAL, *, si: bool = False) -> str:
    """Return in words what times, lengths and fields are in, which a table's file does not say."""
    return ", ".join(f"{name.replace('_', ' ')} in {_unit(name, symbols, si)}" for name in ("time", "length", *fields))


def _dataset(axes: dict[str, FloatArray], fields: dict[str, FloatArray], symbols: Symbols, si: bool) -> xarray.Dataset:
    """Return fields as a data set of xarray: over time, if it is among the axes, then along z, y and x."""
    columns = {
        name: ([*axes], values, {"long_name": _long_name(name, own), "units": _unit(own, symbols, si)})
        for own, field in fields.items()
        for name, values in _components({own: field}, len(axes))
    }
    units = {name: {"units": _unit("time" if name == "time" else "length", symbols, si)} for name in axes}
    lines = {name: (name, line, units[name]) for name, line in axes.items()}
    dataset: xarray.Dataset = _library("xarray").Dataset(columns, lines)
    return dataset.transpose(*[name for name in ("time", *reversed(AXES)) if name in axes])


def _long_name(name: str, field: str) -> str:
    return field.replace("_", " ") + (f" along {name[-1]}" if name != field else "")


def grid(
    snapshot: Snapshot,
    own_spacing: float,
    spacing: float | None,
    box: tuple[FloatArray, FloatArray],
    domain: Domain,
    derived: Sequence[str] = (),
    symbols: Symbols = GENERAL,
) -> Grid:
    """Return the fields of a snapshot on a regular grid; see :meth:`alsph.Run.to_grid`."""
    spacing = own_spacing if spacing is None else number("spacing", spacing, above=0, unit="D", finite=True)
    lower, upper = box
    check_derived(derived)
    counts = cell_counts(lower, upper, spacing)
    if counts.prod() > MOST_POINTS:
        raise ConfigError(f"spacing = {spacing:g}: more than {MOST_POINTS:,} points; use a larger one or a smaller box")
    axes = dict(zip(AXES, cell_middles(lower, upper, counts), strict=False))
    points = lattice(*axes.values())
    found = sampling.at(snapshot, points, own_spacing, domain)
    gradient = found["velocity_gradient"]
    fields = {"velocity": found["velocity"], "pressure": found["pressure"], "vorticity": vorticity(gradient)}
    fields |= {name: DERIVED[name](gradient) for name in derived}
    solid = sampling.in_solid(snapshot.position, snapshot.fluid, points)
    for values in fields.values():
        values[solid] = np.nan
    shape = [*map(len, axes.values())]
    shaped = {name: values.reshape(*shape, *values.shape[1:]) for name, values in fields.items()}
    return Grid(snapshot.time, axes, shaped, symbols)


def check_derived(derived: Sequence[str]) -> None:
    """Refuse fields that are not known.

    Raises
    ------
    ConfigError
        If there are some, or `derived` is no list of them.
    """
    if isinstance(derived, str) or not isinstance(derived, Iterable):
        raise ConfigError(f"derived = {shown(derived)}: must be a list of fields, such as ['q_criterion']")
    for name in derived:
        choose("field", name, DERIVED)


def cloud(snapshot: Snapshot, spacing: float, derived: Sequence[str] = ()) -> pyvista.PolyData:
    """Return the particles of a snapshot; see :meth:`alsph.Run.to_pyvista`."""
    check_derived(derived)
    points = vtkhdf.three_components(snapshot.position)
    found: pyvista.PolyData = _library("pyvista", "3d").PolyData(points)
    found["velocity"] = vtkhdf.three_components(snapshot.velocity)
    for name in ("pressure", "velocity_divergence", "vorticity", "kind"):
        found[name] = getattr(snapshot, name)
    if derived:
        gradient = sampling.velocity_gradient(snapshot, snapshot.position, spacing)
        gradient[~snapshot.fluid] = np.nan
        for name in derived:
            found[name] = DERIVED[name](gradient)
    found.field_data["time"] = [snapshot.time]
    return found


def _library(name: str, extra: str = "tables") -> Any:
    try:
        return import_module(name)
    except ImportError:
        raise ConfigError(f"this needs {name}: pip install 'alsph[{extra}]'") from None
