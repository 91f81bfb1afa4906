"""Figures of profiles, surface pressure and convergence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from typing import TYPE_CHECKING

import numpy as np

from alsph.analysis.loads import PressureCoefficient
from alsph.analysis.measures import Profile, checked_curve
from alsph.analysis.probes import GaugeRecord, Probes
from alsph.analysis.window import DEVELOPING
from alsph.arrays import AXES, FloatArray
from alsph.geometry.surface import Surface
from alsph.plotting.style import MARKERS, PALETTE, TIME_LABEL, blank, legend_beside, line, nothing_to_draw
from alsph.text import in_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_PLACES = 10
"""Gauges and probes that a figure shows."""


def pressure_coefficient(
    coefficient: PressureCoefficient,
    reference: tuple[FloatArray, FloatArray] | None = None,
    names: Sequence[str] = (),
) -> Figure:
    """Mean C_p of both sides: of a body with a chord over x/c and the distance along the surface, suction up.

    Of a cylinder it is drawn over the angle from the front stagnation point, folded on 0 to 180 degrees.

    Parameters
    ----------
    coefficient : PressureCoefficient
    reference : (abscissa, value), optional
        A curve to compare with, over degrees from the front or x/c.
    names : sequence of str, optional
        Name of the body that each closed curve is of.
    """
    reference = None if reference is None else checked_curve("reference", reference)
    if coefficient.surface and coefficient.surface.chord is not None:
        return _pressure_over_chord(coefficient, coefficient.surface, coefficient.surface.chord, reference, names)
    figure = blank(7, 4.5)
    axes = figure.subplots()
    theta = np.mod(coefficient.theta, 360.0)
    for side, label, style, colour in (
        (theta <= 180, "upper side", "-", PALETTE[0]),
        ((theta >= 180) | (theta == 0), "lower side", "--", PALETTE[1]),
    ):
        folded = np.where(theta <= 180, theta, 360 - theta)[side]
        order = np.argsort(folded)
        angle, mean, deviation = (a[order] for a in (folded, coefficient.mean[side], coefficient.deviation[side]))
        axes.plot(angle, mean, style, color=colour, label=label)
        axes.fill_between(angle, mean - deviation, mean + deviation, color=colour, alpha=0.15, lw=0)
    if reference is not None:
        axes.plot(*reference, "k:", lw=1.5, label="reference")
    axes.set(xlabel=r"$\theta$ from the front stagnation point [degrees]", ylabel="$C_p$", xlim=(0, 180))
    axes.set_title(_samples(coefficient), fontsize="medium")
    axes.set_xticks(range(0, 181, 30))
    _finish_pressure(axes, coefficient)
    return figure


def _pressure_over_chord(
    coefficient: PressureCoefficient,
    surface: Surface,
    chord: FloatArray,
    reference: tuple[FloatArray, FloatArray] | None,
    names: Sequence[str],
) -> Figure:
    figure = blank(10, 4.5)
    left, right = figure.subplots(1, 2, sharey=True)
    parts = [int(part) for part in np.unique(surface.part)]
    of = {part: in_figure(names[part] if part < len(names) else str(part)) for part in parts}
    for part in parts:
        for index, (side, name, style) in enumerate(((1, "upper side", "-"), (-1, "lower side", "--"))):
            chosen = (surface.part == part) & (surface.side == side)
            mean, deviation = coefficient.mean[chosen], coefficient.deviation[chosen]
            number, label = (part, f"{of[part]}, {name}") if len(parts) > 1 else (index, name)
            drawn = line(number, len(parts), int(chosen.sum()))
            for axes, abscissa in ((left, chord), (right, surface.arc)):
                axes.plot(abscissa[chosen], mean, style, label=label, **drawn)
                band = mean - deviation, mean + deviation
                axes.fill_between(abscissa[chosen], *band, color=drawn["color"], alpha=0.15, lw=0)
    if reference is not None:
        left.plot(*reference, "k:", lw=1.5, label="reference")
    left.set(xlabel="$x/c$", ylabel="$C_p$, suction up")
    right.set(xlabel="distance along the surface from the leading edge, $s/D$")
    left.invert_yaxis()  # of both
    left.set_title(_samples(coefficient), loc="left", fontsize="small")
    for axes in (left, right):
        _finish_pressure(axes, coefficient)
    return figure


def _samples(coefficient: PressureCoefficient) -> str:
    still = f", {DEVELOPING}" if coefficient.developing else ""
    return f"mean of {coefficient.samples} samples{still}, band: ± 1 standard deviation"


def _finish_pressure(axes: Axes, coefficient: PressureCoefficient) -> None:
    if coefficient.samples == 0:
        axes.text(0.5, 0.5, "no samples in the averaging window", ha="center", transform=axes.transAxes)
    axes.grid(alpha=0.3)
    axes.legend()


def profile(curves: dict[str, Profile]) -> Figure:
    """Draw computed curves, and the reference curves where they are known.

    Parameters
    ----------
    curves : dict
        The same profile of one run or several, by name.
    """
    figure = blank(7, 4.5)
    axes = figure.subplots()
    known: dict[str, tuple[int, str, Profile]] = {}
    for index, (name, curve) in enumerate(curves.items()):
        axes.plot(*curve.computed, lw=1.2, label=name, **line(index, len(curves), len(curve.computed[0])))
        if curve.reference[0].size:
            known.setdefault(str(np.array(curve.reference).tolist()), (index, name, curve))
    for index, name, curve in known.values():  # one for all, or that of each in its colour
        colour, whose = (PALETTE[index % len(PALETTE)], f" of {name}") if len(known) > 1 else ("k", "")
        axes.plot(*curve.reference, ":", color=colour, lw=1.5, label=f"reference{whose}: {curve.source}")
    axes.set(xlabel=curve.axes[0], ylabel=curve.axes[1])
    axes.set_title(curve.name, fontsize="medium")
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small" if len(known) > 1 else None)
    return figure


def gauges(record: GaugeRecord) -> Figure:
    """Draw the depth of the water over time, of ten gauges where there are more."""
    if not len(record.position):
        figure = blank(7, 4.5)
        figure.subplots().set(xlabel=TIME_LABEL, ylabel="depth over $D$")
        nothing_to_draw(figure, "no gauges")
        return figure
    shown, told = _some(record.position)
    nothing = (np.empty(0), np.empty(0))
    return profile(
        {
            _place(record.position[index]): Profile(
                f"depth at the gauges{told}",
                (TIME_LABEL, "depth over $D$"),
                (record.time, record.depth[:, index]),
                nothing,
                "",
            )
            for index in shown
        }
    )


def probes(record: Probes) -> Figure:
    """Draw velocity and pressure over time, of ten probes where there are more."""
    shown, told = _some(record.position)
    labels = [f"${symbol}/U$" for symbol in "uvw"[: record.position.shape[1]]] + [r"$p\,/\,\rho U^2$"]
    figure = blank(9, 1 + 2 * len(labels))
    grid = figure.subplots(len(labels), 1, sharex=True)
    columns = [*np.moveaxis(record.velocity, 2, 0), record.pressure]
    for axes, label, values in zip(grid, labels, columns, strict=True):
        for number, index in enumerate(shown):
            drawn = line(number, len(shown), len(record.time))
            axes.plot(record.time, values[:, index], lw=1, label=_place(record.position[index]), **drawn)
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
    grid[0].set_title(f"at the probes{told}", loc="left", fontsize="medium")
    grid[-1].set_xlabel(TIME_LABEL)
    if not shown:
        nothing_to_draw(figure, "no probes")
        return figure
    legend_beside(figure, *grid[0].get_legend_handles_labels())
    return figure


def _some(places: FloatArray) -> tuple[list[int], str]:
    """Return the indices of the places (m, d) that a figure shows, and what it says of the others."""
    count = len(places)
    shown = np.unique(np.linspace(0, count - 1, min(count, MOST_PLACES)).round().astype(int)).tolist()
    return shown, f", {len(shown)} of {count}" if len(shown) < count else ""


def _place(place: FloatArray) -> str:
    """Return the name of a place (d,) in a figure."""
    return ", ".join(f"${axis}/D$ = {at:g}" for axis, at in zip(AXES, place, strict=False))


@dataclass(frozen=True)
class Curve:
    """A series of points to draw.

    Attributes
    ----------
    label : str
        Its name in the legend.
    x, y : list of float
    uncertainty : list of float
        Half lengths of the error bars; none are drawn if empty or zero.
    style : str
        Marker and dashes as matplotlib's format has them; the next marker and a line if empty.
    colour : str
        Its colour; the next one if empty.
    """

    label: str
    x: list[float]
    y: list[float]
    uncertainty: list[float] = dataclass_field(default_factory=list)
    style: str = ""
    colour: str = ""


def panels(panels: dict[str, list[Curve]], label: str, logarithmic: Sequence[str] = ()) -> Figure:
    """Curves over a common abscissa, one panel for each ordinate, three in a row; a label has one colour in all.

    Parameters
    ----------
    panels : dict
        The curves of each panel by the label of its ordinate.
    label : str
        Label of the abscissa.
    logarithmic : sequence of {"x", "y"}
        Logarithmic axes.
    """
    columns = min(len(panels), 3)
    rows = -(-len(panels) // columns)
    figure = blank(6.5 * columns, 4.5 * rows)
    grid = figure.subplots(rows, columns, squeeze=False).flat
    labels = list(dict.fromkeys(curve.label for curves in panels.values() for curve in curves))
    for axes, (name, curves) in zip(grid, panels.items(), strict=False):
        axes.set(**{f"{axis}scale": "log" for axis in logarithmic})
        for curve in curves:
            index = labels.index(curve.label)
            style = curve.style or f"{MARKERS[index % len(MARKERS)]}-"
            colour = curve.colour or PALETTE[index % len(PALETTE)]
            axes.plot(curve.x, curve.y, style, color=colour, ms=5, lw=1, label=curve.label)
            if np.nansum(curve.uncertainty) > 0:
                axes.errorbar(curve.x, curve.y, curve.uncertainty, fmt="none", ecolor=colour, capsize=2, lw=1)
        if "x" in logarithmic:
            ticks = sorted({x for curve in curves for x in curve.x})
            if len(ticks) <= max(len(curve.x) for curve in curves):  # else, of each its own, they stand on each other
                axes.set_xticks(ticks, [f"{x:.3g}" for x in ticks])
                axes.xaxis.minorticks_off()
            elif ticks[-1] < 10 * ticks[0]:  # in less than a decade there may be one power of ten
                axes.xaxis.set_major_formatter("{x:g}")
                axes.xaxis.set_minor_formatter("{x:g}")
        axes.set(xlabel=label, ylabel=name)
        axes.grid(alpha=0.3)
    for axes in list(figure.axes)[len(panels) :]:
        axes.remove()
    named = {
        text: handle for axes in figure.axes for handle, text in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    legend_beside(figure, [*named.values()], [*named])
    return figure


def convergence(errors: dict[str, dict[int, float]]) -> Figure:
    """Draw the moduli of errors over the resolution, and lines of first and second order.

    Parameters
    ----------
    errors : dict
        The errors of each quantity by resolution D/Δx.
    """
    figure = blank(9, 4.5)
    axes = figure.subplots()
    for number, (name, series) in enumerate(errors.items()):
        axes.loglog(
            [*series],
            np.abs([*series.values()]),
            label=name,
            color=PALETTE[number % len(PALETTE)],
            marker=MARKERS[number % len(MARKERS)],
        )
    resolutions = sorted({resolution for series in errors.values() for resolution in series})
    largest = max(abs(error) for series in errors.values() for error in series.values())
    for order, style in ((1, "k:"), (2, "k--")):
        slope = [largest * (resolutions[0] / resolution) ** order for resolution in resolutions]
        axes.loglog(resolutions, slope, style, lw=0.8, label=f"order {order}")
    axes.set(xlabel=r"resolution $D/\Delta x$", ylabel="|error|")
    axes.set_xticks(resolutions, [str(resolution) for resolution in resolutions])
    axes.xaxis.minorticks_off()
    axes.grid(alpha=0.3, which="both")
    legend_beside(figure, *axes.get_legend_handles_labels())
    return figure
