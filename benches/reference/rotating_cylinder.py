"""Loads on a cylinder that rotates in a stream, by finite elements: the reference of the case `rotating_cylinder`.

Means over t* = 2 to 4 after the impulsive start, and over the last four periods before t* = 60, or the steady flow's.
Each flow is solved four times: with velocities of order 5, then of order 4, then with half the time step, and in a
channel with the outlet farther away (periods with order 4, then 3); the table has the first and what the others change.

    python -m venv fem && fem/bin/pip install ngsolve .
    fem/bin/python benches/reference/rotating_cylinder.py -o rotating_cylinder.csv [--periods]
"""

from __future__ import annotations

import argparse
import csv
from dataclasses import dataclass, replace
from pathlib import Path

import ngsolve as ng
import numpy as np
from finite_elements import Flow, past_cylinder

EARLY, UNTIL, PERIODS, DOUBLINGS, LONGER = (2.0, 4.0), 60.0, 4, 7, 4.0
LOADS = ["CD_mean", "CDp", "CDf", "CL_mean", "CLp", "CLf", "torque"]
FOUND = [*LOADS, "CL_rms", "CL_amp", "St_fD_over_U"]
CHANGES = ["moved_by_order", "moved_by_step", "moved_by_outlet"]
COLUMNS = ["flow", "Re", "speed", "L_over_D", "H_over_D", "LU_over_D", *FOUND, *CHANGES]


@dataclass(frozen=True)
class Stream:
    """A cylinder in a channel whose surface goes round, counterclockwise, at `speed` [U]."""

    speed: float
    channel: tuple[float, float, float]  # length, height, upstream [D]
    reynolds: float = 100.0

    def mesh(self) -> ng.Mesh:
        """Return the channel around the cylinder."""
        return past_cylinder(self.channel, (-2, 3.5), 0.25, curve=6)

    def history(self, until: float, order: int, step: float) -> np.ndarray:
        """Return the columns time, loads and torque (8, n) of a flow that is U everywhere at t* = 0."""
        x, y = ng.x - self.channel[2], ng.y
        surface = ng.CoefficientFunction((-2 * self.speed * y, 2 * self.speed * x))
        flow = Flow(self.mesh(), self.reynolds, order, surface=surface)
        flow.velocity.Set(ng.CoefficientFunction((1, 0)))
        turn = flow.shift((-y, x))
        return np.array([(time, *flow.loads(), 0.5 * flow.push(turn)) for time in flow.march(until, step, DOUBLINGS)]).T

    def early(self, order: int, step: float) -> np.ndarray:
        """Return the means over the window after the start."""
        time, *loads = self.history(EARLY[1], order, step)
        at = np.linspace(*EARLY, 401)
        means = [np.trapezoid(np.interp(at, time, load), at) / (EARLY[1] - EARLY[0]) for load in loads]
        return np.array([*means, np.nan, np.nan, np.nan])

    def periodic(self, order: int, step: float) -> np.ndarray:
        """Return means over the last periods, root mean square of the lift, amplitude of its fundamental, frequency."""
        time, *loads = (column[len(column) // 2 :] for column in self.history(UNTIL, order, step))
        lift = loads[3] - loads[3].mean()
        rises = np.flatnonzero((lift[:-1] < 0) & (lift[1:] >= 0))
        if np.ptp(lift) < 1e-4:
            return np.array([*(load[-1] for load in loads), abs(loads[3][-1]), 0.0, np.nan])
        if len(rises) <= PERIODS:
            raise SystemExit(f"fewer than {PERIODS} periods in the later half: raise UNTIL")
        crossings = time[rises] - lift[rises] * (time[rises + 1] - time[rises]) / (lift[rises + 1] - lift[rises])
        first, last = crossings[-1 - PERIODS], crossings[-1]
        at = np.linspace(first, last, 6001)[:-1]
        loads = np.array([np.interp(at, time, load) for load in loads])
        amplitude = 2 * abs(np.mean(loads[3] * np.exp(2j * np.pi * PERIODS * (at - first) / (last - first))))
        root = np.sqrt(np.mean(loads[3] ** 2))
        return np.array([*loads.mean(axis=1), root, amplitude, PERIODS / (last - first)])


def row(stream: Stream, *, periods: bool, step: float) -> list[str]:
    """Return a row of the table."""
    solve = Stream.periodic if periods else Stream.early
    coarse, fine = (3, 4) if periods else (4, 5)
    length, *others = stream.channel
    best, lower = solve(stream, fine, step), solve(stream, coarse, step)
    changed = [
        best,
        solve(stream, coarse, step / 2),
        solve(replace(stream, channel=(length + LONGER, *others)), coarse, step),
    ]
    moved = [f"{np.abs((other - lower)[[0, 3, 6]]).max():.5f}" for other in changed]
    given = [stream.reynolds, stream.speed, *stream.channel]
    return [
        "developed" if periods else "start",
        *(f"{value:g}" for value in given),
        *(f"{value:.5f}" for value in best),
        *moved,
    ]


def main() -> None:
    """Solve all flows, and append a row to the table for each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=Path("rotating_cylinder.csv"), help="(%(default)s)")
    parser.add_argument("--periods", action="store_true", help="the flow that has developed (hours)")
    parser.add_argument(
        "--step", type=float, default=0.005, help="[D/U], over the speed of the surface [U] (%(default)s)"
    )
    options = parser.parse_args()
    flows = [Stream(1.0, (14, 13, 4))]
    if not options.periods:
        flows += [Stream(2.0, (14, 13, 4)), Stream(1.0, (8, 6, 3))]
    new = not options.output.exists()
    with options.output.open("a", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        if new:
            writer.writerow(COLUMNS)
        for stream in flows:
            writer.writerow(row(stream, periods=options.periods, step=options.step / stream.speed))
            file.flush()


if __name__ == "__main__":
    main()
