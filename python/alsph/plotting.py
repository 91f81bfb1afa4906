"""Figures of a run, as pure functions: results in, :class:`matplotlib.figure.Figure` out, no global state."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from alsph import analysis, sampling
from alsph.durable import check_target, replacing
from alsph.errors import ConfigError
from alsph.geometry import FloatArray, Kind
from alsph.parameters import suggest
from alsph.reading import Snapshot
from alsph.text import shown
from alsph.window import DEVELOPING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from alsph.analysis import Window
    from alsph.ledger import Ledger
    from alsph.measures import Profile
    from alsph.results import PressureCoefficient, Run
    from alsph.surface import Surface

PIXELS_PER_SPACING = 2
LARGEST_VIEW = 20_000  # spacings that a picture is wide or high at most
TIME_LABEL = "$tU/D$"


@dataclass(frozen=True)
class FieldStyle:
    """How a field is drawn: label with its unit, colour map, and whether the scale is symmetric about zero."""

    label: str
    colours: str
    signed: bool


FIELDS = {
    "vorticity": FieldStyle(r"vorticity $\omega D/U$", "RdBu_r", True),
    "pressure": FieldStyle(r"pressure $p\,/\,\rho U^2$", "RdBu_r", True),
    "velocity": FieldStyle(r"velocity $|\mathbf{u}|/U$", "viridis", False),
    "velocity_divergence": FieldStyle(r"velocity divergence $\nabla\cdot\mathbf{u}\,D/U$", "PuOr_r", True),
}


def _figure(width: float, height: float, layout: Literal["constrained", "compressed"] = "constrained") -> Figure:
    """Return an empty figure of a size in inches."""
    from matplotlib.figure import Figure  # half a second that only pictures take

    return Figure(figsize=(width, height), layout=layout)


def save(figure: Figure, path: str | Path, **options: Any) -> None:
    """Save a figure in a file; what was there is replaced, and nothing is written through a link.

    Parameters
    ----------
    figure : Figure
    path : path
        The file, whose suffix says the format: PNG if there is none.
    **options
        Of matplotlib's ``savefig``.

    Raises
    ------
    ConfigError
        If the format is unknown.
    RunFolderError
        If the file is a link or a special file.
    """
    path = Path(path)
    path = path if path.suffix else path.with_suffix(".png")
    known = figure.canvas.get_supported_filetypes()
    if (kind := path.suffix[1:].lower()) not in known:
        raise ConfigError(f"{path}: '{kind}' is no format of figures; {suggest(kind, known)}")
    check_target(path)
    with replacing(path) as temporary:
        figure.savefig(temporary, format=kind, **options)


def field_style(name: str) -> FieldStyle:
    """Return how a field is drawn.

    Raises
    ------
    ConfigError
        If there is no such field.
    """
    if name not in FIELDS:
        raise ConfigError(f"unknown field '{name}'; {suggest(name, FIELDS)}")
    return FIELDS[name]


def remark(figure: Figure, text: str) -> None:
    """Write a remark below a figure."""
    if text:
        width = int(figure.get_size_inches()[0] * 17)  # letters in a line
        figure.supxlabel(
            textwrap.fill(text, width), fontsize="x-small", color="0.3", x=0.01, ha="left", parse_math=False
        )


def field(
    snapshot: Snapshot,
    name: str,
    spacing: float,
    *,
    limit: float | None = None,
    view: tuple[float, float, float, float] | None = None,
) -> Figure:
    """Picture of a field in 2-D, the bodies in grey.

    Parameters
    ----------
    snapshot : Snapshot
    name : {"vorticity", "pressure", "velocity", "velocity_divergence"}
    spacing : float
        Particle spacing Δx [D].
    limit : float, optional
        End of the colour scale; from the data if None.
    view : (left, right, bottom, top), optional
        Part of the plane to show [D]; all of it if None.

    Raises
    ------
    ConfigError
        If there is no such field, or the snapshot is in 3-D.
    """
    field_style(name)
    left, right, bottom, top = extent = _extent(snapshot, spacing, view)
    width = 9.0
    figure = _figure(width, max(2.5, 0.81 * width * (top - bottom) / (right - left) + 0.75), "compressed")
    axes = figure.subplots()
    _draw_field(axes, snapshot, name, spacing, extent, limit)
    axes.set(title=f"{TIME_LABEL} = {snapshot.time:.2f}")
    return figure


def fields(
    snapshots: dict[str, tuple[Snapshot, float]],
    names: Sequence[str],
    view: Sequence[float] | None = None,
) -> Figure:
    """Pictures of several fields in 2-D, one row for each snapshot and one column for each field.

    Parameters
    ----------
    snapshots : dict
        Snapshot and particle spacing Δx [D] by the title of the row.
    names : sequence of str
        Names of the fields; the colour scale of a field is that of its first row.
    view : (left, right, bottom, top), optional
        Part of the plane to show [D]; all of it if None.

    Raises
    ------
    ConfigError
        If there is no such field, or a snapshot is in 3-D.
    """
    (first, spacing), *_ = snapshots.values()
    left, right, bottom, top = extent = _extent(first, spacing, view)
    width = 6.5
    height = 0.85 * width * (top - bottom) / (right - left) + 0.6
    figure = _figure(width * len(names), height * len(snapshots))
    grid = figure.subplots(len(snapshots), len(names), squeeze=False)
    for column, name in zip(grid.T, names, strict=True):
        limit: float | None = None
        for axes, (title, (snapshot, spacing)) in zip(column, snapshots.items(), strict=True):
            limit = _draw_field(axes, snapshot, name, spacing, extent, limit)
            axes.set_title(f"{title}, {TIME_LABEL} = {snapshot.time:.2f}", fontsize="medium")
    return figure


def _draw_field(
    axes: Axes,
    snapshot: Snapshot,
    name: str,
    spacing: float,
    extent: tuple[float, float, float, float],
    limit: float | None,
) -> float:
    """Draw a field with its colour bar; return the end of the colour scale."""
    style = field_style(name)
    if limit is not None and not (isinstance(limit, int | float | np.number) and 0 < limit < np.inf):
        raise ConfigError(f"limit = {shown(limit)}: must be a number above zero")
    values = np.linalg.norm(snapshot.velocity, axis=1) if name == "velocity" else getattr(snapshot, name)
    picture, body = _raster(snapshot, values, spacing, extent)
    limit = limit or _limit(picture)
    lowest = -limit if style.signed else 0.0
    frame: dict[str, Any] = {"extent": extent, "origin": "lower"}
    image = axes.imshow(picture, cmap=style.colours, vmin=lowest, vmax=limit, interpolation="bilinear", **frame)
    if body.any():
        axes.contourf(body, levels=[0.5, np.inf], colors=["0.35"], **frame)
    axes.figure.colorbar(
        image, ax=axes, label=style.label, extend="both" if style.signed else "max", pad=0.02, fraction=0.05
    )
    axes.set(xlabel="$x/D$", ylabel="$y/D$", aspect="equal")
    return limit


def _extent(snapshot: Snapshot, spacing: float, view: Sequence[float] | None) -> tuple[float, float, float, float]:
    """Return left, right, bottom and top of the view; without one, of the fluid without inlet and outlet buffers."""
    if snapshot.position.shape[1] != 2:
        raise ConfigError("pictures are drawn in 2-D only; open particles.vtkhdf in ParaView")
    if view is not None:
        try:
            left, right, bottom, top = map(float, view)
        except (TypeError, ValueError):
            left = right = bottom = top = np.nan
        if not (0 < right - left < LARGEST_VIEW * spacing and 0 < top - bottom < LARGEST_VIEW * spacing):
            raise ConfigError(f"view = {shown(view)}: needs left, right, bottom and top, in this order [D]")
        return left, right, bottom, top
    position = snapshot.position[snapshot.kind == Kind.FLUID]
    bounds = np.array([position.min(axis=0) - spacing / 2, position.max(axis=0) + spacing / 2])
    (left, bottom), (right, top) = np.round(bounds / spacing) * spacing
    return float(left), float(right), float(bottom), float(top)


def _raster(
    snapshot: Snapshot, values: FloatArray, spacing: float, extent: tuple[float, float, float, float]
) -> tuple[FloatArray, FloatArray]:
    """Return the fluid's field (rows, columns), NaN where there is none, and the share of each pixel that is solid."""
    left, right, bottom, top = extent
    columns, rows = (max(2, round(PIXELS_PER_SPACING * length / spacing)) for length in (right - left, top - bottom))
    x = left + (np.arange(columns) + 0.5) * (right - left) / columns
    y = bottom + (np.arange(rows) + 0.5) * (top - bottom) / rows
    points = np.stack([grid.ravel() for grid in np.meshgrid(x, y)], axis=1)
    fluid = snapshot.fluid
    picture = sampling.average(snapshot.position[fluid], values[fluid], points, spacing).reshape(rows, columns)
    if fluid.all():
        return picture, np.zeros_like(picture)
    body = sampling.fill(snapshot.position[~fluid], points, spacing).reshape(rows, columns)
    from scipy.ndimage import binary_fill_holes

    hollow = binary_fill_holes(body > 0.5) & np.isnan(picture)
    return picture, np.where(hollow, 1.0, body)


