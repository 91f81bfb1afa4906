import json
import os
import shutil
import signal
import threading
import time

import alsph
import h5py
import numpy as np
import pytest
from alsph import config
from alsph.cases import Cylinder, DamBreak, TaylorGreen
from alsph.engine.simulation import Simulation
from alsph.errors import ConfigError, Interrupted, RunFolderError, SolverError
from alsph.folder import run_folder, samples
from alsph.running.control import Control, interruptible
from alsph.running.start import resume, start

HISTORY_COLUMNS = (
    "step time time_step iterations converged divergence_max divergence_mean divergence_sum velocity_max "
    "penalty_coefficient volume kinetic_energy potential_energy dissipation packing_min packing_max packing_rms "
    "residual surface isolated "
    "mass_in mass_out inlet_pressure fluid inlet outlet solid returning "
    "drag_coefficient drag_pressure drag_viscous lift_coefficient lift_pressure lift_viscous "
    "cylinder_pressure_force_x cylinder_pressure_force_y cylinder_viscous_force_x cylinder_viscous_force_y "
    "cylinder_pressure_torque cylinder_viscous_torque"
).split()


def same(first, second):
    """Return whether two sets of arrays are the same to the last bit, NaN included."""
    return first.keys() == second.keys() and all(np.array_equal(first[k], second[k], equal_nan=True) for k in first)


def by_id(state):
    """Return the arrays of a state in the order of the particles' numbers."""
    order = np.argsort(state["id"])
    return {name: value[order] if np.ndim(value) else value for name, value in state.items()}


def test_run_folder(small, tmp_path):
    run = small.run(tmp_path / "run", until=0.25, threads=2, output_interval=0.1, progress=False)
    files = {path.name for path in run.path.iterdir()}
    names = (
        "case.toml run.json history.csv particles.vtkhdf surface.h5 checkpoint.h5 checkpoint.previous.h5 run.log .lock"
    )
    assert files == set(names.split())
    assert config.load(run.path / "case.toml").case == small

    info = json.loads((run.path / "run.json").read_text())
    assert info["status"] == "finished"
    assert info["threads"] == 2
    assert info["time"] >= 0.25
    assert info["versions"]["alsph"] == alsph.__version__
    assert info["peak_memory_bytes"] > 1e6
    assert {"commit", "machine", "seconds", "particles", "step", "case"} <= info.keys()

    assert set(run.history) == set(HISTORY_COLUMNS)
    assert run.history["step"].tolist() == list(range(1, info["step"] + 1))
    drag = 2 * (run.history["cylinder_pressure_force_x"] + run.history["cylinder_viscous_force_x"])
    assert run.history["drag_coefficient"] == pytest.approx(drag)
    assert run.history["drag_coefficient"] == pytest.approx(run.history["drag_pressure"] + run.history["drag_viscous"])

    step = run.history["time_step"].max()
    assert run.times == pytest.approx([0, 0.1, 0.2, 0.25], abs=1.01 * step)
    with h5py.File(run.path / "surface.h5") as file:
        assert file["time"][:] == pytest.approx([0.1, 0.2], abs=1.01 * step)
        assert file["pressure_coefficient"].shape == (2, 72)
        assert np.isfinite(file["pressure_coefficient"][:]).all()
    assert f"alsph {alsph.__version__}" in (run.path / "run.log").read_text().splitlines()[0]


def test_run_without_a_body(tmp_path):
    run = TaylorGreen(resolution=10).run(tmp_path / "run", until=0.05, progress=False)
    assert not (run.path / "surface.h5").exists()
    assert "drag_coefficient" not in run.history


