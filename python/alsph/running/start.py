"""How a run begins, goes on and is completed in its folder."""

import math
import warnings
from pathlib import Path
from typing import Any

from alsph import config
from alsph.arguments import path_of
from alsph.arrays import size_of
from alsph.cases.base import Case
from alsph.config import Config, of_run, of_the_flow
from alsph.engine.prescribed import difference
from alsph.errors import ConfigError, DamagedError, RunFolderError
from alsph.folder.checkpoint import Checkpoint
from alsph.folder.run_folder import RunFolder
from alsph.geometry.shape import Shape
from alsph.results.run import Run
from alsph.run_settings import Converged, RunSettings
from alsph.running import beginning
from alsph.running.control import Control
from alsph.running.driver import Driver
from alsph.running.outputs import outputs_of

FIXED = ("dimensions", "particle_spacing", "smoothing_ratio", "kernel", "domain", "bodies")
"""Settings of the engine that the particles were made for: they cannot change in mid-run."""


def start(config: Config, path: Path, control: Control | None = None, *, force: bool = False) -> Run:
    """Run a case from its start in a new run folder: :meth:`alsph.cases.Case.run`."""
    control, folder = control or Control(), RunFolder(path)
    config.check()
    folder.check_new(force=force, configuration=config)
    simulation = config.case.simulation(config.run.threads, config.run.initial_run)
    remarks, info = beginning.of(config)
    driver = Driver(config, folder, simulation, {"start": info})
    with folder.claimed():
        folder.check_new(force=force, configuration=config)  # another process may have been faster
        folder.create(config, 3 * size_of(simulation.problem.state))
        folder.announce(config)
        folder.truncate(0, 0.0, driver.outputs)
        for remark in remarks:
            folder.log(f"warning: {remark}")
        if isinstance(outline := getattr(config.case, "shape", None), Shape):
            folder.log(f"outline: {outline}")
        if config.run.initial_run is not None:
            folder.write_start(simulation.state(), config.case_tables())
        driver.run(control)
    return Run(path)


def run(case: Case, folder: Path, control: Control | None = None, *, force: bool = False, **settings: Any) -> Run:
    """Run a case with settings of :class:`alsph.run_settings.RunSettings`: what :meth:`alsph.cases.Case.run` does."""
    return start(Config(case, RunSettings(**settings)), folder, control, force=force)


def complete(config: Config, path: Path, control: Control | None = None) -> Run:
    """Return the finished run of a case in a folder: as it is there, resumed, or run from the start.

    A folder with another case, beginning or other rules in it, or without a checkpoint that can be read, is replaced.
    The number of threads is that of `config`.
    """
    if (path / "case.toml").exists():
        folder = RunFolder(path)
        kept = of_run(folder.path)
        info = folder.last_info()
        # Retries shorten the time step: the run is still that of the case that it began with.
        began = info.get("began", {}) if info.get("retries") else kept.case_tables()
        alike = (of_the_flow(began), kept.ending) == (config.flow_tables(), config.ending)
        if alike and beginning.alike(config, kept, folder, info):
            if info.get("status") == "finished":
                return Run(path)
            try:
                folder.read_checkpoint()
            except DamagedError:
                pass
            else:
                return _resume(folder, None, config.run.threads, control or Control())
    return start(config, path, control, force=True)


def resume(
    path: str | Path,
    until: float | Converged | None = None,
    threads: int | None = None,
    *,
    walltime: float = math.inf,
    retry: int = 0,
    progress: bool = True,
) -> Run:
    """Go on with a run from its newest checkpoint that is sound; a run that has reached its end stays as it is.

    Parameters
    ----------
    path
        The run folder.
    until
        New end time [D/U], or ``"converged"``; the run's own if None.
    threads
        Number of threads; the run's own if None.
    walltime, retry, progress
        As in :meth:`alsph.cases.Case.run`.

    Warns
    -----
    RuntimeWarning
        If the newest checkpoint is damaged, or the settings in ``case.toml`` are not those that the run was made with.

    Raises
    ------
    RunFolderError
        If the folder cannot be resumed, or another process is at work in it.
    SolverError, WalltimeError, Interrupted
        As :meth:`alsph.cases.Case.run`.
    """
    return _resume(
        RunFolder(path_of("run", path, "run folder")), until, threads, Control(progress, walltime=walltime, retry=retry)
    )


