"""What a run is judged by: measures of its case, beside references where these hold, and whether they still change."""

from __future__ import annotations

from typing import Any

from alsph.analysis.measures import Measure, alone
from alsph.analysis.record import Record
from alsph.cases.base import Case
from alsph.cases.method import Method
from alsph.cases.source import reason
from alsph.config import Config
from alsph.geometry.particles import Snapshot
from alsph.results.outcome import changes
from alsph.text import shown

ELSEWHERE = "no reference: it is of the flow from the case's own start on, and this run goes on with another's"
"""The remark on a run that an initial run takes its reference."""


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
    case = config.case
    try:
        found = case.measures(run)
        if odd := [measure for measure in found if not isinstance(measure, Measure)]:
            raise TypeError(f"{shown(odd[0])} is no Measure")
        if stands_alone(run, config):
            found = alone(found)
        elif case.is_steady:
            found = _settled(found, case, run)
    except Exception as error:
        if type(case).__module__.startswith("alsph."):
            raise
        what = reason(error, case.code.file if case.code else "<cell>")
        return [], [f"no measures: those of {type(case).__name__} fail, {what}; correct the file that defines it"]
    return found, []


def stands_alone(run: Record, config: Config) -> bool:
    """Whether what is known of the case's flow does not hold for a run of it."""
    names = {name for _, changed in changes(run) for name in changed}
    return config.case.is_driven or goes_on_elsewhere(run, config) or bool(names - Method.model_fields.keys())


def goes_on_elsewhere(run: Record, config: Config) -> bool:
    """Whether a run goes on with the flow of another, where references are of the case's own start."""
    begun = run.info["start"].get("initial_run") if "start" in run.info else config.run.initial_run
    return config.case.from_start and bool(begun)


def _settled(found: list[Measure], case: Case, run: Record) -> list[Measure]:
    """Return measures of a steady flow with a note on those that are another than a quarter of the run before."""
    before = {measure.name: measure for measure in case.measures(_Until(run, 0.75))}
    return [measure.settling(before[measure.name]) if measure.name in before else measure for measure in found]
