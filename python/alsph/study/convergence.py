"""Convergence of a case: a ladder of resolutions, observed orders, Richardson values and grid convergence indices."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from alsph import plotting, study
from alsph.analysis.averages import remark
from alsph.arguments import ladder
from alsph.cases.base import Case
from alsph.cases.remarks import tally
from alsph.config import Config
from alsph.errors import ConfigError
from alsph.folder.durable import write_text
from alsph.plotting.curves import Curve
from alsph.results.run import Run
from alsph.study import Results, Study, Sweep
from alsph.study.declaration import digest
from alsph.tables import markdown
from alsph.text import shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SAFETY = 1.25
"""Factor of safety of the grid convergence index from three resolutions (Roache 1994)."""

LARGEST_ORDER = 8.0


@dataclass(frozen=True)
class Convergence:
    """How a result depends on the particle spacing, from its values at the three finest resolutions.

    Attributes
    ----------
    name : str
        The result.
    resolutions : tuple of float
        D/Δx, increasing.
    values : tuple of float
        The result at each.
    kind : str
        ``monotonic``, ``oscillating`` or ``diverging``: how the last three follow each other; ``within ±`` if the last
        two differ by no more than their uncertainties, ``unknown`` if one of these is infinite or a value is NaN.
    order : float
        Observed order p; NaN unless monotonic. Of an error, whose reference is zero, that between the last two.
    richardson : float
        Value extrapolated to Δx = 0; NaN unless monotonic, and of errors, whose limit is known.
    index : float
        Grid convergence index of the finest resolution, 1.25 |e| / (r^p − 1) with the relative change e of the last
        refinement by r; half the range over the finest value where the values oscillate; NaN where they diverge, and of
        errors, whose reference is zero.
    reference : float
        Independent value, NaN where there is none.
    """

    name: str
    resolutions: tuple[float, ...]
    values: tuple[float, ...]
    kind: str
    order: float
    richardson: float
    index: float
    reference: float = np.nan


def grid_convergence(
    name: str, resolutions: Sequence[float], values: Sequence[float], reference: float = np.nan
) -> Convergence:
    """Return the observed order, Richardson value and grid convergence index of a result.

    Parameters
    ----------
    name
        The result.
    resolutions
        At least three D/Δx, increasing; their ratios may differ.
    values
        The result at each; an :class:`alsph.analysis.averages.Estimate` with its uncertainty.
    reference
        Independent value.

    Notes
    -----
    The order p solves (φ₁ − φ₂)/(φ₂ − φ₃) = (r₁₂^p − 1) r₂₃^p / (r₂₃^p − 1) of f = φ + C Δx^p through the last three
    values, from coarse (1) to fine (3): the procedure of Celik et al. (J. Fluids Eng. 130, 078001, 2008), section 2.
    An error is known to go to zero, so that two of them tell an order: log (φ₂/φ₃) / log r₂₃.
    """
    known = tuple(map(float, resolutions)), tuple(values)
    if len(resolutions) < 3 or len(values) != len(resolutions):
        raise ConfigError(f"{name}: needs values at three resolutions or more, and has {len(values)}")
    (n1, n2, n3), (f1, f2, f3) = known[0][-3:], known[1][-3:]
    if not n1 < n2 < n3:
        raise ConfigError(f"{name}: resolutions must increase, and are {n1:g}, {n2:g}, {n3:g}")
    coarse, fine = f2 - f1, f3 - f2
    scale = abs(f3) if f3 else np.nan
    unknown = np.nan, np.nan
    if not np.isfinite([coarse, fine]).all():
        return Convergence(name, *known, "unknown", *unknown, np.nan, reference)
    apart = math.hypot(*map(_uncertainty, known[1][-2:]))
    if fine and abs(fine) <= apart:
        return Convergence(name, *known, "within ±" if apart < np.inf else "unknown", *unknown, np.nan, reference)
    if fine == 0:
        return Convergence(name, *known, "monotonic", *unknown, np.nan, reference)
    ratio, r12, r23 = coarse / fine, n2 / n1, n3 / n2
    if reference == 0:
        e1, e2, e3 = map(abs, (f1, f2, f3))
        shrinks, grows = e1 > e2 > e3 and f1 * f2 > 0 < f2 * f3, e1 < e2 < e3
        order = math.log(e2 / e3) / math.log(r23) if shrinks else np.nan
        kind = "monotonic" if shrinks else "diverging" if grows else "oscillating"
        return Convergence(name, *known, kind, order, np.nan, np.nan, reference)
    if ratio < 0:
        spread = np.ptp([f1, f2, f3]) / 2 / scale
        return Convergence(name, *known, "oscillating", *unknown, float(spread), reference)

    def mismatch(p: float) -> float:
        return float((r12**p - 1) * r23**p / (r23**p - 1) - ratio)

    if not mismatch(1e-3) < 0 < mismatch(LARGEST_ORDER):
        kind = "diverging" if mismatch(1e-3) >= 0 else "monotonic"
        return Convergence(name, *known, kind, *unknown, np.nan, reference)
    from scipy.optimize import brentq  # takes 0.1 s to load

    order = float(brentq(mismatch, 1e-3, LARGEST_ORDER))
    richardson = f3 + fine / (r23**order - 1)
    index = SAFETY * abs(fine) / scale / (r23**order - 1)
    return Convergence(name, *known, "monotonic", order, float(richardson), float(index), reference)


@dataclass(frozen=True, eq=False)
class Report:
    """Convergence of a case.

    Attributes
    ----------
    path : Path
        Folder of report and figure.
    results : Results
        The study of the resolutions.
    convergences : list of Convergence
        One for each measure of the case.
    """

    path: Path
    results: Results
    convergences: list[Convergence]

    @property
    def gaps(self) -> list[str]:
        """Which runs have not finished, and which measures are NaN in which run and why, in words."""
        name = self.results.symbols("D/Δx")
        places = {
            float(row["resolution"]): f"{name} = {row['resolution']}, {row['folder']}" for row in self.results.rows
        }
        states = zip(places.values(), self.results.states, strict=True)
        gaps = [f"{place}: {state.status}" for place, state in states if state.status != "finished"]
        missing: dict[tuple[str, str], list[str]] = {}
        for found in self.convergences:
            for resolution, value in zip(found.resolutions, found.values, strict=True):
                if not np.isfinite(value):
                    why = getattr(value, "note", "") or "the run does not tell"
                    missing.setdefault((places[resolution], why), []).append(found.name)
        return [*gaps, *(f"{place}: no {', '.join(names)}: {why}" for (place, why), names in missing.items())]

    def __str__(self) -> str:
        """Return the table, and what is missing in it."""
        return "\n\n".join(filter(None, (self._table(), "\n".join(f"- {gap}" for gap in self.gaps))))

    def __repr__(self) -> str:
        """Name the folder and the resolutions."""
        return f"Report('{self.path}': {', '.join(str(row['resolution']) for row in self.results.rows)})"

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(str(self))}</pre>"

    def _table(self) -> str:
        if not self.convergences:
            return "nothing to judge: fewer than three runs have finished, or the case has no measures"
        resolutions = self.convergences[0].resolutions
        header = [
            "quantity",
            *(self.results.symbols(f"D/Δx = {n:g}") for n in resolutions),
            "kind",
            "order",
            "Richardson",
            "GCI",
            "reference",
        ]
        rows = [
            [
                found.name,
                *(str(v) if 0 < _uncertainty(v) < np.inf else f"{v:.5g}{remark(v)}" for v in found.values),
                ", ".join(filter(None, (found.kind, _no_order(found)))),
                _shown(found.order, ".2f"),
                _shown(found.richardson, ".5g"),
                _shown(100 * found.index, ".2g", " %"),
                _shown(found.reference, ".5g"),
            ]
            for found in self.convergences
        ]
        return markdown(header, rows)

    def draw(self) -> Figure | None:
        """Return a figure of each measure over the particle spacing, with Richardson and reference values."""
        if not self.convergences:
            return None
        panels: dict[str, list[Curve]] = {}
        for found in self.convergences:
            spacing = [1 / n for n in found.resolutions]
            bars = [_uncertainty(value) for value in found.values]
            curves = [Curve("alsph", spacing, list(found.values), [bar if np.isfinite(bar) else 0.0 for bar in bars])]
            if np.isfinite(found.richardson):
                band = [abs(found.index * found.values[-1])]
                curves.append(Curve("Richardson, ± GCI", [0.0], [found.richardson], band, style="s"))
            if np.isfinite(found.reference) and found.reference:
                curves.append(Curve("reference", [0.0, max(spacing)], [found.reference] * 2, style="--", colour="k"))
            panels[found.name] = curves
        figure = plotting.panels(panels, r"$\Delta x/D$")
        plotting.head(figure, self.results.study.title)
        plotting.remark(figure, tally([row.get("remarks", "") for row in self.results.rows]))
        plotting.rename(figure, self.results.symbols)
        return figure

    def save(self) -> None:
        """Write ``convergence.md`` and ``convergence.png``."""
        picture = self.draw()
        lines = ["# Convergence", str(self)]
        head = self.results.symbols("D/Δx")
        lines += [f"{head} = {row['resolution']}: {row['remarks']}" for row in self.results.rows if "remarks" in row]
        if picture:
            plotting.save(picture, self.path / "convergence.png", dpi=120)
            lines.append("![Each measure over the particle spacing](convergence.png)")
        write_text(self.path / "convergence.md", "\n\n".join(lines) + "\n")


def converge(
    config: Config | Case,
    resolutions: Sequence[int],
    output: str | Path = "runs/studies",
    *,
    progress: bool = True,
    **where: Any,
) -> Report:
    """Run a case at a ladder of resolutions and judge the convergence of its measures.

    Parameters
    ----------
    config
        The case, whose own resolution does not count, and the settings of its runs.
    resolutions
        At least three D/Δx.
    output
        Folder for runs and results, as in :func:`alsph.study.run`; finished runs are used again.
    progress
        Report progress.
    **where
        Further arguments of :func:`alsph.study.run`: ``jobs``, ``threads``, ``scheduler``.

    Raises
    ------
    ConfigError
        If there are fewer than three resolutions, or the case cannot be made at one of them.
    """
    if not isinstance(config, Config):
        if not isinstance(config, Case):
            raise ConfigError(f"config = {shown(config)}: must be a case such as alsph.cases.Cylinder(), or a Config")
        config = Config(config)
    sizes = ladder("resolutions", resolutions)
    if len(sizes) < 3:
        raise ConfigError(f"resolutions = {sizes}: convergence needs three or more")
    declared = Study(
        name=f"converge-{config.case.name}-{digest(config, 'resolution')[:6]}-{'-'.join(map(str, sizes))}",
        title=f"Convergence of {config.case.name}",
        base=config.tables(),
        sweep=Sweep(product={"resolution": sizes}),
    )
    results = study.run(declared, output, progress=progress, **where)
    finished = [row for row in results.rows if row["status"] == "finished"]
    measures = [
        {measure.name: measure for measure in Run(results.path.parent / row["folder"]).measures} for row in finished
    ]
    reached = [row["resolution"] for row in finished]
    convergences = [
        grid_convergence(name, reached, [each[name].value for each in measures], measure.reference)
        for name, measure in (measures[-1] if len(reached) >= 3 else {}).items()
        if all(name in each for each in measures)
    ]
    report = Report(results.path, results, convergences)
    report.save()
    return report


def _no_order(found: Convergence) -> str:
    """Say why values that go one way tell no order; return nothing of others."""
    if found.kind != "monotonic" or np.isfinite(found.order):
        return ""
    if found.values[-2] == found.values[-1]:
        return "the last two are the same"
    return f"faster than Δx^{LARGEST_ORDER:g}"


def _uncertainty(value: float) -> float:
    """Return the ± of a value, zero where it has none."""
    found = getattr(value, "uncertainty", np.nan)
    return 0.0 if np.isnan(found) else float(found)


def _shown(value: float, form: str, unit: str = "") -> str:
    return "" if np.isnan(value) else f"{value:{form}}{unit}"
