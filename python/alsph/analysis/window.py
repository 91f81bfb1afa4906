"""The averaging window: where the transient ends, whether vortices are shed, and whether the flow still develops."""

from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from alsph.analysis.signals import amplitude_spectrum, batch_means, cycle_amplitudes, smoothed, upward_crossings
from alsph.analysis.uncertainty import trend, uncertainty_of_mean
from alsph.arrays import FloatArray

AMPLITUDE_TOLERANCE = (0.02, 0.05)  # relative bounds on how far a settled cycle's lift amplitude is from the reference
DRAG_TOLERANCE = (0.01, 0.02)  # and on its mean drag
SETTLED_CYCLES = 3  # so many settled cycles in a row end the transient; fewer oscillations in all are no shedding yet
IRREGULAR_PERIODS = 0.25  # relative scatter of the periods above which crossings are noise, not shedding
SMOOTHING = 0.125  # of a period, before crossings are sought
DEAD_BAND = 0.3  # crossings are counted between excursions of at least this times the lift's rms
BATCHES_WITHOUT_CYCLES = 20
TOO_FEW = f"fewer than {SETTLED_CYCLES} oscillations of the lift"
SLOW_LIFT = 0.01  # rms of so few oscillations, over that of the whole force, that is shedding to come
DEVELOPING = "still developing"
DRIFT_TOLERANCE = 0.005  # a trend matters if the settled mean may be farther than this from the mean, over the rms
ROUND_OFF = 1e-9  # no growth of the lift below this share of the force is told
SMALLEST_CHANGE = 1e-4  # nor a change below this share
FAST_GROWTH = 0.1  # of the lift's amplitude in the window, beyond which nothing tells the settled flow
SMALLEST_LIFT = 1e-3  # rms of the lift's fluctuation over the drag's rms below which it is round-off or noise
LARGEST_STROUHAL = 1.0  # by the thickness across the stream: bluff bodies 0.1 to 0.3, trailing edges and channels more
SAMPLES_PER_PERIOD = 10
LINE_SHARE = 0.5  # of the lift's spectrum up to three times its frequency lies within 30 % of it


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
        How the window was chosen, in words; begins with "still developing" if drag or lift have a trend in it.
    growing : bool
        Whether the lift grows without levelling off, so that nothing tells the settled flow.
    """

    edges: FloatArray
    periods: int
    settled: bool
    rule: str
    growing: bool = False

    @property
    def developing(self) -> bool:
        """Whether drag or lift have a trend in the window."""
        return DEVELOPING in self.rule

    @property
    def start(self) -> float:
        """Begin of the window, tU/D (NaN if empty)."""
        return float(self.edges[0]) if self.edges.size else np.nan

    @property
    def end(self) -> float:
        """End of the window, tU/D (NaN if empty)."""
        return float(self.edges[-1]) if self.edges.size else np.nan

    def holds(self, time: FloatArray) -> NDArray[np.bool_]:
        """Return which times (n,) lie in the window or at its ends, none if it is empty."""
        return np.asarray((time >= self.start) & (time <= self.end))


def whole_record(time: FloatArray) -> Window:
    """Return the window of a flow that neither becomes steady nor periodic: all of its times tU/D (n,)."""
    if len(time) < 3:
        return Window(np.empty(0), 0, False, "no window: fewer than three samples")
    return Window(np.linspace(time[0], time[-1], BATCHES_WITHOUT_CYCLES + 1), 0, False, "whole run, a transient")


def averaging_window(time: FloatArray, drag: FloatArray, lift: FloatArray, thickness: float = 1.0) -> Window:
    """Cut the transient and return the whole shedding periods after it.

    Periods run between upward zero crossings of the lift. The transient ends with the first of three successive periods
    whose lift amplitude and mean drag agree with their medians over the later half of all periods: within three times
    the scatter there, at most 5 % (lift) and 2 % (drag). Where that never happens the later half of the periods
    is used, and without regular shedding the later half of the record; `Window.rule` says so, and whether drag or lift
    have a trend in the window.

    Parameters
    ----------
    time, drag, lift : ndarray, shape (n,)
        Times tU/D, increasing, and the coefficients C_D and C_L.
    thickness : float
        Extent of the body across the stream [D]; it bounds the frequencies at which it may shed vortices.
    """
    if len(time) < 3:
        return Window(np.empty(0), 0, False, "no window: fewer than three samples")
    edges, doubt = _shedding(time, drag, lift, thickness)
    if doubt:
        return _without_shedding(time, drag, lift, doubt)
    first = _first_settled_cycle(time, drag, lift, edges)
    if first is None:
        rule = "shedding not periodic yet: later half of the shedding periods"
        return _whole_periods(time, drag, lift, edges[(len(edges) - 1) // 2 :], rule, settled=False)
    rule = "periodic: whole shedding periods after the transient"
    rest = (len(edges) - 1 - first) // 8  # what is left of the transient is a trend, too, which a later start cures
    starts = range(first, first + rest + 1)
    windows = (_whole_periods(time, drag, lift, edges[k:], rule, settled=True) for k in starts)
    earliest = next(windows)
    return next((window for window in chain([earliest], windows) if not window.developing), earliest)


def _whole_periods(
    time: FloatArray, drag: FloatArray, lift: FloatArray, edges: FloatArray, rule: str, *, settled: bool
) -> Window:
    """Return the window of these shedding periods, with what develops in it."""
    amplitudes = cycle_amplitudes(time, lift, edges)
    average = float(amplitudes.mean())
    growth = uncertainty_of_mean(amplitudes, average)
    periods = np.diff(edges)
    trends = {
        "drag": _drift(time, drag, edges),
        "lift amplitude": drift_of(amplitudes, average),
        "shedding period": drift_of(periods, float(periods.mean())),
    }
    growing = growth.change > FAST_GROWTH * average and bool(np.isinf(growth.standard))
    return Window(edges, len(edges) - 1, settled, with_trends(rule, trends), growing)


def _without_shedding(time: FloatArray, drag: FloatArray, lift: FloatArray, doubt: str) -> Window:
    """Return the later half of the record in equal slices."""
    edges = np.linspace(0.5 * (time[0] + time[-1]), time[-1], BATCHES_WITHOUT_CYCLES + 1)
    if np.isnan(lift).all():
        return Window(edges, 0, False, "later half of the record")
    rule = f"no regular shedding found: {doubt}; later half of the record"
    whole = edges[[0, -1]]
    scale = float(np.sqrt(batch_means(time, drag**2 + lift**2, whole)[0]))
    fluctuation = (lift - batch_means(time, lift, whole)) ** 2
    fifths = np.sqrt(batch_means(time, fluctuation, edges[:: BATCHES_WITHOUT_CYCLES // 5]))
    growing = trend(fifths) > max(0.5 * fifths.max(), ROUND_OFF * scale)
    trends = {"drag": _drift(time, drag, edges), "lift": drift_of(batch_means(time, lift, edges), scale)}
    if growing:
        trends["lift"] = "grows"
    if doubt == TOO_FEW and np.sqrt((fifths**2).mean()) > SLOW_LIFT * scale:
        trends["shedding"] = "may have begun"
        growing = growing or bool(fifths[3:].mean() > 1.5 * fifths[:2].mean())
    return Window(edges, 0, False, with_trends(rule, trends), growing)


def with_trends(rule: str, trends: dict[str, str]) -> str:
    """Return the rule, after what still develops."""
    found = [f"{name} {how}" for name, how in trends.items() if how]
    return f"{DEVELOPING} ({', '.join(found)}); {rule}" if found else rule


def _drift(time: FloatArray, values: FloatArray, edges: FloatArray) -> str:
    """Return in words how the means of the batches drift, empty where they do not or it does not matter."""
    scale = np.sqrt(batch_means(time, values**2, edges[[0, -1]])[0])
    return drift_of(batch_means(time, values, edges), float(scale))


def drift_of(averages: FloatArray, scale: float) -> str:
    """Return in words how successive averages drift, empty where they do not or it is little beside the scale."""
    found = uncertainty_of_mean(averages, float(averages.mean()))
    if not abs(found.change) > SMALLEST_CHANGE * scale or not found.standard > DRIFT_TOLERANCE * scale:
        return ""
    gathering = ", gathering pace" if np.isinf(found.standard) else ""
    return f"changes by {found.change / scale:+.1%} over the window{gathering}"


def _shedding(time: FloatArray, drag: FloatArray, lift: FloatArray, thickness: float) -> tuple[FloatArray, str]:
    """Return the times that bound the shedding periods, or why the lift's fluctuation is not shedding."""
    none = np.empty(0)
    if np.isnan(lift).all():
        return none, "no lift"
    if odd := np.count_nonzero(~(np.isfinite(lift) & np.isfinite(drag))):
        return none, f"in {odd} of {len(lift)} steps drag or lift is no number"
    late = time >= 0.5 * (time[0] + time[-1])
    spread = float(lift[late].std())
    if not spread > SMALLEST_LIFT * float(np.sqrt((drag[late] ** 2).mean())):
        return none, f"the lift fluctuates by less than {SMALLEST_LIFT:g} of the drag"
    edges = _rises(time, lift - lift[late].mean(), DEAD_BAND * spread)
    periods = np.diff(edges)[len(edges) // 2 :]
    if len(periods) and periods.std() > IRREGULAR_PERIODS * periods.mean():
        return none, "the lift's oscillations are of irregular length"
    if len(edges) - 1 < SETTLED_CYCLES:
        return none, TOO_FEW
    frequency = 1 / float(periods.mean())
    if frequency * thickness > LARGEST_STROUHAL:
        return none, f"the lift oscillates at fD/U = {frequency:.3g}, faster than a wake of this thickness can"
    if SAMPLES_PER_PERIOD * frequency * np.median(np.diff(time[late])) > 1:
        return none, f"the lift oscillates at fD/U = {frequency:.3g}, in fewer than {SAMPLES_PER_PERIOD} steps"
    if _line_share(time, lift, frequency) < LINE_SHARE:
        return none, "no line stands out of the lift's spectrum"
    return edges, ""


def _rises(time: FloatArray, fluctuation: FloatArray, dead_band: float) -> FloatArray:
    """Return the upward zero crossings, without noise much faster than the strongest line of the later half."""
    frequencies, lines = amplitude_spectrum(time, fluctuation, 0.5 * (time[0] + time[-1]), float(time[-1]))
    line = float(frequencies[1 + np.argmax(lines[1:])])
    return upward_crossings(*smoothed(time, fluctuation, SMOOTHING / line), dead_band)


def _line_share(time: FloatArray, lift: FloatArray, frequency: float) -> float:
    """Return how much of the lift's power up to three times a frequency, in the later half, lies around it."""
    frequencies, lines = amplitude_spectrum(time, lift, 0.5 * (time[0] + time[-1]), float(time[-1]))
    power = lines**2 * (frequencies < 3 * frequency)
    near = np.abs(np.log(np.maximum(frequencies, 1e-300) / frequency)) < np.log(1.3)
    return float(power[near].sum() / power.sum())


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
