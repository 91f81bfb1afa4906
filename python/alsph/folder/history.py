"""``history.csv``: a row for each step, a number in each column."""

import codecs
import csv
from collections.abc import Iterator
from pathlib import Path

from alsph.arrays import AXES, Arrays
from alsph.folder.durable import replacing

UNKNOWN = "nan"
"""What stands in it for what an older alsph did not record."""


def flatten(rows: Arrays, bodies: list[str]) -> Arrays:
    """Return the history with vectors split into one column a component, ``BODY_pressure_force_x`` and so on."""
    columns = {}
    for name, values in rows.items():
        if values.ndim == 1:
            columns[name] = values
            continue
        for index, body in enumerate(bodies):
            for component, axis in zip(values[:, index].T, AXES if values.shape[2] > 1 else ("",), strict=False):
                columns[f"{body}_{name}_{axis}".rstrip("_")] = component
    return columns


def lines(columns: Arrays) -> Iterator[dict[str, str]]:
    """Yield the rows of what :func:`flatten` gives as they stand in the file, by column."""
    texts = (map(_text, column.tolist()) for column in columns.values())
    return (dict(zip(columns, row, strict=True)) for row in zip(*texts, strict=True))


def _text(value: float) -> str:
    return f"{value:.10g}" if isinstance(value, float) else str(int(value))


def names(path: Path) -> list[str]:
    """Return the names of the columns of a file, none if there is none, or it is damaged."""
    if not path.exists():
        return []
    with path.open("rb") as file:
        header = file.readline()
    return header.decode("utf-8-sig", errors="replace").rstrip().split(",") if _names_columns(header) else []


def _names_columns(line: bytes) -> bool:
    return line.removeprefix(codecs.BOM_UTF8).startswith(b"step,") and line.endswith(b"\n")


def append(path: Path, columns: Arrays, order: list[str]) -> None:
    """Append what :func:`flatten` gives to a file whose columns have this order, and begin one that is not there."""
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, order, restval=UNKNOWN, lineterminator="\n")
        if file.tell() == 0:
            writer.writeheader()
        writer.writerows(lines(columns))


def widen(path: Path, columns: list[str]) -> None:
    """Give a file further columns, unknown in all its rows."""
    with path.open("rb") as file, replacing(path) as new_path, new_path.open("wb") as new:
        new.write(b",".join([next(file).rstrip(b"\r\n"), *(name.encode() for name in columns)]) + b"\n")
        new.writelines(row.rstrip(b"\r\n") + f",{UNKNOWN}".encode() * len(columns) + b"\n" for row in file)


def truncate(path: Path, last: int) -> None:
    """Keep the rows up to a step, without those that were cut or cannot be read.

    Raises
    ------
    ValueError
        If steps do not follow each other.
    """
    with path.open("rb") as file, replacing(path) as new_path:
        header = next(file, b"")
        if header and not _names_columns(header):
            raise ValueError("its first line does not name its columns")
        with new_path.open("wb") as new:
            new.write(header)
            before = 0
            for row in file:
                number = row.split(b",")[0] if row.count(b",") == header.count(b",") and row.endswith(b"\n") else b""
                if not number.isdigit():
                    continue
                if int(number) <= before:
                    raise ValueError(f"step {int(number)} stands behind step {before}")
                before = int(number)
                if before <= last:
                    new.write(row)
