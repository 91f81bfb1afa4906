"""Recorded loads beside the momentum balance of four boxes around the body and the integral of C_p over its surface.

    python benches/loads.py
    python benches/loads.py naca0012 --resolution 40 --angle 10 --reynolds 500 --start 0.3 --until 0.8 --channel 4 3 1.6
    python benches/loads.py plate_0.25 --resolution 10 --start 1.2 --until 3

In small channels, from an impulsive start, after which waves between the walls swing the lift: so a balance is taken
every 0.01 D/U.
"""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from balance import body, loads  # noqa: E402

SHAPES = ("circle", "square_cylinder", "ellipse_0.4", "plate_0.25", "plate_0.3", "plate_0.4", "naca0012")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shapes", nargs="*", default=SHAPES)
    parser.add_argument("--resolution", type=int, default=20)
    parser.add_argument("--reynolds", type=float, default=100.0)
    parser.add_argument("--angle", type=float, default=0.0)
    parser.add_argument("--start", type=float, default=1.0)
    parser.add_argument("--until", type=float, default=2.0)
    parser.add_argument("--every", type=float, default=0.01)
    parser.add_argument(
        "--channel", type=float, nargs=3, default=(5.0, 4.0, 2.0), metavar=("LENGTH", "HEIGHT", "UPSTREAM")
    )
    options = parser.parse_args()
    print(f"{'':16s} C_D recorded, boxes          C_L recorded, boxes          C_p: pressure part, integral  max |C_L|")
    for shape in options.shapes:
        given = {"resolution": options.resolution, "reynolds": options.reynolds, "angle_of_attack": options.angle}
        given |= dict(zip(("length", "height", "upstream"), options.channel, strict=True))
        found = loads(body(shape, **given), options.start, options.until, options.every)
        pairs = zip(found.recorded, found.boxes, found.spread, strict=True)
        columns = [f"{recorded:8.4f} {boxes:8.4f} ± {spread:.4f}" for recorded, boxes, spread in pairs]
        pressure = "  ".join(f"{a:.4f} {b:.4f}" for a, b in zip(found.pressure, found.surface, strict=True))
        print(f"{shape:16s} {'   '.join(columns)}   {pressure}   {found.largest_lift:.1e}", flush=True)


if __name__ == "__main__":
    main()
