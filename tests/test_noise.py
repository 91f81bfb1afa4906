"""Noise of pressure and loads: fields without any, white noise, and smooth ones."""

import math

import numpy as np
import pytest
from alsph.analysis.noise import load_noise, pressure_noise
from alsph.analysis.window import Window
from alsph.geometry.domain import Domain
from alsph.geometry.particles import Kind, Snapshot

PERIODIC, WALLS = ("periodic", "periodic"), ("none", "none")


def snapshot(pressure, n=20, dimensions=2, sides=PERIODIC, jitter=0.2, solid=0):
    """Return fluid at rest with a pressure in a unit box, its first particles solid."""
    rng = np.random.default_rng(5)
    axis = (np.arange(n) + 0.5) / n
    position = np.stack(np.meshgrid(*[axis] * dimensions), -1).reshape(-1, dimensions)
    position = (position + rng.uniform(-jitter, jitter, position.shape) / n) % 1.0
    kind = np.where(np.arange(len(position)) < solid, Kind.SOLID, Kind.FLUID).astype(np.uint8)
    zero, domain = np.zeros(len(position)), Domain([0] * dimensions, [1] * dimensions, [sides] * dimensions)
    return Snapshot(0.0, position, np.zeros_like(position), pressure(position), zero, zero, kind, domain)


def white(position, amplitude=1e-2):
    return amplitude * np.random.default_rng(7).standard_normal(len(position))


def wave(position):
    return np.sin(2 * np.pi * position[:, 0]) * np.cos(2 * np.pi * position[:, 1])


@pytest.mark.parametrize("dimensions", [2, 3])
def test_a_pressure_that_is_linear_or_quadratic_has_no_noise(dimensions):
    size = 20 if dimensions == 2 else 8
    for pressure in (lambda r: 3 + r @ np.arange(1, dimensions + 1), lambda r: 100 * r[:, 0] * r[:, 1]):
        assert pressure_noise(snapshot(pressure, size, dimensions, WALLS), 1 / size) < 1e-10


@pytest.mark.parametrize(("dimensions", "size"), [(2, 30), (3, 10)])
@pytest.mark.parametrize("jitter", [0.0, 0.3])
def test_white_noise_is_found_with_its_amplitude_over_whatever_is_smooth(dimensions, size, jitter):
    noisy = snapshot(lambda r: 1e3 * r[:, 0] + white(r), size, dimensions, WALLS, jitter)
    assert pressure_noise(noisy, 1 / size) == pytest.approx(1e-2, rel=0.1)
    assert pressure_noise(snapshot(lambda r: wave(r) + white(r), size, dimensions, jitter=jitter), 1 / size) > 9e-3


def test_a_smooth_wave_vanishes_with_the_spacing_also_across_periodic_sides():
    coarse, fine = (pressure_noise(snapshot(wave, n), 1 / n) for n in (20, 40))
    assert coarse < 3e-3 and fine < coarse / 6


def test_pressures_of_solids_do_not_count():
    spoilt = snapshot(lambda r: np.where(np.arange(len(r)) < 40, 1e6, r[:, 0]), sides=WALLS, solid=40)
    assert pressure_noise(spoilt, 1 / 20) < 1e-9
    assert math.isnan(pressure_noise(snapshot(wave, solid=400), 1 / 20))


def settled(start, end):
    return Window(np.linspace(start, end, 11), 0, False, "")


@pytest.mark.parametrize("step", [0.05, 0.013, 0.002])
def test_noise_of_a_load_is_the_same_whatever_the_step(step):
    time = np.arange(step, 20, step)
    noise = 1e-2 * np.random.default_rng(1).standard_normal(len(time))
    found = load_noise(time, 1.4 + 3 * time + noise, settled(10, 20), 0.05)
    assert 0.85e-2 < found < 1.1e-2
    shedding = load_noise(time, 0.7 * np.sin(1.3 * time), settled(10, 20), 0.05)
    assert shedding == pytest.approx(0.7 * (1.3 * 0.05) ** 2 / math.sqrt(12), rel=0.05)


def test_what_happens_before_the_window_is_no_noise():
    time = np.arange(0.01, 20, 0.01)
    assert load_noise(time, np.where(time < 9, (-1.0) ** np.arange(len(time)), 1.4), settled(10, 20), 0.05) < 1e-12


def test_too_short_a_record_has_no_noise_to_tell():
    time = np.array([0.1, 0.11])
    assert math.isnan(load_noise(time, time, settled(0.1, 0.11), 0.05))
    assert math.isnan(load_noise(time[:0], time[:0], settled(0, 0), 0.05))
