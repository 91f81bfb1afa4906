"""Parameter studies: declaration, caching, interruption, and clusters."""

import csv
import io
import json
import os
import signal
import subprocess
import sys
import time as clock
from pathlib import Path

import h5py
import numpy as np
import pytest
import tomli_w
from alsph import Run, study
from alsph.analysis.averages import Estimate
from alsph.cases import Couette, Cylinder, TaylorGreen
from alsph.errors import ConfigError, WalltimeError
from alsph.study import Figure, Study, Sweep
from alsph.study.board import Board
from alsph.study.declaration import RUNS, Published
from alsph.study.execution import _jobs
from alsph.study.results import Results, _of, _time_of_largest_lift, names
from alsph.study.state import State, state
from rich.console import Console
from synthetic import write_run

DECAY = "decay rate of the kinetic energy, U/D"
VORTEX = {"case": "taylor_green", "resolution": 16, "run": {"until": 0.2, "output_interval": 0.1}}


def declare(**changes):
    values = {"name": "few", "base": VORTEX, "sweep": Sweep(product={"reynolds": [50, 100]})} | changes
    return Study(**values)


def bits(path: Path) -> dict[str, bytes]:
    """The final state of a run, to the last bit."""
    with h5py.File(path / "checkpoint.h5") as file:
        return {name: table[()].tobytes() for name, table in file.items()} | {"time": file.attrs["time"].tobytes()}


# Declaration


def test_product_together_and_sets_are_combined_and_ladders_follow_each_other():
    sweep = Sweep(
        product={"algorithm": [1, 2]},
        together={"reynolds": [100, 200], "time_step": [0.05, 0.03]},
        sets=[{"max_iterations": 2}, {"max_iterations": 5, "run.until": 0.3}],
    )
    points = declare(sweep=sweep).points()
    assert len(points) == 2 * 2 * 2
    assert {(p.config.case.reynolds, p.config.case.time_step) for p in points} == {(100, 0.05), (200, 0.03)}
    assert {(p.config.case.max_iterations, p.config.until) for p in points} == {(2, 0.2), (5, 0.3)}
    ladder = Sweep(product={"algorithm": [1, 2]}, until_diverged={"time_step": [0.01, 0.02, 0.04]})
    points = declare(sweep=ladder).points()
    assert [p.after and p.after.config.case.time_step for p in points] == 2 * [None, 0.01, 0.02]
    assert all(p.after is None or p.after.config.case.algorithm == p.config.case.algorithm for p in points)


def test_the_name_of_a_run_depends_on_its_configuration_and_not_on_how_it_is_run():
    first, second = declare().points()
    assert first.name != second.name
    (other,) = declare(name="other", sweep=Sweep(sets=[{"reynolds": 50, "run.threads": 2}])).points()
    assert other.name == first.name
    # Defaults that are written out change nothing.
    (explicit,) = declare(sweep=Sweep(sets=[{"reynolds": 50, "max_iterations": 2}])).points()
    assert explicit.name == first.name


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sweep": Sweep(product={"reynold": [1]})}, "did you mean 'reynolds'"),
        ({"sweep": Sweep(product={"case.reynolds": [1]})}, "must be a parameter of the case"),
        ({"sweep": Sweep(product={"resolution": [3]})}, "resolution = 3"),
        ({"base": {"resolution": 8}}, "case: missing"),
    ],
)
def test_a_sweep_that_makes_no_case_is_refused_with_the_reason(changes, message):
    with pytest.raises(ConfigError, match=message):
        declare(**changes).points()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Sweep(together={"a": [1, 2], "b": [1]}), "as many values"),
        (lambda: Sweep(product={"a": []}), "has no values"),
        (lambda: Sweep(until_diverged={"a": [1], "b": [1]}), "takes one parameter"),
        (lambda: Figure(name="f", kind="profile"), "need profile"),
        (lambda: Figure(name="../f", x="a", y=["b"]), "name"),
        (lambda: declare(figures=[Figure(name="f", x="reynold", y=["b"])]), "did you mean 'reynolds'"),
        (lambda: declare(name="../up"), "name"),
        (lambda: declare(name="runs"), "name: runs is the folder of the run folders"),
        (lambda: declare(base=VORTEX | {"run": 3}), "base.run = 3: must be a table"),
        (lambda: Sweep(product={"a": [1]}, together={"a": [2]}), "a: stands in product and in together"),
        (lambda: Sweep(sets=[{"a": 1}], until_diverged={"a": [2]}), "a: stands in until_diverged and in sets"),
        (lambda: Sweep(product={"run.threads": [1, 2]}), "run.threads: changes nothing in the results"),
        (lambda: declare(sweep=Sweep(product={"time": [1.0, 2.0]})), "time: a column of the results is called so"),
        (lambda: declare(figures=2 * [Figure(name="f", x="reynolds", y=["b"])]), "figure f: two figures are called so"),
        (lambda: Figure(name="f", x="a", y=["b", "c"], labels={"b": "d", "c": "d"}), "two of y have the same name"),
        (lambda: Figure(name="f", x="a", y=["b"], labels={"y": "d"}), "labels.y: is not drawn"),
    ],
)
def test_a_declaration_that_cannot_be_used_is_refused_with_the_reason(make, message):
    with pytest.raises(ConfigError, match=message):
        make()


