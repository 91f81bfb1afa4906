"""The command compare: of run folders, or of the schemes of a case.

What does the work is imported where it is called, so that help comes at once.
"""

from pathlib import Path
from typing import Annotated, Any

import typer
from typer.main import get_command

import alsph
from alsph.cases.method import SCHEMES
from alsph.cli.app import COMMANDS
from alsph.cli.common import StudyOutput
from alsph.cli.help import App
from alsph.cli.options import CaseGroup, Given, group_of_cases
from alsph.cli.terminal import exit_codes, say
from alsph.errors import ConfigError

LONGEST_NAME = 100
"""Letters of the folder of a comparison."""

EXAMPLE = "alsph compare taylor_green --schemes alsph,isph,wcsph --resolution 25 --resolution 50"

runs = App()


@runs.command("runs")
@exit_codes()
def _runs(
    paths: Annotated[list[Path], typer.Argument(metavar="RUN RUN...", help="run folders; the first is the measure")],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="folder for table and figures", show_default="runs/comparison/RUN_RUN..."),
    ] = None,
) -> None:
    """Compare runs: what differs in them, what they found, and how far apart they are.

    Differences are those to the first run, with the ± of both added by squares.
    """
    if len(paths) < 2:
        raise ConfigError(f"{paths[0]}: a comparison needs two run folders or more, or schemes of a case: {EXAMPLE}")
    comparison = alsph.compare(paths)
    name = "_".join(comparison.runs).replace("/", "_")
    say(f"{comparison}\n")
    for path in comparison.save(output or Path("runs/comparison") / name[:LONGEST_NAME]):
        say(path)


def _schemes(
    given: Given,
    scheme: Annotated[
        str, typer.Option("--schemes", metavar="LIST", help=f"two or more of {', '.join(SCHEMES)}, with commas")
    ],
    resolution: Annotated[
        list[int] | None, typer.Option(help="resolution D/Δx, may be repeated", show_default="the case's")
    ] = None,
    jobs: Annotated[int, typer.Option(help="runs at a time; more than one disturb each other's times")] = 1,
    output: StudyOutput = Path("runs/studies"),
) -> None:
    schemes = [name.strip() for name in scheme.split(",")]
    report = alsph.compare_schemes(given.tables, schemes, resolution or (), output, jobs=jobs, **given.values)
    say(f"\n{report}\n\n{report.path / 'comparison.md'}")
    raise typer.Exit(not report.results.complete)


class ComparisonGroup(CaseGroup):
    """``alsph compare RUN RUN`` stands for ``alsph compare runs RUN RUN``, where there are no schemes."""

    beside = {"runs": get_command(runs)}

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put ``runs`` before what are no schemes of a case, and the case before schemes."""
        if args and args[0].partition("=")[0] == "--schemes":
            cut = 1 if "=" in args[0] else 2
            args = [*args[cut:], *args[:cut]]
        schemes = any(each.partition("=")[0] in ("--schemes", "--help") for each in args)
        if args and not schemes and args[0] not in self.beside:
            args = ["runs", *args]
        return super().parse_args(ctx, args)


app = App()
app.add_typer(
    typer.Typer(
        cls=group_of_cases(_schemes, ComparisonGroup),
        help=f"{COMMANDS['compare'][1]}\n\nRun folders are compared as they are; what differs is told, and differences "
        "are those to the first run. Schemes of a case are run first, each with its own step, where such runs are not "
        "there already: a table and figures of what each finds, how well it keeps the flow, and what it costs.",
        no_args_is_help=True,
        subcommand_metavar="RUN RUN... | CASE --schemes LIST [OPTIONS]",
        epilog="CASE may be FILE.toml or FILE.py:CLASS, as elsewhere. See alsph compare runs --help, and CASE --help. "
        f"Start with: {EXAMPLE}",
    ),
    name="compare",
)
