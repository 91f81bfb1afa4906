"""Runs beside each other: what differs in their parameters, what each found and took, and how far apart they are."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from alsph import plotting
from alsph.analysis.averages import Estimate, remark
from alsph.analysis.measures import Profile
from alsph.analysis.window import DEVELOPING
from alsph.cases.remarks import keywords, tally
from alsph.cases.source import shown_name
from alsph.errors import ConfigError, RunFolderError
from alsph.folder.durable import write_text
from alsph.geometry.shape import Shape
from alsph.results.outcome import changes
from alsph.results.run import Run
from alsph.study.declaration import text, typed
from alsph.symbols import Symbols, in_common
from alsph.tables import markdown
from alsph.text import in_figure, printable, shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Picture

LONGEST_CELL = 40
"""Letters of a result beyond which it is told below the table."""
OF_PARAMETERS = ("case", "Reynolds number", "resolution, D/Δx")
"""Results of a summary that stand among the parameters."""

CPU, STEPS = "CPU seconds a D/U", "steps a D/U"
"""Costs: those of all threads, and of how many steps."""

Table = dict[str, list[Any]]


@dataclass(frozen=True, eq=False)
class Comparison:
    """Runs beside each other, see :func:`compare`.

    Attributes
    ----------
    runs : dict
        Each :class:`alsph.Run` by the name that it has in tables and figures.
    """

    runs: dict[str, Run]

    @property
    def symbols(self) -> Symbols:
        """What the cases call D and U, if all call them the same."""
        return in_common(run.symbols for run in self.runs.values())

    @cached_property
    def parameters(self) -> Table:
        """The parameters and settings that differ, of each run; None where a run's case has no such parameter."""
        tables = [_parameters(run) for run in self.runs.values()]
        names = dict.fromkeys(name for table in tables for name in table)
        rows = {name: [table.get(name) for table in tables] for name in names}
        return {name: row for name, row in rows.items() if any(value != row[0] for value in row)}

    @cached_property
    def results(self) -> Table:
        """What :meth:`alsph.Run.summary` tells of each run, by name; None where a run has no such result."""
        summaries = [run.summary() for run in self.runs.values()]
        names: list[str] = []
        for summary in summaries:  # what only a later run has stands behind what it follows there
            place = 0
            for name in summary:
                if name not in names:
                    names.insert(place, name)
                place = names.index(name) + 1
        left_out = {"message", *(run.symbols(name) for run in self.runs.values() for name in OF_PARAMETERS)}
        told = [name for name in names if name not in left_out and not name.startswith("remark ")]
        return {name: [summary.get(name) for summary in summaries] for name in told}

    @cached_property
    def costs(self) -> Table:
        """What each run took, by name."""
        costs = [costs_of(run) for run in self.runs.values()]
        return {name: [cost[name] for cost in costs] for name in costs[0]}

    @cached_property
    def differences(self) -> dict[str, list[Estimate]]:
        """How much each run but the first differs from the first, by measure; the ± of both are added by squares."""
        measured = {measure.name for run in self.runs.values() for measure in run.measures}
        return {
            name: [_difference(value, values[0]) for value in values[1:]]
            for name, values in self.results.items()
            if name in measured
        }

    @property
    def warnings(self) -> list[str]:
        """What cannot be compared, and what is to be borne in mind with each run, in words."""
        found, cases = [], list(dict.fromkeys(run.config.case.name for run in self.runs.values()))
        if len(cases) > 1:
            shared = [name for name in self.differences if None not in self.results[name]]
            found.append(f"different cases, {' and '.join(cases)}: they share {', '.join(shared) or 'no measure'}")
        for name, run in self.runs.items():
            empty = [] if len(run.history["time"]) else ["no steps recorded yet, nothing to compare"]
            found += [f"{name}: {what}" for what in (*empty, run.info.get("message"), keywords(run.remarks)) if what]
        return found

    def to_markdown(self, figures: Sequence[str] = ()) -> str:
        """Return the comparison as Markdown, with the pictures `figures` from files beside it."""
        names, first = [*self.runs], next(iter(self.runs))
        notes: dict[str, list[tuple[str, str]]] = {}
        rows = [
            [name, *self._cells(name, row, notes), *map(_told, self.differences.get(name, [""] * (len(names) - 1)))]
            for name, row in self.results.items()
        ]
        below = [
            f"{', '.join(dict.fromkeys(results))} ({', '.join(dict.fromkeys(runs))}): {note}"
            for note, where in notes.items()
            for results, runs in [zip(*where, strict=True)]
        ]
        parameters = [[name, *map(_shown, row)] for name, row in self.parameters.items()]
        parts = [
            markdown(["parameter", *names], parameters) if parameters else "All parameters are the same.",
            markdown(["result", *names, *(f"{name} - {first}" for name in names[1:])], rows),
            markdown(["cost", *names], [[self.symbols(name), *map(_shown, row)] for name, row in self.costs.items()]),
            "\n".join(f"- {line}" for line in (*below, *self.warnings)),
            *(f"![{name}]({name}.png)" for name in figures),
        ]
        return printable("\n\n".join(part for part in parts if part) + "\n", lines=True)

    def _cells(self, name: str, row: list[Any], notes: dict[str, list[tuple[str, str]]]) -> list[str]:
        """Return a row's cells; what is too long for one, such as why a number is NaN, goes to the notes."""
        cells = []
        for label, value in zip(self.runs, row, strict=True):
            cell, note = _shown(value), value.note if isinstance(value, Estimate) and np.isnan(value) else ""
            if note or len(cell) > LONGEST_CELL:
                notes.setdefault(note or cell, []).append((name, label))
                cell = "nan" if note else "see below"
            cells.append(cell)
        return cells

    def __str__(self) -> str:
        """Return the tables."""
        return self.to_markdown().rstrip("\n")

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(str(self))}</pre>"

    def draw(self) -> dict[str, Picture]:
        """Return forces, their spectra, and the profiles that two runs or more have, over each other, by name."""
        begun = {in_figure(name): run for name, run in self.runs.items() if len(run.history["time"])}
        loaded = {name: run for name, run in begun.items() if run.body}
        pictures: dict[str, Picture] = {}
        if loaded:
            pictures = {"forces": plotting.coefficients(loaded), "spectrum": plotting.spectrum(loaded)}
        profiles: dict[str, dict[str, Profile]] = {}
        for name, run in begun.items():
            for profile in run.profiles:
                profiles.setdefault(profile.file_name, {})[name] = profile
        pictures |= {file: plotting.profile(curves) for file, curves in profiles.items() if len(curves) > 1}
        title = plotting.title([run.case | {"case": run.config.case.name} for run in begun.values()])
        for picture in pictures.values():
            plotting.head(picture, title)
            plotting.remark(picture, tally([keywords(run.remarks) for run in self.runs.values()]))
            plotting.rename(picture, self.symbols)
        return pictures

    def save(self, folder: str | Path) -> list[Path]:
        """Write ``comparison.md`` and the figures to a folder, and return the paths of all."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        paths = []
        for name, picture in (pictures := self.draw()).items():
            paths.append(folder / f"{name}.png")
            plotting.save(picture, paths[-1], dpi=120)
        write_text(folder / "comparison.md", f"# Comparison\n\n{self.to_markdown([*pictures])}")
        return [folder / "comparison.md", *paths]


def compare(runs: Sequence[Run | str | Path]) -> Comparison:
    """Compare runs: what differs in their parameters, what they found and took, and how far apart they are.

    Parameters
    ----------
    runs
        Two or more, as run folders or :class:`alsph.Run`. The first is what the others are compared with.

    Raises
    ------
    ConfigError
        If there are fewer than two, or one is given twice.
    RunFolderError
        If one is no run folder, or none has begun.
    """
    if isinstance(runs, Run | str | Path) or not isinstance(runs, Iterable) or len(runs := [*runs]) < 2:
        raise ConfigError("a comparison needs two run folders or more")
    opened = [run if isinstance(run, Run) else Run(run) for run in runs]
    places = [run.path.resolve() for run in opened]
    for index, place in enumerate(places):
        if place in places[:index]:
            raise ConfigError(f"{opened[index].path}: given twice; compare different runs")
    if not any(len(run.history["time"]) for run in opened):
        raise RunFolderError(f"{', '.join(str(run.path) for run in opened)}: no steps recorded yet, nothing to compare")
    return Comparison(dict(zip(_labels(places), opened, strict=True)))


def _labels(places: list[Path]) -> list[str]:
    """Return the ends of some paths, as long as they must be to differ."""
    for length in range(1, max(len(place.parts) for place in places)):
        labels = ["/".join(place.parts[-length:]) for place in places]
        if len({*labels}) == len(labels):
            return labels
    return [str(place) for place in places]


def _parameters(run: Run) -> dict[str, str]:
    """Return all parameters of a run's case and the settings of the run, in words."""
    config, declared = run.config, run.config.case.declaration()
    values = {name: getattr(config.case, name) for name in config.case.parameter_names()}
    settings = {f"run.{name}": getattr(config.run, name) for name in type(config.run).model_fields}
    values |= settings | {f"run.{name}": value for name, value in config.ending.items()}
    values |= {
        f"{name}, changed at tU/D = {time:.4g}": became
        for time, what in changes(run)
        for name, (_, became) in what.items()
    }
    case = f"{shown_name(declared)}{_sum(declared['sha256'])}" if isinstance(declared, dict) else declared
    return {"case": case} | {name: _parameter(value) for name, value in values.items()}


