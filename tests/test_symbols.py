"""What cases call D and U: in texts and formulas, and in all that is told of a run."""

import re

import alsph
import pytest
from alsph import cases, plotting
from alsph.cli.options import idle
from alsph.config import Config, RunSettings
from alsph.running.describe import describe
from alsph.study.convergence import converge
from alsph.symbols import GENERAL, WATER, Symbols, in_common
from alsph.watching.watched import Watched
from matplotlib.text import Text

DROP = cases.EllipticalDrop.symbols
OLD = re.compile(r"(?<![A-Za-z_-])[DU](?![A-Za-z_])|UD|tU|D/U|U/D")
"""D and U, but for those in words."""


@pytest.mark.parametrize(
    ("text", "water", "drop"),
    [
        ("end time [D/U]", "end time [√(H/g)]", "end time [A₀⁻¹]"),
        ("[D], [U] and [U²/D] in 2-D", "[H], [√(gH)] and [g] in 2-D", "[R], [A₀R] and [A₀²R] in 2-D"),
        ("ΔtU/Δx < 2 at u_max = 1 U", "Δt√(gH)/Δx < 2 at u_max = 1 √(gH)", "ΔtA₀R/Δx < 2 at u_max = 1 A₀R"),
        ("Reynolds number UD/ν [-]", "Reynolds number √(gH)·H/ν [-]", "Reynolds number A₀R·R/ν [-]"),
        ("reached, tU/D", "reached, t√(g/H)", "reached, A₀t"),
        ("energy E / ρU² Dᵈ", "energy E / ρgH Hᵈ", "energy E / ρA₀²R² Rᵈ"),
        (r"$tU/D$ = 2", r"$t\sqrt{g/H}$ = 2", "$A_0t$ = 2"),
        (r"vorticity $\omega D/U$", r"vorticity $\omega \sqrt{H/g}$", r"vorticity $\omega A_0^{-1}$"),
        (r"$p\,/\,\rho U^2$", r"$p\,/\,\rho gH$", r"$p\,/\,\rho A_0^2R^2$"),
        (r"$Q\,D^2/U^2$", r"$Q\,H/g$", r"$Q\,(A_0^{-1})^2$"),
        (r"$\Delta tU/\Delta x$", r"$\Delta t\sqrt{gH}/\Delta x$", r"$\Delta tA_0R/\Delta x$"),
        (r"dam_D, $C_D$ of 5 \$D", r"dam_D, $C_D$ of 5 \$H", r"dam_D, $C_D$ of 5 \$R"),
        ("rho U^2, U^2/D^2", "ρgH, g/H", "ρA₀²R², (A₀)²"),
    ],
)
def test_a_text_in_the_names_of_a_case(text, water, drop):
    assert (GENERAL(text), WATER(text), DROP(text)) == (text, water, drop)
    assert WATER(water) == water and DROP(drop) == drop


def test_cases_that_differ_share_the_general_names():
    assert in_common([WATER, WATER]) == WATER
    assert in_common([WATER, DROP]) == in_common([]) == GENERAL


def test_a_case_without_gravity_that_says_nothing_keeps_the_general_names():
    class Drops(cases.EllipticalDrop):
        symbols = WATER

    assert (cases.FreeSurface.symbols, cases.DamBreak.symbols) == (WATER, WATER)
    assert (Drops.symbols, cases.Cylinder.symbols) == (GENERAL, GENERAL)


@pytest.fixture(scope="module", params=["still_water", "elliptical_drop", "rotating_patch"])
def run(request, tmp_path_factory):
    """A short run of a case with names of its own."""
    case = cases.CASES[request.param](resolution=8)
    path = tmp_path_factory.mktemp(request.param) / "run"
    return case.run(path, until=0.1, output_interval=0.05, progress=False)


