"""Pictures of what a run starts with: particles, outlines of bodies, what closes the sides of the domain."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import NDArray

from alsph.arrays import AXES, Arrays, FloatArray
from alsph.cases import Bodies, Case, remarks
from alsph.geometry.particles import Kind, particles
from alsph.geometry.plane import Plane
from alsph.plotting.style import PALETTE, blank, rename, title

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from alsph.geometry.domain import Domain

KINDS = {Kind.FLUID: "#A6CEE3", Kind.INLET: PALETTE[2], Kind.OUTLET: PALETTE[4], Kind.SOLID: "0.45"}
"""Colours of particles."""

CLOSED_BY = {
    "slip": "free-slip wall",
    "none": "solid particles",
    "periodic": "periodic",
    "inlet": "inlet",
    "outlet": "outlet",
    "air": "air",
}
"""What closes a side, in words."""

WIDTH = 11.0
"""Width of the figure in inches."""

TALLEST = 5.0
"""Largest height of what is drawn below the whole, in inches."""

LONG = 2.2
"""Length over height of a domain from which its bodies are drawn below it, not beside it."""

AROUND = 0.12
"""Room around bodies over their extent."""

BESIDE = 9.0
"""How far beside a side of the domain its name stands [points]."""

LEAST = 0.4
"""Least height over length, and length over height, of what is drawn of bodies."""

NEAR = 8.0
"""Half width of the picture of the thinnest part [Δx]."""

CHANGED = 1e-3
"""Share of a body's area that must be cut off or filled for its outline as it was given to be drawn, too."""

NAMES = {Kind.SOLID: "solid, its normal in white"}
"""What kinds are called that are not by their name alone."""

LABEL = {"facecolor": "w", "alpha": 0.8, "edgecolor": "none", "pad": 1}
"""Box behind a word in the picture."""

View = tuple[float, float, float, float]
"""Left, right, bottom and top [D]."""


@dataclass(frozen=True, eq=False)
class Setup:
    """What is drawn of the start of a run, in the plane (d = 2) or of a slice through it.

    Attributes
    ----------
    domain : Domain
    spacing : float
        Particle spacing Δx [D].
    position, normal : ndarray, shape (n, d)
        Of particles, and of the surface at solid ones.
    kind : ndarray of uint8, shape (n,)
    given, surface : list of ndarray, shape (m, 2)
        Curves on which bodies end, as they were given and as the resolution carries them [D].
    bodies : View, optional
        What the bodies extend over [D].
    thinnest : tuple of ndarray and str, optional
        Where what is carried of the thinnest part of the bodies ends (2,) [D], and what it is called.
    names : dict of ndarray, shape (2,)
        Middles of bodies by their names, where there are several [D].
    points : ndarray, shape (m, d)
        Points that are recorded [D].
    plane : (int, int)
        The axes that are drawn.
    """

    domain: Domain
    spacing: float
    position: FloatArray
    normal: FloatArray
    kind: NDArray[np.uint8]
    given: list[FloatArray] = field(default_factory=list)
    surface: list[FloatArray] = field(default_factory=list)
    bodies: View | None = None
    thinnest: tuple[FloatArray, str] | None = None
    names: dict[str, FloatArray] = field(default_factory=dict)
    points: FloatArray | None = None
    plane: tuple[int, int] = (0, 1)

    @property
    def view(self) -> View:
        """What all particles and the domain extend over."""
        across = list(self.plane)
        corners = np.array([self.domain.lower, self.domain.upper], float)
        everything = np.concatenate([self.position, corners])[:, across]
        (left, bottom), (right, top) = everything.min(axis=0), everything.max(axis=0)
        return float(left), float(right), float(bottom), float(top)


def start(case: Case, state: Arrays | None = None, points: FloatArray | None = None) -> Figure:
    """Picture of what a run starts with: particles, outlines, the thinnest part, sides and recorded points.

    In 3-D it is of the slice that pictures of the run show. Bodies that are too thin for the resolution are drawn
    without particles.

    Parameters
    ----------
    case : Case
    state : dict of ndarray, optional
        Its particles at the start, if they have been made already.
    points : ndarray, shape (m, d), optional
        Points that are recorded [D].

    Raises
    ------
    ConfigError
        If the particles would not fit into the memory that is free.
    """
    plane, where = (0, 1), ""
    if case.space_dimensions == 3:
        cut = Plane.of(case.picture_axis, case.middle)
        plane, where = (cut.across[0], cut.across[1]), f", ${AXES[cut.axis]}/D$ = {cut.place:.3g}"
    figure = _draw_all(
        _found(case, state or _particles(case), points, plane),
        f"{title([case.model_dump() | {'case': case.name}])}{where}",
    )
    rename(figure, case.symbols)
    return figure


def _particles(case: Case) -> Arrays:
    """Return the particles that a case starts with; none of one whose bodies are too thin."""
    if isinstance(case, Bodies) and remarks.refusal(case.remarks()):
        return particles(Kind.FLUID, np.empty((0, 2)), 0.0)
    return case.build().state


