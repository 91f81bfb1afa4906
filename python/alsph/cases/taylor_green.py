"""Decaying Taylor-Green vortices in a periodic box, with their exact solution in 2-D."""

from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from alsph.cases.base import Case
from alsph.errors import ConfigError
from alsph.geometry import FloatArray, Kind, cell_centres, lattice, particles


class TaylorGreen(Case):
    """Decaying Taylor-Green vortices in a periodic square or cube of side D; U is the largest initial velocity."""

    name: ClassVar[str] = "taylor_green"
    title: ClassVar[str] = "decaying Taylor-Green vortices in a periodic box"

    resolution: int = Field(default=50, ge=8, description="particles per side of the box, D/Δx [-]")
    dimensions: Literal[2, 3] = Field(default=2, description="number of space dimensions")
    perturbation: float = Field(
        default=0.0, ge=0, le=0.5, description="random displacement of the initial lattice, at most [Δx]"
    )
    seed: int = Field(default=0, ge=0, description="seed of the random displacement")
    # At the stagnation points the XSPH velocity of (18) vanishes, and lattice rows pressed together there without a
    # shift make the step unstable (seen at 100 particles a side).
    shifting: Literal["xsph", "maximum_velocity", "none"] = Field(
        default="maximum_velocity", description=Case.model_fields["shifting"].description
    )

    @property
    def default_until(self) -> float:
        """One time unit."""
        return 1.0

    @property
    def space_dimensions(self) -> int:
        """2 or 3, as the parameter `dimensions` says."""
        return self.dimensions

    def domain(self) -> dict[str, Any]:
        """Return the periodic unit box."""
        d = self.dimensions
        return {"lower": [0.0] * d, "upper": [1.0] * d, "boundaries": [["periodic", "periodic"]] * d}

    def particle_estimate(self) -> int:
        """Return the number of particles."""
        return int(self.resolution**self.dimensions)

    def particles(self) -> dict[str, NDArray[Any]]:
        """Return a lattice, displaced at random if asked for, with the initial velocity and pressure."""
        position = lattice(*[cell_centres(self.resolution, self.particle_spacing)] * self.dimensions)
        shift = self.perturbation * self.particle_spacing
        position = (position + np.random.default_rng(self.seed).uniform(-shift, shift, position.shape)) % 1.0
        initial = self._initial_2d(position) if self.dimensions == 2 else self._initial_3d(position)
        return particles(Kind.FLUID, position, initial["velocity"], pressure=initial["pressure"])

    def exact(self, position: FloatArray, time: float) -> dict[str, FloatArray]:
        """Return the exact ``velocity`` (n, 2) [U] and ``pressure`` (n,) [ρU²].

        Parameters
        ----------
        position
            Points (n, 2) [D].
        time
            Time [D/U].

        Raises
        ------
        ConfigError
            In 3-D, where no exact solution is known.
        """
        if self.dimensions == 3:
            raise ConfigError("dimensions = 3: the exact solution is known in 2-D only")
        decay = np.exp(-8 * np.pi**2 * time / self.reynolds)
        initial = self._initial_2d(position)
        return {"velocity": decay * initial["velocity"], "pressure": decay**2 * initial["pressure"]}

    @staticmethod
    def _initial_2d(position: FloatArray) -> dict[str, FloatArray]:
        x, y = 2 * np.pi * position.T
        velocity = np.stack([-np.cos(x) * np.sin(y), np.sin(x) * np.cos(y)], axis=1)
        return {"velocity": velocity, "pressure": -0.25 * (np.cos(2 * x) + np.cos(2 * y))}

    @staticmethod
    def _initial_3d(position: FloatArray) -> dict[str, FloatArray]:
        x, y, z = 2 * np.pi * position.T
        velocity = np.stack([np.sin(x) * np.cos(y), -np.cos(x) * np.sin(y), 0 * z], axis=1) * np.cos(z)[:, None]
        return {"velocity": velocity, "pressure": (np.cos(2 * x) + np.cos(2 * y)) * (np.cos(2 * z) + 2) / 16}
