"""Measures of a run, as pure functions of arrays: averages (21)-(23), Strouhal number, divergence, error norms.

Times are in units of D/U (t* = tU/D) and coefficients are dimensionless, so that frequencies are Strouhal numbers.
"""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from alsph.geometry import FloatArray

AMPLITUDE_TOLERANCE = (0.02, 0.05)  # relative bounds on how far a settled cycle's lift amplitude is from the reference
DRAG_TOLERANCE = (0.01, 0.02)  # and on its mean drag
SETTLED_CYCLES = 3  # so many settled cycles in a row end the transient; fewer oscillations in all are no shedding yet
IRREGULAR_PERIODS = 0.25  # relative scatter of the periods above which crossings are noise, not shedding
DEAD_BAND = 0.3  # crossings are counted between excursions of at least this times the lift's rms
BATCHES_WITHOUT_CYCLES = 5


class Estimate(float):
    """A number with its standard uncertainty; behaves as a plain float everywhere else.

    Attributes
    ----------
    uncertainty : float
        One standard uncertainty (68 % confidence), NaN where the data do not allow one.
    note : str
        How the number came about, or why it is NaN.
    """

    __slots__ = ("note", "uncertainty")
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

    def __repr__(self) -> str:
        """Return ``1.487 ± 0.003``, digits down to the uncertainty's first two."""
        if np.isnan(self):
            return f"nan ({self.note})" if self.note else "nan"
        if not self.uncertainty > 1e-6 * abs(self):
            return f"{float(self):.6g}"
        decimals = int(np.clip(1 - np.floor(np.log10(self.uncertainty)), 0, 9))
        return f"{float(self):.{decimals}f} ± {self.uncertainty:.{decimals}f}"

    __str__ = __repr__

    def __format__(self, spec: str) -> str:
        """Format the value alone when a format is given, value and uncertainty when none is."""
        return format(float(self), spec) if spec else repr(self)


@dataclass(frozen=True, eq=False)
class Window:
    """The averaging window: from the end of the transient over a whole number of shedding periods.

    Attributes
    ----------
    edges : ndarray, shape (batches + 1,)
        Times tU/D that bound the shedding periods (or equal slices where there is no shedding).
    periods : int
        Number of shedding periods in the window, 0 where there is no shedding.
    settled : bool
        Whether the flow was found to be periodic; if not, `rule` says what was averaged instead.
    rule : str
        How the window was chosen, in words.
    """

    edges: FloatArray
    periods: int
    settled: bool
    rule: str

    @property
    def start(self) -> float:
        """Begin of the window, tU/D (NaN if empty)."""
        return float(self.edges[0]) if self.edges.size else np.nan

    @property
    def end(self) -> float:
        """End of the window, tU/D (NaN if empty)."""
        return float(self.edges[-1]) if self.edges.size else np.nan


def batch_means(time: FloatArray, values: FloatArray, edges: FloatArray) -> FloatArray:
    """Return the time averages (1/T)∫ f dt between successive edges, as in (21) and (22).

    Parameters
    ----------
    time : ndarray, shape (n,)
        Increasing sample times; steps may vary.
    values : ndarray, shape (n, ...)
        Samples of f.
    edges : ndarray, shape (k + 1,)
        Bounds of the batches, within the sampled time.

    Returns
    -------
    ndarray, shape (k, ...)
    """
    areas = 0.5 * (np.diff(time) * (values[1:] + values[:-1]).T).T
    integral = np.concatenate([np.zeros_like(areas[:1]), np.cumsum(areas, axis=0)])
    right = np.clip(np.searchsorted(time, edges), 1, len(time) - 1)
    elapsed, step = edges - time[right - 1], time[right] - time[right - 1]
    elapsed, step = (a.reshape(-1, *[1] * (values.ndim - 1)) for a in (elapsed, step))
    slope = (values[right] - values[right - 1]) / step
    at_edges = integral[right - 1] + elapsed * (values[right - 1] + 0.5 * slope * elapsed)
    widths = np.diff(edges).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(np.diff(at_edges, axis=0) / widths)


def upward_crossings(time: FloatArray, signal: FloatArray, dead_band: float = 0.0) -> FloatArray:
    """Return the times at which a signal rises from below ``-dead_band`` to above ``dead_band``.

    Each time is the zero of a straight line fitted to the samples of the rise, so noise smaller than the dead band
    neither adds crossings nor shifts them much.
    """
    outside = np.flatnonzero(np.abs(signal) > dead_band)
    rises = np.flatnonzero((signal[outside][:-1] < 0) & (signal[outside][1:] > 0))
    bounds = np.stack([outside[rises], outside[rises + 1] + 1], axis=1)
    return np.array([_zero(time[a:b], signal[a:b]) for a, b in bounds])


def _zero(time: FloatArray, signal: FloatArray) -> float:
    """Zero of the straight line fitted to a short rise, kept within it."""
    slope = np.polyfit(time - time.mean(), signal, 1)[0]
    return float(np.clip(time.mean() - signal.mean() / slope, time[0], time[-1]))


