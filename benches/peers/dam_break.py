"""A dam break in 2-D to t = 2 √(H/g), with alsph's schemes and with PySPH's: CPU seconds of one core, and the front.

The tank is that of alsph's case, with mirrors for walls and with solids, in PySPH with walls of particles. The front is
the particle that is farthest, beside that of the inviscid computation with 400 particles over H. PySPH runs in an
environment of its own, set up on first use; its IISPH did not end in twelve minutes with 40 particles over H.

    python benches/peers/dam_break.py                    # a quarter of an hour
    python benches/peers/dam_break.py --resolutions 20
"""

import argparse
import time
from pathlib import Path

import alsph
import numpy as np
from alsph import reference
from alsph.geometry.particles import Kind
from codes import ENVIRONMENTS, measure

TIMES = 1.0, 2.0

SCHEMES = {
    "alsph": ("alsph", "alsph, walls of solids", "isph", "explicit_isph", "wcsph", "edac"),
    "pysph": ("wcsph", "aha", "edac", "sisph"),
}


def alsph_row(scheme: str, resolution: int) -> dict:
    """Return what alsph takes and comes to."""
    name, _, solids = scheme.partition(", ")
    case = alsph.cases.DamBreak(resolution=resolution, scheme=name, walls="solid" if solids else "slip")
    start, fronts = time.process_time(), []
    simulation = case.simulation(threads=1)
    for at in TIMES:
        simulation.run_until(at)
        state = simulation.state()
        fronts.append(float(state["position"][state["kind"] == Kind.FLUID, 0].max()))
    cpu, steps = time.process_time() - start, simulation.step
    return {"particles": len(state["kind"]), "steps": steps, "cpu": cpu, "front": fronts}


def main() -> None:
    """Print a table, line by line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--resolutions", type=int, nargs="+", default=[20, 40, 80])
    parser.add_argument("--environments", type=Path, default=ENVIRONMENTS, help="folder for the environments")
    options = parser.parse_args()
    known = np.interp(TIMES, *reference.table("dam_break_front.csv"))
    options.environments.mkdir(parents=True, exist_ok=True)
    print("| H/Δx | code | particles | steps | CPU s | front at t = 1 | at t = 2 |")
    print("|---|---|---|---|---|---|---|")
    for resolution in options.resolutions:
        for code, schemes in SCHEMES.items():
            for scheme in schemes:
                if code == "alsph":
                    row = alsph_row(scheme, resolution)
                else:
                    arguments = [f"--resolution={resolution}", f"--scheme={scheme}"]
                    row = measure(code, arguments, options.environments.resolve(), "pysph_dam_break.py")
                if not row:
                    continue
                errors = [f"{front / exact - 1:+.1%}" for front, exact in zip(row["front"], known, strict=True)]
                cells = [resolution, f"{code}, {scheme}", row["particles"], row["steps"], f"{row['cpu']:.1f}", *errors]
                print("| " + " | ".join(map(str, cells)) + " |", flush=True)


if __name__ == "__main__":
    main()
