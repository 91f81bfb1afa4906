"""Measures of a run, as pure functions of arrays: averages (21)-(23), Strouhal number, divergence, error norms.

Times are in units of D/U (t* = tU/D) and coefficients are dimensionless, so that frequencies are Strouhal numbers.
"""

import math
import operator
from collections.abc import Callable, Iterable
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from alsph.analysis.signals import amplitude_spectrum, batch_means, cycle_amplitudes, spectral_peak, upward_crossings
from alsph.analysis.uncertainty import slopes, uncertainty_of_mean
from alsph.analysis.window import DEVELOPING, Window, averaging_window, drift_of, whole_record, with_trends
from alsph.arrays import FloatArray

__all__ = [  # with what the analysis of signals is made of
    "Estimate",
    "Window",
    "amplitude",
    "amplitude_spectrum",
    "averaging_window",
    "batch_means",
    "cycle_amplitudes",
    "decay_rate",
    "error_norms",
    "mean",
    "mean_profile",
    "observed_order",
    "remark",
    "root_mean_square",
    "spectral_peak",
    "strouhal",
    "upward_crossings",
    "whole_record",
]


RATE_BATCHES = 20  # that the ± of a decay rate is found from
HIDDEN = 3.0  # times one over their number: correlation that they do not show


Slopes = Callable[[float, float], tuple[float, float]]


class Estimate(float):
    """A number with its standard uncertainty; behaves as a plain float everywhere else.

    Sums, differences, products and quotients with numbers and with other estimates are estimates again. Their
    uncertainty is that of first order, with errors that are independent of each other: that of a difference of two
    results which err alike is too large, that of ``x * x`` too small. It is NaN where one is unknown, else infinite
    where one is. The notes of both are kept. Comparisons, powers, ``abs`` and functions of NumPy are those of floats.

    Attributes
    ----------
    uncertainty : float
        One standard uncertainty (68 % confidence) of the number as that of the settled flow: scatter, its correlation
        and a trend are in it. Infinite where the data do not bound it, NaN where there is none.
    note : str
        How the number came about, or why it is NaN.
    """

    __slots__ = ("note", "uncertainty")
    __array_priority__ = -1.0  # numbers of NumPy leave the arithmetic to it, arrays do not
    uncertainty: float
    note: str

    def __new__(cls, value: float, uncertainty: float = np.nan, note: str = "") -> Self:
        """Make an estimate from its value, uncertainty and note."""
        self = super().__new__(cls, value)
        self.uncertainty = float(uncertainty)
        self.note = note
        return self

    def __getnewargs__(self) -> tuple[float, float, str]:  # type: ignore[override]
        """Copy and unpickle with the uncertainty."""
        return float(self), self.uncertainty, self.note

    def _with(self, other: Any, value: Callable[[float, float], float], slopes: Slopes) -> Self:
        """Return a function of two numbers, which `slopes` says the derivatives of by each, with its uncertainty."""
        if not isinstance(other, int | float | np.integer | np.floating):
            return NotImplemented  # type: ignore[no-any-return]
        a, b = float(self), float(other)
        found = value(a, b)
        ends = [(self, slopes(a, b)[0])] + ([(other, slopes(a, b)[1])] if isinstance(other, Estimate) else [])
        notes = dict.fromkeys(end.note for end, _ in ends if end.note)
        return type(self)(found, _joined([(end.uncertainty, slope) for end, slope in ends]), "; ".join(notes))

    def __add__(self, other: float) -> Self:
        """Return the sum."""
        return self._with(other, operator.add, lambda a, b: (1.0, 1.0))

    __radd__ = __add__

    def __sub__(self, other: float) -> Self:
        """Return the difference."""
        return self._with(other, operator.sub, lambda a, b: (1.0, 1.0))

    def __rsub__(self, other: float) -> Self:
        """Return the difference."""
        return self._with(other, lambda a, b: b - a, lambda a, b: (1.0, 1.0))

    def __mul__(self, other: float) -> Self:
        """Return the product."""
        return self._with(other, operator.mul, lambda a, b: (b, a))

    __rmul__ = __mul__

    def __truediv__(self, other: float) -> Self:
        """Return the quotient."""
        return self._with(other, operator.truediv, lambda a, b: (1 / b, a / b**2))

    def __rtruediv__(self, other: float) -> Self:
        """Return the quotient."""
        return self._with(other, lambda a, b: b / a, lambda a, b: (b / a**2, 1 / a))

    def __neg__(self) -> Self:
        """Return it with the other sign."""
        return type(self)(-float(self), self.uncertainty, self.note)

    @property
    def developing(self) -> bool:
        """Whether the flow, or this number, still develops, so that the number is not yet that of the settled flow."""
        return DEVELOPING in self.note

    def __repr__(self) -> str:
        """Return ``1.487 ± 0.003``, digits down to the uncertainty's first two, and whether it still develops."""
        if np.isnan(self):
            return f"nan ({self.note})" if self.note else "nan"
        return self._digits() + remark(self)

    def _digits(self) -> str:
        if np.isinf(self.uncertainty):
            return f"{float(self):.4g} ± unknown"
        if not self.uncertainty > 1e-6 * abs(self):
            return f"{float(self):.6g}"
        value, decimals = float(self), 1 - math.floor(math.log10(self.uncertainty))
        if decimals <= 9:
            return f"{value:.{max(decimals, 0)}f} ± {self.uncertainty:.{max(decimals, 0)}f}"
        power = math.floor(math.log10(max(abs(value), self.uncertainty)))
        return " ± ".join(
            f"{each / 10.0**power:.{decimals + power}f}e{power:03d}" for each in (value, self.uncertainty)
        )

    __str__ = __repr__

    def __format__(self, spec: str) -> str:
        """Format the value alone when a format is given, value and uncertainty when none is."""
        return format(float(self), spec) if spec else repr(self)


