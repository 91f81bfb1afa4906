"""Tables in Markdown."""

from collections.abc import Sequence

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
