"""What a run will take, before it is started."""

from __future__ import annotations

import math
import time as clock

import numpy as np

from alsph.arrays import Arrays
from alsph.cases import Body, Body3D
from alsph.cases.base import Case
from alsph.cases.bodies import Bodies
from alsph.config import Config
from alsph.engine.simulation import Simulation
from alsph.errors import SolverError
from alsph.geometry.particles import Kind
from alsph.running.outputs import PLANE_INTERVAL, remarks_of
from alsph.text import duration
from alsph.units import Units

PROBE_SECONDS = 5.0

MOST_BODIES = 10
"""Bodies that are told one by one."""


def starting(config: Config) -> Arrays:
    """Return the particles that a run starts with.

    Raises
    ------
    ConfigError
        If they would not fit into the memory that is free.
    """
    config.check()
    return config.case.build().state


def describe(config: Config, state: Arrays | None = None, *, probe: bool = True) -> list[tuple[str, str]]:
    """Return particles, memory, time step limits, steps and estimated time of a run, in words.

    Parameters
    ----------
    config
        The case and the settings of its run.
    state
        Its particles at the start, if they have been made already.
    probe
        Take a few steps to estimate the time.

    Raises
    ------
    ConfigError
        If the particles would not fit into the memory that is free.
    """
    case = config.case
    state = state or starting(config)
    kinds = np.bincount(state["kind"], minlength=len(Kind))
    counts = ", ".join(f"{kinds[kind]:,} {kind.name.lower()}" for kind in Kind if kinds[kind])
    limits = case.time_step_limits()
    binding = min(limits, key=lambda name: limits[name])
    step, constant = case.expected_time_step(), case.expected_penalty_constant()
    steps = config.until / (step * case.particle_spacing)
    lines = [
        ("case", f"{case.name}: {case.title}"),
        *((("outline", str(case.shape)),) if isinstance(case, Body | Body3D) else ()),
        *_several(case),
        ("Reynolds number", f"{case.reynolds:g}"),
        ("resolution", f"D/Δx = {case.resolution}, Δx = {case.particle_spacing:.6g} D"),
        ("particles", f"{kinds.sum():,}: {counts}"),
        ("memory", f"about {np.ceil(case.memory() / 2**20):,.0f} MiB, beside Python's own"),
        *((name, f"{value:.3g}") for name, value in case.scales().items()),
        *((("forces", f"those on {case.computed_share:g} of the body"),) if case.computed_share < 1 else ()),
        ("time step", f"ΔtU/Δx = {step:.4g}" + (" (adaptive)" if case.adaptive_time_step else "")),
    ]
    if np.isfinite(constant):
        name = "speed of sound" if case.is_weakly_compressible else "penalty"
        lines.append((name, f"C_BV = (c/u_max)² = {constant:.3g}: artificial Mach number {constant**-0.5:.2g}"))
    for name, limit in limits.items():
        if np.isfinite(limit):
            text = (
                f"ΔtU/Δx < {limit:.4g} at u_max = {case.expected_velocity:g} U{' (binds)' if name == binding else ''}"
            )
            lines.append((f"{name.replace('_', ' ')} limit", text))
    lines += _in_si(case.units, step * case.particle_spacing, config.until) if case.units else []
    if points := sum(math.prod(map(len, axes)) for axes in config.planes):
        interval = config.run.plane_interval or PLANE_INTERVAL
        size = (
            8
            * points
            * (case.space_dimensions + 1)
            * config.until
            / max(interval, step * case.particle_spacing)
            / 2**20
        )
        lines.append(("planes", f"{points:,} points, recorded every {interval:g} D/U: about {size:.2g} MiB"))
    most = "at most, until converged, " if config.converges else ""
    lines.append(("steps", f"{most}about {steps:,.0f} to t* = {config.until:g}"))
    if probe:
        try:
            seconds = _seconds_per_step(case.restored(state, config.run.threads))
            lines.append(("estimated time", f"{most}{duration(seconds * steps)} at {seconds:.3g} s a step"))
        except SolverError as error:
            lines.append(("warning", f"breaks down in the first steps: {error}"))
    if warning := case.time_step_warning():
        lines.append(("warning", warning))
    lines += [("remark", remark) for remark in remarks_of(config, state)]
    return [(case.symbols(name), case.symbols(text)) for name, text in lines]


def _several(case: Case) -> list[tuple[str, str]]:
    """Return where each of several bodies is, and how large."""
    if not isinstance(case, Bodies) or not (middles := case.middles()):
        return []
    extents = [(right - left, top - bottom) for left, bottom, right, top in (body.bounds for body in case.outlines)]
    lines = [
        (name, f"{length:.4g} D by {height:.4g} D about x = {x:.4g} D, y = {y:.4g} D")
        for (name, (x, y)), (length, height) in zip(middles.items(), extents, strict=True)
    ]
    left = len(lines) - MOST_BODIES
    return lines[:MOST_BODIES] + [("further bodies", f"{left}, to {lines[-1][0]}")] * (left > 0)


def _in_si(units: Units, step: float, until: float) -> list[tuple[str, str]]:
    """Return what is to be known of units, and a time step and end time [D/U] in them."""
    second = units.factor("time")
    return [
        ("units", f"{units}; D/U = {second:.4g} s"),
        ("time step in SI", f"{step * second:.4g} s"),
        ("duration in SI", f"{until * second:.4g} s"),
    ]


def _seconds_per_step(simulation: Simulation) -> float:
    simulation.advance(1)  # the first step allocates
    start = clock.perf_counter()
    steps = simulation.advance(20, wall_seconds=PROBE_SECONDS)
    return (clock.perf_counter() - start) / max(steps, 1)
