"""Averages, zero crossings and spectra of signals sampled at uneven times."""

import numpy as np

from alsph.arrays import FloatArray


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
    inner = np.union1d(time[(time > edges[0]) & (time < edges[-1])], edges)
    right = np.clip(np.searchsorted(time, inner), 1, len(time) - 1)
    share = (inner - time[right - 1]) / (time[right] - time[right - 1])
    samples = (values[right - 1].T * (1 - share) + values[right].T * share).T
    areas = 0.5 * (samples[1:] + samples[:-1]).T * np.diff(inner)
    sums = np.add.reduceat(areas, np.searchsorted(inner, edges[:-1]), axis=-1)  # of each by itself: none is lost in one
    return np.asarray((sums / np.diff(edges)).T)


def smoothed(time: FloatArray, signal: FloatArray, width: float) -> tuple[FloatArray, FloatArray]:
    """Return the times half a width or more from both ends, and the averages of the signal over a width about them."""
    inside = time[(time >= time[0] + width / 2) & (time <= time[-1] - width / 2)]
    integral = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(time) * (signal[1:] + signal[:-1]))])
    after, before = (np.interp(inside + half, time, integral) for half in (width / 2, -width / 2))
    return inside, (after - before) / width


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


def cycle_amplitudes(time: FloatArray, signal: FloatArray, edges: FloatArray) -> FloatArray:
    """Return the amplitude of a signal's fundamental in each cycle, shape (len(edges) - 1,).

    Unlike half the peak-to-peak range it is not raised by noise.
    """
    phase = 2j * np.pi * np.interp(time, edges, np.arange(len(edges)))
    return 2 * np.abs(batch_means(time, signal * np.exp(phase), edges))


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
