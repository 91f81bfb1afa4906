"""Loads on bodies in the small channels of docs/results.md, by finite elements, as references for those of alsph.

Each case is solved four times: with elements of order 5, of order 4, then with half the time step, and in a channel
with the outlet farther away. A row of the table holds the means of order 5 over a window of time, and what each of the
three changes does to them.
Flow and body are as in `alsph.cases.Body` without a perturbation, except at the outlet, where the traction vanishes.
Where both are their own mirror images, half of the channel is solved. It needs an environment of its own:

    python -m venv fem && fem/bin/pip install ngsolve .
    fem/bin/python benches/reference/bodies.py -o bodies.csv [naca0012_0 plate_0.25_5x4 ...]
"""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import netgen.occ as occ
import ngsolve as ng
import numpy as np
import shapely
from alsph.arrays import FloatArray
from alsph.cases import Body
from finite_elements import Flow
from netgen.meshing import MeshingParameters

DOUBLINGS = 7  # of the step after the start
FAR, NEAR, SURFACE, CORNER = 0.4, 0.15, 0.04, 0.0005  # sizes of the elements [D]
BEND = 0.35  # their length along the surface, in radii of its curvature
SHARP = math.radians(30)  # corners turn by more
STEADY = (math.inf, math.inf)
LONGER = 4.0  # the channel, to see what the outlet does [D]
WHOLE = [0, 3]  # of the loads: drag and lift, each before its parts
LOADS = ["CD", "CDp", "CDf", "CL", "CLp", "CLf"]
COLUMNS = [
    *["case", "Re", "L_over_D", "H_over_D", "LU_over_D", "from", "to", *LOADS],
    *["moved_by_order", "parts_moved_by_order", "moved_by_step", "moved_by_outlet"],
]


@dataclass(frozen=True)
class Case:
    """A body in a channel, at rest from t* = 0 on, and the windows of time to average over [D/U]."""

    name: str
    outline: shapely.Polygon
    channel: tuple[float, float, float]  # length, height, upstream [D]
    windows: tuple[tuple[float, float], ...]
    reynolds: float = 100.0
    symmetric: bool = True
    step: float = 0.004  # [D/U]

    def mesh(self) -> ng.Mesh:
        """Return the channel around the body, or the upper half of it."""
        length, height, upstream = self.channel
        bottom = 0.0 if self.symmetric else -height / 2
        channel = occ.MoveTo(0, bottom).Rectangle(length, height / 2 - bottom).Face()
        for edge in channel.edges:
            at = edge.center.x
            edge.name = "inlet" if abs(at) < 1e-6 else "outlet" if abs(at - length) < 1e-6 else "side"
        points, sizes, pieces = surface(self.outline)
        curves = []
        for piece in pieces:
            along = [occ.Pnt(x + upstream, y, 0) for x, y in piece]
            curves.append(occ.Segment(*along) if len(along) == 2 else occ.SplineInterpolation(along))
        body = occ.Face(occ.Wire(curves))
        body.edges.name = "body"
        sizing = MeshingParameters(maxh=FAR, grading=0.25)
        left, low, right, high = self.outline.bounds
        around = np.mgrid[left - 0.5 : right + 3 : NEAR / 2, low - 0.4 : high + 0.4 : NEAR / 2].reshape(2, -1).T
        for (x, y), size in [*zip(points, sizes, strict=True), *((point, NEAR) for point in around)]:
            if y >= bottom and x + upstream <= length:
                sizing.RestrictH(x + upstream, y, 0, size)
        return ng.Mesh(occ.OCCGeometry(channel - body, dim=2).GenerateMesh(mp=sizing)).Curve(6)

    def loads(self, order: int, step: float) -> FloatArray:
        """Return the mean loads (windows, 6), named in `LOADS`."""
        flow = Flow(self.mesh(), self.reynolds, order)
        flow.velocity.Set(ng.CoefficientFunction((1, 0)))
        starts, ends = np.array([window for window in self.windows if window != STEADY]).T
        history = [
            (time, *flow.loads()) for time in flow.march(max(ends), step, DOUBLINGS) if time > min(starts) - 1.5 * step
        ]
        times, *columns = np.array(history).T
        rows = []
        for start, end in self.windows:
            if (start, end) == STEADY:
                flow.settle()
                rows.append(flow.loads())
            else:
                at = np.linspace(start, end, 1 + round((end - start) / step))
                weights = np.full(len(at), 1.0)
                weights[[0, -1]] = 0.5 if len(at) > 1 else 1
                rows.append([np.average(np.interp(at, times, column), weights=weights) for column in columns])
        return np.array(rows) * ([2, 2, 2, 0, 0, 0] if self.symmetric else 1)


