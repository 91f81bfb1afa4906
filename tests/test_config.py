import re
from pathlib import Path

import numpy as np
import pytest
from alsph import config
from alsph.cases import CASES, Cylinder, TaylorGreen
from alsph.config import Config, RunSettings
from alsph.errors import AlsphError, ConfigError

BAD_CASES = sorted((Path(__file__).parent / "bad_cases").glob("*.toml"))


@pytest.mark.parametrize("path", BAD_CASES, ids=lambda path: path.stem)
def test_bad_case_gives_its_message_and_leaves_nothing(path, tmp_path, alsph):
    expected = path.read_text(encoding="utf-8").splitlines()[0].removeprefix("# expected: ")
    code, _, stderr = alsph("run", path, "-o", tmp_path / "run")
    assert code == 2
    assert expected in stderr
    assert len(stderr.strip().splitlines()) == 1
    assert str(path) in stderr or "GiB" in stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("case", [Cylinder(reynolds=150, algorithm="original"), TaylorGreen(dimensions=3, seed=4)])
def test_round_trip(case, tmp_path):
    written = Config(case, RunSettings(until=3.5, threads=2))
    written.save(tmp_path / "case.toml")
    assert config.load(tmp_path / "case.toml") == written


@pytest.mark.parametrize("model", CASES.values())
def test_file_with_the_case_only_has_the_defaults(model, tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(f'case = "{model.name}"\n')
    loaded = config.load(path)
    assert loaded == Config(model())
    assert loaded.until == model().default_until


@pytest.mark.parametrize("model", [*CASES.values(), RunSettings])
def test_every_parameter_is_described(model):
    for name, field in model.model_fields.items():
        assert field.description
        assert field.annotation is not float or re.search(r"\[.+\]", field.description), name
        assert f"\n{name} : default" in model.__doc__


def test_numpy_numbers_are_numbers():
    assert Cylinder(resolution=np.int64(10), reynolds=np.float32(50)) == Cylinder(resolution=10, reynolds=50)


def test_errors_are_value_errors_too():
    with pytest.raises(ValueError, match="reynold: unknown parameter; did you mean 'reynolds'"):
        Cylinder(reynold=200)
    assert issubclass(ConfigError, AlsphError)


def test_parameters_cannot_change_behind_a_run():
    with pytest.raises(ValueError, match="cannot be changed"):
        Cylinder().reynolds = 100


def test_unreadable_file(tmp_path):
    with pytest.raises(ConfigError, match="cannot be read"):
        config.load(tmp_path / "missing.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="not a TOML file"):
        config.load(tmp_path / "binary.toml")


@pytest.mark.parametrize(
    ("values", "messages"),
    [
        ({"resolution": 10.5}, ["resolution = 10.5: must be a whole number (particles"]),
        ({"resolution": 10.0}, ["resolution = 10.0: must be a whole number, as 10 ("]),
        ({"resolution": "10"}, ["resolution = '10': must be a whole number, without quotes ("]),
        ({"reynolds": "100"}, ["reynolds = '100': must be a number, without quotes (Reynolds number"]),
        ({"reynolds": None}, ["reynolds = None: must be a number ("]),
        ({"reynolds": np.arange(2.0)}, ["reynolds = array([0., 1.]): must be a number ("]),
        ({"reynolds": 10**400}, ["0000 ...: must be a smaller number ("]),
        ({"resolution": 10**400}, ["resolution: too large"]),
        ({"reynolds": 1e15}, ["reynolds = 1e+15: too large"]),
        ({"length": 1e308, "upstream": 4.0}, ["length: too large"]),
        ({"kernel": 3}, ["kernel = 3: must be 'quintic_spline', 'wendland_c2' or"]),
        ({"adaptive_time_step": "yes"}, ["adaptive_time_step = 'yes': must be true or false ("]),
        ({"penalty_constant": 1000}, ["penalty_constant = 1000: must be less than or equal to 100 ("]),
        ({"reynolds": -1, "resolution": 10.5}, ["reynolds = -1: must be greater than 0", "resolution = 10.5: must"]),
        (
            {"reynolds": -1, "length": -1, "height": -1, "upstream": -1, "perturbation": -1},
            ["reynolds", "; and 2 more"],
        ),
    ],
)
def test_mistakes_are_told_in_plain_words_and_together(values, messages):
    with pytest.raises(ConfigError) as error:
        Cylinder(**values)
    for message in messages:
        assert message in str(error.value)
    for foreign in ("valid", "Input", "Overflow", "unable", "convert"):
        assert foreign not in str(error.value)


def test_parameters_have_names():
    with pytest.raises(ConfigError, match=r"Cylinder: parameters are given by name, as Cylinder\(reynolds=200\)"):
        Cylinder(200)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ('case = "cylinder"\n[runs]\nuntil = 4.0', "[runs]: unknown table; did you mean [run]?"),
        ('case = "cylinder"\n[numerics]\na = 1', "[numerics]: unknown table; only [run] is"),
        ('case = "cylinder"\nuntil = 4.0', "until: a setting of the run; put it below a line [run]"),
        (
            'case = "cylinder"\n[run]\nreynolds = 4.0',
            "run.reynolds: a parameter of the case; put it above the line [run]",
        ),
        (
            'case = "cylinder"\nreynolds = -1.0\n[run]\nuntil = -4.0\nthreads = 0',
            "reynolds = -1.0: must be greater than 0 (Reynolds number UD/ν [-]); run.until = -4.0: must be greater "
            "than 0 (end time [D/U]; the case's own default if not given; or converged: as soon as mean drag, lift and "
            "shedding are known well enough); run.threads = 0: must be",
        ),
        ("x = " + "[" * 100_000, "nested too deeply"),
        ("x = " + "{a = " * 100_000, "nested too deeply"),
        ("a." * 100_000 + "b = 1", "nested too deeply"),
        ("[" + '"a" . ' * 100_000 + "b]", "nested too deeply"),
        ("x = " + "[" * 300 + "]" * 300, "case: missing"),
        ("x = " + "1" * 5000, "a number in it has too many digits"),
        ('case = "cyl\\u001b[2Jinder"', r"unknown case 'cyl\x1b[2Jinder'; did you mean 'cylinder'?"),
        ('case = "cylinder"\n"reyn\\u202eolds" = 1.0', r"reyn\u202eolds: unknown parameter"),
        ('case = "cylinder"'.encode("utf-16"), "not a TOML file: it is not text in UTF-8"),
        (b"# " + b"x" * 2**23, "larger than 4 MiB"),
    ],
)
def test_any_file_is_refused_in_one_line(tmp_path, content, message):
    path = tmp_path / "case.toml"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(ConfigError) as error:
        config.load(path)
    assert str(error.value).startswith(f"{path}: ") and message in str(error.value)
    assert len(str(error.value)) < 600 and str(error.value).isprintable()


def test_a_byte_order_mark_is_no_mistake(tmp_path):
    path = tmp_path / "case.toml"
    path.write_bytes(b'\xef\xbb\xbfcase = "cylinder"\r\nreynolds = 150.0\r\n[run]\r\nuntil = 4.0\r\n')
    assert config.load(path) == Config(Cylinder(reynolds=150.0), RunSettings(until=4.0))


def test_what_has_no_end_is_no_configuration():
    with pytest.raises(ConfigError, match="/dev/zero: cannot be read .no regular file"):
        config.load("/dev/zero")


def test_texts_must_fit_into_a_file():
    with pytest.raises(ConfigError, match=r"initial_run = 'a\\udcff': must be a text in UTF-8"):
        RunSettings(initial_run="a\udcff")
