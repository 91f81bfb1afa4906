"""Figures of a run over time, and its spectra."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from alsph.analysis import averages
from alsph.analysis.averages import Window
from alsph.analysis.energy import taken
from alsph.analysis.window import DEVELOPING
from alsph.arrays import FloatArray
from alsph.plotting.style import PALETTE, TIME_LABEL, blank, line, nothing_to_draw
from alsph.results.ledger import Ledger
from alsph.results.outcome import has_moved, has_surface
from alsph.results.run import Run

REFERENCE: dict[str, Any] = {"color": "k", "ls": ":", "lw": 1}
"""How levels of a reference are drawn."""

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def forces(run: Run, body: str | None = None) -> Figure:
    """Drag and lift coefficients over time with their parts, the averaging window shaded and the means drawn.

    Where a reference has them, for all bodies together, dots are at its mean drag and the amplitude of its lift.
    """
    figure = blank(9, 6)
    upper, lower = figure.subplots(2, 1, sharex=True)
    time, known = run.history["time"], {} if body else references(run)
    levels = {
        "x": [known[name] for name in ("mean drag coefficient",) if name in known],
        "y": [sign * known[name] for name in ("lift coefficient amplitude",) if name in known for sign in (1, -1)],
    }
    for axes, axis, symbol in ((upper, "x", "C_D"), (lower, "y", "C_L")):
        parts = {part: run.coefficient(axis, part, body) for part in ("viscous", "pressure", "total")}
        for number, (part, values) in zip((2, 1, 0), parts.items(), strict=True):
            axes.plot(time, values, lw=1, label=part, **line(number, 3, len(time)))
        if limits := robust_limits([(time, values) for values in parts.values()]):
            axes.set_ylim(min([limits[0], *levels[axis]]), max([limits[1], *levels[axis]]))
        for number, level in enumerate(levels[axis]):
            axes.axhline(level, **REFERENCE, label="" if number else "reference")
        axes.set_ylabel(f"${symbol}$")
        _finish(axes, run.window, legend=axes is upper)
    if run.window.edges.size and run.bodies:
        drag, lift = run.load("x", body), run.load("y", body)
        span = [run.window.start, run.window.end]
        upper.plot(span, [drag.mean] * 2, "k--", lw=1)
        upper.set_title(f"mean $C_D$ = {drag.mean}", loc="left", fontsize="medium")
        strouhal = ""
        if run.config.case.is_averaged:
            strouhal = ",  no shedding found" if np.isnan(run.strouhal) else f",  Sr = {run.strouhal}"
        lower.set_title(f"rms $C_L$ = {lift.rms}{strouhal}", loc="left", fontsize="medium")
    if (share := run.config.case.computed_share) < 1:
        lower.set_title(f"of {Fraction(share)} of the body, which is computed", loc="right", fontsize="medium")
    lower.set_xlabel(TIME_LABEL)
    if not run.bodies:
        nothing_to_draw(figure, "no body whose forces are recorded")
    return figure


def references(run: Run) -> dict[str, float]:
    """Return what the case of a run has references of, by the names of its measures."""
    return {measure.name: measure.reference for measure in run.measures if np.isfinite(measure.reference)}


def coefficients(runs: dict[str, Run]) -> Figure:
    """Drag and lift coefficients of several runs over time, with dashes at the means over their averaging windows.

    Parameters
    ----------
    runs : dict
        Runs by the name they have in the figure.
    """
    figure = blank(9, 6)
    upper, lower = figure.subplots(2, 1, sharex=True)
    for axes, axis, symbol in ((upper, "x", "C_D"), (lower, "y", "C_L")):
        records = [(run.history["time"], run.coefficient(axis)) for run in runs.values()]
        for index, ((name, run), record) in enumerate(zip(runs.items(), records, strict=True)):
            label, drawn = (
                f"{name}, {DEVELOPING}" if run.window.developing else name,
                line(index, len(runs), len(record[0])),
            )
            axes.plot(*record, lw=1, label=label, **drawn)
            if run.window.edges.size:
                span = [run.window.start, run.window.end]
                axes.plot(span, [run.load(axis).mean] * 2, "--", color=drawn["color"], lw=1)
        if limits := robust_limits(records):
            axes.set_ylim(limits)
        axes.set_ylabel(f"${symbol}$")
        axes.grid(alpha=0.3)
    upper.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=3, fontsize="small", frameon=False)
    lower.set_xlabel(TIME_LABEL)
    return figure


def spectrum(runs: dict[str, Run], body: str | None = None) -> Figure:
    """Amplitudes of the spectral lines of drag and lift in the averaging window.

    Parameters
    ----------
    runs : dict
        Runs by the name they have in the figure.
    body : str, optional
        Name of the body; the only one if None.
    """
    figure = blank(9, 6)
    grid = figure.subplots(2, 1, sharex=True)
    known = map(references, runs.values())
    strouhal = {values["Strouhal number"] for values in known if "Strouhal number" in values}
    for axes, axis, symbol in zip(grid, "xy", ("C_D", "C_L"), strict=True):
        for number, (name, run) in enumerate(runs.items()):
            time, window, coefficient = run.history["time"], run.window, run.coefficient(axis, body=body)
            if window.edges.size and np.isfinite(coefficient).any():
                lines = averages.amplitude_spectrum(time, coefficient, window.start, window.end)
                label = f"{name}, {DEVELOPING}" if window.developing else name
                drawn = line(number, len(runs), len(lines[0]) - 1, logarithmic=True)
                axes.loglog(*(a[1:] for a in lines), lw=0.8, label=label, **drawn)
        axes.set_ylabel(f"amplitude of ${symbol}$")
        axes.grid(alpha=0.3)
        if axis == "y" and axes.lines and len(strouhal) == 1:
            axes.axvline(*strouhal, **REFERENCE, label="Sr of the reference")
        if axes.lines:
            axes.legend()
    grid[-1].set_xlabel("$fD/U$")
    if not any(axes.lines for axes in grid):
        some = any(run.bodies for run in runs.values())
        nothing_to_draw(figure, "no averaging window" if some else "no body whose forces are recorded")
    return figure


def _finish(axes: Axes, window: Window | None, *, legend: bool = True) -> None:
    """Shade the averaging window, if there is one, and put the legend above the panel, where it hides nothing."""
    if window is not None and window.edges.size:
        label = f"averaged ({window.periods} periods)" if window.periods else "averaged"
        label += f", {DEVELOPING}" if window.developing else ""
        axes.axvspan(window.start, window.end, color="0.92", zorder=0, label=label)
    axes.grid(alpha=0.3)
    if legend and axes.get_legend_handles_labels()[0]:
        axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=5, frameon=False, fontsize="small", borderpad=0)


def robust_limits(records: list[tuple[FloatArray, FloatArray]]) -> tuple[float, float] | None:
    """Return ends of the ordinate for records without their start, where an impulsive start towers over all else.

    None where there is nothing to go by.
    """
    long = [(time, values) for time, values in records if len(time) >= 10]
    late = np.concatenate([values[time > time[0] + 0.1 * (time[-1] - time[0])] for time, values in long] or [[]])
    late = late[np.isfinite(late)]
    if not (late.size and np.ptp(late) > 0):
        return None
    margin = 0.15 * np.ptp(late)
    return float(late.min() - margin), float(late.max() + 2 * margin)


def ledger(run: Run) -> Figure:
    """Divergence and the solver's effort on the left; on the right volume, mass, energy and its budget.

    Beside a free surface, unless bodies move, it is known what parts of the step take of the energy.
    """
    ledger, history = run.ledger, run.history
    empty = np.empty(0)
    fluid, mass = history.get("fluid", empty), history.get("mass_in", empty) - history.get("mass_out", empty)
    surface, potential = (history.get(name, empty) for name in ("surface", "potential_energy"))
    volume = ("relative change", {"volume": ledger.volume_drift, "volume over exact": ledger.volume_error})
    energy, parts = {"kinetic energy": ledger.kinetic_energy}, {} if has_moved(history) else taken(history)
    change = {"fluid particles": fluid / fluid[:1] - 1, "mass in - out": mass / history.get("volume", empty)[:1]}
    if has_surface(history):
        volume = ("share of the fluid", {"at the surface": surface / fluid, "alone": history["isolated"] / fluid})
        change |= {"volume": ledger.volume_drift}
        if np.any(run.config.case.body_force()):
            energy |= {"potential energy": potential, "both": ledger.kinetic_energy + potential}
    panels: list[tuple[str, dict[str, FloatArray]]] = [
        (r"$|\nabla\cdot\mathbf{u}|\,D/U$", {"largest": ledger.divergence_max, "mean": ledger.divergence_mean}),
        volume,
        ("iterations", {"inner iterations of a step": ledger.iterations}),
        ("relative change", change),
        (r"$\Delta tU/\Delta x$", {"time step": history.get("time_step", empty) / run.spacing}),
        (r"$E\,/\,\rho U^2\,D^d$", energy),
        ("$u_{max}/U$", {"largest velocity": history.get("velocity_max", empty)}),
        (r"taken of $E\,/\,\rho U^2\,D^d$", parts) if parts else (r"$\dot E\,D/U\,/\,\rho U^2\,D^d$", {}),
    ]
    figure = blank(12, 8.5)
    grid = figure.subplots(4, 2, sharex=True)
    for axes, (label, curves) in zip(grid.flat, panels, strict=True):
        for number, (name, values) in enumerate(curves.items()):
            axes.plot(run.history["time"], values, lw=0.8, label=name, **line(number, len(curves), len(values)))
        axes.set_ylabel(label)
        if not curves:
            _energy_budget(axes, run.ledger)
        elif "nabla" in label:
            axes.set_yscale("log")
        elif "change" not in label and "taken" not in label:
            axes.set_ylim(0, 1.1 * axes.dataLim.ymax if run.history["time"].size else None)
        _finish(axes, run.window if run.config.case.settles else None)
    for axes in grid[-1]:
        axes.set_xlabel(TIME_LABEL)
    return figure


def _energy_budget(axes: Axes, ledger: Ledger) -> None:
    """Rate of change of the kinetic energy, and at the snapshots what it is made of."""
    if not np.isfinite(ledger.dissipation).any():
        axes.text(0.5, 0.5, "no budget: energy enters or leaves with the fluid", ha="center", transform=axes.transAxes)
        axes.set(yticks=[], ylabel="")
        return
    axes.plot(ledger.time, ledger.energy_rate, color=PALETTE[0], lw=0.8, label="dE/dt")
    for label, values, marker, colour in (
        ("- dissipation", -ledger.dissipation, "v", PALETTE[1]),
        ("power", ledger.power, "^", PALETTE[2]),
        ("imbalance", ledger.imbalance, "x", "k"),
    ):
        axes.plot(ledger.snapshot_time, values, marker, color=colour, ms=4, label=label)
