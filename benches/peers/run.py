"""Compare alsph with other SPH codes on the same flows: CPU time a particle and step, and a unit of flow time.

Each code runs in an environment of its own, set up on first use. Codes take turns, each on one core; medians are
printed, of the times and of the ratios to alsph's in the same round. JAX-SPH needs a python3.10 in the path; a code
that cannot be installed is left out.

    python benches/peers/run.py            # everything, about half an hour
    python benches/peers/run.py cylinder --rounds 1
"""

import argparse
import statistics
from pathlib import Path

from codes import ENVIRONMENTS, measure

AS_MANY = f"--smoothing-ratio={4 / 3}"  # as many neighbours as alsph

CASES = {
    "cylinder": [
        ("alsph", ["cylinder", "--resolution=20"]),
        ("alsph", ["cylinder", "--resolution=20", "--algorithm=1"]),
        ("alsph", ["cylinder", "--resolution=20", "--paper"]),
        ("alsph", ["cylinder", "--resolution=20", "--paper", "--algorithm=1"]),
        ("pysph", ["cylinder", "--resolution=20", "--cache", AS_MANY]),
        ("pysph", ["cylinder", "--resolution=20", AS_MANY]),
    ],
    "taylor_green": [
        ("alsph", ["taylor_green", "--resolution=50"]),
        ("alsph", ["taylor_green", "--resolution=50", "--paper"]),
        ("alsph", ["taylor_green", "--resolution=50", "--paper", "--algorithm=1"]),
        ("pysph", ["taylor_green", "--resolution=50", "--scheme=edac", "--cache", AS_MANY]),
        ("pysph", ["taylor_green", "--resolution=50", "--scheme=edac", "--cache"]),
        ("pysph", ["taylor_green", "--resolution=50", "--scheme=tvf", "--cache"]),
        ("pysph", ["taylor_green", "--resolution=50", "--scheme=sisph", "--cache"]),
        ("jax-sph", ["taylor_green", "--resolution=50"]),
    ],
    # The errors rather than the speed: a finer lattice, and particles that start in disorder.
    "accuracy": [
        (code, ["taylor_green", *start, *scheme])
        for start in (["--resolution=100"], ["--resolution=50", "--perturb=0.2"], ["--resolution=100", "--perturb=0.2"])
        for code, *scheme in (
            ("alsph",),
            ("pysph", "--scheme=edac", "--cache"),
            ("pysph", "--scheme=tvf", "--cache"),
        )
    ],
}


def rates(name, arguments, folder):
    """Run one code once; return what its driver prints, with the rates, or None if it fails."""
    result = measure(name, arguments, folder)
    if result:
        result["cpu_per_time"] = result["cpu_per_step"] / result["time_step"]
        result["cpu_per_particle"] = result["cpu_per_step"] / result["particles"]
        result["rate"] = result["pair_passes_per_step"] / result["cpu_per_step"]
    return result


def compare(case, rounds, folder):
    """Run the codes of a case in turn and print a table."""
    results = [[rates(name, arguments, folder) for name, arguments in CASES[case]] for _ in range(rounds)]
    print(f"\n{case}: the median of {rounds} rounds; CPU seconds of one core\n")
    print(
        "| code | particles | neighbours | Δt | µs a particle and step | pair-passes/s | s a unit of flow time ", end=""
    )
    print("| its time / alsph's | alsph's rate / its | error of the decay rate | error of the velocity |")
    print("|" + "---|" * 11)
    for row in zip(*results, strict=True):
        good = [(a, b) for a, b in zip(row, (round[0] for round in results), strict=True) if a and b]
        if not good:
            continue

        def median(f, good=good):
            return statistics.median(f(a, b) for a, b in good)

        first = good[0][0]
        errors = ["", ""]
        if "velocity_error" in first:
            errors = [f"{first['decay_rate'] / first['decay_rate_exact'] - 1:+.2%}", f"{first['velocity_error']:.4f}"]
        cells = [
            first["code"] + (f", h/Δx = {first['smoothing_ratio']:.3g}" if "smoothing_ratio" in first else ""),
            f"{first['particles']}",
            f"{first['neighbours']:.1f}",
            f"{first['time_step']:.2e}",
            f"{1e6 * median(lambda a, _: a['cpu_per_particle']):.2f}",
            f"{median(lambda a, _: a['rate']):.2e}",
            f"{median(lambda a, _: a['cpu_per_time']):.3g}",
            f"{median(lambda a, b: a['cpu_per_time'] / b['cpu_per_time']):.2f}",
            f"{median(lambda a, b: b['rate'] / a['rate']):.2f}",
            *errors,
        ]
        print("| " + " | ".join(cells) + " |", flush=True)


parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("cases", nargs="*", default=list(CASES), help=f"of {', '.join(CASES)}")
parser.add_argument("--rounds", type=int, default=3)
parser.add_argument("--environments", type=Path, default=ENVIRONMENTS, help="folder for the environments")
options = parser.parse_args()
options.environments.mkdir(parents=True, exist_ok=True)
for case in options.cases:
    compare(case, options.rounds, options.environments.resolve())
