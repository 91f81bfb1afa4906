"""Texts of others, such as names, paths and what files hold: read with bounds, and shown without harm; durations."""

import errno
import hashlib
import os
from pathlib import Path
from typing import Any

LONGEST_VALUE = 80


def contents(path: Path, most_bytes: int, start: int = 0) -> bytes:
    """Read a file, from a byte on, of at most so many bytes.

    Raises
    ------
    OSError
        If it cannot be read, is larger, or is a folder, a device or a pipe, which may have no end.
    """
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, "no regular file")
    with path.open("rb") as file:
        size = max(0, os.fstat(file.fileno()).st_size - start)
        if size > most_bytes:
            raise OSError(errno.EFBIG, f"larger than {most_bytes / 2**20:g} MiB")
        file.seek(start)
        return file.read(size)


def printable(text: str, *, lines: bool = False) -> str:
    r"""Return a text whose control characters, which may do anything to a terminal, are escaped as Python does it.

    So are marks that turn the direction of writing, and bytes of a path that are no UTF-8.

    Parameters
    ----------
    text
        The text.
    lines
        Keep line feeds, which are escaped otherwise.

    Examples
    --------
    >>> print(printable("run\x1b[2J"))
    run\x1b[2J
    """
    return "".join(
        letter if letter.isprintable() or (lines and letter == "\n") else letter.encode("unicode_escape").decode()
        for letter in text
    )


def in_figure(text: str) -> str:
    """Return a text as a label of a figure, where a dollar sign begins no formula."""
    return printable(text).replace("$", r"\$")


def shown(value: Any, longest: int = LONGEST_VALUE) -> str:
    """Return a value as it would be typed, for messages: printable, and cut where it is very long."""
    try:
        text = printable(repr(value))
    except (ValueError, RecursionError):  # numbers of thousands of digits, tables nested without end
        return f"a {type(value).__name__} too long to be shown"
    return text if len(text) <= longest else f"{text[: longest - 4]} ..."


def sha256(text: str) -> str:
    """Return the SHA-256 of a text, in hexadecimal."""
    return hashlib.sha256(text.encode()).hexdigest()


def duration(seconds: float) -> str:
    """Return a length of time in words."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"
