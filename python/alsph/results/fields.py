"""What a run folder holds: history, snapshots, probes, planes, and fields at points and on grids that come of them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from alsph.analysis import averages, sampling
from alsph.analysis.averages import Window
from alsph.analysis.probes import Probes
from alsph.arrays import AXES, FloatArray
from alsph.config import Config, of_run
from alsph.errors import ConfigError, RunFolderError
from alsph.folder import reading
from alsph.folder.durable import mark
from alsph.geometry.particles import Snapshot, check_part
from alsph.geometry.points import checked_box, checked_points
from alsph.results import export
from alsph.results.export import Grid, PlaneRecord
from alsph.symbols import GENERAL, Symbols
from alsph.text import shown

if TYPE_CHECKING:
    import pandas
    import pyvista
    import xarray

FARTHEST = 0.5
"""How far from the only snapshot a time may lie that is asked for [D/U]."""


class Fields:
    """The part of :class:`alsph.Run` that reads history, particles, probes and planes."""

    path: Path
    case: dict[str, Any]
    info: dict[str, Any]
    _folder: Path
    _seen = ""

    def file(self, name: str) -> Path:
        """Return a file or folder in the run folder, wherever the working directory has gone since it was opened.

        Raises
        ------
        RunFolderError
            If another run has been made in the folder since.
        """
        written = self._folder / "run.json"
        if (seen := mark(written)) != self._seen:
            both = self.info, reading.info(written)
            began = ((info.get("start"), info.get("segments", [])[:1]) for info in both)  # the particles, and the case
            if any(one and other and one != other for one, other in zip(*began, strict=True)):
                raise RunFolderError(
                    f"{self.path}: another run has been made there since this one was opened; open it anew"
                )
            self._seen = seen
        return self._folder / name

    @property
    @abstractmethod
    def window(self) -> Window:
        """Averaging window."""

    @property
    def spacing(self) -> float:
        """Particle spacing Δx [D]."""
        return 1.0 / float(self.case["resolution"])

    @cached_property
    def config(self) -> Config:
        """The case and the settings of the run, as the objects that :attr:`case` was written from."""
        return of_run(self.file("case.toml").parent)

    @cached_property
    def symbols(self) -> Symbols:
        """What the case calls D and U."""
        try:
            return self.config.case.symbols
        except RunFolderError:  # of a case that is not known
            return GENERAL

    @cached_property
    def times(self) -> FloatArray:
        """Times tU/D of the snapshots, shape (k,)."""
        return reading.snapshot_times(self.file("particles.vtkhdf"))

    def snapshot(self, time: float | None = None) -> Snapshot:
        """Particles of the snapshot nearest to a time tU/D, the last one if None.

        Raises
        ------
        ConfigError
            If the time is no finite number, or farther from all snapshots than they are from each other.
        RunFolderError
            If there is no complete snapshot.
        """
        if time is not None and not (isinstance(time, int | float | np.number) and np.isfinite(time)):
            raise ConfigError(f"time = {shown(time)}: must be a finite number")
        if len(self.times) == 0:
            raise RunFolderError(f"{self.path}: no snapshot yet; wait for the first one or lower output_interval")
        index = len(self.times) - 1 if time is None else int(np.abs(self.times - time).argmin())
        apart = np.diff(self.times).max() if len(self.times) > 1 else FARTHEST
        if time is not None and abs(self.times[index] - time) > apart:
            first, last = self.times[[0, -1]]
            raise ConfigError(f"time = {time:g}: no snapshot near it, they are of t* = {first:.6g} to {last:.6g}")
        found = reading.snapshot(self.file("particles.vtkhdf"), index)
        with suppress(RunFolderError):  # of a case that is not known the particles can be read all the same
            return replace(found, domain=self.config.case.checked_domain, solid=self._solid_height(found.time))
        return found

    def _solid_height(self, time: float) -> Callable[[FloatArray], FloatArray | None]:
        """Return what tells how far points lie outside of bodies and walls, :meth:`alsph.cases.Case.solid_height`.

        A body that moves, and is the only one, is taken to where it had come by that time. Of several it is not known
        which is where, but by their particles.
        """
        case, bodies = self.config.case, self.config.case.checked_bodies
        if not ("motion" in case.rules or any(body.moves or body.rigid for body in bodies)):
            return case.solid_height
        if len(bodies) != 1:
            return lambda position: None
        history: dict[str, FloatArray] = {}
        with suppress(RunFolderError):  # without it the body is where it begins
            history = self.history
        axes = AXES[: case.space_dimensions]
        columns = [f"{bodies[0].name}_displacement_{axis}" for axis in axes]
        if columns[0] not in history:
            return case.solid_height
        steps = np.append(0.0, history["time"])
        way, turn = (
            [np.interp(time, steps, np.append(0.0, history[name])) for name in names if name in history]
            for names in (columns, [f"{bodies[0].name}_angle"])
        )
        centre, angle = np.array(bodies[0].center), sum(turn)
        back = np.eye(len(axes))
        back[:2, :2] = [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
        return lambda position: case.solid_height((position - centre - way) @ back.T + centre)

    @cached_property
    def probes(self) -> Probes:
        """Velocity and pressure at the probes over time; empty without any."""
        return reading.probes(self.file("probes.h5"), self.config.case.space_dimensions)

    @cached_property
    def planes(self) -> list[PlaneRecord]:
        """Velocity and pressure on each of the run's planes over time; none without any.

        Raises
        ------
        RunFolderError
            If the file is damaged, or of other planes than the configuration's.
        """
        grids = self.config.planes
        found = reading.probes(self.file("planes.h5"), self.config.case.space_dimensions)
        return export.plane_records(found, grids, self.symbols)

    def sample(self, points: ArrayLike, time: float | None = None) -> dict[str, FloatArray]:
        """Velocity, pressure and their gradients at any points of a snapshot.

        Parameters
        ----------
        points : array_like, shape (m, d)
            The points [D].
        time : float, optional
            The snapshot nearest to it is taken [D/U]; the last one if None.

        Returns
        -------
        dict of ndarray
            ``velocity`` (m, d), ``pressure`` (m,), ``velocity_gradient`` (m, d, d), the derivative of component k
            along direction l at [:, k, l], and ``pressure_gradient`` (m, d), by quadratic moving least squares; NaN
            outside of the domain, beyond a free surface and where no fluid is within 1.5 Δx.

        Raises
        ------
        ConfigError
            If `points` are none, or `time` is no number.
        RunFolderError
            If there is no snapshot.
        """
        case = self.config.case
        checked = checked_points(points, case.space_dimensions)
        return sampling.at(self.snapshot(time), checked, self.spacing, case.checked_domain)

    @cached_property
    def history(self) -> dict[str, FloatArray]:
        """Columns of ``history.csv``, one entry a step; only an empty ``time`` before the first step."""
        return reading.history(self.file("history.csv"))

    def to_pandas(self) -> pandas.DataFrame:
        """Return the history as a table of pandas, one row a step, by time tU/D.

        Raises
        ------
        ConfigError
            If pandas is not installed.
        """
        return export.table(self.history)

    def to_grid(
        self,
        time: float | None = None,
        spacing: float | None = None,
        lower: Sequence[float] | None = None,
        upper: Sequence[float] | None = None,
        derived: Sequence[str] = (),
    ) -> Grid:
        """Return velocity, pressure and vorticity of a snapshot on a regular grid, by :meth:`sample`; NaN in bodies.

        ``run.to_grid().save("flow.vtkhdf")`` makes a file for ParaView, ``"flow.nc"`` and ``"flow.csv"`` for others.

        Parameters
        ----------
        time : float, optional
            The snapshot nearest to it is taken [D/U]; the last one if None.
        spacing : float, optional
            Of the grid [D]; that of the particles if None.
        lower, upper : sequence of float, optional
            Corners of the box that is covered with cells, whose middles the values are of [D]; those of the domain if
            None.
        derived : sequence of {"q_criterion", "lambda_2"}
            Fields that are computed from the velocity gradient, too.

        Raises
        ------
        ConfigError
            If there is no such grid or field.
        """
        domain = self.config.case.checked_domain
        corners = domain.lower if lower is None else lower, domain.upper if upper is None else upper
        box = checked_box(*corners, domain.dimensions)
        snapshot, axes = self.snapshot(time), range(domain.dimensions)
        check_part(f"box from {box[0].tolist()} to {box[1].tolist()}", snapshot, *box, axes)
        return export.grid(snapshot, self.spacing, spacing, box, domain, derived, self.symbols)

    def to_xarray(
        self,
        time: float | None = None,
        spacing: float | None = None,
        lower: Sequence[float] | None = None,
        upper: Sequence[float] | None = None,
        derived: Sequence[str] = (),
    ) -> xarray.Dataset:
        """Return :meth:`to_grid`, which says what the parameters are, as a data set of xarray.

        Raises
        ------
        ConfigError
            If xarray is not installed, or there is no such grid.
        """
        return self.to_grid(time, spacing, lower, upper, derived).to_xarray()

    def to_pyvista(self, time: float | None = None, derived: Sequence[str] = ()) -> pyvista.PolyData:
        """Return the particles of the snapshot nearest to a time [D/U], of the last one if None, as points of pyvista.

        With the fields `derived` of them as :meth:`to_grid` has them.

        Raises
        ------
        ConfigError
            If pyvista is not installed (``pip install 'alsph[3d]'``), or there is no such field.
        """
        return export.cloud(self.snapshot(time), self.spacing, derived)

    def momentum_balance(self, lower: tuple[float, ...], upper: tuple[float, ...]) -> FloatArray:
        """Mean force coefficients from the momentum balance of a box around the body: a check of the recorded loads.

        Parameters
        ----------
        lower, upper : tuple of float
            Corners of the box [D]; its faces must lie in the fluid.

        Returns
        -------
        ndarray, shape (d,)
            Averaged over the snapshots in the averaging window; NaN if there are fewer than two.

        Raises
        ------
        ConfigError
            If the box reaches out of the domain, or its faces go through a body in one of the snapshots.
        """
        times = self.times[self.window.holds(self.times)]
        box, domain = checked_box(lower, upper, self.config.case.space_dimensions), self.config.case.checked_domain
        if not domain.contains(np.array(box), 1e-9).all():
            whole = f"{list(domain.lower)} to {list(domain.upper)}"
            raise ConfigError(f"box from {lower} to {upper}: reaches out of the domain, {whole} [D]")
        if len(times) < 2:
            return np.full(len(lower), np.nan)
        points = np.concatenate([face[2] for face in sampling.faces(*box, self.spacing)])
        to_sides = np.minimum(points - domain.lower, np.array(domain.upper) - points).min(axis=1)
        inner = points[to_sides > 0.5 * self.spacing]
        balances = [self._box_balance(self.snapshot(time), box, inner) for time in times]
        surface, momentum = (np.array(values) for values in zip(*balances, strict=True))
        mean = averages.batch_means(times, surface, times[[0, -1]])[0]
        force = mean - (momentum[-1] - momentum[0]) / (times[-1] - times[0])
        return np.asarray(2.0 * force / self.config.case.reference_area)

    def _box_balance(
        self, snapshot: Snapshot, box: tuple[FloatArray, FloatArray], inner: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return force and momentum, given the points of the faces that must lie in the fluid."""
        fluid = snapshot.fluid
        crossing = inner[sampling.in_solid(snapshot.position, fluid, inner)]
        if len(crossing):
            where, time = ", ".join(f"{x:.3g}" for x in crossing[0]), f"tU/D = {snapshot.time:.4g}"
            raise ConfigError(f"box: at {time} a face goes through a body at ({where}); all must lie in the fluid")
        viscosity = self.config.case.kinematic_viscosity
        fields = snapshot.position[fluid], snapshot.velocity[fluid], snapshot.pressure[fluid]
        force = self.config.case.body_force_at(fields[0], snapshot.time)
        return sampling.control_volume(*fields, box, self.spacing, 1.0, viscosity, force)