def test_all_that_is_told_of_a_run_has_the_names_of_its_case(run, tmp_path, monkeypatch):
    told = [*run.summary(), *run.remarks, repr(run), *sum(describe(Config(run.config.case), probe=False), ())]
    drawn = [run.plot_ledger(), *(run.plot_field(name) for name in plotting.FIELDS)]
    monkeypatch.setattr(plotting.animation, "_pixels", lambda figure: drawn.append(figure))
    monkeypatch.setattr(plotting.animation, "_write_gif", lambda frames, path, fps: [path.touch(), *frames])
    run.animate("velocity", tmp_path / "film.gif")
    told += [label.get_text() for figure in drawn for label in figure.findobj(Text)]
    told.append(Watched(run.path).state().decode("unicode_escape", "replace"))
    assert len(drawn) > 2 + len(plotting.FIELDS)
    odd = [text for text in told if OLD.search(text.replace("CPU", ""))]
    assert not odd
    words = "\n".join(told)
    symbols = run.symbols
    assert f"resolution, {symbols.length}/Δx" in run.summary() and f"time reached, {symbols.clock}" in run.summary()
    assert f"${symbols.length}/\\Delta x$ = 8" in words and f"Δx = 0.125 {symbols.length}" in words


def test_units_of_grids_are_told_in_the_names_of_the_case(run):
    pytest.importorskip("xarray")
    dataset = run.to_grid().to_xarray()
    assert dataset["x"].units == run.symbols.length and dataset.time_units == run.symbols.time
    assert (dataset["velocity_x"].units, dataset["pressure"].units) == (run.symbols.velocity, run.symbols.pressure)


@pytest.mark.parametrize("model", [model for model in cases.CASES.values() if issubclass(model, cases.FreeSurface)])
def test_help_of_a_free_surface_has_its_names_and_what_applies(alsph, model):
    text = alsph("autotune", model.name, "--help")[1]
    assert not OLD.search(text.replace("CPU", "")) and f"[{model.symbols.time}]" in text
    for hidden in (
        "shift",
        *(["wall-", "surface-"] if not (model(resolution=8).bodies() or "walls" in model.model_fields) else []),
        "density-relaxation",
        "inlet",
        "initial-run",
        "viscous",
    ):
        assert f"--{hidden}" not in text
    for shown in ("--reynolds", "--scheme", "--sound-speed", "--courant", "--pressure-gradient", "--probes", "--until"):
        assert shown in text
    assert ("--driving-force" in text) == (model.name != "sloshing")


def test_what_is_not_shown_is_still_taken_and_refused_in_words(alsph, tmp_path):
    assert alsph("describe", "still_water", "--resolution=8", "--shifting=none", "--no-probe")[0] == 0
    code, _, complaint = alsph("describe", "still_water", "--shifting=xsph")
    assert code == 2 and "shifting = 'xsph'" in complaint


def test_only_what_acts_on_nothing_is_hidden():
    hidden = {name: idle(model, model()) for name, model in cases.CASES.items()}
    gauges = {"gauges", "gauge_interval"}
    assert hidden["cylinder"] == gauges <= hidden["elliptical_drop"] and not gauges & hidden["dam_break"]
    assert hidden["cavity"] == {"body_motion", "inlet_velocity", "surface_interval", "uncertainty", "latest"} | gauges
    assert "driving_force" in hidden["pulsating_channel"]
    assert hidden["taylor_green"] > {"wall_velocity", "wall_pressure", "surface_velocity"}
    assert idle(cases.DamBreak, None) >= {"density_relaxation", "shift_limit", "viscous_theta"}


def test_a_study_of_water_is_told_in_its_names(tmp_path):
    report = converge(Config(cases.StillWater(), RunSettings(until=0.05)), [8, 10, 12], tmp_path, progress=False)
    assert "H/Δx = 8" in str(report) and report.draw().axes[0].get_xlabel() == r"$\Delta x/H$"
    runs = [alsph.Run(tmp_path / "runs" / path.name) for path in sorted((tmp_path / "runs").iterdir())]
    told = str(alsph.compare(runs))
    assert "time reached, t√(g/H)" in told and "steps a √(H/g)" in told and not OLD.search(told.replace("CPU", ""))


def test_symbols_are_said_once():
    """In a class of one's own, too."""

    class Waves(cases.StandingWave):
        symbols = Symbols("h", "c", "h/c", "c/h", "c²/h", "ρc²", "tc/h")

    assert Waves.describe("resolution") == "particles over the depth, H/Δx [-]"
    assert Waves.describe("time_step").startswith("upper bound of the time step, Δtc/Δx")