def test_resumed_run_is_the_uninterrupted_run_to_the_last_bit(small, tmp_path):
    whole = small.run(tmp_path / "whole", until=0.2, output_interval=0.1, progress=False)
    part = small.run(tmp_path / "part", until=0.1, output_interval=0.1, progress=False)
    for until in (None, 0.05):  # it has reached that already
        files = {path.name: path.read_bytes() for path in part.path.iterdir()}
        assert resume(part.path, until=until, progress=False).status == "finished"
        assert files == {path.name: path.read_bytes() for path in part.path.iterdir()}
    part = resume(part.path, until=0.2, threads=1, progress=False)
    assert (part.path / "history.csv").read_text() == (whole.path / "history.csv").read_text()
    assert same(*(by_id(run_folder.RunFolder(run.path).read_checkpoint().state) for run in (whole, part)))
    assert part.times.tolist() == whole.times.tolist()
    assert config.load(part.path / "case.toml").run.until == 0.2


def test_what_is_later_than_the_checkpoint_is_done_again(small, tmp_path):
    run = small.run(tmp_path / "run", until=0.1, progress=False)
    checkpoint = (run.path / "checkpoint.h5").read_bytes()
    resume(run.path, until=0.2, progress=False)
    history = (run.path / "history.csv").read_text()
    (run.path / "checkpoint.h5").write_bytes(checkpoint)
    again = resume(run.path, until=0.2, progress=False)
    assert (run.path / "history.csv").read_text() == history
    assert len(again.times) == 3


@pytest.mark.filterwarnings("ignore:.*expect divergence")
def test_diverged_run_keeps_the_last_good_state(small, tmp_path):
    case = small.replace(time_step=0.3, penalty_constant=100.0, adaptive_time_step=False)
    with pytest.raises(SolverError, match=r"step \d+.*last good state, t\* = .*checkpoint.h5"):
        case.run(tmp_path / "run", until=20, progress=False)
    info = json.loads((tmp_path / "run" / "run.json").read_text())
    assert info["status"] == "diverged"
    assert "last good state" in info["message"]
    assert np.isfinite(run_folder.RunFolder(tmp_path / "run").read_checkpoint().state["velocity"]).all()
    assert "warning: time_step = 0.3" in (tmp_path / "run" / "run.log").read_text()
    assert alsph.open_run(tmp_path / "run").status == "diverged"


def test_a_run_that_does_not_know_all_parameters_is_not_resumed(small, tmp_path):
    run = small.run(tmp_path / "run", until=0.02, progress=False)
    file = run.path / "case.toml"
    file.write_text("".join(line for line in file.read_text().splitlines(True) if "projection_sweeps" not in line))
    with pytest.raises(RunFolderError, match=r"does not say what projection_sweeps was.*add the values"):
        resume(run.path, until=0.04, progress=False)


def test_disk_that_fills_up_leaves_a_folder_that_resumes(small, tmp_path, monkeypatch):
    usage, append = shutil.disk_usage(tmp_path), samples.append

    def fill(*arguments):
        monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=10))
        append(*arguments)

    monkeypatch.setattr(samples, "append", fill)
    with pytest.raises(RunFolderError, match="disk full"):
        small.run(tmp_path / "run", until=0.2, progress=False)
    monkeypatch.undo()
    info = json.loads((tmp_path / "run" / "run.json").read_text())
    assert (info["status"], "disk full" in info["message"]) == ("failed", True)
    assert resume(tmp_path / "run", progress=False).status == "finished"


def test_nothing_is_created_for_a_run_that_cannot_start(small, tmp_path):
    with pytest.raises(ConfigError, match="GiB of memory"):
        Cylinder(resolution=10**6).run(tmp_path / "run", progress=False)
    for threads in (0, -1):
        with pytest.raises(ConfigError, match=f"threads = {threads}"):
            small.run(tmp_path / "run", threads=threads, progress=False)
        with pytest.raises(ConfigError, match=f"threads = {threads}"):
            small.simulation(threads=threads)
    with pytest.raises(RunFolderError, match="not a folder that can be written to"):
        small.run("/proc/version/run", progress=False)
    assert not list(tmp_path.iterdir())


