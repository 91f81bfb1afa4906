import math
import re
import tomllib
import warnings

import alsph
import numpy as np
import pytest
from alsph import config
from alsph.analysis.averages import Estimate
from alsph.cases import BackwardFacingStep, Cylinder, SettlingSphere, Sphere, TaylorGreen
from alsph.errors import ConfigError
from alsph.results.dimensional import dimensional
from alsph.running.describe import describe
from alsph.running.start import complete
from alsph.study.declaration import digest
from alsph.units import QUANTITIES, Units
from hypothesis import given
from hypothesis import strategies as st

WATER = {"length": 0.02, "velocity": 0.01, "density": 1000.0, "kinematic_viscosity": 1e-6}  # Re = 200
POSITIVE = st.floats(1e-12, 1e12)
SMALL = {"resolution": 8, "length": 5.0, "height": 4.0, "upstream": 2.0}


@given(values=st.tuples(POSITIVE, POSITIVE, POSITIVE, POSITIVE))
def test_the_factors_agree_with_each_other(values):
    units = Units(**dict(zip(WATER, values, strict=True)))
    length, velocity, density, viscosity = values
    of = {name: units.factor(name) for name in QUANTITIES}
    for one, other in (
        (of["length"], length),
        (of["velocity"], velocity),
        (of["velocity"] * of["time"], of["length"]),
        (of["acceleration"] * of["time"], of["velocity"]),
        (of["frequency"] * of["time"], 1.0),
        (of["rate"], of["frequency"]),
        (of["pressure"], density * velocity**2),
        (of["force"], of["pressure"] * of["length"] ** 2),
        (of["force_per_length"] * of["length"], of["force"]),
        (of["moment_per_length"], of["force_per_length"] * of["length"]),
        (of["force"], density * of["length"] ** 3 * of["acceleration"]),  # Newton's second law
        (units.reynolds * viscosity, of["velocity"] * of["length"]),
    ):
        assert math.isclose(one, other, rel_tol=1e-11)


def test_the_reynolds_number_follows_and_the_flow_is_the_same():
    case, plain = Cylinder(units=Units(**WATER), **SMALL), Cylinder(reynolds=200.0, **SMALL)
    assert case.reynolds == 200.0 and case.settings() == plain.settings()
    assert digest(config.Config(case)) == digest(config.Config(plain))
    assert case.kinematic_viscosity == pytest.approx(1e-6 / (0.01 * 0.02))
    assert Cylinder(units=WATER, **SMALL) == case == case.replace(resolution=9).replace(resolution=8)


def test_another_length_of_the_reynolds_number():
    """Re = 2hU/ν behind a step of h = D/(E - 1)."""
    step = BackwardFacingStep(units=WATER, expansion=3.0)
    assert step.reynolds == pytest.approx(200.0) and step.kinematic_viscosity == pytest.approx(1 / 200)
    assert BackwardFacingStep(units=WATER).reynolds == pytest.approx(400)


class Hidden(TaylorGreen):
    """Forms Re otherwise and says so in the wrong place."""

    @property
    def kinematic_viscosity(self) -> float:
        return 2 / self.reynolds


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (
            {"reynolds": 100},
            "reynolds = 100: the units (D = 0.02 m, U = 0.01 m/s, ρ = 1000 kg/m³, ν = 1e-06 m²/s)",
        ),
        ({"reynolds": 200.001}, "make it 200; leave one of the two out"),
        ({"units": WATER | {"velocity": 0}}, "units.velocity = 0: must be greater than 0 (reference velocity U [m/s])"),
        ({"units": WATER | {"length": -1.0}}, "units.length = -1.0: must be greater than 0"),
        ({"units": WATER | {"density": math.nan}}, "units.density = nan: must be a finite number"),
        ({"units": WATER | {"density": math.inf}}, "units.density = inf: must be a finite number"),
        ({"units": WATER | {"density": "1000"}}, "units.density = '1000': must be a number, without quotes"),
        ({"units": WATER | {"lenght": 1}}, "units.lenght: unknown parameter; did you mean 'length'?"),
        ({"units": {"length": 1}}, "units.velocity: is missing; units.density: is missing; units.kinematic_viscosity"),
        ({"units": {}}, "units.length: is missing"),
        ({"units": {1: 2.0}}, "units.1: unknown parameter"),
        ({"units": 3}, "units: must be alsph.Units, or a table of length, velocity, density, kinematic_viscosity"),
        ({"units": WATER | {"velocity": 1e-200}}, "units: what follows from them is too large or too small"),
        ({"units": WATER | {"length": 1e300}}, "units.length: too large"),
        ({"units": WATER, "height": 1.0}, "height = 1: the cylinder does not fit"),
    ],
)
def test_what_cannot_be_is_told(changes, told):
    with pytest.raises(ConfigError, match=re.escape(told)) as caught:
        Cylinder(**{"units": WATER} | SMALL | changes)
    assert "\n" not in str(caught.value)