def test_a_rule_that_fails_in_one_run_names_it(tmp_path, alsph):
    (tmp_path / "stirred.py").write_text(
        "from alsph.cases import TaylorGreen\n\n\nclass Stirred(TaylorGreen):\n    strength: float = 1.0\n\n"
        "    def forcing(self, position, time):\n        return position * (1 // int(self.strength - 2))\n"
    )
    path = tmp_path / "study.toml"
    declared = 'name = "a"\nbase = {{case = "stirred.py:Stirred"}}\nsweep.product.strength = [1.0, {}]\n'
    path.write_text(declared.format(2.0))
    with pytest.raises(ZeroDivisionError) as raised:
        study.load(path).points()
    assert raised.value.__notes__[-1] == "in the run with strength 2"
    code, _, complaints = alsph("study", "run", path, "-o", tmp_path / "out", "--dry-run")
    assert code == 2 and complaints.startswith("error: forcing: the function failed at t* = ")
    assert complaints.endswith("; in the run with strength 2\n")
    text = (tmp_path / "stirred.py").read_text().replace("position * (1 // int(self.strength - 2))", "self.strength")
    (tmp_path / "stirred.py").write_text(text)
    with pytest.raises(ConfigError, match=r"study a, strength 1: .*forcing: the function must give 2 numbers"):
        study.load(path).points()


def test_files_that_cannot_be_used_are_refused_with_their_name(tmp_path):
    path = tmp_path / "study.toml"
    for content, message in (
        ("name = ", "not a TOML file"),
        ('name = "a"', "base"),
        ('name = "a"\nbase = {}\nnonsense = 1', "unknown parameter"),
        ('name = "a"\npreset = "quick"', "preset = 'quick': must be a table"),
        ('name = "a"\n[base]\nrun = 3', "base.run = 3: must be a table"),
        ('name = "a"\n[figure]\nname = "b"', "double brackets"),
        ('name = "a"\n[base]\n[[figure]]\nname = "b"\nkind = "fields"\ny = ["vortex"]', "did you mean 'vorticity'"),
        ('name = "a"\nbase = {}\n[[figure]]\nname = "b"\nkind = "curve"', "kind"),
        ('name = "a"\n[preset.fine]\nsweep = 3', "sweep = 3: must be a table"),
        ('name = "a"\n[preset.fine.base]\nrun = 3', "base.run = 3: must be a table"),
        ('name = "a"\n[preset.fine]\nfigure = [3]', "figure: must be tables with double brackets"),
    ):
        path.write_text(content)
        with pytest.raises(ConfigError, match=f"study.toml: .*{message}"):
            study.load(path)
    with pytest.raises(ConfigError, match="did you mean 'reynolds'"):
        study.load("reynold")
    with pytest.raises(ConfigError, match="unknown preset 'fast'"):
        study.load("reynolds", "fast")


def test_which_preset_is_on_is_told(tmp_path, alsph):
    path = tmp_path / "study.toml"
    path.write_text(
        'name = "a"\nbase = {case = "taylor_green"}\n[preset.quick]\nsweep.product.resolution = [8]\n'
        "[preset.fine]\nsweep.product.resolution = [16]\n"
    )
    for arguments, told in (([], "preset quick"), (["--preset", "fine"], "preset fine")):
        code, output, _ = alsph("study", "run", path, "-o", tmp_path / "out", "--dry-run", *arguments)
        assert code == 0 and output.startswith(told)
    assert study.load(path).in_words == "a, preset quick"


