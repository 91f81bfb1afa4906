"""What the averaging window goes by, just on either side of each of its limits."""

import numpy as np
import pytest
from alsph.analysis.window import averaging_window, drift_of, with_trends

TIME = np.arange(0, 82, 0.01)


def sine(frequency, time=TIME):
    return np.sin(2 * np.pi * frequency * time)


def record(amplitudes, drags):
    """Return drag and lift of cycles five units long, each with its own amplitude and mean drag."""
    cycle = np.minimum((TIME / 5).astype(int), len(amplitudes) - 1)
    return np.array(drags)[cycle], np.array(amplitudes)[cycle] * sine(0.2)


def uneven(scatter):
    """Return lift with periods that are long and short in turn."""
    edges = np.cumsum([0, *5 * (1 + scatter * (-1.0) ** np.arange(17))])
    return sine(1, np.interp(TIME, edges, np.arange(18)))


LATER_HALF = "; later half of the record"


@pytest.mark.parametrize(
    ("lift", "thickness", "doubt"),
    [
        (1.05 * np.sqrt(2) * 1.4e-3 * sine(0.2), 1.0, ""),
        (0.95 * np.sqrt(2) * 1.4e-3 * sine(0.2), 1.0, "the lift fluctuates by less than 0.001 of the drag"),
        (1 + 0.95 * np.sqrt(2) * 1.4e-3 * sine(0.2), 1.0, "the lift fluctuates by less than 0.001 of the drag"),
        (3.0 + sine(0.97), 1.0, ""),
        (sine(1.03), 1.0, "the lift oscillates at fD/U = 1.03, faster than a wake of this thickness can"),
        (sine(1.94), 0.5, ""),
        (sine(2.06), 0.5, "the lift oscillates at fD/U = 2.06, faster than a wake of this thickness can"),
        (sine(9.7), 0.1, ""),
        (sine(9.9, 1.03 * TIME), 0.09, "the lift oscillates at fD/U = 10.2, in fewer than 10 steps"),
        (uneven(0.23), 1.0, ""),
        (uneven(0.3), 1.0, "the lift's oscillations are of irregular length"),
        (sine(0.2) + 0.95 * sine(0.4, TIME + 0.625), 1.0, ""),
        (sine(0.2) + 1.05 * sine(0.4, TIME + 0.625), 1.0, "no line stands out of the lift's spectrum"),
        (
            sine(0.2) + 0.8 * sine(1.9) + 0.8 * sine(2.3),
            1.0,
            "",
        ),  # what is beyond three times the frequency does not count
        (np.nan * TIME, 1.0, None),
    ],
)
def test_shedding_is_told_from_what_is_not(lift, thickness, doubt):
    window = averaging_window(TIME, 1.4 + 0 * TIME, lift, thickness)
    if doubt == "":
        assert window.settled and window.periods > 9 and window.rule.startswith("periodic: whole shedding periods")
        return
    assert (window.periods, window.settled, window.growing) == (0, False, False)
    assert window.edges == pytest.approx(np.linspace(TIME[-1] / 2, TIME[-1], 21), abs=1e-9)
    nothing = LATER_HALF.removeprefix("; ")
    assert window.rule == (nothing if doubt is None else f"no regular shedding found: {doubt}{LATER_HALF}")


@pytest.mark.parametrize(("end", "periods"), [(20.0, 0), (22.0, 3)])
def test_three_periods_are_shedding(end, periods):
    time = TIME[TIME < end]
    window = averaging_window(time, 1.4 + 0 * time, sine(0.2, time))
    assert window.periods == periods
    assert periods or window.rule == (
        "still developing (shedding may have begun); no regular shedding found: fewer than 3 oscillations of the lift"
        + LATER_HALF
    )


