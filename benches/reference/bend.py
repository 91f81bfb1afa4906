"""The pressure that a plane bend costs beyond a straight channel, by finite elements: the reference of the case `bend`.

It needs an environment of its own:

    python -m venv fem && fem/bin/pip install ngsolve numpy
    fem/bin/python benches/reference/bend.py > bend_pressure.csv
"""

import argparse
import math

import netgen.occ as occ
import ngsolve as ng
import numpy as np
from finite_elements import Flow

UPSTREAM, BEFORE, DEVELOPING = 4.0, 2.5, 0.15
"""Length of the inlet channel and how far before the bend the pressure is taken [D]; of the outlet channel over Re."""
SHARP = 0.002
"""Size of the elements at a sharp inner edge [D]."""


def mesh(radius: float, downstream: float, size: float) -> ng.Mesh:
    """Return the channel, with its inlet on the left and its outlet at the top."""
    outer = radius + 1
    sector = occ.Circle((0, 0), outer).Face() * occ.MoveTo(0, -outer).Rectangle(outer, outer).Face()
    if radius:
        sector -= occ.Circle((0, 0), radius).Face()
    inlet = occ.MoveTo(-UPSTREAM, -outer).Rectangle(UPSTREAM, 1).Face()
    outlet = occ.MoveTo(radius, 0).Rectangle(1, downstream).Face()
    domain = occ.Glue([sector, inlet, outlet])
    for edge in domain.edges:
        x, y = edge.center.x, edge.center.y
        inner = (abs(x) < 1e-6 and abs(y + radius + 0.5) < 1e-6) or (abs(y) < 1e-6 and abs(x - radius - 0.5) < 1e-6)
        ends = "inlet" if abs(x + UPSTREAM) < 1e-6 else "outlet" if abs(y - downstream) < 1e-6 else ""
        edge.name = "within" if inner else ends or "body"
    for vertex in domain.vertices:
        if not radius and abs(vertex.p.x) + abs(vertex.p.y) < 1e-6:
            vertex.maxh = SHARP
    return ng.Mesh(occ.OCCGeometry(domain, dim=2).GenerateMesh(maxh=size, grading=0.3)).Curve(6)


def excess(radius: float, reynolds: float, order: int = 4, size: float = 0.15) -> float:
    """Return the pressure drop [ρU²] beyond that of a straight channel."""
    downstream = 6 + DEVELOPING * reynolds
    share = ng.y + radius + 1
    flow = Flow(mesh(radius, downstream, size), reynolds, order, (6 * share * (1 - share), 0))
    flow.settle()
    places, weights = np.polynomial.legendre.leggauss(24)
    places, weights, behind = (places + 1) / 2, weights / 2, downstream - 2
    before = [flow.pressure(flow.mesh(-BEFORE, place - radius - 1)) for place in places]
    after = [flow.pressure(flow.mesh(radius + place, behind)) for place in places]
    straight = 12 / reynolds * (BEFORE + math.pi / 2 * (radius + 0.5) + behind)
    return float(weights @ np.subtract(before, after) - straight)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--order", type=int, default=4, help="of the velocity's elements (%(default)s)")
    parser.add_argument("--size", type=float, default=0.15, help="of the elements [D] (%(default)s)")
    parser.add_argument("--radii", type=float, nargs="+", default=[0.0, 0.5, 1.0, 2.0], help="R/D")
    options = parser.parse_args()
    print("Re,R_over_D,excess")
    for radius in options.radii:
        for reynolds in (1.0, 10.0, 50.0):
            value = excess(radius, reynolds, options.order, options.size)
            print(f"{reynolds:g},{radius:g},{value:.5f}", flush=True)
