"""What the command line says, whatever is in it and whoever reads it, and the exit codes that it ends with."""

import io
import re
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

import typer

from alsph.cli.help import Group
from alsph.errors import AlsphError, Interrupted, WalltimeError
from alsph.text import printable

if TYPE_CHECKING:
    from alsph import Run

INTERRUPTED = 130
BROKEN_PIPE = 141


@contextmanager
def exit_codes() -> Iterator[None]:
    """Turn errors into one line on stderr and an exit code, see docs/reliability.md."""
    try:
        yield
    except BrokenPipeError:
        raise
    except WalltimeError as stop:
        complain(str(stop))
        raise typer.Exit(stop.exit_code) from None
    except (AlsphError, OSError) as error:
        complain(f"error: {error}", "red")
        raise typer.Exit(error.exit_code if isinstance(error, AlsphError) else 2) from None
    except MemoryError:
        complain("error: out of memory; lower the resolution or the number of threads", "red")
        raise typer.Exit(2) from None
    except KeyboardInterrupt as stop:
        complain(str(stop) or "interrupted")
        raise typer.Exit(stop.exit_code if isinstance(stop, Interrupted) else INTERRUPTED) from None
    except Exception as error:  # in a function of the user's, or a defect of alsph's
        from alsph.engine.prescribed import FAILED

        notes = getattr(error, "__notes__", [])
        if not any(FAILED in note for note in notes):
            raise
        complain(f"error: {'; '.join(notes)}", "red")
        raise typer.Exit(2) from None


def say(text: object) -> None:
    """Print a text of one line or several."""
    typer.echo(printable(str(text), lines=True))


def say_table(rows: list[tuple[str, str]]) -> None:
    """Print pairs of a name and a value, one a line."""
    width = max(len(name) for name, _ in rows)
    for name, value in rows:
        say(printable(f"{name:{width}}  {value}"))


def say_run(run: "Run") -> None:
    """Print the summary of a run."""
    say_table([("run folder", str(run.path))] + [(name, str(value)) for name, value in run.summary().items()])


def complain(text: str, colour: str | None = None) -> None:
    """Print a line on stderr, if there is a terminal left to read it."""
    with suppress(OSError):
        typer.secho(printable(text), fg=colour, err=True)


class CommandLine(Group):
    """The group of all commands."""

    def main(self, *arguments: Any, **options: Any) -> Any:
        """Parse and run a command line, and end the process; what is wrong with it is told in plain words."""
        try:
            code = super().main(*arguments, **options | {"standalone_mode": False})
        except typer.Abort:
            code = 1
        except Exception as error:
            if not hasattr(error, "show"):  # the base of typer's own errors, which it does not export
                raise
            error.message = printable(_plain_words(error.message), lines=True)  # type: ignore[attr-defined]
            error.show()
            code = error.exit_code  # type: ignore[attr-defined]
        sys.exit(code)


def _plain_words(message: str) -> str:
    """Translate what typer, of whatever version, says of numbers."""
    for word, plain in (("integer", "whole number"), ("float", "number"), ("number", "number")):
        message = re.sub(rf"Input should be a valid {word}\b.*", f"must be a {plain}", message)
        message = message.replace(f"is not a valid {word}", f"is not a {plain}")
    return message


def call(app: Callable[[], Any]) -> None:
    """Call the command line, on any terminal and in any pipe."""
    warnings.formatwarning = lambda message, *_args, **_kwargs: f"warning: {printable(str(message))}\n"
    output = sys.stdout
    if isinstance(output, io.TextIOWrapper):
        output.reconfigure(errors="replace")  # not every terminal knows every letter
    try:
        app()
    except SystemExit:
        if sys.stdout is not output:  # typer's replacement of one whose reader has gone, as in `| head -1`
            sys.exit(BROKEN_PIPE)
        raise
