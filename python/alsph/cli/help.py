"""How commands tell of themselves, alike with every version of typer and within 80 columns."""

import re
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import typer
from typer.core import TyperCommand, TyperGroup

Function = TypeVar("Function", bound=Callable[..., Any])

KINDS = {"str": "TEXT", "int": "INTEGER", "float": "FLOAT", "path": "PATH", "Path": "PATH"}
"""What stands for the value of an option, by the kinds that typer names."""


class Command(TyperCommand):
    """A command whose help has its options in the sections that they name."""

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Return what follows the name of the command; what may be left out in brackets."""
        return ["[OPTIONS]", *(_placed(each) for each in self.get_params(ctx) if each.param_type_name == "argument")]

    def sections(self, ctx: Any) -> dict[str, list[tuple[str, str]]]:
        """Return names and help of arguments and options by section."""
        found: dict[str, list[tuple[str, str]]] = {}
        for each in self.get_params(ctx):
            if record := each.get_help_record(ctx):
                argument = each.param_type_name == "argument"
                section = getattr(each, "rich_help_panel", None) or ("Arguments" if argument else "Options")
                names, text = _plain_names(record[0]), _plain_help(record[1])
                if argument:  # that it is required stands in the usage
                    names, text = _name(each), text.removesuffix("[required]").strip()
                found.setdefault(section, []).append((names, text))
        return found

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments and options."""
        for name, records in self.sections(ctx).items():
            with formatter.section(name):
                formatter.write_dl(records)


class Group(TyperGroup):
    """A group of commands, each listed with the whole of its first sentence."""

    listed = "Commands"

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Return what follows the name of the group."""
        return [self.subcommand_metavar]

    def summaries(self, ctx: Any) -> Iterator[tuple[str, str]]:
        """Yield the name of each command and what it does."""
        for name in self.list_commands(ctx):
            text = self.commands[name].help or ""
            yield name, " ".join(text.split("\n\n")[0].split())

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the list of the commands."""
        with formatter.section(self.listed):
            formatter.write_dl(list(self.summaries(ctx)))


class App(typer.Typer):
    """Commands of one file."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"add_completion": False, "rich_markup_mode": None} | options)

    def command(
        self, name: str | None = None, *, cls: type[TyperCommand] | None = Command, **options: Any
    ) -> Callable[[Function], Function]:
        """Return a decorator that makes a function a command."""
        return super().command(name, cls=cls, **options)


def _name(argument: Any) -> str:
    return str(argument.metavar or argument.name.upper())


def _placed(argument: Any) -> str:
    return _name(argument) if argument.required else f"[{_name(argument)}]"


def _plain_names(names: str) -> str:
    """Return the names of an option and what stands for its value, for which versions of typer have other words."""
    return re.sub(r"<(?:list\[)?(\w+)[^<>]*>", lambda kind: KINDS.get(kind[1], kind[1].upper()), names)


def _plain_help(text: str) -> str:
    """Return the help of an option, a default in words without brackets of its own."""
    text = re.sub(r"(\d+)<=x<=(\d+)\]$", r"\1 to \2]", text.replace(r"\[", "["))
    return re.sub(r"\[default: \((.*)\)\]$", r"[default: \1]", text)
