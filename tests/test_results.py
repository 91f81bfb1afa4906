import json
import math
import shutil
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from alsph import Run, resume
from alsph.analysis import averages, sampling
from alsph.analysis.measures import Measure, Profile
from alsph.cases import Body, Couette, Cylinder, TaylorGreen, remarks
from alsph.config import Config
from alsph.errors import ConfigError, RunFolderError
from alsph.folder import reading
from alsph.folder.run_folder import RunFolder
from alsph.geometry.particles import Kind
from alsph.results import outcome
from synthetic import CIRCULATION, DRAG, LIFT, STROUHAL, history, signals, write_run


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("runs") / "shedding")


@pytest.fixture
def damaged(folder, tmp_path):
    """Return a copy of the folder, to be damaged."""
    return shutil.copytree(folder, tmp_path / "damaged")


def test_loads_and_strouhal_number(folder):
    run = Run(folder)
    assert run.window.settled and run.window.periods >= 8
    assert run.drag.mean == pytest.approx(DRAG, rel=2e-3)
    assert run.drag.pressure == pytest.approx(0.8 * DRAG, rel=2e-3)
    assert run.drag.viscous == pytest.approx(0.2 * DRAG, rel=2e-3)
    assert run.lift.rms == pytest.approx(LIFT / math.sqrt(2), rel=2e-3)
    assert run.lift.amplitude == pytest.approx(LIFT, rel=2e-3)
    assert run.lift.mean == pytest.approx(0.0, abs=1e-3)
    assert run.strouhal == pytest.approx(STROUHAL, rel=1e-3)
    for estimate in (run.drag.mean, run.lift.rms, run.strouhal):
        assert 0 < estimate.uncertainty < 0.01


def test_divergence_and_pressure_coefficient(folder):
    run = Run(folder)
    assert (run.divergence.mean, run.divergence.sum, run.divergence.max) == pytest.approx((5e-4, 8, 0.5))
    coefficient = run.pressure_coefficient
    ideal = 1 - 2 * np.sin(np.radians(coefficient.theta)) ** 2
    assert coefficient.mean == pytest.approx(ideal, abs=5e-3)
    assert coefficient.deviation[18] == pytest.approx(0.1 / math.sqrt(2), rel=0.02)
    assert coefficient.samples > 80


def test_summary_and_representations(folder):
    run = Run(folder)
    summary = run.summary()
    assert summary["status"] == "finished" and summary["steps"] == len(run.history["time"])
    assert summary["iterations of a step"] == "5 of at most 2, then 4 projection sweeps"
    assert summary["mean of the largest velocity divergence, |∇·u| D/U"] == pytest.approx(0.5)
    assert (summary["Reynolds number"], summary["resolution, D/Δx"]) == (200, 10)
    assert "message" not in summary and "mean drag coefficient, reference" not in summary
    assert repr(run).endswith("cylinder, finished, tU/D = 60.03)")
    assert "mean drag coefficient</th><td>1.4" in run._repr_html_()


def test_snapshots(folder):
    run = Run(folder)
    assert run.times == pytest.approx(np.arange(0, 61, 10.0))
    case = Cylinder(reynolds=200, resolution=10, length=8.0, height=8.0)
    snapshot = run.snapshot(31.0)
    assert snapshot.time == 30.0 and run.snapshot().time == 60.0
    assert snapshot.position == pytest.approx(case.particles()["position"], abs=1e-6)
    assert snapshot.velocity.shape == snapshot.position.shape == (len(snapshot.kind), 2)
    assert snapshot.fluid.sum() == (case.particles()["kind"] != 3).sum()


def test_momentum_balance_of_potential_flow_with_circulation(folder):
    drag, lift = Run(folder).momentum_balance((2.0, -2.0), (6.0, 2.0))
    assert drag == pytest.approx(0.0, abs=1e-3)
    assert lift == pytest.approx(-2 * CIRCULATION, rel=1e-3)


