"""The commands of a run folder: resume, repeat, info, watch, plot, animate and export; and their list.

What does the work is imported where it is called, so that help comes at once.
"""

import functools
import re
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer

import alsph
from alsph.cli.common import KINDS, Plane, Retry, RunPath, Threads, Walltime, number_of, one_of
from alsph.cli.help import App
from alsph.cli.terminal import complain, exit_codes, say, say_run
from alsph.errors import ConfigError, RunFolderError
from alsph.parameters import choose
from alsph.running.control import seconds_of
from alsph.tables import markdown

FIELDS = ("vorticity", "pressure", "velocity", "velocity_divergence", "q_criterion", "lambda_2")
DERIVED = FIELDS[4:]
GRIDS = ("vtkhdf", "vti", "netcdf", "csv")
"""What alsph.plotting and alsph.results.export, which help need not wait for, know by these names."""

FEW = 20
"""Pictures of a film below which it is told how to have more."""

app = App()


@app.command("resume")
@exit_codes()
def _resume(
    path: RunPath,
    until: Annotated[
        Any,
        typer.Option(
            parser=number_of(float, ("converged",)),
            help="new end time [D/U], or converged",
            show_default="the run's",
            **one_of("converged", beside="FLOAT"),
        ),
    ] = None,
    threads: Threads = None,
    walltime: Walltime = None,
    retry: Retry = 0,
) -> None:
    """Go on with a run from its newest sound checkpoint; one that has reached its end stays as it is."""
    say_run(alsph.resume(path, until, threads, walltime=seconds_of(walltime), retry=retry))


@app.command("repeat")
@exit_codes()
def _repeat(path: RunPath, threads: Threads = None) -> None:
    """Repeat a run from its start, without writing anything, and compare it bit by bit.

    The exit code is 1 if it is not the same.
    """
    repetition = alsph.repeat(path, threads)
    say(repetition)
    raise typer.Exit(not repetition.same)


@app.command("info")
@exit_codes()
def _info(path: RunPath) -> None:
    """Tell the state and the results of a run."""
    say_run(alsph.Run(path))


@app.command("watch")
@exit_codes()
def _watch(
    path: RunPath,
    port: Annotated[
        int | None,
        typer.Option(metavar="N", help="port of the page", show_default="the first free from 8000 on"),
    ] = None,
    browser: Annotated[bool, typer.Option(help="open the page, where there is a screen")] = True,
) -> None:
    """Show a run, going on or ended, on a page in a browser, until Ctrl-C.

    State and time left, forces, divergence and time step, means and remarks, the newest field and figures. The page
    keeps itself up to date; the run folder is only read, and the run is not disturbed.

    The page is served on this machine alone, to whoever is logged in on it. For a run on another machine start this
    there, and from where you sit

        ssh -L 8000:localhost:8000 HOST

    then open http://localhost:8000.
    """
    alsph.watch(path, port, browser=browser)


@app.command("runs")
@exit_codes()
def _runs(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="where to look, in folders of it, too")] = Path(
        "runs"
    ),
) -> None:
    """List the run folders in a folder: what each is of, how far it is, and the room that it takes."""
    if not folder.is_dir():
        raise RunFolderError(f"{folder}: no such folder")
    rows = [_row(path.parent, folder) for path in sorted(folder.rglob("run.json"))]
    if not rows:
        raise RunFolderError(f"{folder}: holds no run folder")
    say(markdown(("run folder", "case", "Re", "D/Δx", "status", "t*", "of", "MiB"), rows))


def _row(path: Path, above: Path) -> list[str]:
    """Return what is to be told of a run folder, or what is wrong with it."""
    from alsph.cases.source import shown_name

    name = str(path.relative_to(above))
    try:
        run = alsph.Run(path)
    except RunFolderError as error:
        return [name, "", "", "", str(error).removeprefix(f"{path}: "), "", "", ""]
    case = run.info.get("case", shown_name(run.case.get("case")))
    size = 0
    for file in path.iterdir():
        with suppress(OSError):  # of a run that goes on
            size += file.stat().st_size
    found = [run.case.get("reynolds"), run.case.get("resolution"), run.info.get("time"), run.info.get("until")]
    numbers = [f"{number:.5g}" if isinstance(number, int | float) else "" for number in found]
    return [name, str(case), *numbers[:2], run.status, *numbers[2:], f"{size / 2**20:.1f}"]