def test_runs_that_start_with_the_flow_of_another_are_known_by_it():
    """Starts are shared where nothing that is left of the point's own parameters differs."""
    plain = declare().points()
    shared = declare(start={"resolution": 8, "reynolds": 70, "run": {"until": 0.1}}).points()
    own = declare(start={"resolution": 8}).points()
    assert len({point.name for point in [*plain, *shared, *own]}) == 6
    assert {point.start.name for point in shared} == {shared[0].start.name}
    assert shared[0].start.label == "start.resolution 8, start.reynolds 70, start.run.until 0.1"
    assert shared[0].start.config.until == 0.1 and shared[0].config == plain[0].config
    assert [point.start.config.case.reynolds for point in own] == [50, 100]
    assert [point.start.config.until for point in own] == [0.2, 0.2]
    with pytest.raises(ValueError, match="start: base.run has an initial_run; give one of them"):
        declare(base=VORTEX | {"run": {"initial_run": "x"}}, start={"resolution": 8})
    with pytest.raises(ConfigError, match="start: still_water has a free surface"):
        declare(base={"case": "still_water"}, start={"resolution": 8}).points()
    with pytest.raises(ConfigError, match="resolutio: unknown parameter; did you mean 'resolution'"):
        declare(start={"resolutio": 8}).points()


@pytest.mark.parametrize("name", study.shipped())
def test_the_studies_of_the_paper_declare_its_runs(name):
    for preset in ("quick", "paper"):
        declared = study.load(name, preset)
        points = declared.points()
        assert len({point.name for point in points}) == len(points)
        assert {point.config.case.algorithm for point in points} == {1, 2}
        assert all(point.config.case.projection_sweeps == 0 for point in points)
    starts = {point.start.name: point.start.config.case for point in points}
    assert len(starts) == len({case.reynolds for case in starts.values()}) <= 5
    assert declared.points()[-1].config.case.resolution == 30
    assert {figure.name for figure in declared.figures} == {
        "time-step": {"figure_3", "figure_4", "figure_5"},
        "iterations": {"figure_6", "figure_7", "figure_8", "figure_9", "figure_10"},
        "reynolds": {"figure_11", "figure_12", "figure_13"},
    }[name]


# Running


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    output = tmp_path_factory.mktemp("studies")
    figures = [Figure(name="decay", x="reynolds", y=[DECAY])]
    return study.run(declare(figures=figures), output, progress=False)


