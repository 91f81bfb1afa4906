"""How often the ± of the mean drag covers the settled drag, on signals where that is known, also of runs that it ends.

python benches/coverage.py --seeds 200
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from alsph.analysis import averages
from alsph.analysis.uncertainty import uncertainty_of_mean
from alsph.cases import Cylinder
from alsph.config import Config, RunSettings

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from battery import DEVELOPING, ENDED, ESTIMATED, SETTLED, autoregressive_series, judgements, times  # noqa: E402

CORRELATIONS = (0.0, 0.5, 0.7, 0.9)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=100)
    seeds = parser.parse_args().seeds
    independent(5 * seeds)
    records(seeds)
    converged(seeds)


def independent(trials: int) -> None:
    """Print the coverage for averages that are an AR(1) series, and the ± over that of independent ones."""
    print("| periods | " + " | ".join(f"AR(1) {phi:g}" for phi in CORRELATIONS) + " |\n|---|---|---|---|---|")
    for count in (5, 10, 20, 40):
        cells = []
        for phi in CORRELATIONS:
            rng, covered, ratio = np.random.default_rng(0), [], []
            for _ in range(trials):
                series = autoregressive_series(rng, phi, count)
                standard = uncertainty_of_mean(series, float(series.mean())).standard
                covered.append(abs(series.mean()) <= standard)
                ratio.append(standard * np.sqrt(count))
            cells.append(f"{np.mean(covered):.2f} ({np.median(ratio):.1f})")
        print(f"| {count} | " + " | ".join(cells) + " |", flush=True)
    print()


def records(seeds: int) -> None:
    """Print the coverage for whole records, a line for each class of signals."""
    print("| signal | periods | ± covers | within 2 ± | ± unknown | still developing | median ± | rms error |")
    print("|---|---|---|---|---|---|---|---|")
    for name, (end, signal) in (ESTIMATED | DEVELOPING).items():
        found = []
        for seed in range(seeds):
            rng = np.random.default_rng(seed)
            time = times(rng, end)
            drag, lift = signal(rng, time)
            window = averages.averaging_window(time, drag, lift)
            mean = averages.mean(time, drag, window)
            told = "still developing" in mean.note
            found.append((window.periods, abs(mean - SETTLED), mean.uncertainty, told))
        periods, error, uncertainty, developing = np.array(found).T
        known = np.isfinite(uncertainty)
        one, two = ((error <= k * uncertainty)[known].mean() if known.any() else np.nan for k in (1, 2))
        print(
            f"| {name} | {np.median(periods):.0f} | {one:.2f} | {two:.2f} | {np.mean(~known):.2f} "
            f"| {developing.mean():.2f} | {np.median(uncertainty):.4f} | {np.sqrt(np.mean(error**2)):.4f} |",
            flush=True,
        )


def converged(seeds: int) -> None:
    """Print how runs with ``until = "converged"`` end, and the coverage then, a line for each class of signals.

    Time, the ± and the error are those of the runs that have converged.
    """
    of = Config(Cylinder(), RunSettings(until="converged"))
    print("\n| signal | 12 periods | covered | converged | tU/D | covered | within 2 ± | median ± | rms error |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name, signal in ENDED.items():
        ends = [judgements(signal, of, seed)[-1] for seed in range(seeds)]
        why, time = np.array([found.ended for _, found in ends]), np.array([time for time, _ in ends])
        drags = [found.averages["C_D'"] for _, found in ends]
        error, uncertainty = np.array([(abs(drag - SETTLED), drag.uncertainty) for drag in drags]).T
        cells = []
        for each, factors in (("periods", (1,)), ("converged", (1, 2))):
            chosen = why == each
            covered = [
                f"{np.mean(error[chosen] <= k * uncertainty[chosen]):.2f}" if chosen.any() else "" for k in factors
            ]
            when = [f"{np.median(time[chosen]):.0f}" if chosen.any() else ""] * (each == "converged")
            cells += [f"{chosen.mean():.2f}", *when, *covered]
        last = [f"{np.median(uncertainty[chosen]):.4f}", f"{np.sqrt(np.mean(error[chosen] ** 2)):.4f}"]
        print(f"| {name} | {' | '.join([*cells, *last])} |", flush=True)


if __name__ == "__main__":
    main()
