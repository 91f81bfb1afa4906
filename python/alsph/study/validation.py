"""Validation: cases at several resolutions, judged by their measures, and the report on it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console

from alsph import cases, plotting
from alsph.analysis import averages
from alsph.analysis.measures import Measure
from alsph.arguments import ladder
from alsph.cases.remarks import keywords, tally
from alsph.config import Config
from alsph.errors import ConfigError, SolverError
from alsph.folder.durable import write_text
from alsph.results.run import Run
from alsph.run_settings import RunSettings
from alsph.running.control import Control
from alsph.running.start import complete
from alsph.study.convergence import LARGEST_ORDER
from alsph.tables import html, markdown
from alsph.text import duration

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HEADER = "case parameters resolution quantity value reference error tolerance order result".split()
SNAPSHOTS = 10


@dataclass(frozen=True)
class Entry:
    """A case to validate.

    Attributes
    ----------
    case : str
        Its name, or ``FILE.py:CLASS``.
    resolutions : tuple of int
        Particles per reference length D/Δx, increasing; the finest one is judged, the others show the convergence.
    until : float
        End time [D/U].
    parameters : mapping
        Other parameters than the case's defaults.
    continued : float, optional
        End time of the finer resolutions [D/U], which then start with the last flow of the next coarser one; if not
        given, they start as the case does and end like the coarsest.
    """

    case: str
    resolutions: tuple[int, ...]
    until: float
    parameters: Mapping[str, Any] = field(default_factory=dict)
    continued: float | None = None

    @cached_property
    def model(self) -> type[cases.Case]:
        """The case, as its file is when it is first asked for."""
        return cases.find(self.case)

    @property
    def settings(self) -> list[str]:
        """The parameters in words."""
        return [f"{name} {value}" for name, value in self.parameters.items()]

    @property
    def file_name(self) -> str:
        """Begin of the names of its run folders and figures."""
        return "_".join([self.model.name, *self.settings]).replace(" ", "_")

    def config(self, resolution: int, threads: int | None, coarser: Path | None = None) -> Config:
        """Return the case at a resolution and the settings of its run, which goes on with a coarser one if there is."""
        case = self.model(**self.parameters, resolution=resolution)
        until, initial = (self.continued, str(coarser)) if self.continued and coarser else (self.until, None)
        settings = RunSettings(until=until, threads=threads, output_interval=until / SNAPSHOTS, initial_run=initial)
        return Config(case, settings)

    def configs(self, path: Path, threads: int | None) -> Iterator[tuple[Path, Config]]:
        """Yield the run folder in `path` and the configuration at each resolution."""
        coarser = None
        for resolution in self.resolutions:
            folder = path / f"{self.file_name}_resolution_{resolution}"
            yield folder, self.config(resolution, threads, coarser)
            coarser = folder


SWAY = {"length": 2.85, "amplitude": 0.001, "phase": 90.0, "gauge": 0.0}
"""A sway so small that linear theory holds; the frequencies below are 0.8 and 1.2 of the water's own."""

