"""The commands of a case, or of a file with one: run, describe, autotune and converge; and the list of the cases.

What does the work is imported where it is called, so that help comes at once.
"""

import shlex
from pathlib import Path
from typing import Annotated

import typer

import alsph
from alsph import cases
from alsph.cli.app import COMMANDS
from alsph.cli.common import KINDS, Jobs, Retry, Scheduler, StudyOutput, Walltime
from alsph.cli.help import App
from alsph.cli.options import Given, group_of_cases
from alsph.cli.terminal import say, say_run, say_table
from alsph.errors import ConfigError
from alsph.running.control import Control, seconds_of
from alsph.text import shown

DPI = 150
"""Pixels an inch of the picture of a start."""


def _run(
    given: Given,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="run folder", show_default="runs/CASE")] = None,
    force: Annotated[bool, typer.Option("--force", help="replace an existing run folder")] = False,
    walltime: Walltime = None,
    retry: Retry = 0,
) -> None:
    from alsph.running.start import start

    control = Control(walltime=seconds_of(walltime), retry=retry)
    run = start(given.config, output or Path("runs") / given.config.case.name, control, force=force)
    say_run(run)
    say(f"\nfigures: alsph plot {shlex.quote(str(run.path))}")


def _describe(
    given: Given,
    probe: Annotated[bool, typer.Option(help="take a few steps to estimate the time")] = True,
    draw: Annotated[
        Path | None,
        typer.Option(help="draw particles, outlines, sides and recorded points to this file", show_default="none"),
    ] = None,
) -> None:
    from alsph.running.describe import describe, starting

    target, case, state = _picture(draw), given.config.case, None
    try:
        state = starting(given.config)
    finally:  # bodies that are refused are drawn all the same
        if target and (state or isinstance(case, cases.Bodies)):
            alsph.plotting.save(alsph.plotting.start(case, state, given.config.probes), target, dpi=DPI)
            say(target)
    say_table(describe(given.config, state, probe=probe))


def _picture(path: Path | None) -> Path | None:
    """Return the file that a picture goes to, whose folder is there."""
    if path is None:
        return None
    given, path = path, path if path.suffix or not path.name else path.with_name(f"{path.name}.png")
    if given.is_dir() or path.suffix[1:].lower() not in KINDS:
        raise ConfigError(f"--draw = {shown(str(given))}: must be a file that ends in {', '.join(KINDS)}")
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


def _autotune(
    given: Given,
    divergence: Annotated[float, typer.Option(help="mean |∇·u| that is good enough [U/D]")] = 1e-3,
    develop: Annotated[float, typer.Option(help="time for which the flow is developed first [D/U]")] = 3.0,
    probe: Annotated[float, typer.Option(help="length of each probe [D/U]")] = 1.0,
    margin: Annotated[float, typer.Option(help="fraction of the largest stable step that is used [-]")] = 0.9,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="folder for report and case", show_default="runs/autotune/CASE"),
    ] = None,
) -> None:
    folder = output or Path("runs/autotune") / given.config.case.name
    tuning = alsph.autotune(
        given.config.case, divergence, develop=develop, probe=probe, margin=margin, threads=given.config.run.threads
    )
    tuning.save(folder)
    say(f"\n{tuning}\n\nalsph run {folder / 'case.toml'}")


def _converge(
    given: Given,
    resolution: Annotated[
        str, typer.Option("--resolutions", help="three or more resolutions D/Δx, as 10,14,20")
    ] = "10,14,20",
    jobs: Jobs = None,
    output: StudyOutput = Path("runs/studies"),
    scheduler: Scheduler = None,
) -> None:
    try:
        ladder = [int(text) for text in resolution.split(",")]
    except ValueError:
        raise ConfigError(f"resolutions = {resolution!r}: must be whole numbers with commas, as 10,14,20") from None
    threads = given.config.run.threads or 1
    report = alsph.converge(given.config, ladder, output, jobs=jobs, threads=threads, scheduler=scheduler)
    say(f"\n{report}\n{report.path / 'convergence.md'}")
    raise typer.Exit(not report.results.complete)


app = App()
EPILOG = "The options are the parameters of the case: see CASE --help. They override those of a file."
for _name, _action in (("run", _run), ("describe", _describe), ("autotune", _autotune), ("converge", _converge)):
    app.add_typer(
        typer.Typer(
            cls=group_of_cases(_action),
            help=COMMANDS[_name][1],
            no_args_is_help=True,
            subcommand_metavar="CASE|FILE.toml|FILE.py:CLASS [OPTIONS]",
            epilog=EPILOG,
        ),
        name=_name,
    )


@app.command("cases")
def _cases() -> None:
    """List the cases."""
    say_table([(name, model.title) for name, model in cases.CASES.items()])
