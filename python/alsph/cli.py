"""The command line: ``alsph run | resume | repeat | describe | plot | info | validate | study | autotune | converge``.

The options of ``run`` and ``describe`` are the fields of the case and of :class:`alsph.config.RunSettings`.
"""

import functools
import inspect
import signal
import types
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import typer
from typer.core import TyperGroup

from alsph import _alsph, cases, config, plotting, study
from alsph.autotune import autotune
from alsph.config import Config, RunSettings
from alsph.convergence import converge
from alsph.describe import describe
from alsph.durable import check_folder
from alsph.errors import ConfigError
from alsph.parameters import Parameters, describe_default
from alsph.progress import seconds_of
from alsph.remarks import keywords, tally
from alsph.repetition import repeat
from alsph.results import Run
from alsph.run import Control, resume, start
from alsph.study.board import overview
from alsph.terminal import CommandLine, call, complain, exit_codes, say, say_table
from alsph.text import printable, shown
from alsph.validation import validate


class CaseGroup(TyperGroup):
    """Commands named after the cases; the name of a TOML file stands for the case in it, with its parameters."""

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return the command of a case, or of the case in a file."""
        with exit_codes():
            if cmd_name.endswith(".toml"):
                ctx.obj = config.load(cmd_name)
                cmd_name = ctx.obj.case.name
            return super().get_command(ctx, cases.find(cmd_name).name)


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


class StudyGroup(TyperGroup):
    """``alsph study NAME`` stands for ``alsph study run NAME``."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put ``run`` before anything that is no command."""
        if args and args[0] not in (*self.commands, "--help"):
            args = ["run", *args]
        return super().parse_args(ctx, args)


study_app = typer.Typer(
    cls=StudyGroup,
    no_args_is_help=True,
    subcommand_metavar="NAME|FILE.toml [OPTIONS] | COMMAND",
    help="Run a parameter study, draw its figures and write its tables.",
    epilog="alsph study NAME stands for alsph study run NAME. Start with: alsph study list",
)
app.add_typer(study_app, name="study")

StudyName = Annotated[str, typer.Argument(metavar="NAME|FILE.toml", help="study: see alsph study list")]
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
Threads = Annotated[int | None, typer.Option(help="number of threads", show_default="the run's")]
WORDS = {int: "a whole number", float: "a number"}
METAVARS = {int: "INTEGER", float: "FLOAT"}
RunPath = Annotated[Path, typer.Argument(metavar="RUN", help="run folder")]


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


def _case_command(model: type[cases.Case], action: Callable[..., None]) -> Callable[..., None]:
    """Return a command for a case: `action` called with the configuration that the options make."""
    own = list(inspect.signature(action).parameters.values())[1:]

    @exit_codes()
    def command(context: typer.Context, **values: Any) -> None:
        extra = {parameter.name: values.pop(parameter.name) for parameter in own}
        tables = (context.obj or Config(model())).tables()
        for name in cases.method.superseded(values):
            tables.pop(name, None)
        for name, value in values.items():
            if value is not None:
                (tables["run"] if name in RunSettings.model_fields else tables)[name] = value
        action(config.from_tables(tables), **extra)

    first = inspect.Parameter("context", inspect.Parameter.KEYWORD_ONLY, annotation=typer.Context)
    keywords = [parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY) for parameter in own]
    parameters = [
        first,
        *keywords,
        *_options(model, model.parameter_names(), {}),
        *_options(
            RunSettings, RunSettings.model_fields, {"until": f"{model().default_until:g}", "threads": "all cores"}
        ),
    ]
    functools.update_wrapper(command, action)
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return command


