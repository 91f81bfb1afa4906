"""The ± of a few averages beside plain formulas: least squares for each hypothesis, and SciPy's distributions."""

import math

import numpy as np
import pytest
from alsph.analysis.uncertainty import CORRELATIONS, EXTRAPOLATION, LEAN, RELAXATION_TIMES, trend, uncertainty_of_mean
from battery import autoregressive_series
from scipy import optimize, stats


def fitted(shape, averages):
    """Return constant and its variance for a unit residual, slope and its, and residuals of a line."""
    columns = np.stack([np.ones(len(averages)), shape], axis=1)
    found = np.linalg.lstsq(columns, averages, rcond=None)[0]
    spread = np.diag(np.linalg.inv(columns.T @ columns))
    return found[0], spread[0], found[1], spread[1], averages - columns @ found


def half_width(hypotheses, freedom):
    """Return the distance from zero that holds 68.27 % of Student's distributions (centre, error, weight)."""
    centre, error, weight = np.array(hypotheses).T

    def missing(width):
        inside = stats.t.cdf((width - centre) / error, freedom) - stats.t.cdf((-width - centre) / error, freedom)
        return np.average(inside, weights=weight) - 0.6827

    return optimize.brentq(missing, 0, 1e6, xtol=1e-12)


def correlated(averages):
    """Return the ± of averages that depend on the one before: y' = φ y + (1 - φ) m + chance, for all φ."""
    count, hypotheses = len(averages), []
    for phi in CORRELATIONS:
        rest = averages[1:] - phi * averages[:-1]
        square = ((rest - rest.mean()) ** 2).sum()
        error = math.sqrt(square / (count - 1) / (count - 2)) / (1 - phi)
        weight = square ** (-0.5 * (count - 2)) * (1 - phi) ** -LEAN
        hypotheses.append((rest.mean() / (1 - phi) - averages.mean(), error, weight))
    return half_width(hypotheses, count - 2)


def relaxing(averages):
    """Return the ± of averages that go exponentially to their end, and how likely it is that they go away from it."""
    count = len(averages)
    time, freedom = (np.arange(count) + 0.5) / count, max(count - 3, 1)
    hypotheses, growing = [], 0.0
    for relaxation in RELAXATION_TIMES:
        level, spread, *_, rest = fitted(np.exp(-time / relaxation), averages)
        square, distance = (rest**2).sum(), level - averages.mean()
        error = math.hypot(math.sqrt(square / freedom * spread), EXTRAPOLATION * distance)
        hypotheses.append((distance, error, square ** (-0.5 * (count - 2)) * relaxation))
        rest = fitted(np.exp(time / relaxation), averages)[-1]
        growing += (rest**2).sum() ** (-0.5 * (count - 2)) * relaxation
    decaying = sum(weight for *_, weight in hypotheses)
    return half_width(hypotheses, freedom), growing / (growing + decaying)


def significant_change(averages):
    """Return the change by the most significant of a line, a bend at the begin and one at the end, 0 if it is not."""
    count = len(averages)
    time, found = np.linspace(0, 1, count), []
    for shape in (time, -np.exp(-5 * time), np.exp(5 * time - 5)):
        *_, slope, spread, rest = fitted(shape, averages)
        square = (rest**2).sum()
        correlation = min(max((rest[1:] * rest[:-1]).sum() / square, 0), 0.9)
        error = math.sqrt(square / (count - 2) * spread * (1 + correlation) / (1 - correlation))
        found.append((abs(slope) / error, slope * np.ptp(shape)))
    significance, change = max(found)
    return change if significance > max(3, stats.t.ppf(0.975, count - 2)) else 0.0


@pytest.mark.parametrize("count", [3, 4, 7, 20])
def test_a_trend_is_the_best_of_three_shapes_if_it_stands_out(count):
    rng = np.random.default_rng(count)
    slopes = rng.choice([0.0, 1.0, -2.0, 8.0], 200)
    for slope in slopes:
        averages = (
            5 + autoregressive_series(rng, 0.4, count) + slope * rng.choice([0.3, 1, 3]) * np.linspace(0, 1, count)
        )
        assert trend(averages) == pytest.approx(significant_change(averages), rel=1e-6)


@pytest.mark.parametrize("count", [3, 5, 12, 30])
@pytest.mark.parametrize("scale", [1.0, 1e-5, -300.0])
def test_without_a_trend_all_correlations_are_weighed(count, scale):
    rng, tried = np.random.default_rng(count), 0
    while tried < 5:
        averages = scale * (2 + autoregressive_series(rng, 0.5, count))
        if trend(averages) == 0:
            found = uncertainty_of_mean(averages, averages.mean())
            assert found.standard == pytest.approx(correlated(averages), rel=1e-6) and found.change == 0
            tried += 1


@pytest.mark.parametrize("count", [4, 8, 20])
def test_with_a_trend_all_ends_of_it_are_weighed_and_one_that_gathers_pace_has_none(count):
    rng, time, ends = np.random.default_rng(count), np.linspace(0, 1, count), []
    for bend in np.linspace(-1, 1, 13):
        averages = 40 + 2 * (time + bend * time**2) + 0.02 * rng.normal(size=count)
        standard, growth = relaxing(averages)
        found = uncertainty_of_mean(averages, averages.mean())
        if found.change == 0 or abs(growth - 0.95) < 1e-3:
            continue
        ends.append(growth > 0.95)
        assert found.change == pytest.approx(significant_change(averages), rel=1e-6)
        assert found.standard == pytest.approx(math.inf if ends[-1] else max(standard, correlated(averages)), rel=1e-5)
    assert len(ends) > 6 and 0 < sum(ends) < len(ends)


def test_growth_by_less_than_a_hundredth_leaves_the_mean_known():
    growth = np.exp(np.linspace(0, 3, 9))
    growth = (growth - growth[-1]) / np.ptp(growth)
    for change, known in ((0.0099, True), (0.0101, False)):
        averages = 7 * (1 + change * growth)
        assert math.isfinite(uncertainty_of_mean(averages, averages.mean()).standard) is known