def test_existing_folder_is_replaced_only_by_force(small, tmp_path):
    small.run(tmp_path / "run", until=0.05, progress=False)
    with pytest.raises(RunFolderError, match="exists already"):
        small.run(tmp_path / "run", until=0.05, progress=False)
    run = small.run(tmp_path / "run", until=0.02, force=True, progress=False)
    assert run.history["time"][-1] < 0.04


def test_a_run_that_is_going_on_is_left_alone(small, tmp_path):
    folder = run_folder.RunFolder(small.run(tmp_path / "run", until=0.05, progress=False).path)
    assert not folder.is_busy()
    with run_folder.RunFolder(folder.path).claimed():
        assert folder.is_busy()
        with pytest.raises(RunFolderError, match=f"process {os.getpid()} on .* is still running it; wait for it"):
            resume(folder.path, until=0.1)
        with pytest.raises(RunFolderError, match="is still running it"):
            small.run(folder.path, force=True)
    assert resume(folder.path, until=0.06, progress=False).status == "finished"


@pytest.mark.parametrize("system", ["fcntl", "none"])
def test_who_looks_is_not_seen_as_busy(tmp_path, monkeypatch, system):
    if system == "none":
        monkeypatch.setattr(run_folder, "fcntl", None)
    folder = run_folder.RunFolder(tmp_path / "run")
    assert not folder.is_busy()
    with folder.claimed():
        assert folder.is_busy()
    assert not folder.is_busy()
    if system == "fcntl":
        with (folder.path / run_folder.LOCK).open("rb") as file:
            run_folder.fcntl.flock(file, run_folder.fcntl.LOCK_SH)
            assert not folder.is_busy()


@pytest.mark.parametrize("made_again", [False, True])
def test_a_folder_that_is_removed_under_a_run_is_not_written_to(small, tmp_path, monkeypatch, made_again):
    path, run_until = tmp_path / "run", Simulation.run_until

    def removed(self, *arguments):
        if (path / "case.toml").exists():
            shutil.rmtree(path)
        if made_again:
            with run_folder.RunFolder(path).claimed():
                pass
        return run_until(self, *arguments)

    monkeypatch.setattr(Simulation, "run_until", removed)
    with pytest.raises(RunFolderError, match="removed or replaced under the run"):
        small.run(path, until=0.1, progress=False)
    assert [file.name for file in path.glob("*")] == ([run_folder.LOCK] if made_again else [])


def test_run_in_a_thread(small, tmp_path):
    settings = config.Config(small, config.RunSettings(until=0.05))
    worker = threading.Thread(target=start, args=(settings, tmp_path / "run", Control(progress=False)))
    worker.start()
    worker.join()
    assert alsph.open_run(tmp_path / "run").status == "finished"


