"""What a study found: a row of results for each run, tables, and figures in the form that the study declares."""

from __future__ import annotations

import csv
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from alsph import plotting
from alsph.analysis.averages import Estimate, remark
from alsph.analysis.loads import Divergence
from alsph.analysis.measures import Profile
from alsph.analysis.window import DEVELOPING
from alsph.cases.remarks import keywords, tally
from alsph.config import Config
from alsph.errors import AlsphError, ConfigError
from alsph.folder.durable import check_target, replacing, write_text
from alsph.folder.run_folder import RunFolder
from alsph.parameters import suggest
from alsph.plotting.curves import Curve
from alsph.results.run import Run
from alsph.study.declaration import RUNS, Figure, Point, Study, text, typed
from alsph.study.state import ENDED, State, states
from alsph.symbols import Symbols, in_common
from alsph.tables import html, markdown
from alsph.text import in_figure, printable

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Picture

    from alsph.cases import Case

OF_ALL_RUNS = (
    Divergence.NAMES["mean"],
    Divergence.NAMES["at_end"],
    "sum of the velocity divergence, Σ|∇·u| D/U",
    "shedding periods",
    "steps",
    "mean time step, ΔtU/Δx",
    "mean iterations",
)
"""Numbers that runs of every case have."""
RULE = "averaging rule"
"""A result of all runs that is a text, and so not to be drawn."""


def check_names(study: Study, points: Sequence[Point]) -> None:
    """Refuse a study that collects or draws what none of its runs will have.

    Raises
    ------
    ConfigError
        With the name, where it stands, and what there is.
    """
    results, profiles = set(OF_ALL_RUNS), set[str]()
    kinds = {(point.config.case.name, point.config.case.space_dimensions): point.config for point in points}
    for config in kinds.values():
        measures, curves = names(config)
        results.update(measures)
        profiles.update(curves)
    wanted = [("collect", name, results | {RULE}) for name in study.collect]
    parameters = {*study.swept, *(name for config in kinds.values() for name in config.case.parameter_names())}
    for other in study.published:
        wanted += [(f"published {other.label}, parameters", name, parameters) for name in other.parameters]
        wanted += [(f"published {other.label}, values", name, results) for name in other.values]
    for figure in study.figures:
        wanted += [(f"figure {figure.name}, y", name, results) for name in figure.curves]
        wanted += [(f"figure {figure.name}, profile", name, profiles) for name in filter(None, [figure.profile])]
    for where, name, known in wanted:
        if name not in known and not name.startswith(tuple(begin for begin in known if begin.endswith("= "))):
            what = "parameter" if known is parameters else "result"
            raise ConfigError(f"{where}: no {what} '{name}'; {suggest(name, sorted(known))}")


def names(config: Config) -> tuple[set[str], set[str]]:
    """Return the names of the measures and of the profiles that a run of a case has, as an empty run folder tells."""
    with TemporaryDirectory() as place:
        folder = RunFolder(Path(place) / "run")
        folder.create(config)
        folder.announce(config)
        run = Run(folder.path)
        run.config = config
        measures, profiles = {measure.name for measure in run.measures}, {profile.name for profile in run.profiles}
        measures |= _in_si(run).keys()
    later = set(config.case.later_names)
    return measures | later, profiles | later


def _in_si(run: Run) -> dict[str, Estimate]:
    """Return the results that have a dimension in SI; none of a case without units."""
    return run.dimensional() if run.units else {}


