"""The command line: ``alsph run | resume | repeat | describe | plot | info | validate | study | autotune | converge``.

The options of ``run`` and ``describe`` are the fields of the case and of :class:`alsph.config.RunSettings`.
"""

import functools
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from alsph import cases, plotting
from alsph.cli.options import CaseGroup, Jobs, Retry, RunPath, Scheduler, StudyOutput, Threads, Walltime, case_command
from alsph.cli.studies import study_app
from alsph.cli.terminal import CommandLine, call, complain, exit_codes, say, say_table
from alsph.config import Config
from alsph.engine.simulation import VERSION
from alsph.errors import ConfigError
from alsph.folder.durable import check_folder
from alsph.results.run import Run
from alsph.running.control import Control, seconds_of
from alsph.running.describe import describe
from alsph.running.repetition import repeat
from alsph.running.start import resume, start
from alsph.study.autotune import autotune
from alsph.study.convergence import converge
from alsph.study.validation import validate


class Commands(CommandLine):
    """The commands in the order in which they are used."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of the commands."""
        return [
            "cases",
            "describe",
            "run",
            "resume",
            "repeat",
            "info",
            "plot",
            "validate",
            "study",
            "autotune",
            "converge",
        ]


app = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Incompressible flow with particles: augmented Lagrangian SPH.",
    epilog="Start with: alsph run cylinder --resolution 10 --until 20",
)
group_settings: dict[str, Any] = {
    "cls": CaseGroup,
    "no_args_is_help": True,
    "subcommand_metavar": "CASE|FILE.toml [OPTIONS]",
    "epilog": "The options are the parameters of the case: see CASE --help. They override those of a file.",
}
run_app = typer.Typer(help="Run a case, or a file, into a run folder.", **group_settings)
describe_app = typer.Typer(help="Tell beforehand what a run will take.", **group_settings)
autotune_app = typer.Typer(help="Find the largest stable time step and the cheapest iterations.", **group_settings)
converge_app = typer.Typer(help="Run a case at several resolutions and judge its convergence.", **group_settings)
app.add_typer(run_app, name="run")
app.add_typer(describe_app, name="describe")
app.add_typer(autotune_app, name="autotune")
app.add_typer(converge_app, name="converge")


app.add_typer(study_app, name="study")


def _run(
    configuration: Config,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="run folder", show_default="runs/CASE")] = None,
    force: Annotated[bool, typer.Option("--force", help="replace an existing run folder")] = False,
    walltime: Walltime = None,
    retry: Retry = 0,
) -> None:
    control = Control(walltime=seconds_of(walltime), retry=retry)
    _report(start(configuration, output or Path("runs") / configuration.case.name, control, force=force))


def _describe(
    configuration: Config,
    probe: Annotated[bool, typer.Option(help="take a few steps to estimate the time")] = True,
) -> None:
    say_table(describe(configuration, probe=probe))


def _autotune(
    configuration: Config,
    divergence: Annotated[float, typer.Option(help="mean |∇·u| that is good enough [U/D]")] = 1e-3,
    develop: Annotated[float, typer.Option(help="time for which the flow is developed first [D/U]")] = 3.0,
    probe: Annotated[float, typer.Option(help="length of each probe [D/U]")] = 1.0,
    margin: Annotated[float, typer.Option(help="fraction of the largest stable step that is used [-]")] = 0.9,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="folder for report and case", show_default="runs/autotune/CASE"),
    ] = None,
) -> None:
    folder = output or Path("runs/autotune") / configuration.case.name
    tuning = autotune(
        configuration.case, divergence, develop=develop, probe=probe, margin=margin, threads=configuration.run.threads
    )
    tuning.save(folder)
    say(f"\n{tuning}\n\nalsph run {folder / 'case.toml'}")


def _converge(
    configuration: Config,
    resolutions: Annotated[str, typer.Option(help="three or more resolutions D/Δx, as 10,14,20")] = "10,14,20",
    jobs: Jobs = None,
    output: StudyOutput = Path("runs/studies"),
    scheduler: Scheduler = None,
) -> None:
    try:
        ladder = [int(text) for text in resolutions.split(",")]
    except ValueError:
        raise ConfigError(f"resolutions = {resolutions!r}: must be whole numbers with commas, as 10,14,20") from None
    threads = configuration.run.threads or 1
    report = converge(configuration, ladder, output, jobs=jobs, threads=threads, scheduler=scheduler)
    say(f"\n{report}\n{report.path / 'convergence.md'}")
    raise typer.Exit(not report.results.complete)


