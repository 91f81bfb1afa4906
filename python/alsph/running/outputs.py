"""What a run records beside particles and history."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alsph.analysis.sampling import in_solid
from alsph.arrays import FloatArray
from alsph.cases import answers
from alsph.cases.base import Case
from alsph.cases.free_surface import Gauges
from alsph.config import Config
from alsph.engine.output import Output
from alsph.engine.simulation import Simulation
from alsph.errors import ConfigError
from alsph.folder import samples
from alsph.geometry.lattice import lattice
from alsph.geometry.particles import Kind
from alsph.geometry.surface import Surface

PROBE_INTERVAL = 0.05
"""Time between two records of probes where none is given [D/U]."""

PLANE_INTERVAL = 0.5
"""The same of planes."""

ROUNDING = 1e-9
"""Depth below a surface up to which a point lies on it [D]."""


class Samples:
    """Fields at fixed points over time."""

    def __init__(self, file: str, interval: float, points: Mapping[str, NDArray[Any]]) -> None:
        self.file, self.interval, self.points = file, interval, points
        self.taken: list[tuple[float, Mapping[str, FloatArray]]] = []

    def sample(self, simulation: Simulation, rows: Mapping[str, NDArray[Any]]) -> dict[str, FloatArray]:
        """Return the ``velocity`` (m, d) and ``pressure`` (m,) at the points."""
        return simulation.sample(self.points["position"])

    def record(self, simulation: Simulation, rows: Mapping[str, NDArray[Any]]) -> None:
        """Sample the points."""
        self.taken.append((simulation.time, self.sample(simulation, rows)))

    def append(self, path: Path) -> None:
        """Append the samples."""
        if self.taken:
            times, fields = zip(*self.taken, strict=True)
            values = {name: np.stack([each[name] for each in fields]) for name in fields[0]}
            samples.append(path, np.array(times), self.points, values)
            self.taken = []

    def truncate(self, path: Path, time: float) -> None:
        """Drop later samples."""
        samples.truncate(path, time)


class ProbeSamples(Samples):
    """Fields at points over time, NaN while a body is there."""

    def sample(self, simulation: Simulation, rows: Mapping[str, NDArray[Any]]) -> dict[str, FloatArray]:
        """Return the ``velocity`` (m, d) and ``pressure`` (m,) at the points."""
        found = super().sample(simulation, rows)
        inside = _below_a_surface(self.points["position"], simulation.state())
        for values in found.values():
            values[inside] = np.nan
        return found


class Planes(Samples):
    """Fields on planes over time, NaN in bodies, which they may go through."""

    def sample(self, simulation: Simulation, rows: Mapping[str, NDArray[Any]]) -> dict[str, FloatArray]:
        """Return the ``velocity`` (m, d) and ``pressure`` (m,) at the points."""
        found, state = super().sample(simulation, rows), simulation.state()
        solid = in_solid(state["position"], state["kind"] != Kind.SOLID, self.points["position"])
        for values in found.values():
            values[solid] = np.nan
        return found


class SurfacePressure(Samples):
    """C_p = (p - p_0) / (½ρU²) on the surface of bodies, with p_0 the pressure at the inlet.

    The points go along with bodies that move; those that are kept are where these were at the start.
    """

    def __init__(self, points: Surface, interval: float, case: Case) -> None:
        super().__init__("surface.h5", interval, points.arrays())
        bodies = {body.name: (number, body.center) for number, body in enumerate(case.checked_bodies)}
        of_parts = [bodies[name] for name in case.surface_bodies]
        self.bodies, self.centres = (np.array(each)[points.part.astype(int)] for each in zip(*of_parts, strict=True))

    def sample(self, simulation: Simulation, rows: Mapping[str, NDArray[Any]]) -> dict[str, FloatArray]:
        """Return C_p."""
        pressure = simulation.sample(self._now(rows))["pressure"]
        return {"pressure_coefficient": 2 * (pressure - rows["inlet_pressure"][-1])}

    def _now(self, rows: Mapping[str, NDArray[Any]]) -> FloatArray:
        """Return where the points (m, 2) are."""
        position: FloatArray = self.points["position"]
        if "displacement" not in rows:
            return position
        way, angle = (rows[name][-1, self.bodies] for name in ("displacement", "angle"))
        (x, y), cos, sin = (position - self.centres).T, np.cos(angle[:, 0]), np.sin(angle[:, 0])
        return np.asarray(self.centres + way + np.stack([cos * x - sin * y, sin * x + cos * y], axis=1))


def remarks_of(config: Config, state: Mapping[str, Any]) -> list[str]:
    """Return what is to be said of a run's case, its bodies' way and its probes, given its particles at the start."""
    return [config.case.symbols(remark) for remark in (*config.remarks, *_in_a_body(config.probes, state))]


def _in_a_body(probes: FloatArray, state: Mapping[str, Any]) -> list[str]:
    """Remark on probes that lie in a body at the start."""
    inside = probes[_below_a_surface(probes, state)] if len(probes) else probes
    if not len(inside):
        return []
    where = ", ".join(f"{x:g}" for x in inside[0])
    are = "of the points lies" if len(inside) == 1 else "of the points lie"
    return [f"probes: {len(inside)} {are} in a body, as ({where}): nothing is recorded there; move them"]


def _below_a_surface(points: FloatArray, state: Mapping[str, Any]) -> NDArray[np.bool_]:
    """Whether points (m, d) lie below the surface of the solid particle next to them, and no fluid is nearer."""
    solid = np.asarray(state["kind"]) == Kind.SOLID
    if not solid.any():
        return np.zeros(len(points), bool)
    from scipy.spatial import KDTree  # takes its time

    position, normal, depth = (np.asarray(state[name])[solid] for name in ("position", "normal", "depth"))
    away, next_ = KDTree(position).query(points)
    below = np.asarray(((points - position[next_]) * normal[next_]).sum(axis=1) < depth[next_] - ROUNDING)
    if below.any():  # else no tree of all the fluid
        below[below] = away[below] < KDTree(np.asarray(state["position"])[~solid]).query(points[below])[0]
    return below


def outputs_of(config: Config) -> list[Output]:
    """Return what a run records: the pressure on the surface of its body, probes, planes, gauges, and its case's own.

    Raises
    ------
    ConfigError
        If an output of the case has a name or an interval that cannot be, or a probe or plane is not in the domain.
    """
    own = answers.listed(config.case, "outputs", Output, config.case.outputs)
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
    return [*_samples_of(config), *_gauges_of(config), *own]


def record(output: Output, simulation: Simulation, rows: Mapping[str, NDArray[Any]]) -> None:
    """Let an output keep what is to be known of the simulation, which it leaves as it is.

    Raises
    ------
    AlsphError
        If it fails, or would step or change the simulation: it names the output.
    """
    what = f"output {output.file}"
    with answers.told(f"{what}: {type(output).__name__}", output), simulation.lent(what):
        output.record(simulation, rows)


def _gauges_of(config: Config) -> Iterator[Gauges]:
    """Yield the depth of the water, where there are gauges."""
    if len(config.gauges):
        gauges = Gauges.of(config.case, config.gauges)
        gauges.interval = config.run.gauge_interval or gauges.interval
        yield gauges


def _samples_of(config: Config) -> Iterator[Samples]:
    """Yield the pressure on the surface of a body, probes and planes, where there are some."""
    run, points, probes = config.run, config.case.surface_points(), config.probes
    planes = [lattice(*axes) for axes in config.planes]
    if points:
        yield SurfacePressure(points, run.surface_interval, config.case)
    if len(probes):
        yield ProbeSamples("probes.h5", run.probe_interval or PROBE_INTERVAL, {"position": probes})
    if planes:
        number = np.repeat(np.arange(len(planes)), [*map(len, planes)])
        where = {"position": np.concatenate(planes), "plane": number}
        yield Planes("planes.h5", run.plane_interval or PLANE_INTERVAL, where)