@dataclass(frozen=True, eq=False)
class Results:
    """The results of a study.

    Attributes
    ----------
    study : Study
    path : Path
        Folder of the tables and figures.
    rows : list of dict
        For each run its swept parameters, ``status``, ``time`` reached, ``folder``, and the results by name, numbers
        with their uncertainty where they have one (:class:`alsph.analysis.averages.Estimate`); ``remarks`` are what
        there is to be said of a run, its :attr:`alsph.Run.remarks` in short.
    references : list of dict
        Reference values of the same results, where they are known.
    states : list of State
        How far each run is.
    found : list of dict
        All results of each run by name, collected in the rows or not.
    """

    study: Study
    path: Path
    rows: list[dict[str, Any]]
    references: list[dict[str, float]]
    states: list[State]
    found: list[dict[str, Any]]

    @classmethod
    def of(cls, study: Study, points: list[Point], output: Path, failures: Mapping[str, str] | None = None) -> Results:
        """Collect the results from the run folders in ``output/runs``; `failures` are messages by name of the run."""
        found = states(points, output, failures)
        reached = [found[point.name] for point in points]
        everything: list[dict[str, Any]] = []
        rows: list[dict[str, Any]] = []
        references: list[dict[str, float]] = []
        for point, state in zip(points, reached, strict=True):
            folder = output / RUNS / point.name
            results, known, remarked = _collected(folder, state)
            chosen = {name: results.get(name, Estimate(np.nan)) for name in study.collect} or results
            head = {"status": state.status, "time": state.time, "seconds": state.seconds}
            everything.append(results)
            tail = remarked | {"folder": f"{RUNS}/{point.name}"}
            rows.append(dict(point.parameters) | head | chosen | tail)
            references.append(known)
        return cls(study, output / study.name, rows, references, reached, everything)

    @property
    def warnings(self) -> list[str]:
        """What the study asks for and no finished run has, in words."""
        known = {name for row in self.found for name in row}
        wanted = [("collect", name) for name in self.study.collect]
        wanted += [(f"figure {figure.name}, y", y) for figure in self.study.figures for y in figure.curves]
        missing = [
            f"{where}: no result '{name}'; {suggest(name, known)}"
            for where, name in wanted
            if name not in known and known
        ]
        empty = [figure for figure in self.study.figures if known and not self._chosen(figure)]
        return missing + [
            f"figure {figure.name}: not drawn, no finished run has {_in_words(self._where(figure))}" for figure in empty
        ]

    @property
    def complete(self) -> bool:
        """Whether every run has ended: finished, diverged, or skipped after one that diverged."""
        return all(state.status in ENDED for state in self.states)

    def save(self) -> None:
        """Write ``results.csv``, ``results.md`` and the figures to :attr:`path`."""
        self.path.mkdir(parents=True, exist_ok=True)
        self._save_csv(self.path / "results.csv")
        figures = self.draw()
        for name, figure in figures.items():
            plotting.save(figure, self.path / f"{name}.png", dpi=120)
        write_text(self.path / "results.md", self.to_markdown([*figures]))

    def _columns(self) -> list[str]:
        return list(dict.fromkeys(name for row in self.rows for name in row))

    def _save_csv(self, path: Path) -> None:
        columns = self._columns()
        uncertain = {name for row in self.rows for name, value in row.items() if _uncertainty(value) is not None}
        header = [cell for name in columns for cell in ([name, f"{name}, ±"] if name in uncertain else [name])]
        check_target(path)
        with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(header)
            for row in self.rows:
                cells = []
                for name in columns:
                    cells.append(_cell(row.get(name, "")))
                    if name in uncertain:
                        cells.append(_cell(_uncertainty(row.get(name)) or ""))
                writer.writerow(cells)

    def to_markdown(self, figures: list[str] | None = None) -> str:
        """Return the results as Markdown, with the pictures `figures` from files beside it."""
        titles = {figure.name: figure.title or figure.name for figure in self.study.figures}
        parts = [f"# {self.study.title or self.study.name}", self.study.source, self._table()]
        parts += [
            f"*{row['folder']} failed: {state.message}*"
            for row, state in zip(self.rows, self.states, strict=True)
            if state.status == "failed"
        ]
        parts += [f"*{warning}*" for warning in self.warnings]
        parts += [f"![{titles[name]}]({name}.png)\n\n*{titles[name]}*" for name in figures or []]
        return printable("\n\n".join(part for part in parts if part) + "\n", lines=True)

    def _table(self) -> str:
        columns = [name for name in self._columns() if name not in ("folder", "seconds")]
        lines = [self._words(row, columns) for row in self.rows]
        for published in self.study.published:
            values = published.parameters | {"status": published.label} | published.values
            lines.append(self._words(values, columns))
        lines += [
            self._words(parameters | {"status": "reference"} | known, columns)
            for parameters, known in self._distinct_references()
        ]
        return markdown(columns, lines)

    def _words(self, row: Mapping[str, Any], columns: Sequence[str]) -> list[str]:
        """Return the cells of a row, parameters as they were given and results rounded."""
        swept = self.study.swept
        return ["" if name not in row else (typed if name in swept else _shown)(row[name]) for name in columns]

    def _distinct_references(self) -> list[tuple[dict[str, Any], dict[str, float]]]:
        """Return each set of reference values once, with the parameters that all its runs share."""
        groups: list[tuple[dict[str, Any], dict[str, float]]] = []
        swept = self.study.swept
        for row, known in zip(self.rows, self.references, strict=True):
            mine = {name: row[name] for name in swept if name in row}
            for shared, other in groups:
                if other == known:
                    for name in [name for name in shared if shared[name] != mine.get(name)]:
                        del shared[name]
                    break
            else:
                if known:
                    groups.append((mine, known))
        return groups

    def __str__(self) -> str:
        """Return the table."""
        return self._table()

    def _repr_html_(self) -> str:
        columns = [name for name in self._columns() if name != "folder"]
        return html(columns, [self._words(row, columns) for row in self.rows])

    @property
    def symbols(self) -> Symbols:
        """What the cases call D and U, if all call them the same."""
        return in_common(case.symbols for case in self._cases)

    @cached_property
    def _cases(self) -> list[Case]:
        return [point.config.case for point in self.study.points()]

    def draw(self) -> dict[str, Picture]:
        """Return the figures that can be drawn from the runs that have finished, by name."""
        draw = {"curves": self._curves, "profile": self._profiles, "fields": self._fields}
        pictures = {}
        for figure in self.study.figures:
            if picture := draw[figure.kind](figure):
                plotting.head(picture, self._title(figure))
                plotting.remark(picture, tally([self.rows[k].get("remarks", "") for k in self._chosen(figure)]))
                plotting.rename(picture, self.symbols)
                pictures[figure.name] = picture
        return pictures

    def _title(self, figure: Figure) -> str:
        chosen = [self._cases[index] for index in self._chosen(figure)]
        return plotting.title([case.model_dump() | {"case": case.name} for case in chosen])

    def _chosen(self, figure: Figure) -> list[int]:
        """Return the finished runs that a figure shows."""
        where = self._where(figure).items()
        finished = [index for index, row in enumerate(self.rows) if row["status"] == "finished"]
        return [index for index in finished if all(self.rows[index].get(name) == value for name, value in where)]

    def _where(self, figure: Figure) -> dict[str, Any]:
        """Return the parameters that the runs of a figure have."""
        where = dict(figure.where)
        if figure.finest:
            given = (value for row in self.rows if (value := row[figure.finest]) is not None)
            where[figure.finest] = max(given, default=None)
        return where

    def _series(self, row: Mapping[str, Any], without: str = "") -> str:
        """Return the name of the series that a run belongs to, in the paper's form."""
        parts = []
        for name in self.study.swept:
            if name != without and any(other[name] != self.rows[0][name] for other in self.rows):
                parts.append(_LEGEND.get(name, "{name} {value}").format(name=name, value=in_figure(typed(row[name]))))
        return ", ".join(parts)

    def _curves(self, figure: Figure) -> Picture | None:
        chosen = [index for index in self._chosen(figure) if self.rows[index][figure.x] is not None]
        panels: dict[str, list[Curve]] = {}
        for y in figure.y:
            series: dict[str, list[tuple[Any, Any]]] = {}
            known: dict[str, list[tuple[Any, float]]] = {}
            for index in chosen:
                row = self.rows[index]
                name = self._series(row, figure.x)
                if not _is_nan(self.found[index].get(y)):
                    series.setdefault(name, []).append((row[figure.x], self.found[index][y]))
                if y in self.references[index]:
                    known.setdefault(name, []).append((row[figure.x], self.references[index][y]))
            curves = [Curve(name, *_sorted(points)) for name, points in series.items()]
            early = [point for points in series.values() for point in points if remark(point[1])]
            if early:
                curves.append(Curve(DEVELOPING, *_sorted(early)[:2], style="x", colour="k"))
            shared = _shared(known)
            curves += [
                Curve(_of(names) if len(shared) > 1 else "reference", *_sorted(points), style="d--", colour="k")
                for names, points in shared
            ]
            where = self._where(figure)
            curves += [
                Curve(other.label, [other.parameters[figure.x]], [other.values[y]], style=marker, colour="k")
                for other, marker in zip(self.study.published, itertools.cycle(_MARKERS), strict=False)
                if figure.x in other.parameters
                and y in other.values
                and all(other.parameters.get(name, value) == value for name, value in where.items())
            ]
            panels[figure.labels.get(y, y)] = curves
        if not any(panels.values()):
            return None
        label = figure.labels.get(figure.x, figure.x)
        return plotting.panels(panels, label, figure.logarithmic)

    def _runs(self, figure: Figure) -> dict[str, Run]:
        return {
            self._series(self.rows[index]): Run(self.path.parent / self.rows[index]["folder"])
            for index in self._chosen(figure)
        }

    def _profiles(self, figure: Figure) -> Picture | None:
        curves: dict[str, Profile] = {}
        for name, run in self._runs(figure).items():
            curves.update((name, profile) for profile in run.profiles if profile.name == figure.profile)
        return plotting.profile(curves) if curves else None

    def _fields(self, figure: Figure) -> Picture | None:
        """Pictures of fields at the largest lift of the last snapshots, one column for each field."""
        runs = self._runs(figure)
        snapshots = {name: (run.snapshot(_time_of_largest_lift(run)), run.spacing) for name, run in runs.items()}
        return plotting.fields(snapshots, figure.y, figure.view or None) if snapshots else None