@pytest.mark.parametrize(("strength", "developing"), [(0.012, False), (0.0165, True)])
def test_a_few_oscillations_of_a_hundredth_of_the_force_are_shedding_to_come(strength, developing):
    time = TIME[TIME < 20]
    assert averaging_window(time, 1 + 0 * time, strength * sine(0.2, time)).developing == developing


ONE = np.ones(16)
IN_TURN = (-1.0) ** np.arange(16)


def first(*values, then=ONE):
    return np.concatenate([values, then[len(values) :]])


@pytest.mark.parametrize(
    ("amplitudes", "drags", "cycle"),
    [
        (first(0.5, 0.6, 0.7, 0.96), ONE, 4),
        (first(0.5, 0.6, 0.7, 0.99), ONE, 3),
        (first(0.5, 0.6, 0.7, 1.016), ONE, 3),
        (first(0.5, 0.6, 0.7, 1.035), ONE, 4),
        (first(0.5, 0.6, 0.7, 0.975, then=1 + 0.04 * IN_TURN), ONE, 3),  # three times the scatter, at most 5 %
        (first(0.5, 0.6, 0.7, 0.91, then=1 + 0.04 * IN_TURN), ONE, 4),
        (ONE, first(0.5, 0.6, 0.7, 0.9895), 4),
        (ONE, first(0.5, 0.6, 0.7, 0.9905), 3),
        (ONE, first(0.5, 0.6, 0.7, 1.0095), 3),
        (ONE, first(0.5, 0.6, 0.7, 1.0105), 4),
        (ONE, first(0.5, 0.6, 0.7, 0.979, then=1 + 0.015 * IN_TURN), 4),  # at most 2 %
        (ONE, first(0.5, 0.6, 0.7, 0.981, then=1 + 0.015 * IN_TURN), 3),
        (first(0.5, 1, 1, 0.5), ONE, 4),  # two in a row are not enough
        (first(0.5, 1, 1, 1, 0.5), ONE, 1),
    ],
)
def test_the_transient_ends_with_the_first_of_three_settled_cycles(amplitudes, drags, cycle):
    window = averaging_window(TIME, *record(amplitudes, 1.4 * drags))
    assert window.settled and not window.developing
    assert (window.periods, window.start, window.end) == (
        16 - cycle,
        pytest.approx(5 * cycle, abs=0.1),
        pytest.approx(80, abs=0.1),
    )


@pytest.mark.parametrize(("outliers", "settled"), [(3, True), (4, False)])
def test_four_of_five_cycles_stay_settled(outliers, settled):
    amplitudes = ONE.copy()
    amplitudes[5 : 5 + 2 * outliers : 2] = 1.1
    window = averaging_window(TIME, *record(amplitudes, 1.4 * ONE))
    assert window.settled == settled and (window.periods == (15 if settled else 8))
    assert settled or window.rule == "shedding not periodic yet: later half of the shedding periods"


@pytest.mark.parametrize(("time_constant", "start", "developing"), [(8, 15, False), (15, 30, False), (30, 35, True)])
def test_a_trend_that_a_start_up_to_an_eighth_later_leaves_behind_is_none(time_constant, start, developing):
    window = averaging_window(TIME, 1.4 + 0.1 * np.exp(-TIME / time_constant), sine(0.2))
    assert window.settled and window.start == pytest.approx(start, abs=0.1) and window.developing == developing
    assert not developing or window.rule == (
        "still developing (drag changes by -1.5% over the window); periodic: whole shedding periods after the transient"
    )


@pytest.mark.parametrize(("rate", "growing"), [(0.002, False), (0.005, True), (0.05, True)])
def test_an_amplitude_that_gathers_pace_by_more_than_a_tenth_grows(rate, growing):
    window = averaging_window(TIME, 1.4 + 0 * TIME, np.exp(rate * TIME) * sine(0.2))
    assert window.developing and window.growing == growing
    assert "(lift amplitude changes by +" in window.rule and ", gathering pace)" in window.rule