def test_control_volume_takes_in_friction_and_the_change_of_momentum():
    spacing = 0.05
    position = np.stack(np.meshgrid(*[np.arange(-1, 1, spacing)] * 2), axis=-1).reshape(-1, 2)
    shear = np.stack([position[:, 1] ** 2, np.zeros(len(position))], axis=1)
    box = np.array([-0.5, -0.25]), np.array([0.5, 0.25])
    surface, momentum = sampling.control_volume(position, shear, np.zeros(len(position)), box, spacing, 2.0, 0.1)
    assert surface == pytest.approx([2.0 * 0.1 * 2 * 0.5, 0.0], rel=0.02, abs=1e-12)
    assert momentum == pytest.approx([2.0 * 1.0 * 2 * 0.25**3 / 3, 0.0], rel=0.05, abs=1e-12)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_interpolation_is_exact_for_quadratic_fields(dimensions):
    rng = np.random.default_rng(0)
    position = rng.uniform(0, 1, (4000, dimensions))
    points = rng.uniform(0.2, 0.8, (20, dimensions))
    slope = rng.normal(size=(dimensions, 2))
    values, gradients = sampling.interpolate(position, (position @ slope) ** 2, points, 4000 ** (-1 / dimensions))
    assert values == pytest.approx((points @ slope) ** 2, abs=1e-9)
    assert gradients == pytest.approx((2 * points @ slope)[:, :, None] * slope.T, abs=1e-7)


def test_a_run_that_has_just_begun_gives_nan_and_reasons(damaged):
    for name in ("history.csv", "surface.h5", "particles.vtkhdf"):
        (damaged / name).unlink()
    run = Run(damaged)
    for estimate in (run.drag.mean, run.lift.rms, run.strouhal, run.divergence.mean):
        assert math.isnan(estimate) and "no steps" in estimate.note
    assert run.pressure_coefficient.samples == 0 and len(run.times) == 0
    assert np.isnan(run.momentum_balance((2, -2), (6, 2))).all()
    assert "0 steps" in repr(run) or "tU/D = 0" in repr(run)
    assert run.summary()["steps"] == 0 and run._repr_html_()
    assert run.summary()["iterations of a step"] == "at most 2, then 4 projection sweeps"
    with pytest.raises(RunFolderError, match="no snapshot yet"):
        run.snapshot()


@pytest.mark.parametrize("kept", [0, 1, 2, 5, 300])
def test_a_history_that_was_cut_short_is_read_up_to_the_cut(damaged, kept):
    lines = (damaged / "history.csv").read_text().splitlines(keepends=True)
    (damaged / "history.csv").write_text("".join(lines[: kept + 1]) + lines[kept + 1][:37])
    run = Run(damaged)
    assert len(run.history["time"]) == kept
    assert isinstance(run.summary()["mean drag coefficient"], float)
    assert math.isnan(run.strouhal) and run.strouhal.note


def test_a_snapshot_that_was_cut_short_does_not_count(damaged):
    with h5py.File(damaged / "particles.vtkhdf", "a") as file:
        file["VTKHDF/Steps"].attrs["NSteps"] = 3
    assert Run(damaged).snapshot().time == 20.0


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("case.toml", None, "case.toml is missing; is this a run folder"),
        ("case.toml", b"resolution = ", "case.toml: unreadable"),
        ("case.toml", b"[project]\nname = 'other'\n", "resolution is missing"),
        ("case.toml", b"resolution = -3\nreynolds = 1\n", "resolution is missing, not positive or too large"),
        ("run.json", None, "run.json is missing"),
        ("run.json", b'{"status": ', "run.json: unreadable"),
        ("run.json", b"[]", "run.json: holds no table"),
        ("history.csv", b"a,b\n1,2\n", "no column 'time'"),
        ("history.csv", b"time,x\n1,two\n", "history.csv: unreadable"),
        ("history.csv", b"\xff\xfe\n", "history.csv: unreadable"),
        ("surface.h5", b"not HDF5", "surface.h5: unreadable"),
        ("particles.vtkhdf", b"\x89HDF\r\n\x1a\n cut", "particles.vtkhdf: unreadable"),
    ],
)
def test_damaged_and_foreign_folders_are_refused_in_one_line(damaged, name, content, message):
    (damaged / name).unlink()
    if content is not None:
        (damaged / name).write_bytes(content)
    with pytest.raises(RunFolderError, match=message) as error:
        run = Run(damaged)
        run.summary(), run.pressure_coefficient, run.snapshot()
    assert "\n" not in str(error.value)


