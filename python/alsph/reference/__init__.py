"""Independent reference solutions that runs are compared with; README.md beside this file names their source."""

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from alsph.geometry import FloatArray

FOLDER = Path(__file__).parent
CHANNEL = {"case": "cylinder", "length": 14.0, "height": 13.0, "upstream": 4.0}
COLUMNS = {"mean drag coefficient": "CD_mean", "rms lift coefficient": "CL_rms", "Strouhal number": "St_fD_over_U"}


@dataclass(frozen=True, eq=False)
class Reference:
    """A reference solution.

    Attributes
    ----------
    results : dict
        Values by name, as in :meth:`alsph.Run.summary`.
    pressure_coefficient : (theta, mean), optional
        Degrees from the front stagnation point (m,), and C_p relative to the mean inlet pressure (m,).
    """

    results: dict[str, float]
    pressure_coefficient: tuple[FloatArray, FloatArray] | None = None


def rows(name: str) -> list[dict[str, str]]:
    """Return the rows of a CSV file of this folder by column."""
    with (FOLDER / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def find(case: dict[str, Any]) -> Reference | None:
    """Return the reference solution of a case with these parameters, None where there is none."""
    if case.items() >= CHANNEL.items():
        return _cylinder(case["reynolds"])
    if case.get("case") == "taylor_green" and case.get("dimensions") == 2:
        return Reference({"decay rate of the kinetic energy, U/D": 16 * np.pi**2 / case["reynolds"]})
    return None


def _cylinder(reynolds: float) -> Reference | None:
    row = next((row for row in rows("cylinder_summary.csv") if float(row["Re"]) == reynolds), None)
    if row is None:
        return None
    profile = FOLDER / f"cylinder_cp_Re{row['Re']}.csv"
    theta, mean = np.loadtxt(profile, delimiter=",", skiprows=1, usecols=(0, 1), unpack=True)
    return Reference({name: float(row[column]) for name, column in COLUMNS.items()}, (theta, mean))