for _model in cases.CASES.values():
    for _group, _action in (
        (run_app, _run),
        (describe_app, _describe),
        (autotune_app, _autotune),
        (converge_app, _converge),
    ):
        _help = (_model.__doc__ or "").split("\n\nParameters\n")[0]
        _group.command(_model.name, help=_help, short_help=_model.title)(case_command(_model, _action))


@app.command("resume")
@exit_codes()
def _resume(
    path: RunPath,
    until: Annotated[float | None, typer.Option(help="new end time [D/U]", show_default="the run's")] = None,
    threads: Threads = None,
    walltime: Walltime = None,
    retry: Retry = 0,
) -> None:
    """Go on with a run from its newest sound checkpoint; one that has reached its end stays as it is."""
    _report(resume(path, until, threads, walltime=seconds_of(walltime), retry=retry))


@app.command("repeat")
@exit_codes()
def _repeat(path: RunPath, threads: Threads = None) -> None:
    """Repeat a run from its start, without writing anything, and compare it bit by bit.

    The exit code is 1 if it is not the same.
    """
    repetition = repeat(path, threads)
    say(repetition)
    raise typer.Exit(not repetition.same)


@app.command("plot")
@exit_codes()
def _plot(
    path: RunPath,
    field: Annotated[
        list[str] | None,
        typer.Option(help="field to draw, may be repeated", show_default="vorticity and pressure; none in 3-D"),
    ] = None,
    time: Annotated[float | None, typer.Option(help="time of the fields [D/U]", show_default="the last")] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="folder for the figures", show_default="RUN/figures")
    ] = None,
) -> None:
    """Draw the figures of a run.

    These are the ledger of the run, its curves beside their reference, forces and their spectra,
    pressure coefficient, and fields.
    """
    run = Run(path)
    field = field or ([] if run.case.get("dimensions") == 3 else ["vorticity", "pressure"])
    for name in field:
        plotting.field_style(name)
    figures = output or path / "figures"
    drawings: dict[str, Callable[[Path], object]] = {
        profile.file_name: functools.partial(run.plot_profile, profile) for profile in run.profiles
    }
    drawings["ledger"] = run.plot_ledger
    if run.body:
        drawings |= {"forces": run.plot_forces, "spectrum": run.plot_spectrum}
    if run.config.case.surface_points():
        drawings["pressure_coefficient"] = run.plot_pressure_coefficient
    drawings |= {name: functools.partial(run.plot_field, name, time) for name in field}
    if not output:
        check_folder(figures)
    figures.mkdir(parents=True, exist_ok=True)
    if time is not None and field:
        complain(f"fields at t* = {run.snapshot(time).time:.6g}, the output nearest to {time:g}")
    for name, draw in drawings.items():
        draw(figures / f"{name}.png")
        say(figures / f"{name}.png")


@app.command("validate")
@exit_codes()
def _validate(
    names: Annotated[list[str] | None, typer.Argument(metavar="[CASE]...", help="cases; all if none is given")] = None,
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

    The exit code is 1 if a check fails. Runs are kept in the output folder and used again; a validation that was cut
    goes on when it is started again.
    """
    report = validate(*(names or ()), full=full, resolutions=resolution or (), threads=threads, output=output)
    say(f"\n{report}\n{report.path / 'report.md'}")
    raise typer.Exit(not report.passed)


@app.command("info")
@exit_codes()
def _info(path: RunPath) -> None:
    """Tell the state and the results of a run."""
    _report(Run(path))


@app.command("cases")
def _cases() -> None:
    """List the cases."""
    say_table([(name, model.title) for name, model in cases.CASES.items()])


@app.callback(invoke_without_command=True)
def _version(version: Annotated[bool, typer.Option("--version", help="print the version")] = False) -> None:
    if version:
        say(VERSION)
        raise typer.Exit


def _report(run: Run) -> None:
    say_table([("run folder", str(run.path))] + [(name, str(value)) for name, value in run.summary().items()])


def main() -> None:
    """Run the command line."""
    # Shells have the background jobs of a script ignore SIGINT: it shall stop a study there, too, as it does a run.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    call(app)
