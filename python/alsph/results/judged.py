"""What a run is judged by: measures of its case, beside references where these hold, and whether they still change."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

from alsph.analysis.loads import Divergence
from alsph.analysis.measures import Measure, Profile, alone
from alsph.analysis.record import Record
from alsph.cases import answers
from alsph.cases.method import Method
from alsph.config import Config, of_the_flow
from alsph.errors import AlsphError, ConfigError
from alsph.geometry.particles import Snapshot
from alsph.results.outcome import changes, told_changes
from alsph.run_settings import RunSettings
from alsph.text import shown

Judged = TypeVar("Judged", Measure, Profile)

OWN_NAMES = frozenset(
    (
        *("case", "status", "message", "time", "steps", "seconds", "folder", "remarks", "units"),
        *("Reynolds number", "resolution, D/Δx", "computing time", "time reached, tU/D", "iterations of a step"),
        *("averaged from tU/D", "averaged to tU/D", "averaging rule", "shedding periods"),
        *("share of the body that is computed", "artificial Mach number", "artificial Mach number of the penalty"),
        *Divergence.NAMES.values(),
        *("sum of the velocity divergence, Σ|∇·u| D/U", "mean time step, ΔtU/Δx", "mean iterations"),
    )
)
"""What results of a run, and the row of one in a study, have of their own beside parameters and settings."""

NUMBERED = re.compile(r"remark \d+")
"""The same of remarks."""

ELSEWHERE = "no reference: it is of the flow from the case's own start on, and this run goes on with another's"
"""The remark on a run that an initial run takes its reference."""


DRIVEN = "driven: bodies are moved, and drag and lift follow; periods and a Strouhal number may be the motion's"
"""The remark on a run that finds periods where bodies are moved by a user's expression."""


class _Until:
    """What a run was when a share of its time had gone, as far as its snapshots tell; the rest is the run's."""

    def __init__(self, run: Record, share: float) -> None:
        self._run = run
        self.times = run.times[run.times <= share * run.times[-1:]]

    def snapshot(self, time: float | None = None) -> Snapshot:
        return self._run.snapshot(self.times[-1] if time is None else time)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._run, name)


def judged(run: Record, config: Config) -> tuple[list[Measure], list[str]]:
    """Return the measures of a run, and what went wrong with them in code of the user's."""

    def found() -> list[Measure]:
        measures = _measures(run, config)
        _check_names(measures, config)
        if stands_alone(run, config):
            return alone(measures)
        return _settled(measures, run, config) if config.case.is_steady else measures

    return _told("measures", config, found)


def drawn(run: Record, config: Config) -> tuple[list[Profile], list[str]]:
    """Return the profiles of a run, and what went wrong with them in code of the user's."""
    case = config.case

    def found() -> list[Profile]:
        profiles = answers.listed(case, "profiles", Profile, lambda: case.profiles(run))
        if case.no_reference or stands_alone(run, config):
            return [profile.alone() for profile in profiles]
        return profiles

    return _told("profiles", config, found)


def _told(what: str, config: Config, ask: Callable[[], list[Judged]]) -> tuple[list[Judged], list[str]]:
    """Return what is found, or why code of the user's finds nothing."""
    case = config.case
    name = f"{type(case).__name__}.{what}()"
    try:
        with answers.told(name, case):
            return ask(), []
    except AlsphError as error:
        if not answers.is_own(case):
            raise
        why = str(error) if str(error).startswith(name) else f"{name} fails, {error}"
        return [], [f"no {what}: {why}; correct the file that defines it"]


def _measures(run: Record, config: Config) -> list[Measure]:
    case = config.case
    return answers.listed(case, "measures", Measure, lambda: case.measures(run))


def _check_names(measures: Iterable[Measure], config: Config) -> None:
    """Refuse measures that would take each other's place among the results, or that of one which is there anyway."""
    case = config.case
    taken = OWN_NAMES | {case.symbols(name) for name in OWN_NAMES}
    taken |= {*case.parameter_names(), *RunSettings.model_fields}
    counts = Counter(measure.name for measure in measures)
    counts.update(f"{measure.name}, reference" for measure in measures if abs(measure.reference) > 0)
    for name, count in counts.items():
        if count > 1:
            raise ConfigError(f"{type(case).__name__}.measures() has {count} of the name {shown(name)}")
        if name in taken or NUMBERED.fullmatch(name):
            told = "results of a run, or rows of a study, have something of that name"
            raise ConfigError(f"{type(case).__name__}.measures(): {shown(name)}: {told}; give it another one")


def edited(run: Record, config: Config) -> dict[str, tuple[Any, Any]]:
    """Return what each parameter was that the run was made with, and what its file says now, where that is another."""
    known = [*(part["case"] for part in run.info.get("segments", [])[-1:]), run.info.get("began")]
    made = [of_the_flow(tables) for tables in known if tables]
    if not made:
        return {}
    defaults = {name: field.default for name, field in type(config.case).model_fields.items()}
    says = defaults | json.loads(json.dumps(config.flow_tables()))
    found = {}
    for name, value in says.items():
        was = [tables.get(name, defaults.get(name)) for tables in made]
        if value not in was:
            found[name] = (was[0], value)
    return found


def noted(run: Record, config: Config) -> list[str]:
    """Remark on what a run is judged by: of which flow its references are, its file's parameters and its periods."""
    found = [ELSEWHERE] if goes_on_elsewhere(run, config) else []
    if changed := edited(run, config):
        told = f"case.toml was changed after the run was made: {told_changes(changed)}"
        found.append(f"edited: {told}; put it back, or resume the run with it: numbers made with both are of no flow")
    if config.case.is_moved and run.window.periods:
        found.append(DRIVEN)
    return found


def stands_alone(run: Record, config: Config) -> bool:
    """Whether what is known of the case's flow does not hold for a run of it."""
    names = {name for _, changed in changes(run) for name in changed} | edited(run, config).keys()
    return config.case.is_driven or goes_on_elsewhere(run, config) or bool(names - Method.model_fields.keys())


def goes_on_elsewhere(run: Record, config: Config) -> bool:
    """Whether a run goes on with the flow of another, where references are of the case's own start."""
    begun = run.info["start"].get("initial_run") if "start" in run.info else config.run.initial_run
    return config.case.from_start and bool(begun)


def _settled(found: list[Measure], run: Record, config: Config) -> list[Measure]:
    """Return measures of a steady flow with a note on those that are another than a quarter of the run before."""
    before = {measure.name: measure for measure in _measures(_Until(run, 0.75), config)}
    return [measure.settling(before[measure.name]) if measure.name in before else measure for measure in found]
