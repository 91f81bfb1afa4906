"""Tables in Markdown, and in HTML for notebooks."""

import html as escaping
from collections.abc import Iterable, Sequence

from alsph.text import printable


def markdown(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table whose columns are aligned in plain text too.

    Parameters
    ----------
    header
        Titles of the columns.
    rows
        The cells of each row.
    """
    lines = [[printable(cell).replace("|", r"\|") for cell in cells] for cells in (header, *rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    lines.insert(1, ["-" * width for width in widths])
    return "\n".join("| " + " | ".join(map(str.ljust, cells, widths)) + " |" for cells in lines)


def html(header: Sequence[str], rows: Iterable[Sequence[str]], *, named: bool = False, caption: str = "") -> str:
    """Return a table for notebooks, everything in it escaped.

    Parameters
    ----------
    header
        Titles of the columns; none if it is empty.
    rows
        The cells of each row.
    named
        The first cell of a row is its title.
    caption
        What stands above.
    """
    lines = [_line(header, "th", "th")] * bool(header) + [_line(row, "th" if named else "td", "td") for row in rows]
    above = f"<caption>{escaping.escape(caption)}</caption>" if caption else ""
    return f"<table>{above}{''.join(lines)}</table>"


def _line(cells: Sequence[str], first: str, others: str) -> str:
    """Return a row of a table in HTML, whose first cell has one tag and the others another."""
    tags = [first, *[others] * len(cells)]
    body = (f"<{tag}>{escaping.escape(printable(cell))}</{tag}>" for tag, cell in zip(tags, cells, strict=False))
    return f"<tr>{''.join(body)}</tr>"
