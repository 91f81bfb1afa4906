"""The schemes of one case beside each other: what each finds, how well it keeps the flow, and what it costs."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from alsph import plotting, study
from alsph.analysis.averages import Estimate
from alsph.analysis.measures import Measure
from alsph.analysis.noise import load_noise, pressure_noise
from alsph.arguments import ladder
from alsph.cases import find
from alsph.cases.base import Case
from alsph.cases.method import OWNERS, SCHEMES, of_all_schemes, of_scheme, superseded
from alsph.cases.remarks import keywords, tally
from alsph.config import Config, overridden
from alsph.errors import AlsphError, ConfigError
from alsph.folder.durable import write_text
from alsph.parameters import choose
from alsph.plotting.curves import Curve
from alsph.results.run import Run
from alsph.study.comparison import CPU, STEPS, Comparison, costs_of
from alsph.study.declaration import RUNS, Study, Sweep
from alsph.study.results import Results
from alsph.study.state import State
from alsph.symbols import Symbols
from alsph.tables import markdown
from alsph.text import printable, sha256

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Picture

HOW = (
    "Each scheme takes the step that the case gives it where none is asked for.",
    "Divergence: mean and largest of the fluid where a step takes its derivatives, averaged over the averaging window; "
    "the mean where steps end is of some snapshots in the window. Noise: what the pressure in the "
    "last output, and the force coefficients in the window, have of changes from particle to particle, as the "
    "amplitude of white noise (`alsph.analysis.noise`).",
)
"""What the numbers of the tables are."""


@dataclass(frozen=True, eq=False)
class Row:
    """One scheme at one resolution.

    Attributes
    ----------
    scheme : str
    resolution : int
        D/Δx.
    folder : Path
        The run folder.
    state : State
        How far the run is.
    run : Run or None
        The run, if it has finished.
    """

    scheme: str
    resolution: int
    folder: Path
    state: State
    run: Run | None

    @property
    def label(self) -> str:
        """Scheme and resolution in words."""
        return f"{self.scheme}, D/Δx = {self.resolution}"

    @property
    def status(self) -> str:
        """How far the run is, in words."""
        reached = f" at tU/D = {self.state.time:.3g}" if self.state.status == "diverged" else ""
        return f"{self.state.status}{reached}"

    @property
    def measures(self) -> dict[str, Measure]:
        """What the run is judged by, by name; nothing of one that has not finished."""
        return {measure.name: measure for measure in self.run.measures} if self.run else {}

    @cached_property
    def numbers(self) -> dict[str, float]:
        """Divergence, noise and costs by name, as the table has them; nothing of a run that has not finished."""
        if not (run := self.run):
            return {}
        costs, history = costs_of(run), run.history
        noise = {"noise of p, /ρU²": pressure_noise(run.snapshot(), run.spacing)}
        for axis, name in (("x", "C_D"), ("y", "C_L")) if run.body else ():
            found = load_noise(history["time"], run.coefficient(axis), run.window, run.spacing)
            noise[f"noise of {name}"] = found
        return {
            "mean |∇·u| D/U": float(run.divergence.mean),
            "the same at the end of a step": float(run.divergence.at_end),
            "mean of the largest |∇·u| D/U": float(run.divergence.max),
            **noise,
            CPU: float(costs[CPU]),
            STEPS: float(costs[STEPS]),
            "iterations a step": float(np.mean(history["iterations"])),
        }


@dataclass(frozen=True, eq=False)
class SchemeComparison:
    """Schemes of a case beside each other, see :func:`compare_schemes`.

    Attributes
    ----------
    results : Results
        The study of the schemes.
    rows : list of alsph.study.schemes.Row
        One for each resolution and scheme.
    """

    results: Results
    rows: list[Row]

    @property
    def path(self) -> Path:
        """Folder of tables and figures."""
        return self.results.path

    @property
    def notes(self) -> list[str]:
        """What the numbers are, how times were taken, and what is to be borne in mind with each run, in words."""
        found = [*HOW, *self._times()]
        found += [f"{row.label}: {row.state.message}" for row in self.rows if not row.run and row.state.message]
        why: dict[str, list[str]] = {}
        for row in self.rows:
            for name, measure in row.measures.items():
                if np.isnan(measure.value) and (note := getattr(measure.value, "note", "")):
                    why.setdefault(f"{row.label}: nan, as {note}", []).append(name)
        found += [f"{note}: {', '.join(names)}" for note, names in why.items()]
        said: dict[str, list[str]] = {}
        for row in self.rows:
            for remark in row.run.remarks if row.run else ():
                said.setdefault(keywords([remark]), []).append(row.label)
        return found + [f"{remark}: {'; '.join(dict.fromkeys(labels))}" for remark, labels in said.items()]

    @property
    def _symbols(self) -> Symbols:
        return self.results.symbols

    def _times(self) -> list[str]:
        """Return how the times of the runs were taken, in words."""
        facts = [row.run.info for row in self.rows if row.run]
        machines = dict.fromkeys(
            f"{info.get('machine', {}).get('processor')}, threads: {info.get('threads')}" for info in facts
        )
        if not machines:
            return []
        return [
            f"CPU seconds are those of all threads, output included, on {'; '.join(machines)}. Whatever else the "
            "machine did meanwhile lengthens them, other runs of the comparison (`--jobs` above 1) included."
        ]

    def to_markdown(self, figures: Sequence[str] = ()) -> str:
        """Return the comparison as Markdown, with the pictures `figures` from files beside it."""
        parts = [
            self._table_of_measures(),
            self._table_of_numbers(),
            "\n".join(f"- {self._symbols(note)}" for note in self.notes),
            *(f"![{name}]({name}.png)" for name in figures),
        ]
        return printable("\n\n".join(parts) + "\n", lines=True)

    def _table_of_measures(self) -> str:
        names = [*dict.fromkeys(name for row in self.rows for name in row.measures)]
        rows = [
            [row.scheme, str(row.resolution), row.status, *(_judged(row.measures.get(name)) for name in names)]
            for row in self.rows
        ]
        known = [_references([row.measures[name] for row in self.rows if name in row.measures]) for name in names]
        rows += [["reference", "", "", *known]] * any(known)
        return markdown(["scheme", self._symbols("D/Δx"), "status", *names], rows)

    def _table_of_numbers(self) -> str:
        names = [*dict.fromkeys(name for row in self.rows for name in row.numbers)]
        rows = [
            [row.scheme, str(row.resolution), *(_number(row.numbers.get(name)) for name in names), str(row.folder)]
            for row in self.rows
        ]
        return markdown(["scheme", *map(self._symbols, ["D/Δx", *names]), "run"], rows)

    def __str__(self) -> str:
        """Return the tables."""
        return self.to_markdown().rstrip("\n")

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(str(self))}</pre>"

    def draw(self) -> dict[str, Picture]:
        """Return the errors over the costs, and what the schemes found over each other at the finest resolution."""
        panels: dict[str, dict[str, list[tuple[float, float]]]] = {}
        for row in self.rows:
            for name, measure in row.measures.items():
                if np.isfinite([cost := row.numbers[CPU], measure.error]).all() and cost * measure.error:
                    title = f"|error| of {name}" if measure.reference else name
                    points = panels.setdefault(title, {}).setdefault(row.scheme, [])
                    points.append((cost, abs(measure.error)))
        curves = {
            name: [Curve(scheme, [x for x, _ in points], [y for _, y in points]) for scheme, points in schemes.items()]
            for name, schemes in panels.items()
        }
        pictures = {"cost": plotting.panels(curves, "CPU seconds a $D/U$", ("x", "y"))} if curves else {}
        runs = {row.scheme: row.run for row in self.rows if row.run and row.resolution == self._finest}
        for picture in pictures.values():
            plotting.head(picture, self.results.study.title)
            plotting.remark(picture, tally([keywords(row.run.remarks) for row in self.rows if row.run]))
            plotting.rename(picture, self._symbols)
        return pictures | (Comparison(runs).draw() if runs else {})

    @property
    def _finest(self) -> int:
        return max((row.resolution for row in self.rows if row.run), default=0)

    def save(self) -> list[Path]:
        """Write ``comparison.md`` and the figures to :attr:`path`, and return the paths of all."""
        paths = []
        for name, picture in (pictures := self.draw()).items():
            paths.append(self.path / f"{name}.png")
            plotting.save(picture, paths[-1], dpi=120)
        text = f"# {self.results.study.title}\n\n{self.to_markdown([*pictures])}"
        write_text(self.path / "comparison.md", text)
        return [self.path / "comparison.md", *paths]


def compare_schemes(
    case: Case | Config | Mapping[str, Any],
    schemes: Sequence[str] | None = None,
    resolutions: Sequence[int] = (),
    output: str | Path = "runs/studies",
    *,
    jobs: int = 1,
    progress: bool = True,
    **parameters: Any,
) -> SchemeComparison:
    """Run a case by several schemes, each with its own step, and compare what they find and cost.

    A function beside :func:`alsph.compare`, which takes runs that there are, since it takes and returns other things.
    Finished runs are used again and those that were cut go on, as in :func:`alsph.study.run`; a run that diverges is a
    row that says so.

    Parameters
    ----------
    case
        The case, with or without settings of its runs, or the tables of its file. Its scheme does not count.
    schemes
        Two or more of ``alsph``, ``isph``, ``explicit_isph``, ``wcsph``, ``edac``, ``shadloo`` and ``sisph``; all that
        the case takes if not given.
    resolutions
        D/Δx; that of the case if none are given. Two or more draw errors as curves over the cost.
    output
        Folder for runs and results.
    jobs
        Runs at a time. More than one disturb each other's times.
    progress
        Report progress.
    **parameters
        Parameters of the case and settings of its runs (:class:`~alsph.run_settings.RunSettings`), in place of those
        that it has. One that belongs to some schemes, such as ``penalty_constant``, is given to these alone.

    Raises
    ------
    ConfigError
        If there are fewer than two schemes, one is unknown, or a parameter belongs to none of them.
    """
    declared = _declared(_tables(case), schemes, resolutions, parameters)
    threads = declared.base["run"].get("threads") or 1
    results = study.run(declared, output, jobs=jobs, threads=threads, progress=progress)
    report = SchemeComparison(results, _rows(results))
    report.save()
    return report


def _tables(case: Case | Config | Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables of a case's file."""
    if isinstance(case, Mapping):
        return {"run": {}, **case}
    if not isinstance(case, Case | Config):
        raise ConfigError(f"case: must be a case such as alsph.cases.TaylorGreen(), not a {type(case).__name__}")
    return (case if isinstance(case, Config) else Config(case)).tables()