def _found(case: Case, state: Arrays, points: FloatArray | None, plane: tuple[int, int]) -> Setup:
    """Return what is drawn of the start of a case, in 3-D of particles within Δx of a plane through its middle."""
    for axis in set(range(case.space_dimensions)) - set(plane):
        near = np.abs(state["position"][:, axis] - case.middle[axis]) <= case.particle_spacing
        state = {name: values[near] for name, values in state.items()}
        if points is not None:
            points = points[np.abs(points[:, axis] - case.middle[axis]) <= case.particle_spacing]
    view = _extent(case, state, plane)
    return Setup(
        case.checked_domain,
        case.particle_spacing,
        state["position"],
        state["normal"],
        state["kind"],
        given=_given(case) if isinstance(case, Bodies) else [],
        surface=_surface(case, view, plane) if view else [],
        bodies=view,
        thinnest=_thinnest(case) if isinstance(case, Bodies) else None,
        names=case.middles() if isinstance(case, Bodies) else {},
        points=points,
        plane=plane,
    )


def _extent(case: Case, state: Arrays, plane: tuple[int, int]) -> View | None:
    """Return what the bodies that forces are those of extend over; None if there are none."""
    if isinstance(case, Bodies):
        left, bottom, right, top = np.array(case.bounds) + np.tile(case.centre, 2)
        return float(left), float(right), float(bottom), float(top)
    named = [index for index, body in enumerate(case.checked_bodies) if body.name in case.coefficient_bodies]
    solid = state["position"][(state["kind"] == Kind.SOLID) & np.isin(state["body"], named)][:, plane]
    if not len(solid):
        return None
    (left, bottom), (right, top) = solid.min(axis=0), solid.max(axis=0)
    return float(left), float(right), float(bottom), float(top)


def _surface(case: Case, view: View, plane: tuple[int, int]) -> list[FloatArray]:
    """Return the curves (n, 2) on which bodies end, as far as the case says."""
    from contourpy import contour_generator

    spacing = case.particle_spacing
    x, y = (np.arange(low - 2 * spacing, high + 2 * spacing, spacing / 8) for low, high in (view[:2], view[2:]))
    points = np.tile(case.middle, (len(x) * len(y), 1))
    points[:, plane] = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    height = case.solid_height(points)
    if height is None:
        return []
    height = np.clip(height, -spacing, spacing).reshape(len(y), len(x))
    return [np.asarray(curve) for curve in contour_generator(x, y, height).lines(0.0)]


def _given(case: Bodies) -> list[FloatArray]:
    """Return the curves (n, 2) of outlines of which something is cut off or filled."""
    parts = zip(case.outlines, case.carried, strict=True)
    changed = [outline for outline, left in parts if outline.symmetric_difference(left).area > CHANGED * outline.area]
    rings = [ring for outline in changed for ring in (outline.exterior, *outline.interiors)]
    return [np.array(ring.coords) + case.centre for ring in rings]


def _thinnest(case: Bodies) -> tuple[FloatArray, str] | None:
    """Return where (2,) what is carried of the thinnest part ends, and what it is called; None if it is thick."""
    spacing = case.particle_spacing
    thickness = remarks.thinnest(case.outline)
    if thickness > 0.99 * remarks.THICK * spacing:
        return None
    tip = shapely.Point(remarks.thinnest_tip(case.outline, thickness, spacing))
    left = shapely.union_all(case.carried)
    there = tip.coords[0] if left.is_empty else shapely.shortest_line(left, tip).coords[0]
    name = f"{thickness / spacing:.3g} Δx" if thickness > 0.01 * spacing else "an edge"
    return np.array(there) + case.centre, f"thinnest part: {name}"


def _draw_all(found: Setup, of: str) -> Figure:
    """Draw all of it, the bodies and their thinnest part."""
    views = [("", found.view)]
    if found.bodies:
        views.append(("bodies", _around(found, found.bodies)))
    if found.thinnest:
        (x, y), name = found.thinnest
        reach = NEAR * found.spacing
        views.append((name, (x - reach, x + reach, y - reach, y + reach)))
    left, right, bottom, top = found.view
    length, height = right - left, top - bottom
    figure = blank(WIDTH, _height(length / height, len(views)))
    if length > LONG * height and len(views) > 1:
        grid = figure.add_gridspec(2, len(views) - 1, height_ratios=[height / length * (len(views) - 1), 1])
        places = [grid[0, :], *(grid[1, column] for column in range(len(views) - 1))]
    else:
        grid = figure.add_gridspec(1, len(views))
        places = [grid[0, column] for column in range(len(views))]
    for place, (name, view) in zip(places, views, strict=True):
        axes = figure.add_subplot(place)
        _draw(axes, found, view, close=name != "")
        axes.set_title(name or of, fontsize="medium")
    _explain(figure, found)
    return figure