def test_what_an_hdf5_file_says_about_itself_is_not_trusted(damaged):
    with h5py.File(damaged / "particles.vtkhdf", "a") as file:
        file["VTKHDF/NumberOfPoints"][:] = 10**9
    with pytest.raises(RunFolderError, match="incomplete"):
        Run(damaged).snapshot()
    with h5py.File(damaged / "surface.h5", "a") as file:
        del file["angle"]
    with pytest.raises(RunFolderError, match="surface.h5: unreadable"):
        _ = Run(damaged).pressure_coefficient
    (damaged / "surface.h5").unlink()
    with h5py.File(damaged / "surface.h5", "w") as file:
        file["angle"], file["time"], file["pressure_coefficient"] = np.zeros(3), np.zeros(2), np.zeros((2, 4))
    with pytest.raises(RunFolderError, match="do not match"):
        reading.surface(damaged / "surface.h5")


def test_a_folder_that_is_not_there():
    with pytest.raises(RunFolderError, match="no such run folder"):
        Run("nowhere/at-all")


def test_mistyped_names_are_refused_with_what_there_is(tmp_path, small):
    run = small.run(tmp_path / "run", until=0.05, progress=False)
    for use, message in (
        (lambda: run.load("drag"), "axis = 'drag': unknown; known: x, y; the drag is x and the lift y"),
        (lambda: run.load("z"), "axis = 'z': unknown; known: x, y"),
        (lambda: run.load("x", "lowr"), "body = 'lowr': unknown; known: cylinder"),
        (lambda: run.load("x", "cylindr"), "body = 'cylindr': unknown; did you mean 'cylinder'?"),
        (lambda: run.coefficient("w", "presure"), "axis = 'w': unknown"),
        (lambda: run.coefficient("x", "presure"), "part = 'presure': unknown; did you mean 'pressure'?"),
        (lambda: run.coefficient("x", body=3), "body = 3: unknown; known: cylinder"),
        (lambda: run.plot_forces(body="wing"), "body = 'wing': unknown; known: cylinder"),
        (lambda: run.plot_spectrum(body="wing"), "body = 'wing': unknown; known: cylinder"),
        (lambda: run.plot_field("vortcity"), "unknown field 'vortcity'; did you mean 'vorticity'?"),
        (lambda: run.plot_field("vortcity", "late"), "unknown field 'vortcity'"),
        (lambda: run.plot_field("pressure", view=(1, 2, 3)), "view = .1, 2, 3.: needs left, right, bottom and top"),
        (lambda: run.plot_field("pressure", view=(2, 1, 0, 1)), "view = .2, 1, 0, 1.: needs left, right"),
        (lambda: run.plot_field("pressure", limit="high"), "limit = 'high': must be a number above zero"),
        (lambda: run.snapshot("late"), "time = 'late': must be a finite number"),
        (lambda: run.snapshot([1.0]), r"time = \[1.0\]: must be a finite number"),
        (lambda: run.momentum_balance((1, -1, 0), (3, 1, 1)), "needs corners of 2 finite numbers"),
        (lambda: run.momentum_balance((3, -1), (1, 1)), "the lower one first"),
    ):
        with pytest.raises(ConfigError, match=message):
            use()
    assert np.isfinite(run.coefficient("x", "viscous", "cylinder")).all()
    assert run.snapshot(np.float32(0.1)).time == run.times[-1]


def test_bodies_are_known_before_the_first_step(tmp_path, small):
    folder = RunFolder(tmp_path / "run")
    folder.create(Config(small))
    folder.announce(Config(small))
    run = Run(folder.path)
    assert run.coefficient("x", body="cylinder").size == 0
    with pytest.raises(ConfigError, match="body = 'wing': unknown; known: cylinder"):
        run.load("x", "wing")


def test_coefficients_are_twice_the_forces_of_history(folder):
    run = Run(folder)
    time = run.history["time"]
    drag, lift = signals(time, noise=0.01)
    for axis, whole in (("x", drag), ("y", lift)):
        assert run.coefficient(axis) == pytest.approx(whole, abs=1e-6)
        assert run.coefficient(axis, "pressure") == pytest.approx(0.8 * whole, abs=1e-6)
        assert run.coefficient(axis, "viscous", "cylinder") == pytest.approx(0.2 * whole, abs=1e-6)
    assert run.load("y", "cylinder").amplitude == run.lift.amplitude
    assert run.lift.pressure + run.lift.viscous == pytest.approx(run.lift.mean, abs=1e-9)
    assert run.body == "cylinder" and run.bodies == ["cylinder"] and run.spacing == pytest.approx(0.1)
    assert run._iterations() == "5 of at most 2, then 4 projection sweeps"


