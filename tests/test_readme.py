import re
import tomllib
from pathlib import Path

from alsph import config

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


def test_links_lead_somewhere():
    links = re.findall(r"\]\(([^)#:]+)\)", README.read_text(encoding="utf-8"))
    assert links and [link for link in links if not (README.parent / link).exists()] == []
