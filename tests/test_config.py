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
