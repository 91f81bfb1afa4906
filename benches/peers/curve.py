"""Cost and accuracy of alsph and its peers: CPU seconds of one core a unit of flow time against the error reached.

Rows are kept in curve.jsonl as they come, and those that are there are not run again; `--plot` only draws.

    python benches/peers/curve.py                      # everything: days
    python benches/peers/curve.py taylor_green cavity  # some cases
    python benches/peers/curve.py --most 600           # only what takes less CPU time than that, as far as is known

SPHinXsys is no package: its rows are left out unless `--sphinxsys` names the folders of its sources and of its library,
both outside of this repository; Simbody, TBB, Boost, Eigen and spdlog are to be there (ten minutes on one core):

    cmake -S SOURCES -B BUILD -G Ninja -DCMAKE_BUILD_TYPE=Release -DSPHINXSYS_3D=OFF -DSPHINXSYS_BUILD_TESTS=OFF \\
        -DSPHINXSYS_DEVELOPER_MODE=OFF -DCMAKE_UNITY_BUILD=ON -DCMAKE_UNITY_BUILD_BATCH_SIZE=12
    ninja -C BUILD sphinxsys_2d
"""

import argparse
import itertools
import json
from pathlib import Path

import numpy as np
from alsph import plotting, reference
from alsph.tables import markdown
from codes import ENVIRONMENTS, HERE, measure
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import LogLocator, NullFormatter

ROWS = HERE / "curve.jsonl"
PICTURE = HERE.parents[1] / "docs" / "images" / "cost_error.png"

# What a way of computing is called, its driver and arguments, and how it is drawn.
VARIANTS = {
    "alsph": ("alsph", "alsph", [], "o-"),
    "paper": ("the paper's Algorithm 2, in alsph", "alsph", ["--paper"], "s-"),
    "edac": ("PySPH, EDAC", "pysph", ["--scheme=edac", "--cache"], "^-"),
    "sisph": ("PySPH, SISPH", "pysph", ["--scheme=sisph", "--cache"], "v-"),
    "sphinxsys": ("SPHinXsys", "sphinxsys", ["--relaxed"], "D-"),
}

# Case: end and window of the averages, resolutions, variants, and what the error is of.
CASES = {
    "taylor_green": (1.0, 1.0, [25, 50, 100], list(VARIANTS), "Taylor-Green, Re = 100: velocity"),
    "cavity": (20.0, 5.0, [25, 50, 100], ["alsph", "paper", "edac", "sphinxsys"], "cavity, Re = 100: worst extremum"),
    "cylinder": (40.0, 15.0, [10, 15, 20, 30], ["alsph", "paper", "edac", "sphinxsys"], "cylinder, Re = 200: drag"),
}


def error(case: str, row: dict) -> float:
    """Return the error of a row, relative to the reference; NaN if the run gave none."""
    if case == "taylor_green":
        return row["velocity_error"]
    if case == "cavity":
        known = reference.row("cavity_extrema.csv", 100) or {}
        exact = np.array([float(known[name]) for name in ("umin", "vmax", "vmin")])
        return float(np.max(np.abs(np.array(row["extrema"]) / exact - 1)))
    solution = reference.cylinder_in_channel(200)
    return abs(row["drag"] / solution.results["mean drag coefficient"] - 1) if solution else np.nan


def read() -> dict[tuple[str, str, int], dict]:
    """Return the rows that are there, by case, variant and resolution."""
    lines = ROWS.read_text().splitlines() if ROWS.exists() else []
    return {(row["case"], row["variant"], row["resolution"]): row for row in map(json.loads, lines)}


def likely(rows: dict[tuple[str, str, int], dict], case: str, variant: str, resolution: int) -> float:
    """Return the CPU time to expect of a run by the next coarser one [s]; 0 if there is none."""
    coarser = [row for (*flow, n), row in rows.items() if flow == [case, variant] and n < resolution]
    if not coarser:
        return 0.0
    row = max(coarser, key=lambda row: row["resolution"])
    return row["cpu_per_time"] * row["until"] * (resolution / row["resolution"]) ** 3


