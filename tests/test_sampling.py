"""Fields at points and the balance of a box beside direct sums, weighted least squares and integrals by hand."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from alsph.analysis import sampling
from alsph.errors import ConfigError
from alsph.geometry.domain import Domain
from alsph.geometry.lattice import cell_centres, lattice
from alsph.geometry.particles import Kind, Snapshot

SPACING = 0.1


def cloud(dimensions, seed=0):
    """Return particles about a spacing apart, and points among them."""
    rng = np.random.default_rng(seed)
    position = lattice(*dimensions * [cell_centres(8, SPACING)])
    return position + 0.2 * SPACING * rng.uniform(-1, 1, position.shape), rng.uniform(0.3, 0.5, (6, dimensions))


def nearest(position, point, count):
    """Return the distances of the nearest particles and who they are."""
    distance = np.linalg.norm(position - point, axis=1)
    index = np.argsort(distance)[:count]
    return distance[index] / SPACING, index


@pytest.mark.parametrize("dimensions", [2, 3])
def test_means_and_filling_are_sums_of_gaussians_over_the_nearest(dimensions):
    position, points = cloud(dimensions)
    values = np.random.default_rng(1).normal(size=len(position))
    for k, point in enumerate(points):
        distance, index = nearest(position, point, 8 * dimensions)
        expected = np.average(values[index], weights=np.exp(-2 * distance**2))
        assert sampling.average(position, values, points, SPACING)[k] == pytest.approx(expected)
        normal = np.exp(-0.5 * (distance / 0.7) ** 2) / (np.sqrt(2 * np.pi) * 0.7) ** dimensions
        assert sampling.fill(position, points, SPACING)[k] == pytest.approx(normal.sum())
    few, _ = cloud(dimensions)
    assert sampling.average(few[:3], values[:3], points[:1] * 0, SPACING).shape == (1,)


def test_there_is_nothing_a_spacing_and_a_half_away_from_all_particles():
    position = lattice(cell_centres(5, SPACING), cell_centres(5, SPACING))
    points = np.array([[0.25, 0.05 - 0.149], [0.25, 0.05 - 0.151]])
    found = sampling.average(position, 3 + 0 * position[:, 0], points, SPACING)
    assert found[0] == pytest.approx(3) and np.isnan(found[1])


@pytest.mark.parametrize("dimensions", [2, 3])
def test_interpolation_is_a_weighted_fit_of_a_parabola(dimensions):
    position, points = cloud(dimensions)
    values = np.stack([np.sin(9 * position[:, 0]), position.prod(axis=1)], axis=1)
    found, gradient = sampling.interpolate(position, values, points, SPACING)
    for k, point in enumerate(points):
        distance, index = nearest(position, point, 8 * dimensions)
        offset = position[index] - point
        pairs = [offset[:, i] * offset[:, j] for i in range(dimensions) for j in range(i, dimensions)]
        basis = np.stack([np.ones(len(index)), *offset.T, *pairs], axis=1)
        root = np.exp(-0.25 * distance**2)[:, None]
        fit = np.linalg.lstsq(root * basis, root * values[index], rcond=None)[0]
        assert found[k] == pytest.approx(fit[0], abs=1e-6)
        assert gradient[k] == pytest.approx(fit[1 : dimensions + 1].T, abs=1e-4)


def flow(position, velocity, pressure=0.0, fluid=True):
    count = len(position)
    return SimpleNamespace(
        position=position,
        velocity=np.broadcast_to(velocity, position.shape),
        pressure=np.broadcast_to(pressure, count),
        fluid=np.broadcast_to(fluid, count),
        domain=None,
    )


def test_the_late_velocity_is_that_of_the_last_quarter():
    position, points = cloud(2)
    still = np.arange(len(position)) % 5 == 0  # solids, which are not looked at
    run = SimpleNamespace(
        times=np.array([0.0, 1.0, 2.9, 3.0, 4.0]),
        spacing=SPACING,
        snapshot=lambda t: flow(position, np.where(still[:, None], 99, t * position), fluid=~still),
    )
    assert sampling.late_velocity(run, points) == pytest.approx(3.5 * points)
    assert sampling.late_velocity(run, points, 0.3) == pytest.approx(3.3 * points)
    run.times = np.empty(0)
    assert np.isnan(sampling.late_velocity(run, points)).all()


@pytest.mark.parametrize("outlet", [True, False])
def test_a_run_begins_with_the_flow_of_another_where_that_has_some(monkeypatch, outlet):
    monkeypatch.setattr(sampling, "CHUNK", 7)
    source, _ = cloud(2)
    solid = np.arange(len(source)) % 4 == 0
    fields = (
        np.where(solid[:, None], 99, source @ np.array([[1.0, 2.0], [3.0, 4.0]])),
        np.where(solid, 99, source.sum(axis=1)),
    )
    run = SimpleNamespace(path="other", spacing=SPACING, snapshot=lambda: flow(source, *fields, fluid=~solid))
    position = np.concatenate([lattice(*2 * [0.2 + cell_centres(4, SPACING)]), [[1.0, 0.4], [5.0, 5.0]]])
    kind = np.resize([Kind.FLUID, Kind.INLET, Kind.OUTLET, Kind.SOLID], len(position))
    kind[-2:] = Kind.FLUID
    state = {"position": position, "velocity": 7 + 0 * position, "pressure": 7 + 0 * position[:, 0], "kind": kind}
    began = sampling.initial_state(state, run, outlet=outlet)
    near = np.arange(len(position)) < 16
    takes = near & np.isin(kind, [Kind.FLUID, *[Kind.OUTLET] * outlet])
    expected = np.where(takes[:, None], position @ np.array([[1.0, 2.0], [3.0, 4.0]]), 7)
    assert began["velocity"] == pytest.approx(expected)
    takes = near & np.isin(kind, [Kind.FLUID, Kind.INLET])
    assert began["pressure"] == pytest.approx(np.where(takes, position.sum(axis=1), 7))
    assert (state["velocity"] == 7).all() and (state["pressure"] == 7).all() and began["kind"] is kind
    if outlet:
        assert (sampling.initial_state(state, run)["velocity"] == began["velocity"]).all()
    with pytest.raises(ConfigError, match="initial_run = 'other': it is in 2-D and this case in 3-D"):
        sampling.initial_state(state | {"position": np.zeros((3, 3))}, run)


def test_the_balance_of_a_box_in_three_dimensions():
    """With u = (x, -y, x²) and p = 5x + 6y + 7z, whose derivatives are (x, y, 2x²) along the flow and (5, 6, 7)."""
    position = lattice(*3 * [cell_centres(12, SPACING)])
    x, y, z = position.T
    velocity, pressure = np.stack([x, -y, x**2], axis=1), 5 * x + 6 * y + 7 * z
    lower, upper = np.array([0.3, 0.4, 0.3]), np.array([0.7, 0.7, 0.8])
    surface, momentum = sampling.control_volume(position, velocity, pressure, (lower, upper), SPACING, 3.0, 0.5)
    volume, squares = 0.4 * 0.3 * 0.5, (0.7**3 - 0.3**3) / 3 * 0.3 * 0.5
    expected = -volume * np.array([5, 6, 7]) - 3 * np.array([0.5 * volume, 0.55 * volume, 2 * squares])
    expected[2] += 3 * 0.5 * 2 * volume
    assert surface == pytest.approx(expected, rel=2e-3)
    assert momentum == pytest.approx(3 * np.array([0.5 * volume, -0.55 * volume, squares]), rel=5e-3)


def test_particles_on_the_sides_of_a_box_count_in_part():
    position = lattice(cell_centres(12, SPACING), cell_centres(12, SPACING))
    box = np.array([0.33, 0.41]), np.array([0.78, 0.66])
    _, momentum = sampling.control_volume(position, 0 * position + (2, 3), 0 * position[:, 0], box, SPACING, 5.0, 0.1)
    assert momentum == pytest.approx(5 * 0.45 * 0.25 * np.array([2, 3]))


def test_faces_of_a_box_in_tiles():
    faces = list(sampling.faces(np.array([0.0, 1.0]), np.array([0.45, 1.2]), SPACING))
    assert [(axis, sign) for axis, sign, *_ in faces] == [(0, -1), (0, 1), (1, -1), (1, 1)]
    assert [area for *_, area in faces] == pytest.approx([0.1, 0.1, 0.09, 0.09])
    assert faces[1][2] == pytest.approx(np.array([[0.45, 1.05], [0.45, 1.15]]))
    assert faces[2][2] == pytest.approx(np.array([[0.045 + 0.09 * k, 1.0] for k in range(5)]))


def snapshot_of(position, velocity, pressure, domain):
    count, kind = len(position), np.full(len(position), Kind.FLUID, np.uint8)
    return Snapshot(0.0, position, velocity, pressure, np.zeros(count), np.zeros(count), kind, domain=domain)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_a_flow_goes_on_across_periodic_sides_where_another_begins_with_it(dimensions):
    spacing = 0.05
    domain = Domain(
        [0] * dimensions, [1, *[0.5] * (dimensions - 1)], [["periodic"] * 2, *[["slip"] * 2] * (dimensions - 1)]
    )
    position = lattice(cell_centres(20, spacing), *[cell_centres(10, spacing)] * (dimensions - 1))
    wave = np.sin(2 * np.pi * position[:, 0])
    velocity = np.zeros_like(position)
    velocity[:, 0] = wave
    run = SimpleNamespace(path="other", spacing=spacing, times=np.ones(1))
    run.snapshot = lambda time=None: snapshot_of(position, velocity, wave, domain)
    points = np.full((40, dimensions), 0.25)
    points[:, 0] = np.linspace(0.0, 1.0, 40)
    zeros = np.zeros(40)
    state = {"position": points, "velocity": 0 * points, "pressure": zeros, "kind": np.full(40, Kind.FLUID, np.uint8)}
    exact = np.sin(2 * np.pi * points[:, 0])
    began = sampling.initial_state(state, run)
    assert began["velocity"][:, 0] == pytest.approx(exact, abs=3e-3)
    assert began["pressure"] == pytest.approx(exact, abs=3e-3)
    assert sampling.late_velocity(run, points)[:, 0] == pytest.approx(exact, abs=3e-3)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_in_the_air_above_water_there_is_no_value(dimensions):
    spacing, depth = 0.05, 0.5
    domain = Domain([0] * dimensions, [1.0] * dimensions, [*[["slip"] * 2] * (dimensions - 1), ["slip", "air"]])
    position = lattice(*[cell_centres(20, spacing)] * (dimensions - 1), cell_centres(10, spacing))
    snapshot = snapshot_of(position, np.ones_like(position), depth - position[:, -1], domain)

    def pressure(height, across=0.5):
        found = sampling.at(snapshot, np.array([[*[across] * (dimensions - 1), height]]), spacing, domain)
        assert np.isnan(found["velocity"]).all() == np.isnan(found["pressure"]).all()
        return float(found["pressure"][0])

    for across in (0.0, 0.01, 0.5, 1.0):
        for height in (0.0, 0.02, 0.25, 0.49):
            assert pressure(height, across) == pytest.approx(
                depth - height, abs=1e-9 if dimensions == 2 or across == 0.5 else 0.03
            )
        for height in (depth + 0.5 * spacing, depth + 0.9 * spacing, depth + 2 * spacing, 1.0):
            assert math.isnan(pressure(height, across))
    assert pressure(depth + 0.2 * spacing, 0.525) == pytest.approx(0.0, abs=1e-9)