def averaging_window(time: FloatArray, drag: FloatArray, lift: FloatArray) -> Window:
    """Cut the transient and return the whole shedding periods after it.

    Periods run between upward zero crossings of the lift. The transient ends with the first of three successive periods
    whose lift amplitude and mean drag agree with their medians over the later half of all periods: within three times
    the scatter there, at most 5 % (lift) and 2 % (drag). Where that never happens the later half of the periods
    is used, and without regular shedding the later half of the record; `Window.rule` says so.

    Parameters
    ----------
    time, drag, lift : ndarray, shape (n,)
        Times tU/D, increasing, and the coefficients C_D and C_L.
    """
    if len(time) < 3:
        return Window(np.empty(0), 0, False, "no window: fewer than three samples")
    edges = _cycle_edges(time, lift)
    if len(edges) - 1 < SETTLED_CYCLES:
        halfway = 0.5 * (time[0] + time[-1])
        edges = np.linspace(halfway, time[-1], BATCHES_WITHOUT_CYCLES + 1)
        bodiless = bool(np.isnan(lift).all())
        rule = "later half of the record" if bodiless else "no regular shedding found: later half of the record"
        return Window(edges, 0, False, rule)
    first = _first_settled_cycle(time, drag, lift, edges)
    if first is None:
        edges = edges[(len(edges) - 1) // 2 :]
        return Window(edges, len(edges) - 1, False, "shedding not periodic yet: later half of the shedding periods")
    return Window(edges[first:], len(edges) - 1 - first, True, "periodic: whole shedding periods after the transient")


def _cycle_edges(time: FloatArray, lift: FloatArray) -> FloatArray:
    """Return the times that bound the shedding periods, empty where the lift does not oscillate regularly."""
    late = lift[time >= 0.5 * (time[0] + time[-1])]
    fluctuation = lift - late.mean()
    edges = upward_crossings(time, fluctuation, DEAD_BAND * float(late.std()))
    periods = np.diff(edges)[len(edges) // 2 :]
    if len(periods) == 0 or periods.std() > IRREGULAR_PERIODS * periods.mean():
        return np.empty(0)
    return edges


def _first_settled_cycle(time: FloatArray, drag: FloatArray, lift: FloatArray, edges: FloatArray) -> int | None:
    """Index of the cycle that ends the transient, None if the cycles after it do not stay settled."""
    settled = _settled(cycle_amplitudes(time, lift, edges), AMPLITUDE_TOLERANCE)
    settled &= _settled(batch_means(time, drag, edges), DRAG_TOLERANCE)
    runs = np.lib.stride_tricks.sliding_window_view(settled, SETTLED_CYCLES).all(axis=1)
    first = int(np.argmax(runs))
    return first if runs.any() and settled[first:].mean() >= 0.8 else None


def _settled(measure: FloatArray, tolerance: tuple[float, float]) -> NDArray[np.bool_]:
    """Cycles within three scatters of the later half's median; the scatter is bounded by the relative tolerance."""
    later = measure[len(measure) // 2 :]
    reference = np.median(later)
    deviation = np.abs(measure - reference)
    scatter = 1.4826 * np.median(deviation[len(measure) // 2 :])
    return np.asarray(deviation <= np.clip(3 * scatter, *np.abs(reference) * np.array(tolerance)))


def cycle_amplitudes(time: FloatArray, signal: FloatArray, edges: FloatArray) -> FloatArray:
    """Return the amplitude of a signal's fundamental in each cycle, shape (len(edges) - 1,).

    Unlike half the peak-to-peak range it is not raised by noise.
    """
    phase = 2j * np.pi * np.interp(time, edges, np.arange(len(edges)))
    return 2 * np.abs(batch_means(time, signal * np.exp(phase), edges))


def _from_batches(means: FloatArray, widths: FloatArray, note: str) -> Estimate:
    """Mean of batch means and its standard uncertainty.

    Successive periods are correlated, so batches of one, two and three periods are tried and the largest standard error
    (with Student's factor for the number of batches) is kept.
    """
    value = float(np.average(means, weights=widths))
    errors = [np.nan]
    for size in (1, 2, 3):
        count = len(means) // size
        if count >= (2 if size == 1 else 4):
            batches = means[len(means) - count * size :].reshape(count, size).mean(axis=1)
            errors.append(batches.std(ddof=1) / np.sqrt(count) * stdtrit(count - 1, 0.8413))
    return Estimate(value, float(np.nanmax(errors)) if len(errors) > 1 else np.nan, note)


def mean(time: FloatArray, values: FloatArray, window: Window) -> Estimate:
    """Time average over the window, (21), with the uncertainty from its scatter between shedding periods."""
    if window.edges.size < 2:
        return Estimate(np.nan, note=window.rule)
    return _from_batches(batch_means(time, values, window.edges), np.diff(window.edges), window.rule)


def root_mean_square(time: FloatArray, values: FloatArray, window: Window) -> Estimate:
    """Root mean square about zero over the window, (23)."""
    square = mean(time, values**2, window)
    root = float(np.sqrt(square))
    return Estimate(root, square.uncertainty / (2 * root) if root > 0 else 0.0, square.note)


def amplitude(time: FloatArray, values: FloatArray, window: Window) -> Estimate:
    """Amplitude of the fundamental, averaged over the shedding periods of the window."""
    if window.periods < 1:
        return Estimate(np.nan, note=window.rule)
    return _from_batches(cycle_amplitudes(time, values, window.edges), np.ones(window.periods), window.rule)


def strouhal(time: FloatArray, lift: FloatArray, window: Window) -> Estimate:
    """Strouhal number fD/U of the lift in the window.

    The value is the interpolated peak of the spectrum. The uncertainty joins the scatter of the zero crossings with the
    difference between the two methods. The note gives both.
    """
    if window.periods < 2:
        return Estimate(np.nan, note=window.rule)
    period, error = _slope(np.arange(window.periods + 1), window.edges)
    crossing = 1 / period
    peak = spectral_peak(time, lift, window.start, window.end, crossing)
    uncertainty = np.hypot(error * crossing**2, peak - crossing)
    note = f"spectrum {peak:.5f}, zero crossings {crossing:.5f}, {window.periods} periods; {window.rule}"
    return Estimate(peak, float(uncertainty), note)


def _slope(x: NDArray[Any], y: FloatArray) -> tuple[float, float]:
    """Slope of the straight line fitted to three or more points, and its standard error."""
    line, covariance = np.polyfit(x, y, 1, cov=True)
    return float(line[0]), float(np.sqrt(covariance[0, 0]))


def amplitude_spectrum(
    time: FloatArray, signal: FloatArray, start: float, end: float, padding: int = 1
) -> tuple[FloatArray, FloatArray]:
    """Return the frequencies and the amplitudes of the spectral lines of a signal without its mean, by a Hann window.

    Parameters
    ----------
    time, signal : ndarray, shape (n,)
        Increasing sample times, and the samples; steps may vary.
    start, end : float
        The stretch of time looked at.
    padding : int
        Bins for each 1/(end - start) of frequency.

    Returns
    -------
    frequency, amplitude : ndarray, shape (m,)
        A sine of amplitude a gives a line of height a.
    """
    count = max(64, int(np.count_nonzero((time >= start) & (time <= end))))
    uniform, step = np.linspace(start, end, count, endpoint=False, retstep=True)
    samples, taper = np.interp(uniform, time, signal), np.hanning(count)
    lines = np.abs(np.fft.rfft((samples - samples.mean()) * taper, padding * count))
    return np.asarray(np.fft.rfftfreq(padding * count, step)), np.asarray(2 * lines / taper.sum())


def spectral_peak(time: FloatArray, signal: FloatArray, start: float, end: float, guess: float) -> float:
    """Return the frequency of the strongest spectral line within a factor 1.5 of `guess`.

    A Hann window, eightfold zero padding and a parabola through the logarithms of the three highest bins place the peak
    far more finely than the bin width 1/T.
    """
    frequency, lines = amplitude_spectrum(time, signal, start, end, padding=8)
    near = np.flatnonzero((frequency > guess / 1.5) & (frequency < guess * 1.5))
    k = int(near[np.argmax(lines[near])])
    left, middle, right = np.log(np.maximum(lines[k - 1 : k + 2], np.finfo(float).tiny))
    curvature = left - 2 * middle + right
    offset = 0.5 * (left - right) / curvature if curvature < 0 else 0.0
    return float(frequency[k] + offset * frequency[1])


def mean_profile(time: FloatArray, profiles: FloatArray, window: Window) -> tuple[FloatArray, FloatArray]:
    """Time mean (22) and standard deviation in time of profiles such as C_p(t, θ).

    Parameters
    ----------
    time : ndarray, shape (k,)
        Sample times tU/D.
    profiles : ndarray, shape (k, m)
        One profile a sample.

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

    Parameters
    ----------
    time, energy : ndarray, shape (n,)
        Times, and for instance the kinetic energy (in D dimensions its rate is twice that of the velocity, Dνk²).
    """
    if len(time) < 3 or not np.all(energy > 0):
        return Estimate(np.nan, note="a decay rate needs three or more positive values")
    slope, error = _slope(time, np.log(energy))
    return Estimate(-slope, error)


def observed_order(resolution: tuple[float, float], error: tuple[float, float]) -> float:
    """Order of convergence p in |error| ~ Δx^p between two resolutions D/Δx; NaN where an error is zero or missing."""
    coarse, fine = np.abs(error)
    if not (coarse > 0 and fine > 0):
        return np.nan
    return float(np.log(coarse / fine) / np.log(resolution[1] / resolution[0]))
