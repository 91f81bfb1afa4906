import csv
import math

import numpy as np
import pytest
from alsph import Run, reference
from alsph.analysis.measures import Measure
from alsph.cases import Cylinder, Sphere, TaylorGreen
from synthetic import DRAG, LIFT, STROUHAL, write_run

FORCES = list(reference.COLUMNS)


@pytest.fixture(scope="module")
def shedding(tmp_path_factory):
    """Return a synthetic run in the channel whose reference is known."""
    return Run(write_run(tmp_path_factory.mktemp("runs") / "channel", Cylinder(resolution=8), end=30.0))


def begun(case, folder):
    """Return a run that has hardly begun."""
    return case.run(folder / "run", until=1e-6, progress=False)


@pytest.mark.parametrize("reynolds", [100, 200])
def test_the_default_channel_has_a_reference(reynolds):
    found = reference.cylinder_in_channel(reynolds)
    with (reference.FOLDER / "cylinder_summary.csv").open() as file:
        row = next(row for row in csv.DictReader(file) if row["Re"] == str(reynolds))
    assert found.results["mean drag coefficient"] == float(row["CD_mean"]) == pytest.approx(1.5, abs=0.02)
    assert found.results["Strouhal number"] == float(row["St_fD_over_U"])
    parts = (found.results[f"mean drag coefficient, {part} part"] for part in ("pressure", "viscous"))
    assert sum(parts) == pytest.approx(found.results["mean drag coefficient"], rel=1e-3)
    theta, mean = found.pressure_coefficient
    assert (theta[0], theta[-1], len(mean)) == (0, 180, len(theta))
    assert mean[0] == pytest.approx(float(row["Cp_stag_inletmean"]), abs=1e-4)
    assert mean[-1] == pytest.approx(float(row["Cp_base_inletmean"]), abs=1e-4)
    assert reference.cylinder_in_channel(150) is None


def test_measures_of_a_cylinder_stand_beside_the_reference(shedding):
    measures = {measure.name: measure for measure in shedding.measures}
    expected = reference.cylinder_in_channel(200)
    assert [measures[name].reference for name in FORCES] == [expected.results[name] for name in FORCES]
    assert measures["mean drag coefficient"].value == pytest.approx(DRAG, rel=2e-3)
    assert measures["mean drag coefficient"].passed
    assert measures["rms lift coefficient"].value == pytest.approx(LIFT / math.sqrt(2), rel=5e-3)
    assert measures["Strouhal number"].error == pytest.approx(STROUHAL / 0.209528 - 1, abs=3e-3)
    assert not measures["mean drag coefficient, viscous part"].passed


def test_error_of_the_pressure_coefficient_leaves_out_the_stagnation_point(shedding):
    (profile,) = shedding.profiles
    (theta, computed), (_, expected) = profile.computed, profile.reference
    assert computed == pytest.approx(1 - 2 * np.sin(np.radians(theta)) ** 2, abs=1e-9)
    measure = shedding.measures[-1]
    assert measure.value == pytest.approx(np.abs(computed - expected)[3:].max())
    assert (measure.reference, measure.passed) == (0.0, False)
    assert shedding.plot_pressure_coefficient().axes[0].lines[-1].get_ydata() == pytest.approx(expected)


@pytest.mark.parametrize("case", [Cylinder(resolution=8, reynolds=150), Cylinder(resolution=8, height=14)])
def test_other_flows_have_none(case, tmp_path):
    run = Run(write_run(tmp_path / "run", case, end=1.0))
    assert [measure.name for measure in run.measures] == FORCES
    assert all(math.isnan(measure.reference) for measure in run.measures)
    assert not any(profile.reference[0].size for profile in run.profiles)


def test_a_wide_domain_is_compared_with_the_unconfined_cylinder():
    wide = Cylinder(reynolds=100, height=60, upstream=20, length=50)
    assert wide._reference().results["mean drag coefficient"] == 1.317
    assert wide.replace(height=40)._reference() is None
    assert wide.replace(upstream=10)._reference() is None