def _declared(
    tables: dict[str, Any], schemes: Sequence[str] | None, resolutions: Sequence[int], parameters: dict[str, Any]
) -> Study:
    """Return the study of the schemes, named by its runs."""
    if schemes is None:
        schemes = find(tables["case"]).schemes()
    chosen = [*dict.fromkeys([schemes] if isinstance(schemes, str) else schemes)]
    for scheme in chosen:
        choose("schemes", scheme, SCHEMES)
    if len(chosen) < 2:
        raise ConfigError(
            f"schemes = {', '.join(chosen) or 'none'}: a comparison takes two or more of {', '.join(SCHEMES)}"
        )
    if "scheme" in parameters:
        raise ConfigError(f"scheme = {parameters['scheme']!r}: give schemes, which are compared")
    for name in parameters.keys() & OWNERS.keys():
        if not {*OWNERS[name]} & {*chosen}:
            raise ConfigError(f"{name}: of the scheme {' or '.join(OWNERS[name])}, which is not compared; leave it out")
    base = overridden(of_all_schemes(tables), {name: parameters[name] for name in parameters if name not in OWNERS})
    own = {scheme: of_scheme(scheme, tables | parameters) for scheme in chosen}
    sets = []
    for scheme in chosen:
        of_others = {*superseded({"scheme": scheme}, base)} - {*parameters}  # what was asked for stays
        gone = [name for name in base if name in of_others or name in superseded(own[scheme], base)]
        sets.append({"scheme": scheme} | dict.fromkeys(gone) | own[scheme])
    sizes = ladder("resolutions", resolutions)
    sweep = Sweep(product={"resolution": sizes} if sizes else {}, sets=sets)
    points = Study(name="compare", base=base, sweep=sweep).points()
    case = points[0].config.case.name
    name = f"compare-{case}-{sha256(' '.join(point.name for point in points))[:6]}"
    return Study(name=name, title=f"Schemes of {case}", base=base, sweep=sweep)


