"""NACA airfoils beside the ordinates that Abbott and von Doenhoff (Theory of Wing Sections, 1959) print."""

import numpy as np
import pytest
import shapely
from alsph.cases import Body
from alsph.errors import ConfigError
from alsph.geometry.naca import _five, naca
from hypothesis import given
from hypothesis import strategies as st

STATIONS = [2.5, 5, 10, 20, 30, 40, 50]
"""Beyond, where the trailing edge is open in the book, ordinates differ by up to 0.13."""

PRINTED = {
    "2412": ([2.99, 4.13, 5.63, 7.26, 7.88, 7.80, 7.24], [-2.27, -3.01, -3.75, -4.23, -4.12, -3.80, -3.34]),
    "23012": ([3.61, 4.91, 6.43, 7.50, 7.55, 7.14, 6.41], [-1.71, -2.26, -2.92, -3.97, -4.46, -4.48, -4.17]),
    "0012": (
        [2.615, 3.555, 4.683, 5.737, 6.002, 5.803, 5.294],
        [-2.615, -3.555, -4.683, -5.737, -6.002, -5.803, -5.294],
    ),
}


@pytest.mark.parametrize("digits", PRINTED)
def test_ordinates_are_those_of_the_book(digits):
    cuts = shapely.linestrings([[(x / 100, -1), (x / 100, 1)] for x in STATIONS])
    _, lower, _, upper = 100 * shapely.bounds(shapely.intersection(naca(digits, 400), cuts)).T
    assert upper == pytest.approx(PRINTED[digits][0], abs=0.03)
    assert lower == pytest.approx(PRINTED[digits][1], abs=0.04)


def test_a_reflexed_mean_line_has_no_moment():
    """By thin-airfoil theory, about the quarter chord: of 231 next to none, of 230 −0.013."""
    theta = (np.arange(4000) + 0.5) * np.pi / 4000

    def moment(digits):
        _, slope = _five(digits, 0.5 * (1 - np.cos(theta)))
        first, second = (2 / np.pi * np.trapezoid(slope * np.cos(n * theta), theta) for n in (1, 2))
        return np.pi / 4 * (second - first)

    assert moment("23012") == pytest.approx(-0.013, abs=0.001) and abs(moment("23112")) < 0.002


@given(
    st.one_of(
        st.tuples(st.integers(0, 9), st.integers(1, 9)).map(lambda d: f"{d[0]}{d[1]}"),
        st.tuples(st.integers(1, 9), st.integers(2, 5), st.integers(0, 1)).map(lambda d: f"{d[0]}{d[1]}{d[2]}"),
    ),
    st.integers(6, 24),
)
def test_airfoils_are_as_thick_as_they_are_called(mean_line, thickness):
    airfoil = naca(f"{mean_line}{thickness:02d}")
    assert airfoil.is_valid and airfoil.bounds[2] == pytest.approx(1.0, abs=0.002)
    assert airfoil.area == pytest.approx(naca(f"00{thickness:02d}").area, rel=0.05)


@pytest.mark.parametrize(
    ("digits", "message"),
    [
        ("0000", "has no thickness"),
        ("2012", "the second digit, the place of the largest camber, must not be 0"),
        ("26012", "mean lines are L10 to L50 and, reflexed, L21 to L51"),
        ("21112", "mean lines are"),
        ("23212", "mean lines are"),
        ("03012", "L the design lift, 1 to 9"),
    ],
)
def test_what_is_no_airfoil_is_refused(digits, message):
    with pytest.raises(ConfigError, match=f"naca{digits}.*{message}"):
        Body(shape=f"naca{digits}")


def test_an_airfoil_is_a_shape_by_its_name():
    assert Body(shape="NACA 2412").outline.equals(Body(shape="naca2412").outline)
    assert Body(shape="naca4412").bounds != Body(shape="naca0012").bounds
