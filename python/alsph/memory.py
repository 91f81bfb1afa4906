"""How much memory can be had."""

import math
import os
import sys
from pathlib import Path

from alsph.errors import ConfigError

BYTES_PER_THREAD = 72 * 2**20
"""Of the address space: a thread's stack, and what the C library reserves for its allocations."""

OUTPUT_FACTOR = 1.5
"""What a run takes with its outputs, in terms of what it takes to step."""


def free_memory(threads: int = 0) -> float:
    """Return the memory that can be had without swapping and within the process's limits [bytes].

    Infinite where the system does not tell.

    Parameters
    ----------
    threads
        Threads that are yet to be started, which take of the limits.
    """
    return max(0.0, min(_available(), (_within_limits() - threads * BYTES_PER_THREAD) / OUTPUT_FACTOR))


def check(what: str, particles: int, bytes_per_particle: float, threads: int | None) -> None:
    """Refuse to make more particles than fit into the memory that is free: the engine cannot bear that it runs out.

    Parameters
    ----------
    what
        What asks for them.
    particles
        Number of particles.
    bytes_per_particle
        What each takes.
    threads
        Number of threads; all cores if None.

    Raises
    ------
    ConfigError
        If there are too many.
    """
    needed, free = particles * bytes_per_particle, free_memory(threads or os.cpu_count() or 1)
    if needed > free:
        raise ConfigError(
            f"{what}: about {particles:,} particles need {needed / 2**30:.2g} GiB of memory and {free / 2**30:.2g} GiB "
            "are free; lower the resolution"
        )


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
