"""NACA airfoils of four and five digits (Jacobs, Ward and Pinkerton 1933; Jacobs and Pinkerton 1935)."""

import re

import numpy as np
import shapely

from alsph.arrays import FloatArray

NAME = re.compile(r"naca[ _-]?([0-9]{4,5})", re.IGNORECASE)

THICKNESS = np.array([0.2969, -0.1260, -0.3516, 0.2843, -0.1036])
"""Coefficients of √x, x, x², x³ and x⁴; the last one closes the trailing edge (−0.1015 leaves it open)."""

SIMPLE = {
    1: (0.0580, 361.4, 0.0),
    2: (0.1260, 51.64, 0.0),
    3: (0.2025, 15.957, 0.0),
    4: (0.2900, 6.643, 0.0),
    5: (0.3910, 3.230, 0.0),
}
"""m, k₁ and no k₂ of the mean lines 210 to 250, by the second digit."""

REFLEX = {
    2: (0.1300, 51.990, 0.000764),
    3: (0.2170, 15.793, 0.00677),
    4: (0.3180, 6.520, 0.0303),
    5: (0.4410, 3.191, 0.1355),
}
"""m, k₁ and k₂/k₁ of the mean lines 221 to 251."""


def naca(digits: str, count: int = 100) -> shapely.Polygon:
    """Return the airfoil of chord 1 with these digits, a closed trailing edge and 2 count points.

    Raises
    ------
    ValueError
        If there is no such airfoil.
    """
    if digits.endswith("00"):
        raise ValueError(f"NACA {digits} has no thickness: the last two digits are it in % of the chord")
    x = 0.5 * (1 - np.cos(np.linspace(0, np.pi, count + 1)))
    half = int(digits[-2:]) / 20 * THICKNESS @ np.stack([np.sqrt(x), x, x**2, x**3, x**4])
    line, slope = _four(digits, x) if len(digits) == 4 else _five(digits, x)
    sin, cos = slope / np.hypot(1, slope), 1 / np.hypot(1, slope)
    upper = np.stack([x - half * sin, line + half * cos], axis=1)
    lower = np.stack([x + half * sin, line - half * cos], axis=1)
    airfoil = shapely.Polygon(np.concatenate([upper, lower[-2:0:-1]]))
    if not airfoil.is_valid:
        raise ValueError(f"NACA {digits}: its sides cross")
    return airfoil


def _four(digits: str, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return mean line and slope: two parabolas that meet in the largest camber."""
    camber, place = int(digits[0]) / 100, int(digits[1]) / 10
    if not camber:
        return 0 * x, 0 * x
    if not place:
        raise ValueError(f"NACA {digits}: the second digit, the place of the largest camber, must not be 0")
    before = x < place
    extent = np.where(before, place, 1 - place)
    line = camber / extent**2 * (np.where(before, 0, 1 - 2 * place) + 2 * place * x - x**2)
    return line, 2 * camber / extent**2 * (place - x)


def _five(digits: str, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return mean line and slope: a cubic in front, a straight line or, reflexed, another cubic behind."""
    lift, place, reflexed = (int(digit) for digit in digits[:3])
    known = {0: SIMPLE, 1: REFLEX}.get(reflexed, {})
    if not lift or place not in known:
        lines = "mean lines are L10 to L50 and, reflexed, L21 to L51, L the design lift, 1 to 9"
        raise ValueError(f"NACA {digits}: {lines}")
    m, k, ratio = known[place]
    k *= lift / 2
    ahead = np.minimum(x - m, 0)
    if not reflexed:
        return k / 6 * (ahead**3 + m**3 * (1 - x)), k / 6 * (3 * ahead**2 - m**3)
    behind = np.maximum(x - m, 0)
    straight = ratio * (1 - m) ** 3 + m**3
    line = k / 6 * (ahead**3 + ratio * behind**3 - straight * x + m**3)
    return line, k / 6 * (3 * ahead**2 + 3 * ratio * behind**2 - straight)
