"""How much memory can be had."""

import math
import os
import sys
from pathlib import Path


def free_memory() -> float:
    """Return the memory that can be had without swapping and within the process's limits [bytes].

    Infinite where the system does not tell.
    """
    return max(0.0, min(_available(), _within_limits()))


def _available() -> float:
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return float(line.split()[1]) * 1024
        return float(os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (OSError, ValueError):
        return math.inf


def _within_limits() -> float:
    """Return what the limits of ``ulimit -v`` and ``-d`` leave."""
    if sys.platform != "linux":
        return math.inf
    import resource

    try:
        pages = [int(number) for number in Path("/proc/self/statm").read_text().split()]
    except (OSError, ValueError):
        return math.inf
    used = {resource.RLIMIT_AS: pages[0], resource.RLIMIT_DATA: pages[5]}
    limits = {kind: resource.getrlimit(kind)[0] for kind in used}
    left = [limits[kind] - used[kind] * os.sysconf("SC_PAGE_SIZE") for kind in used if limits[kind] >= 0]
    return float(min(left, default=math.inf))
