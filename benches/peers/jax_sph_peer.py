"""Time JAX-SPH on the Taylor-Green vortex and print one line of JSON. Runs in the environment that run.py makes."""

import argparse
import json
import time

import jax
import jax.numpy as jnp
import numpy as np
from jax_sph import partition
from jax_sph.case_setup import SimulationSetup
from jax_sph.defaults import defaults
from jax_sph.integrator import si_euler
from jax_sph.jax_md.partition import Sparse
from jax_sph.solver import WCSPH
from jax_sph.utils import Tag
from scipy.spatial import cKDTree

TURN = 2 * np.pi


class TaylorGreen(SimulationSetup):
    """The vortex in the periodic unit square."""

    def _box_size2D(self, n_walls):
        return np.ones(2)

    def _tag2D(self, r, n_walls):
        return jnp.full(len(r), Tag.FLUID, dtype=int)

    def _init_velocity2D(self, r):
        x, y = TURN * r
        return jnp.array([-jnp.cos(x) * jnp.sin(y), jnp.sin(x) * jnp.cos(y)])

    def _unused(self, *arguments):
        raise NotImplementedError("the vortex is plane and has no walls")

    _box_size3D = _init_velocity3D = _init_walls_2d = _init_walls_3d = _unused

    def _external_acceleration_fn(self, r):
        return jnp.zeros_like(r)

    def _boundary_conditions_fn(self, state):
        return state


parser = argparse.ArgumentParser()
parser.add_argument("case", choices=["taylor_green"])
parser.add_argument("--resolution", type=int, default=50)
parser.add_argument("--until", type=float, default=1.0)
options = parser.parse_args()

# The package's own settings for this case, with transport velocity.
jax.config.update("jax_enable_x64", True)
settings = defaults.copy()
settings.case.dim, settings.case.dx, settings.case.viscosity = 2, 1 / options.resolution, 0.01
settings.solver.tvf = 1.0
settings.solver.t_end, settings.config = options.until, "taylor_green.yaml"
settings, box, state, g_ext, boundary, walls, eos, _, displacement, move = TaylorGreen(settings).initialize()
case, solver = settings.case, settings.solver
sph = WCSPH(
    displacement, eos, g_ext, case.dx, case.dim, solver.dt, case.c_ref, solver.eta_limiter, solver.name,
    settings.kernel.name, solver.is_bc_trick, solver.density_evolution, solver.artificial_alpha, solver.free_slip,
    solver.density_renormalize, solver.heat_conduction,
)  # fmt: skip
cutoff = sph._kernel_fn.cutoff
finder = partition.neighbor_list(
    displacement, box, r_cutoff=cutoff, backend=settings.nl.backend, capacity_multiplier=1.25, mask_self=False,
    format=Sparse, num_particles_max=len(state["r"]), num_partitions=settings.nl.num_partitions, pbc=np.array(case.pbc),
)  # fmt: skip
count = len(state["r"])
neighbours = finder.allocate(state["r"], num_particles=count)
advance = jax.jit(si_euler(solver.tvf, sph.forward_wrapper(), move, boundary, walls))
advance(0.0, state, neighbours)[0]["v"].block_until_ready()
cpu = []
steps = round(options.until / solver.dt)
for _ in range(steps):
    new, found = advance(solver.dt, state, neighbours)
    if found.did_buffer_overflow:
        neighbours = finder.allocate(state["r"], num_particles=count)
        new, found = advance(solver.dt, state, neighbours)
    state, neighbours = new, found
    state["v"].block_until_ready()
    cpu.append(time.process_time())

position, velocity = np.asarray(state["r"]) % 1, np.asarray(state["v"])
end = steps * solver.dt
rate = -8 * np.pi**2 / 100
x, y = (TURN * position).T
exact = np.exp(rate * end) * np.column_stack([-np.cos(x) * np.sin(y), np.sin(x) * np.cos(y)])
tree = cKDTree(position, boxsize=1)
pairs = tree.count_neighbors(tree, float(cutoff) * (1 - 1e-9)) - count
print(
    json.dumps(
        {
            "code": "JAX-SPH, transport velocity",
            "particles": count,
            "neighbours": pairs / count,
            "cpu_per_step": float(np.median(np.diff(cpu[5:]))),
            "time_step": float(solver.dt),
            # Density summation, then acceleration.
            "pair_passes_per_step": 2 * int(pairs),
            "decay_rate": float(-np.log(np.mean(np.sum(velocity**2, axis=1)) / 0.5) / end),
            "decay_rate_exact": -2 * rate,
            "velocity_error": float(np.mean(np.linalg.norm(velocity - exact, axis=1)) / np.exp(rate * end)),
        }
    )
)
