import csv
import math

import pytest
from alsph import reference
from alsph.cases import Cylinder, TaylorGreen
from alsph.config import Config


def tables(case):
    return Config(case).tables()


@pytest.mark.parametrize("reynolds", [100, 200])
def test_the_default_channel_has_a_reference(reynolds):
    found = reference.find(tables(Cylinder(reynolds=reynolds)))
    with (reference.FOLDER / "cylinder_summary.csv").open() as file:
        row = next(row for row in csv.DictReader(file) if row["Re"] == str(reynolds))
    assert found.results["mean drag coefficient"] == float(row["CD_mean"]) == pytest.approx(1.5, abs=0.02)
    assert found.results["Strouhal number"] == float(row["St_fD_over_U"])
    theta, mean = found.pressure_coefficient
    assert (theta[0], theta[-1], len(mean)) == (0, 180, len(theta))
    assert mean[0] == pytest.approx(float(row["Cp_stag_inletmean"]), abs=1e-4)
    assert mean[-1] == pytest.approx(float(row["Cp_base_inletmean"]), abs=1e-4)


@pytest.mark.parametrize(
    "case", [Cylinder(reynolds=150), Cylinder(height=14), Cylinder(upstream=5), TaylorGreen(dimensions=3)]
)
def test_other_flows_have_none(case):
    assert reference.find(tables(case)) is None


def test_taylor_green_decays_as_the_exact_solution():
    found = reference.find(tables(TaylorGreen(reynolds=100)))
    assert found.results == {"decay rate of the kinetic energy, U/D": pytest.approx(0.16 * math.pi**2)}
    assert found.pressure_coefficient is None


def test_summary_and_figure_show_the_reference(tmp_path):
    run = Cylinder(resolution=8).run(tmp_path / "run", until=0.01, progress=False)
    names = list(run.summary())
    for name, value in run.reference.results.items():
        assert names[names.index(name) + 1] == f"{name}, reference"
        assert run.summary()[f"{name}, reference"] == value
    lines = run.plot_pressure_coefficient().axes[0].lines
    assert lines[-1].get_label() == "reference"
    assert lines[-1].get_ydata() == pytest.approx(run.reference.pressure_coefficient[1])


def test_summary_of_taylor_green_tells_the_decay_rate(tmp_path):
    run = TaylorGreen(resolution=20).run(tmp_path / "run", until=0.1, progress=False)
    name = "decay rate of the kinetic energy, U/D"
    assert run.summary()[name] == pytest.approx(run.summary()[f"{name}, reference"], rel=0.05)