def test_what_an_older_version_has_not_recorded_is_not_known(damaged):
    header, *rows = [line.split(",") for line in (damaged / "history.csv").read_text().splitlines()]
    kept = [k for k, name in enumerate(header) if "torque" not in name and name != "cylinder_viscous_force_y"]
    assert len(header) - len(kept) == 3
    (damaged / "history.csv").write_text("".join(",".join(row[k] for k in kept) + "\n" for row in [header, *rows]))
    run = Run(damaged)
    assert np.isnan(run.moment_coefficient()).all() and math.isnan(run.moment().mean)
    assert np.isnan(run.coefficient("y")).all() and np.isnan(run.coefficient("y", "viscous")).all()
    assert run.lift.pressure == pytest.approx(0, abs=0.05) and run.drag.mean == pytest.approx(DRAG, rel=0.01)


def test_loads_are_those_of_all_bodies_together_or_of_the_first_wall(tmp_path):
    path = tmp_path / "two.txt"
    path.write_text("0 0\n.5 0\n.5 .5\n0 .5\n\n1.5 0\n2 0\n2 .5\n1.5 .5\n")
    for case, names, share in ((Body(shape=path), ["body_1", "body_2"], 4), (Couette(), ["lower", "upper"], 1)):
        folder = RunFolder(tmp_path / case.name)
        folder.create(Config(case))
        folder.announce(Config(case))
        rows = history(1.0)
        loads = {name: np.concatenate([each, 3 * each], axis=1) for name, each in rows.items() if each.ndim == 3}
        folder.append_history(rows | loads, names)
        run = Run(folder.path)
        drag, lift = rows["pressure_force"][:, 0].T * 2
        assert run.coefficient("x", "pressure") == pytest.approx(share * drag)
        assert run.coefficient("y", "pressure", names[1]) == pytest.approx(3 * lift)
        if share == 4:  # lifts that act a distance before the point put the nose up
            first, second = (body.center for body in case.bodies())
            behind = np.add(first, (1.5, 0))
            arms = 1.5 + 3 * (behind - second)[0]
            assert run.moment_coefficient("pressure", about=behind) == pytest.approx(arms * lift / 2**2)


def test_another_reference_area_changes_forces_and_no_moments(folder, monkeypatch):
    def found():
        run = Run(folder)
        return run.coefficient("y"), run.moment_coefficient(about=(0, 1))

    lift, moment = found()
    monkeypatch.setattr(Cylinder, "reference_area", 0.25)
    assert found()[0] == pytest.approx(4 * lift) and found()[1] == pytest.approx(moment) and np.abs(moment).max() > 1


def test_the_summary_of_a_run(folder):
    run = Run(folder)
    shown = {name: str(value) for name, value in run.summary().items()}
    window = run.window
    expected = {
        "case": "cylinder",
        "Reynolds number": "200",
        "resolution, D/Δx": "10",
        "status": "finished",
        "computing time": "0 s",
        "time reached, tU/D": f"{run.history['time'][-1]:.6g}",
        "steps": "6000",
        "iterations of a step": "5 of at most 2, then 4 projection sweeps",
        "averaged from tU/D": f"{window.start:.6g}",
        "averaged to tU/D": f"{window.end:.6g}",
        "averaging rule": window.rule,
        "shedding periods": str(window.periods),
        "mean velocity divergence, |∇·u| D/U": "0.0005",
        "mean velocity divergence at the end of a step, |∇·u| D/U": "0",
        "mean of the largest velocity divergence, |∇·u| D/U": "0.5",
        "artificial Mach number of the penalty": f"{np.mean(1.5 * run.history['time_step'] ** 0.5):.6g}",
    }
    assert list(shown.items())[: len(expected)] == list(expected.items())
    rest = list(shown.items())[len(expected) :]
    measures = [(each.name, str(each.value)) for each in run.measures]
    assert [
        item for item in rest if not item[0].startswith("remark ") and not item[0].endswith(", reference")
    ] == measures
    assert [value for name, value in rest if name.startswith("remark ")] == run.remarks
    assert ("remark 1", run.remarks[0]) in rest
    info = run.info | {"message": "stopped by hand", "seconds": 3700.0}
    run.info = info
    later = run.summary()
    assert later["message"] == "stopped by hand" and later["computing time"] != "0 s"


