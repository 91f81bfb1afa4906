"""The paper's figures at its own resolutions, D/Δx = 20 and 30, from the runs that there are.

Runs take hours each and their folders do not last, so a row of each is kept in docs/studies/resolved/rows.csv,
whatever study it was made in, and one of its mean C_p by degrees from the front in pressure_coefficient.csv. `add` puts
in the rows of a run folder, in place of those of the same flow and method; without it the figures are drawn.

    python benches/paper.py add runs/studies/runs/cylinder_NAME --commit 41e3d16 --cpu-seconds 5581
    python benches/paper.py
"""

import argparse
import csv
from collections.abc import Sequence
from pathlib import Path

import alsph
import numpy as np
from alsph import plotting, reference
from alsph.analysis.window import DEVELOPING
from alsph.plotting import Curve

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "studies" / "resolved"
ROWS = FOLDER / "rows.csv"
PROFILES = FOLDER / "pressure_coefficient.csv"

# What a row is of; the same of two runs is the same flow by the same method.
KEY = ("resolution", "reynolds", "method", "algorithm", "iterations", "time_step")

DRAG, LIFT, STROUHAL = "mean drag coefficient", "rms lift coefficient", "Strouhal number"
PRESSURE, VISCOUS = f"{DRAG}, pressure part", f"{DRAG}, viscous part"
DIVERGENCE, AT_END = "mean velocity divergence", "mean velocity divergence at the end of a step"
MEASURES = (DRAG, PRESSURE, VISCOUS, LIFT, STROUHAL, DIVERGENCE)
COLUMNS = (
    *KEY,
    *(column for name in MEASURES for column in (name, f"{name}, ±")),
    AT_END,
    "largest error of the pressure coefficient",
    "from",
    "to",
    DEVELOPING,
    "CPU seconds",
    "commit",
)

# The pressure of (20), and the wall's own velocity or, after a comma, the rule by which it is extrapolated.
PAPERS_WALLS = "the paper's walls"

DEGREES = [str(degrees) for degrees in range(0, 181, 5)]

# The paper's Table 1: Re = 200, D/Δx = 30.
PRINTED = {1: {DRAG: 1.427, LIFT: 0.478, STROUHAL: 0.213}, 2: {DRAG: 1.428, LIFT: 0.482, STROUHAL: 0.211}}

LABELS = {
    DRAG: "$C_D'$",
    LIFT: "$C_L'$",
    STROUHAL: "Sr",
    DIVERGENCE: "mean $|\\nabla\\cdot u|\\,D/U$, in the frame of the step",
    AT_END: "the same at the end of the step",
    "reynolds": "Re",
    "time_step": "$\\Delta tU/\\Delta x$",
    "iterations": "iterations in a step",
}

# Abscissa, what else is fixed, ordinates, and logarithmic axes of each figure.
FIGURES = {
    "figure_3": ("time_step", {"reynolds": 200, "iterations": 5}, (DRAG, LIFT), ("x",)),
    "figure_4": ("time_step", {"reynolds": 200, "iterations": 5}, (STROUHAL,), ("x",)),
    "figure_5": ("time_step", {"reynolds": 200, "iterations": 5}, (DIVERGENCE, AT_END), ("x",)),
    "figure_6": ("iterations", {"reynolds": 200, "time_step": 0.0508}, (DRAG, LIFT), ("x",)),
    "figure_7": ("iterations", {"reynolds": 200, "time_step": 0.0508}, (STROUHAL,), ("x",)),
    "figure_8": ("iterations", {"reynolds": 200, "time_step": 0.0508}, (DIVERGENCE, AT_END), ("x",)),
    "figure_11": ("reynolds", {"iterations": 5, "time_step": 0.0508}, (DRAG, LIFT), ()),
    "figure_12": ("reynolds", {"iterations": 5, "time_step": 0.0508}, (STROUHAL,), ()),
    "figure_13": ("reynolds", {"iterations": 5, "time_step": 0.0508}, (DIVERGENCE, AT_END), ()),
}


def method(case: alsph.cases.Cylinder) -> str:
    """Return what a run's method is called here."""
    if case.projection_sweeps:
        return "alsph's defaults"
    if case.wall_pressure != "paper":
        return "the paper's steps"
    return PAPERS_WALLS if case.wall_velocity == "paper" else f"{PAPERS_WALLS}, {case.wall_velocity}"


def row(run: alsph.Run, commit: str, cpu_seconds: float) -> dict[str, str]:
    """Return the row of a run."""
    case, window = run.config.case, run.window
    found = {measure.name: measure.value for measure in run.measures}
    found[DIVERGENCE] = run.divergence.mean
    times = [time for time in run.times if window.start <= time <= window.end]
    ends = (run.snapshot(time) for time in times)
    divergence = [np.abs(end.velocity_divergence[end.kind == 0]).mean() for end in ends]
    surface = [float(value) for name, value in found.items() if name.startswith("largest error of the pressure")]
    return {
        "resolution": f"{case.resolution:g}",
        "reynolds": f"{case.reynolds:g}",
        "method": method(case),
        "algorithm": str(case.algorithm),
        "iterations": str(case.max_iterations),
        "time_step": f"{case.time_step:g}" if case.penalty_constant else "",
        **{name: f"{float(found[name]):.6g}" for name in MEASURES},
        **{f"{name}, ±": f"{found[name].uncertainty:.2g}" for name in MEASURES},
        AT_END: f"{np.mean(divergence):.3g}" if divergence else "",
        "largest error of the pressure coefficient": f"{surface[0]:.3g}" if surface else "",
        "from": f"{window.start:.1f}",
        "to": f"{window.end:.1f}",
        DEVELOPING: "yes" if window.developing else "",
        "CPU seconds": f"{cpu_seconds:.0f}",
        "commit": commit,
    }