def test_a_study_writes_rows_tables_and_figures(done):
    assert done.complete and [row["reynolds"] for row in done.rows] == [50, 100]
    assert not done.warnings
    assert done.rows[0][DECAY] > done.rows[1][DECAY] > 0
    assert {path.name for path in done.path.iterdir()} == {"results.csv", "results.md", "decay.png"}
    with (done.path / "results.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["reynolds"]) for row in rows] == [50, 100]
    assert float(rows[1][DECAY]) == done.rows[1][DECAY]
    assert "![decay](decay.png)" in (done.path / "results.md").read_text()


def test_a_study_asked_for_again_runs_only_what_is_missing_and_shares_runs(done):
    output = done.path.parent
    before = {path: (path / "run.json").stat().st_mtime_ns for path in (output / RUNS).iterdir()}
    more = declare(name="more", sweep=Sweep(product={"reynolds": [100, 200]}))
    results = study.run(more, output, progress=False)
    after = {path: (path / "run.json").stat().st_mtime_ns for path in (output / RUNS).iterdir()}
    assert len(after) == 3 and all(after[path] == before[path] for path in before)
    assert results.rows[0] == done.rows[1]


def test_runs_start_with_the_flow_of_one_that_is_made_first(tmp_path):
    declared = declare(start={"resolution": 8, "reynolds": 70})
    start = declared.points()[0].start.name
    results = study.run(declared, tmp_path, progress=False)
    folders = [tmp_path / RUNS / point.name for point in declared.points()]
    assert results.complete and len(results.rows) == 2 and len(list((tmp_path / RUNS).iterdir())) == 3
    for folder, reynolds in zip(folders, (50, 100), strict=True):
        by_hand = TaylorGreen(resolution=16, reynolds=reynolds).run(
            tmp_path / f"{reynolds}",
            until=0.2,
            output_interval=0.1,
            threads=1,
            initial_run=str(tmp_path / RUNS / start),
            progress=False,
        )
        assert bits(folder) == bits(by_hand.path)
    (tmp_path / RUNS / start).rename(tmp_path / "gone")  # what has ended needs it no longer
    assert study.run(declared, tmp_path, progress=False).rows == results.rows
    assert not (tmp_path / RUNS / start).exists()


def test_what_would_start_with_a_flow_that_diverged_is_skipped(tmp_path):
    base = VORTEX | {"adaptive_time_step": False, "penalty_constant": 100.0}
    results = study.run(declare(base=base, start={"time_step": 0.5}), tmp_path, progress=False)
    assert [row["status"] for row in results.rows] == ["skipped", "skipped"]
    assert len(list((tmp_path / RUNS).iterdir())) == 2


def test_misspelt_results_are_warned_of_and_lose_nothing(done):
    wrong = declare(
        collect=["decay rate"], figures=[Figure(name="decay", x="reynolds", y=["decay rate of the energy"])]
    )
    results = study.run(wrong, done.path.parent, progress=False)
    assert len(results.warnings) == 2
    assert "did you mean 'decay rate of the kinetic energy, U/D'" in results.warnings[1]
    assert results.complete and not results.draw()


def test_a_ladder_ends_with_the_run_that_diverges_which_is_a_result(tmp_path):
    base = VORTEX | {"adaptive_time_step": False, "penalty_constant": 100.0}
    ladder = declare(base=base, sweep=Sweep(until_diverged={"time_step": [0.05, 0.3, 0.4, 0.5]}))
    results = study.run(ladder, tmp_path, progress=False)
    assert [row["status"] for row in results.rows] == ["finished", "diverged", "skipped", "skipped"]
    assert results.complete and 0 <= results.rows[1]["time"] < 0.2
    again = study.run(ladder, tmp_path, progress=False)
    assert [row["status"] for row in again.rows] == [row["status"] for row in results.rows]


def test_a_run_that_fails_is_reported_and_the_others_go_on(tmp_path):
    broken = declare().points()[0]
    (tmp_path / RUNS).mkdir()
    (tmp_path / RUNS / broken.name).write_text("no folder")
    results = study.run(declare(), tmp_path, progress=False)
    assert [row["status"] for row in results.rows] == ["failed", "finished"]
    assert not results.complete and broken.name in results.states[0].message


def test_a_run_that_failed_before_is_tried_again(tmp_path):
    point = declare().points()[0]
    path = tmp_path / RUNS / point.name
    path.mkdir(parents=True)
    point.config.save(path / "case.toml")
    (path / "run.json").write_text(json.dumps({"status": "failed"}))
    assert study.run(declare(), tmp_path, progress=False).complete


HOLDER = """
import sys, time
from pathlib import Path
from alsph.folder.run_folder import RunFolder

folder = RunFolder(Path(sys.argv[1]))
with folder.claimed():
    print("claimed", flush=True)
    time.sleep(3)
    sys.exit((folder.path / "case.toml").exists())
"""


def test_a_run_that_another_study_makes_is_waited_for(tmp_path):
    path = tmp_path / RUNS / declare().points()[0].name
    other = subprocess.Popen([sys.executable, "-c", HOLDER, path], stdout=subprocess.PIPE)
    assert other.stdout.readline() == b"claimed\n"
    assert state(path).status == "running"
    results = study.run(declare(), tmp_path, progress=False)
    assert other.wait() == 0, "the run was begun while the other one held its folder"
    assert results.complete


def test_words_on_the_abscissa_are_drawn(done):
    sweep = Sweep(product={"algorithm": [2, "midpoint"]})
    figures = [Figure(name="decay", x="algorithm", y=[DECAY])]
    assert study.run(declare(sweep=sweep, figures=figures), done.path.parent, progress=False).draw()


def test_so_are_lists(done):
    """Sines and cosines of a motion, say."""
    declared = declare(figures=[Figure(name="decay", x="reynolds", y=[DECAY])])
    results = Results.of(declared, declared.points(), done.path.parent)
    for row, value in zip(results.rows, ([1.0], [1.0, 2.0]), strict=True):
        row["reynolds"] = value
    assert [text.get_text() for text in results.draw()["decay"].axes[0].get_xticklabels()] == ["[1.0]", "[1.0, 2.0]"]


def collected(path, rows, references=None, **declared):
    """The results of a study of vortices whose runs have found such decay rates, by their parameters."""
    declared = declare(**declared)
    points = declared.points()
    assert [dict(point.parameters) for point in points] == [parameters for parameters, _ in rows]
    found = [{DECAY: Estimate(value)} for _, value in rows]
    table = [
        dict(parameters) | {"status": "finished", "time": 1.0, "seconds": 1.0} | results | {"folder": "runs/none"}
        for (parameters, _), results in zip(rows, found, strict=True)
    ]
    known = [{DECAY: value} for value in references] if references else [{} for _ in rows]
    return Results(declared, path, table, known, [State("finished") for _ in rows], found)


def lines_of(results, name="decay"):
    """What a figure's only panel draws: abscissae and ordinates by label."""
    (axes,) = results.draw()[name].axes
    return {line.get_label(): (list(line.get_xdata()), list(line.get_ydata())) for line in labelled(axes)}


def labelled(axes):
    handles, names = axes.get_legend_handles_labels()
    lines = [getattr(handle, "lines", [handle])[0] for handle in handles]
    for line, name in zip(lines, names, strict=True):
        line.set_label(name)
    return lines


def test_parameters_that_are_nearly_the_same_are_told_apart(tmp_path):
    figures = [Figure(name="decay", x="resolution", y=[DECAY])]
    sweep = Sweep(product={"reynolds": [20001.0, 20002.0], "resolution": [10, 12]})
    rows = [({"reynolds": re, "resolution": n}, re + n) for re in (20001.0, 20002.0) for n in (10, 12)]
    results = collected(tmp_path, rows, sweep=sweep, figures=figures)
    assert lines_of(results) == {
        "Re = 20001": ([10, 12], [20011.0, 20013.0]),
        "Re = 20002": ([10, 12], [20012.0, 20014.0]),
    }
    assert "| 20002 " in results.to_markdown()
    assert declare(sweep=Sweep(product={"time_step": [0.0254321, 1 / 3]})).points()[1].label.endswith(repr(1 / 3))


def test_what_a_set_does_not_name_is_as_it_is_without(tmp_path):
    figures = [Figure(name="decay", x="resolution", y=[DECAY], where={"run.until": 0.2})]
    sweep = Sweep(product={"resolution": [10, 12]}, sets=[{}, {"reynolds": 200}, {"run.until": 0.3}])
    base = VORTEX | {"reynolds": 50}
    rows = [
        ({"resolution": n, "reynolds": re, "run.until": until}, n * re)
        for n in (10, 12)
        for re, until in ((50, 0.2), (200, 0.2), (50, 0.3))
    ]
    results = collected(tmp_path, rows, base=base, sweep=sweep, figures=figures)
    found = lines_of(results)
    assert [points for name, points in found.items() if "Re = 50" in name] == [([10, 12], [500.0, 600.0])]
    assert [points for name, points in found.items() if "Re = 200" in name] == [([10, 12], [2000.0, 2400.0])]
    assert len(found) == 2


def test_a_run_without_a_value_on_the_abscissa_is_not_on_it(tmp_path):
    """As one whose time step follows from its Courant number, beside others whose step is given."""
    sweep = Sweep(sets=[{}, {"time_step": 0.05}, {"time_step": 0.1}])
    rows = [({"time_step": step}, 1.0 + (step or 0.0)) for step in (None, 0.05, 0.1)]
    figures = [Figure(name="decay", x="time_step", y=[DECAY])]
    results = collected(tmp_path, rows, [3.0, 3.0, 3.0], sweep=sweep, figures=figures)
    assert [[*line.get_xdata()] for line in results.draw()["decay"].axes[0].lines] == [[0.05, 0.1], [0.05, 0.1]]
    figures = [Figure(name="decay", x="time_step", y=[DECAY], finest="time_step")]
    results = collected(tmp_path, rows, sweep=sweep, figures=figures)
    assert [[*line.get_xdata()] for line in results.draw()["decay"].axes[0].lines] == [[0.1]]
    assert "| not given " in results.to_markdown()


def test_each_series_has_its_own_reference(tmp_path):
    figures = [Figure(name="decay", x="resolution", y=[DECAY])]
    sweep = Sweep(product={"reynolds": [50, 200], "resolution": [10, 12]})
    rows = [({"reynolds": re, "resolution": n}, 1.0) for re in (50, 200) for n in (10, 12)]
    found = lines_of(collected(tmp_path, rows, [3.0, 3.0, 0.5, 0.5], sweep=sweep, figures=figures))
    assert found["reference, Re = 50"] == ([10, 12], [3.0, 3.0])
    assert found["reference, Re = 200"] == ([10, 12], [0.5, 0.5])
    found = lines_of(collected(tmp_path, rows, [3.0, 3.0, 3.0, 3.0], sweep=sweep, figures=figures))
    assert found["reference"] == ([10, 12], [3.0, 3.0]) and len(found) == 3
    assert _of(["Algorithm 1, Re = 50", "Algorithm 2, Re = 50"]) == "reference, Re = 50"
    assert _of(["Re = 50", "Re = 100"]) == "reference, Re = 50; Re = 100"


def test_published_values_are_drawn_where_they_belong(tmp_path):
    published = [
        Published(label=f"other {n}", parameters={"reynolds": 50, "resolution": n}, values={DECAY: 1.0 * n})
        for n in (10, 12, *(9 * [12]))
    ]
    published = [other.replace(label=f"{other.label}, {k}") for k, other in enumerate(published)]
    figures = [Figure(name="decay", x="reynolds", y=[DECAY], where={"resolution": 12})]
    sweep = Sweep(product={"reynolds": [50, 200], "resolution": [10, 12]})
    rows = [({"reynolds": re, "resolution": n}, 1.0) for re in (50, 200) for n in (10, 12)]
    results = collected(tmp_path, rows, sweep=sweep, figures=figures, published=published)
    assert sum(name.startswith("other 12") for name in lines_of(results)) == 10
    assert not any(name.startswith("other 10") for name in lines_of(results))
    for other, message in (
        (
            Published(label="a", parameters={"reynold": 50}, values={}),
            "published a, parameters: no parameter",
        ),
        (Published(label="a", values={"decay rat": 1.0}), "published a, values: no result 'decay rat'"),
    ):
        wrong = declare(published=[other])
        with pytest.raises(ConfigError, match=message):
            study.check_names(wrong, wrong.points())


def test_a_figure_that_cannot_be_drawn_is_told_of(tmp_path):
    figures = [Figure(name="decay", x="reynolds", y=[DECAY], where={"resolution": 13})]
    sweep = Sweep(product={"reynolds": [50], "resolution": [12]})
    results = collected(tmp_path, [({"reynolds": 50, "resolution": 12}, 1.0)], sweep=sweep, figures=figures)
    assert results.warnings == ["figure decay: not drawn, no finished run has resolution = 13"] and not results.draw()


def test_never_more_threads_than_cores():
    cores = len(os.sched_getaffinity(0))
    assert _jobs(None, 1) == cores and _jobs(None, 10 * cores) == 1 and _jobs(1, 10 * cores) == 1
    with pytest.raises(ConfigError, match="on .* cores"):
        _jobs(cores + 1, 1)
    with pytest.raises(ConfigError, match="threads"):
        _jobs(None, 0)


# Interruption

# Long enough that a busy machine does not end it before it is interrupted.
LONG = {"case": "taylor_green", "resolution": 36, "run": {"until": 1.5, "output_interval": 0.25}}
LONG_TOML = """
name = "long"
[base]
case = "taylor_green"
resolution = 36
[base.run]
until = 1.5
output_interval = 0.25
[sweep.product]
reynolds = [50, 100]
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The long study, never interrupted."""
    output = tmp_path_factory.mktemp("whole")
    study.run(declare(name="long", base=LONG), output, progress=False)
    return {path.name: bits(path) for path in (output / RUNS).iterdir()}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_study_that_is_stopped_or_killed_goes_on_and_ends_with_the_same_bits(tmp_path, whole, number):
    file, output = tmp_path / "long.toml", tmp_path / "out"
    file.write_text(LONG_TOML)
    previous = signal.signal(signal.SIGINT, signal.SIG_IGN)  # as in the background of a script
    process = alsph_study(file, "-o", output)
    signal.signal(signal.SIGINT, previous)
    declared = study.load(file)
    wait_for(lambda: any(s.time > 0.1 for s in study.states(declared.points(), output).values()))
    process.send_signal(number)
    _, errors = process.communicate(timeout=60)
    if number == signal.SIGINT:
        assert process.returncode == 130 and "goes on from its checkpoint" in errors
    wait_for(lambda: all(s.status != "running" for s in study.states(declared.points(), output).values()))
    assert not all(s.status == "finished" for s in study.states(declared.points(), output).values())
    results = study.run(declared, output, progress=False)
    assert results.complete and not list((output / RUNS).glob("*.stop"))
    assert {path.name: bits(path) for path in (output / RUNS).iterdir()} == whole


def alsph_study(*arguments):
    command = [sys.executable, "-c", "from alsph.cli import main; main()", "study", *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def wait_for(condition, seconds=60.0):
    end = clock.monotonic() + seconds
    while not condition():
        assert clock.monotonic() < end, "waited in vain"
        clock.sleep(0.1)


# Clusters


@pytest.fixture
def cluster(tmp_path):
    """A Dask scheduler and two workers, each a process of its own: the scheduler's address and the workers."""
    file = tmp_path / "scheduler.json"
    scheduler = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "distributed.cli.dask_scheduler",
            "--scheduler-file",
            file,
            "--port",
            "0",
            "--host",
            "127.0.0.1",
            "--no-dashboard",
        ],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    wait_for(file.exists)
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", "--scheduler-file", file, "--nthreads", "1"]
    workers = [
        subprocess.Popen(
            [*worker, "--no-nanny", "--no-dashboard", "--local-directory", tmp_path / f"worker{index}"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        for index in range(2)
    ]
    yield json.loads(file.read_text())["address"], workers
    for process in (*workers, scheduler):
        process.kill()
        process.wait()


def test_a_study_on_a_cluster_survives_the_death_of_a_worker_with_the_same_bits(tmp_path, whole, cluster):
    address, workers = cluster
    declared, output = declare(name="long", base=LONG), tmp_path / "out"
    (tmp_path / "long.toml").write_text(LONG_TOML)
    process = alsph_study(tmp_path / "long.toml", "-o", output, "--scheduler", address)
    first = declared.points()[0].name

    def owner():
        # What run.json says is in a checkpoint; what the history holds may not be yet.
        path = output / RUNS / first / "run.json"
        info = json.loads(path.read_text()) if path.exists() else {}
        return info.get("pid") if info.get("time", 0.0) > 0.1 else None

    wait_for(owner)
    killed = next(worker for worker in workers if worker.pid == owner())
    killed.kill()
    assert process.communicate(timeout=120) and process.returncode == 0
    assert killed.wait() != 0
    assert "resumed" in (output / RUNS / first / "run.log").read_text()
    assert {path.name: bits(path) for path in (output / RUNS).iterdir()} == whole


def test_a_scheduler_that_does_not_answer_is_an_error_of_the_user(tmp_path):
    with pytest.raises(ConfigError, match="no Dask scheduler answers"):
        study.run(declare(), tmp_path, scheduler="tcp://127.0.0.1:9", progress=False)


def test_reading_a_study_that_runs_does_not_disturb_it(done):
    points = done.study.points()
    states = study.states(points, done.path.parent)
    assert [states[point.name].status for point in points] == ["finished", "finished"]
    assert np.isclose([states[point.name].time for point in points], 0.2, atol=0.01).all()


def test_a_wall_time_ends_a_study_that_goes_on_later(tmp_path):
    declared = declare(name="longer", base=LONG | {"run": {"until": 20.0}})
    with pytest.raises(WalltimeError, match="each run goes on when the study is run again"):
        study.run(declared, tmp_path, walltime=1.5, progress=False)
    assert {state.status for state in study.states(declared.points(), tmp_path).values()} <= {"stopped", "waiting"}
    assert study.run(declared, tmp_path, progress=False).complete


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"collect": ["mean drag"]}, "collect: no result 'mean drag'; did you mean 'mean drag coefficient'?"),
        (
            {"figures": [Figure(name="a", x="reynolds", y=["Strouhal number", "shedding period"])]},
            "figure a, y: no result 'shedding period'; did you mean 'shedding periods'?",
        ),
        (
            {"figures": [Figure(name="a", kind="profile", profile="pressure coeficient")]},
            "figure a, profile: no result 'pressure coeficient'; did you mean 'pressure coefficient'?",
        ),
    ],
)
def test_a_result_that_no_run_will_have_is_refused_before_the_first(tmp_path, alsph, changes, message):
    wrong = Study(name="a", base={"case": "cylinder"}, sweep=Sweep(product={"reynolds": [50]}), **changes)
    with pytest.raises(ConfigError) as error:
        study.run(wrong, tmp_path / "out", progress=False)
    assert str(error.value) == message and not (tmp_path / "out").exists()
    file = tmp_path / "a.toml"
    tables = wrong.model_dump(exclude_defaults=True)
    file.write_text(tomli_w.dumps({"figure" if key == "figures" else key: tables[key] for key in tables}))
    for arguments in (["--dry-run"], []):
        code, output, complaints = alsph("study", "run", file, "-o", tmp_path / "out", *arguments)
        assert (code, output, complaints) == (2, "", f"error: {message}\n")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "case",
    [
        Cylinder(reynolds=100, resolution=8, length=5.0, height=4.0, upstream=2.0),
        TaylorGreen(dimensions=3, resolution=8, reynolds=100),
        TaylorGreen(resolution=8),
        Couette(resolution=8),
    ],
    ids=lambda case: f"{case.name}{case.space_dimensions}",
)
def test_the_results_of_a_run_are_known_beforehand(tmp_path, case):
    run = case.run(tmp_path / "run", until=0.12, output_interval=0.02, progress=False)
    results, profiles = names(run.config)
    assert {measure.name for measure in run.measures} <= results
    for profile in run.profiles:
        assert profile.name in profiles or profile.name.startswith("velocity at tU/D = ")


