"""Pictures of the particles' fields."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from alsph.analysis import sampling
from alsph.analysis.vortices import DERIVED
from alsph.arguments import number
from alsph.arrays import AXES, FloatArray
from alsph.errors import ConfigError
from alsph.geometry.particles import Kind, Snapshot, check_part
from alsph.geometry.plane import Plane
from alsph.parameters import suggest
from alsph.plotting.style import TIME_LABEL, blank
from alsph.results.export import Grid
from alsph.text import shown

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


PIXELS_PER_SPACING = 2

FINE = 4  # pixels per spacing of bodies whose outline is known

SURFACE = 0.25  # how far under a surface fluid, and above it solid particles may be [Δx]

DENSITY = 1.5  # of streamlines: 45 along each side at most

TALLEST = 1.5  # height over width, beyond which the picture is made narrower than its figure

INSIDE = 0.75  # share of the space around that fluid fills, above which it is neither at a free surface nor spray

AIR = "0.88"  # colour beside a free surface: spray without pressure is white

ROOM = 0.1  # of a picture's longer side, that is left beside a free surface

LARGEST_VIEW = 20_000  # spacings that a picture is wide or high at most


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
    "q_criterion": FieldStyle(r"$Q\,D^2/U^2$", "PuOr_r", True),
    "lambda_2": FieldStyle(r"$\lambda_2\,D^2/U^2$", "PuOr", True),  # vortices in the same colour
}


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


def field(
    snapshot: Snapshot,
    name: str,
    spacing: float,
    *,
    limit: float | None = None,
    view: tuple[float, float, float, float] | None = None,
    title: str = "",
    width: float = 9.0,
    plane: Plane | None = None,
    flow: Grid | None = None,
) -> Figure:
    """Picture of a field in 2-D or along a plane, the bodies in grey.

    Parameters
    ----------
    snapshot : Snapshot
    name : {"vorticity", "pressure", "velocity", "velocity_divergence", "q_criterion", "lambda_2"}
    spacing : float
        Particle spacing Δx [D].
    limit : float, optional
        End of the colour scale; from the data if None.
    view : (left, right, bottom, top), optional
        Part of the plane to show [D]; all of it if None.
    title : str, optional
        What stands above the picture, before the time.
    width : float
        Width of the figure in inches.
    plane : Plane, optional
        The plane in 3-D.
    flow : Grid, optional
        The flow whose streamlines are drawn, in 3-D on the plane and along it.

    Raises
    ------
    ConfigError
        If there is no such field, the snapshot is in 3-D and there is no plane, or no fluid is in it.
    """
    field_style(name)
    left, right, bottom, top = part = extent_of(snapshot, spacing, view, plane)
    height = 0.81 * width * min((top - bottom) / (right - left), TALLEST) + 0.75
    figure = blank(width, max(2.5, height), "compressed")
    axes = figure.subplots()
    _draw_field(axes, snapshot, name, spacing, part, limit, plane)
    if flow is not None:
        _draw_streamlines(axes, flow, part, plane)
    where = f"${AXES[plane.axis]}/D$ = {plane.place:.3g}, " if plane else ""
    axes.set_title(f"{title}, " * bool(title) + where + f"{TIME_LABEL} = {snapshot.time:.2f}")
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
    left, right, bottom, top = part = extent_of(first, spacing, view)
    width = 6.5
    height = 0.85 * width * (top - bottom) / (right - left) + 0.6
    figure = blank(width * len(names), height * len(snapshots), "compressed")
    grid = figure.subplots(len(snapshots), len(names), squeeze=False)
    for column, name in zip(grid.T, names, strict=True):
        limit: float | None = None
        for axes, (title, (snapshot, spacing)) in zip(column, snapshots.items(), strict=True):
            limit = _draw_field(axes, snapshot, name, spacing, part, limit)
            axes.set_title(f"{title}, {TIME_LABEL} = {snapshot.time:.2f}", fontsize="medium")
    return figure


def _draw_field(
    axes: Axes,
    snapshot: Snapshot,
    name: str,
    spacing: float,
    extent: tuple[float, float, float, float],
    limit: float | None,
    plane: Plane | None = None,
) -> float:
    """Draw a field with its colour bar; return the end of the colour scale."""
    style = field_style(name)
    limit = None if limit is None else number("limit", limit, above=0, finite=True)
    picture, inside = _raster(snapshot, name, spacing, extent, plane)
    body = _solid(snapshot, spacing, extent, plane, picture)
    limit = limit or _limit(picture[inside])
    lowest = -limit if style.signed else 0.0
    scale: dict[str, Any] = {"cmap": style.colours, "vmin": lowest, "vmax": limit}
    if meets_air(snapshot):
        axes.set_facecolor(AIR)
    image = axes.imshow(picture, extent=extent, origin="lower", interpolation="bilinear", **scale)
    if body.any():
        sides = zip(body.shape[::-1], np.reshape(extent, (2, 2)), strict=True)
        x, y = (np.concatenate([[low], _centres(count, low, high), [high]]) for count, (low, high) in sides)
        axes.contourf(x, y, np.pad(body, 1, mode="edge"), [0.5, np.inf], colors=["0.35"], antialiased=True)
    datum = _datum(snapshot) if name == "pressure" else None
    label = style.label + (f", {datum[1]}" if datum else "")
    above = name == "pressure" and meets_air(snapshot) and not np.nanmin(picture, initial=0.0) < 0
    ends = "both" if style.signed and not above else "max"
    bar = axes.figure.colorbar(image, ax=axes, label=label, extend=ends, pad=0.02, fraction=0.05)
    if above:  # that of the air, as it is in water
        bar.ax.set_ylim(0, limit)
    horizontal, vertical = (AXES[axis] for axis in (plane.across if plane else (0, 1)))
    axes.set(xlabel=f"${horizontal}/D$", ylabel=f"${vertical}/D$", aspect="equal")
    return limit


def _draw_streamlines(axes: Axes, flow: Grid, extent: tuple[float, float, float, float], plane: Plane | None) -> None:
    """Draw the streamlines of a flow on a grid, which has one layer in 3-D; there are none in bodies."""
    across, velocity = [0, 1], flow.fields["velocity"]
    if plane:
        across, velocity = plane.across, np.take(velocity, 0, axis=plane.axis)
    if np.isfinite(velocity).any():
        x, y = (flow.axes[AXES[axis]] for axis in across)
        u, v = (np.ma.masked_invalid(velocity[..., axis].T) for axis in across)
        axes.streamplot(x, y, u, v, density=DENSITY, color="0.1", linewidth=0.6, arrowsize=0.7)
    left, right, bottom, top = extent
    axes.set(xlim=(left, right), ylim=(bottom, top))


def colour_limit(
    snapshot: Snapshot,
    name: str,
    spacing: float,
    extent: tuple[float, float, float, float],
    plane: Plane | None = None,
) -> float:
    """Return the end of the colour scale that a picture of a part of the plane has by itself."""
    picture, inside = _raster(snapshot, name, spacing, extent, plane)
    return _limit(picture[inside])


def _values(snapshot: Snapshot, name: str, whole: Snapshot, spacing: float) -> FloatArray:
    """Return a field at the fluid particles of a snapshot, which is a part of the whole one."""
    if name in DERIVED:
        return DERIVED[name](sampling.velocity_gradient(whole, snapshot.position[snapshot.fluid], spacing))
    values = np.linalg.norm(snapshot.velocity, axis=1) if name == "velocity" else getattr(snapshot, name)
    if name == "pressure" and (datum := _datum(whole)):
        values = values - whole.pressure[datum[0]].mean()
    return np.asarray(values[snapshot.fluid])


def _datum(snapshot: Snapshot) -> tuple[NDArray[np.bool_], str] | None:
    """Return what particles (n,) the pressure is told over the mean of, and in words.

    Those of the inlet, as C_p is, or all where no fluid enters or leaves nor meets the air, so that the pressure is
    known but for a constant, which would leave one colour.
    """
    if (inlet := snapshot.kind == Kind.INLET).any():
        return inlet, "less the inlet's"
    if meets_air(snapshot) or (snapshot.kind == Kind.OUTLET).any():
        return None
    return snapshot.fluid, "less its mean"


def meets_air(snapshot: Snapshot) -> bool:
    """Whether the fluid has a free surface, so that it goes where it will in its domain."""
    return snapshot.domain is not None and snapshot.domain.meets_air


def extent_of(
    snapshot: Snapshot, spacing: float, view: Sequence[float] | None = None, plane: Plane | None = None
) -> tuple[float, float, float, float]:
    """Return left, right, bottom and top of the view; without one, of the fluid without buffers, with some air."""
    if plane is None and snapshot.position.shape[1] != 2:
        raise ConfigError("pictures of several runs are drawn in 2-D only; open particles.vtkhdf in ParaView")
    if view is not None:
        try:
            left, right, bottom, top = map(float, view)
        except (TypeError, ValueError):
            left = right = bottom = top = np.nan
        if not (0 < right - left < LARGEST_VIEW * spacing and 0 < top - bottom < LARGEST_VIEW * spacing):
            raise ConfigError(f"view = {shown(view)}: needs left, right, bottom and top, in this order [D]")
        axes = list(plane.across) if plane else [0, 1]
        check_part(f"view = {shown(view)}", snapshot, (left, bottom), (right, top), axes)
        return left, right, bottom, top
    axes = plane.across if plane else [0, 1]
    position = snapshot.position[snapshot.kind == Kind.FLUID][:, axes]
    bounds = np.array([position.min(axis=0) - spacing / 2, position.max(axis=0) + spacing / 2])
    if snapshot.domain is not None and meets_air(snapshot):
        room = ROOM * np.ptp(bounds, axis=0).max()
        sides = np.array([snapshot.domain.lower, snapshot.domain.upper])[:, axes]
        bounds[0] = np.minimum(bounds[0], np.maximum(bounds[0] - room, sides[0]))
        bounds[1] = np.maximum(bounds[1], np.minimum(bounds[1] + room, sides[1]))
    (left, bottom), (right, top) = np.round(bounds / spacing) * spacing
    return float(left), float(right), float(bottom), float(top)


def _raster(
    snapshot: Snapshot, name: str, spacing: float, extent: tuple[float, float, float, float], plane: Plane | None
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return the fluid's field (rows, columns), and which pixels make the colour scale.

    The field is NaN where there is none. Of a fluid with a free surface, gradients at it and in spray, where half the
    neighbours are missing, make no scale.
    """
    whole = snapshot
    points, shape = _pixels(extent, spacing / PIXELS_PER_SPACING)
    if plane is not None:
        points, snapshot = plane.points(points), plane.near(snapshot, spacing)
    fluid, values = snapshot.position[snapshot.fluid], _values(snapshot, name, whole, spacing)
    fluid, values = sampling.with_images(fluid, values, whole.domain, sampling.REACH * spacing)
    picture = sampling.average(fluid, values, points, spacing)
    if whole.domain is None or not meets_air(whole):
        return picture.reshape(shape), np.isfinite(picture).reshape(shape)
    air, filled = sampling.in_air(whole, points, spacing)
    picture[air] = np.nan
    scaled, full = np.isfinite(picture), filled > INSIDE
    scaled = scaled & full if (scaled & full).any() else scaled
    return picture.reshape(shape), scaled.reshape(shape)


