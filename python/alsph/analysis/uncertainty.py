"""How far the mean of a few averages in a row may lie from the mean that the flow settles to.

Averages over successive periods are neither independent nor, in a flow that still develops, of one mean. Both are
estimated from the averages themselves. Each model that may hold (:func:`_correlated`, :func:`_relaxing`) is a set of
hypotheses, each with the settled mean that it implies, the error of that, and a weight by how well it fits; the
standard uncertainty is the distance within which the settled mean lies with the probability of one standard deviation.
"""

from dataclasses import dataclass

import numpy as np

from alsph.arrays import FloatArray

ONE_SIGMA = 0.6827
LEAST = 3  # averages, fewer of which tell neither their correlation nor a trend
CORRELATIONS = np.linspace(-0.9, 0.975, 76)  # of an average with the next
LEAN = 0.75  # correlations are weighed by (1-φ)^-LEAN
RELAXATION_TIMES = np.geomspace(0.1, 4.0, 50)  # over the length of the window; slower ones cannot be told from no end
EXTRAPOLATION = 0.25  # relative standard error of a relaxation's rest, since none is exactly exponential
TREND = 3.0  # a slope of so many of its standard errors is a trend, and of more where they are known from few averages
BEND = 0.2  # time over the length of the window in which a trend that is no line changes
GROWTH = 0.95  # probability from which a trend is held to gather pace
LARGE_GROWTH = 0.01  # relative change of such a trend from which there is no telling where it ends


@dataclass(frozen=True)
class Uncertainty:
    """What successive averages tell about the settled mean.

    Attributes
    ----------
    standard : float
        Standard uncertainty (68 %) of the mean of the averages as an estimate of the settled mean; infinite if there
        is no telling.
    change : float
        Change from the first to the last average by the line through them that fits best if that is a trend, else 0.
    """

    standard: float
    change: float = 0.0


def uncertainty_of_mean(averages: FloatArray, value: float) -> Uncertainty:
    """Return the uncertainty of a value as an estimate of the mean that successive averages settle to.

    Parameters
    ----------
    averages : ndarray, shape (n,)
        Averages of a quantity over successive periods, about equally long.
    value : float
        Their mean.

    Returns
    -------
    Uncertainty
        Infinite for fewer than three averages.
    """
    if len(averages) < LEAST:
        return Uncertainty(np.inf)
    scale = max(float(np.abs(averages).max()), np.finfo(float).tiny)
    averages, value = averages / scale, value / scale  # so that weights neither over- nor underflow
    if np.ptp(averages) < 1e-12:
        return Uncertainty(scale * float(np.ptp(averages)))
    standard, change = _correlated(averages, value), trend(averages)
    if change:
        standard = max(standard, _relaxing(averages, value))
    return Uncertainty(scale * standard, scale * change)


def trend(averages: FloatArray) -> float:
    """Return the change from the first to the last average by a straight line or a bend if it is significant, else 0.

    The bends are exponentials that change most at the begin or at the end.
    """
    count = len(averages)
    if count < LEAST:
        return 0.0
    time = np.arange(count) / (count - 1)
    shapes = np.stack([time, 1 - np.exp(-time / BEND), np.exp((time - 1) / BEND)])
    slope, error = slopes(shapes, averages)
    best = int(np.argmax(np.abs(slope) / error))
    change = slope[best] * (shapes[best, -1] - shapes[best, 0])
    from scipy.special import stdtrit

    least = max(TREND, stdtrit(count - 2, 0.975))
    return float(change) if abs(slope[best]) > least * error[best] else 0.0


def slopes(shapes: FloatArray, averages: FloatArray, hidden: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Return how much averages (n,) rise along each of some shapes (m, n), and the standard errors of that.

    They are those of independent deviations, times what their correlation with the next one adds, √((1+r)/(1-r)), r as
    it is found and what a short series hides of it.
    """
    count = len(averages)
    centred, deviations = shapes - shapes.mean(axis=1)[:, None], averages - averages.mean()
    squares = (centred**2).sum(axis=1)
    slope = centred @ deviations / squares
    rest = deviations - slope[:, None] * centred
    residual = np.maximum((rest**2).sum(axis=1), np.finfo(float).tiny)
    correlation = np.clip((rest[:, 1:] * rest[:, :-1]).sum(axis=1) / residual + hidden, 0.0, 0.9)
    return slope, np.sqrt(residual / (count - 2) / squares * (1 + correlation) / (1 - correlation))


def _correlated(averages: FloatArray, value: float) -> float:
    """Uncertainty where each average deviates by a share φ of the deviation before it and by chance.

    For a given φ the numbers (y_k+1 - φ y_k)/(1 - φ) are independent and their mean is the settled one, whatever the
    first average was. φ itself is known from a few averages only roughly: each is weighed by its likelihood, and large
    ones more, by so much that the uncertainty covers the mean in two of three cases for φ = 0 to 0.9 alike
    (benches/coverage.py).
    """
    phi = CORRELATIONS[:, None]
    settled = (averages[1:] - phi * averages[:-1]) / (1 - phi)
    freedom = len(averages) - 2
    variance = np.maximum(settled.var(axis=1), np.finfo(float).tiny)
    likelihood = -0.5 * freedom * np.log((1 - CORRELATIONS) ** 2 * variance) - LEAN * np.log(1 - CORRELATIONS)
    return _half_width(settled.mean(axis=1) - value, np.sqrt(variance / freedom), likelihood, freedom)


def _relaxing(averages: FloatArray, value: float) -> float:
    """Uncertainty where the averages, the largest of them 1, go exponentially to the settled mean.

    Infinite where they go away from it, and far.
    """
    time = (np.arange(len(averages)) + 0.5) / len(averages)
    rates = np.concatenate([-1 / RELAXATION_TIMES, 1 / RELAXATION_TIMES])
    shapes = np.exp(rates[:, None] * (time - (rates[:, None] > 0)))
    shape_means = shapes.mean(axis=1)
    centred, deviations = shapes - shape_means[:, None], averages - averages.mean()
    squares = (centred**2).sum(axis=1)
    amplitude = centred @ deviations / squares
    freedom = max(len(averages) - 3, 1)  # mean, amplitude, time
    residual = np.maximum(((deviations - amplitude[:, None] * centred) ** 2).sum(axis=1), 1e-24)
    likelihood = -0.5 * (len(averages) - 2) * np.log(residual) - np.log(np.abs(rates))  # any time as likely as another

    weight = np.exp(likelihood - likelihood.max())
    if np.ptp(averages) > LARGE_GROWTH and weight[rates > 0].sum() > GROWTH * weight.sum():
        return np.inf
    rest = averages.mean() - amplitude * shape_means - value
    variance = residual / freedom * (1 / len(averages) + shape_means**2 / squares)
    decaying = rates < 0
    error = np.sqrt(variance + (EXTRAPOLATION * rest) ** 2)
    return _half_width(rest[decaying], error[decaying], likelihood[decaying], freedom)


def _half_width(center: FloatArray, error: FloatArray, likelihood: FloatArray, freedom: int) -> float:
    """Distance from zero within which a mixture of Student's distributions has the probability of one sigma."""
    from scipy.special import stdtr

    weight = np.exp(likelihood - likelihood.max())
    weight /= weight.sum()
    low, high = 0.0, float(np.abs(center).max() + 20 * error.max())
    for _ in range(50):
        middle = 0.5 * (low + high)
        inside = stdtr(freedom, (middle - center) / error) - stdtr(freedom, (-middle - center) / error)
        low, high = (middle, high) if weight @ inside < ONE_SIGMA else (low, middle)
    return high