_LEGEND = {
    "resolution": "$D/\\Delta x$ = {value}",
    "algorithm": "Algorithm {value}",
    "reynolds": "Re = {value}",
    "time_step": "$\\Delta tU/\\Delta x$ = {value}",
    "max_iterations": "{value} iterations",
}
_MARKERS = "*+1234|"
SNAPSHOTS_AT_LIFT = 10


def _time_of_largest_lift(run: Run) -> float | None:
    """Return the time of that of the last snapshots in the window at which the lift is largest; None without lift."""
    lift = run.coefficient("y")
    settled = run.times[run.window.holds(run.times)]
    times = (settled if len(settled) else run.times)[-SNAPSHOTS_AT_LIFT:]
    if not len(times) or not np.isfinite(lift).any():
        return None
    at = np.interp(times, run.history["time"], lift)
    return float(times[np.argmax(at)])


def _collected(folder: Path, state: State) -> tuple[dict[str, Any], dict[str, float], dict[str, str]]:
    """Return the results of a finished run by name, the reference values of those that have one, and remarks."""
    if state.status != "finished":
        return {}, {}, {}
    try:
        run = Run(folder)
        results: dict[str, Any] = {measure.name: measure.value for measure in run.measures} | _in_si(run)
        known = {measure.name: measure.reference for measure in run.measures if abs(measure.reference) > 0}
        history = run.history
        numbers = (
            run.divergence.mean,
            run.divergence.at_end,
            run.divergence.sum,
            run.window.periods,
            len(history["time"]),
            float(np.mean(history["time_step"])) / run.spacing,
            float(np.mean(history["iterations"])),
        )
        results |= {RULE: run.window.rule} | dict(zip(OF_ALL_RUNS, numbers, strict=True))
        return results, known, {"remarks": keywords(run.remarks)} if run.remarks else {}
    except (AlsphError, KeyError) as error:
        return {"message": str(error)}, {}, {}