def test_summary_shows_the_reference(shedding):
    summary = shedding.summary()
    names = list(summary)
    for name in FORCES:
        assert names[names.index(name) + 1] == f"{name}, reference"
        assert summary[f"{name}, reference"] == reference.cylinder_in_channel(200).results[name]


def test_taylor_green_in_2d_is_judged_by_the_exact_solution(tmp_path):
    run = TaylorGreen(resolution=20).run(tmp_path / "run", until=0.1, progress=False)
    rate, error = run.measures
    assert rate.reference == pytest.approx(0.16 * math.pi**2)
    assert rate.value == pytest.approx(rate.reference, rel=0.05)
    assert 1e-4 < error.value < 0.05
    assert run.summary()[f"{rate.name}, reference"] == rate.reference
    assert f"{error.name}, reference" not in run.summary()
    (profile,) = run.profiles
    assert profile.computed[1] == pytest.approx(profile.reference[1], rel=0.02)


def test_taylor_green_in_3d_starts_with_the_exact_decay_rate(tmp_path):
    run = TaylorGreen(dimensions=3, resolution=12).run(tmp_path / "run", until=0.06, progress=False)
    rate, error = run.measures
    assert rate.reference == pytest.approx(0.24 * math.pi**2)
    assert rate.value == pytest.approx(rate.reference, rel=0.15)
    assert 0 < error.value < 0.02
    other = TaylorGreen(dimensions=3, resolution=8, reynolds=50).run(tmp_path / "other", until=0.02, progress=False)
    assert len(other.measures) == 1 and other.profiles == []


def test_the_spectral_solution_keeps_the_energy_balance():
    time, energy, enstrophy = reference.table("taylor_green_3d_Re100.csv")
    assert energy[0] == 1 / 8
    assert enstrophy[0] == pytest.approx(1.5 * math.pi**2)
    assert np.gradient(energy, time)[1:-1] == pytest.approx(-0.02 * enstrophy[1:-1], rel=2e-3)


def test_measures_of_runs_that_have_hardly_begun(tmp_path):
    for case in (TaylorGreen(resolution=8), TaylorGreen(resolution=8, dimensions=3)):
        run = begun(case, tmp_path / str(case.dimensions))
        assert math.isnan(run.measures[0].value) and not run.measures[0].passed
        (run.path / "history.csv").unlink()
        (run.path / "particles.vtkhdf").unlink()
        again = Run(run.path)
        assert math.isnan(again.measures[0].value) and again.summary()["steps"] == 0


def test_a_measure_passes_within_its_tolerance():
    assert Measure("drag", 1.01, 1.0, 0.02).passed and not Measure("drag", 1.03, 1.0, 0.02).passed
    assert Measure("lift", -1.1, -1.0, 0.2).error == pytest.approx(-0.1)
    assert Measure("error", 0.03, 0.0, 0.05).error == 0.03
    assert not Measure("drag", math.nan, 1.0, 0.02).passed and not Measure("drag", 1.0).passed


def test_a_sphere_is_compared_in_its_own_channel():
    case = Sphere(quarter=True)
    known = case._reference().results
    parts = known["mean drag coefficient, pressure part"] + known["mean drag coefficient, viscous part"]
    assert known["mean drag coefficient"] == pytest.approx(parts, abs=2e-5) == pytest.approx(1.133, abs=1e-3)
    assert case.replace(height=10, width=10)._reference().results["mean drag coefficient"] < parts
    assert case.replace(length=10)._reference() is case.replace(reynolds=99)._reference() is None
    assert case.replace(quarter=False, body_offset=0.5)._reference() is None


def test_a_row_is_found_by_what_is_given():
    given = {"flow": "developed", "Re": 100, "speed": 1.0}
    known = reference.matching("rotating_cylinder.csv", given)
    assert known["speed"] == 1 and known["CL_rms"] > 0 and "flow" not in known
    assert math.isnan(reference.matching("rotating_cylinder.csv", given | {"flow": "start"})["CL_rms"])
    assert reference.matching("rotating_cylinder.csv", given | {"flow": "neither"}) == {}
    assert reference.matching("rotating_cylinder.csv", given | {"speed": 1.01}) == {}
