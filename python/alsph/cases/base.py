"""What all cases share: how a case becomes a simulation or a run."""

from __future__ import annotations

import inspect
import math
import re
import warnings
from abc import abstractmethod
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from alsph.analysis.measures import Measure, Profile, alone
from alsph.analysis.record import Record
from alsph.arguments import path_of
from alsph.arrays import Arrays, FloatArray
from alsph.cases import answers, remarks
from alsph.cases.discretised import Discretised
from alsph.cases.driven import RULES
from alsph.cases.method import Method
from alsph.engine.output import Output
from alsph.engine.prescribed import crossing
from alsph.engine.problem import Problem
from alsph.engine.simulation import Simulation
from alsph.errors import ConfigError
from alsph.geometry.particles import Kind
from alsph.geometry.surface import Surface
from alsph.parameters import Parameters
from alsph.text import shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from alsph.results.run import Run

WORD = re.compile(r"(?<=[a-z0-9])(?=[A-Z][a-z])|(?<=[A-Z])(?=[A-Z][a-z])|(?<=[a-z])(?=[A-Z])")
"""Where a new word begins in the name of a class."""


def name_of(model: type) -> str:
    """Return the name of a case that has none: its class's, in small letters."""
    return WORD.sub("_", model.__name__).lower()


def title_of(model: type) -> str:
    """Return the title of a case that has none: the first line of its docstring."""
    first = re.split(r"\n|Parameters\n---", (model.__doc__ or "").strip())[0].rstrip(".")
    return first[:1].lower() + first[1:] or name_of(model)


OFFERED = (
    *("name", "title", "run", "simulation", "draw", "replace", "describe", "remarks", "scales", "measures", "profiles"),
    *("particles", "particle_spacing", "particle_estimate", "memory", "fluid_volume", "domain", "bodies"),
    *("kinematic_viscosity", "cell_reynolds", "boundary_layer", "reference_area", "validated"),
    *("default_until", "expected_time_step", "time_step_limits"),
    *("shapes", "outlines", "carried", "bounds", "centre", "chord", "moment_point", "thickness", "blockage"),
)
"""What a case is used by, beside its parameters, as far as it has it; the rest is for who writes one."""


