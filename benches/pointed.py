"""Flow past bodies with points and edges, from rest: which of them break down.

    python benches/pointed.py                      # defaults: five minutes
    python benches/pointed.py --set shift_limit=0.3 --until 3

In small channels, from an impulsive start, where particles come nearest to the bodies.
"""

import argparse
import ast
import itertools
import warnings
from collections.abc import Iterator

import numpy as np
from alsph.cases import Body
from alsph.errors import SolverError

AROUND = np.linspace(0, 2 * np.pi, 200, endpoint=False)
SHAPES = {
    "naca0012": "naca0012",
    "naca2412": "naca2412",
    "naca4412": "naca4412",
    "square": "square_cylinder",
    "ellipse, 5 : 1": np.stack([0.5 * np.cos(AROUND), 0.1 * np.sin(AROUND)], axis=1),
    "triangle": [(-0.3, 0), (0.6, -0.35), (0.6, 0.35)],
    "plate, 0.08 D thick": [(-0.5, -0.04), (0.5, -0.04), (0.5, 0.04), (-0.5, 0.04)],
}

# Shape, angles of attack, Reynolds numbers, resolutions.
FLOWS = [
    ("naca0012", (5, 10), (200, 500), (18, 19, 20, 21, 22, 24)),
    ("naca2412", (5, 10), (200, 500), (18, 19, 20, 21, 22, 24)),
    ("naca0012", (5, 10), (200, 1000), (28, 32, 40)),
    ("naca4412", (8,), (200, 1000), (28, 40)),
    ("square", (0, 10, 45), (200, 1000), (10, 16, 24)),
    ("triangle", (0, 20), (200, 1000), (10, 20)),
    ("ellipse, 5 : 1", (0, 10, 60), (200, 1000), (12, 16, 24)),
    ("plate, 0.08 D thick", (0, 10, 90), (200, 1000), (26, 32)),
]


def flows() -> Iterator[tuple[str, int, int, int]]:
    """Yield shape, angle of attack, Reynolds number and resolution of each flow."""
    for shape, *ranges in FLOWS:
        for angle, reynolds, resolution in itertools.product(*ranges):
            yield shape, angle, reynolds, resolution


def main() -> None:
    """Run all and name those that break down."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--until", type=float, default=1.0, help="end time [D/U]")
    parser.add_argument("--set", nargs="*", default=[], metavar="NAME=VALUE", help="settings of the method")
    options = parser.parse_args()
    settings = {name: ast.literal_eval(value) for name, value in (pair.split("=", 1) for pair in options.set)}
    warnings.simplefilter("ignore")
    broken = total = 0
    for shape, angle, reynolds, resolution in flows():
        channel = {"length": 4, "height": 3, "upstream": 1.5, "angle_of_attack": angle}
        case = Body(shape=SHAPES[shape], reynolds=reynolds, resolution=resolution, **channel, **settings)
        total += 1
        try:
            case.simulation().run_until(options.until)
        except SolverError as error:
            broken += 1
            print(
                f"{shape}, {angle} degrees, Re = {reynolds}, D/Δx = {resolution}: {str(error).split(';')[0]}",
                flush=True,
            )
    print(f"{broken} of {total} broke down before t* = {options.until:g}")


if __name__ == "__main__":
    main()