def _limit(picture: FloatArray) -> float:
    """Return a round end for the colour scale.

    All but one per cent of the pixels stay within it, or more where the field is concentrated in fewer than that.
    """
    size = np.abs(picture[np.isfinite(picture)])
    if not size.any():
        return 1.0
    largest = max(float(np.percentile(size, 99)), float((size**2).sum() / size.sum()))
    unit = 10.0 ** np.floor(np.log10(largest))
    return float(np.ceil(largest / unit * 2) / 2 * unit)


def forces(run: Run, body: str | None = None) -> Figure:
    """Drag and lift coefficients over time with their parts, the averaging window shaded and the means drawn."""
    figure = _figure(9, 6)
    upper, lower = figure.subplots(2, 1, sharex=True)
    time = run.history["time"]
    for axes, axis, symbol in ((upper, "x", "C_D"), (lower, "y", "C_L")):
        parts = {part: run.coefficient(axis, part, body) for part in ("viscous", "pressure", "total")}
        for (part, values), colour in zip(parts.items(), ("C2", "C1", "C0"), strict=True):
            axes.plot(time, values, colour, lw=1, label=part)
        _robust_limits(axes, time, np.stack(list(parts.values())))
        axes.set_ylabel(f"${symbol}$")
        _finish(axes, run.window, legend=axes is upper)
    if run.window.edges.size and run.bodies:
        drag, lift = run.load("x", body), run.load("y", body)
        span = [run.window.start, run.window.end]
        upper.plot(span, [drag.mean] * 2, "k--", lw=1)
        upper.set_title(f"mean $C_D$ = {drag.mean}", loc="left", fontsize="medium")
        strouhal = ",  no shedding found" if np.isnan(run.strouhal) else f",  Sr = {run.strouhal}"
        lower.set_title(f"rms $C_L$ = {lift.rms}{strouhal}", loc="left", fontsize="medium")
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
    figure = _figure(9, 6)
    grid = figure.subplots(2, 1, sharex=True)
    for axes, axis, symbol in zip(grid, "xy", ("C_D", "C_L"), strict=True):
        for name, run in runs.items():
            time, window, coefficient = run.history["time"], run.window, run.coefficient(axis, body=body)
            if window.edges.size:
                lines = analysis.amplitude_spectrum(time, coefficient, window.start, window.end)
                label = f"{name}, {DEVELOPING}" if window.developing else name
                axes.loglog(*(a[1:] for a in lines), lw=0.8, label=label)
        axes.set_ylabel(f"amplitude of ${symbol}$")
        axes.grid(alpha=0.3)
        if axes.lines:
            axes.legend()
    grid[-1].set_xlabel("$fD/U$")
    return figure


