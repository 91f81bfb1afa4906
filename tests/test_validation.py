import math
from dataclasses import replace
from types import SimpleNamespace

import pytest
from alsph import Run, validate
from alsph.analysis import averages
from alsph.analysis.measures import Measure
from alsph.cases import TaylorGreen
from alsph.cli.studies import _validated
from alsph.errors import ConfigError, SolverError
from alsph.running.driver import Driver
from alsph.study import validation
from alsph.study.validation import Entry

FAST = (Entry("taylor_green", (10, 20), until=0.1),)
STRICT = 1e-9


@pytest.fixture
def fast(monkeypatch):
    """Make the quick suite one that takes a second."""
    monkeypatch.setattr(validation, "QUICK", FAST)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Return the report of a fast validation."""
    return validate(suite=FAST, output=tmp_path_factory.mktemp("validation"), threads=1, progress=False)


def measuring(monkeypatch, measures):
    """Let every Taylor-Green run have the measures that a function of its resolution returns."""
    monkeypatch.setattr(TaylorGreen, "measures", lambda self, run: measures(self.resolution))


@pytest.mark.parametrize("order", [1.0, 2.0, 3.5])
def test_observed_order_is_recovered(order):
    assert averages.observed_order((25, 60), (25**-order, -(60**-order))) == pytest.approx(order)


@pytest.mark.parametrize("error", [(0.0, 0.1), (0.1, 0.0), (math.nan, 0.1), (0.1, math.nan)])
def test_no_order_without_two_errors(error):
    assert math.isnan(averages.observed_order((25, 50), error))


def test_report(finished):
    assert [(row.resolution, row.judged) for row in finished.rows] == [(10, False), (10, False), (20, True), (20, True)]
    coarse, fine = finished.rows[1], finished.rows[3]
    assert math.isnan(coarse.order)
    assert fine.order == pytest.approx(math.log2(coarse.measure.error / fine.measure.error))
    text = (finished.path / "report.md").read_text()
    assert text == finished.to_markdown() and finished.verdict in text and str(fine.cells[4]) in text
    assert len(finished.figures) == 2
    for name in finished.figures:
        assert f"]({name})" in text
        assert (finished.path / name).stat().st_size > 10_000
    assert finished.verdict in str(finished) and "<td>decay rate" in finished._repr_html_()
    (table, *_) = [part for part in text.split("\n\n") if part.startswith("| case")]
    assert len({len(line) for line in table.splitlines()}) == 1


def test_orders_and_verdict_of_synthetic_errors(finished, monkeypatch):
    def measures(resolution):
        return [
            Measure("second order", 1 + 4 / resolution**2, 1.0, 0.02, "exact"),
            Measure("first order", -0.5 / resolution, 0.0, 0.05, "exact"),
            Measure("unknown", 3.0),
        ]

    measuring(monkeypatch, measures)
    report = validate(suite=FAST, output=finished.path, progress=False)
    assert [row.order for row in report.rows[2:]] == pytest.approx([2.0, 1.0])
    assert [row.measure.name for row in report.rows] == ["second order", "first order"] * 2
    assert report.passed and report.verdict == "All well: 2 of 2 checks passed."
    assert report.rows[2].cells[6:] == ("+1 %", "2 %", "2.0", "pass")
    assert report.rows[0].cells[6:] == ("+4 %", "2 %", "", "")
    measuring(monkeypatch, lambda resolution: [*measures(resolution), Measure("wrong", math.nan, 1.0, 0.1, "exact")])
    report = validate(suite=FAST, output=finished.path, progress=False)
    assert not report.passed and report.verdict == "FAILED: 2 of 3 checks passed."
    assert report.rows[-1].cells[4:] == ("nan", "1", "", "10 %", "", "FAIL")
    uncertain = averages.Estimate(1.01, 0.04)
    measuring(monkeypatch, lambda n: [Measure("a", uncertain if n > 10 else 2.0, 1.0, 0.02, "exact")])
    row = validate(suite=FAST, output=finished.path, progress=False).rows[-1]
    assert row.cells[4] == "1.01 ± 0.04" and row.order > 5
    assert replace(row, order=9.6).cells[8] == "> 8"
    measuring(monkeypatch, lambda resolution: [])
    assert not validate(suite=FAST, output=finished.path, progress=False).passed


def test_finished_runs_are_used_again_and_changed_ones_are_not(finished):
    written = [run.path / "run.log" for run in finished.runs]
    logs = [log.read_text() for log in written]
    again = validate(suite=FAST, output=finished.path, progress=False)
    assert [log.read_text() for log in written] == logs
    assert str(again) == str(finished)
    assert validate("taylor_green", suite=FAST, output=finished.path, resolutions=[10], progress=False).runs[
        0
    ].path in [run.path for run in finished.runs]
    longer = (Entry("taylor_green", (10,), until=0.12),)
    validate(suite=longer, output=finished.path, threads=1, progress=False)
    assert written[0].read_text() != logs[0]
    assert written[1].read_text() == logs[1]


def test_finer_resolutions_may_go_on_with_the_flow_of_coarser_ones(tmp_path):
    suite = (Entry("taylor_green", (10, 14, 20), until=0.1, continued=0.05),)
    report = validate(suite=suite, output=tmp_path, threads=1, progress=False)
    assert [run.config.run.until for run in report.runs] == [0.1, 0.05, 0.05]
    assert [run.config.run.initial_run for run in report.runs] == [None, *(str(run.path) for run in report.runs[:2])]
    ends = [run.history["kinetic_energy"][[0, -1]] for run in report.runs]
    for (_, end), (begin, _) in zip(ends, ends[1:], strict=False):
        assert begin == pytest.approx(end, rel=0.1)  # the case's own start has 0.25


@pytest.mark.parametrize("lost", [[], ["checkpoint.h5"], ["checkpoint.h5", "run.json"]])
def test_a_validation_that_was_cut_goes_on(finished, tmp_path, monkeypatch, lost):
    record, calls = Driver._record, []

    def cut(self, reporter):
        calls.append(1)
        if len(calls) > 1:
            raise KeyboardInterrupt("stopped")
        return record(self, reporter)

    with monkeypatch.context() as patch:
        patch.setattr("alsph.running.driver.Driver._record", cut)
        with pytest.raises(KeyboardInterrupt):
            validate(suite=FAST, output=tmp_path, threads=1, progress=False)
    (folder,) = tmp_path.iterdir()
    assert Run(folder).status == "failed"
    for name in lost:
        (folder / name).unlink()
    report = validate(suite=FAST, output=tmp_path, threads=1, progress=False)
    assert ("resumed" in (folder / "run.log").read_text()) is (not lost)
    again = validate(suite=FAST, output=finished.path, threads=1, progress=False)
    assert [row.measure.value for row in report.rows] == [row.measure.value for row in again.rows]


def test_a_run_that_breaks_down_fails_and_the_others_go_on(finished, monkeypatch):
    run = validation.complete

    def broken(config, path, control):
        if config.case.resolution == 20:
            raise SolverError("step 7: the velocity is no number")
        return run(config, path, control)

    monkeypatch.setattr(validation, "complete", broken)
    report = validate(suite=FAST, output=finished.path, progress=False)
    (failed,) = [row for row in report.rows if row.judged]
    assert (failed.resolution, failed.measure.passed, failed.measure.source[:6]) == (20, False, "step 7")
    assert not report.passed and len(report.rows) == 3
    assert "step 7" in report.to_markdown()


def test_the_shipped_suites_can_be_built():
    for entry in (*validation.QUICK, *validation.FULL):
        assert list(entry.resolutions) == sorted(set(entry.resolutions))
        for resolution in entry.resolutions:
            config = entry.config(resolution, threads=None)
            assert (config.case.name, config.case.resolution, config.until) == (entry.case, resolution, entry.until)


def test_mistakes_in_python(tmp_path):
    with pytest.raises(
        ConfigError, match=r"cylinder: only in the full suite, which takes longer; use --full \(full=True\)"
    ):
        validate("cylinder", output=tmp_path / "out")
    with pytest.raises(ConfigError, match="did you mean 'taylor_green'"):
        validate("tayler_green", output=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_command_line(fast, alsph, tmp_path, monkeypatch):
    options = ["--threads", 1, "-o", tmp_path / "out"]
    code, stdout, _ = alsph("validate", "taylor_green", "--resolution", 12, "--resolution", 16, *options)
    assert "run 2 of 2: taylor_green, resolution 16; ETA of all" in stdout
    assert str(tmp_path / "out" / "report.md") in stdout
    assert code == (0 if "All well: 2 of 2" in stdout else 1)
    measuring(monkeypatch, lambda resolution: [Measure("energy", 1.0, 1.0, STRICT, "exact")])
    assert alsph("validate", *options)[0] == 0
    measuring(monkeypatch, lambda resolution: [Measure("energy", 1.1, 1.0, STRICT, "exact")])
    code, stdout, _ = alsph("validate", *options)
    assert (code, "FAILED: 0 of 1 checks passed." in stdout) == (1, True)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["cylinder"], "cylinder: only in the full suite, which takes longer; use --full"),
        (["cylindr"], "did you mean 'cylinder'?"),
        (["--resolution", "4"], "resolution = 4: must be greater than or equal to 8"),
        (["--threads", "0"], "threads = 0: must be greater than or equal to 1"),
    ],
)
def test_mistakes_are_exit_code_2(fast, alsph, tmp_path, arguments, message):
    code, _, stderr = alsph("validate", *arguments, "-o", tmp_path / "out")
    assert (code, message in stderr) == (2, True)
    assert not (tmp_path / "out").exists()


def test_the_report_carries_the_remarks_on_its_runs(finished, monkeypatch):
    monkeypatch.setattr(TaylorGreen, "remarks", lambda self: ["coarse: of few particles; take more"])
    again = replace(finished, runs=[Run(run.path) for run in finished.runs])
    assert "| coarse" in again.to_markdown() and "remarks" in finished.to_markdown()


OWN = """
from alsph.analysis.measures import Measure
from alsph.cases import TaylorGreen


