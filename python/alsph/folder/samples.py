"""Files of what is sampled at fixed points over time, ``surface.h5``, ``probes.h5`` and ``planes.h5``.

See docs/architecture.md.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alsph.arrays import FloatArray
from alsph.errors import OtherPointsError
from alsph.folder.durable import growing
from alsph.folder.reading import sound

CHUNK = 2**17
"""Most numbers of a chunk of an array in a file, if a record is not larger by itself."""


def append(path: Path, time: FloatArray, points: Mapping[str, NDArray[Any]], values: Mapping[str, FloatArray]) -> None:
    """Append samples at times (k,).

    Parameters
    ----------
    path
        The file.
    time
        Times (k,) [D/U].
    points
        Where they were taken, arrays (m, ...) by name, which a new file takes; those of one that is there must be the
        same, by the first of them.
    values
        Samples (k, m, ...) by name.

    Raises
    ------
    OtherPointsError
        If the file is of other points.
    """
    name, where = next(iter(points.items()))
    with growing(path) as file:
        if "time" not in file:
            for own, array in points.items():
                file[own] = array
            for own, samples in values.items():
                shape = samples.shape[1:]
                chunks = (max(1, min(64, CHUNK // max(1, math.prod(shape)))), *shape)
                file.create_dataset(own, (0, *shape), float, maxshape=(None, *shape), chunks=chunks)
            file.create_dataset("time", (0,), float, maxshape=(None,), chunks=(64,))
        elif file[name].shape != where.shape or not np.allclose(file[name], where, rtol=0, atol=1e-9):
            raise OtherPointsError("holds samples at other points")
        count = len(file["time"])
        for own, samples in {**values, "time": time}.items():
            file[own].resize(count + len(samples), axis=0)
            file[own][count:] = samples


def truncate(path: Path, time: float) -> None:
    """Keep the samples up to a time."""
    with growing(path) as file:
        times = sound(file, "time")[:]
        keep = int(np.searchsorted(times, time, side="right"))
        for name in file:
            if (samples := sound(file, name)).maxshape[0] is None:
                samples.resize(keep, axis=0)
