"""Autotune: the largest stable time step and the cheapest iterations for a divergence, by the paper's way.

The paper (Kolukisa et al. 2021, sections 4.1 and 4.2) raises the time step until the flow breaks down, takes the
largest step that did not, and then tries numbers of iterations with it. Here both are done with short probes from one
developed state of the user's own case.
"""

import math
import time as clock
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from alsph.arguments import number, path_of
from alsph.cases import Case
from alsph.config import Config
from alsph.errors import ConfigError, SolverError
from alsph.folder.durable import write_text
from alsph.tables import markdown
from alsph.text import duration, shown

RUNGS = 2**0.5
"""Ratio of the time steps of the ladder."""

BISECTIONS = 2
"""Halvings, in the logarithm, of the rung between the largest stable and the smallest unstable step."""

SMALLEST_STEP = 1e-3
BLOWN_UP = 2.0
"""A probe whose u_max exceeds that of the developed state by this factor is unstable, broken down or not."""

AT_REST = 1e-3
"""Share of the velocity of waves below which what moves beside a free surface is the scheme's doing."""

ITERATIONS = (1, 2, 3, 5, 8, 12, 20)
SWEEPS = (0, 2, 4, 8)


@dataclass(frozen=True)
class Probe:
    """A short run from the developed state.

    Attributes
    ----------
    time_step : float
        ΔtU/Δx.
    max_iterations, projection_sweeps : int
    stable : bool
    divergence : float
        Mean |∇·u| D/U over the second half of the probe, NaN if unstable.
    cost : float
        Computing time a unit of flow time [s / (D/U)], NaN if unstable.
    """

    time_step: float
    max_iterations: int
    projection_sweeps: int
    stable: bool
    divergence: float = math.nan
    cost: float = math.nan


@dataclass(frozen=True, eq=False)
class Tuning:
    """What an autotune found.

    Attributes
    ----------
    case : Case
        The case with the time step, iterations and sweeps found; while the flow develops its steps obey the stability
        law.
    largest_stable : float
        Largest ΔtU/Δx that was found stable.
    smallest_unstable : float
        Smallest ΔtU/Δx that was found unstable; infinite if none was.
    target : float
        The divergence asked for, mean |∇·u| D/U.
    reached : bool
        Whether a probe reached it; if not, the case has the least divergence found.
    probes : list of Probe
    """

    case: Case
    largest_stable: float
    smallest_unstable: float
    target: float
    reached: bool
    probes: list[Probe]

    def __str__(self) -> str:
        """Return the findings in words and the table of the probes."""
        case = self.case
        best = (
            f"cheapest with mean |∇·u| D/U of {self.target:.2g} or less"
            if self.reached
            else f"least divergence found; none reached {self.target:.2g}"
        )
        limits = case.time_step_limits()
        binding = min(limits, key=lambda name: limits[name])
        lines = [
            f"largest stable ΔtU/Δx: {self.largest_stable:.4g} (unstable: {self.smallest_unstable:.4g}; "
            f"the {binding.replace('_', ' ')} law says {limits[binding]:.4g})",
            f"time_step = {case.largest_time_step:.4g}, max_iterations = {case.max_iterations}, "
            f"projection_sweeps = {case.projection_sweeps}: {best}",
        ]
        header = [case.symbols("ΔtU/Δx"), "iterations", "sweeps", "stable", case.symbols("mean |∇·u| D/U")]
        header.append("s a unit of time")
        rows = [
            [
                f"{probe.time_step:.4g}",
                str(probe.max_iterations),
                str(probe.projection_sweeps),
                "yes" if probe.stable else "no",
                f"{probe.divergence:.2e}" if probe.stable else "",
                f"{probe.cost:.3g}" if probe.stable else "",
            ]
            for probe in self.probes
        ]
        return "\n".join([*map(case.symbols, lines), "", markdown(header, rows)])

    def save(self, path: str | Path) -> None:
        """Write ``case.toml`` with the tuned case and ``report.md`` into a folder."""
        folder = path_of("path", path, "folder")
        folder.mkdir(parents=True, exist_ok=True)
        write_text(folder / "case.toml", Config(self.case).text())
        write_text(folder / "report.md", f"# Autotune of {self.case.name}\n\n{self}\n")