def _shared(known: Mapping[str, list[tuple[Any, float]]]) -> list[tuple[list[str], list[tuple[Any, float]]]]:
    """Return reference values with the names of the series that they are of, each set once."""
    found: list[tuple[list[str], list[tuple[Any, float]]]] = []
    for name, points in known.items():
        for names, others in found:
            theirs = [(x, value) for x, value in others if any(x == own for own, _ in points)]
            if all(point in points for point in theirs):
                names.append(name)
                others += [point for point in points if point not in others]
                break
        else:
            found.append(([name], list(points)))
    return found


def _of(names: Sequence[str]) -> str:
    """Return what reference values are called that are those of series, by what the series have in common."""
    parts = [name.split(", ") for name in names]
    common = [part for part in parts[0] if all(part in others for others in parts)]
    return ", ".join(["reference", *(common or ["; ".join(names)])])


def _in_words(parameters: Mapping[str, Any]) -> str:
    return " and ".join(f"{name} = {typed(value)}" for name, value in parameters.items())


def _sorted(points: list[tuple[Any, Any]]) -> tuple[list[float], list[float], list[float]]:
    """Return abscissae, numbers increasing and words as they come, with ordinates and the uncertainties of these."""
    if not all(isinstance(x, int | float) for x, _ in points):
        points = [(typed(x), y) for x, y in points]
    else:
        points = sorted(points, key=lambda point: point[0])
    bars = [_uncertainty(y) or 0.0 for _, y in points]
    return [x for x, _ in points], [float(y) for _, y in points], [bar if np.isfinite(bar) else 0.0 for bar in bars]


def _uncertainty(value: Any) -> float | None:
    return value.uncertainty if isinstance(value, Estimate) and not np.isnan(value.uncertainty) else None


def _is_nan(value: Any) -> bool:
    return value is None or (isinstance(value, float) and bool(np.isnan(value)))


def _cell(value: Any) -> str:
    return repr(float(value)) if isinstance(value, float) else printable(str(value))


def _shown(value: Any) -> str:
    if _is_nan(value):
        return ""
    return str(value) if isinstance(value, Estimate) else text(value)