# A new case is one line in each.
QUICK = (
    Entry("taylor_green", (25, 50), until=1.0),
    Entry("taylor_green", (16, 24), until=0.2, parameters={"dimensions": 3}),
    Entry("poiseuille", (20, 40), until=2.5),
    Entry("couette", (20, 40), until=2.5),
    Entry("taylor_couette", (20,), until=1.0),
    Entry("pulsating_channel", (20, 40), until=1.6),
    Entry("backward_facing_step", (10,), until=40.0, parameters={"reynolds": 100, "downstream": 8.0}),
    Entry("dam_break", (20, 40), until=2.0),
    Entry("standing_wave", (20, 30), until=10.0),
    Entry("elliptical_drop", (10, 20), until=0.8),
    Entry("floating_box", (20,), until=5.0),
    Entry("concentric_release", (10, 20), until=0.11, parameters={"density_ratio": 0.5}),
)
FULL = (
    Entry("taylor_green", (25, 50, 100), until=1.0),
    Entry("taylor_green", (16, 24, 32), until=1.0, parameters={"dimensions": 3}),
    Entry("poiseuille", (20, 40, 80), until=2.5),
    Entry("couette", (20, 40, 80), until=2.5),
    Entry("pulsating_channel", (20, 40, 80), until=1.6),
    Entry("pressure_jump", (20, 40), until=2.0),
    Entry("nozzle", (10, 20), until=20.0),
    Entry("bend", (10, 20), until=20.0),
    Entry("taylor_couette", (10, 20, 40), until=1.0),
    Entry("pipe", (10, 20), until=0.4),
    Entry("concentric_release", (10, 20, 40), until=0.11, parameters={"density_ratio": 0.1}),
    Entry("concentric_release", (10, 20, 40), until=0.11, parameters={"density_ratio": 2.0}),
    Entry("rotating_cylinder", (10, 20), until=4.0),
    Entry("confined_cylinder", (10, 20), until=20.0, parameters={"reynolds": 20}, continued=12.0),
    Entry("confined_cylinder", (10, 20, 30), until=70.0, continued=35.0),
    Entry("oscillating_cylinder", (20, 32), until=15.0),
    Entry("towed_cylinder", (10, 20), until=6.0),
    Entry("settling_sphere", (8,), until=12.0),
    Entry("sphere", (8, 10), until=15.0, parameters={"quarter": True}),
    Entry("dam_break", (20, 40, 80), until=8.0),
    Entry("dam_break", (20, 40), until=2.0, parameters={"length": 0.5}),
    Entry("dam_break", (20, 40), until=2.0, parameters={"length": 1.0}),
    Entry("dam_break_obstacle", (20,), until=6.0),
    Entry("dam_break_structure", (30,), until=10.0),
    Entry("floating_box", (20, 40), until=8.0),
    Entry("rolling_tank", (20,), until=44.0),
    Entry("heaving_cylinder", (20,), until=12.0),
    Entry("still_water", (20, 40), until=50.0),
    Entry("standing_wave", (20, 40), until=10.0, parameters={"reynolds": 50}),
    Entry("standing_wave", (20, 40), until=10.0),
    Entry("standing_wave", (20, 40, 80), until=10.0, parameters={"reynolds": 2500}),
    Entry("sloshing", (20, 40), until=20.5),
    Entry("sloshing", (20, 40), until=51.0, parameters=SWAY | {"frequency": 0.75}),
    Entry("sloshing", (20, 40), until=51.0, parameters=SWAY | {"frequency": 1.128}),
    Entry("elliptical_drop", (10, 20, 40), until=2.0),
    Entry("rotating_patch", (20, 40), until=4.0),
    Entry("cavity", (25, 50, 100), until=24.0, parameters={"reynolds": 100}, continued=12.0),
    Entry("cavity", (50, 100), until=36.0, parameters={"reynolds": 400}, continued=18.0),
    Entry("cavity", (50, 100, 150), until=60.0, parameters={"reynolds": 1000}, continued=24.0),
    Entry("backward_facing_step", (10, 20), until=60.0, parameters={"reynolds": 100}, continued=30.0),
    Entry("backward_facing_step", (10, 20), until=220.0, parameters={"reynolds": 389}, continued=75.0),
    Entry("cylinder", (10, 20, 30), until=60.0, parameters={"reynolds": 100}, continued=30.0),
    Entry("cylinder", (10, 20, 30), until=45.0, parameters={"reynolds": 200}, continued=30.0),
)


@dataclass(frozen=True)
class Row:
    """A measure of a run, and what came of it.

    Attributes
    ----------
    entry : Entry
    resolution : int
        Particles per reference length, D/Δx.
    measure : Measure
    order : float
        Observed order of convergence from the next coarser resolution; NaN at the coarsest one.
    judged : bool
        Whether the validation depends on it.
    """

    entry: Entry
    resolution: int
    measure: Measure
    order: float = np.nan
    judged: bool = True

    @property
    def cells(self) -> tuple[str, ...]:
        """The row of the report's table."""
        measure = self.measure
        error = "" if np.isnan(measure.error) else f"{100 * measure.error:+.3g} %"
        beside = f"{measure.reference:.5g}", error, f"{100 * measure.tolerance:g} %"
        apart = getattr(measure.value, "uncertainty", np.nan)
        order = f"> {LARGEST_ORDER:g}" if self.order > LARGEST_ORDER else f"{self.order:.1f}"
        return (
            self.entry.model.name,
            ", ".join(self.entry.settings),
            str(self.resolution),
            measure.name,
            f"{measure.value:.5g} ± {apart:.2g}" if 0 < apart < np.inf else f"{measure.value:.5g}",
            *("" if np.isnan(measure.reference) else told for told in beside),
            "" if np.isnan(self.order) else order,
            (("pass" if measure.passed else "FAIL") if self.judged else "") + averages.remark(measure.value),
        )


