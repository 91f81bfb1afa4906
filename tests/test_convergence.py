"""Grid convergence: exact sequences, what is no convergence, and a case."""

import math

import alsph
import numpy as np
import pytest
from alsph.analysis.averages import Estimate
from alsph.cases import Cylinder, TaylorGreen
from alsph.config import Config, RunSettings
from alsph.errors import ConfigError
from alsph.study import convergence
from alsph.study.convergence import _no_order, converge, grid_convergence
from hypothesis import given, settings
from hypothesis import strategies as st


@given(
    order=st.floats(0.3, 5.0),
    limit=st.floats(-10, 10).filter(lambda x: abs(x) > 0.1),
    slope=st.floats(0.1, 5.0),
    ratios=st.tuples(st.floats(1.2, 2.5), st.floats(1.2, 2.5)),
)
@settings(deadline=None)  # the first one loads scipy
def test_order_and_limit_of_a_power_law_are_recovered_at_any_ratios(order, limit, slope, ratios):
    resolutions = [10.0, 10 * ratios[0], 10 * ratios[0] * ratios[1]]
    found = grid_convergence("f", resolutions, [limit + slope * (10 / n) ** order for n in resolutions])
    assert found.kind == "monotonic"
    assert found.order == pytest.approx(order, rel=1e-4)
    assert found.richardson == pytest.approx(limit, abs=1e-4)
    error = abs(found.values[-1] - limit)
    assert found.index * abs(found.values[-1]) == pytest.approx(1.25 * error, rel=1e-3)


@pytest.mark.parametrize(
    ("values", "kind"), [([1, 2, 1.5], "oscillating"), ([1, 2, 4], "diverging"), ([1, math.nan, 4], "unknown")]
)
def test_what_is_no_monotonic_convergence_has_no_order(values, kind):
    found = grid_convergence("f", [10, 20, 40], values)
    assert found.kind == kind and math.isnan(found.order) and math.isnan(found.richardson)


def test_errors_have_an_order_and_no_relative_index():
    found = grid_convergence("error", [10, 20, 40], [0.16, 0.04, 0.01], reference=0.0)
    assert found.order == pytest.approx(2) and math.isnan(found.index)


def test_too_few_or_unordered_resolutions_are_refused():
    with pytest.raises(ConfigError, match="three"):
        grid_convergence("f", [10, 20], [1, 2])
    with pytest.raises(ConfigError, match="increase"):
        grid_convergence("f", [10, 40, 20], [1, 2, 3])
    with pytest.raises(ConfigError, match="three or more"):
        converge(Config(TaylorGreen()), [10, 20, 20])


def test_a_case_is_run_judged_and_drawn(tmp_path):
    config = Config(TaylorGreen(reynolds=50), RunSettings(until=0.1, output_interval=0.05))
    report = converge(config, [12, 8, 16], tmp_path, progress=False)
    rate = next(found for found in report.convergences if found.name.startswith("decay rate"))
    assert rate.resolutions == (8, 12, 16) and len(rate.values) == 3
    assert rate.reference == pytest.approx(16 * math.pi**2 / 50)
    text = (report.path / "convergence.md").read_text()
    assert str(report) in text and "convergence.png" in text
    assert (report.path / "convergence.png").stat().st_size > 10_000
    assert convergence.SAFETY == 1.25
    other = converge(config, [8, 10, 12], tmp_path, progress=False)
    assert (report.path / "convergence.md").read_text() == text
    assert {row["folder"] for row in report.results.rows if row["resolution"] < 16} < {
        row["folder"] for row in other.results.rows
    }


def test_a_measure_that_is_nan_is_told_with_its_run_and_why(tmp_path):
    config = Config(Cylinder(length=5, height=4, upstream=2), RunSettings(until=0.05))
    report = converge(config, [8, 10, 12], tmp_path, progress=False)
    strouhal = next(found for found in report.convergences if found.name == "Strouhal number")
    assert strouhal.kind == "unknown"
    folder = report.results.rows[0]["folder"]
    (gap,) = [gap for gap in report.gaps if gap.startswith(f"D/Δx = 8, {folder}: no ")]
    assert "Strouhal number" in gap and gap.endswith(strouhal.values[0].note) and f"- {gap}" in str(report)
    assert report.gaps[0] in (report.path / "convergence.md").read_text()