@pytest.mark.parametrize("name", study.shipped())
def test_the_studies_that_come_with_alsph_ask_for_what_there_is(name):
    declared = study.load(name)
    study.check_names(declared, declared.points())


def test_a_study_of_a_case_with_units_tabulates_si():
    units = {"length": 0.01, "velocity": 0.02, "density": 1000.0, "kinematic_viscosity": 1e-6}
    asked = {"sweep": Sweep(product={"resolution": [8, 10]}), "collect": ["mean drag, N/m"]}
    plain = declare(base={"case": "cylinder"}, **asked)
    with pytest.raises(ConfigError, match="no result 'mean drag, N/m'"):
        study.check_names(plain, plain.points())
    declared = declare(base={"case": "cylinder", "units": units}, **asked)
    study.check_names(declared, declared.points())


def test_fields_are_drawn_in_the_window(tmp_path):
    run = Run(write_run(tmp_path / "run", Cylinder(resolution=8), end=40.0))
    inside = run.times[(run.times >= run.window.start) & (run.times <= run.window.end)]
    assert _time_of_largest_lift(run) in inside


def test_what_is_wrong_with_a_figure_names_its_table(tmp_path):
    file = tmp_path / "study.toml"
    good = '[[figure]]\nname = "a"\nx = "reynolds"\ny = ["Strouhal number"]\n'
    file.write_text(f'name = "s"\n[base]\ncase = "cylinder"\n[sweep.product]\nreynolds = [100]\n{good}{good}yy = 1\n')
    with pytest.raises(ConfigError, match=r"\[\[figure\]\] 2: yy: unknown parameter"):
        study.load(file)


