"""What a resolution and a domain can carry, in words.

A remark is a text ``keyword: what it is; what to do about it``. Each limit says where it comes from.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from alsph.arrays import FloatArray
from alsph.geometry import thin as thin_bodies
from alsph.geometry.thin import NARROWEST_HOLE, THINNEST, carried, thickness
from alsph.geometry.volume import Volume

LAYER = 1.2
"""Thickness of the boundary layer at the front of a cylinder over √(νD/U): 2.4 √(ν/a) in stagnation-point flow
(Schlichting and Gersten, Boundary-Layer Theory, section 5.1) with the strain rate a = 4U/D of potential flow."""

CELL_REYNOLDS = 20.0
"""Largest UΔx/ν at which results have been compared with those of others (docs/results.md)."""

NARROWEST = {"quintic_spline": 1.2, "wendland_c2": 1.5, "wendland_c4": 1.5}
"""Smoothing ratio h/Δx below which a kernel has been found to err (docs/experiments.md, Kernels)."""

MOST_POINTS = 4000
"""About how many points of an outline are looked at, beside its corners."""

LARGEST_BLOCKAGE = 0.1
"""Share of a channel's height; at 0.077 the walls raise a cylinder's drag by 15 % (reference solutions, Re = 100)."""

SLOWED = 0.05
"""Share by which a cylinder may slow the stream at the inlet, (D/2)²/x² in potential flow."""

OUTLET = 2.5
"""Distance from the back of a cylinder to the outlet over D: with 1.5 no vortices were shed at Re = 200, with 2.5 the
drag was that with 5.5 (docs/reliability.md)."""

COMPRESSIBLE = 0.46
"""Largest artificial Mach number of the penalty with which results have been compared (docs/performance.md, Cost and
error)."""


CLOSEST = 4.0
"""Width of a gap between bodies, or of a slot in one, [Δx] below which it is remarked on."""

NO_SLOT = 0.05
"""Area of a notch [Δx²] below which it is roughness."""

DEEP = 2.0
"""Depth of a slot over its width; a corner of 39 degrees has as much, wider ones have less."""

TOO_THIN = "too thin"
"""What is remarked on a body that the resolution does not carry, and refused."""

LEAST_LEFT = 0.5
"""Share of its area below which what the resolution carries of a body is no longer that body."""

MOST_LEFT = 0.95
"""Share of its volume below which a body in space has thin parts to speak of; a cube's edges take less."""

THICK = 8.0
"""Thickness of a body [Δx] from which its recorded loads have met the momentum balance within 3 % (docs/results.md)."""


def keywords(remarks: Iterable[str]) -> str:
    """Return what the remarks are about, each once."""
    return ", ".join(dict.fromkeys(remark.partition(":")[0] for remark in remarks))


def tally(runs: Sequence[str]) -> str:
    """Return of how many of the runs, each given by its :func:`keywords`, there is what to remark."""
    words = Counter(word for run in runs for word in run.split(", ") if word)
    return ", ".join(f"{word}: {count} of {len(runs)} runs" for word, count in words.items())


def refusal(remarks: Iterable[str]) -> str:
    """Return why the resolution does not carry a body, empty if it does."""
    return next((remark for remark in remarks if remark.startswith(TOO_THIN)), "")


JOINED = "  |  "
"""What stands between remarks below a picture."""


def brief(remarks: Iterable[str]) -> str:
    """Return the remarks without what explains them, for a line below a picture."""
    return JOINED.join(remark.partition(";")[0] for remark in remarks)