def test_a_case_that_hides_its_length_is_told():
    with pytest.raises(ConfigError, match="forms its Reynolds number with another length .* override that, not"):
        Hidden(units=WATER)


def test_mistakes_beyond_three_are_counted_as_they_are():
    with pytest.raises(ConfigError, match="units.density: is missing; and 1 more$"):
        Cylinder(units={"length": 0.01, "velocity": 0.02, "rho": 998, "nu": 1e-6})


def test_changes_of_a_case_with_units():
    case = Cylinder(units=WATER, **SMALL)
    faster = case.replace(units=WATER | {"velocity": 0.02})
    assert (faster.reynolds, faster.units.velocity) == (400, 0.02)
    assert (case.replace(units=None).reynolds, case.replace(units=None, reynolds=50).units) == (200, None)
    with pytest.raises(ConfigError, match="reynolds = 50: the units .* make it 200"):
        case.replace(reynolds=50)
    assert case.replace(reynolds=200.0 * (1 + 1e-9)).reynolds != 200  # rounding, as given


def test_files_and_options(tmp_path, alsph):
    path = tmp_path / "my.toml"
    table = "\n".join(f"{name} = {value}" for name, value in WATER.items())
    path.write_text(f'case = "cylinder"\nresolution = 8\n\n[units]\n{table}\n\n[run]\nuntil = 0.1\n')
    assert config.load(path).case.reynolds == 200
    assert tomllib.loads(config.load(path).text())["units"] == WATER
    code, told, _ = alsph("describe", path, "--units-velocity", 0.02, "--no-probe")
    assert code == 0 and re.search(r"Reynolds number +400\n", told)
    assert re.search(r"duration in SI +0.1 s\n", told) and re.search(r"time step in SI +0.025 s\n", told)
    code, _, told = alsph("describe", path, "--reynolds", 100, "--no-probe")
    assert code == 2 and "reynolds = 100: the units" in told
    code, _, told = alsph("describe", "cylinder", "--units-velocity", 0.02, "--no-probe")
    assert code == 2 and "give --units-length, --units-density, --units-kinematic-viscosity, too" in told


def test_describe_tells_seconds_only_with_units():
    lines = dict(describe(config.Config(Cylinder(**SMALL), config.RunSettings(until=3.0)), probe=False))
    assert not any("SI" in name or name == "units" for name in lines)
    lines = dict(describe(config.Config(Cylinder(units=WATER, **SMALL), config.RunSettings(until=3.0)), probe=False))
    assert lines["duration in SI"] == "6 s" and lines["units"].endswith("D/U = 2 s")


def test_a_run_tells_both_and_converts_later(tmp_path):
    run = Cylinder(units=WATER, **SMALL).run(tmp_path / "one", until=0.5, progress=False)
    plain = Cylinder(reynolds=200.0, **SMALL).run(tmp_path / "two", until=0.5, progress=False)
    assert run.history["time"].tolist() == plain.history["time"].tolist()
    assert (run.units, plain.units) == (Units(**WATER), None)
    told = run.summary()
    force = 1000 * 0.01**2 * 0.02  # ρU²D, N/m
    assert told["mean drag, N/m"] == pytest.approx(0.5 * force * told["mean drag coefficient"])
    assert told["mean drag, N/m"].uncertainty == pytest.approx(0.5 * force * run.drag.mean.uncertainty, nan_ok=True)
    assert told["time reached, s"] == pytest.approx(2 * run.history["time"][-1])
    # by hand: ∫ p n ds over the surface is the engine's pressure force
    newton = run.history["cylinder_pressure_force_x"][-1] * run.units.factor("force_per_length")
    assert 0.5 * force * run.coefficient("x", "pressure")[-1] == pytest.approx(newton)
    assert not any(", s" in name or name == "units" for name in plain.summary())
    with pytest.raises(ConfigError, match="its case has no units; use run.dimensional"):
        plain.dimensional()
    later = plain.dimensional(alsph.Units(**WATER))
    assert list(later) == list(run.dimensional()) and later["mean drag, N/m"] == told["mean drag, N/m"]
    with pytest.raises(ConfigError, match="reynolds = 200: the units .* make it 400"):
        plain.dimensional(alsph.Units(**WATER | {"velocity": 0.02}))


