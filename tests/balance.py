"""Loads on a body: recorded, by the momentum balance of boxes around it, and by the pressure along its surface."""

import tempfile
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from alsph.analysis import sampling
from alsph.arrays import FloatArray
from alsph.cases import Body, Case
from alsph.geometry.particles import Kind
from shapely import affinity

MARGINS = (0.3, 0.4, 0.5, 0.6)
"""Distances [D] of the boxes' faces from the body."""

CHANNEL = {"length": 5.0, "height": 4.0, "upstream": 2.0, "perturbation": 0.0}


@dataclass(frozen=True, eq=False)
class Loads:
    """Means over the same time, coefficients of drag and lift.

    Attributes
    ----------
    recorded, boxes, spread : ndarray, shape (2,)
        The engine's; the mean of the boxes and half the range of theirs.
    pressure, surface : ndarray, shape (2,)
        Pressure part of the engine's, and −∮ C_p n ds.
    largest_lift : float
        max |C_L| up to the end.
    """

    recorded: FloatArray
    boxes: FloatArray
    spread: FloatArray
    pressure: FloatArray
    surface: FloatArray
    largest_lift: float


def loads(case: Case, start: float, until: float, every: float = 0.05, threads: int = 1) -> Loads:
    """Return the loads on the bodies of a case from t* = `start` to `until`, balances taken `every` so often [D/U]."""
    simulation, surface = case.simulation(threads=threads), case.surface_points()
    times = np.arange(start, until + every / 2, every)
    corners = np.reshape(case.bounds, (2, 2)) + case.centre
    balances, samples, reached = [], [], []
    for time in times:
        simulation.run_until(time)
        state = simulation.snapshot()
        fluid = state["kind"] != Kind.SOLID
        fields = [state[name][fluid] for name in ("position", "velocity", "pressure")]
        boxes = [(corners[0] - margin, corners[1] + margin) for margin in MARGINS]
        fluid_values = case.particle_spacing, 1.0, case.kinematic_viscosity
        force = case.body_force_at(fields[0], simulation.time)
        balances.append([sampling.control_volume(*fields, box, *fluid_values, force) for box in boxes])
        samples.append(simulation.sample(surface.position)["pressure"])
        reached.append(simulation.time)
    taken, span = np.array(reached), reached[-1] - reached[0]
    history = simulation.history()
    within = (history["time"] >= taken[0]) & (history["time"] <= taken[-1])

    def recorded(part: str) -> FloatArray:
        columns = np.stack([history[f"drag_{part}"], history[f"lift_{part}"]], axis=1)[within]
        return np.asarray(np.trapezoid(columns, history["time"][within], axis=0) / span)

    through, momentum = np.moveaxis(np.array(balances), 2, 0)
    balance = 2 * (np.trapezoid(through, taken, axis=0) - (momentum[-1] - momentum[0])) / span
    mean_pressure = np.trapezoid(np.array(samples), taken, axis=0) / span
    return Loads(
        recorded=recorded("coefficient"),
        boxes=balance.mean(axis=0),
        spread=np.ptp(balance, axis=0) / 2,
        pressure=recorded("pressure"),
        surface=-surface.integral(2 * mean_pressure),
        largest_lift=float(np.abs(history["lift_coefficient"]).max()),
    )


def body(shape: str, **options: Any) -> Body:
    """Return the case of a shape by name: ``plate_T``, ``wedge_T`` and ``ellipse_T`` are T thick, the plate across the
    stream, the wedge with its edge to it.
    """
    name, _, thickness = shape.partition("_")
    if name in ("circle", "ellipse"):
        circle = shapely.Point(0, 0).buffer(0.5, quad_segs=64)
        outline = affinity.scale(circle, 1.0, float(thickness or 1.0))
    elif name == "wedge":
        outline = shapely.Polygon([(0.0, 0.0), (1.0, -float(thickness) / 2), (1.0, float(thickness) / 2)])
    elif name == "plate":
        outline = shapely.box(-float(thickness) / 2, -0.5, float(thickness) / 2, 0.5)
    else:
        return Body(shape=shape, **CHANNEL | options)
    with tempfile.NamedTemporaryFile("w", suffix=".txt") as file:
        file.writelines(f"{x!r} {y!r}\n" for x, y in shapely.get_coordinates(outline).tolist())
        file.flush()
        return Body(shape=file.name, **CHANNEL | options)