@pytest.mark.parametrize(
    ("rate", "growing", "how"),
    [(0.3, True, "lift grows"), (-0.05, False, "lift changes by -1.6% over the window"), (0.0, False, None)],
)
def test_a_lift_without_regular_periods_may_grow_too(rate, growing, how):
    time = TIME[:2000]
    lift = 0.1 * np.exp(rate * (time - 15)) * sine(0.05, time + 3) if rate > 0 else 0.1 * np.exp(rate * time)
    window = averaging_window(time, 1.4 + 0 * time, lift)
    assert window.periods == 0 and window.growing == growing
    assert how is None or how in window.rule


LINE = np.linspace(-0.5, 0.5, 10) + 1e-6 * np.sin(9 * np.arange(10))


@pytest.mark.parametrize(
    ("change", "scale", "text"),
    [
        (0.02, 1.0, "changes by +2.0% over the window"),
        (-0.02, 2.0, "changes by -1.0% over the window"),
        (0.0008, 1.0, ""),  # the settled mean is near enough
        (0.0, 1.0, ""),
    ],
)
def test_a_drift_is_told_in_parts_of_the_scale(change, scale, text):
    assert drift_of(1 + change * LINE, scale) == text


def test_averages_that_go_away_faster_and_faster_are_told_so():
    growth = np.exp(np.arange(10) / 2.0)
    found = drift_of(1 + 0.02 * growth / growth[-1], 1.0)
    assert found.startswith("changes by +") and found.endswith("% over the window, gathering pace")
    assert drift_of(1e-3 * growth / growth[-1], 100.0) == ""  # by 1e-5 of the scale


def test_trends_stand_before_the_rule():
    assert with_trends("rule", {"drag": "", "lift": ""}) == "rule"
    assert (
        with_trends("rule", {"drag": "falls", "x": "", "lift": "grows"})
        == "still developing (drag falls, lift grows); rule"
    )


def test_a_drift_is_told_by_the_root_mean_square_of_the_window():
    window = averaging_window(TIME, TIME / TIME[-1], 0 * TIME)
    # slices at 0.5125 to 0.9875, over the root of (1 - 1/8) / 3 / 0.5
    assert window.rule.startswith(f"still developing (drag changes by +{0.475 / np.sqrt(7 / 12):.1%} over the window")
    assert (window.periods, window.growing) == (0, False)


def test_nothing_at_all_develops_nothing():
    window = averaging_window(TIME, 0 * TIME, 0 * TIME)
    assert not window.developing and not window.growing and window.periods == 0
    assert averaging_window(TIME, 0 * TIME, sine(0.2)).settled  # sides of a channel may have lift alone


def test_noise_is_told_by_the_later_half_and_the_begin_of_the_clock_by_nothing():
    lift = np.where(TIME < 41, 2 * sine(1.5), sine(0.2))
    window = averaging_window(TIME, 1.4 + 0 * TIME, lift)
    assert window.settled and window.periods == 7 and window.start == pytest.approx(45, abs=0.1)
    for signal in (lift, sine(0.2), sine(0.02), uneven(0.3), np.exp(0.05 * TIME) * sine(0.2), np.nan * TIME):
        drag = 1.4 + 0.1 * np.exp(-TIME / 30)
        here, later = averaging_window(TIME, drag, signal), averaging_window(1000 + TIME, drag, signal)
        assert later.edges == pytest.approx(1000 + here.edges, abs=1e-6)
        assert (later.rule, later.growing) == (here.rule, here.growing)


def test_three_samples_make_a_window():
    none = averaging_window(TIME[:2], TIME[:2], TIME[:2])
    assert (none.edges.size, none.periods, none.settled, none.growing) == (0, 0, False, False)
    assert none.rule == "no window: fewer than three samples" and np.isnan([none.start, none.end]).all()
    three = averaging_window(TIME[:3], 1 + 0 * TIME[:3], 0 * TIME[:3])
    assert (three.start, three.end) == pytest.approx((0.01, 0.02))
