"""The commands of several runs: study and validate.

What does the work is imported where it is called, so that help comes at once.
"""

from pathlib import Path
from typing import Annotated, Any

import typer

import alsph
from alsph.cli.common import Jobs, Preset, Scheduler, StudyName, StudyOutput, Walltime
from alsph.cli.help import App, Group
from alsph.cli.terminal import complain, exit_codes, say, say_table
from alsph.running.control import seconds_of
from alsph.text import printable


class StudyGroup(Group):
    """``alsph study NAME`` stands for ``alsph study run NAME``."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put ``run`` before anything that is no command."""
        if args and args[0] not in (*self.commands, "--help"):
            args = ["run", *args]
        return super().parse_args(ctx, args)


app = App()
study_app = App(
    cls=StudyGroup,
    no_args_is_help=True,
    subcommand_metavar="NAME|FILE.toml|COMMAND [OPTIONS]",
    help="Run a parameter study, draw its figures and write its tables.",
    epilog="alsph study NAME stands for alsph study run NAME. Start with: alsph study list",
)


app.add_typer(study_app, name="study")


@study_app.command("run")
@exit_codes()
def _study_run(
    name: StudyName,
    preset: Preset = None,
    output: StudyOutput = Path("runs/studies"),
    dry_run: Annotated[bool, typer.Option("--dry-run", help="only tell what would be run")] = False,
    jobs: Jobs = None,
    threads: Annotated[int, typer.Option(help="threads of each run")] = 1,
    scheduler: Scheduler = None,
    walltime: Walltime = None,
) -> None:
    """Run what is missing of a study, draw its figures and write its tables.

    Runs are named by a hash of their configuration: those that have finished are used again, also by other studies,
    and those that were cut go on. The exit code is 1 if a run failed; one that diverged is a result.
    """
    declared = alsph.study.load(name, preset)
    if dry_run:
        alsph.study.check_names(declared, declared.points())
        _print_states(declared, output)
        return
    results = alsph.study.run(
        declared, output, jobs=jobs, threads=threads, scheduler=scheduler, walltime=seconds_of(walltime)
    )
    say(f"\n{results}")
    _print_results(results)
    raise typer.Exit(not results.complete)


@study_app.command("status")
@exit_codes()
def _study_status(name: StudyName, preset: Preset = None, output: StudyOutput = Path("runs/studies")) -> None:
    """Tell how far the runs of a study are, whoever runs them."""
    _print_states(alsph.study.load(name, preset), output)


@study_app.command("draw")
@exit_codes()
def _study_draw(name: StudyName, preset: Preset = None, output: StudyOutput = Path("runs/studies")) -> None:
    """Write tables and figures of the runs that there are, without running anything."""
    declared = alsph.study.load(name, preset)
    results = alsph.study.Results.of(declared, declared.points(), output)
    results.save()
    _print_results(results)


@study_app.command("list")
def _study_list() -> None:
    """List the studies that come with alsph."""
    say_table([(name, alsph.study.load(name).title) for name in alsph.study.shipped()])


def _validated(ctx: typer.Context) -> list[str]:
    """Return the names of the cases of the suite that a command line chooses so far."""
    from alsph.study.validation import FULL, QUICK

    return sorted({entry.case for entry in (FULL if ctx.params.get("full") else QUICK)})


@app.command("validate")
@exit_codes()
def _validate(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="CASE|FILE.py:CLASS...",
            help="cases; all of the suite if none is given",
            autocompletion=_validated,
        ),
    ] = None,
    full: Annotated[bool, typer.Option("--full/--quick", help="hours, or minutes, on two cores")] = False,
    resolution: Annotated[
        list[int] | None, typer.Option(help="resolution D/Δx, may be repeated", show_default="those of the suite")
    ] = None,
    threads: Annotated[int | None, typer.Option(help="number of threads", show_default="all cores")] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="folder for runs and report")] = Path(
        "runs/validation"
    ),
) -> None:
    """Run cases at several resolutions and compare them with their references.

    A case of one's own, FILE.py:CLASS, is run at its own resolution, or at those of --resolution.
    The exit code is 1 if a check fails. Runs are kept in the output folder and used again; a validation that was cut
    goes on when it is started again.
    """
    report = alsph.validate(*(names or ()), full=full, resolutions=resolution or (), threads=threads, output=output)
    say(f"\n{report}\n{report.path / 'report.md'}")
    raise typer.Exit(not report.passed)


def _print_results(results: "alsph.study.Results") -> None:
    for warning in results.warnings:
        complain(f"warning: {warning}", "yellow")
    say(results.path / "results.md")


def _print_states(declared: "alsph.study.Study", output: Path) -> None:
    from alsph.cases.remarks import keywords, tally
    from alsph.study.board import overview
    from alsph.study.declaration import with_starts

    points = declared.points()
    if declared.preset:
        say(f"preset {declared.preset} (--preset)")
    for line in overview(with_starts(points), alsph.study.states(points, output)):
        say(printable(line))
    if remarked := tally([keywords(point.config.remarks) for point in points]):
        say(f"remarks: {remarked}")
