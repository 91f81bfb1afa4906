"""How often the ± of the mean drag covers the settled drag, on signals where that is known.

python benches/coverage.py --seeds 200
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from alsph import analysis

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from battery import DEVELOPING, ESTIMATED, SETTLED, times  # noqa: E402


def main() -> None:
    """Print a table, a line for each class of signals."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=200)
    seeds = parser.parse_args().seeds
    print("| signal | periods | ± covers | within 2 ± | ± unknown | still developing | median ± | rms error |")
    print("|---|---|---|---|---|---|---|---|")
    for name, (end, signal) in (ESTIMATED | DEVELOPING).items():
        found = []
        for seed in range(seeds):
            rng = np.random.default_rng(seed)
            time = times(rng, end)
            drag, lift = signal(rng, time)
            window = analysis.averaging_window(time, drag, lift)
            mean = analysis.mean(time, drag, window)
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


if __name__ == "__main__":
    main()