def _finish(axes: Axes, window: Window, *, legend: bool = True) -> None:
    """Shade the averaging window, and put the legend above the panel, where it hides nothing."""
    if window.edges.size:
        label = f"averaged ({window.periods} periods)" if window.periods else "averaged"
        label += f", {DEVELOPING}" if window.developing else ""
        axes.axvspan(window.start, window.end, color="0.92", zorder=0, label=label)
    axes.grid(alpha=0.3)
    if legend and axes.get_legend_handles_labels()[0]:
        axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=5, frameon=False, fontsize="small", borderpad=0)


def _robust_limits(axes: Axes, time: FloatArray, values: FloatArray) -> None:
    """Scale the ordinate to the record without its start, where an impulsive start's forces tower over all else."""
    if len(time) < 10:
        return
    late = values[:, time > time[0] + 0.1 * (time[-1] - time[0])]
    late = late[np.isfinite(late)]
    if late.size and np.ptp(late) > 0:
        margin = 0.15 * np.ptp(late)
        axes.set_ylim(late.min() - margin, late.max() + 2 * margin)


def pressure_coefficient(
    coefficient: PressureCoefficient, reference: tuple[FloatArray, FloatArray] | None = None
) -> Figure:
    """Mean C_p of both sides: of a body with a chord over x/c and the distance along the surface, suction up.

    Of a cylinder it is drawn over the angle from the front stagnation point, folded on 0 to 180 degrees.

    Parameters
    ----------
    coefficient : PressureCoefficient
    reference : (abscissa, value), optional
        A curve to compare with, over degrees from the front or x/c.
    """
    if coefficient.surface and coefficient.surface.chord is not None:
        return _pressure_over_chord(coefficient, coefficient.surface, coefficient.surface.chord, reference)
    figure = _figure(7, 4.5)
    axes = figure.subplots()
    theta = np.mod(coefficient.theta, 360.0)
    for side, label, style in (
        (theta <= 180, "upper side", "C0-"),
        ((theta >= 180) | (theta == 0), "lower side", "C1--"),
    ):
        folded = np.where(theta <= 180, theta, 360 - theta)[side]
        order = np.argsort(folded)
        angle, mean, deviation = (a[order] for a in (folded, coefficient.mean[side], coefficient.deviation[side]))
        axes.plot(angle, mean, style, label=label)
        axes.fill_between(angle, mean - deviation, mean + deviation, color=style[:2], alpha=0.15, lw=0)
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
) -> Figure:
    figure = _figure(10, 4.5)
    left, right = figure.subplots(1, 2, sharey=True)
    several = surface.part.max() > 0
    for part in np.unique(surface.part):
        for index, (side, name, line) in enumerate(((1, "upper side", "-"), (-1, "lower side", "--"))):
            chosen = (surface.part == part) & (surface.side == side)
            mean, deviation = coefficient.mean[chosen], coefficient.deviation[chosen]
            colour = f"C{int(part) % 10}" if several else f"C{index}"
            for axes, abscissa in ((left, chord), (right, surface.arc)):
                axes.plot(abscissa[chosen], mean, line, color=colour, label=f"{part:.0f}, {name}" if several else name)
                axes.fill_between(abscissa[chosen], mean - deviation, mean + deviation, color=colour, alpha=0.15, lw=0)
    if reference is not None:
        left.plot(*reference, "k:", lw=1.5, label="reference")
    left.set(xlabel="$x/c$", ylabel="$C_p$, suction up")
    right.set(xlabel="distance along the surface from the leading edge, $s/D$")
    left.invert_yaxis()  # of both
    figure.suptitle(_samples(coefficient), fontsize="medium")
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


