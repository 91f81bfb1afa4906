"""Results in SI: those of a run that have a dimension, by what their names say that they are."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from alsph.analysis.averages import Estimate
from alsph.symbols import GENERAL, Symbols
from alsph.units import QUANTITIES, Quantity, Units

IN_UNITS: dict[str, Quantity] = {
    ", D": "length",
    ", U": "velocity",
    ", U/D": "rate",
    ", ρU²": "pressure",
    ", tU/D": "time",
    " tU/D": "time",
}
"""What a result is whose name ends so, or so in the names of the case."""

REFERENCE = ", reference"

FORCE = re.compile(r"\b(drag|lift) coefficient\b(?!.*\b(over|Morison)\b)")
"""What a result is called that is a force; a ratio of two is none, nor is a part of one that swings."""


def dimensional(
    results: Mapping[str, Any],
    units: Units,
    dimensions: int,
    area: float,
    chord: float,
    symbols: Symbols = GENERAL,
) -> dict[str, Estimate]:
    """Return those of the results of a run that have a dimension, in SI, under their names with the unit.

    Parameters
    ----------
    results
        Results in D, U and ρ by name; coefficients are F/(½ρU²A) and M/(½ρU²c²).
    units
        What D, U and ρ are.
    dimensions
        Number of space dimensions: in 2-D forces are per length.
    area
        A that force coefficients are formed with, of the whole body: a length in 2-D [D], an area in 3-D [D²].
    chord
        Length c that moment coefficients are formed with [D].
    symbols
        What the case calls D and U.
    """
    found = {}
    for name, value in results.items():
        base = name.removesuffix(REFERENCE)
        known = _known(base, dimensions, area, chord, symbols)
        if known and isinstance(value, Estimate):
            title, quantity, share = known
            factor = share * units.factor(quantity)
            own = f"{title}{REFERENCE if base != name else ''}, {QUANTITIES[quantity][0]}"
            found[own] = Estimate(value * factor, value.uncertainty * factor, value.note)
    return found


def _known(
    name: str, dimensions: int, area: float, chord: float, symbols: Symbols
) -> tuple[str, Quantity, float] | None:
    """Return what a result is called in SI, its quantity, and the share of its unit that it is given in."""
    if name == "Strouhal number":
        return "shedding frequency", "frequency", 1.0
    if FORCE.search(name):
        force: Quantity = "force_per_length" if dimensions == 2 else "force"
        return name.replace(" coefficient", ""), force, 0.5 * area
    if "moment coefficient" in name and dimensions == 2:
        return name.replace(" coefficient", ""), "moment_per_length", 0.5 * chord**2
    for end, quantity in IN_UNITS.items():
        for said in (end, symbols(end)):
            if name.endswith(said):
                return name.removesuffix(said), quantity, 1.0
    return None