def profile(run: alsph.Run) -> dict[str, str]:
    """Return the mean C_p of a run, that of both sides."""
    (found,) = run.profiles
    return {at: f"{np.interp(float(at), *found.computed):.4f}" for at in DEGREES}


def read(path: Path) -> list[dict[str, str]]:
    """Return the rows that are there."""
    with path.open() as file:
        return list(csv.DictReader(file))


def add(path: Path, columns: Sequence[str], new: dict[str, str]) -> None:
    """Put a row in."""
    rows = {tuple(each[name] for name in KEY): each for each in [*read(path), new]}
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows[key] for key in sorted(rows))


def number(text: str) -> float:
    """Return a cell's number, NaN for an empty one."""
    return float(text) if text else np.nan


def curve(label: str, points: list[tuple[float, float, float]], **style: str) -> Curve:
    """Return a curve through (abscissa, value, ±)."""
    x, value, bar = zip(*sorted(points), strict=True)
    return Curve(label, list(x), list(value), [0.0 if np.isnan(each) else each for each in bar], **style)


def curves(rows: list[dict[str, str]], x: str, fixed: dict[str, float], y: str) -> list[Curve]:
    """Return a panel: runs by method and resolution, the defaults, references, the paper's Table 1."""
    series: dict[str, list[tuple[float, float, float]]] = {}
    early = []
    for each in rows:
        defaults = each["method"] == "alsph's defaults"
        wanted = x == "reynolds" if defaults else all(number(each[name]) == value for name, value in fixed.items())
        if not (wanted and each[y]):
            continue
        name = "defaults" if defaults else f"Algorithm {each['algorithm']}"
        walls = f", {each['method']}" if each["method"].startswith(PAPERS_WALLS) else ""
        point = (number(each[x]), number(each[y]), number(each.get(f"{y}, ±", "")))
        series.setdefault(f"{name}{walls}, $D/\\Delta x$ = {each['resolution']}", []).append(point)
        if each[DEVELOPING]:
            early.append((*point[:2], 0.0))
    found = [curve(label, points) for label, points in sorted(series.items())]
    if early:
        found.append(curve(DEVELOPING, early, style="x", colour="k"))
    exact = {reynolds: reference.cylinder_in_channel(reynolds) for reynolds in (100, 150, 200, 250, 300)}
    known = {reynolds: each.results[y] for reynolds, each in exact.items() if each and y in each.results}
    if x == "reynolds" and known:
        found.append(
            curve("reference", [(reynolds, value, 0.0) for reynolds, value in known.items()], style="d--", colour="k")
        )
    elif 200 in known:
        ends = {value for line in found for value in line.x}
        found.append(
            curve("reference", [(end, known[200], 0.0) for end in (min(ends), max(ends))], style="--", colour="k")
        )
    at = {"reynolds": 200, "time_step": 0.0508, "iterations": 5}[x]
    found += [
        curve(f"paper, Algorithm {algorithm}, Table 1", [(at, values[y], 0.0)], style=marker, colour="k")
        for (algorithm, values), marker in zip(PRINTED.items(), "*+", strict=True)
        if y in values
    ]
    return found


def draw() -> None:
    """Draw the figures that have two abscissae or more."""
    rows = read(ROWS)
    for name, (x, fixed, ordinates, logarithmic) in FIGURES.items():
        shown = {LABELS[y]: curves(rows, x, fixed, y) for y in ordinates}
        if len({value for lines in shown.values() for line in lines for value in line.x}) < 2:
            continue
        picture = plotting.panels(shown, LABELS[x], logarithmic)
        flows = [{"case": "cylinder", "resolution": resolution, **fixed} for resolution in (20, 30)]
        plotting.head(picture, plotting.title(flows))
        plotting.save(picture, FOLDER / f"{name}.png", dpi=120)


def draw_pressure() -> None:
    """Draw C_p over the angle, Figure 10: each number of iterations, a panel for either wall."""
    fixed = {"reynolds": 200, "time_step": 0.0508}
    shown: dict[str, list[Curve]] = {}
    for each in read(PROFILES):
        if all(number(each[name]) == value for name, value in fixed.items()):
            walls = each["method"] if each["method"].startswith(PAPERS_WALLS) else "alsph's walls"
            label = "Algorithm {algorithm}, {iterations} iterations, $D/\\Delta x$ = {resolution}".format(**each)
            points = [(float(at), number(each[at]), 0.0) for at in DEGREES]
            shown.setdefault(f"$C_p'$, {walls}", []).append(curve(label, points, style="-"))
    known = reference.cylinder_in_channel(200)
    if shown and known and known.pressure_coefficient:
        points = [(at, value, 0.0) for at, value in zip(*known.pressure_coefficient, strict=True)]
        for lines in shown.values():
            lines.append(curve("reference", points, style="--", colour="k"))
        picture = plotting.panels(shown, "degrees from the front")
        plotting.head(picture, plotting.title([{"case": "cylinder", **fixed}]))
        plotting.save(picture, FOLDER / "figure_10.png", dpi=120)


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command")
    adding = commands.add_parser("add", help="put in the rows of a run folder")
    adding.add_argument("run", type=Path, help="run folder")
    adding.add_argument("--commit", required=True, help="commit that it was made with")
    adding.add_argument("--cpu-seconds", type=float, required=True, help="what it took [s]")
    arguments = parser.parse_args()
    if arguments.command:
        run = alsph.open_run(arguments.run)
        found = row(run, arguments.commit, arguments.cpu_seconds)
        add(ROWS, COLUMNS, found)
        add(PROFILES, (*KEY, *DEGREES), {name: found[name] for name in KEY} | profile(run))
    else:
        draw()
        draw_pressure()


if __name__ == "__main__":
    main()