@dataclass(frozen=True, eq=False)
class Report:
    """What a validation found.

    Attributes
    ----------
    path : Path
        The folder with the run folders, the figures and ``report.md``.
    rows : list of Row
    runs : list of Run
    figures : dict
        Names of the figures' files in `path`, and their titles.
    """

    path: Path
    rows: list[Row]
    runs: list[Run]
    figures: dict[str, str]

    @property
    def passed(self) -> bool:
        """Whether there were checks and all of them passed."""
        judged = [row.measure.passed for row in self.rows if row.judged]
        return bool(judged) and all(judged)

    @property
    def verdict(self) -> str:
        """The outcome in a sentence."""
        judged = [row.measure.passed for row in self.rows if row.judged]
        return f"{'All well' if self.passed else 'FAILED'}: {sum(judged)} of {len(judged)} checks passed."

    def __str__(self) -> str:
        """Return the table and the verdict."""
        return f"{markdown(HEADER, [row.cells for row in self.rows])}\n\n{self.verdict}"

    def to_markdown(self) -> str:
        """Return the report as Markdown; the pictures are taken from files beside it."""
        facts = [
            (
                run.path.name,
                run.status,
                duration(run.info.get("seconds", 0)),
                f"{run.info.get('versions', {}).get('alsph', '?')}, commit {run.info.get('commit') or '?'}",
                keywords(run.remarks),
            )
            for run in self.runs
        ]
        return "\n\n".join(
            [
                "# Validation",
                self.verdict,
                "The finest resolution of a case is judged; the order is the one observed from the next coarser one. "
                "Errors are relative, those of a zero reference absolute.",
                markdown([*HEADER, "source"], [(*row.cells, row.measure.source) for row in self.rows]),
                *(f"![{title}]({file})" for file, title in self.figures.items()),
                markdown(["run", "status", "time", "alsph", "remarks"], facts) + "\n",
            ]
        )

    def _repr_html_(self) -> str:
        return f"<p>{self.verdict}</p>{html(HEADER, [row.cells for row in self.rows])}"


def validate(
    *names: str,
    full: bool = False,
    resolutions: Sequence[int] = (),
    threads: int | None = None,
    output: str | Path = "runs/validation",
    progress: bool = True,
    suite: Sequence[Entry] | None = None,
) -> Report:
    """Run cases at several resolutions and compare them with their references.

    Runs are kept in the output folder: those that have finished are not run again, and those that were cut go on.

    Parameters
    ----------
    *names
        Cases to validate, by name or as ``FILE.py:CLASS``; all of the suite if none is given. Those of a file are run
        at their own resolution until their own end.
    full
        Take the full suite (hours) in place of the quick one (minutes).
    resolutions
        Other resolutions D/Δx than those of the suite.
    threads
        Number of threads; all cores if None.
    output
        Folder for the runs, the figures and ``report.md``.
    progress
        Report progress.
    suite
        Other entries than those of the quick and the full suite.

    Raises
    ------
    ConfigError, RunFolderError
        If a case or the folder cannot be used.
    """
    entries, sizes = _chosen(names, full, suite), ladder("resolutions", resolutions)
    if sizes:
        entries = [replace(entry, resolutions=tuple(sizes)) for entry in entries]
    report = Report(Path(output), [], [], {})
    jobs = [(entry, [*entry.configs(report.path, threads)]) for entry in entries]
    heading = _Heading([config for _, runs in jobs for _, config in runs], enabled=progress)
    for entry, planned in jobs:
        runs: list[Run] = []
        for folder, config in planned:
            heading.print(config)
            try:
                runs.append(complete(config, folder, Control(progress=progress)))
            except SolverError as error:
                report.rows.append(Row(entry, config.case.resolution, _broken_down(Run(folder), config, error)))
            report.runs.append(Run(folder))
            heading.seconds.append(report.runs[-1].info["seconds"])
        rows = _judge(entry, runs)
        report.rows.extend(rows)
        report.figures.update(_draw(entry, runs, rows, report.path))
        write_text(report.path / "report.md", report.to_markdown())
    return report