def test_how_runs_were_averaged_can_be_tabulated_and_not_drawn():
    declared = declare(collect=["averaging rule"])
    study.check_names(declared, declared.points())
    drawn = declare(figures=[Figure(name="rule", x="reynolds", y=["averaging rule"])])
    with pytest.raises(ConfigError, match="figure rule, y: no result 'averaging rule'"):
        study.check_names(drawn, drawn.points())


def test_remarks_on_a_run_stand_beside_its_results(tmp_path):
    sweep = Sweep(product={"smoothing_ratio": [1.1, 1.25]})
    figures = [Figure(name="decay", x="smoothing_ratio", y=[DECAY])]
    results = study.run(declare(sweep=sweep, figures=figures), tmp_path, progress=False)
    assert ["kernel" in row.get("remarks", "") for row in results.rows] == [True, False]
    with (results.path / "results.csv").open() as file:
        assert [row["remarks"] for row in csv.DictReader(file)] == [row.get("remarks", "") for row in results.rows]
    assert "remarks" in results.to_markdown()
    assert "kernel: 1 of 2 runs" in results.draw()["decay"].get_supxlabel()


@pytest.mark.parametrize("width", [50, 80, 160])
def test_the_live_board_fits_its_terminal_and_says_what_went_wrong(width, tmp_path):
    declared = study.load("time-step")
    points = declared.points()[:4]
    board = Board(declared, points, tmp_path, enabled=False)
    board.console = Console(width=width, height=30, file=io.StringIO(), force_terminal=True, color_system=None)
    message = "broke down at step 7: the time step is above the limit of stability"
    found = {point.name: State("running", time=2.0) for point in points} | {
        points[1].name: State("failed", message=message)
    }
    board.console.print(board._table(found, board.start + 10))
    lines = board.console.file.getvalue().splitlines()
    assert max(map(len, lines)) <= width
    assert "t* 2.00 of 30  ETA ?" in lines[0] and lines[1].startswith("failed ")
    assert message.replace(" ", "") in "".join(lines).replace(" ", "")