def _resume(folder: RunFolder, until: float | Converged | None, threads: int | None, control: Control) -> Run:
    of_run(folder.path)  # refuses what is no run folder before the claim makes one
    with folder.claimed():
        config, info = of_run(folder.path), folder.last_info()
        _check_parameters(config, folder)
        beginning.check_class(config.case, info, folder.path)
        changes = {name: value for name, value in (("until", until), ("threads", threads)) if value is not None}
        own, config = config, Config(config.case, config.run.replace(**changes))
        saved = folder.read_checkpoint()
        if not isinstance(saved.state["time"], float):
            raise RunFolderError(f"{folder.path}: its checkpoint is of no time")
        if _has_ended(config, saved, info):
            if until is not None:
                told = f"{until:g}" if isinstance(until, float | int) else until
                reached = f"the run has reached t* = {saved.state['time']:.6g}, and until = {told}"
                warnings.warn(f"{folder.path}: nothing to be done: {reached}", RuntimeWarning, stacklevel=3)
            if info.get("status") != "finished" and _has_ended(own, saved, info):  # cut after its last step
                folder.write_info(info | {"status": "finished"})
            return Run(folder.path)
        remarks = [saved.warning] if saved.warning else []
        if saved.case is None:
            remarks.append("its checkpoint, of an older alsph, does not tell its settings: those in case.toml are used")
        elif changed := _changes(config, saved, folder):
            remarks.append(f"goes on with other settings than before: {', '.join(changed)}")
        config.case.check_memory(config.run.threads)
        simulation = beginning.restored(config, saved, folder)
        if change := difference(simulation.rules, saved.prescribed):
            remarks.append(f"goes on with {change}")
        remarks += beginning.changed(config, info)
        if saved.warning:
            folder.set_damaged_aside()
        remarks += folder.truncate(simulation.step, simulation.time, outputs_of(config))
        folder.write_config(config)
        for remark in remarks:
            folder.log(f"warning: {remark}")
            warnings.warn(f"{folder.path}: {remark}", RuntimeWarning, stacklevel=3)
        Driver(config, folder, simulation, info).run(control)
    return Run(folder.path)


def _has_ended(config: Config, saved: Checkpoint, info: dict[str, Any]) -> bool:
    """Whether a run with these settings ends where its checkpoint is; `info` tells if it has converged there."""
    ended = info.get("ended", {})
    judged = (ended.get("step"), ended.get("settings")) == (saved.state["step"], config.ending)
    return bool(judged or saved.state["time"] >= config.until)


def _check_parameters(config: Config, folder: RunFolder) -> None:
    """Refuse a file that does not say what it should: the defaults may not be those that it was made with."""
    fields = type(config.case).model_fields
    given = config.case.model_fields_set | {name for name, field in fields.items() if field.default is None}
    if unknown := [name for name in config.case.parameter_names() if name not in given]:
        raise RunFolderError(
            f"{folder.path}/case.toml does not say what {', '.join(unknown)} was: the run is of an older version, and "
            "the defaults of this one would change its method; add the values that it was made with, or run it again"
        )


def _changes(now: Config, saved: Checkpoint, folder: RunFolder) -> list[str]:
    """Say how the case differs from the one that a checkpoint was made with."""
    then, tables = of_the_flow(saved.case or {}), now.flow_tables()
    if then == tables:
        return []
    try:
        before = config.from_tables(then, folder.path, Path()).case
    except ConfigError as error:
        raise RunFolderError(f"{folder.path}: the case of its checkpoint cannot be used: {error}") from None
    old, new = (case.problem(saved.state).settings for case in (before, now.case))
    for one, two in zip(old["bodies"], new["bodies"], strict=False):
        if None in (one["velocity"], two["velocity"]):  # surfaces that slide as `surface_velocity` says, or do no more
            one["velocity"] = two["velocity"] = None
    fixed = [name for name in FIXED if old[name] != new[name]]
    made_for = [name for name in now.case.made_for if getattr(before, name) != getattr(now.case, name)]
    if fixed := made_for + fixed:
        raise RunFolderError(
            f"{folder.path}/case.toml has been changed in what the particles were made for ({', '.join(fixed)}); "
            "undo the change, or start a new run"
        )
    names = [name for name in then | tables if then.get(name) != tables.get(name) and name not in now.case.made_for]
    return [f"{name} = {tables.get(name)} (was {then.get(name)})" for name in names]
