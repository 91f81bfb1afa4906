"""The file of the surface pressure, ``surface.h5``: see docs/architecture.md."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from alsph.arrays import FloatArray
from alsph.folder.durable import growing
from alsph.folder.reading import sound


def append(path: Path, time: FloatArray, points: Mapping[str, FloatArray], pressure_coefficient: FloatArray) -> None:
    """Append samples (k, m) of C_p at times (k,).

    A new file also takes the `points`, arrays (m, ...) by name, ``angle`` among them
    (:class:`alsph.geometry.surface.Surface`).
    """
    with growing(path) as file:
        count = len(points["angle"])
        if "time" not in file:
            for name, values in points.items():
                file[name] = values
            file.create_dataset("pressure_coefficient", (0, count), float, maxshape=(None, count), chunks=(64, count))
            file.create_dataset("time", (0,), float, maxshape=(None,), chunks=(64,))
        elif not (len(file["angle"]) == count and np.allclose(file["angle"], points["angle"])):
            raise ValueError("it was sampled at other points, by another version of alsph")
        samples = len(file["time"])
        for name, values in (("pressure_coefficient", pressure_coefficient), ("time", time)):
            file[name].resize(samples + len(values), axis=0)
            file[name][samples:] = values


def truncate(path: Path, time: float) -> None:
    """Keep the samples up to a time."""
    with growing(path) as file:
        keep = int(np.searchsorted(sound(file, "time")[:], time, side="right"))
        for name in ("pressure_coefficient", "time"):
            sound(file, name).resize(keep, axis=0)
