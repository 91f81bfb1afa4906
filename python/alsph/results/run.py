"""What a run folder tells: forces, Strouhal number, pressure coefficient, divergence, snapshots and figures."""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from alsph.analysis.averages import Estimate
from alsph.analysis.measures import Measure, Measures, Profile
from alsph.analysis.probes import GaugeRecord
from alsph.arguments import path_of
from alsph.arrays import FloatArray
from alsph.cases import remarks
from alsph.cases.answers import is_own
from alsph.cases.free_surface import Gauges
from alsph.cases.source import shown_name
from alsph.errors import ConfigError, RunFolderError
from alsph.folder import reading
from alsph.folder.durable import check_folder
from alsph.folder.run_folder import GOING_ON, RunFolder
from alsph.geometry.particles import Field, Snapshot
from alsph.geometry.plane import Plane
from alsph.parameters import choose
from alsph.results.dimensional import dimensional
from alsph.results.export import Grid
from alsph.results.judged import drawn, judged, noted
from alsph.results.ledger import Ledger, mach_number
from alsph.results.loads import Loads
from alsph.results.outcome import ended_early, made, outcome, unsolved
from alsph.tables import html
from alsph.text import duration, in_figure, printable, shown
from alsph.units import Units

if TYPE_CHECKING:
    from matplotlib.figure import Figure


STREAMLINE_CELLS = 300
"""Along the longer side of a picture, at most."""


