"""Time Algorithm 1 against Algorithm 2, both with the paper's five iterations, on one thread and in turns.

    python benches/algorithms.py

The ratio of the sums of CPU time, and the median and quartiles of the ratios of the turns: the vortex to t* = 1, and
the channel at D/Δx = 20 just after its start and from t* = 0.3 on. About two minutes.
"""

import time

import alsph
import numpy as np

PAPER = {"max_iterations": 5, "projection_sweeps": 0, "viscous_order": 2}


def compare(name, case, start, turns, steps):
    """Print the ratio over `turns` of so many `steps`, from the time `start` on."""
    simulations = [case(algorithm=algorithm, **PAPER).simulation(threads=1) for algorithm in (1, 2)]
    for simulation in simulations:
        if start > 0:
            simulation.run_until(start)
    seconds = np.empty((turns, 2))
    for turn in seconds:
        for k, simulation in enumerate(simulations):
            before = time.process_time()
            simulation.advance(steps)
            turn[k] = time.process_time() - before
    low, median, high = np.quantile(seconds[:, 0] / seconds[:, 1], [0.25, 0.5, 0.75])
    first, second = seconds.sum(axis=0)
    print(f"{name:28} {first / second:.3f}   {median:.3f} ({low:.3f} to {high:.3f})", flush=True)


print("Algorithm 1 / Algorithm 2    sums    median of turns (quartiles)")
compare("vortex, 50²", lambda **method: alsph.cases.TaylorGreen(resolution=50, **method), 0.0, 49, 20)
compare("channel, first 20 steps", lambda **method: alsph.cases.Cylinder(resolution=20, **method), 0.0, 10, 2)
compare("channel, from t* = 0.3 on", lambda **method: alsph.cases.Cylinder(resolution=20, **method), 0.3, 15, 2)
