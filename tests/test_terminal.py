"""What is shown, and where: hostile texts, terminals of few letters, pipes that nobody reads, mistyped options."""

import json
import os
import subprocess
import sys

import pytest
from alsph import Run, errors, study
from alsph.folder.run_folder import RunFolder
from alsph.study.board import overview
from alsph.study.declaration import Study
from alsph.study.state import states
from alsph.tables import markdown
from alsph.text import printable, shown
from processes import command

HOSTILE = "\x1b]0;owned\x07\x1b[2J\x9b31m\x7f\u202efdp\u2066\nfinished\udcff"
ESCAPED = r"\x1b]0;owned\x07\x1b[2J\x9b31m\x7f\u202efdp\u2066\nfinished\udcff"


@pytest.fixture
def run(tmp_path, small):
    """A short run in a folder with a hostile name."""
    return small.run(tmp_path / "run\x1b[31m", until=0.05, progress=False)


def harmless(text):
    return all(letter.isprintable() or letter == "\n" for letter in text)


def test_texts_are_shown_escaped():
    assert printable(HOSTILE) == ESCAPED and printable(ESCAPED) == ESCAPED
    assert printable("D/Δx = 20, ∇·u ≤ 1\n", lines=True) == "D/Δx = 20, ∇·u ≤ 1\n"
    assert shown("x" * 1000) == "'" + "x" * 75 + " ..."
    assert shown(10**5000) == "a int too long to be shown"
    for kind in (errors.ConfigError, errors.SolverError, errors.RunFolderError, errors.Interrupted):
        assert str(kind(HOSTILE)) == ESCAPED
    assert markdown([HOSTILE], [["1"]]).startswith(f"| {ESCAPED} |")


def test_what_a_folder_says_reaches_no_terminal_raw(run, alsph):
    info = run.info | {"status": HOSTILE, "message": HOSTILE}
    (run.path / "run.json").write_text(json.dumps(info))
    code, output, complaints = alsph("info", run.path)
    assert code == 0 and harmless(output + complaints)
    assert output.count(ESCAPED) == 3 and r"run\x1b[31m" in output
    again = Run(run.path)
    assert ESCAPED in repr(again) and harmless(repr(again))
    assert ESCAPED in again._repr_html_() and harmless(again._repr_html_())
    folder = RunFolder(run.path)
    folder.log(HOSTILE)
    assert (run.path / "run.log").read_text(encoding="utf-8").endswith(f"  {ESCAPED}\n")


@pytest.mark.parametrize("arguments", [["info"], ["resume"], ["repeat"], ["plot", "--field", HOSTILE]])
def test_no_command_shows_a_path_raw(run, alsph, arguments):
    for path in (run.path, run.path / HOSTILE.replace("\udcff", "")):
        assert harmless("".join(alsph(*arguments, path)[1:]))


def test_what_is_typed_wrong_is_shown_escaped(alsph):
    for arguments in (["info", "a", HOSTILE], [f"--{HOSTILE}"], [HOSTILE], ["run", HOSTILE], ["study", HOSTILE]):
        code, output, complaints = alsph(*arguments)
        assert code == 2 and harmless(output + complaints) and r"\x1b" in complaints, complaints


def test_a_dollar_in_a_name_begins_no_formula(tmp_path, small):
    run = small.run(tmp_path / "cost$^$\x1b", until=0.05, progress=False)
    run.plot_spectrum(tmp_path / "spectrum.png")


def test_a_study_of_others_is_shown_escaped(tmp_path):
    declared = Study(name="a", base={"case": "cylinder"}, sweep={"product": {"kernel": ["wendland_c2"]}})
    (point,) = declared.points()
    folder = tmp_path / "runs" / point.name
    folder.mkdir(parents=True)
    (folder / "run.json").write_text(json.dumps({"status": "failed", "message": HOSTILE}))
    results = study.Results.of(declared, [point], tmp_path)
    assert harmless(results.to_markdown()) and harmless(str(results)) and harmless(results._repr_html_())
    assert ESCAPED in overview([point], states([point], tmp_path))[0]


IN_TURN = """
import json, sys
from alsph.cli import main
for sys.argv[1:] in json.loads(sys.argv[1]):
    try:
        main()
    except SystemExit as end:
        assert not end.code, (sys.argv, end.code)
"""


@pytest.mark.parametrize("encoding", ["cp1252", "latin-1"])
def test_a_terminal_may_know_few_letters(tmp_path, small_options, encoding):
    path = str(tmp_path / "Δx")
    commands = [
        ["run", "cylinder", *small_options, "--until=0.02", "-o", path],
        ["info", path],
        ["describe", "cylinder", "--no-probe"],
        ["run", "cylinder", "--help"],
    ]
    environment = os.environ | {"PYTHONIOENCODING": encoding}
    arguments = [sys.executable, "-c", IN_TURN, json.dumps(commands)]
    done = subprocess.run(arguments, env=environment, capture_output=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, b"") and b"D/?x" in done.stdout


@pytest.mark.parametrize("arguments", [["info"], ["run", "cylinder", "--help"]])
def test_a_pipe_that_nobody_reads_is_no_error(run, arguments):
    """As with ``alsph info RUN | head -1``."""
    process = command(*arguments, *([run.path] if arguments == ["info"] else []))
    process.stdout.close()
    assert process.stderr.read() == ""
    assert process.wait(60) == 141


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "cylinder", "--resolution", "10.5"], "'--resolution': must be a whole number, not '10.5'\n"),
        (["run", "cylinder", "--reynolds", "much"], "'--reynolds': must be a number, not 'much'\n"),
        (["describe", "cylinder", "--threads", "1e3"], "'--threads': must be a whole number, not '1e3'\n"),
        (["run", "cylinder", "--resolution", "1" * 500], "error: resolution: too large\n"),
        (["resume", "run", "--until", "soon"], "'--until': must be a number or converged, not 'soon'\n"),
        (["validate", "--resolution", "10.5"], "whole number\n"),
        (
            ["run", "cylinder", "--reynolds=-1", "--until=-1"],
            "error: reynolds = -1.0: must be greater than 0 (Reynolds",
        ),
    ],
)
def test_numbers_are_asked_for_in_plain_words(alsph, arguments, message):
    code, _, complaints = alsph(*arguments)
    assert code == 2 and message in complaints
    assert not any(word in complaints for word in ("valid integer", "valid number", "valid float", "parse"))


def test_warnings_are_shown_escaped(run):
    (run.path / "checkpoint.h5").write_bytes(b"damaged")
    process = command("resume", run.path, "--until", "0.06")
    _, complaints = process.communicate(timeout=60)
    assert "warning: " in complaints and harmless(complaints) and r"run\x1b[31m" in complaints