def _height(aspect: float, views: int) -> float:
    """Return the height of the figure in inches, given length over height of the domain."""
    if views > 1 and aspect > LONG:
        return float(np.clip(WIDTH / aspect + min(WIDTH / (views - 1), TALLEST) + 1.5, 5, 12))
    return float(np.clip(WIDTH / views / aspect + 1.2, 2.6, 9))


def _around(found: Setup, bodies: View) -> View:
    """Return a view of the bodies with some room around them, no larger than the whole."""
    corners = np.reshape(bodies, (2, 2)).T
    outlines = np.concatenate([corners, *found.given, *found.surface])
    low, high = outlines.min(axis=0), outlines.max(axis=0)
    size = (high - low).max()
    half = np.maximum((high - low) / 2, LEAST * size / 2) + AROUND * size
    middle = (low + high) / 2
    left, right, bottom, top = np.stack([middle - half, middle + half], axis=1).ravel()
    whole = found.view
    return max(left, whole[0]), min(right, whole[1]), max(bottom, whole[2]), min(top, whole[3])


def _draw(axes: Axes, found: Setup, view: View, *, close: bool) -> None:
    """Draw particles in a view as circles of a diameter of Δx, and what is known of bodies and sides."""
    from matplotlib.collections import EllipseCollection

    across = list(found.plane)
    left, right, bottom, top = view
    place = found.position[:, across]
    seen = ((place > [left - 1, bottom - 1]) & (place < [right + 1, top + 1])).all(axis=1)
    for kind, colour in KINDS.items():
        offsets = place[seen & (found.kind == kind)]
        size = found.spacing * (0.85 if close else 1.0)
        circles = EllipseCollection(
            [size], [size], [0.0], units="xy", offsets=offsets, offset_transform=axes.transData, facecolors=colour
        )
        circles.set(linewidth=0, rasterized=True)
        axes.add_collection(circles)
    if close:
        solid = seen & (found.kind == Kind.SOLID)
        normal = found.normal[solid][:, across] * found.spacing / 2
        style: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.002, "headwidth": 0}
        axes.quiver(*place[solid].T, *normal.T, headlength=0, headaxislength=0, color="w", **style)
    for curves, colour, dashes in ((found.given, PALETTE[1], "--"), (found.surface, "k", "-")):
        for curve in curves:
            axes.plot(*curve.T, color=colour, ls=dashes, lw=1.2 if close else 0.6)
    if found.points is not None and len(found.points):
        axes.plot(*found.points[:, across].T, "+", color=PALETTE[3], ms=6)
    for name, at in found.names.items() if close else ():
        axes.annotate(name, (at[0], at[1]), ha="center", va="center", fontsize="small", clip_on=True, bbox=LABEL)
    if close and found.thinnest:
        axes.plot(*found.thinnest[0], "o", mfc="none", color=PALETTE[1], ms=9)
    if not close:
        _name_sides(axes, found)
    horizontal, vertical = (AXES[axis] for axis in across)
    axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
    axes.set(xlabel=f"${horizontal}/D$", ylabel=f"${vertical}/D$")


def _name_sides(axes: Axes, found: Setup) -> None:
    """Draw the domain, and write beside each side what closes it."""
    low, high = (np.array(corner)[list(found.plane)] for corner in (found.domain.lower, found.domain.upper))
    axes.plot(*np.array([low, [high[0], low[1]], high, [low[0], high[1]], low]).T, "k-", lw=0.6)
    middle = (low + high) / 2
    look: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": "x-small", "bbox": LABEL}
    look["textcoords"] = "offset points"
    for axis, sides in enumerate(found.domain.boundaries[axis] for axis in found.plane):
        for corner, side, inwards in ((low, sides[0], 1), (high, sides[1], -1)):
            at, offset = middle.copy(), np.zeros(2)
            at[axis], offset[axis] = corner[axis], inwards * BESIDE
            axes.annotate(
                CLOSED_BY[side], (at[0], at[1]), (offset[0], offset[1]), rotation=90 if axis == 0 else 0, **look
            )


def _explain(figure: Figure, found: Setup) -> None:
    """Write what colours and lines are, below the picture."""
    from matplotlib.lines import Line2D

    dot: dict[str, Any] = {"marker": "o", "ls": "", "ms": 6}
    handles = [
        Line2D([], [], color=colour, label=NAMES.get(kind, kind.name.lower()), **dot)
        for kind, colour in KINDS.items()
        if (found.kind == kind).any()
    ]
    if found.surface:
        handles.append(Line2D([], [], color="k", label="surface"))
    if found.given:
        handles.append(Line2D([], [], color=PALETTE[1], ls="--", label="as given"))
    if found.points is not None and len(found.points):
        handles.append(Line2D([], [], color=PALETTE[3], marker="+", ls="", label="recorded points"))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize="small", frameon=False)
