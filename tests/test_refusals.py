"""What functions are called with by mistake is told in a line; figures without anything to draw say so."""

import math
import re

import alsph
import numpy as np
import pytest
from alsph import cases
from alsph.errors import ConfigError
from alsph.study.autotune import autotune
from matplotlib.figure import Figure
from synthetic import write_run


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return alsph.Run(write_run(tmp_path_factory.mktemp("refusals") / "run", end=20.0))


@pytest.fixture(scope="module")
def still(tmp_path_factory):
    """Return a run without body, gauges and probes."""
    path = tmp_path_factory.mktemp("refusals") / "vortices"
    return cases.TaylorGreen(resolution=8).run(path, until=0.1, threads=1, progress=False)


SMALL = cases.TaylorGreen(resolution=8)


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda run: alsph.Simulation(None), "problem = None: must be what `case.build()` returns"),
        (lambda run: alsph.Simulation(SMALL.build(), until=None), "until = None: must be a number"),
        (lambda run: autotune("cylinder"), "case = 'cylinder': must be a case, such as alsph.cases.Cylinder()"),
        (lambda run: autotune(SMALL, "1e-3"), "divergence = '1e-3': must be a number above zero"),
        (lambda run: alsph.resume(None), "run = None: must be the path of a run folder"),
        (lambda run: alsph.resume(b"run"), "run = b'run': must be the path of a run folder"),
        (lambda run: alsph.repeat(None), "run = None: must be the path of a run folder"),
        (lambda run: alsph.Run(5), "run = 5: must be the path of a run folder"),
        (lambda run: SMALL.run(5), "folder = 5: must be the path of a run folder"),
        (lambda run: run.to_grid(spacing=1.0).save(None), "path = None: must be the path of a file"),
        (lambda run: run.plot_field("pressure", path=5), "path = 5: must be the path of a file"),
        (lambda run: run.plot_profile(None), "profile = None: must be one of run.profiles, or its name"),
        (
            lambda run: run.plot_pressure_coefficient(reference=([0, 90], [1])),
            "reference = ([0, 90], [1]): must be two arrays of numbers, of one length",
        ),
        (lambda run: run.to_grid(spacing=1.0, derived="q_criterion"), "derived = 'q_criterion': must be a list"),
        (lambda run: run.to_grid(spacing=1.0, derived=None), "derived = None: must be a list"),
        (lambda run: run.to_grid(spacing=True), "spacing = True: must be a number above zero [D]"),
        (
            lambda run: run.to_grid(spacing=1.0, lower=(100, 100), upper=(101, 101)),
            "box from [100.0, 100.0] to [101.0, 101.0]: lies outside of the domain, x from 0 to 8, y from -4 to 4 [D]",
        ),
        (
            lambda run: run.plot_field("pressure", view=(100, 101, -1, 1)),
            "view = (100, 101, -1, 1): lies outside of the domain, x from 0 to 8, y from -4 to 4 [D]",
        ),
    ],
)
def test_mistakes_are_told_in_a_line(run, call, told):
    with pytest.raises(ConfigError, match=re.escape(told)):
        call(run)


def test_a_part_that_reaches_into_the_domain_is_drawn(run):
    assert np.isfinite(run.to_grid(spacing=1.0, lower=(7, 3), upper=(100, 5)).fields["pressure"]).any()
    assert run.plot_field("pressure", view=(-50, 0.5, -1, 1)).axes


@pytest.mark.parametrize("force", [[math.nan, 0.0], ["a", 0.0], [1.0], None, "ab", [0.0, math.inf]])
def test_a_body_force_that_is_none_is_told(force, monkeypatch):
    class Pushed(cases.TaylorGreen):
        def body_force(self):
            return force

    told = re.escape(f"Pushed.body_force() gave {force!r}: it must return 2 finite numbers")
    with pytest.raises(ConfigError, match=told):
        Pushed(resolution=8).settings()


def said(figure: Figure) -> list[str]:
    return [text.get_text() for axes in figure.axes for text in axes.texts]


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("plot_gauges", "no gauges"),
        ("plot_probes", "no probes"),
        ("plot_forces", "no body whose forces are recorded"),
        ("plot_spectrum", "no body whose forces are recorded"),
    ],
)
def test_figures_without_anything_to_draw_say_so(still, run, tmp_path, name, why):
    figure = getattr(still, name)(tmp_path / "figure.png")
    assert said(figure) == [why] * len(figure.axes) and (tmp_path / "figure.png").is_file()
    if name in ("plot_forces", "plot_spectrum"):
        assert not said(getattr(run, name)())


def test_loads_without_a_body_are_no_numbers(still):
    moment = still.moment()
    for value in (moment.mean, moment.rms, still.load("x").mean):
        assert math.isnan(value) and value.note == "no body to measure"
    assert np.isnan(still.moment_coefficient()).all()
