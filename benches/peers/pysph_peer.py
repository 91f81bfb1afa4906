"""Time PySPH on alsph's cases and print one line of JSON. Runs in the environment that run.py makes."""

import argparse
import contextlib
import io
import json
import time

import numpy as np
from alsph.analysis.sampling import interpolate
from alsph.cases.cavity import CENTRE_LINES, on_centre_lines
from pysph.examples import cavity, flow_past_cylinder_2d, taylor_green
from pysph.solver.utils import iter_output
from scipy.spatial import cKDTree


class Clock:
    """Notes the CPU time of every step."""

    def __init__(self):
        self.cpu, self.time = [], []

    def tick(self, solver):
        """Note the end of a step."""
        self.cpu.append(time.process_time())
        self.time.append(solver.t)


class Cylinder(flow_past_cylinder_2d.WindTunnel):
    """The channel of Kolukisa, Ozbulut and Yildiz (2021): 14 D long, 13 D high, cylinder 4 D from the inlet."""

    def consume_user_options(self):
        """Set the geometry, which the example's options only reach in part."""
        super().consume_user_options()
        self.Lt, self.Wt, self.cxy = 14 * self.dc, 6.5 * self.dc, (4 * self.dc, 0.0)

    def post_step(self, solver):
        """Note the end of a step."""
        clock.tick(solver)


class TaylorGreen(taylor_green.TaylorGreen):
    """The example as it is."""

    def post_step(self, solver):
        """Note the end of a step."""
        clock.tick(solver)


class Cavity(cavity.LidDrivenCavity):
    """The example as it is."""

    def post_step(self, solver):
        """Note the end of a step."""
        clock.tick(solver)


def loops(evaluator):
    """Return (destination, source, passes) of every loop over neighbours in one evaluation of the equations."""
    counts = {}

    def visit(group):
        if group.has_subgroups:
            for sub in group.data:
                visit(sub)
            return
        for destination, (_, sources, _) in group.data.items():
            for source, equations in sources.items():
                if equations.has_loop() or equations.has_loop_all():
                    pair = (destination, source)
                    counts[pair] = counts.get(pair, 0) + max(1, group.min_iterations if group.iterate else 1)

    for group in evaluator.mega_groups:
        visit(group)
    return counts


def pairs(solver, destination, source, period):
    """Count the pairs within the support radius."""
    arrays = {array.name: array for array in solver.particles}
    points = [np.column_stack([arrays[name].x, arrays[name].y]) for name in (destination, source)]
    if not all(len(p) for p in points):
        return 0
    radius = solver.kernel.radius_scale * float(arrays[destination].h.max())
    real = [p[arrays[name].tag == 0] for p, name in zip(points, (destination, source), strict=True)]
    trees = [cKDTree(p % period if period else p, boxsize=period) for p in real]
    return int(trees[0].count_neighbors(trees[1], radius * (1 - 1e-9)))


def errors(fluid, time):
    """Return the decay rate of the kinetic energy and the mean error of the velocity, of the Taylor-Green vortex."""
    rate = -8 * np.pi**2 / 100
    real = fluid.tag == 0
    x, y, u, v = (getattr(fluid, name)[real] for name in "xyuv")
    exact = taylor_green.exact_solution(1.0, rate, time, x, y)
    energy = np.mean(u**2 + v**2) / np.mean(0.5)
    return {
        "decay_rate": -np.log(energy) / time,
        "decay_rate_exact": -2 * rate,
        "velocity_error": float(np.mean(np.hypot(u - exact[0], v - exact[1])) / np.exp(rate * time)),
    }


def extrema(app, start):
    """Return the smallest u and the largest and smallest v on the centre lines, of the mean of the late outputs."""
    late = []
    for data, arrays in iter_output(app.output_files):
        if data["t"] >= start:
            fluid = arrays["fluid"]
            position, velocity = np.column_stack([fluid.x, fluid.y]), np.column_stack([fluid.u, fluid.v])
            late.append(interpolate(position, velocity, CENTRE_LINES, app.dx)[0])
    u, v = on_centre_lines(np.mean(late, axis=0))
    return [float(u.min()), float(v.max()), float(v.min())]