def _solid(
    snapshot: Snapshot,
    spacing: float,
    extent: tuple[float, float, float, float],
    plane: Plane | None,
    picture: FloatArray,
) -> FloatArray:
    """Return the share of each pixel that is solid, where there is a picture (rows, columns) of the fluid."""
    points, _ = _pixels(extent, spacing / PIXELS_PER_SPACING)
    if plane is not None:
        points, snapshot = plane.points(points), plane.near(snapshot, spacing)
    body = _outlined(snapshot, spacing, extent, plane)
    return _filled(snapshot, spacing, points, picture, plane) if body is None else body


def _pixels(extent: tuple[float, float, float, float], size: float) -> tuple[FloatArray, tuple[int, int]]:
    """Return the centres (m, 2) of pixels of about that size, row by row, and the numbers of rows and columns."""
    left, right, bottom, top = extent
    columns, rows = (max(2, round(length / size)) for length in (right - left, top - bottom))
    x, y = _centres(columns, left, right), _centres(rows, bottom, top)
    return np.stack([grid.ravel() for grid in np.meshgrid(x, y)], axis=1), (rows, columns)


def _centres(count: int, low: float, high: float) -> FloatArray:
    """Return the centres of as many pixels between two edges."""
    return np.asarray(low + (np.arange(count) + 0.5) * (high - low) / count)