def test_units_change_no_run(tmp_path):
    """A finished run is used whatever its units, and one that was cut goes on without a warning."""
    case, settings = Cylinder(reynolds=200.0, **SMALL), config.RunSettings(until=0.1, threads=1)
    run = case.run(tmp_path / "run", until=0.1, threads=1, progress=False)
    made = (run.path / "history.csv").stat().st_mtime_ns
    complete(config.Config(case.replace(units=WATER), settings), run.path)
    assert (run.path / "history.csv").stat().st_mtime_ns == made
    air = {"length": 0.3, "velocity": 0.01, "density": 1.2, "kinematic_viscosity": 1.5e-5}
    file = run.path / "case.toml"
    file.write_text(file.read_text() + "\n[units]\n" + "".join(f"{name} = {value}\n" for name, value in air.items()))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = alsph.resume(run.path, until=0.2, progress=False)
    assert run.units == Units(**air) and "mean drag, N/m" in run.dimensional()


def test_names_of_results_in_si():
    units = Units(length=2.0, velocity=3.0, density=5.0, kinematic_viscosity=1.0)
    results = {
        "case": "x",
        "Reynolds number": Estimate(6.0),
        "resolution, D/Δx": 20,
        "time reached, tU/D": Estimate(3.0),
        "averaged from tU/D": Estimate(1.0),
        "mean velocity divergence, |∇·u| D/U": Estimate(1e-3),
        "mean drag coefficient, pressure part": Estimate(1.0, 0.1, "a note"),
        "mean lift coefficient of body_1": Estimate(2.0),
        "mean lift coefficient of body_1, reference": Estimate(3.0),
        "drag coefficient of body_1 over that of body_2": Estimate(0.5),
        "drag coefficient of Morison": Estimate(2.0),
        "largest error of the pressure coefficient beyond 10 degrees": Estimate(0.1),
        "mean pitching moment coefficient about c/4": Estimate(1.0),
        "Strouhal number": Estimate(0.2),
        "reattachment length, D": Estimate(6.0),
        "decay rate of the kinetic energy, U/D": Estimate(1.0),
        "largest v at y = D/2, U": Estimate(0.5),
        "pressure jump, ρU²": Estimate(1.0),
        "kinetic energy against the stream, ρU²D²/8": Estimate(1.0),
    }
    found = dimensional(results, units, 2, area=1.0, chord=0.5)
    assert found == pytest.approx(
        {
            "time reached, s": 2.0,
            "averaged from, s": 2 / 3,
            "mean drag, pressure part, N/m": 45.0,
            "mean lift of body_1, N/m": 90.0,
            "mean lift of body_1, reference, N/m": 135.0,
            "mean pitching moment about c/4, N m/m": 0.5 * 5 * 9 * 1.0,
            "shedding frequency, Hz": 0.3,
            "reattachment length, m": 12.0,
            "decay rate of the kinetic energy, 1/s": 1.5,
            "largest v at y = D/2, m/s": 1.5,
            "pressure jump, Pa": 45.0,
        }
    )
    drag = found["mean drag, pressure part, N/m"]
    assert (drag.uncertainty, drag.note) == (pytest.approx(4.5), "a note")
    in_space = dimensional(results, units, 3, area=0.5, chord=1.0)
    assert in_space["mean drag, pressure part, N"] == pytest.approx(45.0)


def test_forces_in_si_are_those_on_the_whole_body(tmp_path):
    case = Sphere(reynolds=100, resolution=8, length=3, height=3, width=3, upstream=1.25, quarter=True)
    run = case.run(tmp_path / "run", until=0.1, threads=1, progress=False)
    units = Units(**WATER | {"velocity": 0.005})
    force = run.drag.mean * 0.5 * 1000 * 0.005**2 * 0.02**2 * case.reference_area * 4
    assert run.dimensional(units)["mean drag, N"] == pytest.approx(force)


def test_wrong_quantities_are_told():
    with pytest.raises(ConfigError, match="quantity = 'presure': unknown; did you mean 'pressure'"):
        Units(**WATER).factor("presure")
    assert np.array([1.0, 2.0]) @ [1, 1] * Units(**WATER).factor("time") == pytest.approx(6.0)


def test_a_parameter_of_ones_own_may_not_have_the_name_of_an_option(tmp_path, alsph):
    text = "from alsph.cases import TaylorGreen\n\n\nclass Odd(TaylorGreen):\n    units_length: float = 1.0\n"
    (tmp_path / "odd.py").write_text(text)
    code, _, told = alsph("describe", tmp_path / "odd.py")
    assert code == 2 and "its parameter 'units_length' has the name of an option" in told


def test_a_settling_velocity_is_in_si():
    name = SettlingSphere.later_names[0]
    units = Units(length=0.01, velocity=0.2, density=1000.0, kinematic_viscosity=1e-5)
    found = dimensional({name: Estimate(0.5, 0.1)}, units, 3, 1.0, 1.0)
    assert found == {"settling velocity over the last two diameters, m/s": pytest.approx(0.1)}
