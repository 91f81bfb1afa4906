"""The ± of the mean drag on signals whose settled drag is known; benches/coverage.py tries more of them."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from alsph import Run, plotting
from alsph.analysis import averages
from alsph.analysis.measures import Measure
from alsph.analysis.signals import smoothed
from alsph.analysis.uncertainty import trend, uncertainty_of_mean
from alsph.plotting import pressure_coefficient
from alsph.study import convergence
from alsph.study.convergence import grid_convergence
from alsph.study.validation import Entry, Row
from alsph.symbols import GENERAL
from battery import ESTIMATED, SETTLED, autoregressive_series, drifting, growing, relaxing, shedding, times, transient
from scipy.ndimage import gaussian_filter1d
from synthetic import write_run


def measured(signal, end, seed, thickness=1.0):
    rng = np.random.default_rng(seed)
    time = times(rng, end)
    drag, lift = signal(rng, time)
    window = averages.averaging_window(time, drag, lift, thickness)
    return window, averages.mean(time, drag, window), averages.strouhal(time, lift, window)


@pytest.mark.parametrize("count", [10, 20, 40])
@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.7, 0.9])
def test_the_uncertainty_covers_the_mean_of_correlated_periods(correlation, count):
    rng = np.random.default_rng(0)
    covered = []
    for _ in range(400):
        averages = autoregressive_series(rng, correlation, count)
        value = float(averages.mean())
        covered.append(abs(value) <= uncertainty_of_mean(averages, value).standard)
    assert 0.6 < np.mean(covered) < (0.84 if count == 10 else 0.8)  # 0.60 to 0.76, and two standard errors


@pytest.mark.parametrize("relaxation", [0.3, 0.6, 1.0, 2.0])
@pytest.mark.parametrize("noise", [0.0, 1e-3, 0.01])
def test_a_relaxing_mean_is_covered(relaxation, noise):
    time = (np.arange(12) + 0.5) / 12
    rng = np.random.default_rng(0)
    covered = []
    for _ in range(40):
        averages = np.exp(-time / relaxation) + noise * rng.normal(size=12)
        found = uncertainty_of_mean(averages, float(averages.mean()))
        assert found.change < 0 and found.standard < 4 * averages.mean()
        covered.append(averages.mean() <= found.standard)
    assert np.mean(covered) > 0.68


def test_growth_that_does_not_level_off_leaves_the_mean_unknown():
    assert uncertainty_of_mean(np.exp(0.3 * np.arange(10)), 1.0).standard == math.inf
    assert uncertainty_of_mean(np.array([1.0, 1.2]), 1.1).standard == math.inf


def test_a_constant_is_certain_and_units_do_not_matter():
    assert uncertainty_of_mean(np.full(6, 3.0), 3.0).standard == 0.0
    assert uncertainty_of_mean(np.zeros(6), 0.0).standard == 0.0
    averages = np.random.default_rng(0).normal(size=9)
    small = uncertainty_of_mean(1e-200 * averages, 1e-200 * float(averages.mean()))
    assert small.standard == pytest.approx(1e-200 * uncertainty_of_mean(averages, float(averages.mean())).standard)


def test_a_line_is_a_trend_and_noise_is_not():
    rng = np.random.default_rng(0)
    assert trend(np.arange(10.0)) == pytest.approx(9.0)
    assert np.mean([trend(rng.normal(size=12)) != 0 for _ in range(400)]) < 0.06
    assert trend(np.array([1.0, 2.0, 3.0])) == pytest.approx(2.0)
    assert trend(np.array([1.0, 2.0])) == 0.0


@pytest.mark.parametrize("name", [name for name in ESTIMATED if "10" in name or "steady" in name])
def test_coverage_of_whole_records(name):
    end, signal = ESTIMATED[name]
    found = [measured(signal, end, seed)[1] for seed in range(40)]
    covered = np.mean([abs(mean - SETTLED) <= mean.uncertainty for mean in found])
    assert 0.45 < covered < 0.95  # within three standard errors; it was 0.2 with correlated periods


def test_a_drag_that_relaxes_says_so_and_is_covered():
    time = np.arange(0, 40, 0.005)
    drag = 1.3 + 0.2 * np.exp(-time / 20)
    window = averages.averaging_window(time, drag, 0 * time)
    mean = averages.mean(time, drag, window)
    assert window.developing and mean.developing
    assert abs(mean - 1.3) < mean.uncertainty < 0.1
    assert "still developing (drag changes by" in mean.note and str(mean).endswith("(still developing)")


@pytest.mark.parametrize("signal", [relaxing, drifting])
def test_signals_that_relax_are_covered(signal):
    found = [measured(signal, 40, seed)[1] for seed in range(20)]
    assert np.mean([mean.developing for mean in found]) > 0.8
    assert np.mean([abs(mean - SETTLED) <= mean.uncertainty for mean in found]) > 0.68


def test_growing_shedding_has_no_settled_mean_yet():
    for seed in range(10):
        window, mean, strouhal = measured(growing, 25, seed)
        assert window.developing and mean.developing and not window.settled
        assert mean.uncertainty == math.inf
        assert "± unknown (still developing)" in str(mean)
        assert math.isnan(strouhal) or strouhal.developing


def test_shedding_that_has_settled_does_not_develop():
    for seed in range(10):
        window, mean, strouhal = measured(
            lambda _, t: (SETTLED + transient(t) + shedding(t)[0], shedding(t)[1]), 60, seed
        )
        assert window.settled and not window.developing and not mean.developing
        assert abs(mean - SETTLED) < 3e-3 and mean.uncertainty < 3e-3
        assert strouhal == pytest.approx(0.2, rel=1e-3) and strouhal.uncertainty < 1e-3


def noise(kind):
    def signal(rng, time):
        drag = SETTLED - 0.5 * np.exp(-time / 3) + 0.01 * rng.normal(size=len(time))
        samples = rng.normal(size=len(time))
        if kind == "round-off":
            return drag, 1e-13 * np.sin(2 * np.pi * 0.2 * time)
        if kind == "fast":
            return drag, 0.1 * np.sin(2 * np.pi * 1.66 * time)
        if kind == "steps":
            return drag, 0.1 * np.where(np.arange(len(time)) % 4 < 2, 1.0, -1.0)
        return drag, 0.1 * gaussian_filter1d(samples, float(kind) / 0.01) * math.sqrt(float(kind) / 0.01)

    return signal


@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        ("round-off", "less than 0.001 of the drag"),
        ("fast", "faster than a wake"),
        ("steps", "no regular shedding found"),
        ("0.03", "no regular shedding found"),
        ("0.1", "no regular shedding found"),
        ("1", "no regular shedding found"),
    ],
)
def test_noise_has_no_strouhal_number(kind, reason):
    found = [measured(noise(kind), 30, seed) for seed in range(8)]
    assert np.mean([window.periods > 0 for window, _, _ in found]) < 0.2
    window, mean, strouhal = next(each for each in found if each[0].periods == 0)
    assert reason in window.rule
    assert math.isnan(strouhal) and reason in strouhal.note
    assert window.start == pytest.approx(15, abs=0.5)
    assert mean == pytest.approx(SETTLED, rel=5e-3)


def test_a_thin_body_may_shed_faster_by_its_unit_of_length():
    def airfoil(rng, time):
        return 0.2 + 0 * time, 0.6 + 0.03 * np.sin(2 * np.pi * 1.3 * time) + 0.005 * rng.normal(size=len(time))

    assert measured(airfoil, 20, 0, thickness=0.2)[2] == pytest.approx(1.3, rel=0.01)
    assert math.isnan(measured(airfoil, 20, 0)[2])


def test_shedding_is_found_through_noise_from_step_to_step():
    def noisy(rng, time):
        drag, lift = shedding(time)
        return SETTLED + drag + 0.2 * rng.normal(size=len(time)), lift + 0.2 * rng.normal(size=len(time))

    window, _, strouhal = measured(noisy, 60, 0)
    assert window.periods >= 9 and strouhal == pytest.approx(0.2, rel=0.01)


def test_smoothing_keeps_lines_and_leaves_out_the_ends():
    time = times(np.random.default_rng(0), 5)
    inside, line = smoothed(time, 1 + 2 * time, 0.4)
    assert inside[0] >= time[0] + 0.2 and inside[-1] <= time[-1] - 0.2
    assert line == pytest.approx(1 + 2 * inside, abs=1e-3)


@pytest.fixture(scope="module")
def developing(tmp_path_factory):
    """A run whose shedding has just begun to grow."""
    return Run(write_run(tmp_path_factory.mktemp("runs") / "early", end=13.0))


def test_what_still_develops_is_said_wherever_it_is_shown(developing):
    run = developing
    assert run.window.developing and run.drag.mean.developing
    summary = {name: str(value) for name, value in run.summary().items()}
    assert summary["averaging rule"].startswith("still developing (")
    assert summary["mean drag coefficient"].endswith("(still developing)")
    assert "still developing" in run.plot_forces().axes[0].get_title("left")
    assert "still developing" in pressure_coefficient(run.pressure_coefficient).axes[0].get_title()
    assert "still developing" in plotting.spectrum({"a": run}).axes[0].get_legend().get_texts()[0].get_text()
    row = Row(Entry("cylinder", (10,), 13.0), 10, Measure("mean drag coefficient", run.drag.mean, 1.5, 0.02))
    assert row.cells[-1].endswith("(still developing)")


@pytest.mark.parametrize("start", [1e-5, 1e-3, 0.02])
def test_a_lift_that_grows_makes_the_drag_before_it_unknown(start):
    time = np.arange(0, 25, 0.005)
    lift = start * np.exp(0.2 * time) * np.sin(2 * np.pi * 0.2 * time)
    window = averages.averaging_window(time, 1.2 + 0.1 * lift**2, lift)
    mean = averages.mean(time, 1.2 + 0.1 * lift**2, window)
    assert window.growing and mean.developing and mean.uncertainty == math.inf


def test_a_slow_beat_or_a_tiny_drift_leaves_the_mean_known():
    time = np.arange(0, 60, 0.008)
    beat = np.sin(2 * np.pi * time / 150 - 2)
    drag, lift = 1.48 + 0.01 * beat, 0.5 * (1 + 0.02 * beat) * np.sin(0.4 * np.pi * time)
    mean = averages.mean(time, drag, averages.averaging_window(time, drag, lift))
    assert mean.developing and abs(mean - 1.48) < mean.uncertainty < 0.1
    drag = 1.48 + 1e-6 * np.exp(time / 30)
    mean = averages.mean(time, drag, averages.averaging_window(time, drag, 0 * time))
    assert not mean.developing and mean.uncertainty < 1e-3


def test_round_off_that_wanders_is_no_development():
    time = np.arange(0, 40, 0.01)
    wander = 1e-13 * np.cumsum(np.random.default_rng(0).normal(size=len(time)))
    window = averages.averaging_window(time, 1.3 + 0 * time, wander)
    assert not window.developing and window.periods == 0


def test_tables_say_what_still_develops():
    early = averages.Estimate(1.25, math.inf, "still developing (lift grows)")
    found = grid_convergence("mean drag coefficient", [10, 20, 40], [1.5, 1.3, early])
    nothing = SimpleNamespace(rows=[], states=[], symbols=GENERAL)
    assert "1.25 (still developing)" in str(convergence.Report(None, nothing, [found]))
    assert str(early) == "1.25 ± unknown (still developing)"
    assert str(averages.Estimate(1.25, math.inf, "too few periods")) == "1.25 ± unknown"
