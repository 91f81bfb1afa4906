"""A dam break in 2-D to t = 2 √(H/g), with alsph's schemes and with PySPH's: CPU seconds of one core, and the front.

The tank is that of alsph's case, in PySPH with walls of particles. The reference is the inviscid computation with 400
particles over H that alsph's case is compared with. PySPH runs in an environment of its own, set up on first use.

    python benches/peers/dam_break.py                    # a quarter of an hour
    python benches/peers/dam_break.py --resolutions 20
"""

import argparse
import tempfile
import time
from pathlib import Path

import alsph
from codes import ENVIRONMENTS, measure

SCHEMES = {
    "alsph": ("alsph", "isph", "explicit_isph", "wcsph", "edac"),
    "pysph": ("wcsph", "aha", "edac", "iisph", "sisph"),
}


def alsph_row(scheme: str, resolution: int) -> dict:
    """Return what alsph takes and comes to, and what the front is to be."""
    case = alsph.cases.DamBreak(resolution=resolution, scheme=scheme)
    with tempfile.TemporaryDirectory() as folder:
        start = time.process_time()
        run = case.run(folder + "/run", until=2.0, threads=1, progress=False)
        cpu = time.process_time() - start
        fronts = [measure for measure in run.measures if measure.name.startswith("front")]
    return {
        "particles": int(run.history["fluid"][0]),
        "steps": int(run.history["step"][-1]),
        "cpu": cpu,
        "front": [front.value for front in fronts],
        "reference": [front.reference for front in fronts],
    }


def main() -> None:
    """Print a table, line by line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--resolutions", type=int, nargs="+", default=[20, 40, 80])
    parser.add_argument("--environments", type=Path, default=ENVIRONMENTS, help="folder for the environments")
    options = parser.parse_args()
    options.environments.mkdir(parents=True, exist_ok=True)
    print("| H/Δx | code | particles | steps | CPU s | front at t = 1 | at t = 2 |")
    print("|---|---|---|---|---|---|---|")
    for resolution in options.resolutions:
        for code, schemes in SCHEMES.items():
            for scheme in schemes:
                if code == "alsph":
                    row = alsph_row(scheme, resolution)
                    reference = row["reference"]
                else:
                    arguments = [f"--resolution={resolution}", f"--scheme={scheme}"]
                    row = measure(code, arguments, options.environments.resolve(), "pysph_dam_break.py")
                if not row:
                    continue
                errors = [f"{front / known - 1:+.1%}" for front, known in zip(row["front"], reference, strict=True)]
                cells = [resolution, f"{code}, {scheme}", row["particles"], row["steps"], f"{row['cpu']:.1f}", *errors]
                print("| " + " | ".join(map(str, cells)) + " |", flush=True)


if __name__ == "__main__":
    main()
