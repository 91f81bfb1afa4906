import re
import tomllib
from pathlib import Path

import pytest
from alsph import cases, config

README = Path(__file__).parent.parent / "README.md"
SMALL_SCALE = {
    "resolution=20": "resolution=8, length=5.0, height=4.0, upstream=2.0",
    "until=60": "until=0.2",
    "advance(100)": "advance(10)",
    "every=0.5, until=5": "every=0.1, until=0.2",
}


def test_the_python_example_runs(tmp_path, monkeypatch, capsys):
    (example,) = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    for full, small in SMALL_SCALE.items():
        assert example.count(full) == 1
        example = example.replace(full, small)
    monkeypatch.chdir(tmp_path)
    exec(compile(example, str(README), "exec"), {"__name__": "readme"})
    for picture in ("forces.png", "vorticity.png", "pressure_coefficient.png"):
        assert (tmp_path / picture).stat().st_size > 5000
    assert capsys.readouterr().out


def test_the_configuration_file_is_valid():
    (example,) = re.findall(r"```toml\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    assert config.from_tables(tomllib.loads(example)).until == 60


def test_files_in_the_guide_of_running_are_configurations(tmp_path):
    text = (README.parent / "docs" / "running.md").read_text(encoding="utf-8")
    wing, units = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    for name, content in (("wing", wing), ("water", 'case = "cylinder"\n' + units)):
        (tmp_path / f"{name}.toml").write_text(content, encoding="utf-8")
    read = config.load(tmp_path / "wing.toml")
    assert (read.case.resolution, read.case.angle_of_attack, len(read.probes), read.until) == (40, 8.0, 22, 20)
    assert config.load(tmp_path / "water.toml").case.reynolds == pytest.approx(200)


ADD_YOUR_OWN = README.parent / "docs" / "add_your_own.md"


def test_the_examples_of_adding_run(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(cases, "CASES", dict(cases.CASES))
    monkeypatch.chdir(tmp_path)
    for example in re.findall(r"```python\n(.*?)```", ADD_YOUR_OWN.read_text(encoding="utf-8"), re.DOTALL):
        example = (
            example.replace("resolution=20).run", "resolution=8).run")
            .replace("until=0.5", "until=0.2")
            .replace("until=1)", "until=0.4)")
        )
        exec(compile(example, str(ADD_YOUR_OWN), "exec"), {"__name__": "add_your_own"})
    out = capsys.readouterr().out
    assert "share of the energy that is lost" in out


def test_the_files_that_adding_touches_are_there():
    words = re.findall(
        r"`((?:rust|tests|cases|running|engine|folder|scheme|boundary|settings)/[\w/.]+)`",
        ADD_YOUR_OWN.read_text(encoding="utf-8"),
    )
    roots = (README.parent, README.parent / "rust", README.parent / "python" / "alsph")
    missing = [word for word in words if "/x." not in word and not any((root / word).exists() for root in roots)]
    assert words and missing == []