def boundary_layer(thickness: float, spacing: float) -> list[str]:
    """Remark on a boundary layer with fewer than two particles in it: they lie Δx/2, 3Δx/2 and so on off the surface.

    Parameters
    ----------
    thickness, spacing : float
        Both in D.
    """
    layer = f"boundary layer of {thickness / spacing:.3g} Δx"
    remedy = f"resolution = {math.ceil(1.5 / thickness - 1e-9)} puts two particles into it"
    if thickness < 0.5 * spacing:
        text = f"not resolved: {layer}, below the first particles; forces and separation are not those of this flow"
        return [f"{text}; {remedy}"]
    if thickness < 1.5 * spacing:
        text = f"coarse: {layer}, fewer than two particles"
        known = "a cylinder's drag errs by 4 to 8 %, its lift by 14 % at 0.8 to 1.2 Δx"
        return [f"{text}; {known}, {remedy}"]
    return []


def validated(reynolds: float, resolution: int, cell_reynolds: float, known: tuple[float, float, int]) -> list[str]:
    """Remark on what lies outside all that has been compared with the results of others.

    Parameters
    ----------
    reynolds, resolution, cell_reynolds
        Re, D/Δx and UΔx/ν.
    known : (least Re, largest Re, least D/Δx)
        What has been compared.
    """
    least, largest, coarsest = known
    outside = [f"Re = {reynolds:g}"] if not least <= reynolds <= largest else []
    outside += [f"D/Δx = {resolution}"] if resolution < coarsest else []
    outside += [f"UΔx/ν = {cell_reynolds:.3g}"] if cell_reynolds > (1 + 1e-9) * CELL_REYNOLDS else []
    span = f"Re = {least:g}" + (f" to {largest:g}" if least < largest else "")
    limit = f"compared with the results of others are {span}, D/Δx from {coarsest}, UΔx/ν up to {CELL_REYNOLDS:g}"
    return [f"not validated: {', '.join(outside)}; {limit}"] if outside else []


def kernel(name: str, smoothing_ratio: float) -> list[str]:
    """Remark on a kernel whose support is too narrow for the particles in it."""
    if smoothing_ratio >= NARROWEST.get(name, 0.0) - 1e-9:
        return []
    found = (
        "Taylor-Green vortices broke down with h/Δx = 1.1; use smoothing_ratio = 1.2 or more"
        if name == "quintic_spline"
        else f"Poiseuille flow then errs by {'3 to 10' if smoothing_ratio < 1.1 else '0.7 to 3'} % at any resolution; "
        "use smoothing_ratio = 1.75 or more, or the quintic spline"
    )
    return [f"kernel: {name} with h/Δx = {smoothing_ratio:.3g}; {found}"]


def scheme(name: str | None, wall_pressure: str) -> list[str]:
    """Remark on a scheme with which hardly anything has been compared, and on walls at which its sound grows."""
    if name in (None, "alsph"):
        return []
    wrong = "; C_p on a cylinder erred by 0.13" if name == "isph" else ""
    compared = f"other scheme: {name} has been compared with references in few flows, see docs/schemes.md{wrong}"
    if wall_pressure != "linear" or name not in ("wcsph", "edac"):
        return [compared]
    grows = "growing sound: with wall_pressure = linear sound grew at solid walls until a fluid at rest broke down"
    return [compared, f"{grows}; use wall_pressure = adami"]


def without_effect(values: dict[str, object], where: str) -> list[str]:
    """Remark on parameters, by name, that are given and that nothing depends on, in words where."""
    if not values:
        return []
    told = ", ".join(f"{name} = {value}" for name, value in values.items())
    return [f"no effect: {told}; nothing depends on {'it' if len(values) == 1 else 'them'} {where}"]


def penalty(constant: float, scheme: str | None = None) -> list[str]:
    """Remark on a constant (c/u_max)² of the penalty or the speed of sound too small for a fluid that hardly gives way.

    Parameters
    ----------
    constant
        C_BV, or (c/u_max)² of another scheme.
    scheme
        The scheme; ALSPH if None.
    """
    mach = constant**-0.5
    if mach <= COMPRESSIBLE:
        return []
    what, remedy = {
        "wcsph": ("speed of sound", "larger sound_speed"),
        "edac": ("speed of sound", "larger sound_speed"),
        "explicit_isph": ("step", "smaller mach_number"),
    }.get(scheme or "", ("penalty", "smaller courant, or a larger penalty_constant"))
    text = f"the {what} lets the fluid give way as at a Mach number of {mach:.2g}, up to {COMPRESSIBLE:g} was compared"
    return [f"compressible: {text}; take a {remedy}"]


