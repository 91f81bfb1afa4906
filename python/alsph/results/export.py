"""Results as tables and grids of other libraries, which need not be installed until they are asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from alsph.analysis import sampling
from alsph.arrays import AXES, FloatArray
from alsph.errors import ConfigError
from alsph.geometry.particles import Snapshot
from alsph.text import shown

if TYPE_CHECKING:
    import pandas
    import xarray

MOST_POINTS, LARGEST = 20_000_000, 1e15


def table(history: dict[str, FloatArray]) -> pandas.DataFrame:
    """Return the history of a run, one row a step; see :meth:`alsph.Run.to_pandas`."""
    frame: pandas.DataFrame = _library("pandas").DataFrame(history)
    return frame.set_index("time")


def grid(
    snapshot: Snapshot,
    own_spacing: float,
    spacing: float | None,
    box: tuple[FloatArray, FloatArray],
    domain: Mapping[str, Any],
) -> xarray.Dataset:
    """Return the fields of a snapshot on a regular grid; see :meth:`alsph.Run.to_xarray`."""
    library = _library("xarray")
    spacing = own_spacing if spacing is None else spacing
    if not (isinstance(spacing, int | float) and 0 < spacing < LARGEST):
        raise ConfigError(f"spacing = {shown(spacing)}: must be a number above zero [D]")
    lower, upper = box
    cells = np.maximum(1.0, np.round((upper - lower) / spacing))
    if cells.prod() > MOST_POINTS:
        raise ConfigError(f"spacing = {spacing:g}: more than {MOST_POINTS:,} points; use a larger one or a smaller box")
    counts = cells.astype(int)
    names = AXES[: len(counts)]
    lines = {
        name: low + (np.arange(count) + 0.5) * (high - low) / count
        for name, low, high, count in zip(names, lower, upper, counts, strict=True)
    }
    points = np.stack([line.ravel() for line in np.meshgrid(*lines.values(), indexing="ij")], axis=1)
    found = sampling.at(snapshot, points, own_spacing, domain)

    def field(values: FloatArray, name: str, units: str) -> tuple[Sequence[str], FloatArray, dict[str, str]]:
        return names, values.reshape(counts), {"long_name": name, "units": units}

    fields = {
        f"velocity_{name}": field(found["velocity"][:, axis], f"velocity along {name}", "U")
        for axis, name in enumerate(names)
    }
    fields["pressure"] = field(found["pressure"], "pressure", "rho U^2")
    turning = found["velocity_gradient"]
    if len(names) == 2:
        fields["vorticity"] = field(turning[:, 1, 0] - turning[:, 0, 1], "vorticity", "U/D")
    coordinates = {name: (name, line, {"units": "D"}) for name, line in lines.items()}
    dataset: xarray.Dataset = library.Dataset(fields, coordinates, {"time": snapshot.time, "time_units": "D/U"})
    return dataset.transpose(*reversed(names))


def _library(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError:
        raise ConfigError(f"this needs {name}: pip install {name}, or 'alsph[tables]'") from None
