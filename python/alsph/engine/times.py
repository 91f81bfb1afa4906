"""Times that a simulation steps to, of the flow and of the clock."""

import math
import time as clock
from collections.abc import Iterator

from alsph.arguments import number

SLICE_SECONDS = 0.2
"""Longest time in the engine without a look at signals, so that Ctrl-C works."""


def next_multiple(time: float, interval: float) -> float:
    """Return the smallest multiple of `interval` after `time`, the same one for each time up to it, to the last bit."""
    count = math.floor(min(time / interval, 1e300))
    multiples = ((count + k) * interval for k in range(3))
    return next((multiple for multiple in multiples if multiple > time), math.nextafter(time, math.inf))


def slices(wall_seconds: float) -> Iterator[float]:
    """Yield the lengths of short slices of `wall_seconds` until they have passed."""
    end = clock.monotonic() + number("wall_seconds", wall_seconds)
    while (left := end - clock.monotonic()) > 0:
        yield min(left, SLICE_SECONDS)