def ledger(run: Run) -> Figure:
    """Divergence and the solver's effort on the left; volume, mass and kinetic energy with its budget on the right."""
    ledger, history = run.ledger, run.history
    empty = np.empty(0)
    fluid, mass = history.get("fluid", empty), history.get("mass_in", empty) - history.get("mass_out", empty)
    panels: list[tuple[str, dict[str, FloatArray]]] = [
        (r"$|\nabla\cdot\mathbf{u}|\,D/U$", {"largest": ledger.divergence_max, "mean": ledger.divergence_mean}),
        ("relative change", {"volume": ledger.volume_drift, "volume over exact": ledger.volume_error}),
        ("iterations", {"inner iterations of a step": ledger.iterations}),
        (
            "relative change",
            {"fluid particles": fluid / fluid[:1] - 1, "mass in - out": mass / history.get("volume", empty)[:1]},
        ),
        (r"$\Delta tU/\Delta x$", {"time step": history.get("time_step", empty) / run.spacing}),
        (r"$E\,/\,\rho U^2D^d$", {"kinetic energy": ledger.kinetic_energy}),
        ("$u_{max}/U$", {"largest velocity": history.get("velocity_max", empty)}),
        (r"$\dot E\,/\,\rho U^3D^{d-1}$", {}),
    ]
    figure = _figure(12, 8.5)
    grid = figure.subplots(4, 2, sharex=True)
    for axes, (label, curves) in zip(grid.flat, panels, strict=True):
        for name, values in curves.items():
            axes.plot(run.history["time"], values, lw=0.8, label=name)
        axes.set_ylabel(label)
        if not curves:
            _energy_budget(axes, run.ledger)
        elif "nabla" in label:
            axes.set_yscale("log")
        elif "change" not in label:
            axes.set_ylim(0, 1.1 * axes.dataLim.ymax if run.history["time"].size else None)
        _finish(axes, run.window)
    for axes in grid[-1]:
        axes.set_xlabel(TIME_LABEL)
    return figure