def test_plain_progress(small, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("alsph.running.progress.PLAIN_SECONDS", 0.0)
    small.run(tmp_path / "run", until=0.1)
    printed = capsys.readouterr().out.splitlines()
    remarks = [f"remark: {remark}" for remark in small.remarks()]
    assert remarks and printed[: len(remarks)] == remarks
    assert all(remark in (tmp_path / "run" / "run.log").read_text() for remark in remarks)
    lines = printed[len(remarks) :]
    assert lines
    for text in ("%", "steps/s", "ETA", "t* ", "2 iter  ", "max|∇·u|", "C_D", "C_L", "particles"):
        assert text in lines[0]


def test_stepping(small):
    simulation = small.simulation(threads=2)
    assert simulation.history()["drag_coefficient"].shape == (0,)
    assert simulation.advance(3) == 3
    assert simulation.run_until(0.05)
    assert simulation.time >= 0.05
    assert not simulation.run_until(100, wall_seconds=0.05)
    history = simulation.history()
    assert history["step"].tolist() == list(range(1, simulation.step + 1))
    assert simulation.history()["time"][-1] == simulation.time
    particles = simulation.snapshot()
    assert len(particles["position"]) == sum(simulation.counts.values())
    assert particles["vorticity"].shape == particles["pressure"].shape


def test_rows_that_are_not_kept_take_no_memory(small):
    simulation = small.simulation()
    simulation.advance(3)
    assert simulation.new_history(keep=False)["step"].tolist() == [1, 2, 3]
    simulation.advance(2)
    assert simulation.history()["step"].tolist() == [4, 5]


def test_steps_are_evenly_spaced(small):
    times = [0.1, 0.2, 0.25]
    simulation = small.replace(time_step=0.05).simulation()
    for state in simulation.steps(every=0.1, until=0.25):
        assert simulation.time == pytest.approx(times.pop(0), abs=0.0064)
        assert state["velocity"].shape[1] == 2
    assert not times
    assert simulation.until == small.default_until
    assert repr(simulation).startswith("Simulation(t* = 0.25")
    for every in (0, -1, np.nan):
        with pytest.raises(ConfigError, match=f"every = {every}"):
            next(simulation.steps(every=every))


def test_going_back_gives_the_same_steps(small):
    simulation = small.simulation()
    simulation.advance(3)
    state = simulation.state()
    simulation.advance(4)
    first, history = simulation.snapshot(), simulation.history()
    simulation.restore(state)
    assert simulation.step == 3
    simulation.advance(4)
    assert same(first, simulation.snapshot())
    assert same({name: column[3:] for name, column in history.items()}, simulation.history())


def test_one_thread_is_two_threads_to_the_last_bit(small):
    one, two = (small.simulation(threads=threads) for threads in (1, 2))
    for simulation in (one, two):
        simulation.advance(10)
    assert same(one.snapshot(), two.snapshot())
    assert same(one.history(), two.history())


def test_prescribed_inflow(small):
    calls = []

    def inflow(position, time):
        calls.append(time)
        assert position.shape == (simulation.counts["inlet"], 2)
        return np.stack([1 + 0.1 * np.cos(position[:, 1]), 0 * position[:, 0]], axis=1)

    simulation = small.simulation()
    simulation.set_inflow(inflow)
    simulation.advance(3)
    simulation.run_until(0.05)
    assert len(calls) == simulation.step
    state = simulation.snapshot()
    inlet = state["kind"] == 1
    assert state["velocity"][inlet, 0] == pytest.approx(1 + 0.1 * np.cos(state["position"][inlet, 1]), abs=1e-9)

    simulation.set_inflow([0.5, 0.0])
    simulation.advance(2)
    state = simulation.snapshot()
    assert (state["velocity"][state["kind"] == 1] == [0.5, 0.0]).all()
    with pytest.raises(ConfigError, match="inflow velocity"):
        simulation.set_inflow(np.zeros((3, 2)))
    when = rf"t\* = {simulation.time:.4g}".replace(".", r"\.")
    with pytest.raises(ConfigError, match=rf"inflow: the velocity at \(\S+, \S+\) and {when} is \(nan, 0\); all must"):
        simulation.set_inflow([np.nan, 0.0])


def test_symmetric_flow_has_no_lift(small):
    simulation = small.replace(perturbation=0.0).simulation()
    simulation.advance(30)
    history = simulation.history()
    assert np.abs(history["lift_coefficient"]).max() < 1e-9
    # Not for want of forces; the drag rings after the impulsive start, so its sign at one step says nothing.
    assert np.abs(history["drag_coefficient"]).max() > 0.5


def test_sample_is_the_uniform_flow_far_from_the_body(small):
    simulation = small.simulation()
    sample = simulation.sample(np.array([[0.3, 1.5], [100.0, 0.0]]))
    assert sample["velocity"][0] == pytest.approx([1, 0], abs=0.01)
    assert np.isnan(sample["pressure"][1])


def test_samples_are_of_the_domain_and_of_the_fluid_in_it(small):
    """Those beyond a periodic side are at the same places within, those beyond others, or deep in bodies, nowhere."""
    vortices = TaylorGreen(resolution=20).simulation()
    vortices.run_until(0.1)
    within, beyond = (vortices.sample(np.array([[x, 0.3], [0.3, x]])) for x in (0.15, 1.15))
    for name, values in within.items():
        assert values == pytest.approx(beyond[name], abs=1e-12) and np.isfinite(values).all()
    spacing = small.particle_spacing
    inside = small.simulation().sample(np.array([[2.0, 0.0], [2.0 - 0.5 + 1.7 * spacing, 0.0], [2.0, 2.0 + spacing]]))
    assert np.isnan(inside["pressure"]).all() and np.isnan(inside["velocity"]).all()
    water = DamBreak(resolution=16).simulation()
    height = water.state()["position"][:, 1].max() + 1.01 / 16
    above = water.sample(np.array([[0.5, height], [0.5, height - 0.03]]))["pressure"]
    assert np.isnan(above).tolist() == [True, False]


@pytest.mark.parametrize("algorithm", [1, 2, "original"])
def test_taylor_green_decays_as_the_exact_solution(algorithm):
    case = TaylorGreen(resolution=24, perturbation=0.1, algorithm=algorithm)
    simulation = case.simulation()
    simulation.run_until(0.3)
    state = simulation.snapshot()
    exact = case.exact(state["position"], simulation.time)["velocity"]
    assert np.abs(exact).max() < 0.8
    assert np.linalg.norm(state["velocity"] - exact) < 0.02 * np.linalg.norm(exact)


def test_taylor_green_in_three_dimensions():
    simulation = TaylorGreen(resolution=10, dimensions=3).simulation()
    simulation.advance(5)
    energy = simulation.history()["kinetic_energy"]
    assert (np.diff(energy) < 0).all()
    assert simulation.snapshot()["vorticity"].shape == (1000, 3)


def test_as_much_leaves_as_enters(small):
    simulation = small.simulation()
    simulation.run_until(3)
    history = simulation.history()
    entered, left = (history[name][-1] for name in ("mass_in", "mass_out"))
    assert entered == pytest.approx(3 * small.height, rel=0.05)
    assert left == pytest.approx(entered, rel=0.05)
    # At first whole columns of 32 particles of the lattice enter and leave at once, now one first, now the other.
    fluid = history["fluid"].astype(float)
    assert np.abs(fluid / fluid[0] - 1).max() < 0.03


def test_only_a_second_wish_to_stop_interrupts_at_once(monkeypatch):
    interrupted = threading.Event()
    with interruptible(interrupted) as signals:
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)  # the echo from a wrapper that passes the terminal's Ctrl-C on
        assert interrupted.is_set() and signals == [signal.SIGINT, signal.SIGINT]
        now = time.monotonic()
        monkeypatch.setattr(time, "monotonic", lambda: now + 2)
        with pytest.raises(Interrupted) as caught:
            signal.raise_signal(signal.SIGTERM)
        assert caught.value.exit_code == 143