def _parameter(value: Any) -> str:
    if isinstance(value, Shape):
        return f"{value}{_sum(value.sha256)}"
    if value is None or isinstance(value, int | float):
        return typed(value)
    return shown(value if isinstance(value, list) else str(value))


def _sum(sha256: str) -> str:
    return f", SHA-256 {sha256[:8]}"


def costs_of(run: Run) -> dict[str, Any]:
    """Return what a run took, by name; NaN where its folder does not tell."""
    seconds, threads, time = run.info.get("seconds", np.nan), run.info.get("threads", np.nan), run.history["time"]
    counts, versions = run.info.get("particles"), run.info.get("versions")
    rate = seconds / time[-1] if len(time) else np.nan
    cpu = run.info.get("cpu_seconds", np.nan)
    return {
        "particles": sum(counts.values()) if isinstance(counts, dict) else None,
        STEPS: len(time) / time[-1] if len(time) else np.nan,
        "wall seconds a D/U": rate,
        "threads": threads,
        "wall seconds a D/U times threads": rate * threads,
        CPU: cpu / time[-1] if len(time) else np.nan,
        "processor": run.info.get("machine", {}).get("processor"),
        "alsph, commit": f"{versions.get('alsph') if isinstance(versions, dict) else ''}, {run.info.get('commit')}",
    }


def _difference(value: Any, first: Any) -> Estimate:
    """Return the difference of two measures, NaN where one is missing."""
    if value is None or first is None:
        return Estimate(np.nan)
    own, other = (getattr(each, "uncertainty", math.nan) for each in (value, first))
    apart = math.hypot(own, other)
    return Estimate(float(value) - float(first), apart, DEVELOPING if remark(value) or remark(first) else "")


def _told(difference: Estimate | str) -> str:
    """Return a difference in words, and how it compares with its ±."""
    if isinstance(difference, str) or np.isnan(difference):
        return ""
    if not 0 < difference.uncertainty < np.inf:
        return str(difference)
    times = abs(difference) / difference.uncertainty
    return f"{difference}: {'within ±' if times <= 1 else f'{times:.2g} times ±'}"


def _shown(value: Any) -> str:
    return "" if value is None else str(value) if isinstance(value, Estimate) else text(value)
