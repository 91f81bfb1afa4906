"""The simulation: particles, and the means to step them."""

import json
import math
import os
import threading
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import alsph._alsph as _alsph
from alsph.arguments import number, whole
from alsph.arrays import Arrays, FloatArray
from alsph.engine.columns import left_out
from alsph.engine.core import TYPES, exact, translated
from alsph.engine.motion import answering_poses, is_rigid
from alsph.engine.prescribed import Prescription, Rule, answering, asked, backflow
from alsph.engine.problem import Problem
from alsph.engine.times import next_multiple, slices
from alsph.errors import ConfigError, SharedError, SolverError
from alsph.geometry.domain import Domain
from alsph.geometry.particles import Kind
from alsph.text import shown

AS_IT_IS: Any = object()
"""Stands for a rule that is not named."""


class Simulation:
    """State and stepping of one simulation.

    Parameters
    ----------
    problem
        Settings and particles, for instance from ``case.build()``.
    threads
        Number of threads; all cores if None. The result does not depend on it.
    until
        Default end time of :meth:`steps`.

    Raises
    ------
    ConfigError
        If the settings or the particles cannot be used.

    Warns
    -----
    RuntimeWarning
        Once, if fluid is to leave through an inlet in places (:attr:`backflow`).

    Attributes
    ----------
    rules : dict of function
        Those that :meth:`set_inflow` and :meth:`prescribe` were given: ``inflow``, ``forcing``, ``sliding`` and
        ``motion``.
    prescribed : dict of Prescription
        What they gave for the last step.
    backflow : str
        The warning of fluid that leaves through an inlet; empty without.
    """

    def __init__(self, problem: Problem, threads: int | None = None, until: float = math.inf) -> None:
        if not isinstance(problem, Problem):
            raise ConfigError(f"problem = {shown(problem)}: must be what `case.build()` returns")
        self.problem = problem
        self.until = number("until", until)
        self.rules: dict[str, Rule] = {}
        self.prescribed: dict[str, Prescription] = {}
        self.backflow = ""
        self._history: list[Arrays] = []
        self._lent_to = ""
        self._start(problem.state, threads)

    def _start(self, state: dict[str, Any], threads: int | None) -> None:
        threads = None if threads is None else whole("threads", threads, 1)
        if not isinstance(state, Mapping):
            raise ConfigError(f"state = {shown(state)}: must be what `state()` has returned")
        arrays = {name: exact(name, state[name], *TYPES[name]) if name in TYPES else state[name] for name in state}
        with translated():
            self._engine_of_process = _alsph.Simulation(json.dumps(self.problem.settings), arrays, threads)
        self._process, self._user = os.getpid(), threading.RLock()
        inlet = np.asarray(state["kind"]) == Kind.INLET
        self._check_inflow(np.asarray(state["position"])[inlet], np.asarray(state["velocity"])[inlet])

    @contextmanager
    def _engine(self) -> Iterator[_alsph.Simulation]:
        """Give the engine to one thread at a time, of the process whose threads it steps with.

        Raises
        ------
        SharedError
            If another thread has it, or the process is a forked one, which has none of those threads.
        """
        if os.getpid() != self._process:
            raise SharedError(
                f"this simulation was made in process {self._process}, whose threads the forked process {os.getpid()} "
                "does not have; make the simulation there"
            )
        if not self._user.acquire(blocking=False):
            raise SharedError(
                "this simulation is in use by another thread; let one thread at a time use it, or make two"
            )
        try:
            with translated():
                yield self._engine_of_process
        except SolverError as error:
            if not self.backflow:
                raise
            raise SolverError(f"{error}; before, {self.backflow}") from None
        finally:
            self._user.release()

    @contextmanager
    def lent(self, whom: str) -> Iterator[None]:
        """Let no one step or change the simulation meanwhile, because it is read by `whom`."""
        self._lent_to = whom
        try:
            yield
        finally:
            self._lent_to = ""

    def _refuse_changes(self) -> None:
        if self._lent_to:
            raise SharedError(
                f"{self._lent_to}: it steps or changes the simulation of the run; it may read it alone, by `sample`, "
                "`snapshot`, `state` and the like"
            )

    def __repr__(self) -> str:
        """Name the time, the step and the particles."""
        if os.getpid() != self._process:
            return f"Simulation(of process {self._process})"
        particles = ", ".join(f"{count} {kind}" for kind, count in self.counts.items() if count)
        return f"Simulation(t* = {self.time:.4g}, step {self.step}: {particles})"

    @property
    def time(self) -> float:
        """Time reached [D/U]."""
        with self._engine() as engine:
            return engine.time

    @property
    def step(self) -> int:
        """Number of steps taken."""
        with self._engine() as engine:
            return engine.step

    @property
    def threads(self) -> int:
        """Number of threads."""
        with self._engine() as engine:
            return engine.threads

    @property
    def counts(self) -> dict[str, int]:
        """Number of particles by kind: ``fluid``, ``inlet``, ``outlet``, ``solid``."""
        with self._engine() as engine:
            return engine.counts

    def advance(self, steps: int = 1, wall_seconds: float = math.inf) -> int:
        """Take up to `steps` steps, stop early after `wall_seconds`, and return the number taken.

        Raises
        ------
        SolverError
            If the computation breaks down.
        """
        steps = whole("steps", steps, 0)
        self._refuse_changes()
        with self._engine() as engine:
            first = engine.step
            for seconds in slices(wall_seconds):
                left = first + steps - engine.step
                if left <= 0:
                    break
                engine.advance(self._prescribe(left), seconds)
            return engine.step - first

    def run_until(self, time: float, wall_seconds: float = math.inf) -> bool:
        """Step until ``self.time >= time`` (True) or `wall_seconds` have passed (False).

        The time step is never clipped, so the time reached lies up to one step beyond `time`.

        Raises
        ------
        SolverError
            If the computation breaks down.
        """
        time = number("time", time)
        self._refuse_changes()
        with self._engine() as engine:
            for seconds in slices(wall_seconds):
                if engine.time >= time:
                    break
                if self._prescribe(2) == 1:
                    engine.advance(1)
                else:
                    engine.advance_until(time, seconds)
            return engine.time >= time

    def steps(self, every: float, until: float | None = None) -> Iterator[Arrays]:
        """Step to the next multiple of `every` [D/U], yield a :meth:`snapshot`, and so on until `until`."""
        every = number("every", every, above=0, unit="D/U", finite=True)
        until = self.until if until is None else number("until", until)
        while self.time < until:
            self.run_until(min(next_multiple(self.time, every), until))
            yield self.snapshot()

    def snapshot(self) -> Arrays:
        """Return the particles.

        Returns
        -------
        dict
            ``position``, ``velocity``, ``normal`` (n, d), ``pressure``, ``volume``, ``velocity_divergence``, ``kind``,
            ``body``, ``depth``, ``id``, beside a free surface ``place`` (n,), ``vorticity``, (n,) in 2-D and (n, 3) in
            3-D; and the numbers ``time``, ``step``, ``mass_in`` and ``mass_out``. The pressure is that which acts, with
            the mean over the kernel's support of what :meth:`state` has beside it as ``unkept_pressure``.
        """
        with self._engine() as engine:
            return engine.snapshot()

    def breakdown(self) -> list[tuple[float, Arrays]]:
        """Return time and particles, as :meth:`snapshot` does, before and after the step that broke down.

        Those after it are at the positions before it. If no step has broken down, the present ones are all.
        """
        with self._engine() as engine:
            before, after = engine.snapshot(), engine.failed_snapshot()
        return [(self.time, before)] + ([] if after is None else [(math.nextafter(self.time, math.inf), after)])

    def history(self) -> Arrays:
        """Return one row for each step taken so far.

        Returns
        -------
        dict
            The columns of docs/architecture.md, and the force coefficients where the case has a body.
        """
        rows = self.new_history()
        if not self._history:
            return rows
        self._history = [{name: np.concatenate([rows[name] for rows in self._history]) for name in self._history[0]}]
        return self._history[0]

    def new_history(self, *, keep: bool = True) -> Arrays:
        """Return the rows of the history since the last call of this method or of :meth:`history`.

        Unless they are to be kept for :meth:`history`, which takes memory as long as the simulation lives.
        """
        with self._engine() as engine:
            rows = engine.take_history()
        absent = left_out(self.problem.settings)
        rows = {name: values for name, values in rows.items() if name not in absent}
        rows = {"step": rows["step"], **rows, **self._coefficients(rows)}
        if keep and len(rows["step"]):
            self._history.append(rows)
        return rows

    def _coefficients(self, rows: Arrays) -> Arrays:
        """Drag and lift coefficients of the case's bodies with their parts: force / (½ρU²A), eqs. (21) and (22)."""
        names = [body["name"] for body in self.problem.settings["bodies"]]
        bodies = [names.index(name) for name in self.problem.coefficient_bodies if name in names]
        if not bodies:
            return {}
        scale = 2 / self.problem.reference_area
        pressure, viscous = (scale * rows[f"{part}_force"][:, bodies].sum(axis=1) for part in ("pressure", "viscous"))
        columns: Arrays = {}
        for axis, name in enumerate(("drag", "lift")):
            columns |= {
                f"{name}_coefficient": pressure[:, axis] + viscous[:, axis],
                f"{name}_pressure": pressure[:, axis],
                f"{name}_viscous": viscous[:, axis],
            }
        return columns

    def sample(self, points: FloatArray) -> dict[str, FloatArray]:
        """Return the fluid's ``pressure`` (m,) and ``velocity`` (m, d) at `points` (m, d).

        NaN outside of the domain and where no fluid is within 1.5 Δx, beside a free surface within Δx; points in bodies
        next to fluid have values. They are quadratic fits. The pressure is that of :meth:`snapshot`; in other schemes
        than ``alsph``, where it errs from layer to layer at walls, the fit follows its gradient, too.
        """
        domain = Domain.of(self.problem.settings["domain"])
        points = domain.wrapped(exact("points", points, np.float64, 2))
        with self._engine() as engine:
            found = engine.sample(points)
        beyond = ~domain.contains(points, 1e-9)
        for values in found.values():
            values[beyond] = np.nan
        surface = self.problem.settings.get("free_surface")
        if surface and not surface["tension"]:  # beyond the last particles the fit knows nothing of the air
            found["pressure"] = np.maximum(found["pressure"], 0.0)
        return found

    def inflow_position(self) -> FloatArray:
        """Return the positions (m, d) of the inlet particles."""
        with self._engine() as engine:
            return engine.inflow_position()

    def set_inflow(self, velocity: ArrayLike | Rule) -> None:
        """Prescribe the velocity of the inlet particles.

        Parameters
        ----------
        velocity
            An array (d,) or, in the order of :meth:`inflow_position`, (m, d), which the particles keep and hand on to
            those that follow them [U]; or a function of their positions (m, d) [D] and the time [D/U] that returns such
            an array and is called before every step. The rule of a case is better its
            :meth:`~alsph.cases.driven.Driven.inflow`.

        Raises
        ------
        ConfigError
            If it is no such array, or more fluid would leave through an inlet than enter.
        """
        self._refuse_changes()
        if callable(velocity):
            self._tell("inflow", velocity)
        else:
            self._apply(velocity, self.inflow_position())
            self._forget("inflow")

    def prescribe(
        self,
        *,
        forcing: Rule | None = AS_IT_IS,
        sliding: Rule | None = AS_IT_IS,
        motion: Rule | None = AS_IT_IS,
    ) -> None:
        """Prescribe a body force, the velocity of surfaces, and motions, by functions that are called in every step.

        What is not named stays as it is; None takes a function away.

        Parameters
        ----------
        forcing
            Body force per unit mass beside that of the settings [U²/D]. A function of positions (m, d) [D], those that
            the step takes its derivatives at, and the time in the middle of the step [D/U], which gives an array
            (m, d), or (d,) for a force that is the same everywhere. The time step does not follow it: give a smaller
            ``time_step`` where it is much larger than U²/D.
        sliding
            Likewise the velocity of the solid particles of bodies whose ``velocity`` is None [U], which stay where
            they are, as those of a cylinder that rotates; without, that of the state.
        motion
            Likewise how far the bodies that move, but have neither a ``velocity`` nor are ``rigid``, have come (b, d)
            [D], of their centres at the start (b, d) and the time; or (b, 3) in 2-D and (b, 6) in 3-D, with the angle,
            as a vector in 3-D, that they have turned by behind it [rad]. What it gives at the time 0 is taken off.

        Raises
        ------
        ConfigError
            If surfaces are to slide, and each body has a ``velocity`` of its own, or if no body is there to move.

        Notes
        -----
        The rules of a case are better its :meth:`~alsph.cases.driven.Driven.forcing` and
        :meth:`~alsph.cases.driven.Driven.sliding`. They are called in a thread of the engine, and cannot use the
        simulation.
        """
        self._refuse_changes()
        given = {"forcing": forcing, "sliding": sliding, "motion": motion}
        for name, rule in given.items():
            if not (rule is None or rule is AS_IT_IS or callable(rule)):
                raise ConfigError(f"{name} = {shown(rule)}: must be a function of positions and time, or None")
        if callable(sliding) and all(body["velocity"] is not None for body in self.problem.settings["bodies"]):
            raise ConfigError(
                "sliding: each body has a velocity of its own; give those whose surface slides velocity = None, or "
                "make it the method `sliding` of the case's class"
            )
        if callable(motion) and not len(self._told_centres()):
            raise ConfigError(
                "motion: no body is moved by it; give those that are moves = True and velocity = None, or make it the "
                "method `motion` of the case's class"
            )
        named = {name: rule for name, rule in given.items() if rule is not AS_IT_IS}
        for name, rule in named.items():
            self._forget(name) if rule is None else self._tell(name, rule)
        self._hand_over()

    def _forget(self, name: str) -> None:
        for told in (self.rules, self.prescribed):
            told.pop(name, None)

    def _tell(self, name: str, rule: Rule) -> None:
        self.rules[name] = rule
        self.prescribed[name] = Prescription.nothing_yet(self.time, int(self.problem.settings["dimensions"]))

    def _hand_over(self) -> None:
        """Give the engine the rules that it asks itself."""
        forcing, sliding = (
            answering(name, self.rules[name], self.prescribed) if name in self.rules else None
            for name in ("forcing", "sliding")
        )
        moving = self.rules.get("motion")
        motion = moving and answering_poses(moving, self._told_centres(), self.prescribed)
        with self._engine() as engine:
            engine.prescribe(forcing, sliding, motion)

    def _told_centres(self) -> FloatArray:
        """Return the centres (b, d) of the bodies that a rule moves."""
        bodies = self.problem.settings["bodies"]
        told = [body["center"] for body in bodies if is_rigid(body) and not body.get("rigid")]
        return np.array(told, float).reshape(len(told), self.problem.dimensions)

    def _prescribe(self, steps: int) -> int:
        """Apply an inflow given as a function; return how many of `steps` may be taken until it is due again."""
        if "inflow" not in self.rules:
            return steps
        position = self.inflow_position()
        velocity = asked("inflow", self.rules["inflow"], position, self.time)
        if velocity is not None:
            self.prescribed["inflow"] = Prescription(self.time, position, self._apply(velocity, position).copy())
        return 1

    def _apply(self, velocity: ArrayLike, position: FloatArray) -> FloatArray:
        """Give the inlet particles at `position` (m, d) a velocity, (d,) or (m, d), and return it as (m, d)."""
        values = exact("inflow velocity", velocity, np.float64)
        if values.shape in (position.shape[1:], position.shape):
            self._check_inflow(position, np.broadcast_to(values, position.shape))
        with self._engine() as engine:
            engine.set_inflow(values)  # refuses other shapes
        return np.broadcast_to(values, position.shape)

    def _check_inflow(self, position: FloatArray, velocity: FloatArray) -> None:
        """Refuse backflow at an inlet, and warn once of such in places."""
        warning = backflow(Domain.of(self.problem.settings["domain"]), position, velocity, self.time)
        if warning and not self.backflow:
            self.backflow = warning
            warnings.warn(warning, RuntimeWarning, stacklevel=4)

    def state(self) -> dict[str, Any]:
        """Return all that :meth:`restore` needs to go on from here to the last bit, but for the rules."""
        with self._engine() as engine:
            return engine.state()

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to a state that :meth:`state` has returned; the history starts anew."""
        self._refuse_changes()
        self._start(state, self.threads)
        self._history = []
        if "inflow" in self.rules:
            self.set_inflow(self.rules["inflow"])
        self.prescribe(**{name: self.rules.get(name) for name in ("forcing", "sliding", "motion")})
