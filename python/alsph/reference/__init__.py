"""Independent reference solutions that runs are compared with; README.md beside this file names their source."""

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from alsph.arrays import FloatArray

FOLDER = Path(__file__).parent
COLUMNS = {
    "mean drag coefficient": "CD_mean",
    "mean drag coefficient, pressure part": "CDp",
    "mean drag coefficient, viscous part": "CDf",
    "rms lift coefficient": "CL_rms",
    "lift coefficient amplitude": "CL_amp",
    "Strouhal number": "St_fD_over_U",
}


@dataclass(frozen=True, eq=False)
class Reference:
    """A reference solution.

    Attributes
    ----------
    results : dict
        Values by name, as in :meth:`alsph.Run.summary`.
    source : str
        Who computed them, and how.
    pressure_coefficient : (theta, mean), optional
        Degrees from the front stagnation point (m,), and C_p relative to the mean inlet pressure (m,).
    """

    results: dict[str, float]
    source: str
    pressure_coefficient: tuple[FloatArray, FloatArray] | None = None


def cylinder_in_channel(reynolds: float) -> Reference | None:
    """Return the flow past a cylinder in the paper's channel, None at a Reynolds number that is not known."""
    source = "finite elements of order 4 in the same channel"
    results = _results("cylinder_summary.csv", reynolds)
    if results is None:
        return None
    theta, mean, *_ = table(f"cylinder_cp_Re{reynolds:g}.csv")
    return Reference(results, source, (theta, mean))


def unconfined_cylinder(reynolds: float) -> Reference | None:
    """Return the flow past a cylinder far from all sides, None at a Reynolds number that is not known."""
    results = _results("cylinder_unconfined.csv", reynolds)
    return Reference(results, "Qu, Norberg, Davidson, Peng and Wang (2013)") if results else None


def rows(name: str) -> list[dict[str, str]]:
    """Return the rows of a CSV file of this folder by column."""
    with (FOLDER / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def row(name: str, reynolds: float, column: str = "Re") -> dict[str, str] | None:
    """Return the row of a CSV file of this folder with that Reynolds number in `column`, None where there is none."""
    return next((row for row in rows(name) if float(row[column]) == reynolds), None)


def matching(name: str, given: Mapping[str, float | str]) -> dict[str, float]:
    """Return the numbers of the first row of a CSV file of this folder whose columns have what is `given`.

    An empty cell is NaN; columns that are given in words are left out. Nothing if there is no such row.
    """
    words = [column for column, value in given.items() if isinstance(value, str)]
    for row in rows(name):
        named = all(row.pop(word) == given[word] for word in words)
        numbers = {column: float(cell or "nan") for column, cell in row.items()}
        if named and all(numbers[column] == value for column, value in given.items() if column not in words):
            return numbers
    return {}


def table(name: str) -> FloatArray:
    """Return the columns (k, n) of a file of numbers with one line of header."""
    return np.loadtxt(FOLDER / name, delimiter=",", skiprows=1, unpack=True)


def curve(name: str) -> FloatArray:
    """Return the columns (k, n) of such a file in the order of the first: digitised points turn back in time."""
    columns = table(name)
    return np.asarray(columns[:, np.argsort(columns[0], kind="stable")])


def _results(name: str, reynolds: float) -> dict[str, float] | None:
    """Return the values in the row of a Reynolds number, None where there is no such row."""
    known = row(name, reynolds)
    return {name: float(known[column]) for name, column in COLUMNS.items() if column in known} if known else None