def channel(size: float, inlet: float, outlet: float, share: float, slowed: float) -> list[str]:
    """Remark on a channel that ends, or is closed, too near a body.

    Parameters
    ----------
    size : float
        The body's extent across the stream [D].
    inlet, outlet : float
        Distances of the inlet from its centre and of the outlet from its back [D].
    share : float
        Share of the channel's section that the body blocks.
    slowed : float
        Share by which it slows the stream at the inlet.
    """
    remarks = near_outlet(size, outlet)
    if slowed > SLOWED:
        text = f"inlet {inlet:.3g} D before the body, which slows the stream there by about {100 * slowed:.0f} %"
        remarks.append(f"short channel: {text}; the inflow is uniform all the same, use a larger upstream")
    if share > LARGEST_BLOCKAGE:
        text = f"the body blocks {100 * share:.0f} % of it; its coefficients are not those of unbounded flow"
        remarks.append(f"narrow channel: {text}")
    return remarks


def near_outlet(size: float, outlet: float, when: str = "") -> list[str]:
    """Remark on an outlet too near the back of a body of that size across the stream, then [D]."""
    if not outlet < OUTLET * size:
        return []
    text = f"outlet {outlet:.3g} D behind the body{when}; vortices leave as they form, and may not form at all"
    return [f"short channel: {text}, use a larger length"]


def protrusion(shape: Polygon | MultiPolygon, thickness: float) -> float:
    """Return how far [D] parts of a shape thinner than `thickness` reach beyond its thicker ones.

    It is infinite where all are, and where they are what holds it together, such as the wall around a hole.
    """
    core = shape.buffer(-0.5 * thickness)
    if core.is_empty or shapely.get_num_geometries(core) > shapely.get_num_geometries(shape):
        return math.inf
    if len(thin_bodies.holes(core)) < len(thin_bodies.holes(shape)):
        return math.inf
    return reach(shape, core.buffer(0.5 * thickness), 0.5 * thickness)


def reach(shape: Polygon | MultiPolygon, rest: Polygon | MultiPolygon, step: float) -> float:
    """Return how far [D] a shape reaches beyond what is left of it, by points of its outline up to `step` apart."""
    return float(shapely.distance(rest, shapely.Point(tip(shape, rest, step))))


def tip(shape: Polygon | MultiPolygon, rest: Polygon | MultiPolygon, step: float) -> FloatArray:
    """Return the point (2,) of a shape's outline that is farthest from what is left of it, of those `reach` looks at.

    Its corners are always among them.
    """
    outline = shapely.get_coordinates(shapely.segmentize(shape, max(step, shape.length / MOST_POINTS)))
    return np.asarray(outline[shapely.distance(rest, shapely.points(outline)).argmax()])


def thinnest(shape: Polygon | MultiPolygon) -> float:
    """Return the thickness [D] of the thinnest part of a shape, of those that reach out farther than they are thick.

    Of what holds it together, too, such as the wall around a hole. It is 0 where the shape tapers to an edge of less
    than 39 degrees; other corners are no thin parts.
    """
    left, bottom, right, top = shape.bounds
    size = max(right - left, top - bottom)
    thin, thick = 0.0, 2 * size
    plain = shapely.simplify(shape, 1e-4 * size)
    while thick - thin > 1e-4 * thick > 1e-9 * size:
        middle = 0.5 * (thin + thick)
        if protrusion(plain, middle) > middle:
            thick = middle
        else:
            thin = middle
    return thin


