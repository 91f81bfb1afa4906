import copy
import math
import pickle

import numpy as np
import pytest
from alsph.analysis import averages
from alsph.analysis.averages import Estimate
from alsph.analysis.uncertainty import uncertainty_of_mean
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from scipy.signal import lfilter
from synthetic import DRAG, LIFT, STROUHAL, signals

settings.register_profile("alsph", deadline=None)  # busy machines are slow, not wrong
settings.load_profile("alsph")

FINITE = st.floats(-1e3, 1e3)


def uneven_times(end=60.0, step=0.01, seed=0):
    return np.cumsum(step * np.random.default_rng(seed).uniform(0.7, 1.3, int(end / step)))


def test_estimate_is_a_float_that_knows_its_uncertainty():
    estimate = Estimate(1.4868, 0.0031, "how")
    assert estimate + 1 == pytest.approx(2.4868)
    assert f"{estimate:.2f}" == "1.49"
    assert str(estimate) == repr(estimate) == f"{estimate}" == "1.4868 ± 0.0031"
    assert str(Estimate(2.5)) == "2.5"
    assert str(Estimate(math.nan, note="no data")) == "nan (no data)"
    for twin in (copy.copy(estimate), pickle.loads(pickle.dumps(estimate))):
        assert (twin, twin.uncertainty, twin.note) == (estimate, 0.0031, "how")


@given(st.lists(st.floats(0.01, 1.0), min_size=4, max_size=40), FINITE, FINITE, st.data())
def test_batch_means_are_exact_for_straight_lines(steps, offset, slope, data):
    time = np.cumsum(steps)
    inside = st.floats(float(time[0]), float(time[-1]))
    edges = np.unique(data.draw(st.lists(inside, min_size=2, max_size=6)))
    if len(edges) < 2 or np.diff(edges).min() < 1e-3:
        return
    means = averages.batch_means(time, offset + slope * time, edges)
    assert np.allclose(means, offset + slope * (edges[1:] + edges[:-1]) / 2, atol=1e-6, rtol=1e-9)


def test_batch_means_of_profiles_act_column_by_column():
    time = uneven_times(5.0)
    values = np.stack([time, time**2], axis=1)
    edges = np.array([1.0, 2.0, 4.0])
    assert averages.batch_means(time, values, edges) == pytest.approx(np.array([[1.5, 7 / 3], [3.0, 28 / 3]]), rel=1e-4)


@given(st.floats(0.05, 2.0), st.floats(-3.0, 3.0), st.floats(0.0, 0.15))
def test_upward_crossings_of_a_sine_with_noise(frequency, phase, noise):
    time = uneven_times(20.0)
    signal = np.sin(2 * np.pi * frequency * time + phase)
    signal += noise * np.random.default_rng(0).uniform(-1, 1, len(time))
    crossings = averages.upward_crossings(time, signal, 0.3)
    cycles = frequency * crossings + phase / (2 * np.pi)
    assert np.allclose(cycles, np.round(cycles), atol=0.03)
    assert abs(len(crossings) - 20 * frequency) < 2


@settings(max_examples=25)
@given(st.floats(0.15, 0.25), st.floats(0.0, 15.0), st.floats(0.0, 0.05), st.integers(0, 99))
def test_the_transient_is_cut_and_the_answers_are_known(strouhal, growth, noise, seed):
    time = uneven_times()
    drag, lift = signals(time, growth=growth, noise=noise, strouhal=strouhal, seed=seed)
    window = averages.averaging_window(time, drag, lift)
    assert window.settled
    assert growth - 3 < window.start < growth + 20
    assert time[-1] - window.end < 1.1 / strouhal + 0.02  # smoothing and dead band need a tenth of a period
    assert window.periods == round((window.end - window.start) * strouhal) >= 4
    assert averages.mean(time, drag, window) == pytest.approx(DRAG, rel=5e-3)
    assert averages.root_mean_square(time, lift, window) == pytest.approx(LIFT / math.sqrt(2), rel=1e-2)
    assert averages.amplitude(time, lift, window) == pytest.approx(LIFT, rel=1e-2)
    assert averages.strouhal(time, lift, window) == pytest.approx(strouhal, rel=3e-3)


