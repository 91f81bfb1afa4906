"""The compiled engine (Rust). Use it through :class:`alsph.Simulation`."""

from collections.abc import Callable
from typing import Any, Self, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "ConfigError",
    "Simulation",
    "SolverError",
    "__version__",
    "bytes_per_particle",
    "instructions",
    "kernels",
    "time_step_limits",
]

__version__: str

class SolverError(RuntimeError):
    """The computation broke down; ``args[0]`` names step, time, particle, position and field."""

class ConfigError(ValueError):
    """The settings or the arrays cannot be used; ``args[0]`` says what, where and how to mend it."""

@final
class Simulation:
    """State and stepping of one simulation in 2-D or 3-D."""

    def __new__(cls, settings: str, state: dict[str, Any], threads: int | None = None) -> Self: ...
    @property
    def dimensions(self) -> int: ...
    @property
    def time(self) -> float: ...
    @property
    def step(self) -> int: ...
    @property
    def threads(self) -> int: ...
    @property
    def counts(self) -> dict[str, int]:
        """Particles by kind: ``fluid``, ``inlet``, ``outlet``, ``solid``."""

    def advance(self, steps: int, wall_seconds: float | None = None) -> int:
        """Take up to `steps` steps, stop early after `wall_seconds`; return the steps taken."""

    def advance_until(self, time: float, wall_seconds: float | None = None) -> bool:
        """Step until ``self.time >= time`` (True) or `wall_seconds` have passed (False); Δt is never clipped."""

    def take_history(self) -> dict[str, NDArray[Any]]:
        """One row for each step since the last call, see docs/architecture.md for the columns."""

    def snapshot(self) -> dict[str, NDArray[Any]]:
        """Return the particles: the arrays of `state` and ``volume``, ``velocity_divergence``, ``vorticity``.

        The ``pressure`` is that which acts, smooth: it has the mean of the ``unkept_pressure``, which is left out.
        """

    def failed_snapshot(self) -> dict[str, NDArray[Any]] | None:
        """Return what the step that broke down led to, at the positions before that step; None if none has."""

    def state(self) -> dict[str, Any]:
        """All that is needed to go on from here to the last bit."""

    def sample(self, points: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Fluid ``pressure`` (m,) and ``velocity`` (m, d) at `points` (m, d), by quadratic moving least squares.

        NaN where the nearest fluid that is seen from there is more than 1.5 Δx away, beside a free surface Δx.
        """

    def inflow_position(self) -> NDArray[np.float64]:
        """Return the positions (m, d) of the inlet buffer particles."""

    def prescribe(
        self,
        forcing: Callable[[NDArray[np.float64], float], NDArray[np.float64]] | None,
        sliding: Callable[[NDArray[np.float64], float], NDArray[np.float64]] | None,
        motion: Callable[[float], NDArray[np.float64]] | None,
    ) -> None:
        """Ask functions for a body force and the velocity of surfaces: (m, d) from positions and time, once a step.

        And for the poses (b, 30) of the b bodies that move and are not free, from the time, twice a step.
        """

    def set_inflow(self, velocity: NDArray[np.float64]) -> None:
        """Prescribe the velocity of the inlet buffer particles, (d,) or (m, d) in the order of `inflow_position`."""

def time_step_limits(settings: str, velocity_max: float) -> dict[str, float]:
    """Largest Δt: ``courant``, ``penalty``, ``acoustic``, ``viscous``, ``body_force``; ``lambda_max`` is λ_max Δx²."""

def kernels() -> dict[str, float]:
    """Return the kernels by name, each with its support radius over the smoothing length."""

def instructions() -> str:
    """Name of the vector instructions in use, ``portable`` or ``avx2``; ``ALSPH_INSTRUCTIONS`` pins them."""

def bytes_per_particle(settings: str) -> float:
    """Estimate the engine's memory per particle, buffers and neighbour list included."""
