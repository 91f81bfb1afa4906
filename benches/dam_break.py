"""The dam break to t = 8 from several starts: impulses at the sensors, impact, energy, losses, and their spread.

After the impact the water is chaotic: starts that differ by a thousandth of a spacing have other splashes. The first
start is undisturbed, particles of the others are displaced by up to a thousandth of a spacing.

    python benches/dam_break.py --resolution 40 --starts 8 [--scheme isph] [--set tank_height=8]
"""

import argparse
import json

import numpy as np
from alsph.analysis.energy import energy, largest_rise
from alsph.cases import DamBreak
from alsph.cases.dam_break import SENSORS, WINDOWS, impulse
from alsph.geometry.particles import Kind

UNTIL, INTERVAL, DISPLACED = 8.0, 0.01, 1e-3
BESIDE = 1.5
"""How far from the end wall the front has met it [Δx]: the foremost particles stop short of it."""


def course(case: DamBreak, seed: int) -> dict[str, float]:
    """Return what is told of a run, by name."""
    state = case.build(1).state
    if seed:
        displaced = DISPLACED * case.particle_spacing
        state["position"] += np.random.default_rng(seed).uniform(-displaced, displaced, state["position"].shape)
    simulation = case.restored(state, threads=1)
    front, sensors = case.outputs()
    rows = []
    for time in np.arange(INTERVAL, UNTIL + INTERVAL / 2, INTERVAL):
        simulation.run_until(time)
        rows.append([simulation.time, *front.values(simulation), *sensors.values(simulation)])
    time, way, *pressures = np.array(rows).T
    found = {
        f"{name} {start:g} to {end:g}": impulse((time, pressure), (start, end))
        / impulse(sensor.measured(), (start, end))
        for (name, sensor), pressure in zip(SENSORS.items(), pressures, strict=True)
        for start, end in WINDOWS
    }
    history = simulation.history()
    total = energy(history)
    met = way >= case.end - BESIDE * case.particle_spacing
    return found | {
        "impact": float(time[met.argmax()]),
        "rise of the energy, %": 100 * largest_rise(history),
        "energy at the end, %": 100 * float(total[-1] / total[0]),
        "particles lost": float(np.count_nonzero(state["kind"] == Kind.FLUID) - history["fluid"][-1]),
    }


def main() -> None:
    """Print means and spreads over the starts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--resolution", type=int, default=20, help="H/Δx (%(default)s)")
    parser.add_argument("--starts", type=int, default=8, help="(%(default)s)")
    parser.add_argument("--scheme", default="alsph", help="(%(default)s)")
    parser.add_argument("--set", nargs="*", default=[], metavar="NAME=VALUE", help="further parameters of the case")
    options = parser.parse_args()
    more = {}
    for setting in options.set:
        name, _, value = setting.partition("=")
        more[name] = json.loads(value)
    case = DamBreak(resolution=options.resolution, scheme=options.scheme, **more)
    runs = []
    for seed in range(options.starts):
        runs.append(course(case, seed))
        print(f"start {seed}: {json.dumps(runs[-1])}", flush=True)
    print(f"H/Δx = {options.resolution}, {options.scheme}, {options.starts} starts; impulses over the experiments'")
    for name in runs[0]:
        values = np.array([run[name] for run in runs])
        print(
            f"{name:28} {values.mean():8.3f} ± {values.std(ddof=1) if len(values) > 1 else np.nan:.3f}"
            f"   {values.min():.3f} to {values.max():.3f}"
        )


if __name__ == "__main__":
    main()