class Case(Discretised):
    """A flow problem with its numerical parameters.

    Every case is computed in its own reference units: lengths in D, velocities in U, density in ρ, hence times in D/U,
    pressures in ρU² and kinematic viscosity 1/Re. What D and U are, each case says, and by `symbols` what they are
    called in all that is told of it.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    settles: ClassVar[bool] = True
    """Whether the flow may become steady or periodic; if not, averages are of the whole run, without ±."""
    is_steady: ClassVar[bool] = False
    """Whether measures are of the steady flow late in a run; they are said to develop where they change until then."""
    inviscid_from: ClassVar[float] = 0.0
    """Reynolds number from which on references hold that are of a fluid without viscosity."""
    from_start: ClassVar[bool] = False
    """Whether references are of the flow from its own start on, not of one that goes on with another run's."""
    picture_axis: ClassVar[str] = "z"
    """Axis that the plane of pictures in 3-D is normal to where none is given."""
    made_for: ClassVar[tuple[str, ...]] = ()
    """Parameters that the particles are made for beside what the engine's settings tell: no run changes them."""
    of_the_start: ClassVar[tuple[str, ...]] = ()
    """Parameters of the case that nothing but its own start depends on."""
    idle: ClassVar[tuple[str, ...]] = ()
    """Parameters of all cases that nothing in this one depends on, which its help leaves out."""
    later_names: ClassVar[tuple[str, ...]] = ()
    """Measures and profiles, or beginnings of their names, that only a run with some results has."""
    code: ClassVar[Any] = None
    """The Python file of the user's that it stands in, a :class:`alsph.cases.source.Source`."""

    def __dir__(self) -> list[str]:
        """Return the names to complete: parameters, what a case is used by, and what a class of a user's adds."""
        added = {
            name for model in type(self).__mro__ if model.__module__.split(".")[0] != "alsph" for name in vars(model)
        }
        known = {*type(self).model_fields, *OFFERED, *(added - {*dir(Parameters)})}
        return sorted(name for name in super().__dir__() if name in known or name.startswith("__"))

    @classmethod
    def parameter_names(cls) -> list[str]:
        """Return the names of the parameters: those of the problem, what drives it, and the numerical method's."""
        return sorted(cls.model_fields, key=lambda name: (name in Method.model_fields, name in RULES.values()))

    @classmethod
    def describe(cls, name: str) -> str:
        """Return what the parameter `name` means, with its unit."""
        return cls.symbols(super().describe(name))

    @classmethod
    def __pydantic_init_subclass__(cls, **options: Any) -> None:
        """Name a class that has no name of its own or its bases', and refuse parameters that nothing would ask for."""
        super().__pydantic_init_subclass__(**options)
        for parent in cls.__mro__[1:]:
            for name in cls.model_fields.keys() & vars(parent).keys():
                if isinstance(vars(parent)[name], property | cached_property):
                    told = f"no parameter; make it a property, too, or `{name}: ClassVar[...] = ...`"
                    raise ConfigError(f"{cls.__name__}: '{name}' is a property of {parent.__name__}, {told}")
        if not inspect.isabstract(cls):
            for name, of in (("name", name_of), ("title", title_of)):
                if not hasattr(cls, name):
                    setattr(cls, name, of(cls))

    @classmethod
    def declaration(cls) -> str | dict[str, Any]:
        """Return what stands for the case in a configuration: its name, or the file of the user's that it stands in."""
        code = vars(cls).get("code")
        return code.model_dump() if code else cls.name

    @property
    def checked_until(self) -> float:
        """What :attr:`default_until` gives, a time above zero."""
        return answers.end_time(self, lambda: self.default_until)

    @property
    def thickness(self) -> float:
        """Extent of the body that drag and lift are those of, across the stream [D]."""
        return 1.0

    @property
    def reference_area(self) -> float:
        """What force coefficients are formed with: a length in 2-D [D], an area in 3-D [D²]."""
        return 1.0

    @property
    def computed_share(self) -> float:
        """Share of the bodies that is computed, whose forces are recorded; the rest are its mirror images."""
        return 1.0

    @abstractmethod
    def particles(self) -> Arrays:
        """Return the particles at the start."""

    @property
    def is_averaged(self) -> bool:
        """Whether drag, lift and shedding of a body are what its runs are averaged for."""
        return self.settles and bool(self.coefficient_bodies)

    @property
    def has_depth(self) -> bool:
        """Whether there is water that lies on a floor, for gauges to tell its depth."""
        return False

    def solid_height(self, position: FloatArray) -> FloatArray | None:
        """Return how far points (m, d) lie outside of bodies and walls at the start (m,), negative inside [D].

        Pictures draw them by it. Far from all it may be infinite; None, the default, draws what solid particles fill.
        """
        return None

    def surface_points(self) -> Surface | None:
        """Return where the surface pressure is sampled."""
        return None

    @property
    def surface_bodies(self) -> list[str]:
        """Name of the body that each closed curve of the surface is of, in the order of their numbers."""
        return self.coefficient_bodies

    def outputs(self) -> list[Output]:
        """Return what a run records beside particles, history and surface pressure."""
        return []

    @property
    def middle(self) -> FloatArray:
        """Point (d,) that slices for pictures go through in 3-D [D]: the centre of the body, or of the domain."""
        if self.coefficient_bodies:
            return np.array(self.checked_bodies[0].center, float)
        domain = self.checked_domain
        return np.asarray(np.mean([domain.lower, domain.upper], axis=0))

    @property
    def chord(self) -> float:
        """Length c that moment coefficients are formed with [D]."""
        return 1.0

    @property
    def moment_point(self) -> FloatArray:
        """Point (2,) that moments are taken about if no other is given [D]: the centre of the first body."""
        centres = [body.center for body in self.checked_bodies] or [(np.nan, np.nan)]
        return np.array(centres[0])

    def fluid_volume(self) -> float:
        """Return the volume of the space that the fluid fills [D^d]: that of the cells it is put in at first."""
        count = np.count_nonzero(self.particles()["kind"] == Kind.FLUID)
        return float(count * self.particle_spacing**self.space_dimensions)

    @property
    def validated(self) -> tuple[float, float, int] | None:
        """Least and largest Re and least D/Δx that have been compared with the results of others (docs/results.md).

        None where each run is compared with an exact solution of its own.
        """
        return None

    @property
    def cell_reynolds(self) -> float:
        """Cell Reynolds number UΔx/ν [-]."""
        return self.particle_spacing / self.kinematic_viscosity

    @property
    def boundary_layer(self) -> float:
        """About how thick the thinnest boundary layer is that matters [D]; infinite without any."""
        return math.inf

    def scales(self) -> dict[str, float]:
        """Return what the resolution must carry: lengths of the flow in Δx, and the cell Reynolds number, by name."""
        scales = {"cell Reynolds number, UΔx/ν": self.cell_reynolds}
        if math.isfinite(self.boundary_layer):
            scales["thickness of the boundary layer, Δx"] = self.boundary_layer / self.particle_spacing
        return scales

    def remarks(self) -> list[str]:
        """Return what this resolution, method and domain cannot carry, each as ``keyword: what it is; what to do``."""
        known = self.validated
        return [
            *remarks.boundary_layer(self.boundary_layer, self.particle_spacing),
            *(remarks.validated(self.reynolds, self.resolution, self.cell_reynolds, known) if known else []),
            *remarks.kernel(self.kernel, self.smoothing_ratio),
            *remarks.scheme(self.scheme, self.wall_pressure),
            *remarks.without_effect({name: getattr(self, name) for name in self.without_effect}, f"with {self.scheme}"),
            *remarks.without_effect(
                {name: getattr(self, name) for name in self.idle if self._is_chosen(name)}, f"in {self.name}"
            ),
            *remarks.derived(type(self)),
            *remarks.prescribed(self._driven_by),
            *([f"no reference: {self.no_reference}"] if self.no_reference else []),
            *self.slow_pressure,
            *remarks.penalty(self.expected_penalty_constant(), self.scheme),
        ]

    def remarks_until(self, until: float) -> list[str]:
        """Return what is to be said besides of where what moves goes up to a time [D/U]."""
        return []

    @property
    def no_reference(self) -> str:
        """Why references do not hold for these parameters, in words; empty where they do."""
        if self.reynolds >= self.inviscid_from:
            return ""
        return f"it is of a fluid without viscosity, and holds from Re = {self.inviscid_from:g} on"

    def compared(self, measures: list[Measure]) -> list[Measure]:
        """Return measures as they are, or without their reference where it does not hold (:attr:`no_reference`)."""
        return alone(measures) if self.no_reference else measures

    def measures(self, run: Record) -> list[Measure]:
        """Return what a run of this case is judged by."""
        return []

    def profiles(self, run: Record) -> list[Profile]:
        """Return the curves of a run of this case that have a reference."""
        return []

    def build(self, threads: int | None = None) -> Problem:
        """Return the problem that the engine starts from.

        Parameters
        ----------
        threads
            Number of threads that it will be solved with, which need memory; all cores if None.

        Warns
        -----
        UserWarning
            If solid particles have velocities that are not used, because their body has another one.

        Raises
        ------
        ConfigError
            If the particles would not fit into the memory that is free, surfaces would slide through themselves, or
            what drives the flow has not the symmetry of what is computed.
        """
        self.refuse_what_is_not_symmetric(self.rules)
        self.check_memory(threads)
        state = answers.particles(self, self.particles, self.particle_spacing)
        self._warn_of_unused_velocities(state)
        self._refuse_surfaces_that_let_through(state)
        return self.problem(state)

    def draw(self) -> Figure:
        """Return a picture of the start: particles, outlines, the thinnest part, what closes the sides.

        Raises
        ------
        ConfigError
            If the particles would not fit into the memory that is free.
        """
        from alsph import plotting

        return plotting.start(self)

    def _warn_of_unused_velocities(self, state: Arrays) -> None:
        """Warn if solid particles have velocities that are not those of their body, which are the ones that hold."""
        for index, body in enumerate(self.settings()["bodies"]):
            own = state["velocity"][(state["kind"] == Kind.SOLID) & (state["body"] == index)]
            if body["velocity"] is not None and own.any() and not np.allclose(own, body["velocity"]):
                told = f"velocities that particles() gives to those of '{body['name']}' are not used"
                why = f"bodies() says velocity = {body['velocity']}; say None there to keep them"
                warnings.warn(f"{type(self).__name__}: the {told}, as {why}", stacklevel=3)

    def _refuse_surfaces_that_let_through(self, state: Arrays) -> None:
        """Refuse a ``surface_velocity`` through the surface, of which the outermost solid particles tell."""
        if self.surface_velocity is None:
            return
        slides = [body["velocity"] is None and not body["moves"] for body in self.settings()["bodies"]]
        depth = state["depth"]
        outermost = (
            (state["kind"] == Kind.SOLID) & np.array(slides)[state["body"]] & (depth < 0.6 * self.particle_spacing)
        )
        normal = state["normal"][outermost]
        place = state["position"][outermost] + depth[outermost, None] * normal
        if len(place) > 2 and (found := crossing(self.sliding, place, normal, self.checked_until)):
            remedy = (
                "surfaces slide only along themselves (a body that moves has a body_motion), or it has too few points"
            )
            raise ConfigError(self.symbols(f"surface_velocity = {shown(self.surface_velocity)}: has {found}; {remedy}"))

    def problem(self, state: dict[str, Any]) -> Problem:
        """Return this case with the given state, for instance one from a checkpoint."""
        return Problem(self.settings(), state, self.coefficient_bodies, self.reference_area)

    def simulation(self, threads: int | None = None, initial_run: str | Path | None = None) -> Simulation:
        """Return a :class:`alsph.Simulation` of this case, at its start.

        Parameters
        ----------
        threads
            Number of threads; all cores if None.
        initial_run
            Run folder whose last flow this one starts with (:func:`alsph.running.beginning.started`); the case's own
            start if None. The inflow stays that of the case.

        Warns
        -----
        RuntimeWarning
            If `initial_run` is of another case or geometry, or has not finished.

        Raises
        ------
        ConfigError, RunFolderError
            If the case does not fit into memory, or the flow of `initial_run` cannot be used.
        """
        problem = self.build(threads if isinstance(threads, int) else None)
        if initial_run is not None:
            from alsph.running import beginning

            problem = self.problem(beginning.started(self, problem.state, initial_run))
        if warning := self.time_step_warning():
            warnings.warn(warning, stacklevel=2)
        return self._simulation(problem, threads)

    def restored(self, state: dict[str, Any], threads: int | None = None) -> Simulation:
        """Return a simulation of this case that goes on from a state, for instance one from a checkpoint.

        Raises
        ------
        ConfigError
            If the state does not fit the case.
        """
        if type(self).simulation is Case.simulation:
            return self._simulation(self.problem(state), threads)
        simulation = self.simulation(threads)  # it may do more, such as prescribe an inflow
        simulation.restore(state)
        return simulation

    def _simulation(self, problem: Problem, threads: int | None) -> Simulation:
        simulation = Simulation(problem, threads, until=self.checked_until)
        rules = self.rules
        if "inflow" in rules:
            simulation.set_inflow(rules.pop("inflow"))
        simulation.prescribe(**rules)
        return simulation

    def run(
        self,
        folder: str | Path,
        until: float | Literal["converged"] | None = None,
        threads: int | None = None,
        *,
        force: bool = False,
        progress: bool = True,
        walltime: float = math.inf,
        retry: int = 0,
        **settings: Any,
    ) -> Run:
        """Run the case to `until`, write a run folder, and return its results.

        Parameters
        ----------
        folder
            The run folder to create.
        until
            End time [D/U], or ``"converged"``: when the averages are known well enough; the case's own default if None.
        threads
            Number of threads; all cores if None.
        force
            Replace an existing run folder.
        progress
            Report progress.
        walltime
            Seconds after which the run writes a checkpoint and ends with a :class:`alsph.errors.WalltimeError`.
        retry
            How often a run that breaks down goes back to a checkpoint and on with half the time step.
        **settings
            Further settings of :class:`alsph.run_settings.RunSettings`, such as ``output_interval``.

        Raises
        ------
        ConfigError, RunFolderError
            Before anything is written.
        SolverError
            If the computation breaks down; the folder keeps the last checkpoint and the particles of the failed step.
        WalltimeError
            When the wall time is used up, after a checkpoint has been written.
        Interrupted
            At Ctrl-C or SIGTERM, a ``KeyboardInterrupt``, after a checkpoint has been written.
        """
        from alsph.running.control import Control
        from alsph.running.start import run

        control = Control(progress, walltime=walltime, retry=retry)
        place = path_of("folder", folder, "run folder")
        return run(self, place, control, force=force, until=until, threads=threads, **settings)