def _joined(parts: Iterable[tuple[float, float]]) -> float:
    """Return the uncertainty of what has independent ones, each with the slope that it enters by."""
    shares = [abs(slope) * own if np.isfinite(own) else own for own, slope in parts]
    return math.nan if any(map(math.isnan, shares)) else math.hypot(*shares)


def remark(value: float) -> str:
    """Return ``" (still developing)"`` to put behind a number that is the mean of a flow that does, else nothing."""
    return f" ({DEVELOPING})" if isinstance(value, Estimate) and value.developing else ""


def _from_batches(means: FloatArray, value: float, scale: float, window: Window) -> Estimate:
    """Return a value with its uncertainty from the batch means that it is the mean of; the note tells a trend."""
    found = uncertainty_of_mean(means, value)
    drift = "" if window.developing else drift_of(means, scale)
    note = with_trends(window.rule, {"it": drift})
    if len(means) < 3:
        note = f"too few periods for an uncertainty; {note}"
    return Estimate(value, np.inf if window.growing else found.standard, note)


def mean(time: FloatArray, values: FloatArray, window: Window) -> Estimate:
    """Time average over the window, (21), with its uncertainty as the mean of the settled flow.

    The uncertainty is that of correlated averages over the shedding periods, of their trend if they have one
    (:func:`alsph.analysis.uncertainty.uncertainty_of_mean`), and infinite where the flow still grows.
    """
    if window.edges.size < 2:
        return Estimate(np.nan, note=window.rule)
    whole = window.edges[[0, -1]]
    average, square = (float(batch_means(time, f, whole)[0]) for f in (values, values**2))
    return _from_batches(batch_means(time, values, window.edges), average, np.sqrt(square), window)


def root_mean_square(time: FloatArray, values: FloatArray, window: Window) -> Estimate:
    """Root mean square about zero over the window, (23)."""
    square = mean(time, values**2, window)
    root = float(np.sqrt(square))
    return Estimate(root, square.uncertainty / (2 * root) if root > 0 else 0.0, square.note)


def amplitude(time: FloatArray, values: FloatArray, window: Window) -> Estimate:
    """Amplitude of the fundamental, averaged over the shedding periods of the window."""
    if window.periods < 1:
        return Estimate(np.nan, note=window.rule)
    amplitudes = cycle_amplitudes(time, values, window.edges)
    average = float(amplitudes.mean())
    return _from_batches(amplitudes, average, average, window)


