"""Words of arrays that all files share."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

Arrays = dict[str, NDArray[Any]]
"""Arrays by name, such as those of particles."""

AXES = ("x", "y", "z")


def size_of(arrays: dict[str, Any]) -> int:
    """Return the size of arrays in memory [bytes]."""
    return sum(np.asarray(array).nbytes for array in arrays.values())