def _outlined(
    snapshot: Snapshot, spacing: float, extent: tuple[float, float, float, float], plane: Plane | None
) -> FloatArray | None:
    """Return the share of each fine pixel that is solid by what the case says of its bodies and walls.

    None if it says nothing, or the particles are not where that says, such as those of a body that has moved.
    """
    if snapshot.solid is None or snapshot.fluid.all():
        return None
    height = snapshot.solid(snapshot.position)
    if height is None or (np.where(snapshot.fluid, -height, height) > SURFACE * spacing).any():
        return None
    points, shape = _pixels(extent, spacing / FINE)
    height = snapshot.solid(points if plane is None else plane.points(points))
    return None if height is None else np.clip(0.5 - height / spacing, 0, 1).reshape(shape)


def _filled(
    snapshot: Snapshot, spacing: float, points: FloatArray, picture: FloatArray, plane: Plane | None
) -> FloatArray:
    """Return the share of each pixel that solid particles fill, those beyond closed sides left out."""
    solid = snapshot.position[~snapshot.fluid]
    if snapshot.domain is not None:
        solid = solid[snapshot.domain.beyond("none", solid) <= 0]
    if not len(solid):
        return np.zeros_like(picture)
    body = sampling.fill(solid, points, spacing)
    if plane is not None:  # which may be one that the flow is computed on one side of
        least = 0.3 if meets_air(snapshot) else 0.1  # a body in the air ends near its own surface
        body = body / np.maximum(body + sampling.fill(snapshot.position[snapshot.fluid], points, spacing), least)
    body = body.reshape(picture.shape)
    from scipy.ndimage import binary_fill_holes

    hollow = binary_fill_holes(body > 0.5) & np.isnan(picture)
    return np.where(hollow, 1.0, body)


def _limit(values: FloatArray) -> float:
    """Return a round end for the colour scale of pixels (n,).

    All but one per cent of them stay within it, or more where the field is concentrated in fewer than that.
    """
    size = np.abs(values)
    if not size.any():
        return 1.0
    largest = max(float(np.percentile(size, 99)), float((size**2).sum() / size.sum()))
    unit = 10.0 ** np.floor(np.log10(largest))
    return float(np.ceil(largest / unit * 2) / 2 * unit)
