"""The loads that a run records are those of the flow: the momentum balance of boxes around the body gives the same."""

from pathlib import Path

import pytest
from alsph import cases
from balance import CHANNEL, body, loads

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.mark.parametrize(
    "shape, options, start, until, tolerance",
    [
        ("circle", {"resolution": 10}, 0.5, 1.25, 0.03),
        ("square_cylinder", {"resolution": 10}, 4.0, 8.0, 0.03),
        ("ellipse_0.4", {"resolution": 12, "angle_of_attack": 15.0}, 0.8, 1.6, 0.03),
        ("plate_0.3", {"resolution": 10}, 0.5, 1.25, 0.03),
        ("wedge_0.4", {"resolution": 12}, 0.8, 1.6, 0.05),
        ("naca0012", {"resolution": 20, "angle_of_attack": 10.0, "reynolds": 500.0}, 0.4, 0.8, 0.08),
    ],
)
def test_recorded_loads_are_the_momentum_that_the_flow_loses(shape, options, start, until, tolerance):
    found = loads(body(shape, **options), start, until)
    largest = abs(found.boxes).max()
    assert found.recorded == pytest.approx(found.boxes, abs=tolerance * largest), (found.recorded, found.spread)


def test_so_are_those_on_the_array_of_the_examples():
    array = cases.find("cylinder_array.py", EXAMPLES)
    channel = CHANNEL | {"height": 6.0, "resolution": 16}
    found = loads(array(**channel), 0.5, 1.25)
    assert found.recorded == pytest.approx(found.boxes, abs=0.03 * abs(found.boxes).max()), (
        found.recorded,
        found.spread,
    )
    assert found.largest_lift < 1e-5
