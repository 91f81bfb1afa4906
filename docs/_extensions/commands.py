"""The directive ``commands``: every command of alsph with its options, as typer knows them."""

import re
from collections.abc import Iterator
from typing import Any

from alsph.cases import Cylinder
from alsph.cli import app
from alsph.cli.help import Command
from alsph.cli.options import CaseGroup
from docutils.nodes import Node
from sphinx.util.docutils import SphinxDirective
from typer import Context
from typer.main import get_command

OF_A_CASE = (
    "and the [parameters of the case](api.md#cases), with dashes: `inlet_velocity` is `--inlet-velocity`. "
    "Defaults here are those of the cylinder."
)


OF_THE_CASE = ("Parameters of the problem", "Parameters of the method")


def _plain(text: str) -> str:
    """Return a text that Markdown takes as it stands."""
    return re.sub(r"([\\`*_\[\]<>|$#])", r"\\\1", " ".join(text.split()))


def _options(command: Any, context: Any, *left_out: str) -> Iterator[str]:
    """Yield a table of arguments and options, without those of some sections."""
    sections = command.sections(context) if isinstance(command, Command) else {}
    records = [record for section, found in sections.items() if section not in left_out for record in found]
    if records:
        yield "\n| option | |\n|---|---|"
        for names, text in records:
            yield f"| `{names.replace('|', chr(92) + '|')}` | {_plain(text)} |"


def _described(name: str, command: Any, above: Any, level: int) -> Iterator[str]:
    """Yield the section of a command, then those of its own commands."""
    context = Context(command, info_name=name, parent=above)
    usage = " ".join([context.command_path, *command.collect_usage_pieces(context)])
    yield f"\n{'#' * level} {context.command_path}\n\n    {usage}\n"
    yield from (f"{_plain(paragraph)}\n" for paragraph in (command.help or "").split("\n\n"))
    if isinstance(command, CaseGroup):
        case = command.get_command(context, Cylinder.name)  # one stands for all
        yield from _options(case, Context(case, info_name="CASE", parent=context), *OF_THE_CASE)
        yield f"\n{OF_A_CASE}\n"
        for other in command.beside:
            yield from _described(other, command.beside[other], context, level + 1)
    else:
        yield from _options(command, context)
    if above is None or not isinstance(command, CaseGroup):
        for other in getattr(command, "commands", ()):
            yield from _described(other, command.commands[other], context, level + 1)


def described() -> Iterator[str]:
    """Yield the Markdown of all commands."""
    return _described("alsph", get_command(app), None, 2)


class Commands(SphinxDirective):
    """A section for each command."""

    def run(self) -> list[Node]:
        """Return the sections."""
        text = "\n".join(described())
        return self.parse_text_to_nodes(text, allow_section_headings=True)


def setup(sphinx: Any) -> dict[str, bool]:
    """Tell Sphinx of the directive."""
    sphinx.add_directive("commands", Commands)
    return {"parallel_read_safe": True}
