"""Time PySPH's dam break in alsph's tank and print one line of JSON. Runs in the environment that codes.py makes."""

import argparse
import json
import time

import numpy as np
from pysph.base.utils import get_particle_array
from pysph.examples import dam_break_2d as example
from pysph.tools.geometry import get_2d_block, get_2d_tank

UNIT = 1 / np.sqrt(9.81)
"""√(H/g) [s]."""

LENGTH = 5.366
"""Of the tank [H], H = 1 m; the column is 2H long."""

example.vref = np.sqrt(2 * 9.81)
example.co = 10 * example.vref


class DamBreak(example.DamBreak2D):
    """The example in that tank, with masses and smoothing lengths of its own spacing; it notes CPU time and front."""

    def create_particles(self):
        """Return the column and the tank, whose walls are half a spacing before their first particles."""
        dx = self.dx
        x, y = get_2d_block(dx=dx, length=2 - dx, height=1 - dx, center=[1 + dx / 2, 0.5 + dx / 2])
        tank = get_2d_tank(dx=dx, length=LENGTH + dx, height=2.5, base_center=[(LENGTH + dx) / 2, 0], num_layers=4)
        own = {"h": self.hdx * dx, "m": 1000 * dx**2, "rho": 1000}
        fluid = get_particle_array(name="fluid", x=x, y=y, **own)
        boundary = get_particle_array(name="boundary", x=tank[0], y=tank[1], **own)
        self.scheme.setup_properties([fluid, boundary])
        return [fluid, boundary]

    def post_step(self, solver):
        """Note the end of a step."""
        fluid = next(array for array in solver.particles if array.name == "fluid")
        rows.append((time.process_time(), solver.t / UNIT, float(fluid.x.max())))


parser = argparse.ArgumentParser()
parser.add_argument("--resolution", type=int, default=40)
parser.add_argument("--until", type=float, default=2.0, help="[√(H/g)]")
parser.add_argument("--scheme", default="wcsph")
options = parser.parse_args()
rows: list[tuple[float, float, float]] = []
app = DamBreak()
app.run(
    [
        *(f"--scheme={options.scheme}", f"--dx={1 / options.resolution}", f"--tf={options.until * UNIT}"),
        *("--directory=output", "--pfreq=1000000", "--cache-nnps"),
    ]
)
cpu, at, front = np.array(rows).T
print(
    json.dumps(
        {
            "particles": sum(array.get_number_of_particles() for array in app.particles),
            "steps": len(rows),
            "cpu": cpu[-1] - cpu[0],
            "front": np.interp([1.0, 2.0], at, front).tolist(),
        }
    )
)