class Run(Loads):
    """The results in a run folder, finished or not, read when they are first asked for.

    Lengths are in D, velocities in U and times in D/U. A run that is still going on is seen as it was when each part
    was read; make a new ``Run`` to see more of it. Where the data are too few a number is NaN and its ``note`` says
    why.

    Parameters
    ----------
    path : path
        The run folder.

    Raises
    ------
    RunFolderError
        If it is no run folder, or a file in it is unreadable when it is needed.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = path_of("run", path, "run folder")
        if not self.path.is_dir():
            there = "a file, and no run folder" if self.path.exists() else "no such run folder"
            raise RunFolderError(f"{self.path}: {there}")
        self._folder = self.path.absolute()
        self.case: dict[str, Any] = reading.case(self.path / "case.toml")
        self.info: dict[str, Any] = reading.info(self.path / "run.json")
        if self._goes_on() and RunFolder(self.path).is_busy() is False:
            self.info = reading.info(self.path / "run.json")  # it may just have ended
            if self._goes_on():
                self.info |= {"status": "stopped", "message": self._how_to_go_on()}

    def _goes_on(self) -> bool:
        return self.info.get("status") in GOING_ON

    def _how_to_go_on(self) -> str:
        """Return what to say of a run that has neither ended nor a process at work in it."""
        resumable = RunFolder(self.path).has_checkpoint()
        command = f"alsph resume {shlex.quote(str(self.path))}" if resumable else "alsph run, with --force"
        return f"no process is at work in it, it was killed or its machine went down; go on with: {command}"

    @property
    def status(self) -> str:
        """How far the run is.

        ``running`` (``starting`` before its first step), ``finished``, ``interrupted``, ``diverged``, ``failed``, or
        ``stopped``: killed, with no process at work in it.
        """
        return str(self.info.get("status", "unknown"))

    @cached_property
    def measures(self) -> Measures:
        """What the run is judged by: numbers beside their reference values; none if the case's own code fails."""
        return Measures(self._judged[0])

    @cached_property
    def _judged(self) -> tuple[list[Measure], list[str]]:
        return judged(self, self.config)

    @cached_property
    def gauges(self) -> GaugeRecord:
        """The depth of the water at the run's gauges over time; empty without any.

        Raises
        ------
        RunFolderError
            If the file is of other gauges than the configuration's.
        """
        return Gauges.recorded(self, self.config.case, self.config.gauges)

    @cached_property
    def profiles(self) -> list[Profile]:
        """Curves of the run beside their reference curves; none if the case's own code fails."""
        return self._drawn[0]

    @cached_property
    def _drawn(self) -> tuple[list[Profile], list[str]]:
        return drawn(self, self.config)

    @cached_property
    def ledger(self) -> Ledger:
        """How incompressible the flow stayed, and where its kinetic energy went."""
        return Ledger.of(self, self.config.case)

    @cached_property
    def remarks(self) -> list[str]:
        """What is to be borne in mind with the results, each as ``keyword: what it is; what explains it``.

        What resolution, method and domain cannot carry (:meth:`alsph.cases.Case.remarks`), and what came of the run.
        """
        case = self.config.case
        solved = unsolved(self, case.residual_tolerance, case.most_iterations)
        found = [
            *outcome(self, self.config.until_in_words, case.scheme),
            *solved,
            *(ended_early(self) if case.residual_tolerance and case.solver == "jacobi" else []),
            *made(self.measures),
            *self._judged[1],
            *(self._drawn[1] if is_own(case) else []),
            *noted(self, self.config),
            *self.config.remarks,
        ]
        return [self.symbols(remark) for remark in found]

    @property
    def units(self) -> Units | None:
        """What D, U, ρ and ν are in SI, if the case says so."""
        return self.config.case.units

    def dimensional(self, units: Units | None = None) -> dict[str, Estimate]:
        """Return the main results with a dimension in SI, named with the unit; forces are those on the whole body.

        Parameters
        ----------
        units : Units, optional
            What D, U, ρ and ν are; those of the case if None.

        Raises
        ------
        ConfigError
            If there are none, or they make another Reynolds number than the run's.
        """
        case = self.config.case
        if units is not None:
            case = case.replace(units=units, reynolds=case.reynolds)
        if case.units is None:
            raise ConfigError(f"{self.path}: its case has no units; use run.dimensional(alsph.Units(...))")
        lengths = case.reference_area / case.computed_share, case.chord
        return dimensional(self._results(), case.units, case.space_dimensions, *lengths, case.symbols)

    def summary(self) -> dict[str, Any]:
        """Return the run's main results by name, its measures each followed by the reference value where there is one.

        Where the case has units, the results in SI follow. ``str()`` of each value is fit to be read.
        """
        results = {self.symbols(name): value for name, value in self._results().items()}
        if self.units is not None:
            known = {name: value for name, value in self.dimensional().items() if not np.isnan(value)}
            results |= {"units": self.symbols(str(self.units))} | known
        results |= {f"remark {number}": remark for number, remark in enumerate(self.remarks, 1)}
        return {name: value for name, value in results.items() if value != ""}

    def _results(self) -> dict[str, Any]:
        """Return the results in D, U and ρ by name."""
        steps = len(self.history["time"])
        results: dict[str, Any] = {
            "case": self.config.case.name,
            "Reynolds number": Estimate(self.case["reynolds"]),
            "resolution, D/Δx": self.case["resolution"],
            "status": self.status,
            "message": self.info.get("message", ""),
            "computing time": duration(self.info.get("seconds", 0)),
            "time reached, tU/D": Estimate(self.history["time"][-1] if steps else 0.0),
            "steps": steps,
            "iterations of a step": self._iterations(),
            "averaged from tU/D": Estimate(self.window.start),
            "averaged to tU/D": Estimate(self.window.end),
            "averaging rule": self.window.rule,
        }
        if self.config.case.is_averaged:
            results["shedding periods"] = self.window.periods
        if (share := self.config.case.computed_share) < 1:
            results["share of the body that is computed"] = share
        results |= self.divergence.told()
        if np.isfinite(self.config.case.expected_penalty_constant()):
            waves = "" if self.config.case.is_weakly_compressible else " of the penalty"
            results[f"artificial Mach number{waves}"] = Estimate(mach_number(self.history))
        for measure in self.measures:
            value = measure.value if isinstance(measure.value, Estimate) else Estimate(measure.value)
            told = np.isnan(value) and value.note == self.window.rule
            results[measure.name] = Estimate(math.nan, note="see averaging rule") if told else value
            if np.abs(measure.reference) > 0:
                results[f"{measure.name}, reference"] = Estimate(measure.reference)
        return results

    def _iterations(self) -> str:
        """How many iterations a step took, and how many it may take, in words."""
        case, iterations = self.config.case, self.history.get("iterations", np.empty(0))
        taken = f"{iterations.mean():.3g} of at most " if iterations.size else "at most "
        if case.is_weakly_compressible:
            return "1"
        return f"{taken}{case.most_iterations}, then {case.projection_sweeps} projection sweeps"

    def plot_forces(self, path: str | Path | None = None, body: str | None = None) -> Figure:
        """Figure of drag and lift over time with their parts and the averaging window; saved if `path` is given."""
        return self._saved(_plotting().forces(self, body), path, body)

    def plot_spectrum(self, path: str | Path | None = None, body: str | None = None) -> Figure:
        """Figure of the spectra of drag and lift in the averaging window; saved if `path` is given."""
        return self._saved(_plotting().spectrum({in_figure(self.path.name): self}, body), path, body)

    def plot_field(
        self,
        name: Field,
        time: float | None = None,
        path: str | Path | None = None,
        *,
        limit: float | None = None,
        view: tuple[float, float, float, float] | None = None,
        plane: str | None = None,
        streamlines: bool = False,
    ) -> Figure:
        """Picture of a field, in 3-D along a plane; saved if `path` is given.

        Parameters
        ----------
        name : {"vorticity", "pressure", "velocity", "velocity_divergence", "q_criterion", "lambda_2"}
        time : float, optional
            Time tU/D; the nearest snapshot is shown, the last one if None.
        path : path, optional
            File to save the figure in.
        limit : float, optional
            End of the colour scale; from the data if None.
        view : (left, right, bottom, top), optional
            Part of the plane to show [D]; all of it if None.
        plane : str, optional
            In 3-D the plane, such as ``"z=0.5"`` or ``"y"`` [D]; by default normal to z, with a free surface to y,
            through the middle of the body, or of the flow.
        streamlines : bool
            Draw streamlines over it, in 3-D those of the velocity along the plane.
        """
        _plotting().field_style(name)
        snapshot = self.snapshot(time)
        plane_of = self.plane(snapshot, plane)
        part = _plotting().extent_of(snapshot, self.spacing, view, plane_of)
        flow = self._flow(snapshot.time, part, plane_of) if streamlines else None
        figure = _plotting().field(
            snapshot, name, self.spacing, limit=limit, view=part, title=self._title, plane=plane_of, flow=flow
        )
        return self._saved(figure, path, headed=True)

    def _flow(self, time: float, view: tuple[float, float, float, float], plane: Plane | None) -> Grid:
        """Return the flow in a view, on a grid of one layer in 3-D, that is fine enough for streamlines."""
        left, right, bottom, top = view
        sides = sorted((right - left, top - bottom))
        spacing = min(max(self.spacing, sides[1] / STREAMLINE_CELLS), sides[0] / 8)
        lower, upper = np.array([left, bottom]), np.array([right, top])
        if plane:
            lower = np.insert(lower, plane.axis, plane.place - spacing / 2)
            upper = np.insert(upper, plane.axis, plane.place + spacing / 2)
        return self.to_grid(time, spacing, lower.tolist(), upper.tolist())

    def plane(self, snapshot: Snapshot, given: str | None = None) -> Plane | None:
        """Return the plane of pictures of a snapshot, None in 2-D; `given` as of :meth:`plot_field`."""
        if snapshot.position.shape[1] == 2:
            if given is not None:
                raise ConfigError(f"plane = {shown(given)}: the run is in 2-D; leave it out")
            return None
        case = self.config.case
        return Plane.of(case.picture_axis if given is None else given, case.middle)

    def animate(
        self,
        name: Field = "vorticity",
        path: str | Path | None = None,
        *,
        start: float = -math.inf,
        end: float = math.inf,
        every: int = 1,
        fps: float = 10.0,
        limit: float | None = None,
        view: tuple[float, float, float, float] | None = None,
        plane: str | None = None,
        progress: Callable[[int, int], None] = lambda done, count: None,
    ) -> Path:
        """Make a film of a field from the snapshots.

        Parameters
        ----------
        name : {"vorticity", "pressure", "velocity", "velocity_divergence", "q_criterion", "lambda_2"}
        path : path, optional
            File that ends in .gif or, with imageio-ffmpeg (``pip install 'alsph[video]'``), .mp4 or .webm; ``NAME.gif``
            among the run's figures if None.
        start, end : float
            Times between which snapshots are taken [D/U].
        every : int
            Of how many snapshots one is taken.
        fps : float
            Pictures a second.
        limit, view, plane
            As of :meth:`plot_field`, the same for all pictures.
        progress : callable
            Called with the number of pictures that are done, and of all.

        Returns
        -------
        Path
            The file, which a notebook shows as a film.

        Raises
        ------
        ConfigError
            If there are fewer than two snapshots, or an option cannot be used.
        """
        plane_of = self.plane(self.snapshot(self.times[0]), plane) if len(self.times) else None
        if path is None:
            check_folder(self.file("figures"))
        target: Path = _plotting().Film(path if path is not None else self.file("figures") / f"{name}.gif")
        _plotting().animate(
            self,
            name,
            target,
            start=start,
            end=end,
            every=every,
            fps=fps,
            limit=limit,
            view=view,
            title=self._title,
            said=self._said(),
            symbols=self.symbols,
            plane=plane_of,
            progress=progress,
        )
        return target

    def plot_pressure_coefficient(
        self,
        path: str | Path | None = None,
        reference: tuple[FloatArray, FloatArray] | None = None,
        body: str | None = None,
    ) -> Figure:
        """Figure of C_p and a reference curve (θ in degrees, or x/c, and C_p); saved if `path` is given.

        It is that of all bodies, if no `body` is named. Without a `reference`, that of :attr:`profiles` is drawn where
        there is one.
        """
        coefficient, names = self.pressure_coefficient, self.config.case.surface_bodies
        if body is not None:
            choose("body", body, names)
            coefficient = coefficient.of([part for part, name in enumerate(names) if name == body])
        if reference is None:
            title = "pressure coefficient" + f" of {body}" * (len(set(names)) > 1)
            known = (each.reference for each in self.profiles if each.name == title and each.reference[0].size)
            reference = next(known, None)
        return self._saved(_plotting().pressure_coefficient(coefficient, reference, names), path, body)

    def plot_profile(self, profile: Profile | str, path: str | Path | None = None) -> Figure:
        """Figure of one of :attr:`profiles`, or of that of a name, beside its reference; saved if `path` is given."""
        if isinstance(profile, str):
            choose("profile", profile, named := {each.name: each for each in self.profiles})
            profile = named[profile]
        elif not isinstance(profile, Profile):
            raise ConfigError(f"profile = {shown(profile)}: must be one of run.profiles, or its name")
        return self._saved(_plotting().profile({"computed": profile}), path)

    def plot_gauges(self, path: str | Path | None = None) -> Figure:
        """Figure of the depth at the run's gauges over time, of ten where there are more; saved if `path` is given."""
        return self._saved(_plotting().gauges(self.gauges), path)

    def plot_probes(self, path: str | Path | None = None) -> Figure:
        """Figure of velocity and pressure at the run's probes over time, of ten at most; saved if `path` is given."""
        return self._saved(_plotting().probes(self.probes), path)

    def plot_ledger(self, path: str | Path | None = None) -> Figure:
        """Figure of divergence, iterations, time step, volume, mass and energy over time; saved if `path` is given."""
        return self._saved(_plotting().ledger(self), path)

    def _saved(
        self, figure: Figure, path: str | Path | None, body: str | None = None, *, headed: bool = False
    ) -> Figure:
        if not headed:
            _plotting().head(figure, ", ".join(filter(None, (self._title, body and in_figure(body)))))
        _plotting().remark(figure, self._said())
        _plotting().rename(figure, self.symbols)
        if path is not None:
            _plotting().save(figure, path)
        return figure

    @property
    def _title(self) -> str:
        """What its pictures are of."""
        name = self.info.get("case") or shown_name(self.case.get("case"))
        return str(_plotting().title([self.case | {"case": name}]))

    def _said(self) -> str:
        """Return what stands below its figures: the run's remarks in short, and what their units are in SI."""
        try:
            units = self.units.told() if self.units else ""
            return remarks.JOINED.join(filter(None, (remarks.brief(self.remarks), units)))
        except RunFolderError:  # a field can be drawn all the same
            return "no remarks: case or history of the run cannot be read"

    def __repr__(self) -> str:
        """Name the folder, the case, the status and the time reached."""
        time = self.history["time"]
        reached = time[-1] if len(time) else 0.0
        name, clock = shown_name(self.case.get("case", "unknown")), self.symbols.clock
        return printable(f"Run('{self.path}': {name}, {self.status}, {clock} = {reached:.4g})")

    def _repr_html_(self) -> str:
        return html((), [(name, str(value)) for name, value in self.summary().items()], named=True)


def _plotting() -> ModuleType:
    """Return :mod:`alsph.plotting`, which draws runs: the door of the ``plot_`` methods."""
    from alsph import plotting

    return plotting


open_run = Run
"""Open a run folder: ``alsph.open_run("runs/re200")``."""