def test_uncertainties_cover_the_errors():
    misses = []
    for seed in range(40):
        time = uneven_times(seed=seed)
        rng = np.random.default_rng(seed)
        drift = np.interp(time, np.arange(0, 70, 5.0), rng.normal(0, 0.01, 14))
        drag, lift = signals(time, growth=2.0, noise=0.02, seed=seed)
        window = averages.averaging_window(time, drag + drift, lift * (1 + drift))
        estimate = averages.mean(time, drag + drift, window)
        misses.append(abs(estimate - DRAG) / estimate.uncertainty)
    assert np.mean(np.array(misses) < 1) > 0.5
    assert np.mean(np.array(misses) < 3) > 0.9


def test_shedding_that_still_grows_is_averaged_over_its_later_half_and_says_so():
    time = uneven_times(30.0)
    lift = np.exp(0.1 * time) * np.sin(2 * np.pi * STROUHAL * time)
    window = averages.averaging_window(time, np.ones_like(time), lift)
    assert not window.settled and window.periods >= 2
    assert "not periodic yet" in window.rule
    assert "not periodic yet" in averages.strouhal(time, lift, window).note


@pytest.mark.parametrize("kind", ["zero", "noise", "constant"])
def test_without_shedding_the_later_half_is_averaged(kind):
    time = uneven_times(20.0)
    lift = {"zero": 0 * time, "noise": np.random.default_rng(0).normal(size=len(time)), "constant": 1 + 0 * time}[kind]
    window = averages.averaging_window(time, 1.2 + 0 * time, lift)
    assert (window.periods, window.settled) == (0, False)
    assert window.start == pytest.approx(10.0, abs=0.1)
    assert "no regular shedding" in window.rule
    assert averages.mean(time, 1.2 + 0 * time, window) == pytest.approx(1.2)
    assert math.isnan(averages.strouhal(time, lift, window))
    assert math.isnan(averages.amplitude(time, lift, window))


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_short_a_record_gives_nan_and_a_reason(count):
    time = np.arange(float(count))
    window = averages.averaging_window(time, time, time)
    for measure in (averages.mean, averages.root_mean_square, averages.amplitude, averages.strouhal):
        estimate = measure(time, time, window)
        assert math.isnan(estimate) and estimate.note
    mean, deviation = averages.mean_profile(time, np.zeros((count, 4)), window)
    assert np.isnan(mean).all() and np.isnan(deviation).all()


@given(st.integers(3, 60), st.integers(0, 1000))
def test_any_short_record_gives_an_answer_without_failing(count, seed):
    rng = np.random.default_rng(seed)
    time, drag, lift = np.cumsum(rng.uniform(0.01, 1, count)), rng.normal(size=count), rng.normal(size=count)
    window = averages.averaging_window(time, drag, lift)
    assert time[0] <= window.start < window.end <= time[-1]
    for measure in (averages.mean, averages.root_mean_square, averages.amplitude, averages.strouhal):
        assert isinstance(measure(time, lift, window), Estimate)


@settings(max_examples=30)
@given(st.floats(0.1, 0.5), st.floats(0, 6.28), st.integers(4, 20))
def test_the_spectral_peak_is_far_finer_than_a_bin(frequency, phase, periods):
    end = periods / frequency
    time = np.linspace(0, end, 3000)
    signal = np.sin(2 * np.pi * frequency * time + phase) + 0.2 * np.sin(6 * np.pi * frequency * time)
    peak = averages.spectral_peak(time, signal, 0.0, end, 1.1 * frequency)
    assert abs(peak - frequency) < 0.03 / end


def test_a_sine_gives_a_line_of_its_amplitude_and_no_other():
    time = np.sort(np.random.default_rng(0).uniform(0, 40, 4000))
    signal = 3 + 0.7 * np.sin(2 * np.pi * 0.25 * time)
    frequency, amplitude = averages.amplitude_spectrum(time, signal, 0.0, 40.0)
    assert frequency[amplitude.argmax()] == pytest.approx(0.25)
    assert amplitude.max() == pytest.approx(0.7, rel=0.01)
    assert amplitude[frequency > 0.35].max() < 0.01


def test_strouhal_gives_both_methods_and_their_difference():
    time = uneven_times(60.0)
    drag, lift = signals(time, growth=0.0, noise=0.01)
    window = averages.averaging_window(time, drag, lift)
    strouhal = averages.strouhal(time, lift, window)
    assert abs(strouhal - STROUHAL) < 3 * strouhal.uncertainty < 0.003
    assert "spectrum" in strouhal.note and "zero crossings" in strouhal.note