def test_references_stand_behind_their_measures(folder):
    run = Run(folder)
    nothing = Measure("drag", 1.25, math.nan, 0.1), Measure("symmetry", 0.01, 0.0, 0.1)
    run.measures = [Measure("lift", averages.Estimate(0.5, 0.1), -2.0, 0.1), *nothing]
    found = [(name, str(value)) for name, value in run.summary().items()]
    first = found.index(("lift", "0.50 ± 0.10"))
    assert found[first + 1 : first + 4] == [("lift, reference", "-2"), ("drag", "1.25"), ("symmetry", "0.01")]
    assert found[first + 4][0] == "remark 1"


def test_the_momentum_balance_is_of_the_snapshots_in_the_window(folder):
    """A stream that is sped up by a pressure gradient, without a body: what comes in stays in."""
    run = Run(folder)
    run.times = np.array([0.0, 1.0, 2.0, 4.0, 9.0])
    run.window = averages.Window(np.array([1.0, 4.0]), 1, True, "")
    first = run.snapshot(0.0)
    position = first.position[first.fluid]
    box = np.array([(1.0, -3.0), (3.0, -1.0)])
    to_faces = np.abs(position[:, None, :] - box).min(axis=(1, 2))
    solid = (np.arange(len(position)) % 7 == 0) & (to_faces > run.spacing)
    inside = ((position > box[0]) & (position < box[1])).all(axis=1)

    def snapshot(time, push=1.0):
        wild = 1.0 if 1 <= time <= 4 else 50.0
        velocity = wild * 0.5 * time**2 * np.array([1.0, 0.5]) + 0 * position
        pressure = wild * push * -time * (position @ [1.0, 0.5])
        return SimpleNamespace(
            time=time,
            position=position,
            velocity=np.where(solid[:, None], 99, velocity),
            pressure=np.where(solid, 99, pressure),
            fluid=~solid,
        )

    run.snapshot = snapshot
    whole = 2 * 4 * 7.5 / 3 * np.array([1.0, 0.5])  # 2 V Δu / Δt, the fluid being all there
    balance = run.momentum_balance(*box)
    run.snapshot = lambda time: snapshot(time, 0.0)
    unpushed = run.momentum_balance(*box)
    # trapezia of the pressure's push, 2 V t: (1.5 + 2 * 3) / 3 = 2.5
    assert balance - unpushed == pytest.approx(2 * 4 * 2.5 * np.array([1.0, 0.5]), rel=1e-6)
    assert unpushed == pytest.approx(-whole * (~solid)[inside].mean(), rel=0.02)
    run.window = averages.Window(np.array([1.5, 3.0]), 1, True, "")
    assert np.isnan(run.momentum_balance(*box)).all() and len(run.momentum_balance(*box)) == 2


def test_points_and_boxes_that_are_none_are_refused(folder):
    run = Run(folder)
    for lower, upper in (((1, 2), (1, 3)), ((1, 2), (3, 2)), ((1, 2, 3), (2, 3, 4)), ((1, 2), (2, 3, 4))):
        with pytest.raises(ConfigError, match="needs corners of 2 finite numbers, the lower one first"):
            run.momentum_balance(lower, upper)
    with pytest.raises(ConfigError, match="a face goes through a body at"):
        run.momentum_balance((3.9, -1), (6, 1))
    with pytest.raises(ConfigError, match="reaches out of the domain"):
        run.momentum_balance((1, -100), (3, 1))
    assert run.snapshot(26).time == 30 and run.snapshot(24).time == 20 and run.snapshot(-5.0).time == 0
    for time in (math.nan, math.inf, "1"):
        with pytest.raises(ConfigError, match="must be a finite number"):
            run.snapshot(time)


