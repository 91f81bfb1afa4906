"""What a run records beside particles and history."""

import re
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alsph.config import Config
from alsph.engine.output import Output
from alsph.engine.simulation import Simulation
from alsph.errors import ConfigError
from alsph.folder import surface
from alsph.geometry.surface import Surface


class SurfacePressure:
    """C_p = (p - p_0) / (½ρU²) on a surface, with p_0 the pressure at the inlet."""

    file = "surface.h5"

    def __init__(self, points: Surface, interval: float) -> None:
        self.points, self.interval = points, interval
        self.samples: list[tuple[float, Any]] = []

    def record(self, simulation: Simulation, rows: Mapping[str, NDArray[Any]]) -> None:
        """Sample the surface."""
        pressure = simulation.sample(self.points.position)["pressure"]
        self.samples.append((simulation.time, 2 * (pressure - rows["inlet_pressure"][-1])))

    def append(self, path: Path) -> None:
        """Append the samples."""
        if self.samples:
            times, samples = (np.array(values) for values in zip(*self.samples, strict=True))
            surface.append(path, times, self.points.arrays(), samples)
            self.samples = []

    def truncate(self, path: Path, time: float) -> None:
        """Drop later samples."""
        surface.truncate(path, time)


def outputs_of(config: Config) -> list[Output]:
    """Return what a run records: the pressure on the surface of its body, if it has one, and what its case adds.

    Raises
    ------
    ConfigError
        If an output of the case has a name or an interval that cannot be.
    """
    points, own = config.case.surface_points(), config.case.outputs()
    for output in own:
        if not (isinstance(output.file, str) and re.fullmatch(r"output_\w+\.\w+", output.file)):
            raise ConfigError(
                f"case '{config.case.name}': the file {output.file!r} of an output must be called output_NAME.csv"
            )
        if not (isinstance(output.interval, int | float) and output.interval > 0):
            raise ConfigError(f"output {output.file}: its interval, {output.interval!r}, must be above zero [D/U]")
    for name, count in Counter(output.file for output in own).items():
        if count > 1:
            raise ConfigError(f"case '{config.case.name}': {count} outputs have the file {name}; one file, one output")
    return [*([SurfacePressure(points, config.run.surface_interval)] if points else []), *own]
