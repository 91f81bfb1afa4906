"""Cost and error: CPU seconds a unit of flow time on one thread, beside the errors of what a case measures.

    python benches/cost.py taylor_green --resolutions 25 50 100 --until 1
    python benches/cost.py cavity --resolutions 25 --until 16 --settings default courant=0.2 courant=0.3
    python benches/cost.py cylinder --resolutions 10 --until 46 --settings default courant=0.3,projection_sweeps=2

Settings are `default`, `paper` (Algorithm 2, five iterations), or parameters of the case. Rows come as they are ready.
"""

import argparse
import tempfile
import time
import tomllib
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from alsph.analysis.averages import Estimate
from alsph.cases import CASES
from alsph.results.run import Run
from alsph.tables import markdown

NAMED: dict[str, dict[str, Any]] = {
    "default": {},
    "paper": {"algorithm": 2, "max_iterations": 5, "projection_sweeps": 0, "viscous_order": 2},
}


def settings_of(text: str) -> dict[str, Any]:
    """Return the parameters that a name, or ``name=value,name=value``, stands for."""
    if text in NAMED:
        return NAMED[text]
    return tomllib.loads("\n".join(text.split(",")))


def noise(run: Run, name: str) -> float:
    """Return the rms of the second difference of a coefficient over a hundredth of D/U in the averaging window."""
    found, window = run.history, run.window
    every = np.arange(window.start, window.end, 0.01)
    return float(np.sqrt(np.mean(np.diff(np.interp(every, found["time"], found[name]), 2) ** 2)))


def row(case: str, resolution: int, text: str, until: float, parameters: dict[str, Any]) -> dict[str, str]:
    """Run a case and return its cost and its errors, in words."""
    made = CASES[case](resolution=resolution, **parameters | settings_of(text))
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        start = time.process_time()
        run = made.run(Path(folder) / "run", until=until, threads=1, progress=False, output_interval=min(until, 1.0))
        seconds = time.process_time() - start
        cells = {"D/Δx": str(resolution), "settings": text, "CPU s a D/U": f"{seconds / until:.3g}"}
        cells["ΔtU/Δx"] = f"{np.mean(run.history['time_step']) * resolution:.3g}"
        cells["mean |∇·u|"] = f"{run.divergence.mean:.2e}"
        for measure in run.measures:
            value = measure.value if isinstance(measure.value, Estimate) else Estimate(measure.value)
            known = np.isfinite(measure.reference)
            cells[measure.name] = f"{value}" + (f", {100 * measure.error:+.3g} %" if known else "")
        if made.coefficient_bodies:
            cells["noise of C_L"] = f"{noise(run, 'lift_coefficient'):.2g}"
    return cells


def main() -> None:
    """Print the rows, and the table of all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("case", choices=list(CASES))
    parser.add_argument("--resolutions", type=int, nargs="+", default=[25])
    parser.add_argument("--until", type=float, default=1.0)
    parser.add_argument("--reynolds", type=float)
    parser.add_argument("--settings", nargs="+", default=["default"])
    options = parser.parse_args()
    parameters = {"reynolds": options.reynolds} if options.reynolds else {}
    rows = []
    for resolution in options.resolutions:
        for text in options.settings:
            rows.append(row(options.case, resolution, text, options.until, parameters))
            print("  ".join(f"{name} {cell}" for name, cell in rows[-1].items()), flush=True)
    print("\n" + markdown(list(rows[0]), [list(cells.values()) for cells in rows]))


if __name__ == "__main__":
    main()