@app.command("plot")
@exit_codes()
def _plot(
    path: RunPath,
    field: Annotated[
        list[str] | None,
        typer.Option(help="field to draw, may be repeated", show_default="vorticity and pressure", **one_of(*FIELDS)),
    ] = None,
    time: Annotated[float | None, typer.Option(help="time of the fields [D/U]", show_default="the last")] = None,
    body: Annotated[
        list[str] | None,
        typer.Option(help="body to draw forces and pressure coefficient of by itself, too, may be repeated"),
    ] = None,
    kind: Annotated[str, typer.Option("--format", help="format of the figures", **one_of(*KINDS))] = "png",
    dpi: Annotated[int, typer.Option(min=10, max=2400, help="pixels an inch of png")] = 100,
    plane: Plane = None,
    streamlines: Annotated[bool, typer.Option("--streamlines", help="draw streamlines over the fields")] = False,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="folder for the figures", show_default="RUN/figures")
    ] = None,
) -> None:
    """Draw the figures of a run.

    These are the ledger of the run, its curves beside their reference, forces and their spectra,
    pressure coefficient, and fields.
    """
    from alsph.folder.durable import check_folder

    choose("format", kind, KINDS)
    run = alsph.Run(path)
    names: list[Any] = field or ["vorticity", "pressure"]
    for name in names:
        alsph.plotting.field_style(name)
    if plane is not None:
        run.plane(run.snapshot(time), plane)  # refused before anything is drawn
    figures = output or path / "figures"
    drawings = _drawings(run, body or []) | {
        name: functools.partial(run.plot_field, name, time, plane=plane, streamlines=streamlines) for name in names
    }
    if not output:
        check_folder(figures)
    figures.mkdir(parents=True, exist_ok=True)
    if time is not None and names:
        complain(f"fields at t* = {run.snapshot(time).time:.6g}, the output nearest to {time:g}")
    for name, draw in drawings.items():
        alsph.plotting.save(draw(), figures / f"{name}.{kind}", dpi=dpi)
        say(figures / f"{name}.{kind}")


def _drawings(run: "alsph.Run", bodies: list[str]) -> dict[str, Callable[[], Any]]:
    """Return what draws the figures of a run but those of fields, by name; some of single bodies."""
    drawings: dict[str, Callable[[], Any]] = {
        profile.file_name: functools.partial(run.plot_profile, profile) for profile in run.profiles
    }
    drawings["ledger"] = run.plot_ledger
    if len(run.gauges.time):
        drawings["gauges"] = run.plot_gauges
    if len(run.probes.time):
        drawings["probes"] = run.plot_probes
    settles = run.config.case.settles
    if run.body:
        drawings |= {"forces": run.plot_forces} | ({"spectrum": run.plot_spectrum} if settles else {})
    if run.config.case.surface_points():
        drawings["pressure_coefficient"] = run.plot_pressure_coefficient
    for body in bodies:
        choose("body", body, run.bodies)
        name = "_".join(["of", *re.findall(r"\w+", body)])
        drawings[f"forces_{name}"] = functools.partial(run.plot_forces, body=body)
        if settles:
            drawings[f"spectrum_{name}"] = functools.partial(run.plot_spectrum, body=body)
        if body in run.config.case.surface_bodies and run.config.case.surface_points():
            drawings[f"pressure_coefficient_{name}"] = functools.partial(run.plot_pressure_coefficient, body=body)
    return drawings


