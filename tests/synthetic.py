"""A small run folder with known answers, written with alsph's own writer."""

import json
from pathlib import Path

import numpy as np
from alsph.cases import Cylinder
from alsph.config import Config, RunSettings
from alsph.folder import samples
from alsph.folder.run_folder import RunFolder
from alsph.results.run import Run

DRAG, DRAG_SWING, LIFT, STROUHAL, CIRCULATION = 1.48, 0.05, 0.75, 0.21, 1.0
SHED = 2 * np.pi * STROUHAL
SHORT = Cylinder(reynolds=200, resolution=10, length=8.0, height=8.0)


def signals(time, *, growth=12.0, noise=0.0, strouhal=STROUHAL, seed=0):
    """Drag and lift of shedding that grows to its final strength at tU/D of about `growth`."""
    rng = np.random.default_rng(seed)
    strength = 1 / (1 + np.exp(-1.2 * (time - growth)))
    lift = LIFT * strength * np.sin(2 * np.pi * strouhal * time)
    drag = DRAG - 0.2 * (1 - strength**2) + DRAG_SWING * strength * np.sin(4 * np.pi * strouhal * time)
    drag += 8 * np.exp(-time / 0.2)
    return drag + noise * rng.standard_normal(len(time)), lift + noise * rng.standard_normal(len(time))


def history(end=60.0, step=0.01):
    """Return the rows of the engine's history, with one body."""
    rng = np.random.default_rng(1)
    time = np.cumsum(step * rng.uniform(0.8, 1.2, int(end / step)))
    n = len(time)
    drag, lift = signals(time, noise=0.01)
    force = 0.5 * np.stack([drag, lift], axis=1)[:, None, :]
    ones = np.ones(n)
    return {
        "step": np.arange(1, n + 1),
        "time": time,
        "time_step": np.diff(time, prepend=0.0),
        "iterations": np.full(n, 5),
        "converged": np.arange(n) % 4 == 0,
        "divergence_max": 0.5 * ones,
        "divergence_mean": 5e-4 * ones,
        "divergence_sum": 8 * ones,
        "velocity_max": 1.5 * ones,
        "penalty_coefficient": ones,
        "volume": 180 + 0.01 * np.sin(time),
        "kinetic_energy": ones,
        "dissipation": ones,
        "packing_min": 0.95 * ones,
        "packing_max": 1.05 * ones,
        "packing_rms": 0.01 * ones,
        "residual": np.nan * ones,
        "mass_in": time,
        "mass_out": time,
        "inlet_pressure": 0 * ones,
        "fluid": np.full(n, 16000),
        "inlet": np.full(n, 1000),
        "outlet": np.full(n, 1000),
        "solid": np.full(n, 100),
        "pressure_force": 0.8 * force,
        "viscous_force": 0.2 * force,
        "pressure_torque": np.zeros((n, 1, 1)),
        "viscous_torque": np.zeros((n, 1, 1)),
    }


def particles(case):
    """Return the case's particles in potential flow with circulation: no drag, and a lift of -2 Γ."""
    state = case.particles()
    solid = state["kind"] == 3
    z = (state["position"] - [case.upstream, 0.0]) @ [1, 1j]
    z = np.where(np.abs(z) < 0.3, 0.3, z)
    speed = 1 - 0.25 / z**2 - 1j * CIRCULATION / (2 * np.pi * z)
    velocity = np.where(solid[:, None], 0.0, np.stack([speed.real, -speed.imag], axis=1))
    n = len(z)
    return state | {
        "velocity": velocity,
        "pressure": np.where(solid, 0.0, 0.5 - 0.5 * np.abs(speed) ** 2),
        "velocity_divergence": np.zeros(n),
        "vorticity": np.sin(state["position"][:, 0]) * ~solid,
        "id": np.arange(n),
    }


def append_surface(folder: RunFolder, time, points, sample):
    """Append a sample (m,) of C_p at points told by arrays, ``angle`` among them."""
    folder.append(
        "surface.h5",
        lambda path: samples.append(path, np.array([time]), points, {"pressure_coefficient": np.asarray(sample)[None]}),
    )


def write_run(path: Path, case=SHORT, *, end=60.0) -> Path:
    """Write a run folder of shedding up to tU/D = `end`, with snapshots every 10 D/U."""
    folder = RunFolder(path)
    folder.create(Config(case, RunSettings(until=end)))
    (path / "run.json").write_text(json.dumps({"status": "finished", "case": "cylinder"}))
    folder.append_history(history(end), ["cylinder"])
    angle = np.arange(0.0, 360.0, 5.0)
    for time in np.arange(0.0, end, 0.5):
        profile = 1 - 2 * np.sin(np.radians(angle)) ** 2 + 0.1 * np.sin(SHED * time) * np.sin(np.radians(angle))
        append_surface(folder, time, {"angle": angle}, profile)
    for time in np.arange(0.0, end + 1, 10.0):
        folder.append_particles(float(time), particles(case))
    return path


def write_flow(path: Path, case, velocity, times=(0.0, 1.0, 2.0), pressure=0.0) -> Run:
    """Write a run folder of `case` with snapshots of its first particles with a `velocity` (position, time)."""
    folder = RunFolder(path)
    folder.create(Config(case, RunSettings(until=times[-1])))
    (path / "run.json").write_text(json.dumps({"status": "finished", "case": case.name}))
    state = case.particles()
    solid = state["kind"] == 3
    zero = np.zeros(len(solid))
    for time in times:
        field = np.where(solid[:, None], state["velocity"], velocity(state["position"], time))
        derived = {
            "velocity_divergence": zero,
            "vorticity": zero if case.space_dimensions == 2 else np.zeros((len(solid), 3)),
            "id": np.arange(len(solid)),
            "pressure": zero + pressure,
        }
        folder.append_particles(time, state | {"velocity": field} | derived)
    return Run(path)