def test_mean_profile_over_whole_periods():
    time = np.arange(0.0, 60.0, 0.25)
    shape = np.linspace(-1, 1, 7)
    profiles = shape + np.sin(2 * np.pi * 0.2 * time)[:, None]
    window = averages.Window(np.arange(10.0, 60.0, 5.0), 9, True, "")
    mean, deviation = averages.mean_profile(time, profiles, window)
    assert mean == pytest.approx(shape, abs=1e-3)
    assert deviation == pytest.approx(np.full(7, math.sqrt(0.5)), rel=0.01)


def test_error_norms_of_a_vector_field():
    exact = np.array([[3.0, 4.0], [0.0, 5.0]])
    norms = averages.error_norms(exact + [[0.0, 0.1], [0.3, 0.0]], exact)
    assert norms == pytest.approx({"l1": 0.04, "l2": math.sqrt(0.05) / 5, "max": 0.06})


@given(st.floats(0.01, 10.0), st.floats(0.1, 10.0))
def test_decay_rate(rate, start):
    time = np.linspace(0, 1, 50)
    assert averages.decay_rate(time, start * np.exp(-rate * time)) == pytest.approx(rate)
    assert math.isnan(averages.decay_rate(time[:2], time[:2]))


@pytest.mark.parametrize(("correlation", "least", "most"), [(0.0, 0.6, 0.8), (0.9, 0.6, 0.8), (0.99, 0.5, 0.7)])
def test_the_uncertainty_of_a_decay_rate_covers_it_however_long_deviations_last(correlation, least, most):
    random, time = np.random.default_rng(1), np.linspace(0, 1, 400)
    covered = []
    for _ in range(200):
        steps = random.normal(size=(400,)) * math.sqrt(1 - correlation**2)
        deviation = lfilter([1.0], [1.0, -correlation], steps, zi=[correlation * random.normal()])[0]
        rate = averages.decay_rate(time, np.exp(-1.58 * time + 1e-3 * deviation))
        covered.append(abs(rate - 1.58) <= rate.uncertainty)
    assert least <= np.mean(covered) <= most


def test_a_rate_that_changes_has_an_uncertainty_of_that_size():
    for count in (100, 1000):
        time = np.linspace(0, 1, count)
        rate = averages.decay_rate(time, np.exp(-1.58 * time - 0.1 * time**2))
        assert rate == pytest.approx(1.68, abs=1e-3) and rate.uncertainty == pytest.approx(0.026, rel=0.1)


@pytest.mark.parametrize(
    ("value", "uncertainty", "text"),
    [
        (12.345, 12.0, "12 ± 12"),
        (123.4, 250.0, "123 ± 250"),
        (12.345, 1.0, "12.3 ± 1.0"),
        (1e-5, 1.2e-10, "1.000000e-05 ± 0.000012e-05"),
        (2.127e-8, 1.21e-9, "2.13e-08 ± 0.12e-08"),
        (1e-12, 1e-13, "1.00e-12 ± 0.10e-12"),
        (-3e-10, 2.5e-9, "-0.3e-09 ± 2.5e-09"),
        (152_340.0, 1200.0, "152340 ± 1200"),
        (1.0, 1e-6, "1"),
        (1.0, 1.1e-6, "1.0000000 ± 0.0000011"),
        (-1.23456789, 0.0, "-1.23457"),
        (1.23456, math.inf, "1.235 ± unknown"),
        (math.nan, 0.1, "nan"),
    ],
)
def test_an_estimate_shows_two_digits_of_its_uncertainty(value, uncertainty, text):
    assert str(Estimate(value, uncertainty)) == text
    developing = Estimate(value, uncertainty, "still developing (drag changes)")
    assert developing.developing and averages.remark(developing) == " (still developing)"
    if value == value:
        assert str(developing) == f"{text} (still developing)"
    assert f"{developing:.2f}" == f"{value:.2f}"
    assert averages.remark(value) == averages.remark(Estimate(value, uncertainty, "settled")) == ""


def window(*edges, rule="", growing=False):
    return averages.Window(np.array(edges), len(edges) - 1, True, rule, growing)


