"""When a run with ``until = "converged"`` ends: as soon as what it is averaged for is known well enough."""

import math
from dataclasses import dataclass

import numpy as np

from alsph.analysis.averages import Estimate
from alsph.analysis.record import Record
from alsph.analysis.window import Window
from alsph.config import Config
from alsph.engine.times import next_multiple
from alsph.results.outcome import unsettled

LIFT_SHARE = 10 / 3
"""Largest ± of the rms lift, which scatters more, over that of mean drag and Strouhal number."""

LEAST_PERIODS = 8
"""Shedding periods without which no run has converged: the ± of fewer may be small by chance (docs/reliability.md)."""

MOST_PERIODS = 12
"""Shedding periods of a settled flow, averaged over which a run ends whatever the ±."""

INTERVAL = 2.0
"""Between two judgements at first [D/U]; later they are farther apart, by a sixteenth to a 32nd of the time."""


def next_judgement(time: float) -> float:
    """Return when a run is judged next [D/U]: every 2 D/U, from 64 D/U on every 4, from 128 on every 8, and so on.

    These are times of the flow, so that a run ends with the same step however often it was cut.
    """
    return next_multiple(time, max(INTERVAL, 2.0 ** (math.frexp(time)[1] - 5)))


WHY = {
    "converged": "converged: ended",
    "periods": "not converged: ended",
    "latest": "not converged: ended at its latest time",
}
"""Why a run ends, in words."""


@dataclass(frozen=True)
class Judgement:
    """What a run has come to.

    Attributes
    ----------
    averages : dict of Estimate
        Those of :attr:`alsph.Run.averaged`.
    missing : list of str
        What the run has not converged for.
    ended : str
        Why it ends, one of ``WHY``; empty while it goes on.
    where : str
        After how many shedding periods, and when.
    end : float
        When it will end at the latest, as far as can be told [D/U].
    """

    averages: dict[str, Estimate]
    missing: list[str]
    ended: str
    where: str
    end: float

    def __str__(self) -> str:
        """Tell the averages, and what is missing."""
        figures = ", ".join(f"{name} {Estimate(value, value.uncertainty)}" for name, value in self.averages.items())
        return "; missing: ".join(filter(None, (figures, ", ".join(self.missing))))

    @property
    def remark(self) -> str:
        """Why the run ended, in the form of :mod:`alsph.cases.remarks`."""
        return f"{WHY[self.ended]} {self.where}; {self}"


def judge(run: Record, config: Config) -> Judgement:
    """Judge a run, of whose history some is there, by its averages (:attr:`alsph.Run.averaged`) and their window.

    It has converged when the ± of each is small enough and there is nothing to remark on the window. Where no
    vortices are shed, that goes by the drag alone, from the time on at which runs of the case end by default: before,
    shedding may be yet to begin.
    """
    window, time, latest = run.window, float(run.history["time"][-1]), config.until
    missing = [remark.partition(";")[0] for remark in unsettled(window, LEAST_PERIODS)]
    if not window.periods and time < config.case.checked_until:
        missing.append(f"shedding, which may begin until tU/D = {config.case.checked_until:g}")
    for name, value in run.averaged.items():
        missing += _above(name, value, config.uncertainty * (LIFT_SHARE if name == "C_L'" else 1.0))
    reasons = {
        "converged": not missing,
        "periods": window.periods >= MOST_PERIODS and not window.developing,
        "latest": time >= latest,
    }
    after = f"after {window.periods} shedding periods" if window.periods else "without shedding"
    return Judgement(
        averages=run.averaged,
        missing=missing,
        ended=next((why for why, holds in reasons.items() if holds), ""),
        where=f"{after}, tU/D = {time:.4g}",
        end=min(latest, max(_last_period(window), next_judgement(time))),
    )


def _last_period(window: Window) -> float:
    """Return when so many shedding periods will have been averaged over that the run ends [D/U]."""
    if window.developing or not window.periods:
        return math.inf
    return window.start + MOST_PERIODS * (window.end - window.start) / window.periods


def _above(name: str, value: Estimate, limit: float) -> list[str]:
    """Say how far an average is from being known well enough, nothing if it is."""
    if not value.developing and value.uncertainty <= limit * abs(value):
        return []
    share = value.uncertainty / abs(value) if value else np.inf
    known = f"{100 * share:.3g} %" if np.isfinite(share) else "unknown"
    return [f"{name} ± {known} (limit {100 * limit:.3g} %)"]
