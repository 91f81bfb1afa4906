"""Columns that compare schemes: residual of the Poisson solve, packing, dissipation; and histories that lack them."""

import alsph
import numpy as np
import pytest
from alsph.cases import Cavity, Couette, Cylinder, TaylorGreen
from alsph.folder.run_folder import RunFolder
from alsph.results.outcome import unsolved

NEW = {"residual", "dissipation", "packing_min", "packing_max", "packing_rms"}


def without_new_columns(path):
    """Make a history that of an alsph that did not record what is new."""
    rows = [line.split(",") for line in (path / "history.csv").read_text().splitlines()]
    kept = [k for k, name in enumerate(rows[0]) if name not in NEW]
    assert len(rows[0]) == len(kept) + len(NEW)
    (path / "history.csv").write_text("".join(",".join(row[k] for k in kept) + "\n" for row in rows))


def test_an_older_run_is_read_goes_on_and_is_repeated(tmp_path, small):
    whole = small.run(tmp_path / "whole", until=0.1, threads=1, progress=False)
    run = small.run(tmp_path / "old", until=0.05, threads=1, progress=False)
    before = len(run.history["time"])
    without_new_columns(run.path)
    old = alsph.Run(run.path)
    assert not NEW & old.history.keys()
    assert old.summary().keys() == run.summary().keys()
    assert old.plot_ledger().axes
    assert alsph.compare([run.path, whole.path])
    assert alsph.repeat(run.path, progress=False).same
    history = alsph.resume(run.path, until=0.1, progress=False).history
    assert NEW < history.keys() == whole.history.keys()
    for name, values in whole.history.items():
        assert np.array_equal(history[name][before:], values[before:], equal_nan=True), name
        assert np.isnan(history[name][:before]).all() if name in NEW else (history[name] == values).all(), name
    assert alsph.repeat(run.path, progress=False).same
    row = dict.fromkeys(("step", "time", "mine"), np.array([9999]))
    RunFolder(run.path).append_history(row, [])
    last = {name: values[-1] for name, values in alsph.Run(run.path).history.items()}
    assert last["step"] == last["mine"] == 9999 and np.isnan(last["kinetic_energy"])


def test_steps_whose_pressure_is_not_solved_are_told(tmp_path):
    def ran(**chosen):
        case = TaylorGreen(resolution=16, perturbation=0.2, scheme="isph", **chosen)
        name = "_".join(map(str, chosen.values())) or "isph"
        return case.run(tmp_path / name, until=0.05, threads=1, progress=False)

    def said(run):
        return [remark for remark in run.remarks if remark.startswith("pressure not solved")]

    good, fixed = ran(), ran(solver_tolerance=0.0, solver_iterations=1)
    assert (good.history["residual"] <= 1e-3).all() and good.history["converged"].all()
    assert np.isfinite(fixed.history["residual"]).all()  # looked at, but there is no tolerance
    assert said(good) == said(fixed) == []
    capped = ran(solver="jacobi", solver_iterations=2)
    (remark,) = said(capped)
    steps, worst = len(capped.history["time"]), capped.history["residual"].max()
    assert remark.startswith(f"pressure not solved: in {steps} of {steps} steps the Poisson solve ended above its ")
    assert f"tolerance of 0.001, {steps} at the cap of 2 iterations, residual up to {worst:.2g}; raise" in remark
    assert remark in capped.summary().values()
    assert not capped.history["converged"].any()
    without_new_columns(capped.path)  # where `converged` said something else
    assert said(alsph.Run(capped.path)) == []


def test_a_solve_that_ends_by_a_change_says_what_it_leaves(tmp_path):
    def said(**chosen):
        case = Cylinder(resolution=8, length=5, height=4, upstream=2, **chosen)
        run = case.run(tmp_path / "_".join(map(str, chosen.values())), until=0.4, threads=1, progress=False)
        inside = (run.history["time"] >= run.window.start) & (run.history["time"] <= run.window.end)
        return [told for told in run.remarks if "ended by the change" in told], run.history["residual"][inside].mean()

    (remark,), mean = said(scheme="sisph")
    assert mean > 0.1 and "pressure not solved: Jacobi's iteration ended by the change of the pressure; " in remark
    assert f"the residual is {mean:.2g} in the mean; take a smaller solver_tolerance" in remark
    assert said(scheme="isph")[0] == said(scheme="shadloo")[0] == []
    assert said(scheme="isph", solver="jacobi", solver_tolerance=0.0, solver_iterations=3)[0] == []
    assert said(scheme="sisph", solver="bicgstab", solver_tolerance=0.3)[0] == []


def test_solves_that_came_no_further_and_steps_of_an_older_alsph(tmp_path):
    run = TaylorGreen(resolution=10, scheme="isph").run(tmp_path / "run", until=0.2, progress=False)
    steps = len(run.history["time"])
    run.history["residual"][:] = [np.nan, 0.03, 5e-3, *[1e-4] * (steps - 3)]
    run.history["converged"][:3] = 0
    (remark,) = unsolved(run, tolerance=1e-3, cap=200)
    assert f"in 2 of {steps - 1} steps" in remark and "0 at the cap of 200 iterations" in remark
    assert remark.endswith("residual up to 0.03; it fell no further; use another solver")
    run.history["residual"][:] = np.nan
    assert unsolved(run, tolerance=1e-3, cap=200) == []


@pytest.mark.parametrize(
    ("chosen", "most"),
    [
        ({}, 0.005),
        ({"shifting": "none"}, 0.005),
        ({"scheme": "isph"}, 0.005),
        ({"scheme": "explicit_isph"}, 0.005),
        ({"scheme": "wcsph"}, 0.01),
        ({"scheme": "edac"}, 0.01),
        ({"algorithm": 2}, 0.03),  # of first order in time, which takes energy
    ],
)
def test_vortices_lose_by_viscosity_what_they_lose(chosen, most):
    """dE/dt + dissipation, over the dissipation: what the scheme itself loses."""
    simulation = TaylorGreen(resolution=32, **chosen).simulation(threads=1)
    simulation.run_until(0.1)
    history = simulation.history()
    taken = (history["dissipation"] * history["time_step"])[1:].sum()
    lost = history["kinetic_energy"][0] - history["kinetic_energy"][-1]
    assert abs(lost / taken - 1) < most
    assert (history["packing_min"] > 0.9).all() and (history["packing_max"] < 1.2).all()
    assert (history["packing_rms"] < 0.05).all()


@pytest.mark.parametrize(
    ("case", "until", "most"), [(Couette(resolution=16), 1.0, 0.02), (Cavity(resolution=16), 3.0, 0.05)]
)
def test_walls_that_slide_give_what_viscosity_takes(case, until, most):
    """With them the budget closes, and the dissipation is never negative: in Couette flow at rest it is ν U²/D."""
    simulation = case.simulation(threads=1)
    simulation.run_until(until)
    history = {name: values[len(values) // 2 :] for name, values in simulation.history().items()}
    force = history["pressure_force"] + history["viscous_force"]
    velocity = np.array([body.velocity for body in case.checked_bodies])
    given = -(force * velocity).sum(axis=(1, 2))
    rate = np.gradient(history["kinetic_energy"], history["time"])
    loss = given - rate - history["dissipation"]
    assert np.abs(loss.mean()) < most * history["dissipation"].mean()
    assert (history["dissipation"] > 0).all()
