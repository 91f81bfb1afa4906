"""How a run ended, in words, as those of :mod:`alsph.cases.remarks`."""

import itertools
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from alsph.analysis.measures import Measure
from alsph.analysis.record import Record
from alsph.analysis.window import Window
from alsph.arrays import FloatArray
from alsph.cases.free_surface import ENERGY
from alsph.cases.method import DIFFUSION
from alsph.config import of_the_flow
from alsph.errors import RunFolderError
from alsph.folder.run_folder import GOING_ON
from alsph.text import shown

DIVERGENCE = 0.02
"""Mean |∇·u| [U/D] above which it is remarked upon; runs with the defaults have 1e-4 to 5e-3 (docs/results.md)."""

FEW_PERIODS = 5

MOST_AT_SURFACE = 0.5
"""Share of the fluid at its surface from which on it is remarked upon."""

BACKFLOW = 0.01
"""Share of an outlet's buffer that comes back, in the mean over the window, from which on it is remarked upon."""


PACKING = 0.1
"""Mean of `packing_rms` from which on it is remarked upon; shipped cases have up to 0.02."""

UNSOLVED = 0.05
"""Mean residual of the Poisson equation from which on it is remarked upon that nothing asked for less: BiCGSTAB and
multigrid leave up to 1e-3, Jacobi's iteration that ends by its change 0.007 in a periodic box and 1 past a body."""

NO_DRAG = 1e-6
"""Drag coefficient below which it is rounding, as of a fluid at rest."""


def outcome(run: Record, until: str, scheme: str | None = None) -> list[str]:
    """Remark on how a run by a scheme that was to reach `until` [D/U] in words ended, and on its statistics."""
    time = run.history["time"]
    found = [str(ended["remark"])] if (ended := run.info.get("ended")) else []
    if run.status != "finished":
        reached = time[-1] if len(time) else 0.0
        found.append(f"{run.status}: at tU/D = {reached:.4g} of {until}; results are those up to there")
    if retries := run.info.get("retries"):
        found.append(f"retried: broke down {len(retries)} times, went on with smaller time steps")
    found += missing(run)
    with suppress(RunFolderError):  # without particles the rest can be judged all the same
        if len(run.times) and run.times[0] > 0:
            found.append(f"incomplete: the snapshots before tU/D = {run.times[0]:.4g} are missing in particles.vtkhdf")
    if told := [f"at tU/D = {time:.4g} {told_changes(what)}" for time, what in changes(run)]:
        found.append(f"changed on the way: {'; '.join(told)}; averages may go across it")
    divergence, at_surface = run.divergence, has_surface(run.history)
    largest = divergence.mean if at_surface else np.fmax(divergence.mean, divergence.at_end)
    if largest > DIVERGENCE:
        remedy = "more projection_sweeps lower it"
        if scheme in DIFFUSION:
            remedy = "a larger sound_speed lowers it"
        elif scheme in (None, "alsph") and not at_surface:
            remedy = "more projection_sweeps or max_iterations lower it"
        if at_surface:
            remedy = f"particles at the surface and alone in the air count, too; {remedy}"
        where = ""
        if largest > 2 * divergence.mean:
            where = f" where steps end, {float(divergence.mean):.2g} where they take their derivatives"
            if _apart(run):
                remedy = "derivatives in the middle of a step, as those of alsph and isph by default, leave less"
        found.append(f"not divergence-free: mean |∇·u| = {float(largest):.2g} U/D{where}; {remedy}")
    found += [*lost(run), *crowded(run.history), *thinned(run.history), *backflow(run)]
    if run.body and run.window.edges.size:
        found += unsettled(run.window)
        if run.drag.mean < -NO_DRAG and not (has_moved(run.history) or has_surface(run.history)):
            found.append(f"unphysical: mean drag coefficient {run.drag.mean}; a stream drags a body at rest along")
    return found


def _apart(run: Record) -> bool:
    """Whether a run's steps took their derivatives elsewhere than in the middle."""
    return any(part["case"].get("algorithm") in (1, 2, "original") for part in run.info.get("segments", [])[-1:])


def missing(run: Record) -> list[str]:
    """Remark on steps of which nothing is recorded, in a file that was damaged."""
    steps = run.history.get("step", np.empty(0))
    if not len(steps):
        return []
    made = int(steps[-1])
    if run.status not in GOING_ON:
        made = max(made, int(run.info.get("step", 0)))
    if not (lost := made - len(steps)):
        return []
    gap = np.diff(steps, prepend=0, append=made + 1) > 1
    first = int(np.argmax(gap))
    after = f"the first behind step {int(steps[first - 1])}" if first else "the first ones"
    return [f"incomplete: {lost} of {made} steps are missing in the history, {after}; averages are without them"]


def changes(run: Record) -> list[tuple[float, dict[str, tuple[Any, Any]]]]:
    """Return when a run was made to go on with other parameters [D/U], and what each of these was and became."""
    times = run.history["time"]
    steps = run.history.get("step", 1 + np.arange(len(times)))
    retried = {retry["step"] for retry in run.info.get("retries", [])}
    found = []
    for before, after in itertools.pairwise(run.info.get("segments", [])):
        was, became = (of_the_flow(part["case"]) for part in (before, after))
        names = [name for name in was | became if was.get(name) != became.get(name)]
        made = steps <= after["step"]
        if names and made.any() and not made.all() and after["step"] not in retried:
            found.append((float(times[made][-1]), {name: (was.get(name), became.get(name)) for name in names}))
    return found


