"""Averages, crossings and spectra beside what can be worked out by hand."""

import numpy as np
import pytest
from alsph.analysis.signals import (
    amplitude_spectrum,
    batch_means,
    cycle_amplitudes,
    smoothed,
    spectral_peak,
    upward_crossings,
)


def average(time, values, start, end):
    """Return the average between two times of the straight lines through samples."""
    grid = np.unique(np.concatenate([[start, end], time[(time > start) & (time < end)]]))
    return np.trapezoid(np.interp(grid, time, values), grid) / (end - start)


def test_batch_means_are_those_of_the_straight_lines_between_samples():
    rng = np.random.default_rng(0)
    time = 3 + np.cumsum(rng.uniform(0.1, 1, 30))
    values = rng.normal(size=(30, 2))
    edges = np.sort(np.concatenate([rng.uniform(time[0], time[-1], 12), time[[0, 1, 9, -2, -1]]]))
    batches = list(zip(edges[:-1], edges[1:], strict=True))
    expected = np.array([[average(time, column, *batch) for column in values.T] for batch in batches])
    assert batch_means(time, values, edges) == pytest.approx(expected)
    assert batch_means(time, values[:, 0], edges) == pytest.approx(expected[:, 0])


def test_the_mean_of_what_is_left_of_a_large_signal_keeps_its_digits():
    time = np.linspace(0, 4, 401)
    signal = np.where(time < 1, 10.0, 1e-14)
    assert batch_means(time, signal, np.array([2.0, 3.0, 4.0])) == pytest.approx([1e-14, 1e-14], rel=1e-12, abs=0)
    assert batch_means(time, signal**2, np.array([2.0, 4.0])) == pytest.approx([1e-28], rel=1e-12, abs=0)


def test_smoothing_averages_over_the_width_wherever_it_fits():
    time = np.arange(0, 10.25, 0.25)
    inside, values = smoothed(time, time**2, 1.0)
    assert inside.tolist() == np.arange(0.5, 9.75, 0.25).tolist()
    assert values == pytest.approx([average(time, time**2, t - 0.5, t + 0.5) for t in inside])


def test_a_rise_is_the_zero_of_its_line_and_excursions_end_at_the_dead_band():
    time = np.arange(8.0)
    signal = np.array([0.2, -1.0, -0.2, 0.1, -0.1, 0.4, 1.0, -1.0])
    # the line through (1, -1) ... (5, 0.4): mean -0.16 at 3, slope 0.29
    assert upward_crossings(time, signal, 0.3) == pytest.approx([3 + 0.16 / 0.29])
    assert upward_crossings(time, signal, 0.4) == pytest.approx([_zero(time[1:7], signal[1:7])])
    assert upward_crossings(time, signal) == pytest.approx([2 + 2 / 3, 4.2])
    assert upward_crossings(time, -signal) == pytest.approx([1 / 6, 3.5, 6.5])
    assert upward_crossings(time, np.ones(8), 0.3).size == upward_crossings(time, 0 * time).size == 0


def _zero(time, signal):
    slope, constant = np.polyfit(time, signal, 1)
    return -constant / slope


@pytest.mark.parametrize(("signal", "zero"), [([-0.4, *[0.29] * 14, 0.31], 0.0), ([-0.31, *[-0.29] * 14, 0.4], 15.0)])
def test_a_crossing_lies_within_its_rise(signal, zero):
    time = np.arange(16.0)
    assert not 0 <= _zero(time, signal) <= 15
    assert upward_crossings(time, np.array(signal), 0.3).tolist() == [zero]


def test_each_cycle_has_its_amplitude_whatever_its_length_mean_and_harmonics():
    edges, amplitudes = np.array([1.0, 3.0, 4.5, 9.0]), np.array([0.5, 2.0, 1.2])
    time = np.linspace(0, 10, 8000)
    cycle = np.interp(time, edges, np.arange(4.0))
    strength = amplitudes[np.clip(cycle.astype(int), 0, 2)]
    for phase in (0.0, 0.7):
        signal = strength * np.sin(2 * np.pi * cycle + phase) + 0.3 * np.cos(4 * np.pi * cycle)
        found = cycle_amplitudes(time, 5 + signal, edges)
        assert found == pytest.approx(amplitudes, rel=3e-3)


@pytest.mark.parametrize("padding", [1, 4])
def test_a_sine_has_a_line_of_its_amplitude_between_two_of_half_of_it(padding):
    time = np.linspace(0, 60, 6001)
    signal = 3 + 0.8 * np.sin(2 * np.pi * 0.4 * time + 1) + 100.0 * (time < 9.95) - 100.0 * (time > 50.05)
    frequency, lines = amplitude_spectrum(time, signal, 10.0, 50.0, padding)
    assert frequency[:2] == pytest.approx([0, 1 / (40 * padding)])
    assert frequency[-1] == pytest.approx(4001 / 40 / 2, rel=1e-3) and len(frequency) == len(lines)
    peak = 16 * padding  # 16 periods
    assert lines[peak + np.array([-1, 0, 1]) * padding] == pytest.approx([0.4, 0.8, 0.4], rel=2e-3)
    assert np.delete(lines, range(peak - 2 * padding + 1, peak + 2 * padding)).max() < 0.03
    assert lines[0] < 1e-3


def test_few_samples_are_looked_at_in_64_places():
    time = np.linspace(0, 8, 17)
    for start, end, places in ((0.0, 8.0, 64), (2.0, 4.0, 64)):
        frequency, lines = amplitude_spectrum(time, np.sin(np.pi * time / 2), start, end)
        assert len(frequency) == places // 2 + 1 and frequency[1] == pytest.approx(1 / (end - start))
    assert len(amplitude_spectrum(np.linspace(0, 8, 801), np.ones(801), 2.0, 3.995)[0]) == 200 // 2 + 1
    assert len(amplitude_spectrum(np.linspace(0, 8, 801), np.ones(801), 2.005, 4.0)[0]) == 200 // 2 + 1


@pytest.mark.parametrize("guess", [0.28, 0.3, 0.38, 0.46])
def test_the_peak_is_the_highest_near_the_guess(guess):
    time = np.linspace(0, 100, 10_001)
    signal = (
        5 * np.sin(2 * np.pi * 0.171 * time) + np.sin(2 * np.pi * 0.3137 * time) + 5 * np.sin(4 * np.pi * 0.4 * time)
    )
    assert spectral_peak(time, signal, 0.0, 100.0, guess) == pytest.approx(0.3137, abs=3e-5)


def test_without_a_peak_the_edge_of_the_band_is_given():
    time = np.linspace(0, 100, 10_001)
    assert spectral_peak(time, np.sin(2 * np.pi * 0.1 * time), 0.0, 100.0, 0.2) == pytest.approx(0.2 / 1.5, abs=0.003)
    assert np.isfinite(spectral_peak(time, 0 * time, 0.0, 100.0, 0.2))