def test_figures_are_saved_where_they_shall_be_and_carry_the_remarks(folder, tmp_path):
    run = Run(folder)
    curve = np.arange(0.0, 181.0, 45.0), np.zeros(5)
    for name, figure in (
        ("forces", run.plot_forces(tmp_path / "forces.png")),
        ("spectrum", run.plot_spectrum(tmp_path / "spectrum.png", "cylinder")),
        ("field", run.plot_field("pressure", 30.0, tmp_path / "field.png", limit=0.25, view=(2, 6, -2, 2))),
        ("surface", run.plot_pressure_coefficient(tmp_path / "surface.png", curve)),
        ("ledger", run.plot_ledger(tmp_path / "ledger.png")),
    ):
        assert (tmp_path / f"{name}.png").stat().st_size > 1000
        assert remarks.brief(run.remarks) in [text.get_text() for text in figure.texts]
        if name == "field":
            assert (figure.axes[0].get_xlim(), figure.axes[0].get_ylim()) == ((2, 6), (-2, 2))
            assert "30" in figure.axes[0].get_title() + figure.axes[0].get_title("left")
        if name == "surface":
            assert any(np.array_equal(line.get_ydata(), curve[1]) for line in figure.axes[0].lines)
        if name == "spectrum":
            assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()] == ["shedding"]
    assert len(list(tmp_path.glob("*.png"))) == 5 and run.plot_forces().axes


def test_a_profile_is_drawn_beside_its_reference(folder, tmp_path):
    run, x = Run(folder), np.arange(3.0)
    figure = run.plot_profile(Profile("u", ("x", "y"), (x, x**2), (x, 2 * x), "theory"), tmp_path / "profile.png")
    drawn = {line.get_label(): line.get_ydata().tolist() for line in figure.axes[0].lines}
    assert drawn == {"computed": [0, 1, 4], "reference: theory": [0, 2, 4]} and (tmp_path / "profile.png").exists()
    assert remarks.brief(run.remarks) in [text.get_text() for text in figure.texts]


@pytest.mark.parametrize("status", ["starting", "running"])
def test_a_run_without_a_process_is_stopped(damaged, monkeypatch, status):
    (damaged / "run.json").write_text(f'{{"status": "{status}", "case": "cylinder"}}')
    whole = "no process is at work in it, it was killed or its machine went down; go on with: "
    stopped = Run(str(damaged))
    assert (stopped.status, stopped.info["message"]) == ("stopped", f"{whole}alsph run, with --force")
    (damaged / "checkpoint.h5").write_bytes(b"")
    assert Run(damaged).info == {
        "status": "stopped",
        "case": "cylinder",
        "message": f"{whole}alsph resume {damaged}",
    }
    for busy in (True, None):
        monkeypatch.setattr(RunFolder, "is_busy", lambda self, busy=busy: busy)
        assert Run(damaged).status == status and "message" not in Run(damaged).info
    monkeypatch.setattr(
        RunFolder, "is_busy", lambda self: (damaged / "run.json").write_text('{"status": "finished"}') < 0
    )
    assert Run(damaged).status == "finished" and "message" not in Run(damaged).info
    (damaged / "run.json").write_text("{}")
    assert Run(damaged).status == "unknown"


def test_a_run_is_that_of_its_folder_wherever_the_process_has_gone(folder, tmp_path, monkeypatch):
    monkeypatch.chdir(folder.parent)
    run = Run(folder.name)
    monkeypatch.chdir(tmp_path)
    assert run.history["time"][-1] > 60 and run.snapshot().time == 60 and run.config.case.reynolds == 200
    assert str(run.path) == folder.name


def test_a_run_does_not_mix_with_another_that_is_made_in_its_folder(tmp_path):
    first = TaylorGreen(resolution=8).run(tmp_path / "run", until=0.02, progress=False)
    again = TaylorGreen(resolution=8).run(tmp_path / "run", until=0.04, progress=False, force=True)
    assert first.history["time"][-1] == again.history["time"][-1]  # of the same flow, and longer
    TaylorGreen(resolution=10).run(tmp_path / "run", until=0.02, progress=False, force=True)
    for read in (first.snapshot, again.summary, lambda: first.remarks):
        with pytest.raises(
            RunFolderError, match="another run has been made there since this one was opened; open it anew"
        ):
            read()


