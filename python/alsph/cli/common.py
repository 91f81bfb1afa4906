"""Arguments and options that several commands have."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

import alsph
from alsph.text import shown

KINDS = ("png", "pdf", "svg")
"""Formats of figures."""

WORDS = {int: "a whole number", float: "a number"}


def one_of(*choices: object, beside: str = "") -> dict[str, Any]:
    """Return the settings of an option that takes one of some values, which its help names and shells complete.

    Beside these it may take any value of a kind.
    """
    names = [str(choice) for choice in choices]
    return {"metavar": "|".join([beside, *names] if beside else names), "autocompletion": lambda: names}


def number_of(kind: type[int | float], words: tuple[str, ...] = ()) -> Callable[[str], int | float | str]:
    """Return a function that reads a number, or one of some words in its place, and says what is wrong with one."""

    def number(text: str) -> int | float | str:
        try:
            return text if text in words else kind(text)
        except ValueError:
            known = " or ".join((WORDS[kind], *words))
            raise typer.BadParameter(f"must be {known}, not {shown(text)}") from None

    return number


RunPath = Annotated[Path, typer.Argument(metavar="RUN", help="run folder")]

StudyName = Annotated[
    str,
    typer.Argument(
        metavar="NAME|FILE.toml",
        help="study: see alsph study list",
        autocompletion=lambda: list(alsph.study.shipped()),
    ),
]

Preset = Annotated[str | None, typer.Option(help="preset of the study", show_default="its first")]

StudyOutput = Annotated[Path, typer.Option("--output", "-o", help="folder for runs and results")]

Jobs = Annotated[int | None, typer.Option(help="runs at a time", show_default="cores / threads")]

Scheduler = Annotated[
    str | None, typer.Option(help="address of a Dask scheduler, tcp://HOST:8786", show_default="local processes")
]

Walltime = Annotated[
    str | None, typer.Option(metavar="HH:MM:SS", help="end with a checkpoint before this time", show_default="none")
]

Retry = Annotated[int, typer.Option(help="how often a run that breaks down goes back and on with half the time step")]

Plane = Annotated[
    str | None,
    typer.Option(
        help="plane of the fields in 3-D, z=0.5 or y [D]",
        show_default="z, y with a free surface, through the middle of the body",
    ),
]

Threads = Annotated[int | None, typer.Option(help="number of threads", show_default="the run's")]