@app.command("animate")
@exit_codes()
def _animate(
    path: RunPath,
    field: Annotated[str, typer.Option(help="field to draw", **one_of(*FIELDS))] = "vorticity",
    start: Annotated[float | None, typer.Option(help="time to start at [D/U]", show_default="the first")] = None,
    end: Annotated[float | None, typer.Option(help="time to end at [D/U]", show_default="the last")] = None,
    every: Annotated[int, typer.Option(help="take one snapshot of so many")] = 1,
    fps: Annotated[float, typer.Option(help="pictures a second")] = 10.0,
    limit: Annotated[float | None, typer.Option(help="end of the colour scale", show_default="from the fields")] = None,
    plane: Plane = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="file, .gif, .mp4 or .webm", show_default="RUN/figures/FIELD.gif"),
    ] = None,
) -> None:
    """Make a film of a field from the snapshots of a run.

    A run writes a snapshot every output_interval. MP4 and WebM need pip install 'alsph[video]'.
    """
    from rich.console import Console
    from rich.progress import Progress

    run = alsph.Run(path)
    name: Any = field
    chosen: dict[str, Any] = {"start": start, "end": end, "limit": limit, "plane": plane}
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("pictures", total=None)

        pictures = 0

        def progress(done: int, count: int) -> None:
            nonlocal pictures
            pictures = count
            bar.update(task, completed=done, total=count)

        given = {what: value for what, value in chosen.items() if value is not None}
        film = run.animate(name, output, every=every, fps=fps, progress=progress, **given)
    say(film)
    if pictures < FEW and every == 1:
        told = f"{pictures} pictures, {pictures / fps:.3g} s"
        complain(f"{told}; a run writes more with a smaller --output-interval", "yellow")


@app.command("export")
@exit_codes()
def _export(
    path: RunPath,
    to: Annotated[str | None, typer.Option(help="format", show_default="vtkhdf", **one_of(*GRIDS))] = None,
    time: Annotated[float | None, typer.Option(help="time of the fields [D/U]", show_default="the last")] = None,
    spacing: Annotated[
        float | None, typer.Option(help="spacing of the grid [D]", show_default="the particles'")
    ] = None,
    field: Annotated[
        list[str] | None,
        typer.Option(help="field to write, too, may be repeated", show_default="none", **one_of(*DERIVED)),
    ] = None,
    probes: Annotated[bool, typer.Option("--probes", help="write what probes recorded in place of fields")] = False,
    si: Annotated[bool, typer.Option("--si", help="in SI, for a run that knows its units")] = False,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="file, .vtkhdf, .vti, .nc or .csv", show_default="RUN/flow.vtkhdf, RUN/probes.csv"
        ),
    ] = None,
) -> None:
    """Write a snapshot of a run on a regular grid, for other programs: velocity, pressure and vorticity.

    ParaView 5.12 or later reads vtkhdf, any reads vti, which needs pip install 'alsph[3d]'; netcdf needs
    'alsph[tables]'. Bodies are NaN. What probes recorded is written as a table, a row for each time and point.
    """
    from alsph.results.export import FORMATS, save_probes, told_units

    if to is not None:
        choose("to", to, FORMATS)
    if output and to and output.suffix != FORMATS[to]:
        raise ConfigError(f"{output}: a file in the format {to} ends in {FORMATS[to]}")
    run = alsph.Run(path)
    units, suffix = (run.units, "_si") if si else (None, "")
    if si and units is None:
        raise ConfigError(f"--si: {path} does not know its units; give them to the run, --units-length and so on")
    if probes:
        of_fields = {"to": to, "time": time, "spacing": spacing, "field": field or None}
        if extra := [name for name, given in of_fields.items() if given is not None]:
            raise ConfigError(f"--probes: not with --{extra[0]}, which is of the fields")
        say(save_probes(run.probes, output or path / f"probes{suffix}.csv", units))
        complain(told_units(["velocity", "pressure"], run.symbols, si=si))
        return
    grid = run.to_grid(time, spacing, derived=field or [])
    if time is not None:
        complain(f"fields at t* = {grid.time:.6g}, the output nearest to {time:g}")
    if units:
        grid = grid.in_si(units)
    say(grid.save(output or path / f"flow{suffix}{FORMATS[to or 'vtkhdf']}"))
    complain(told_units(grid.fields, grid.symbols, si=si))