def run(cases: list[str], most: float, folder: Path, sphinxsys: list[Path] | None) -> None:
    """Run what is missing, the coarse before the fine."""
    for case in cases:
        until, window, resolutions, variants, _ = CASES[case]
        for resolution, variant in itertools.product(resolutions, variants):
            rows = read()
            if (case, variant, resolution) in rows or likely(rows, case, variant, resolution) > most:
                continue
            _, code, more, _ = VARIANTS[variant]
            if code == "sphinxsys":
                if sphinxsys is None:
                    continue
                more = [*more, *(f"--{name}={path}" for name, path in zip(("source", "build"), sphinxsys, strict=True))]
            arguments = [case, f"--resolution={resolution}", f"--until={until}", f"--window={window}", *more]
            result = measure(code, arguments, folder)
            if result is None:
                continue
            row = {"case": case, "variant": variant, "resolution": resolution, "until": until} | result
            with ROWS.open("a") as file:
                file.write(json.dumps(row) + "\n")
            cost = f"{row['cpu_per_time']:.3g} s"
            print(f"{case} {variant} {resolution}: {cost}, error {error(case, row):.3%}", flush=True)


def plot(path: Path) -> None:
    """Draw the errors over the cost, a panel a case."""
    rows = read()
    figure = Figure(figsize=(10, 4), layout="constrained")
    for axes, (case, (_, _, resolutions, variants, title)) in zip(
        figure.subplots(1, len(CASES)), CASES.items(), strict=True
    ):
        for variant in variants:
            colour = plotting.PALETTE[list(VARIANTS).index(variant)]
            found = [rows[case, variant, n] for n in resolutions if (case, variant, n) in rows]
            cost, errors = [row["cpu_per_time"] for row in found], [100 * error(case, row) for row in found]
            axes.loglog(cost, errors, VARIANTS[variant][3], color=colour, ms=5, lw=1, label=VARIANTS[variant][0])
            for row, x, y in zip(found, cost, errors, strict=True):
                axes.annotate(
                    f"{row['resolution']}",
                    (x, y),
                    textcoords="offset points",
                    xytext=(0, 5),
                    fontsize=8,
                    ha="center",
                    color=colour,
                    path_effects=[withStroke(linewidth=2, foreground="white")],
                )
        axes.margins(x=0.12, y=0.12)
        axes.set_title(title, fontsize=10)
        axes.set(xlabel="CPU s a unit of flow time, one core", ylabel="error [%]")
        axes.grid(alpha=0.3, which="both")
        for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
            axis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < 100 * low else (1,)))
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter(NullFormatter())
    handles, names = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=len(names), fontsize=8)
    plotting.save(figure, path)


def main() -> None:
    """Run what is missing, print the table and draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", default=list(CASES), help=f"of {', '.join(CASES)}")
    parser.add_argument("--most", type=float, default=np.inf, help="largest expected CPU time of a run [s]")
    parser.add_argument("--plot", action="store_true", help="run nothing")
    parser.add_argument("--environments", type=Path, default=ENVIRONMENTS, help="folder for the environments")
    parser.add_argument("--sphinxsys", type=Path, nargs=2, metavar=("SOURCES", "BUILD"), help="where SPHinXsys is")
    options = parser.parse_args()
    options.environments.mkdir(parents=True, exist_ok=True)
    if not options.plot:
        run(options.cases, options.most, options.environments.resolve(), options.sphinxsys)
    cells = [
        [case, VARIANTS[variant][0], str(n), f"{row['cpu_per_time']:.3g}", f"{100 * error(case, row):.2g} %"]
        for (case, variant, n), row in sorted(read().items())
    ]
    print(markdown(["case", "code", "resolution", "CPU s a unit of flow time", "error"], cells))
    plot(PICTURE)


if __name__ == "__main__":
    main()