class Gauged(TaylorGreen):
    resolution: int = 12

    @property
    def default_until(self):
        return 0.05

    def measures(self, run):
        return [Measure("number of particles", run.info["particles"]["fluid"], self.resolution**2, 1e-9, "a square")]
"""


def test_a_case_of_ones_own_is_validated_at_its_own_resolution_or_those_given(alsph, tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    own, options = f"{tmp_path}/own.py:Gauged", ["-o", tmp_path / "out"]
    code, stdout, stderr = alsph("validate", own, *options)
    assert "All well: 1 of 1" in stdout and "| gauged" in stdout, stderr
    assert (tmp_path / "out" / "gauged_resolution_12").is_dir()
    code, stdout, _ = alsph("validate", own, "--resolution", 10, "--resolution", 12, *options)
    assert (code, "run 2 of 2: gauged, resolution 12" in stdout, "All well: 1 of 1" in stdout) == (0, True, True)


def test_cases_that_cannot_be_validated(tmp_path):
    (tmp_path / "own.py").write_text(
        "from alsph.cases import CylinderPair\n\n\nclass Pair(CylinderPair):\n    height: float = 8.0\n"
    )
    with pytest.raises(ConfigError, match="own.py:Pair: nothing of it is compared; give it `measures`"):
        validate(f"{tmp_path}/own.py:Pair", output=tmp_path / "out")
    with pytest.raises(ConfigError, match="cylinder_pair: in no suite, it has no reference; alsph run"):
        validate("cylinder_pair", output=tmp_path / "out")
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "own.py").write_text(OWN)
    one, two = (f"{tmp_path}/{folder}/own.py:Gauged" for folder in ("one", "two"))
    with pytest.raises(ConfigError, match="there is a case 'gauged' before it"):
        validate(one, two, output=tmp_path / "out")
    (entry,) = validation._chosen([one, one], False, None)
    model = entry.model
    (tmp_path / "one" / "own.py").unlink()
    assert entry.model is model and entry.file_name == "gauged"  # the file is read once


def test_completion_offers_what_validate_takes():
    offered = {}
    for full in (False, True):
        offered[full] = _validated(SimpleNamespace(params={"full": full}))
        for name in offered[full]:
            assert validation._chosen([name], full, None)
    assert "cylinder" in set(offered[True]) - set(offered[False])