def _options(model: type[Parameters], names: Iterable[str], defaults: Mapping[str, str]) -> Iterator[inspect.Parameter]:
    """Make an option of each named field of a model; `defaults` says what stands for None."""
    for name in names:
        kind, choices = _option_type(model.model_fields[name].annotation)
        flag = f"--{name.replace('_', '-')}"
        option = typer.Option(
            f"{flag}/--no-{flag[2:]}" if kind is bool else flag,
            help=f"{model.describe(name)}  [default: {defaults.get(name) or describe_default(model, name)}]",
            show_default=False,
            metavar="|".join(map(str, choices)) or METAVARS.get(kind),
            parser=_choice_of(choices) if choices else _number_of(kind) if kind in WORDS else None,
        )
        yield inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            default=None,
            annotation=Annotated[Union[kind, None], option],  # noqa: UP007
        )


def _option_type(annotation: Any) -> tuple[type, tuple[Any, ...]]:
    """Return the type that an option is read as, and its choices if there are few."""
    if get_origin(annotation) in (Union, types.UnionType):
        annotation = next(member for member in get_args(annotation) if member is not type(None))
    if get_origin(annotation) is Literal:
        return str, get_args(annotation)
    return annotation, ()


def _choice_of(choices: tuple[Any, ...]) -> Callable[[str], Any]:
    """Return a function that finds the choice with a given text."""

    def choice(text: str) -> Any:
        return next((choice for choice in choices if str(choice) == text), text)

    return choice


def _number_of(kind: type[int | float]) -> Callable[[str], int | float]:
    """Return a function that reads a number, and says what is wrong with one."""

    def number(text: str) -> int | float:
        try:
            return kind(text)
        except ValueError:
            raise typer.BadParameter(f"must be {WORDS[kind]}, not {shown(text)}") from None

    return number


for _model in cases.CASES.values():
    for _group, _action in (
        (run_app, _run),
        (describe_app, _describe),
        (autotune_app, _autotune),
        (converge_app, _converge),
    ):
        _help = (_model.__doc__ or "").split("\n\nParameters\n")[0]
        _group.command(_model.name, help=_help, short_help=_model.title)(_case_command(_model, _action))


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
    declared = study.load(name, preset)
    if dry_run:
        study.check_names(declared, declared.points())
        _print_states(declared, output)
        return
    results = study.run(
        declared, output, jobs=jobs, threads=threads, scheduler=scheduler, walltime=seconds_of(walltime)
    )
    say(f"\n{results}")
    _print_results(results)
    raise typer.Exit(not results.complete)


@study_app.command("status")
@exit_codes()
def _study_status(name: StudyName, preset: Preset = None, output: StudyOutput = Path("runs/studies")) -> None:
    """Tell how far the runs of a study are, whoever runs them."""
    _print_states(study.load(name, preset), output)


@study_app.command("draw")
@exit_codes()
def _study_draw(name: StudyName, preset: Preset = None, output: StudyOutput = Path("runs/studies")) -> None:
    """Write tables and figures of the runs that there are, without running anything."""
    declared = study.load(name, preset)
    results = study.Results.of(declared, declared.points(), output)
    results.save()
    _print_results(results)


@study_app.command("list")
def _study_list() -> None:
    """List the studies that come with alsph."""
    say_table([(name, study.load(name).title) for name in study.shipped()])


def _print_results(results: study.Results) -> None:
    for warning in results.warnings:
        complain(f"warning: {warning}", "yellow")
    say(results.path / "results.md")


def _print_states(declared: study.Study, output: Path) -> None:
    points = declared.points()
    for line in overview(points, study.states(points, output)):
        say(printable(line))
    if remarked := tally([keywords(point.config.case.remarks()) for point in points]):
        say(f"remarks: {remarked}")


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
        say(_alsph.__version__)
        raise typer.Exit


def _report(run: Run) -> None:
    say_table([("run folder", str(run.path))] + [(name, str(value)) for name, value in run.summary().items()])


def main() -> None:
    """Run the command line."""
    # Shells have the background jobs of a script ignore SIGINT: it shall stop a study there, too, as it does a run.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    call(app)
