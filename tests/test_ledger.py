import numpy as np
import pytest
from alsph import Run
from alsph.cases import Cylinder, SolidBody, TaylorGreen
from alsph.config import Config, RunSettings
from alsph.folder.run_folder import RunFolder
from synthetic import history, write_run


def write_decay(path, case, times):
    """Write a run of `case` that follows the exact Taylor-Green vortices; `times` are those of the snapshots."""
    rows = history(end=0.5)
    decay = np.exp(-16 * np.pi**2 * rows["time"] / case.reynolds)
    rows |= {"kinetic_energy": 0.25 * decay, "volume": 1.01 * (1 - 1e-3 * rows["time"])}
    for name in ("pressure_force", "viscous_force", "pressure_torque", "viscous_torque"):
        del rows[name]
    folder = RunFolder(path)
    folder.create(Config(case, RunSettings(until=0.5)))
    folder.write_info({"status": "finished"})
    folder.append_history(rows, [])
    state = case.particles()
    for time in times:
        velocity = case.exact(state["position"], time)["velocity"]
        zeros = np.zeros(len(velocity))
        numbers = {"velocity_divergence": zeros, "vorticity": zeros, "id": np.arange(len(velocity))}
        folder.append_particles(time, state | {"velocity": velocity} | numbers)
    return Run(path)


def test_columns(tmp_path):
    run = write_decay(tmp_path / "run", TaylorGreen(resolution=10), [0.0])
    ledger = run.ledger
    assert ledger.volume_drift == pytest.approx(run.history["volume"] / run.history["volume"][0] - 1)
    assert ledger.volume_error[0] == pytest.approx(0.01, abs=1e-4)
    assert ledger.energy_rate == pytest.approx(-0.16 * np.pi**2 * ledger.kinetic_energy, rel=2e-2)
    assert (ledger.iterations == 5).all() and (ledger.divergence_max == 0.5).all()
    assert (ledger.divergence_mean == 5e-4).all() and (ledger.time == run.history["time"]).all()


def test_budget_of_exact_vortices_closes_with_second_order(tmp_path):
    errors = []
    for resolution in (24, 48):
        ledger = write_decay(tmp_path / str(resolution), TaylorGreen(resolution=resolution), [0.0, 0.2, 0.4]).ledger
        exact = 0.04 * np.pi**2 * np.exp(-0.16 * np.pi**2 * ledger.snapshot_time)
        errors.append(np.abs(ledger.dissipation / exact - 1).max())
        assert ledger.imbalance == pytest.approx(ledger.dissipation - exact, abs=0.01)
        assert (ledger.power == 0).all()
    assert errors[1] < 0.03
    assert 1.8 < np.log2(errors[0] / errors[1]) < 2.2


def test_work_of_the_body_force_and_of_moving_walls(tmp_path, monkeypatch):
    run = write_decay(tmp_path / "run", TaylorGreen(resolution=12), [0.1, 0.2])
    steps = len(run.history["time"])
    for part, force in (("pressure", 0.0), ("viscous", -0.3)):
        run.history[f"lid_{part}_force_x"], run.history[f"lid_{part}_force_y"] = np.full((2, steps), force)
    still = run.ledger
    monkeypatch.setattr(TaylorGreen, "bodies", lambda self: [SolidBody("lid", (0, 0), (2, 0))])
    monkeypatch.setattr(TaylorGreen, "body_force", lambda self: [1.0, 0.0])
    snapshot = Run.snapshot

    def moving(self, time=None):
        found = snapshot(self, time)
        found.velocity[:, 0] += 0.5
        return found

    monkeypatch.setattr(Run, "snapshot", moving)
    del run.ledger, run.config
    assert run.ledger.power == pytest.approx(2.0 * 0.3 + 0.5 * 1.0, rel=1e-3)
    assert run.ledger.dissipation == pytest.approx(still.dissipation, rel=1e-3)
    assert run.ledger.imbalance == pytest.approx(still.imbalance - run.ledger.power, abs=1e-3)


def test_with_inlet_and_outlet_there_is_no_budget_but_all_else(tmp_path):
    run = Run(write_run(tmp_path / "run", Cylinder(resolution=8, length=8.0, height=8.0), end=10.0))
    assert np.isnan([run.ledger.dissipation, run.ledger.power, run.ledger.imbalance]).all()
    assert run.ledger.volume_error == pytest.approx(run.history["volume"] / (64 - np.pi / 4) - 1)
    assert len(run.plot_ledger().axes) == 8


def test_ledger_of_a_short_run(tmp_path):
    case = TaylorGreen(resolution=25)
    run = case.run(tmp_path / "run", until=0.1, output_interval=0.05, threads=1, progress=False)
    ledger = run.ledger
    assert np.abs(ledger.volume_error).max() < 2e-3
    assert np.abs(ledger.imbalance).max() < 0.12 * ledger.dissipation.max()
    run.plot_ledger(tmp_path / "ledger.png")
    assert (tmp_path / "ledger.png").stat().st_size > 10_000
