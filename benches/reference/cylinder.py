"""Compare the whole flow past the cylinder, not only its forces, with finite elements from a common start.

`solve` computes the flow at Re = 200 in the paper's channel with NGSolve (`finite_elements.py`), started as the case
is; it needs an environment of its own. `compare` starts alsph with that field at t* = 2, when the boundary layers are
there and the pressure waves of the impulsive start are not, and prints at every half time unit forces, those of the
reference in brackets, and errors of the velocity within 2 D of the centre; at the end errors at the particles beside
the cylinder, by layers, 40 to 100 degrees from the front, and of the mean C_p on rings around it, with what pushes
beside p and without.

    python -m venv fem && fem/bin/pip install ngsolve scipy
    fem/bin/python benches/reference/cylinder.py solve --until 6 --resolutions 20 30 -o fields.npz
    python benches/reference/cylinder.py compare fields.npz --resolution 20 [--set wall_velocity=adami viscous_order=2]
"""

from __future__ import annotations

import argparse
import itertools
import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import RegularGridInterpolator

if TYPE_CHECKING:
    from alsph import Simulation

REYNOLDS, LENGTH, HEIGHT, UPSTREAM, RADIUS, PERTURBATION = 200.0, 14.0, 13.0, 4.0, 0.5, 0.1
START, EVERY = 2.0, 0.5
SPACING, REACH = 0.05, 2.0  # of the points of comparison: spacing, distance from the centre
RADII, ANGLES = np.linspace(0.502, 1.0, 167), np.radians(np.linspace(-180, 180, 181))  # of a net around the cylinder
NET_FROM, NET_EVERY = 3.0, 0.1
LAYERS = (0, 1, 2, 3, 4, 6, 8)  # heights over the surface [Δx] between which errors are averaged
SIDE = np.radians((40, 100))  # from the front
HEIGHTS = (0.05, 0.5, 1, 2, 3, 4, 6, 8)  # of rings over the surface [Δx]


def cell_centres(resolution: int) -> np.ndarray:
    """Cell centres (n, 2) of the channel, those of alsph's lattice."""
    x, y = (np.arange(round(size * resolution)) + 0.5 for size in (LENGTH, HEIGHT))
    return np.stack(np.meshgrid(x / resolution, y / resolution - HEIGHT / 2, indexing="ij"), axis=-1).reshape(-1, 2)


def comparison_points() -> np.ndarray:
    """Points (n, 2) around the cylinder, none nearer to it than 0.05 D."""
    line = np.arange(-REACH, REACH + SPACING / 2, SPACING)
    points = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)
    distance = np.hypot(*points.T)
    return points[(distance > RADIUS + 0.05) & (distance < REACH)] + (UPSTREAM, 0)


