"""Autotune: the step that it finds is the stability law's, and its case runs."""

import math

import pytest
from alsph import config
from alsph.cases import StandingWave, StillWater, TaylorGreen
from alsph.errors import ConfigError
from alsph.study.autotune import autotune


@pytest.fixture(scope="module")
def tuning():
    case = TaylorGreen(resolution=16, max_iterations=5, projection_sweeps=0, penalty_constant=100.0)
    return autotune(case, 5e-3, develop=0.2, probe=0.3, threads=1, progress=False)


def test_the_largest_stable_step_is_near_the_stability_law(tuning):
    law = tuning.case.time_step_limits()["penalty"]
    assert 0.6 * law < tuning.largest_stable < 1.6 * law
    assert tuning.largest_stable < tuning.smallest_unstable <= tuning.largest_stable * 2**0.5 * 1.001
    assert not any(probe.stable for probe in tuning.probes if probe.time_step >= tuning.smallest_unstable)


def test_the_cheapest_probe_that_is_good_enough_is_taken(tuning):
    largest = 0.9 * tuning.largest_stable
    tried = [p for p in tuning.probes if p.stable and p.time_step <= largest]
    low = [p for p in tried if p.divergence <= tuning.target]
    good = [p for p in low if p.time_step == largest] or low
    assert tuning.reached == bool(good)
    best = min(good, key=lambda p: p.cost) if good else min(tried, key=lambda p: p.divergence)
    chosen = tuning.case.time_step, tuning.case.max_iterations, tuning.case.projection_sweeps
    assert chosen == (best.time_step, best.max_iterations, best.projection_sweeps)


def test_report_and_case_are_saved(tuning, tmp_path):
    tuning.save(tmp_path / "tuned")
    assert config.load(tmp_path / "tuned" / "case.toml").case == tuning.case
    assert str(tuning) in (tmp_path / "tuned" / "report.md").read_text()


def test_a_target_out_of_reach_gives_the_least_divergence():
    case = TaylorGreen(resolution=12, max_iterations=2, projection_sweeps=0)
    tuning = autotune(case, 1e-9, develop=0.1, probe=0.1, threads=1, progress=False)
    tried = [p for p in tuning.probes if p.stable and p.time_step <= 0.9 * tuning.largest_stable]
    least = min(tried, key=lambda p: p.divergence)
    assert not tuning.reached and least.time_step < 0.9 * tuning.largest_stable
    assert (tuning.case.time_step, tuning.case.max_iterations) == (least.time_step, least.max_iterations)


def test_a_shorter_step_is_taken_where_it_alone_is_good_enough():
    case = TaylorGreen(resolution=12, max_iterations=2, projection_sweeps=0)
    out_of_reach = autotune(case, 1e-9, develop=0.1, probe=0.1, threads=1, progress=False)
    least = min(p.divergence for p in out_of_reach.probes if p.stable)
    tuning = autotune(case, least, develop=0.1, probe=0.1, threads=1, progress=False)
    assert tuning.reached and tuning.case.time_step < 0.9 * tuning.largest_stable


@pytest.mark.parametrize("number", [0, -1, math.nan, math.inf])
@pytest.mark.parametrize("name", ["divergence", "develop", "probe", "margin"])
def test_numbers_that_cannot_be_used_are_refused(name, number):
    arguments = {"divergence": 1e-3} | {name: number}
    with pytest.raises(ConfigError, match=name):
        autotune(TaylorGreen(), progress=False, **arguments)


def test_water_at_rest_is_not_tuned():
    """What it creeps with is the scheme's doing, which a step that doubles it is not unstable for."""
    with pytest.raises(ConfigError, match=r"still_water: nothing moves, u_max is .* √\(gH\) at t\* = 1"):
        autotune(StillWater(resolution=12), develop=1.0, threads=1, progress=False)


def test_a_wave_that_grows_from_a_standstill_is_not_unstable():
    """Velocities are judged beside those of waves, as the Courant number is; u_max is far below and doubles."""
    tuning = autotune(StandingWave(resolution=8), 0.1, develop=0.1, probe=0.5, margin=0.5, threads=1, progress=False)
    assert 0.2 < tuning.largest_stable <= 1
    assert all(probe.stable for probe in tuning.probes if probe.time_step <= 0.4 and probe.projection_sweeps)
    table = [line for line in str(tuning).splitlines() if line.startswith("|")]
    assert "Δt√(gH)/Δx" in table[0] and len({*map(len, table)}) == 1
