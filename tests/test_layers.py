"""The engine's files and folders lie on floors: each uses those below it, and none uses another of its own floor."""

import re
from pathlib import Path

RUST = Path(__file__).parents[1] / "rust"

FLOORS = (
    ("base",),
    ("kernel",),
    ("settings",),
    ("particles",),
    ("halo", "neighbours"),
    ("discretisation", "faces"),
    ("frame",),
    ("boundary", "breakdown", "interpolation"),
    ("loads", "shifting"),
    ("scheme",),
    ("report",),
    ("simulation",),
    ("python", "lib"),
)
FLOOR = {name: height for height, names in enumerate(FLOORS) for name in names}


def used(text: str) -> set[str]:
    """Return the modules of the crate that a source file names, but for those of its documentation and its tests."""
    code = re.sub(r"//.*", "", text.split("#[cfg(test)]")[0])
    assert "crate::{" not in code, "one line a module, so that this test can read it"
    return set(re.findall(r"\bcrate::([a-z_]+)\b", code))


def test_the_engine_has_no_arrow_up():
    modules = {path.relative_to(RUST).parts[0].removesuffix(".rs"): set() for path in RUST.rglob("*.rs")}
    assert set(modules) == set(FLOOR)
    for path in RUST.rglob("*.rs"):
        modules[path.relative_to(RUST).parts[0].removesuffix(".rs")] |= used(path.read_text())
    up = [
        f"{name} uses {other}"
        for name, others in sorted(modules.items())
        for other in sorted(others - {name})
        if FLOOR[other] >= FLOOR[name]
    ]
    assert not up


def test_an_arrow_up_is_noticed():
    assert used("use crate::scheme::Alsph;\n/// [`crate::report`]\n#[cfg(test)]\nuse crate::kernel;") == {"scheme"}
