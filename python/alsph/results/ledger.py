"""The ledger of a run: how incompressible the flow stayed, and where its kinetic energy went."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from alsph.analysis import sampling
from alsph.analysis.record import Record
from alsph.arrays import AXES, FloatArray
from alsph.cases.base import Case
from alsph.geometry.particles import Snapshot

FORCES = ("pressure", "viscous")
"""Of the loads on a body."""


@dataclass(frozen=True, eq=False)
class Ledger:
    """Divergence, volume and kinetic energy of the fluid, each step, and its energy budget, each snapshot.

    Where no fluid enters or leaves, dE/dt = power - dissipation; `imbalance` is what the computed fields miss of that.
    Inlets and outlets carry energy that is not recorded: with them `dissipation`, `power` and `imbalance` are NaN.

    Attributes
    ----------
    time : ndarray, shape (n,)
        End of each step, tU/D.
    iterations : ndarray, shape (n,)
        Inner iterations.
    divergence_max, divergence_mean : ndarray, shape (n,)
        Largest and mean |∇·u| of the fluid particles [U/D].
    volume_drift : ndarray, shape (n,)
        Σ V_i of the fluid particles over its value after the first step, less 1.
    volume_error : ndarray, shape (n,)
        Σ V_i over the volume of the space that the fluid fills (`Case.fluid_volume`), less 1.
    kinetic_energy : ndarray, shape (n,)
        E = ½ρ ∫ |u|² dV [ρU²D^d], as Σ V_i of the fluid particles in a step before their shift, beside a free surface
        Σ m_i; of fields with jumps, as at a lid in the first steps, that differs from a sum over a snapshot.
    energy_rate : ndarray, shape (n,)
        dE/dt, by central differences [ρU³D^(d-1)].
    snapshot_time : ndarray, shape (k,)
        Times of the snapshots, tU/D.
    dissipation : ndarray, shape (k,)
        2ρν ∫ S:S dV, S = (∇u + ∇uᵀ)/2 by moving least squares at the particles; its error is of second order in Δx
        [ρU³D^(d-1)].
    power : ndarray, shape (k,)
        Work of the body force and of moving walls on the fluid in unit time [ρU³D^(d-1)].
    imbalance : ndarray, shape (k,)
        energy_rate + dissipation - power [ρU³D^(d-1)]; large where gradients are not resolved, as at a lid's corners.
    """

    time: FloatArray
    iterations: FloatArray
    divergence_max: FloatArray
    divergence_mean: FloatArray
    volume_drift: FloatArray
    volume_error: FloatArray
    kinetic_energy: FloatArray
    energy_rate: FloatArray
    snapshot_time: FloatArray
    dissipation: FloatArray
    power: FloatArray
    imbalance: FloatArray

    @classmethod
    def of(cls, run: Record, case: Case) -> Self:
        """Make the ledger of a run of a case from its history and its snapshots."""
        names = "time iterations divergence_max divergence_mean volume kinetic_energy".split()
        time, iterations, largest, mean, volume, energy = (run.history.get(name, np.empty(0)) for name in names)
        rate = np.gradient(energy, time) if len(time) > 1 else np.full_like(energy, np.nan)
        budget = np.full((3, len(run.times)), np.nan)
        if len(time) and not case.checked_domain.is_open:
            walls = np.interp(run.times, time, _wall_power(run, case))
            budget[:2] = np.array([_budget(run.snapshot(at), case) for at in run.times]).reshape(-1, 2).T
            budget[1] += walls
            budget[2] = np.interp(run.times, time, rate) + budget[0] - budget[1]
        return cls(
            time=time,
            iterations=iterations,
            divergence_max=largest,
            divergence_mean=mean,
            volume_drift=volume / volume[:1] - 1,
            volume_error=volume / case.fluid_volume() - 1,
            kinetic_energy=energy,
            energy_rate=rate,
            snapshot_time=run.times,
            dissipation=budget[0],
            power=budget[1],
            imbalance=budget[2],
        )


def mach_number(history: dict[str, FloatArray]) -> float:
    """Return u_max over the speed of sound c = √(r_AL/Δt), averaged over the steps; NaN where they do not tell."""
    names = ("velocity_max", "time_step", "penalty_coefficient")
    if not all(name in history for name in names):
        return np.nan
    fastest, step, penalty = (history[name] for name in names)
    moving = penalty > 0
    return float(np.mean(fastest[moving] * np.sqrt(step[moving] / penalty[moving]))) if moving.any() else np.nan


def _wall_power(run: Record, case: Case) -> FloatArray:
    """Work of the moving bodies on the fluid in unit time (n,): minus the force on each times its velocity; or NaN."""
    power = np.zeros_like(run.history["time"])
    if "sliding" in case.rules:  # which the force on the whole body does not tell
        return np.full_like(power, np.nan)
    moved = case.moved_bodies if "motion" in case.rules else []
    for body in case.checked_bodies:
        if body.name in moved or body.rigid:
            power += _rigid_power(run.history, body.name)
            continue
        if body.velocity is None:
            return np.full_like(power, np.nan)
        for axis, speed in zip(AXES, body.velocity, strict=False):
            for part in FORCES:
                power -= speed * run.history[f"{body.name}_{part}_force_{axis}"]
    return power


def _rigid_power(history: dict[str, FloatArray], body: str) -> FloatArray:
    """Return that of a rigid body: minus force and torque times its velocity and angular velocity."""
    pairs = [(f"{body}_{part}_force_{axis}", f"{body}_velocity_{axis}") for part in FORCES for axis in AXES]
    pairs += [
        (f"{body}_{part}_torque{axis}", f"{body}_angular_velocity{axis}")
        for part in FORCES
        for axis in ("", *(f"_{axis}" for axis in AXES))
    ]
    return -np.asarray(sum(history[load] * history[speed] for load, speed in pairs if load in history))


def _budget(snapshot: Snapshot, case: Case) -> tuple[float, float]:
    """Return dissipation and the body force's power in a snapshot."""
    fluid, spacing = snapshot.fluid, case.particle_spacing
    position, velocity, volume = snapshot.position[fluid], snapshot.velocity[fluid], spacing**case.space_dimensions
    images = sampling.with_images(position, velocity, case.checked_domain, sampling.REACH * spacing)
    gradient = sampling.interpolate(*images, position, spacing)[1]
    strain = (gradient + np.swapaxes(gradient, 1, 2)) / 2
    power = (velocity * case.body_force_at(position, snapshot.time)).sum()
    return 2 * case.kinematic_viscosity * volume * float((strain**2).sum()), volume * float(power)
