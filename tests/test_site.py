"""What the documentation site is made of is complete, and its links lead somewhere; `make docs` builds it."""

import json
import re
import shlex
import sys
from pathlib import Path

import alsph as package
import pytest
from alsph import cases, config
from alsph.cli.app import COMMANDS
from alsph.config import RunSettings

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")),
    *sorted(page for page in DOCS.rglob("*.md") if "generated" not in page.parts),
]
SHIPPED = [name for name, model in cases.CASES.items() if model.__module__.startswith("alsph.")]
EXAMPLES = {"cylinder_array": str(DOCS.parent / "examples" / "cylinder_array.py")}


FENCED = re.compile(r"^(`{3,}).*?^\1$", re.DOTALL | re.MULTILINE)


def prose(page):
    """The text of a page without blocks of code."""
    return FENCED.sub("", page.read_text(encoding="utf-8"))


def anchors(page):
    """Those that GitHub gives to the headings of a page, as Sphinx does."""
    found = []
    for heading in re.findall(r"^#+ (.*)$", prose(page), re.MULTILINE):
        anchor = re.sub(r"[^\w -]", "", heading.strip().lower()).replace(" ", "-")
        found.append(f"{anchor}-{found.count(anchor)}" if anchor in found else anchor)
    return found


def broken(page):
    """The links of a page that lead nowhere."""
    for link in re.findall(r"\]\(([^)\s]+)\)", re.sub(r"`[^`\n]*`", "", prose(page))):
        path, _, anchor = link.partition("#")
        if ":" not in path:
            target = (page.parent / path) if path else page
            if not target.exists() or (anchor and anchor not in anchors(target)):
                yield link


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    assert list(broken(page)) == []


def test_broken_links_are_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# One\n# What the ± means\n# One\n[a](page.md#one) [b](#what-the--means) [c](#one-1) `[d](e)`\n")
    assert list(broken(page)) == []
    page.write_text("# One\n\n```\n# two\n```\n\n[a](other.md) [b](#two) [c](page.md#three) [d](https://x.org/#y)\n")
    assert list(broken(page)) == ["other.md", "#two", "page.md#three"]


def gallery():
    """The sections of the gallery by case."""
    parts = re.split(r"^## (\w+)$", (DOCS / "gallery.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def test_every_case_stands_in_the_gallery():
    assert [name for name in gallery() if name not in EXAMPLES] == SHIPPED and set(EXAMPLES) < gallery().keys()


def number(text):
    """The number that a text is, or the text."""
    try:
        return json.loads(text)
    except ValueError:
        return text


@pytest.mark.parametrize("case", [*SHIPPED, *EXAMPLES])
def test_a_case_of_the_gallery_has_a_command_a_picture_and_its_time(case):
    section = gallery()[case]
    (command,) = re.findall(r"^    alsph run (.*)$", section, re.MULTILINE)
    (picture,) = re.findall(r"!\[.+\]\((.+)\)", section)
    assert 5_000 < (DOCS / picture).stat().st_size < 100_000
    assert re.search(r"\d s of one core", section) and ("ompared with" in section or case in EXAMPLES)
    name, *words = shlex.split(re.sub(r"(--[\w-]+)(?= --|$)", r"\1 true", command))  # a flag
    options = {word[2:].replace("-", "_"): number(value) for word, value in zip(words[::2], words[1::2], strict=True)}
    run = {option: options.pop(option) for option in RunSettings.model_fields.keys() & options.keys()}
    made = config.from_tables({"case": EXAMPLES.get(case, name), "run": run, **options})
    assert name == str(EXAMPLES.get(case, case)).removeprefix(f"{DOCS.parent}/") and made.case.resolution <= 16


def test_every_public_name_stands_in_the_reference():
    text = (DOCS / "api.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"^   ([\w.]+)$", text, re.MULTILINE))
    listed |= {name.removeprefix("alsph.") for name in re.findall(r"{py:\w+} (\w[\w.]*)", text)}
    assert set(package.__all__) <= listed
    assert set(cases.__all__) <= {name.removeprefix("cases.") for name in listed}


def test_every_command_and_option_stands_in_the_reference(monkeypatch):
    pytest.importorskip("sphinx", reason="of the dependency group docs")
    monkeypatch.setattr(sys, "path", [*sys.path, str(DOCS / "_extensions")])
    from commands import described

    text = "\n".join(described())
    assert re.findall(r"^### alsph (\w+)$", text, re.MULTILINE) == list(COMMANDS)
    assert re.findall(r"^#### alsph (\w+ \w+)$", text, re.MULTILINE) == [
        "compare runs",
        *(f"study {name}" for name in ("run", "status", "draw", "list")),
    ]
    for name in COMMANDS.keys() - {"cases"}:
        section = re.split(r"^### alsph ", text, flags=re.MULTILINE)[1 + list(COMMANDS).index(name)]
        assert "\n| `" in section, name
    assert "`--output-interval FLOAT`" in text and "`--reynolds" not in text  # a parameter of the case