def test_means_have_the_uncertainty_of_the_averages_over_the_periods():
    time = np.linspace(0, 8, 4001)
    batches = np.array([1.0, 1.3, 0.9, 1.1, 1.2, 0.8])
    values = batches[np.clip(time.astype(int) - 1, 0, 5)] + 0.5 * np.sin(2 * np.pi * time)
    six = window(*range(1, 8), rule="as told")
    mean = averages.mean(time, values, six)
    assert mean == pytest.approx(1.05, abs=1e-3) and mean.note == "as told" and not mean.developing
    assert mean.uncertainty == pytest.approx(uncertainty_of_mean(batches, 1.05).standard, rel=0.01)
    square = averages.root_mean_square(time, values, six)
    assert square == pytest.approx(math.sqrt(np.mean(batches**2) + 0.125), rel=1e-3)
    spread = uncertainty_of_mean(batches**2, np.mean(batches**2)).standard
    assert square.uncertainty == pytest.approx(spread / (2 * square), rel=0.02) and square.note == "as told"
    swing = averages.amplitude(time, values, six)
    assert swing == pytest.approx(0.5, rel=1e-3) and swing.uncertainty < 1e-3
    assert averages.mean(time, values, window(*range(1, 8), growing=True)).uncertainty == math.inf
    few = averages.mean(time, values, window(1, 2, 3, rule="why"))
    assert (few.uncertainty, few.note) == (math.inf, "too few periods for an uncertainty; why")
    assert "too few" not in averages.mean(time, values, window(1, 2, 3, 4)).note
    assert averages.amplitude(time, values, window(1, 2)) == pytest.approx(0.5, rel=1e-3)
    assert averages.mean(time, values, window(1, 2)) == pytest.approx(1, abs=1e-3)
    nothing = averages.root_mean_square(time, 0 * time, six)
    assert (float(nothing), nothing.uncertainty) == (0.0, 0.0)


@pytest.mark.parametrize("size", [1.0, 100.0])
def test_a_number_that_changes_in_a_settled_window_says_by_how_much(size):
    time = np.linspace(0, 10, 5001)
    values = size * (1 + 0.05 * (time - 5) + 1e-3 * np.sin(40 * time))
    found = averages.mean(time, values, window(*range(11), rule="as told"))
    assert found.note == "still developing (it changes by +44.5% over the window); as told"
    told = averages.mean(time, values, window(*range(11), rule="still developing (drag grows); as told"))
    assert told.note == "still developing (drag grows); as told"


def test_the_strouhal_number_joins_scatter_and_difference_of_two_methods():
    edges = np.array([0.0, 5.1, 9.9, 15.2, 20.0, 24.9, 30.1])
    time = np.linspace(0, 31, 6201)
    lift = np.sin(2 * np.pi * 0.19 * time)
    found = averages.strouhal(time, lift, window(*edges, rule="as told"))
    line, periods = stats.linregress(np.arange(7), edges), np.diff(edges)
    error = max(line.stderr, uncertainty_of_mean(periods, periods.mean()).standard)
    assert found == pytest.approx(0.19, abs=1e-3)
    assert found.uncertainty == pytest.approx(math.hypot(error / line.slope**2, found - 1 / line.slope), rel=1e-6)
    assert found.note == f"spectrum {found:.5f}, zero crossings {1 / line.slope:.5f}, 6 periods; as told"
    assert not math.isnan(averages.strouhal(time, lift, window(*edges[:3])))
    assert math.isnan(averages.strouhal(time, lift, window(*edges[:2])))


@pytest.mark.parametrize(
    ("start", "end", "mean", "square"),
    [
        (0.0, 10.0, 3.0, 1.75),  # trapezia of 4, 1, 1, 4 over 1, 2 and 1
        (1.5, 4.5, 3.0, 1.25),
        (4.5, 10.0, 4.75, None),
        (0.0, 1.5, 1.25, None),
        (5.0, 10.0, None, None),
        (0.0, 1.0, None, None),
    ],
)
def test_a_mean_profile_is_over_the_sampled_part_of_the_window(start, end, mean, square):
    time = np.array([1.0, 2.0, 4.0, 5.0])
    found = averages.mean_profile(time, np.stack([time, 2 * time], axis=1), window(start, end))
    if mean is None:
        assert np.isnan(found).all() and found[0].shape == found[1].shape == (2,)
    else:
        assert found[0] == pytest.approx([mean, 2 * mean])
    if square is not None:
        assert found[1] == pytest.approx([math.sqrt(square), 2 * math.sqrt(square)])
    assert averages.mean_profile(time[:2], time[:2, None], window(0, 9))[0] == pytest.approx([1.5])
    assert np.isnan(averages.mean_profile(time[:1], time[:1, None], window(0, 9))).all()


