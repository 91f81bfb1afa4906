"""The largest eigenvalue of a step beside a free surface: `python benches/step_matrix.py`, a quarter of an hour.

A square of 12 x 12 particles at rest in a tank of mirrors or of solids, without gravity; each velocity and pressure is
disturbed in turn, and what a step makes of it is a column of the matrix. No modulus may be above 1, but for single
precision. With `--weight` gravity acts, and the pressure is that of depth. `--set` changes settings of the engine:

    python benches/step_matrix.py --scheme isph --set scheme.pressure_share=0
    python benches/step_matrix.py --scheme explicit_isph --set scheme.sweeps=40 projection_sweeps=0
"""

import argparse
import functools
import itertools
import json
import operator
from typing import Any, ClassVar

import numpy as np
import shapely
from alsph import Domain, SolidBody
from alsph.cases import FreeSurface
from alsph.geometry.lattice import cell_centres, lattice
from alsph.geometry.particles import join
from alsph.geometry.solids import walls
from numpy.typing import NDArray

SIDE, SIZE = 12, 1e-5


class Square(FreeSurface):
    """Fluid in the lower half of a tank without gravity."""

    gravity: ClassVar[bool] = False
    tension: ClassVar[bool] = True
    changes: ClassVar[dict[str, Any]] = {}
    """Settings of the engine by their path, and their values."""
    solids: bool = False

    def domain(self) -> Domain:
        """Return the tank."""
        side = "none" if self.solids else "slip"
        return Domain((0, 0), (1, 2), [(side, side), (side, "air")])

    def settings(self) -> dict[str, Any]:
        """Return the engine's settings with the changes."""
        found = super().settings()
        for path, value in self.changes.items():
            *tables, name = path.split(".")
            table = functools.reduce(operator.getitem, tables, found)
            if name not in table:
                raise SystemExit(f"--set {path}: no such setting; there are {', '.join(table)}")
            table[name] = value
        return found

    def bodies(self) -> list[SolidBody]:
        """Return its walls."""
        return [SolidBody("tank", (0, 0))] if self.solids else []

    def particles(self) -> dict[str, NDArray[Any]]:
        """Return the square on its floor."""
        cells = cell_centres(SIDE, 1 / SIDE)
        position = lattice(cells, cells)
        pressure = 1 - position[:, 1] if self.gravity else np.zeros(len(position))
        fluid = self.fluid(position, np.zeros_like(position), pressure)
        tank = walls(shapely.box(0, 0, 1, 2), 1 / SIDE, self.support_layers)
        return join(fluid, tank.particles()) if self.solids else fluid


class Heavy(Square):
    """The same with its weight."""

    gravity: ClassVar[bool] = True


def radius(case: Square, disorder: float) -> float:
    """Return the largest modulus of an eigenvalue of a step, of particles displaced by up to `disorder` spacings."""
    simulation = case.simulation(threads=1)
    start = simulation.state()
    fluid = np.flatnonzero(start["kind"] == 0)
    start["position"][fluid] += np.random.default_rng(1).uniform(-disorder, disorder, (len(fluid), 2)) / SIDE

    def after(unknown: int, size: float) -> NDArray[Any]:
        state = {name: np.copy(values) if np.ndim(values) else values for name, values in start.items()}
        if unknown < 2 * len(fluid):
            state["velocity"][fluid[unknown // 2], unknown % 2] += size
        else:
            state["pressure"][fluid[unknown - 2 * len(fluid)]] += size
        simulation.restore(state)
        simulation.advance()
        end = simulation.state()
        order = np.argsort(end["id"])[np.argsort(np.argsort(start["id"]))][fluid]
        return np.concatenate([end["velocity"][order].ravel(), end["pressure"][order]])

    columns = [(after(k, SIZE) - after(k, -SIZE)) / (2 * SIZE) for k in range(3 * len(fluid))]
    return float(np.abs(np.linalg.eigvals(np.stack(columns, axis=1))).max())


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--weight", action="store_true", help="with gravity")
    parser.add_argument("--scheme", nargs="*", default=Square.schemes(), help="(all)")
    parser.add_argument("--set", nargs="*", default=[], metavar="NAME=VALUE", help="settings of the engine")
    options = parser.parse_args()
    model = Heavy if options.weight else Square
    model.changes = {path: json.loads(value) for path, _, value in (each.partition("=") for each in options.set)}
    for scheme, solids, gradient, disorder in itertools.product(
        options.scheme, (False, True), ("adjoint", "conservative"), (0.0, 0.1)
    ):
        # What a solve leaves is no linear function of the state.
        own = {"solver_tolerance": 1e-12} if scheme == "isph" else {}
        case = model(resolution=SIDE, solids=solids, pressure_gradient=gradient, scheme=scheme, **own)
        told = f"{scheme:13} {'solids' if solids else 'mirrors':8} {gradient:13} disorder {disorder:g}"
        print(f"{told}: radius - 1 = {radius(case, disorder) - 1:.1e}", flush=True)
