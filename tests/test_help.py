"""The help of every command, whatever commands and options there are."""

import re

import pytest
from alsph.cases import CASES
from alsph.cli import app
from alsph.cli.help import Command, Group
from alsph.cli.options import CaseGroup
from typer import Context
from typer.main import get_command

WIDTH = 80


def found(command, context):
    """Yield the words of every command and group, and what it is."""
    yield context.command_path.split()[1:], command, context
    if isinstance(command, CaseGroup):
        cases = CASES if context.info_name == "run" else ["cylinder"]  # the options of a case are the same in all
        others = [*cases, *command.beside]
    else:
        others = getattr(command, "commands", ())
    for name in others:
        other = command.get_command(context, name)
        yield from found(other, Context(other, info_name=name, parent=context))


root = get_command(app)
COMMANDS = [
    pytest.param(*each, id="_".join(each[0]) or "alsph") for each in found(root, Context(root, info_name="alsph"))
]


@pytest.mark.parametrize(("words", "command", "context"), COMMANDS)
def test_help_is_plain_and_narrow(alsph, monkeypatch, words, command, context):
    monkeypatch.setenv("COLUMNS", str(WIDTH))
    code, text, complaints = alsph(*words, "--help")
    assert (code, complaints) == (0, "") and text.startswith("Usage: ")
    assert max(map(len, text.splitlines())) <= WIDTH
    for odd in ("[[", "]]", "\\", "{", "default: (", "<int", "<str", "<path", "<=x", "automatic", "None", "...\n"):
        assert odd not in text.partition("\n")[2], odd
    assert re.search(r"Options:\n", text)


@pytest.mark.parametrize(("words", "command", "context"), [each for each in COMMANDS if each.id != "alsph"])
def test_every_option_says_what_it_is_and_its_default_once(words, command, context):
    if isinstance(command, Group):
        assert all(text for _, text in command.summaries(context))
        return
    assert isinstance(command, Command)
    records = [record for section in command.sections(context).values() for record in section]
    options = [each for each in command.get_params(context) if each.get_help_record(context)]
    assert len(records) == len(options)
    for names, text in records:
        assert re.match(r"\w|[βδ|'/]", text), names
        assert text.count("[default: ") <= 1 and text.count("[") == text.count("]"), text
    text = " ".join(text for _, text in records)
    given = [each for each in options if each.default not in (None, False, (), [])]
    assert text.count("[default: ") >= len(given)


def test_the_help_of_a_case_says_what_holds_where_nothing_is_given(alsph):
    words = " ".join(alsph("run", "cylinder", "--help")[1].split())
    for text in (
        "--reynolds FLOAT Reynolds number UD/ν [-] [default: 200]",
        "--until FLOAT|converged end time [D/U]; 60 if not given; or converged: as soon as mean drag, lift and "
        "shedding are known well enough --uncertainty",
        "3 times the default of until if not given --threads",
        "alsph if not given --sound-speed",
        "Units, all four or none: --units-length FLOAT reference length D [m] --units-velocity",
        "-o, --output PATH run folder [default: runs/CASE]",
    ):
        assert text in words


def test_a_parameter_that_must_be_given_says_so(alsph, tmp_path):
    path = tmp_path / "own.py"
    path.write_text(
        "from alsph.cases import Cylinder\nfrom pydantic import Field\n\n\n"
        "class Own(Cylinder):\n    gap: float = Field(description='gap [D]')\n"
    )
    words = " ".join(alsph("run", f"{path}:Own", "--help")[1].split())
    assert "--gap FLOAT gap [D] [required]" in words and "60 if not given" not in words


@pytest.mark.parametrize(
    ("words", "usage"),
    [
        (["runs"], "runs [OPTIONS] [FOLDER]"),
        (["info"], "info [OPTIONS] RUN"),
        (["compare"], "compare RUN RUN... | CASE --schemes LIST [OPTIONS]"),
        (["compare", "runs"], "compare runs [OPTIONS] RUN RUN..."),
        (["validate"], "validate [OPTIONS] [CASE|FILE.py:CLASS...]"),
        (["run"], "run CASE|FILE.toml|FILE.py:CLASS [OPTIONS]"),
        (["study"], "study NAME|FILE.toml|COMMAND [OPTIONS]"),
        ([], "COMMAND [OPTIONS]"),
    ],
)
def test_usage_brackets_what_may_be_left_out(alsph, words, usage):
    assert alsph(*words, "--help")[1].splitlines()[0].endswith(f" {usage}")
