"""Flow between turning cylinders: its exact transient, and what is computed of it."""

import numpy as np
import pytest
from alsph.cases import TaylorCouette
from alsph.errors import ConfigError
from alsph.geometry.particles import Kind
from scipy.linalg import solve_banded
from scipy.spatial import KDTree
from synthetic import write_flow


def diffused(case, time, count=400):
    """Return radii, velocities and both torques by finite differences and implicit Euler steps."""
    a, b, viscosity = case.inner_radius, case.outer_radius, 1 / case.reynolds
    r = np.linspace(a, b, count + 1)
    h, step, u = r[1] - r[0], time / count, np.zeros(count + 1)
    u[[0, -1]] = 1.0, case.outer_velocity
    below, above = (viscosity * (1 / h**2 + sign / (2 * h * r[1:-1])) for sign in (-1, 1))
    bands = np.zeros((3, count - 1))
    bands[0, 1:], bands[2, :-1] = -step * above[:-1], -step * below[1:]
    bands[1] = 1 + step * viscosity * (2 / h**2 + 1 / r[1:-1] ** 2)
    for _ in range(count):
        right = u[1:-1].copy()
        right[0] += step * below[0] * u[0]
        right[-1] += step * above[-1] * u[-1]
        u[1:-1] = solve_banded((1, 1), bands, right)
    slopes = (-3 * u[0] + 4 * u[1] - u[2]) / (2 * h), (3 * u[-1] - 4 * u[-2] + u[-3]) / (2 * h)
    inner, outer = (
        2 * np.pi * at**2 * viscosity * (slope - v / at)
        for at, slope, v in zip((a, b), slopes, u[[0, -1]], strict=True)
    )
    return r, u, np.array([inner, -outer])


@pytest.mark.parametrize(
    "changes", [{}, {"outer_velocity": -0.5, "inner_radius": 1.0}, {"outer_velocity": 1.0, "inner_radius": 5.0}]
)
def test_the_series_is_what_diffuses(changes):
    case = TaylorCouette(**changes)
    radius, speed, torques = diffused(case, 1.0)
    assert case.speed(radius, 1.0) == pytest.approx(speed, abs=1e-3)
    assert case.torques(np.array([1.0]))[:, 0] == pytest.approx(torques, rel=5e-3)
    first, second = case.steady
    assert case.speed(radius, 1e3) == pytest.approx(first * radius + second / radius)
    steady = case.torques(np.array([1e3]))[:, 0]
    assert steady[0] == pytest.approx(-4 * np.pi * second / case.reynolds) and steady.sum() == pytest.approx(0)


@pytest.mark.parametrize("changes", [{}, {"outer_velocity": -0.5, "inner_radius": 1.3, "resolution": 10}])
def test_fluid_fills_the_gap_between_walls_that_turn(changes):
    case = TaylorCouette(**changes)
    state, spacing = case.particles(), case.particle_spacing
    fluid, solid = state["kind"] == Kind.FLUID, state["kind"] == Kind.SOLID
    radius = np.hypot(*state["position"].T)
    inner, outer = case.inner_radius, case.outer_radius
    assert fluid.sum() * spacing**2 == pytest.approx(np.pi * (outer**2 - inner**2), rel=2e-3)
    assert ((radius[fluid] > inner) & (radius[fluid] < outer)).all() and not state["velocity"][fluid].any()
    nearest = KDTree(state["position"]).query(state["position"][fluid], k=2)[0][:, 1] / spacing
    assert nearest.min() > 0.7 and nearest.max() < 1.15
    turning = np.cross(state["position"], state["velocity"])[solid] / radius[solid]
    assert turning == pytest.approx(np.where(state["body"][solid] == 1, case.outer_velocity, 1.0))
    assert (radius[solid] > outer).sum() == (state["body"] == 1).sum()
    assert case.particle_estimate() == pytest.approx(len(radius), rel=0.02)


def with_torques(folder, case, change=1.0):
    run = write_flow(folder, case, lambda r, t: change * case.exact(r, t)["velocity"])
    run.history = {"time": np.linspace(0.1, 2, 9)}
    exact = change * case.torques(run.history["time"])
    for name, torque in zip(("inner", "outer"), exact, strict=True):
        run.history[f"{name}_pressure_torque"] = 0.0 * torque
        run.history[f"{name}_viscous_torque"] = torque
    return run


def test_measures(tmp_path):
    case = TaylorCouette(resolution=10, outer_velocity=-0.3)
    velocity, *torques = case.measures(with_torques(tmp_path / "run", case))
    assert velocity.value < 1e-5 and all(abs(torque.error) < 1e-6 for torque in torques)
    velocity, *torques = case.measures(with_torques(tmp_path / "less", case, change=0.9))
    assert velocity.value == pytest.approx(0.1, abs=1e-3) and not velocity.passed
    assert not any(torque.passed for torque in torques)


@pytest.mark.parametrize(
    ("changes", "told"), [({"inner_radius": 0.1}, "inner_radius = 0.1"), ({"outer_velocity": 2}, "outer_velocity = 2")]
)
def test_cylinders_that_cannot_be_are_refused(changes, told):
    with pytest.raises(ConfigError, match=told):
        TaylorCouette(**changes)


def test_the_start_is_met(tmp_path):
    case = TaylorCouette(resolution=10)
    run = case.run(tmp_path / "run", until=0.5, threads=1, progress=False)
    velocity, inner, outer = case.measures(run)
    assert velocity.value < 0.03
    assert abs(inner.error) < 0.09 and inner.value < 0 < outer.value
