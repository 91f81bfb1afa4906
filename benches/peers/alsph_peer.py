"""Time alsph as the peers are timed and print one line of JSON."""

import argparse
import json
import time

import alsph
import numpy as np
from alsph.analysis.sampling import interpolate
from alsph.cases.cavity import CENTRE_LINES, on_centre_lines
from alsph.geometry.particles import Kind
from scipy.spatial import cKDTree


def passes(case, iterations):
    """Passes over all pairs in a step: volumes, the first (which forms the corrections too), two of the shift, four an
    iteration but for the last, whose derivatives come with the shift (five with Algorithm 1, the last too: the volumes
    in each), two a sweep, one for the fourth viscous order."""
    sharpening = int(case.viscous_order == 4)
    iterating = 5 * iterations if case.algorithm == 1 else 4 * iterations - 1
    return 4 + iterating + 2 * case.projection_sweeps + sharpening


def channel_pairs(case, position, radius):
    """Count the directed pairs of the channel's particles, images across the walls included."""
    plane = case.height / 2
    images = [position]
    for side in (-plane, plane):
        near = np.abs(position[:, 1] - side) < radius
        images.append(np.column_stack([position[near, 0], 2 * side - position[near, 1]]))
    return cKDTree(position).count_neighbors(cKDTree(np.vstack(images)), radius)


parser = argparse.ArgumentParser()
parser.add_argument("case", choices=["cavity", "cylinder", "taylor_green"])
parser.add_argument("--resolution", type=int, default=20)
parser.add_argument("--algorithm", type=int, help="the paper's; in the middle of the step if not given")
parser.add_argument("--paper", action="store_true", help="five iterations, no sweeps, a viscous term of second order")
parser.add_argument("--steps", type=int, default=20, help="steps to time, of the cylinder")
parser.add_argument("--until", type=float, help="time to reach, D/U; for the cylinder in place of the steps")
parser.add_argument("--window", type=float, default=5.0, help="length of the averages at the end, D/U")
parser.add_argument("--perturb", type=float, default=0, help="width of the vortex's random displacement, Δx")
options = parser.parse_args()

WARM_UP = 5
algorithm = options.algorithm or (2 if options.paper else "midpoint")
code = ["alsph", str(algorithm), *["the paper"] * options.paper, *["perturbed"] * bool(options.perturb)]
result = {"code": ", ".join(code)}
method = {"resolution": options.resolution, "algorithm": algorithm}
if options.paper:
    method |= {"max_iterations": 5, "projection_sweeps": 0, "viscous_order": 2}
if options.case == "cylinder":
    case, until = alsph.cases.Cylinder(reynolds=200, **method), options.until
elif options.case == "cavity":
    case, until = alsph.cases.Cavity(reynolds=100, **method), options.until or 1.0
else:
    case, until = (
        alsph.cases.TaylorGreen(reynolds=100, perturbation=options.perturb / 2, **method),
        options.until or 1.0,
    )
simulation = case.simulation(threads=1)
cpu, late, sampling = [], [], 0.0
while simulation.time < until if until else len(cpu) < WARM_UP + options.steps:
    simulation.advance(1)
    cpu.append(time.process_time() - sampling)
    if options.case == "cavity" and simulation.time >= until - options.window + len(late) / 4:
        state = simulation.snapshot()
        fluid = state["kind"] == Kind.FLUID
        fields = state["position"][fluid], state["velocity"][fluid]
        late.append(interpolate(*fields, CENTRE_LINES, case.particle_spacing)[0])
        sampling = time.process_time() - cpu[-1]
history, state = simulation.history(), simulation.snapshot()
position = state["position"]
radius = 3 * case.smoothing_ratio / case.resolution * (1 + 5e-7)
if options.case == "cylinder":
    count = channel_pairs(case, position, radius)
    if until:
        window = history["time"] >= until - options.window
        result["drag"] = float(np.mean(history["drag_coefficient"][window]))
        result["lift"] = float(np.std(history["lift_coefficient"][window]))
elif options.case == "cavity":
    tree = cKDTree(position)
    count = tree.count_neighbors(tree, radius)
    u, v = on_centre_lines(np.mean(late, axis=0))
    result["extrema"] = [float(u.min()), float(v.max()), float(v.min())]
else:
    tree = cKDTree(position % 1, boxsize=1)
    count = tree.count_neighbors(tree, radius)
    rate = -8 * np.pi**2 / case.reynolds
    factor = np.exp(rate * simulation.time)
    x, y = (2 * np.pi * position).T
    exact = factor * np.column_stack([-np.cos(x) * np.sin(y), np.sin(x) * np.cos(y)])
    speed = np.linalg.norm(state["velocity"], axis=1)
    result |= {
        "decay_rate": -np.log(np.mean(speed**2) / 0.5) / simulation.time,
        "decay_rate_exact": -2 * rate,
        "velocity_error": float(np.mean(np.linalg.norm(state["velocity"] - exact, axis=1)) / factor),
    }
count -= len(position)
iterations = history["iterations"][WARM_UP:]
print(
    json.dumps(
        result
        | {
            "particles": len(position),
            "neighbours": count / len(position),
            "cpu_per_time": (cpu[-1] - cpu[0]) / (history["time"][-1] - history["time"][0]),
            "cpu_per_step": float(np.median(np.diff(cpu[WARM_UP - 1 :]))),
            "time_step": float(np.mean(history["time_step"][WARM_UP:])),
            "pair_passes_per_step": float(count * np.mean([passes(case, m) for m in iterations])),
        }
    )
)
