"""Loads on a cylinder between no-slip sides, by finite elements: the reference of the case `confined_cylinder`.

The flows are the benchmarks 2D-1 (Re = 20, steady) and 2D-2 (Re = 100, shedding) of Schäfer and Turek, Notes Numer.
Fluid Mech. 52 (1996) 547: a channel 22 D long and 4.1 D high, the cylinder 2 D behind the inlet and 0.05 D below the
centre line. They found a largest drag coefficient of 3.22 to 3.24, a largest lift coefficient of 0.99 to 1.01 and a
Strouhal number of 0.295 to 0.305 for 2D-2. A row of the table holds what the higher order has, 5 in the steady flow, 4
with shedding; the last columns say by how much order and half the time step (with order 3) move drag and lift. Flows
that shed go on from one of order 3 that has developed; means are those of the last periods.

    python -m venv fem && fem/bin/pip install ngsolve .
    fem/bin/python benches/reference/confined_cylinder.py -o cylinder_confined.csv
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

import ngsolve as ng
import numpy as np
from finite_elements import Flow, past_cylinder

CHANNEL, OFFSET = (22.0, 4.1, 2.0), -0.05  # length, height, upstream; the centre above the channel's [D]
DEVELOPED, AFTER, PERIODS, DOUBLINGS = 45.0, 22.0, 5, 5
STEP = 0.005  # [D/U]; that of order 4 is half of it
CHOICES = ((3, STEP), (3, STEP / 2), (4, STEP / 2))
FOUND = ["CD_mean", "CDp", "CDf", "CL_mean", "CL_rms", "CL_amp", "St_fD_over_U", "CD_max", "CD_min", "CL_max", "CL_min"]
COLUMNS = ["Re", "LU_over_D", "L_over_D", "H_over_D", "offset_over_D", *FOUND, "moved_by_order", "moved_by_step"]


def flow(reynolds: float, order: int) -> Flow:
    """Return the flow at rest between the sides, with the parabola of the mean U at the inlet."""
    _, height, _ = CHANNEL
    mesh = past_cylinder(CHANNEL, (-1.2, 2.4), 0.3, curve=6, offset=OFFSET, sides="inlet")
    y = (ng.y + height / 2 + OFFSET) / height
    return Flow(mesh, reynolds, order, (6 * y * (1 - y), 0))


def steady(reynolds: float, order: int) -> np.ndarray:
    """Return what is found of the steady flow."""
    settled = flow(reynolds, order)
    settled.settle()
    drag, pressure, viscous, lift, *_ = settled.loads()
    return np.array([drag, pressure, viscous, lift, *[np.nan] * 7])


def developed(reynolds: float) -> Flow:
    """Return the flow of order 3 that sheds vortices."""
    found, height = flow(reynolds, 3), CHANNEL[1]
    y = (ng.y + height / 2 + OFFSET) / height
    found.velocity.Set(ng.CoefficientFunction((6 * y * (1 - y), 0)))
    for _ in found.march(DEVELOPED, STEP, DOUBLINGS):
        pass
    return found


def periodic(begun: Flow, reynolds: float, order: int, step: float) -> np.ndarray:
    """Return what is found of the last periods of a flow that sheds vortices, as it has begun."""
    further = flow(reynolds, order)
    further.velocity.Set(begun.velocity)
    history = np.array([(time, *further.loads()[:4]) for time in further.march(AFTER, step, DOUBLINGS)]).T
    time, drag, pressure, viscous, lift = history[:, history[0] > 1.0]
    about = lift - lift.mean()
    rises = np.flatnonzero((about[:-1] < 0) & (about[1:] >= 0))
    crossings = time[rises] - about[rises] * (time[rises + 1] - time[rises]) / (about[rises + 1] - about[rises])
    first, last = crossings[-1 - PERIODS], crossings[-1]
    at = np.linspace(first, last, 8001)[:-1]
    drag, pressure, viscous, lift = (np.interp(at, time, load) for load in (drag, pressure, viscous, lift))
    amplitude = 2 * abs(np.mean(lift * np.exp(2j * np.pi * PERIODS * (at - first) / (last - first))))
    means = [load.mean() for load in (drag, pressure, viscous, lift)]
    ends = [drag.max(), drag.min(), lift.max(), lift.min()]
    return np.array([*means, np.sqrt(np.mean(lift**2)), amplitude, PERIODS / (last - first), *ends])


def main() -> None:
    """Solve both flows, and write a row of the table for each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=Path("cylinder_confined.csv"), help="(%(default)s)")
    options = parser.parse_args()
    length, height, upstream = CHANNEL
    of = [FOUND.index(name) for name in ("CD_mean", "CL_mean")]
    with options.output.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for reynolds in (20, 100):
            if reynolds == 20:
                coarse, best = steady(reynolds, 4), steady(reynolds, 5)
                moved = [f"{np.abs((best - coarse)[of]).max():.6f}", ""]
            else:
                begun = developed(reynolds)
                coarse, finer, best = (periodic(begun, reynolds, *with_) for with_ in CHOICES)
                moved = [f"{np.abs((other - coarse)[of]).max():.6f}" for other in (best, finer)]
            found = ["" if np.isnan(value) else f"{value:.6f}" for value in best]
            writer.writerow([reynolds, upstream, length, height, OFFSET, *found, *moved])
            file.flush()


if __name__ == "__main__":
    main()