def solve(until: float, resolutions: list[int], output: Path, step: float = 0.002) -> None:
    """Write the forces, the velocity at the points of comparison, and at t* = 2 the fields at the cell centres."""
    import ngsolve as ng
    from finite_elements import Flow, past_cylinder

    mesh = past_cylinder((LENGTH, HEIGHT, UPSTREAM), (-1.5, 3), 0.22, curve=5)
    x, y = (ng.x - UPSTREAM) / 0.6, ng.y / 0.6
    swirl = PERTURBATION * ng.exp(0.5 * (1 - x * x - y * y))
    flow = Flow(mesh, REYNOLDS)
    flow.velocity.Set(ng.CoefficientFunction((1 - swirl * y, swirl * x)))

    def at(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found = mesh(np.clip(points[:, 0], 1e-6, LENGTH - 1e-6), points[:, 1])
        return np.array(flow.velocity(found)), np.array(flow.pressure(found)).ravel()

    saved: dict[str, np.ndarray] = {}
    history, snapshots, net_times, net, points_compared = [], [], [], [], comparison_points()
    radii, angles = np.meshgrid(RADII, ANGLES, indexing="ij")
    around = np.stack([UPSTREAM - radii * np.cos(angles), radii * np.sin(angles)], axis=-1).reshape(-1, 2)
    for n, time in enumerate(flow.march(until, step), start=1):
        if n % 10 == 0:
            _, *parts, lift, _, _ = flow.loads()
            history.append([time, *parts, lift])
        if n % round(EVERY / step) == 0:
            snapshots.append((time, at(points_compared)[0]))
            print(
                f"t* = {time:.1f}: C_D = {history[-1][1]:.4f} + {history[-1][2]:.4f}, C_L = {history[-1][3]:+.4f}",
                flush=True,
            )
        if time > NET_FROM - step / 2 and n % round(NET_EVERY / step) == 0:
            net_times.append(time)
            net.append(np.column_stack(at(around)).reshape(*radii.shape, 3))
        if n == round(START / step):
            for resolution in resolutions:
                points = cell_centres(resolution)
                outside = np.hypot(*(points - (UPSTREAM, 0)).T) >= RADIUS
                # Chords of the curved mesh leave a sliver of the fluid outside of it.
                offset = points[outside] - (UPSTREAM, 0)
                radius = np.hypot(*offset.T)[:, None]
                values = at(offset * np.maximum(radius, RADIUS + 2e-3) / radius + (UPSTREAM, 0))
                fields = np.full((len(points), 3), np.nan)
                fields[outside] = np.column_stack(values)
                saved[f"start_{resolution}"] = fields
    times, fields = zip(*snapshots, strict=True)
    np.savez_compressed(output, history=history, times=times, velocity=fields, net_times=net_times, net=net, **saved)


def compare(path: Path, resolution: int, until: float, settings: dict[str, object]) -> None:
    """Print forces and velocity errors of alsph against the fields in `path`."""
    from alsph.analysis.sampling import interpolate
    from alsph.cases import Cylinder
    from alsph.geometry.particles import Kind

    fields = np.load(path)
    start = fields[f"start_{resolution}"].reshape(round(LENGTH * resolution), round(HEIGHT * resolution), 3)

    class Started(Cylinder):
        """The cylinder with the reference's velocity and pressure."""

        def particles(self) -> dict[str, np.ndarray]:
            arrays = super().particles()
            fluid = arrays["kind"] == Kind.FLUID
            cell = np.floor((arrays["position"][fluid] + (0, HEIGHT / 2)) * resolution).astype(int)
            arrays["velocity"][fluid], arrays["pressure"][fluid] = start[*cell.T, :2], start[*cell.T, 2]
            return arrays

    case = Started(resolution=resolution, reynolds=REYNOLDS, **settings)
    simulation = case.simulation()
    points = comparison_points()
    times, known, net = fields["times"], fields["history"], dict(zip(fields["net_times"], fields["net"], strict=True))
    beside, rings = [], []
    print("t*     C_D pressure         C_D viscous          C_L                  rms error of u, v [U]")
    velocities = dict(zip(times, fields["velocity"], strict=True))
    for time in sorted({*times[times > START], *net}):
        if time > until + NET_EVERY / 2:
            break
        simulation.run_until(time - START)
        state = simulation.snapshot()
        if time in net:
            beside.append(errors_beside(state, net[time], resolution))
            kept = case.restored({k: v for k, v in simulation.state().items() if k != "unkept_pressure"})
            rings.append([errors_around(each, net[time], resolution) for each in (simulation, kept)])
        if time not in velocities:
            continue
        expected, history = velocities[time], simulation.history()
        fluid = state["kind"] == Kind.FLUID
        found, _ = interpolate(state["position"][fluid], state["velocity"][fluid], points, 1 / resolution)
        error = np.sqrt(((found - expected) ** 2).mean(axis=0))
        row = f"{time:3.1f}"
        names = ("drag_pressure", "drag_viscous", "lift_coefficient")
        for column, name in enumerate(names, start=1):
            ours = history[name][history["time"] > time - START - EVERY / 2].mean()
            theirs = known[(known[:, 0] > time - EVERY / 2) & (known[:, 0] <= time), column].mean()
            row += f"   {ours:+.4f} ({theirs:+.4f})"
        print(row, "  {:.4f} {:.4f}".format(*error), flush=True)
    if beside:
        print("height [Δx]  mean errors of u along and off the surface [U], and of C_p less its median from 0.3 D on")
        found = np.concatenate(beside)
        for low, high in itertools.pairwise(LAYERS):
            within = (found[:, 0] >= low) & (found[:, 0] < high)
            print(f"{low} to {high}      ", " ".join(f"{value:+.3f}" for value in found[within, 1:].mean(axis=0)))
        print("height [Δx]  rms error around the cylinder of the mean C_p, and by p alone")
        for height, around in zip(HEIGHTS, np.moveaxis(np.mean(rings, axis=0), 1, 0), strict=False):
            print(f"{height:<12g}", " ".join(f"{value:.4f}" for value in np.sqrt((around**2).mean(axis=1))))


def errors_beside(state: dict[str, np.ndarray], net: np.ndarray, resolution: int) -> np.ndarray:
    """Heights [Δx] of the particles at the cylinder's sides, and errors of u along and off the surface and of C_p."""
    from alsph.geometry.particles import Kind

    offset = state["position"] - (UPSTREAM, 0)
    radius, angle = np.hypot(*offset.T), np.arctan2(offset[:, 1], -offset[:, 0])
    near = (state["kind"] == Kind.FLUID) & (radius > RADII[0]) & (radius < RADII[-1])
    radius, angle = radius[near], angle[near]
    known = RegularGridInterpolator((RADII, ANGLES), net, method="cubic")(np.column_stack([radius, angle]))
    velocity = state["velocity"][near] - known[:, :2]
    pressure = 2 * (state["pressure"][near] - known[:, 2])
    # Waves between inlet and outlet lift the pressure of all.
    pressure -= np.median(pressure[radius > 0.8 * RADII[-1]])
    cosine, sine = np.cos(angle), np.sin(angle)
    along = np.sign(angle) * (velocity[:, 0] * sine + velocity[:, 1] * cosine)
    off = velocity[:, 1] * sine - velocity[:, 0] * cosine
    errors = np.column_stack([(radius - RADIUS) * resolution, along, off, pressure])
    return errors[(np.abs(angle) > SIDE[0]) & (np.abs(angle) < SIDE[1])]


def errors_around(simulation: Simulation, net: np.ndarray, resolution: int) -> np.ndarray:
    """Errors of C_p (heights, angles) on rings within the net, less their median on the outermost."""
    radii = [radius for height in HEIGHTS if (radius := RADIUS + height / resolution) < RADII[-1]]
    radius, angle = np.meshgrid(radii, ANGLES, indexing="ij")
    points = np.stack([UPSTREAM - radius * np.cos(angle), radius * np.sin(angle)], axis=-1).reshape(-1, 2)
    polar = np.column_stack([radius.ravel(), angle.ravel()])
    known = RegularGridInterpolator((RADII, ANGLES), net[..., 2], method="cubic", bounds_error=False, fill_value=None)
    error = 2 * (simulation.sample(points)["pressure"] - known(polar)).reshape(radius.shape)
    return error - np.median(error[-1])


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    solving = commands.add_parser("solve", help="compute the reference with NGSolve")
    solving.add_argument("--until", type=float, default=6.0, help="end time [D/U] (%(default)s)")
    solving.add_argument("--resolutions", type=int, nargs="+", default=[20], help="D/Δx to give start fields for (20)")
    solving.add_argument("-o", "--output", type=Path, default=Path("fields.npz"), help="file to write (%(default)s)")
    comparing = commands.add_parser("compare", help="run alsph from the reference's field at t* = 2")
    comparing.add_argument("fields", type=Path, help="the file that `solve` wrote")
    comparing.add_argument("--resolution", type=int, default=20, help="D/Δx, one of those solved for (%(default)s)")
    comparing.add_argument("--until", type=float, default=4.0, help="end time [D/U] (%(default)s)")
    comparing.add_argument("--set", nargs="*", default=[], metavar="NAME=VALUE", help="parameters of the case")
    options = parser.parse_args()
    if options.command == "solve":
        solve(options.until, options.resolutions, options.output)
        return
    settings = {}
    for name, value in (item.split("=", 1) for item in options.set):
        try:
            settings[name] = json.loads(value)
        except ValueError:
            settings[name] = value
    compare(options.fields, options.resolution, options.until, settings)


if __name__ == "__main__":
    main()