def _chosen(names: Sequence[str], full: bool, suite: Sequence[Entry] | None) -> Sequence[Entry]:
    """Return the entries of the suite for the cases with these names, all of them if there are no names.

    A case of a user's has an entry of its own.
    """
    suite = suite or (FULL if full else QUICK)
    if not names:
        return suite
    chosen: dict[str, list[Entry]] = {}
    for name in dict.fromkeys(names):
        model = cases.find(name)
        if model.name in chosen:
            raise ConfigError(f"{name}: there is a case '{model.name}' before it; give one of the classes another name")
        entries = [entry for entry in suite if entry.case == name]
        if not entries and model.__module__.split(".")[0] == "alsph":
            longer = not full and name in [entry.case for entry in FULL]
            told = "only in the full suite, which takes longer; use --full (full=True)"
            raise ConfigError(f"{name}: {told if longer else f'in no suite, it has no reference; alsph run {name}'}")
        if not entries:
            if not _is_compared(model):
                told = "nothing of it is compared; give it `measures` with references, or"
                raise ConfigError(f"{name}: {told} see what comes of it: alsph run {name}")
            case = model()
            entries = [Entry(name, (case.resolution,), until=case.default_until)]
        chosen[model.name] = entries
    return [entry for entries in chosen.values() for entry in entries]


def _is_compared(model: type[cases.Case]) -> bool:
    """Return whether a class has measures beside those of every body in a channel, which have no reference."""
    general = (cases.Case, cases.Channel, cases.Bodies, cases.Spatial)
    return any(vars(parent).keys() & {"measures", "_reference"} for parent in model.__mro__ if parent not in general)


class _Heading:
    """Announces each run, with the time that it and those after it will take by the pace of those before.

    Attributes
    ----------
    seconds : list of float
        What each run so far took.
    """

    def __init__(self, configs: list[Config], *, enabled: bool) -> None:
        self.seconds: list[float] = []
        self._console = Console(highlight=False, quiet=not enabled)
        self._work = [config.work for config in configs]

    def print(self, config: Config) -> None:
        done, count = sum(self._work[: len(self.seconds)]), len(self._work)
        left = f"; ETA of all {duration(sum(self.seconds) / done * (sum(self._work) - done))}" if done else ""
        line = f"run {len(self.seconds) + 1} of {count}: {config.case.name}, resolution {config.case.resolution}{left}"
        self._console.print(line, markup=False, soft_wrap=True)


def _broken_down(run: Run, config: Config, error: SolverError) -> Measure:
    """Return a measure that fails, with the reason for its source."""
    time = run.history["time"]
    reached = time[-1] / config.until if len(time) else 0.0
    return Measure("share of the run computed before it broke down", reached, 1.0, 0.0, str(error))


def _judge(entry: Entry, runs: list[Run]) -> list[Row]:
    """Return the measures of the runs of an entry, from the coarsest to the finest, that have a reference."""
    rows: list[Row] = []
    coarser: dict[str, tuple[int, float]] = {}
    for run in runs:
        resolution = run.case["resolution"]
        for measure in run.measures:
            if np.isnan(measure.reference):
                continue
            earlier, error = coarser.get(measure.name, (resolution, np.nan))
            order = averages.observed_order((earlier, resolution), (error, measure.error))
            rows.append(Row(entry, resolution, measure, order, resolution == entry.resolutions[-1]))
            coarser[measure.name] = resolution, measure.error
    if runs and not rows:
        rows.append(Row(entry, entry.resolutions[-1], Measure("no quantity has a reference value", np.nan)))
    return rows


def _draw(entry: Entry, runs: list[Run], rows: list[Row], path: Path) -> dict[str, str]:
    """Draw each profile at all resolutions, and the errors over the resolution; return file names and titles."""
    figures: dict[str, Figure] = {}
    profiles = {f"D/Δx = {run.case['resolution']}": run.profiles for run in runs}
    for same in zip(*profiles.values(), strict=False):
        figures[same[0].file_name] = plotting.profile(dict(zip(profiles, same, strict=True)))
    errors: dict[str, dict[int, float]] = {}
    for row in rows:
        if abs(row.measure.error) > 0:
            errors.setdefault(row.measure.name, {})[row.resolution] = row.measure.error
    if len(runs) > 1 and errors:
        figures["convergence"] = plotting.convergence(errors)
    titles, remarked = {}, tally([keywords(run.remarks) for run in runs])
    for name, figure in figures.items():
        plotting.remark(figure, remarked)
        plotting.rename(figure, entry.model.symbols)
        plotting.save(figure, path / f"{entry.file_name}_{name}.png")
        titles[f"{entry.file_name}_{name}.png"] = ", ".join([entry.model.name, *entry.settings, name.replace("_", " ")])
    return titles
