"""What a run begins with and is known by beside its parameters: another run's flow, the case's class, the inflow."""

from __future__ import annotations

import hashlib
import reprlib
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from alsph import cases
from alsph.analysis import sampling
from alsph.cases.base import Case
from alsph.cases.driven import RULES
from alsph.cases.source import shown_name
from alsph.config import Config
from alsph.engine.prescribed import WORDS, difference
from alsph.engine.simulation import Simulation
from alsph.errors import ConfigError, RunFolderError
from alsph.folder.checkpoint import Checkpoint
from alsph.folder.run_folder import RunFolder
from alsph.results.run import Run


def started(case: Case, state: dict[str, Any], initial_run: str | Path) -> dict[str, Any]:
    """Return the particles of a case with the last flow of another run (:func:`alsph.analysis.sampling.initial_state`).

    Warns
    -----
    RuntimeWarning
        Of each of :func:`remarks`.

    Raises
    ------
    ConfigError, RunFolderError
        If the flow cannot be used.
    """
    if case.checked_domain.meets_air:
        told = f"initial_run = '{initial_run}': {case.name} has a free surface, and begins where its particles() has it"
        raise ConfigError(f"{told}; go on with a run by alsph resume RUN --until TIME")
    run = Run(initial_run)
    state = sampling.initial_state(state, run, outlet=not unlike(case, run))
    for remark in remarks(case, run):
        warnings.warn(remark, RuntimeWarning, stacklevel=3)
    return state


def remarks(case: Case, run: Run) -> list[str]:
    """Say what speaks against beginning a case with the flow of a run: another problem, or a run without an end."""
    found = []
    if other := unlike(case, run):
        found.append(f"initial_run = '{run.path}': is of another flow than this one, {'; '.join(other)}")
    if run.status != "finished":
        time = run.info.get("time", float("nan"))
        found.append(f"initial_run = '{run.path}': has not finished, it is {run.status} at t* = {time:.4g}")
    if any(values[-1] for name, values in run.history.items() if "_displacement_" in name and len(values)):
        found.append(f"initial_run = '{run.path}': its bodies have moved, and here begin where they are drawn")
    return found


def unlike(case: Case, run: Run) -> list[str]:
    """Say in what a run's case or geometry is not that of a case."""
    was, own_case = run.case.get("case"), case.declaration()
    if was != own_case:
        same = shown_name(was) == shown_name(own_case)
        return [f"its case is {shown_name(was)}" + " as another text of that file has it" * same]
    free = (Case.model_fields.keys() | set(case.of_the_start)) - set(RULES.values())
    own = {name: value for name, value in Config(case).case_tables().items() if name not in {"case", *free}}
    was = own | {name: run.case.get(name) for name in RULES.values()} | run.case
    return [
        f"{name} = {reprlib.repr(was[name])} (here {reprlib.repr(own.get(name))})"
        for name in dict.fromkeys([*own, *RULES.values()])
        if was[name] != own.get(name)
    ]


def flow_sha256(run: Run) -> str:
    """Return the SHA-256 of the last flow of a run, by which its content is known wherever it lies.

    Raises
    ------
    RunFolderError
        If it has no complete snapshot.
    """
    snapshot, total = run.snapshot(), hashlib.sha256()
    for values in (snapshot.position, snapshot.velocity, snapshot.pressure, snapshot.kind):
        total.update(np.ascontiguousarray(values).data)
    return total.hexdigest()


def of(config: Config) -> tuple[list[str], dict[str, Any]]:
    """Return what is to be said of the beginning of a new run, and what ``run.json`` is to know it by.

    Warns
    -----
    RuntimeWarning
        If the run folder will be read as that of another case.
    """
    found = [warning] if (warning := config.case.time_step_warning()) else []
    if warning := _stranger(config.case):
        found.append(warning)
        warnings.warn(warning, RuntimeWarning, stacklevel=4)
    if config.run.initial_run is None:
        return found, {}
    initial = Run(config.run.initial_run)
    start = {"initial_run": config.run.initial_run, "flow_sha256": flow_sha256(initial)}
    return found + remarks(config.case, initial), start