def autotune(
    case: Case,
    divergence: float = 1e-3,
    *,
    develop: float = 3.0,
    probe: float = 1.0,
    margin: float = 0.9,
    threads: int | None = None,
    progress: bool = True,
) -> Tuning:
    """Find the largest stable time step and the cheapest iterations for a given divergence on a case.

    The flow is first developed with the case's own settings and the stability law. From that state the time step is
    raised (or lowered) on a ladder of √2 until a probe breaks down, and the last rung is bisected. Then, with `margin`
    times the largest stable step, iterations and projection sweeps are tried, cheapest first. If none is good enough,
    the shorter steps of the ladder count, too.

    Parameters
    ----------
    case
        The case to tune; its algorithm, walls and shifting stay.
    divergence
        Mean |∇·u| D/U that is good enough.
    develop
        Time for which the flow is developed before [D/U].
    probe
        Length of each probe [D/U].
    margin
        Fraction of the largest stable step that is used.
    threads
        Number of threads; all cores if None.
    progress
        Report progress.

    Raises
    ------
    ConfigError
        If a number cannot be used, no time step is stable, or nothing moves beside a free surface.
    SolverError
        If the flow breaks down while it is developed.
    """
    if not isinstance(case, Case):
        raise ConfigError(f"case = {shown(case)}: must be a case, such as alsph.cases.Cylinder()")
    numbers = {"divergence": divergence, "develop": develop, "probe": probe, "margin": margin}
    for name, value in numbers.items():
        number(name, value, above=0, finite=True)
    if margin > 1:
        raise ConfigError(f"margin = {margin}: must not exceed 1, the largest stable step itself")
    if case.scheme not in (None, "alsph"):
        raise ConfigError(f"scheme = {case.scheme}: only steps and iterations of alsph can be tuned; leave scheme out")
    tuner = _Tuner(case, develop, probe, threads, Console(highlight=False, quiet=not progress, soft_wrap=True))
    stable, unstable = tuner.time_step()
    tuner.iterations(margin * stable, divergence)
    tried = [found for found in tuner.probes if found.stable and found.time_step <= margin * stable]
    if not any(found.time_step == margin * stable for found in tried):
        raise ConfigError(f"no iterations are stable with ΔtU/Δx = {margin * stable:.4g}; take a smaller margin")
    low = [found for found in tried if found.divergence <= divergence]
    good = [found for found in low if found.time_step == margin * stable] or low
    best = min(good, key=lambda found: found.cost) if good else min(tried, key=lambda found: found.divergence)
    tuned = case.replace(
        courant=case.courant and max(case.courant, best.time_step * tuner.velocity_max),
        time_step=best.time_step,
        max_iterations=best.max_iterations,
        projection_sweeps=best.projection_sweeps,
        adaptive_time_step=True,
        adaptive_until=develop,
    )
    return Tuning(tuned, stable, unstable, divergence, bool(good), tuner.probes)


class _Tuner:
    """Probes from one developed state."""

    def __init__(self, case: Case, develop: float, length: float, threads: int | None, console: Console) -> None:
        self.case, self.length, self.threads, self.console = case, length, threads, console
        self.probes: list[Probe] = []
        developed = case.replace(adaptive_time_step=True, adaptive_until=None)
        self._say(f"developing the flow to t* = {develop:g}")
        simulation = developed.simulation(threads)
        started = clock.monotonic()
        while not simulation.run_until(develop, wall_seconds=10.0):
            left = (clock.monotonic() - started) * (develop / simulation.time - 1) if simulation.time else math.nan
            self._say(f"  t* {simulation.time:.3g}, ETA {duration(left)}")
        self.state = simulation.state()
        surface = simulation.problem.settings.get("free_surface") or {}
        own, reference = float(simulation.history()["velocity_max"][-1]), surface.get("reference_velocity", 0.0)
        if own < AT_REST * reference:
            told = f"nothing moves, u_max is {own:.2g} U at t* = {develop:g}: no step and no divergence can be judged"
            raise ConfigError(case.symbols(f"{case.name}: {told}; tune a case that flows, or a longer develop"))
        self.velocity_max = max(own, reference)  # as a step beside a free surface counts it
        self.law = min(developed.time_step_limits().values())

    def _say(self, line: str) -> None:
        self.console.print(self.case.symbols(line), markup=False)

    def time_step(self) -> tuple[float, float]:
        """Return the largest stable and the smallest unstable ΔtU/Δx."""
        step = self.law / RUNGS
        stable = self._probe(step).stable
        while True:
            following = step * RUNGS if stable else step / RUNGS
            if stable and following * self.velocity_max >= 1.0:
                return step, math.inf  # a particle may not cross more than Δx in a step
            if following < SMALLEST_STEP:
                raise ConfigError(f"no stable time step found down to ΔtU/Δx = {step:.3g}; is the case well posed?")
            if self._probe(following).stable != stable:
                break
            step = following
        low, high = sorted((step, following))
        for _ in range(BISECTIONS):
            middle = math.sqrt(low * high)
            low, high = (middle, high) if self._probe(middle).stable else (low, middle)
        return low, high

    def iterations(self, step: float, target: float) -> None:
        """Try iterations and sweeps with a time step, from the cheapest on, until one is good enough."""
        sweeps = SWEEPS if self.case.projection_sweeps else (0,)
        for count in sweeps:
            for iterations in ITERATIONS:
                found = self._probe(step, iterations, count)
                cheaper = [p.cost for p in self.probes if p.time_step == step and p.divergence <= target]
                if found.divergence <= target or (cheaper and found.cost > min(cheaper)):
                    break

    def _probe(self, step: float, iterations: int | None = None, sweeps: int | None = None) -> Probe:
        fixed = {"adaptive_time_step": False, "adaptive_until": None}
        changes: dict[str, Any] = {"courant": self.case.courant, "time_step": step} | fixed
        if iterations is not None:
            changes |= {"max_iterations": iterations, "projection_sweeps": sweeps}
        case = self.case.replace(**changes)
        simulation = case.restored(self.state, self.threads)
        started, stable = clock.process_time(), True
        try:
            simulation.run_until(self.state["time"] + self.length)
        except SolverError:
            stable = False
        cost = (clock.process_time() - started) / self.length
        rows = simulation.history()
        stable = stable and float(rows["velocity_max"].max()) < BLOWN_UP * self.velocity_max
        numbers = case.max_iterations, case.projection_sweeps
        if stable:
            late = rows["time"] > rows["time"][-1] - self.length / 2
            found = Probe(step, *numbers, True, float(np.mean(rows["divergence_mean"][late])), cost)
        else:
            found = Probe(step, *numbers, False)
        self.probes.append(found)
        outcome = f"mean |∇·u| D/U {found.divergence:.2e}, {found.cost:.3g} s a unit of time" if stable else "unstable"
        self._say(f"ΔtU/Δx {step:.4g}, {numbers[0]} iterations, {numbers[1]} sweeps: {outcome}")
        return found


__all__ = ["Probe", "Tuning", "autotune"]