@pytest.mark.filterwarnings("ignore:time_step")
def test_creeping_flow_is_stable_at_the_viscous_limit(small):
    """With half of this limit: the velocities that the cubic of the wall shows stiffen the viscous term."""
    simulation = small.replace(reynolds=1, resolution=10).simulation(2)
    simulation.run_until(0.15)
    assert simulation.history()["velocity_max"].max() < 2.2


def test_a_run_goes_on_with_the_flow_of_another_one(small, tmp_path):
    coarse = small.run(tmp_path / "coarse", until=0.3, progress=False)
    finer = small.replace(resolution=small.resolution + 4)
    run = finer.run(tmp_path / "finer", until=0.05, initial_run=str(coarse.path), progress=False)
    assert run.config.run.initial_run == str(coarse.path)
    energy, before = run.history["kinetic_energy"], coarse.history["kinetic_energy"]
    assert run.history["time"][0] < 0.05
    assert energy[0] == pytest.approx(before[-1], rel=0.02)
    assert abs(energy[0] - before[0]) > 2 * abs(energy[0] - before[-1])
    with pytest.raises(RunFolderError, match="nowhere: no such run folder"):
        finer.run(tmp_path / "other", initial_run="nowhere", progress=False)
    assert not (tmp_path / "other").exists()