def thinnest_tip(shape: Polygon | MultiPolygon, thickness: float, spacing: float) -> FloatArray:
    """Return where (2,) the thinnest part of a shape, of that thickness, ends; what tapers is cut off below 2 Δx."""
    thick = max(1.05 * thickness, THINNEST * spacing)
    rest = shape.buffer(-0.5 * thick).buffer(0.5 * thick)
    return tip(shape, shape.centroid if rest.is_empty else rest, 0.25 * spacing)


def thin(name: str, shape: Polygon, left: Polygon | MultiPolygon, spacing: float) -> list[str]:
    """Remark on what the resolution cuts off a body, and on loads that two near faces make uncertain (lengths in D).

    Parameters
    ----------
    name
        Name of the body.
    shape, left
        The body, and what is carried of it.
    spacing : float
        Particle spacing Δx.
    """
    thick = thickness(shape)
    if left.area < LEAST_LEFT * shape.area:
        lost = "the flow would go through it"
        if not left.is_empty:
            lost = f"without what is thinner than {THINNEST:g} Δx {100 * left.area / shape.area:.2g} % of it is left"
        return [
            f"{TOO_THIN}: the {name} is at most {thick:.3g} D or {thick / spacing:.3g} Δx thick, {lost}; "
            f"use resolution = {_coarsest(shape, thick)} or more"
        ]
    found = []
    length, area = reach(shape, left, 0.5 * spacing), 1 - left.area / shape.area
    pieces = len(shapely.get_parts(left))
    if length > spacing or pieces > 1:
        text = f"cut off, for they are thinner than 2 Δx: up to {length:.2g} D of tips, {100 * area:.2g} % of the area"
        if pieces > 1:
            text += f", so that {_the(name)} is in {pieces} pieces, with flow between them"
        found.append(f"thin parts: {text}; they come back with resolution")
    if thick < 0.99 * THICK * spacing:
        known = "lift and drag were found off by 17 to 23 % below 3 Δx, by 4 % at 5 Δx"
        text = f"{_the(name)} is {thick / spacing:.2g} Δx at its thickest"
        found.append(f"thin body: {text}; {known}; resolution = {math.ceil(THICK / thick)} makes it {THICK:g} Δx")
    return found


def thin_in_space(name: str, body: Volume, spacing: float) -> list[str]:
    """Remark on a body in space too thin for the resolution, or with parts that are (Δx in D)."""
    share, thick = body.left(THINNEST * spacing), body.thickness / spacing
    if share < LEAST_LEFT:
        text = f"{_the(name)} is at most {thick:.3g} Δx thick, only {100 * share:.0f} % of it {THINNEST:g} Δx and more"
        return [f"{TOO_THIN}: {text}; use a finer resolution"]
    found = []
    if share < MOST_LEFT:
        text = f"{100 * (1 - share):.2g} % of {_the(name)} is thinner than {THINNEST:g} Δx"
        found.append(f"thin parts: {text}; each face there has half a wall, and loads are uncertain")
    if thick < 0.95 * THICK:  # it is known to some per cent
        enough = math.ceil(THICK / (thick * spacing))
        text = f"{_the(name)} is {thick:.2g} Δx at its thickest"
        found.append(f"thin body: {text}; resolution = {enough} makes it {THICK:g} Δx")
    return found


def _the(name: str) -> str:
    """Return a body's name as a sentence has it: one of several stands by itself."""
    return name if "_" in name else f"the {name}"


def _coarsest(shape: Polygon, thick: float) -> int:
    """Return the least resolution that carries enough of a body of a given thickness [D], which all finer ones do."""
    least = math.ceil(THINNEST / thick - 0.05)
    enough = least
    while carried(shape, 1 / enough).area < LEAST_LEFT * shape.area:
        least, enough = enough + 1, 2 * enough
    while least < enough:
        middle = (least + enough) // 2
        if carried(shape, 1 / middle).area < LEAST_LEFT * shape.area:
            least = middle + 1
        else:
            enough = middle
    return enough


def unknown(several: bool = False) -> list[str]:
    """Remark on a body that nothing is known of."""
    what = "these bodies; they have" if several else "this body; it has"
    return [f"not validated: flow past {what} not been compared with the results of others"]