def strouhal(time: FloatArray, lift: FloatArray, window: Window) -> Estimate:
    """Strouhal number fD/U of the lift in the window.

    The value is the interpolated peak of the spectrum. The uncertainty joins that of the mean period between zero
    crossings with the difference between the two methods. The note gives both.
    """
    if window.periods < 2:
        return Estimate(np.nan, note=window.rule)
    period, error = _slope(np.arange(window.periods + 1), window.edges)
    periods = np.diff(window.edges)
    error = max(error, uncertainty_of_mean(periods, float(periods.mean())).standard)
    crossing = 1 / period
    peak = spectral_peak(time, lift, window.start, window.end, crossing)
    uncertainty = np.hypot(error * crossing**2, peak - crossing)
    note = f"spectrum {peak:.5f}, zero crossings {crossing:.5f}, {window.periods} periods; {window.rule}"
    return Estimate(peak, float(uncertainty), note)


def _slope(x: NDArray[Any], y: FloatArray) -> tuple[float, float]:
    """Slope of the straight line fitted to three or more points, and its standard error."""
    line, covariance = np.polyfit(x, y, 1, cov=True)
    return float(line[0]), float(np.sqrt(covariance[0, 0]))


def mean_profile(time: FloatArray, profiles: FloatArray, window: Window) -> tuple[FloatArray, FloatArray]:
    """Time mean (22) and standard deviation in time of profiles such as C_p(t, θ).

    Parameters
    ----------
    time : ndarray, shape (k,)
        Sample times tU/D.
    profiles : ndarray, shape (k, m)
        One profile a sample.
    window : Window
        What is averaged over.

    Returns
    -------
    mean, deviation : ndarray, shape (m,)
        NaN where the window holds fewer than two samples.
    """
    if len(time) < 2 or not max(window.start, time[0]) < min(window.end, time[-1]):
        return np.full(profiles.shape[1], np.nan), np.full(profiles.shape[1], np.nan)
    edges = np.clip([window.start, window.end], time[0], time[-1])
    average = batch_means(time, profiles, edges)[0]
    variance = batch_means(time, (profiles - average) ** 2, edges)[0]
    return average, np.sqrt(np.maximum(variance, 0.0))


def error_norms(computed: FloatArray, exact: FloatArray) -> dict[str, float]:
    """Relative error norms ``l1``, ``l2`` and ``max`` of a particle field, each over the same norm of the exact field.

    Parameters
    ----------
    computed, exact : ndarray, shape (n,) or (n, d)
        Values at the same particles; vectors enter with their modulus.
    """
    error, scale = (np.linalg.norm(np.reshape(a, (len(a), -1)), axis=1) for a in (computed - exact, exact))
    norms: dict[str, Any] = {
        "l1": error.mean() / scale.mean(),
        "l2": np.sqrt((error**2).mean() / (scale**2).mean()),
        "max": error.max() / scale.max(),
    }
    return {name: float(value) for name, value in norms.items()}


def decay_rate(time: FloatArray, energy: FloatArray) -> Estimate:
    """Rate λ of an exponential decay exp(-λt), by a straight line through the logarithms (Taylor-Green: λ = 2Dνk²).

    Its uncertainty is that of a line through twenty averages of the record, since successive values deviate alike: 0.7
    of the rates lie within it where the deviations last for a fortieth of the record, 0.6 with a quarter.

    Parameters
    ----------
    time, energy : ndarray, shape (n,)
        Times, and for instance the kinetic energy (in D dimensions its rate is twice that of the velocity, Dνk²).
    """
    if len(time) < 3 or not np.all(energy > 0):
        return Estimate(np.nan, note="a decay rate needs three or more positive values")
    line = np.stack([time, -np.log(energy)])
    count = min(RATE_BATCHES, len(time))
    rate, error = _slope(*line)[0], np.nan
    if count > 3:
        batches, values = np.array([part.mean(axis=1) for part in np.array_split(line, count, axis=1)]).T
        error = float(slopes(batches[None], values, HIDDEN / count)[1][0])
    return Estimate(rate, error)


def observed_order(resolution: tuple[float, float], error: tuple[float, float]) -> float:
    """Order of convergence p in |error| ~ Δx^p between two resolutions D/Δx; NaN where an error is zero or missing."""
    coarse, fine = np.abs(error)
    if not (coarse > 0 and fine > 0):
        return np.nan
    return float(np.log(coarse / fine) / np.log(resolution[1] / resolution[0]))