def told_changes(changed: Mapping[str, tuple[Any, Any]]) -> str:
    """Return changes in words; of what a table such as an outline holds too much is to be told."""
    return ", ".join(f"{name} {_brief(was)} -> {_brief(became)}" for name, (was, became) in changed.items())


def _brief(value: Any) -> str:
    return str(value.get("file", "another")) if isinstance(value, dict) else "none" if value is None else shown(value)


def has_moved(history: Mapping[str, FloatArray]) -> bool:
    """Whether bodies have moved as rigid ones."""
    return any(name.endswith("_displacement_x") for name in history)


def unsettled(window: Window, least_periods: int = FEW_PERIODS) -> list[str]:
    """Remark on a window in which the averages are not yet, or not surely, those of a settled flow."""
    if window.developing:
        return [window.rule.replace(" (", ": ", 1).replace(")", "", 1)]
    if window.periods and not window.settled:
        return [f"not settled: {window.rule}"]
    if 0 < window.periods < least_periods:
        return [f"few periods: averaged over {window.periods} of shedding; a longer run tells more"]
    return []


def has_surface(history: Mapping[str, FloatArray]) -> bool:
    """Whether particles have been at a free surface; what an older version has not recorded is NaN."""
    return bool(np.nan_to_num(history.get("surface", np.empty(0))).any())


def made(measures: Iterable[Measure]) -> list[str]:
    """Remark on energy that a step has made, if a run's measures tell of more than is borne."""
    return [
        f"energy made: kinetic and potential energy rise by {100 * measure.value:.2g} % of their start, and nothing in "
        "the flow gives it; smaller steps (courant) or a finer resolution make less"
        for measure in measures
        if measure.name == ENERGY and measure.value > measure.tolerance
    ]


def lost(run: Record) -> list[str]:
    """Remark on fluid that has left a flow with a free surface through the sides that are open to the air."""
    fluid = run.history.get("fluid", np.empty(0))
    if not has_surface(run.history) or fluid[-1] >= fluid.max():
        return []
    share = f"{100 * (1 - fluid[-1] / fluid.max()):.2g} %"
    return [f"lost: {share} of the fluid has left through the sides open to the air; a larger domain keeps it"]


def crowded(history: Mapping[str, FloatArray]) -> list[str]:
    """Remark on fluid whose particles are not Δx apart, for which kernel, walls and masses are made."""
    rms = history.get("packing_rms", np.empty(0))
    known = np.isfinite(rms)
    if not known.any() or not (mean := float(rms[known].mean())) > PACKING:
        return []
    least, most = (float(history[f"packing_{name}"][known].mean()) for name in ("min", "max"))
    text = f"{least:.3g} to {most:.3g} times as dense as particles Δx apart, {100 * mean:.2g} % off in the mean"
    return [f"packing: the fluid is {text}; is it placed with another spacing than 1/resolution?"]


def thinned(history: Mapping[str, FloatArray]) -> list[str]:
    """Remark on fluid of which so much is taken for its surface, which carries no pressure, that little is inside."""
    surface, fluid = (np.nan_to_num(history.get(name, np.empty(0))) for name in ("surface", "fluid"))
    if not has_surface(history) or (share := (surface / fluid)[-1]) < MOST_AT_SURFACE:
        return []
    text = f"{100 * share:.2g} % of the fluid counts as surface at the end, and carries no pressure"
    return [f"thin: {text}: sheets of two particles, or, at any resolution, fluid drawn out to more than 2.6 times"]


def backflow(run: Record) -> list[str]:
    """Remark on fluid that comes back through an outlet, of which nothing is known but the fluid beside it."""
    history, inside = run.history, run.window.holds(run.history["time"])
    returning, buffer = (history.get(name, np.zeros(len(inside)))[inside] for name in ("returning", "outlet"))
    if not buffer.sum() or (share := returning.sum() / buffer.sum()) < BACKFLOW:
        return []
    text = f"fluid comes back through {100 * share:.2g} % of the outlet; it is taken to be as the fluid beside it"
    return [f"backflow: {text}, an outlet farther off has less"]


def unsolved(run: Record, tolerance: float, cap: int) -> list[str]:
    """Remark on steps whose Poisson solve ended above its tolerance, of those whose residual is known."""
    residual = run.history.get("residual", np.empty(0))
    looked = np.isfinite(residual)
    if not looked.any() or not tolerance:
        return []
    failed = looked & (run.history["converged"] == 0)
    if not failed.any():
        return []
    capped = int((failed & (run.history["iterations"] >= cap)).sum())
    text = f"in {failed.sum()} of {looked.sum()} steps the Poisson solve ended above its tolerance of "
    text += f"{tolerance:g}, {capped} at the cap of {cap} iterations, "
    remedy = "raise solver_iterations or use another solver" if capped else "it fell no further; use another solver"
    return [f"pressure not solved: {text}residual up to {residual[failed].max():.2g}; {remedy}"]


def ended_early(run: Record) -> list[str]:
    """Remark on solves by Jacobi's iteration, which ends by the change of the pressure, that leave much to be solved.

    They count as converged; of those that do not :func:`unsolved` tells.
    """
    history = run.history
    residual = history.get("residual", np.empty(0))
    looked = np.isfinite(residual)
    if not looked.any():
        return []
    ended = looked & (history["converged"] != 0)
    inside = ended & run.window.holds(history["time"])
    if not inside.any() or (mean := residual[inside].mean()) < UNSOLVED:
        return []
    text = f"Jacobi's iteration ended by the change of the pressure; the residual is {mean:.2g} in the mean"
    return [f"pressure not solved: {text}; take a smaller solver_tolerance, or another solver"]