def forces(app, start):
    """Return the mean drag and the rms lift coefficient of the late outputs, as the example finds them."""
    with contextlib.redirect_stdout(io.StringIO()):
        time, drag, lift = app._plot_force_vs_t()
    late = time >= start
    return {"drag": float(np.mean(drag[late])), "lift": float(np.std(lift[late]))}


parser = argparse.ArgumentParser()
parser.add_argument("case", choices=["cavity", "cylinder", "taylor_green"])
parser.add_argument("--resolution", type=int, default=20)
parser.add_argument("--smoothing-ratio", type=float, help="h/Δx, the example's if not given; the cavity's is fixed")
parser.add_argument("--steps", type=int, default=20, help="steps to time, of the cylinder")
parser.add_argument("--until", type=float, help="time to reach, D/U; for the cylinder in place of the steps")
parser.add_argument("--window", type=float, default=5.0, help="length of the averages at the end, D/U")
parser.add_argument("--scheme", default="edac")
parser.add_argument("--perturb", type=float, default=0, help="width of the vortex's random displacement, Δx")
parser.add_argument("--cache", action="store_true")
options = parser.parse_args()

WARM_UP = 5
SMOOTHING_RATIO = {"cavity": cavity.hdx, "cylinder": 1.2, "taylor_green": 1.0}
clock = Clock()
smoothing_ratio = options.smoothing_ratio or SMOOTHING_RATIO[options.case]
arguments = [f"--nx={options.resolution}", "--directory=output"]
if options.case == "taylor_green":
    app, until = TaylorGreen(), options.until or 1.0
    arguments += [f"--scheme={options.scheme}", f"--tf={until}", f"--perturb={options.perturb}"]
    arguments += [f"--hdx={smoothing_ratio}", "--pfreq=1000000"]
elif options.case == "cavity":
    app, until = Cavity(), options.until or 1.0
    arguments += [f"--scheme={options.scheme}", f"--tf={until}"]
else:
    app, until = Cylinder(), options.until
    arguments.append(f"--hdx={smoothing_ratio}")
    arguments += [f"--tf={1.2 * until}"] if until else [f"--max-steps={WARM_UP + options.steps}", "--disable-output"]
if options.cache:
    arguments.append("--cache-nnps")
app.run(arguments)
solver = app.solver
unit = app.dc if options.case == "cylinder" else 1.0
period = 1.0 if options.case == "taylor_green" else None
found = loops(solver.acceleration_evals[0])
fluid = solver.particles[0]
result = {
    "code": f"PySPH {options.scheme.upper()}"
    + (", cached neighbours" if options.cache else "")
    + (", perturbed" if options.perturb else ""),
    "particles": sum(int(np.sum(array.tag == 0)) for array in solver.particles),
    "smoothing_ratio": smoothing_ratio,
    "neighbours": pairs(solver, "fluid", "fluid", period) / np.sum(fluid.tag == 0) - 1,
    "cpu_per_step": float(np.median(np.diff(clock.cpu[WARM_UP - 1 :]))),
    "cpu_per_time": (clock.cpu[-1] - clock.cpu[0]) / (clock.time[-1] - clock.time[0]) * unit,
    "time_step": float(np.mean(np.diff(clock.time[WARM_UP - 1 :]))) / unit,
    "pair_passes_per_step": sum(count * pairs(solver, *pair, period) for pair, count in found.items()),
}
if options.case == "taylor_green":
    result |= errors(fluid, solver.t)
elif options.case == "cavity":
    result["extrema"] = extrema(app, until - options.window)
elif until:
    result |= forces(app, unit * (until - options.window))
print(json.dumps(result))