def changed(config: Config, info: dict[str, Any]) -> list[str]:
    """Say if the run that one was to begin with has been changed since, which has no effect; `info` is ``run.json``."""
    now = config.run.initial_run
    before = info["start"].get("initial_run") if "start" in info else now  # an older alsph has no `start`
    return (
        [] if _same_path(now, before) else [f"initial_run = {now!r} has no effect: the run has begun with {before!r}"]
    )


def _same_path(one: str | None, two: str | None) -> bool:
    return one == two or (one is not None and two is not None and Path(one) == Path(two))


def alike(config: Config, kept: Config, folder: RunFolder, info: dict[str, Any]) -> bool:
    """Whether a run, of which `kept` and `info` tell, has the class, beginning and rules of this configuration."""
    if info.get("case_class", type(config.case).__qualname__) != type(config.case).__qualname__:
        return False
    return _same_flow(config, kept, info) and _same_rules(config, folder, info)


def _same_flow(config: Config, kept: Config, info: dict[str, Any]) -> bool:
    initial, recorded = config.run.initial_run, info.get("start", {}).get("flow_sha256")
    if initial is None or recorded is None:  # an older alsph did not record it
        return _same_path(initial, kept.run.initial_run)
    try:
        return bool(flow_sha256(Run(initial)) == recorded)
    except RunFolderError:  # it is gone, and not needed any more
        return _same_path(initial, kept.run.initial_run)


def _same_rules(config: Config, folder: RunFolder, info: dict[str, Any]) -> bool:
    """Whether what functions prescribe in a run is still what the case's do."""
    if not (config.case.rules or rules_of(info)):
        return True
    try:
        saved = folder.read_checkpoint()
        return not difference(restored(config, saved, folder).rules, saved.prescribed)
    except RunFolderError:
        return False


def _stranger(case: Case) -> str:
    """Return a warning if a run folder of this case would be read as one of another class, or of none."""
    known, own = cases.CASES.get(case.name), type(case)
    if known is own or isinstance(case.declaration(), dict):
        return ""
    reader = f"takes it for alsph.cases.{known.__name__}" if known else "does not know it"
    return (
        f"the case class {own.__qualname__} does not stand in alsph.cases.CASES under its name '{case.name}': whoever "
        f"opens its run folder {reader}, and the run cannot be resumed or repeated; give the class a name of its own "
        "and put it there"
    )


def check_class(case: Case, info: dict[str, Any], path: Path) -> None:
    """Refuse a run of another class than the one that its case's name stands for.

    Raises
    ------
    RunFolderError
        If ``run.json``, of which this is the content, tells of another.
    """
    own = type(case).__qualname__
    if (was := info.get("case_class", own)) != own:
        raise RunFolderError(
            f"{path}: the run is of the case class {was}, and '{case.name}' stands for {own} in alsph.cases.CASES; "
            f"give {was} a name of its own and put it there before the run, or put it there now under this one"
        )


def restored(config: Config, saved: Checkpoint, folder: RunFolder) -> Simulation:
    """Return the simulation of a case that goes on from a checkpoint.

    Raises
    ------
    RunFolderError
        If the checkpoint does not fit, or a function prescribed something and the case does not tell of any.
    """
    try:
        simulation = config.case.restored(saved.state, config.run.threads)
    except ConfigError as error:
        raise RunFolderError(f"{folder.path}: its checkpoint does not fit its case: {error}") from None
    for name in saved.prescribed:
        was_told = (saved.case or {}).get(RULES[name]) is not None  # by a parameter, which may be taken away
        if name not in simulation.rules and not was_told:
            raise RunFolderError(
                f"{folder.path}: a function prescribes the {WORDS[name]} of the run, and its case does not tell of "
                f"any; make it the method `{name}` of the case's class, and put that into alsph.cases.CASES before"
            )
    return simulation


def rules_of(info: dict[str, Any]) -> list[str]:
    """Return the names of the rules that ``run.json`` tells of."""
    names = info.get("rules", ["inflow"] if info.get("inflow_function") else [])
    return [name for name in WORDS if isinstance(names, list) and name in names]
