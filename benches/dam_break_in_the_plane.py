"""What the dam breaks against boxes miss, in the plane, where it costs little.

`box`: the column of Kleefsman et al. (2005) against their box: mean pressures at the heights of its four sensors, and
the mean force on it, over t = 1.6 to 3. `back`: the column of Yeh and Petroff, without their structure, between slip
walls and walls that water sticks to: when the wave comes back to the structure's place, and with what momentum.

    python benches/dam_break_in_the_plane.py box --resolution 20 40 80 [--scheme isph]
    python benches/dam_break_in_the_plane.py back --resolution 20
"""

import argparse
from typing import Any, ClassVar

import numpy as np
import shapely
from alsph import Domain, SolidBody
from alsph.cases import DamBreak, FreeSurface
from alsph.cases.dam_break import column_pressure
from alsph.cases.dam_break_obstacle import DEPTH, DamBreakObstacle
from alsph.cases.sensors import WallSensors
from alsph.geometry.lattice import cell_centres, lattice
from alsph.geometry.particles import Kind, join
from alsph.geometry.solids import body_layers
from numpy.typing import NDArray

START, END, INTERVAL = 1.6, 3.0, 0.02
HEIGHTS = np.array([0.021, 0.061, 0.101, 0.141]) / DEPTH


class BoxInThePlane(FreeSurface):
    """The middle plane of the dam break against a box."""

    splashes: ClassVar[bool] = True

    @property
    def edges(self) -> NDArray[Any]:
        """Left, right and upper edge of the box [H]."""
        (left, _, _), (right, _, top) = DamBreakObstacle.corners
        return self.whole([left, right, top])

    def domain(self) -> Domain:
        """Return the tank, whose top is open."""
        return Domain((0, 0), (float(self.whole(DamBreakObstacle.tank[0])), 3), [("slip", "slip"), ("slip", "air")])

    def bodies(self) -> list[SolidBody]:
        """Return the box."""
        left, right, _ = self.edges
        return [SolidBody("box", ((left + right) / 2, 0.0))]

    def particles(self) -> dict[str, NDArray[Any]]:
        """Return the column and the box, whose layers end at the floor."""
        spacing, length = self.particle_spacing, DamBreakObstacle.column
        columns = round(float(self.whole(length)) / spacing)
        position = lattice(cell_centres(columns, spacing), cell_centres(self.resolution, spacing))
        pressure = column_pressure(position[:, 0], position[:, 1], length)
        left, right, top = self.edges
        box = body_layers(shapely.box(left, -8 * spacing, right, top), spacing, self.support_layers)
        return join(
            self.fluid(position, np.zeros_like(position), pressure), box.where(box.position[:, 1] > 0).particles()
        )


def box(resolution: int, scheme: str) -> str:
    """Return the means at the sensors and the force."""
    case = BoxInThePlane(resolution=resolution, scheme=scheme)
    face = np.array([-1.0, 0])
    places = {f"P{number}": (np.array([case.edges[0], height]), face) for number, height in enumerate(HEIGHTS, 1)}
    sensors = WallSensors(places, 0, np.zeros(2), case.particle_spacing)
    simulation = case.simulation(threads=1)
    rows = []
    for time in np.arange(INTERVAL, END + INTERVAL / 2, INTERVAL):
        simulation.run_until(time)
        rows.append([simulation.time, *sensors.values(simulation)])
    found, history = np.array(rows), simulation.history()
    means = found[found[:, 0] > START, 1:].mean(axis=0)
    late = history["time"] > START
    force = np.average(history["pressure_force"][late, 0, 0], weights=history["time_step"][late])
    return f"{scheme}, H/Δx = {resolution}: P1 to P4 {means.round(3)} ρgH, force {force:.4f} ρgH²"


def back(resolution: int, **changes: Any) -> str:
    """Return when the water comes back with 0.3 √(gH), 3 H from the end wall behind it, and its momentum then."""
    case = DamBreak(resolution=resolution, length=1.35, tank_length=5.35, **changes)
    simulation = case.simulation(threads=1)
    rows = []
    for time in np.arange(0.1, 9.01, 0.1):
        simulation.run_until(time)
        state = simulation.state()
        near = (state["kind"] == Kind.FLUID) & (np.abs(state["position"][:, 0] - 3) < 0.15)
        depth = near.sum() / resolution**2 / 0.3
        velocity = state["velocity"][near, 0].mean() if near.any() else 0.0
        rows.append([simulation.time, velocity, depth * velocity * abs(velocity)])
    time, velocity, momentum = np.array(rows)[40:].T
    first = time[velocity < -0.3][:1]
    return f"{changes or 'slip walls'}: back at {first}, largest depth times velocity squared {-momentum.min():.4f} gH²"


def main() -> None:
    """Print one of the two."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["box", "back"])
    parser.add_argument("--resolution", type=int, nargs="+", default=[20], help="H/Δx (%(default)s)")
    parser.add_argument("--scheme", default="alsph", help="of box (%(default)s)")
    options = parser.parse_args()
    sticking: list[dict[str, Any]] = [{"walls": "solid", "reynolds": number} for number in (1e4, 3e3, 1e3)]
    for resolution in options.resolution:
        if options.what == "box":
            print(box(resolution, options.scheme), flush=True)
        else:
            for changes in ({}, *sticking):
                print(back(resolution, **changes), flush=True)


if __name__ == "__main__":
    main()