def several(names: Sequence[str]) -> list[str]:
    """Remark on drag and lift of more than one body."""
    if len(names) < 2:
        return []
    return [f"several bodies: drag and lift are those of all {len(names)} together; those of each stand beside them"]


def derived(model: type) -> list[str]:
    """Remark on a class of the user's that derives from a shipped case, with whose reference it may be compared."""
    shipped = [base for base in model.__mro__ if base.__module__.startswith("alsph.cases.") and "title" in vars(base)]
    if model.__module__.startswith("alsph.") or not shipped:
        return []
    text = (
        f"{model.__name__} has what it does not say itself from {shipped[0].__name__}: references and tolerances, too"
    )
    return [f"not validated: {text}; if its flow is another one it needs its own measures, profiles and validated"]


def prescribed(names: list[str]) -> list[str]:
    """Remark on what a case prescribes by expressions, with which its references have nothing to do."""
    if not names:
        return []
    return [f"not validated: {', '.join(names)} of its own; references are of the flow without and not used"]


def gaps(names: list[str], bodies: list[Polygon | MultiPolygon], spacing: float) -> list[str]:
    """Remark on bodies so near each other that the flow between them is not resolved (lengths in D)."""
    found = []
    for first, second in itertools.combinations(range(len(bodies)), 2):
        gap = shapely.distance(bodies[first], bodies[second]) / spacing
        if gap < CLOSEST:
            found.append(_narrow("", gap, f"between {names[first]} and {names[second]}"))
    return found


def _narrow(most: str, gap: float, where: str) -> str:
    through = "nothing flows there" if gap < 1 else "the flow there is not resolved"
    return f"narrow gap: {most}{gap:.2g} Δx {where}; {through}, use a finer resolution"


def slots(name: str, body: Polygon | MultiPolygon, spacing: float) -> list[str]:
    """Remark on slots in a body so narrow that the flow in them is not resolved (lengths in D).

    They are what a disc of 4 Δx does not come to: deeper than a corner, or between what it comes to.
    """
    if body.is_empty:
        return []
    body, radius = body.simplify(0.05 * spacing), 0.5 * CLOSEST * spacing * (1 - 1e-3)
    outside = shapely.box(*body.bounds).buffer(4 * radius).difference(body)
    cores = shapely.get_parts(outside.buffer(-radius))
    reached = shapely.union_all(cores).buffer(radius, quad_segs=32)
    mouths = reached.buffer(1e-3 * spacing)
    widths = []
    for part in shapely.get_parts(outside.difference(reached)):
        if part.area < NO_SLOT * spacing**2:
            continue
        if np.count_nonzero(shapely.distance(cores, part) < 1.01 * radius) > 1:
            widths.append(CLOSEST)
            continue
        corners = shapely.points(shapely.get_coordinates(part))
        wide, deep = thickness(part), shapely.distance(part.intersection(mouths), corners).max()
        if deep > max(spacing, DEEP * wide):
            widths.append(wide / spacing)
    if not widths:
        return []
    several = f", the narrowest of {len(widths)} slots" if len(widths) > 1 else ""
    return [_narrow("up to ", min(widths), f"within {_the(name)}{several}")]


def holes(shapes: Sequence[Polygon], left: Sequence[Polygon | MultiPolygon]) -> list[str]:
    """Remark on holes in bodies: on those of what is carried of them, and on those that are filled."""
    drawn, carried = (sum(len(thin_bodies.holes(shape)) for shape in some) for some in (shapes, left))
    found = []
    if carried:
        text = f"{carried} of fluid that no flow comes to; the pressure there has a level of its own"
        found.append(f"closed holes: {text}")
    if drawn > carried:
        text = f"{drawn - carried} of {drawn} are narrower than {NARROWEST_HOLE:g} Δx, or opened where the body is thin"
        found.append(f"lost holes: {text}; they come back with resolution")
    return found
