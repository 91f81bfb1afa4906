"""Numbers over time, such as those of gauges, in small CSV files of the run folder."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from alsph.analysis.record import Record
from alsph.arrays import FloatArray
from alsph.engine.simulation import Simulation
from alsph.errors import ConfigError
from alsph.text import printable, shown


class Series(ABC):
    """Numbers over time in a CSV file of the run folder, an :class:`alsph.engine.output.Output`.

    A line that names the columns comes first. A file that an older version began has its own columns, or no line that
    names them, and goes on so.

    Parameters
    ----------
    columns
        What the numbers are, with their units and without commas; the first is the time.

    Attributes
    ----------
    file : str
        Its name, ``output_NAME.csv``.
    interval : float
        Time between two records [D/U].

    Raises
    ------
    ConfigError
        If a column has the name of another, or a record holds not a number for each column but the time.
    """

    file: str
    interval: float

    def __init__(self, columns: Sequence[str]) -> None:
        if twice := [name for name, count in Counter(columns).items() if count > 1]:
            raise ConfigError(
                f"output {self.file}: two columns are called '{printable(twice[0])}'; each needs its own name"
            )
        self.columns = list(columns)
        self.rows: list[list[str]] = []

    @abstractmethod
    def values(self, simulation: Simulation) -> FloatArray:
        """Return the present numbers (m,)."""

    def record(self, simulation: Simulation, rows: Mapping[str, NDArray[Any]]) -> None:
        """Keep them."""
        given: Any = self.values(simulation)
        try:
            numbers = np.asarray(given)
            wrong = numbers.ndim != 1 or numbers.dtype.kind not in "iufb"
        except ValueError:
            wrong = True
        if wrong:
            raise ConfigError(f"output {self.file}: values() gave {shown(given)}: must return an array (m,) of numbers")
        row = [*map(_digits, (simulation.time, *numbers))]
        if len(row) != len(self.columns):
            count, names = len(row) - 1, len(self.columns) - 1
            raise ConfigError(f"output {self.file}: values() gave {count} numbers for {names} columns beside the time")
        self.rows.append(row)

    def append(self, path: Path) -> None:
        """Append what has been kept to the file."""
        with path.open("a+", encoding="utf-8") as file:
            if not file.tell():
                file.write(",".join(self.columns) + "\n")
            file.seek(0)
            head = file.readline().rstrip("\n").split(",")
            places = [self.columns.index(name) if name in self.columns else None for name in head]
            named = any(place is not None for place in places)
            for row in self.rows:
                kept = ["nan" if place is None else row[place] for place in places] if named else row[: len(head)]
                file.write(",".join(kept) + "\n")
        self.rows = []

    def truncate(self, path: Path, time: float) -> None:
        """Drop what is later than `time`, and a line that was cut."""
        head, rows = _lines(path)
        last = float(_digits(time))  # a line of that very time may be rounded up
        new = path.with_name(f"{path.name}.new")
        new.write_text("".join(head + [row for row in rows if _time(row) <= last]), encoding="utf-8")
        new.replace(path)

    @classmethod
    def read(cls, run: Record) -> tuple[FloatArray, FloatArray]:
        """Return times (k,) and numbers (m, k) of a run; (0,) and (1, 0) where it has none."""
        path = run.file(cls.file)
        rows = _lines(path)[1] if path.exists() else []
        if not rows:
            return np.empty(0), np.empty((1, 0))
        table = np.loadtxt(rows, delimiter=",", ndmin=2).T
        return table[0], table[1:]


def names(path: Path) -> list[str]:
    """Return what a file calls its columns; none if there is no file, or no line that names them."""
    if not path.exists():
        return []
    with path.open(encoding="utf-8") as file:
        head = file.readline()
    return head.rstrip("\n").split(",") if head.endswith("\n") and np.isnan(_time(head)) else []


def _lines(path: Path) -> tuple[list[str], list[str]]:
    """Return the whole lines of a file that hold no numbers, and those that do."""
    lines = [line for line in path.read_text(encoding="utf-8").splitlines(keepends=True) if line.endswith("\n")]
    first = 1 if lines and np.isnan(_time(lines[0])) else 0
    return lines[:first], lines[first:]


def _digits(number: float) -> str:
    """Return a number as files have it."""
    return f"{number:.9g}"


def _time(line: str) -> float:
    try:
        return float(line.split(",")[0])
    except ValueError:
        return np.nan
