"""The command line: ``alsph run | resume | repeat | describe | info | watch | plot | validate | study | ...``.

The options of ``run`` and ``describe`` are the fields of the case and of :class:`alsph.run_settings.RunSettings`.
"""

import signal
from collections import UserDict
from collections.abc import Iterator
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.main import get_group

from alsph import __version__
from alsph.cli.terminal import CommandLine, call, say

COMMANDS = {
    "cases": ("of_cases", "List the cases."),
    "describe": ("of_cases", "Tell beforehand what a run will take."),
    "run": ("of_cases", "Run a case, or a file, into a run folder."),
    "runs": ("runs", "List the run folders in a folder."),
    "resume": ("runs", "Go on with a run from its newest sound checkpoint."),
    "repeat": ("runs", "Repeat a run from its start, without writing anything, and compare it bit by bit."),
    "info": ("runs", "Tell the state and the results of a run."),
    "watch": ("runs", "Show a run, going on or ended, on a page in a browser."),
    "plot": ("runs", "Draw the figures of a run."),
    "export": ("runs", "Write a snapshot of a run on a regular grid, for other programs."),
    "compare": ("comparison", "Compare runs, or the schemes of a case: what they found, and what it took."),
    "animate": ("runs", "Make a film of a field from the snapshots of a run."),
    "validate": ("studies", "Run cases at several resolutions and compare them with their references."),
    "study": ("studies", "Run a parameter study, draw its figures and write its tables."),
    "autotune": ("of_cases", "Find the largest stable time step and the cheapest iterations."),
    "converge": ("of_cases", "Run a case at several resolutions and judge its convergence."),
}
"""The commands in the order in which they are used: file and short help of each."""


class Files(UserDict[str, Any]):
    """The commands by name; the file of one is loaded when it is used, so that help comes at once."""

    def __getitem__(self, name: str) -> Any:
        """Return the command."""
        module, _ = super().__getitem__(name)
        return get_group(import_module(f"alsph.cli.{module}").app).commands[name]


class Commands(CommandLine):
    """The group of all commands."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.commands = Files(COMMANDS)

    def summaries(self, ctx: Any) -> Iterator[tuple[str, str]]:
        """Yield the name of each command and what it does."""
        return ((name, text) for name, (_, text) in COMMANDS.items())


app = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    subcommand_metavar="COMMAND [OPTIONS]",
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Incompressible flow with particles: augmented Lagrangian SPH.",
    epilog="Start with: alsph run cylinder --resolution 10 --until 20",
)


@app.callback(invoke_without_command=True)
def _version(version: Annotated[bool, typer.Option("--version", help="print the version")] = False) -> None:
    if version:
        say(__version__)
        raise typer.Exit


def main() -> None:
    """Run the command line."""
    # Shells have the background jobs of a script ignore SIGINT: it shall stop a study there, too, as it does a run.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    call(app)