@pytest.mark.parametrize(
    ("errors", "kind", "order"),
    [
        ([0.30, 0.265, 0.23], "monotonic", math.log(0.265 / 0.23) / math.log(20 / 14)),
        ([0.12249, 0.014977, 0.0054354], "monotonic", 2.842),
        ([-0.4, -0.1, -0.05], "monotonic", 1.943),
        ([0.4, 0.1, -0.05], "oscillating", math.nan),
        ([0.4, 0.1, 0.2], "oscillating", math.nan),
        ([0.1, 0.2, 0.3], "diverging", math.nan),
    ],
)
def test_the_order_of_an_error_is_that_at_which_the_last_two_go_to_zero(errors, kind, order):
    found = grid_convergence("error", [10, 14, 20], errors, 0.0)
    assert found.kind == kind and found.order == pytest.approx(order, rel=1e-3, nan_ok=True)
    assert math.isnan(found.richardson) and math.isnan(found.index)


def test_changes_within_their_uncertainties_tell_no_order():
    values = [Estimate(1.52, 0.05), Estimate(1.50, 0.05), Estimate(1.4917, 0.05)]
    found = grid_convergence("mean drag coefficient", [10, 14, 20], values)
    assert found.kind == "within ±" and np.isnan([found.order, found.richardson, found.index]).all()
    sharp = grid_convergence("mean drag coefficient", [10, 14, 20], [Estimate(value, 1e-3) for value in values])
    values[1] = Estimate(1.50, math.inf)  # which goes on to change, and tells nothing
    assert grid_convergence("mean drag coefficient", [10, 14, 20], values).kind == "unknown"
    assert sharp.kind == "monotonic" and sharp.order == pytest.approx(2.72, abs=0.01)


def test_what_is_no_ladder_or_case_is_said(tmp_path):
    vortex = TaylorGreen()
    for arguments, message in (
        (("taylor_green", [8, 9, 10]), "config = 'taylor_green': must be a case such as"),
        ((vortex, 8), "resolutions = 8: must be a list of whole numbers"),
        ((vortex, ["8", 9, 10]), "resolutions = '8': must be a whole number, 1 or more"),
        ((vortex, [8, 9, 9]), "convergence needs three or more"),
    ):
        with pytest.raises(ConfigError, match=message):
            converge(*arguments, output=tmp_path, progress=False)
    with pytest.raises(ConfigError, match="resolutions = 20: must be a list"):
        alsph.validate("taylor_green", resolutions=20, output=tmp_path, progress=False)
    with pytest.raises(ConfigError, match="resolutions = 8: must be a list"):
        alsph.compare_schemes(vortex, ["alsph", "isph"], 8, output=tmp_path, progress=False)
    for wrong, message in (
        ({"study": None}, "study = None: must be the name of a study"),
        ({"jobs": "1"}, "jobs = '1': must be a whole number"),
        ({"threads": "1"}, "threads = '1': must be a whole number"),
        ({"walltime": "1:00"}, r"walltime = '1:00': must be a number above zero \[s\]"),
    ):
        with pytest.raises(ConfigError, match=message):
            alsph.study.run(**{"study": "reynolds", "output": tmp_path / "none", "progress": False} | wrong)
    with pytest.raises(ConfigError, match="two run folders or more"):
        alsph.compare(path for path in ())


@pytest.mark.parametrize(
    ("values", "reference", "told"),
    [((1.0, 2.0, 2.0), 1.0, "the last two are the same"), ((1.0, 1.9, 1.901), 1.0, "faster than Δx^8")],
)
def test_why_there_is_no_order_is_said(values, reference, told):
    found = grid_convergence("a", (8, 16, 32), values, reference)
    assert found.kind == "monotonic" and math.isnan(found.order)
    assert _no_order(found) == told
    assert not _no_order(grid_convergence("a", (8, 16, 32), (1.0, 1.75, 1.9375)))