def test_decay_rate_and_its_standard_error():
    """Of values that deviate by chance alone that of the line, and of four points more, since these tell little."""
    time = np.linspace(0, 1, 2000)
    logarithm = -1.58 * time + 1e-3 * np.random.default_rng(0).normal(size=2000)
    found, line = averages.decay_rate(time, np.exp(logarithm)), stats.linregress(time, logarithm)
    assert (found, found.uncertainty) == (pytest.approx(-line.slope), pytest.approx(line.stderr, rel=0.25))
    time, energy = np.array([0.0, 1.0, 2.0, 4.0]), np.array([1.0, 0.4, 0.1, 0.02])
    found, line = averages.decay_rate(time, energy), stats.linregress(time, np.log(energy))
    assert found == pytest.approx(-line.slope) and found.uncertainty > line.stderr
    assert averages.decay_rate(time[:3], np.exp(-time[:3])) == pytest.approx(1)
    for bad in (averages.decay_rate(time[:2], energy[:2]), averages.decay_rate(time, energy * (1, 1, 1, 0))):
        assert math.isnan(bad) and bad.note == "a decay rate needs three or more positive values"


def test_observed_order():
    assert averages.observed_order((10, 20), (0.04, -0.01)) == pytest.approx(2)
    assert averages.observed_order((10, 30), (27.0, 1.0)) == pytest.approx(3)
    for error in ((0.0, 1.0), (1.0, 0.0), (math.nan, 1.0), (1.0, math.nan)):
        assert math.isnan(averages.observed_order((10, 20), error))


def same(found, value, uncertainty, note=""):
    """Whether an estimate is this one."""
    assert type(found) is Estimate and found.note == note
    assert float(found) == pytest.approx(value) and found.uncertainty == pytest.approx(uncertainty, nan_ok=True)


def test_arithmetic_keeps_the_uncertainty():
    a, b = Estimate(3.0, 0.3, "a"), Estimate(2.0, 0.4)
    same(a + b, 5.0, 0.5, "a")
    same(a - b, 1.0, 0.5, "a")
    same(a * b, 6.0, math.hypot(0.3 * 2, 0.4 * 3), "a")
    same(a / b, 1.5, 1.5 * math.hypot(0.1, 0.2), "a")
    same(-a, -3.0, 0.3, "a")
    for two in (2, 2.0, np.float64(2), np.int64(2), np.float32(2)):
        same(two * a, 6.0, 0.6, "a")
        same(a * two, 6.0, 0.6, "a")
        same(two - a, -1.0, 0.3, "a")
        same(a / two, 1.5, 0.15, "a")
        same(two / a, 2 / 3, 2 / 9 * 0.3, "a")
        same(two + a, 5.0, 0.3, "a")
    same(sum([a, b]), 5.0, 0.5, "a")


def test_a_ratio_says_what_is_unknown_and_what_still_develops():
    known, unknown, unbounded = Estimate(2.0, 0.1), Estimate(1.0), Estimate(4.0, np.inf, "still developing")
    same(unknown / known, 0.5, np.nan)
    same(unbounded / known, 2.0, np.inf, "still developing")
    assert (known / unbounded).developing
    same(unbounded * 0, 0.0, np.inf, "still developing")
    same(Estimate(1.0, 0.1, "one") + Estimate(1.0, 0.1, "two"), 2.0, math.hypot(0.1, 0.1), "one; two")
    with pytest.raises(ZeroDivisionError):
        known / 0
    with pytest.raises(TypeError):
        known + "1"


def test_estimates_are_plain_floats_everywhere_else():
    a = Estimate(3.0, 0.3)
    assert a == 3.0 and a > 2.5 and hash(a) == hash(3.0) and type(abs(a)) is float and type(a**2) is float
    for found in (np.ones(2) * a, a * np.ones(2), a + np.ones(2), np.ones(2) / a):
        assert type(found) is np.ndarray and found.dtype == float
    assert not np.isnan(a) and float(np.sqrt(a)) == np.sqrt(3.0) and complex(1, 0) * a == 3.0