def _energy_budget(axes: Axes, ledger: Ledger) -> None:
    """Rate of change of the kinetic energy, and at the snapshots what it is made of."""
    if not np.isfinite(ledger.dissipation).any():
        axes.text(0.5, 0.5, "no budget: energy enters or leaves with the fluid", ha="center", transform=axes.transAxes)
        return
    axes.plot(ledger.time, ledger.energy_rate, lw=0.8, label="dE/dt")
    for label, values, style in (
        ("- dissipation", -ledger.dissipation, "v"),
        ("power", ledger.power, "^"),
        ("imbalance", ledger.imbalance, "kx"),
    ):
        axes.plot(ledger.snapshot_time, values, style, ms=4, label=label)


def profile(curves: dict[str, Profile]) -> Figure:
    """Draw computed curves, and the reference curve where it is known.

    Parameters
    ----------
    curves : dict
        The same profile of one run or several, by name; the last one's reference is drawn.
    """
    figure = _figure(7, 4.5)
    axes = figure.subplots()
    for name, curve in curves.items():
        axes.plot(*curve.computed, lw=1.2, label=name)
    if curve.reference[0].size:
        axes.plot(*curve.reference, "k:", lw=1.5, label=f"reference: {curve.source}")
    axes.set(xlabel=curve.axes[0], ylabel=curve.axes[1])
    axes.set_title(curve.name, fontsize="medium")
    axes.grid(alpha=0.3)
    axes.legend()
    return figure


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
        Matplotlib's format; the next colour and marker if empty.
    """

    label: str
    x: list[float]
    y: list[float]
    uncertainty: list[float] = dataclass_field(default_factory=list)
    style: str = ""


def panels(panels: dict[str, list[Curve]], label: str, logarithmic: Sequence[str] = ()) -> Figure:
    """Curves over a common abscissa, one panel for each ordinate, three in a row.

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
    figure = _figure(6.5 * columns, 4.5 * rows)
    grid = figure.subplots(rows, columns, squeeze=False).flat
    for axes, (name, curves) in zip(grid, panels.items(), strict=False):
        for index, curve in enumerate(curves):
            style = curve.style or f"C{index}{'osD^v<>pPX'[index % 10]}-"
            axes.plot(curve.x, curve.y, style, ms=5, lw=1, label=curve.label)
            if np.nansum(curve.uncertainty) > 0:
                axes.errorbar(curve.x, curve.y, curve.uncertainty, fmt="none", ecolor=style[:2], capsize=2, lw=1)
        if "x" in logarithmic:
            axes.set_xscale("log")
            ticks = sorted({x for curve in curves for x in curve.x})
            axes.set_xticks(ticks, [f"{x:.3g}" for x in ticks])
            axes.xaxis.minorticks_off()
        if "y" in logarithmic:
            axes.set_yscale("log")
        axes.set(xlabel=label, ylabel=name)
        axes.grid(alpha=0.3)
        axes.legend(fontsize="small")
    for axes in list(figure.axes)[len(panels) :]:
        axes.remove()
    return figure


def convergence(errors: dict[str, dict[int, float]]) -> Figure:
    """Draw the moduli of errors over the resolution, and lines of first and second order.

    Parameters
    ----------
    errors : dict
        The errors of each quantity by resolution D/Δx.
    """
    figure = _figure(7, 4.5)
    axes = figure.subplots()
    for name, series in errors.items():
        axes.loglog([*series], np.abs([*series.values()]), "o-", label=name)
    resolutions = sorted({resolution for series in errors.values() for resolution in series})
    largest = max(abs(error) for series in errors.values() for error in series.values())
    for order, style in ((1, "k:"), (2, "k--")):
        slope = [largest * (resolutions[0] / resolution) ** order for resolution in resolutions]
        axes.loglog(resolutions, slope, style, lw=0.8, label=f"order {order}")
    axes.set(xlabel=r"resolution $D/\Delta x$", ylabel="|error|")
    axes.set_xticks(resolutions, [str(resolution) for resolution in resolutions])
    axes.xaxis.minorticks_off()
    axes.grid(alpha=0.3, which="both")
    figure.legend(loc="outside lower center", ncols=2, fontsize="small", frameon=False)
    return figure
