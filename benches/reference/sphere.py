"""Drag of a sphere in a channel that lets slip, by finite elements: the reference of the case `sphere`.

The channel is round, of the length and the area of the case's, which is square; the flow is the same all around its
axis, as the steady one is up to Re = 210. What the sides do to the drag is some 1 % in a channel of 6 D by 6 D; to a
small sphere a square channel does 1.5 % more than a round one of its area (Pankhurst and Holder, Wind-Tunnel Technique,
1952), so the form does not matter. A row of the table is of order 5; the last columns say by how much order 4, and an
outlet 4 D farther away, move the drag. A line says what a sphere far from all sides has, which others know.
It needs an environment of its own:

    python -m venv fem && fem/bin/pip install ngsolve .
    fem/bin/python benches/reference/sphere.py -o sphere_channel.csv
    fem/bin/python benches/reference/sphere.py --start      # the drag after an impulsive start, Re = 100
"""

from __future__ import annotations

import argparse
import csv
import math
from pathlib import Path

import netgen.occ as occ
import ngsolve as ng
import numpy as np
from finite_elements import Flow

AREA = math.pi / 4
CHANNELS = ((9.0, 6.0, 6.0, 3.0), (9.0, 10.0, 10.0, 3.0))  # length, height, width, upstream [D]
FAR = (30.0, 20.0, 20.0, 10.0)
NUMBERS = (20.0, 50.0, 100.0, 150.0, 200.0)
LONGER = 4.0  # the channel, to see what the outlet does [D]
WINDOW = (5.0, 10.0)  # to average over after the start [D/U]
STEP, DOUBLINGS = 0.005, 6  # [D/U]
COLUMNS = ["Re", "L_over_D", "H_over_D", "W_over_D", "LU_over_D", "CD_mean", "CDp", "CDf"]


def mesh(channel: tuple[float, ...]) -> ng.Mesh:
    """Return half of the section through the axis, y = 0, of the round channel."""
    length, height, width, upstream = channel
    radius = math.sqrt(height * width / math.pi)
    whole = occ.MoveTo(0, 0).Rectangle(length, radius).Face()
    for edge in whole.edges:
        at = edge.center.x
        edge.name = "inlet" if abs(at) < 1e-6 else "outlet" if abs(at - length) < 1e-6 else "side"
    behind = occ.MoveTo(upstream - 1, 0).Rectangle(length - upstream + 1, 1.0).Face()
    near, disc = (occ.Circle((upstream, 0), reach).Face() for reach in (1.0, 0.5))
    behind.faces.maxh, near.faces.maxh = 0.25, 0.12
    disc.edges.name, disc.edges.maxh = "body", 0.06
    behind, near = (part * whole for part in (behind, near))
    parts = occ.Glue([whole - behind - near - disc, behind - near - disc, near - disc])
    for edge in parts.edges:
        if abs(edge.center.y) < 1e-9:
            edge.name = "side"
    return ng.Mesh(occ.OCCGeometry(parts, dim=2).GenerateMesh(maxh=0.6, grading=0.3)).Curve(6)


def loads(channel: tuple[float, ...], reynolds: float, order: int) -> np.ndarray:
    """Return C_D, its pressure and its viscous part in steady flow."""
    flow = Flow(mesh(channel), reynolds, order, round=True)
    flow.settle()
    return np.array(flow.loads()[:3]) / AREA


def after_the_start(reynolds: float, order: int = 3) -> np.ndarray:
    """Return the mean loads over the window after an impulsive start, in the case's own channel."""
    flow = Flow(mesh(CHANNELS[0]), reynolds, order, round=True)
    flow.velocity.Set(ng.CoefficientFunction((1, 0)))
    history = [flow.loads()[:3] for time in flow.march(WINDOW[1], STEP, DOUBLINGS) if time > WINDOW[0]]
    return np.mean(history, axis=0) / AREA


def main() -> None:
    """Write a row of the table for each channel and Reynolds number."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=Path("sphere_channel.csv"), help="(%(default)s)")
    parser.add_argument("--start", action="store_true", help="the mean over t* = 5 to 10 after the start instead")
    options = parser.parse_args()
    if options.start:
        print(" ".join(f"{each:.4f}" for each in after_the_start(100.0)))
        return
    with options.output.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*COLUMNS, "moved_by_order", "moved_by_outlet"])
        for channel in CHANNELS:
            length, *others = channel
            for reynolds in NUMBERS:
                best, coarse = (loads(channel, reynolds, order) for order in (5, 4))
                longer = loads((length + LONGER, *others), reynolds, 4)
                moved = [f"{abs(other[0] - coarse[0]):.5f}" for other in (best, longer)]
                writer.writerow([f"{reynolds:g}", *(f"{of:g}" for of in channel), *(f"{c:.5f}" for c in best), *moved])
                file.flush()
    print("Re = 100, far from all sides:", " ".join(f"{each:.4f}" for each in loads(FAR, 100.0, 3)))


if __name__ == "__main__":
    main()