def surface(outline: shapely.Polygon) -> tuple[FloatArray, FloatArray, list[FloatArray]]:
    """Return points (n, 2) of an outline, sizes (n,) of the elements there, and the smooth pieces between corners."""
    points = shapely.get_coordinates(shapely.geometry.polygon.orient(outline).exterior)[:-1]
    before, after = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
    turn = np.abs(np.arctan2(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0], (before * after).sum(axis=1)))
    radius = 0.5 * (np.hypot(*before.T) + np.hypot(*after.T)) / np.maximum(turn, 1e-9)
    sizes = np.where(turn > SHARP, CORNER, np.clip(BEND * radius, CORNER, SURFACE))
    ends = set(np.flatnonzero(turn > SHARP))
    if len(ends) < 2:  # a closed curve is made of two
        ends |= {points[:, 0].argmin(), points[:, 0].argmax()}
    ends = sorted(ends)
    pieces = [
        np.roll(points, -first, axis=0)[: (last - first) % len(points) + 1]
        for first, last in zip(ends, np.roll(ends, -1), strict=True)
    ]
    return points, sizes, pieces


def cases() -> Iterator[Case]:
    """Yield the cases: airfoils and what alsph carries of them, plates, a square and a circle."""
    lift = ((0.3, 0.8), (0.4, 1.0), (0.6, 1.5))
    for angle, reynolds, windows in ((0, 100.0, (STEADY, (0.6, 1.5))), (10, 500.0, lift)):
        for resolution in (None, 20, 40, 80):
            case = Body(shape="naca0012", angle_of_attack=angle, resolution=resolution or 20)
            outline, suffix = (case.carried[0], f"_carried_{resolution}") if resolution else (case.outline, "")
            name = f"naca0012_{angle}{suffix}"
            yield Case(
                name, outline, (4, 3, 1.6), windows, reynolds, symmetric=angle == 0, step=0.001 if angle else 0.002
            )
    yield Case("square", shapely.box(-0.5, -0.5, 0.5, 0.5), (5, 4, 2), ((2.0, 3.0),))
    yield Case("circle", shapely.Point(0, 0).buffer(0.5, quad_segs=64), (6, 5, 2), ((1.5, 3.0),))
    for channel in ((5, 4, 2), (6, 5, 2)):
        for thickness in (0.25, 0.3, 0.4, 0.2, 0.1, 0.04):
            outline = shapely.box(-thickness / 2, -0.5, thickness / 2, 0.5)
            name = f"plate_{thickness}_{channel[0]}x{channel[1]}"
            step = 0.004 if thickness >= 0.2 else 0.002
            yield Case(name, outline, channel, ((0.8, 0.8), (1.2, 3.0)), step=step)


def rows(case: Case) -> Iterator[list[object]]:
    """Yield the row of each window: means, and by how much they move."""
    length, *others = case.channel
    coarse = case.loads(4, case.step)
    best, finer = case.loads(5, case.step), case.loads(4, case.step / 2)
    longer = replace(case, channel=(length + LONGER, *others)).loads(4, case.step)
    changes = [best - coarse, finer - coarse, longer - coarse]
    for window, values, order, step, outlet in zip(case.windows, best, *changes, strict=True):
        parts = np.delete(order, WHOLE)
        moved = [abs(change).max() for change in (order[WHOLE], parts, step[WHOLE], outlet[WHOLE])]
        figures = [f"{figure:.5f}" for figure in (*values, *moved)]
        yield [case.name, f"{case.reynolds:g}", *case.channel, *window, *figures]


def check() -> None:
    """Print the loads on a cylinder at Re = 20 beside those known.

    It is the benchmark 2D-1 of Schäfer and Turek, Notes Numer. Fluid Mech. 52 (1996) 547, with no slip on the sides;
    values of Nabh, On high order methods for the stationary incompressible Navier-Stokes equations, Heidelberg 1998.
    """
    channel, disc = occ.MoveTo(0, 0).Rectangle(22, 4.1).Face(), occ.Circle((2, 2), 0.5).Face()
    for edge in channel.edges:  # the profile is zero on the sides
        edge.name = "outlet" if abs(edge.center.x - 22) < 1e-6 else "inlet"
    disc.edges.name, disc.edges.maxh = "body", 0.1
    mesh = ng.Mesh(occ.OCCGeometry(channel - disc, dim=2).GenerateMesh(maxh=0.6, grading=0.25)).Curve(6)
    flow = Flow(mesh, 20, 5, (6 * ng.y * (4.1 - ng.y) / 4.1**2, 0))
    flow.settle()
    drag, _, _, lift, _, _ = flow.loads()
    print(f"C_D = {drag:.7f} (known: 5.5795352), C_L = {lift:.7f} (0.0106189)")


def main() -> None:
    """Solve the cases named, or all, and append a row to the table for each window."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="cases to solve (all)")
    parser.add_argument("-o", "--output", type=Path, default=Path("bodies.csv"), help="file to write (%(default)s)")
    parser.add_argument("--check", action="store_true", help="only compute a cylinder whose loads are known")
    options = parser.parse_args()
    if options.check:
        check()
        return
    chosen = [case for case in cases() if not options.names or case.name in options.names]
    with options.output.open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerow(COLUMNS)
        for case in chosen:
            csv.writer(file, lineterminator="\n").writerows(rows(case))
            file.flush()


if __name__ == "__main__":
    main()