def _rows(results: Results) -> list[Row]:
    """Return a row for each run of the study."""
    rows = []
    for point, state in zip(results.study.points(), results.states, strict=True):
        folder, case = results.path.parent / RUNS / point.name, point.config.case
        row = Row(case.scheme or SCHEMES[0], case.resolution, folder, state, None)
        if state.status == "finished":
            try:
                read = replace(row, run=Run(folder))
                _ = read.measures, read.numbers
                row = read
            except (AlsphError, KeyError) as error:
                row = replace(row, state=replace(state, status="cannot be read", message=str(error)))
        rows.append(row)
    return rows


def _judged(measure: Measure | None) -> str:
    """Return a measure's value in words, and its error where it has a reference other than zero."""
    if measure is None:
        return ""
    value = measure.value
    text = str(value) if isinstance(value, Estimate) and not np.isnan(value) else f"{value:.4g}"
    return f"{text} ({100 * measure.error:+.2g} %)" if np.isfinite(measure.error) and measure.reference else text


def _references(measures: list[Measure]) -> str:
    """Return the reference values of a measure in all rows, the least and the largest if they differ."""
    known = {f"{measure.reference:.5g}": None for measure in measures if abs(measure.reference) > 0}
    return " to ".join(sorted(known, key=float)[:: max(len(known) - 1, 1)])


def _number(value: float | None) -> str:
    return "" if value is None or np.isnan(value) else f"{value:.3g}"