def test_a_history_that_was_cut_at_its_end_is_told(damaged):
    assert not any("incomplete" in remark for remark in Run(damaged).remarks)
    info = json.loads((damaged / "run.json").read_text())
    lines = (damaged / "history.csv").read_text().splitlines(True)
    (damaged / "run.json").write_text(json.dumps(info | {"step": len(lines) - 1}))
    assert not any("incomplete" in remark for remark in Run(damaged).remarks)
    (damaged / "history.csv").write_text("".join(lines[:-5]))
    (told,) = [remark for remark in Run(damaged).remarks if "incomplete" in remark]
    assert told.startswith(
        f"incomplete: 5 of {len(lines) - 1} steps are missing in the history, the first behind step "
    )


def test_a_snapshot_is_as_near_as_they_are_to_each_other(folder):
    run = Run(folder)
    apart = np.diff(run.times).max()
    assert run.snapshot(run.times[-1] + 0.9 * apart).time == run.times[-1]
    for time in (run.times[-1] + 1.1 * apart, run.times[0] - 1.1 * apart):
        with pytest.raises(ConfigError, match="no snapshot near it"):
            run.snapshot(time)


def test_the_divergence_where_steps_end_is_told_beside_that_of_their_derivatives(tmp_path):
    case = TaylorGreen(resolution=16, algorithm=2, time_step=0.0508, penalty_constant=100.0, projection_sweeps=0)
    run = case.run(tmp_path / "run", until=0.4, output_interval=0.05, progress=False)
    times = [time for time in run.times if max(run.window.start, 1e-9) <= time <= run.window.end]
    snapshots = [run.snapshot(time) for time in times]
    ends = [abs(each.velocity_divergence[each.kind == Kind.FLUID]).mean() for each in snapshots]
    assert run.divergence.at_end == pytest.approx(np.mean(ends)) and len(ends) >= 3
    assert run.divergence.at_end > 2 * run.divergence.mean
    assert run.summary()["mean velocity divergence at the end of a step, |∇·u| D/U"] == run.divergence.at_end
    told = [remark for remark in run.remarks if remark.startswith("not divergence-free")]
    assert bool(told) == (run.divergence.at_end > outcome.DIVERGENCE)
    assert all("where steps end" in remark for remark in told)
    (run.path / "particles.vtkhdf").unlink()
    without = Run(run.path)
    assert math.isnan(without.divergence.at_end) and without.divergence.mean == run.divergence.mean


def test_parameters_that_were_changed_after_the_run_are_told_and_have_no_reference(tmp_path):
    case = Cylinder(reynolds=100, resolution=8, length=5, height=4, upstream=2)
    run = case.run(tmp_path / "run", until=0.05, progress=False)
    assert not any(remark.startswith("edited") for remark in run.remarks)
    text = (run.path / "case.toml").read_text()
    for old, new in (("reynolds = 100.0", "reynolds = 200.0"), ("upstream = 2.0", "upstream = 2.5")):
        assert old in text
        (run.path / "case.toml").write_text(text.replace(old, new))
        edited, change = Run(run.path), f"{old.replace(' =', '')} -> {new.rpartition(' ')[2]}"
        told = f"edited: case.toml was changed after the run was made: {change}; put it back"
        assert any(remark.startswith(told) for remark in edited.remarks), edited.remarks
        assert not any(name.endswith("reference") for name in edited.summary())
    (run.path / "case.toml").write_text(text.replace("tolerance = 0.001", "tolerance = 0.002"))
    resumed = resume(run.path, until=0.1, progress=False)
    assert not any(remark.startswith("edited") for remark in Run(resumed.path).remarks)


def test_particles_that_are_not_placed_by_the_spacing_are_told(tmp_path, damaged):
    assert not any(remark.startswith("packing") for remark in Run(damaged).remarks)
    lines = [line.split(",") for line in (damaged / "history.csv").read_text().splitlines()]
    for name, value in (("rms", "0.21"), ("min", "1.1"), ("max", "1.3")):
        for line in lines[1:]:
            line[lines[0].index(f"packing_{name}")] = value
    (damaged / "history.csv").write_text("".join(",".join(line) + "\n" for line in lines))
    (told,) = [remark for remark in Run(damaged).remarks if remark.startswith("packing")]
    assert "1.1 to 1.3 times as dense as particles Δx apart, 21 % off" in told
