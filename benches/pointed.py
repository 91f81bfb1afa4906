"""Flow past bodies with points and edges, from rest: which of them break down.

    python benches/pointed.py                      # defaults: five minutes
    python benches/pointed.py --polygons 80        # triangles, polygons and stars: two minutes
    python benches/pointed.py --set shift_limit=0.3 --until 3

In small channels, from an impulsive start, where particles come nearest to the bodies.
"""

import argparse
import ast
import itertools
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
from alsph.cases import Body
from alsph.errors import ConfigError, SolverError

CHANNEL = {"length": 4, "height": 3, "upstream": 1.5}
AROUND = np.linspace(0, 2 * np.pi, 200, endpoint=False)
SHAPES = {
    "naca0012": "naca0012",
    "naca2412": "naca2412",
    "naca4412": "naca4412",
    "square": "square_cylinder",
    "ellipse, 5 : 1": np.stack([0.5 * np.cos(AROUND), 0.1 * np.sin(AROUND)], axis=1),
    "wedge": [(0, 0), (1, 0.2), (1, -0.2)],
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
    ("wedge", (0, 20), (200, 1000), (10, 12, 15)),
    ("ellipse, 5 : 1", (0, 10, 60), (200, 1000), (12, 16, 24)),
    ("plate, 0.08 D thick", (0, 10, 90), (200, 1000), (26, 32)),
]


def flows() -> Iterator[tuple[str, int, int, int]]:
    """Yield shape, angle of attack, Reynolds number and resolution of each flow."""
    for shape, *ranges in FLOWS:
        for angle, reynolds, resolution in itertools.product(*ranges):
            yield shape, angle, reynolds, resolution


def polygon(seed: int) -> np.ndarray:
    """Return the corners (n, 2) of a triangle, another polygon or a star, 1 D long."""
    random = np.random.default_rng(seed)
    corners = int(random.integers(3, 9))
    angle, radius = np.arange(corners) + random.uniform(0, 0.9, corners), random.uniform(0.4, 1, corners)
    if corners > 5 and random.random() < 0.5:
        angle, radius = np.arange(0, corners, 0.5), np.tile([1.0, random.uniform(0.3, 0.6)], corners)
    angle = (angle + random.random()) * 2 * np.pi / corners
    points = radius[:, None] * np.stack([np.cos(angle), random.uniform(0.3, 1) * np.sin(angle)], axis=1)
    return points / np.ptp(points[:, 0])


def bodies(polygons: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield name and parameters of each flow: as many past polygons, or those of `FLOWS`."""
    for seed in range(polygons):
        yield f"polygon {seed}", {"shape": polygon(seed), "reynolds": 200, "resolution": 8 + seed % 8}
    if not polygons:
        for shape, angle, reynolds, resolution in flows():
            parameters = {"angle_of_attack": angle, "reynolds": reynolds, "resolution": resolution}
            yield f"{shape}, {angle} degrees, Re = {reynolds}", {"shape": SHAPES[shape], **parameters}


def main() -> None:
    """Run all and name those that break down."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--until", type=float, default=1.0, help="end time [D/U]")
    parser.add_argument("--polygons", type=int, default=0, metavar="N", help="as many polygons in place of the bodies")
    parser.add_argument("--set", nargs="*", default=[], metavar="NAME=VALUE", help="settings of the method")
    options = parser.parse_args()
    settings = {name: ast.literal_eval(value) for name, value in (pair.split("=", 1) for pair in options.set)}
    warnings.simplefilter("ignore")
    broken = total = refused = 0
    for name, parameters in bodies(options.polygons):
        case = Body(**CHANNEL, **parameters, **settings)
        try:
            simulation = case.simulation()
        except ConfigError:
            refused += 1
            continue
        total += 1
        try:
            simulation.run_until(options.until)
        except SolverError as error:
            broken += 1
            print(f"{name}, D/Δx = {case.resolution:g}: {str(error).split(';')[0]}", flush=True)
    print(f"{broken} of {total} broke down before t* = {options.until:g}; {refused} more are too thin and were refused")


if __name__ == "__main__":
    main()
