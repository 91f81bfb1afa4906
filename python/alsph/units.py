"""What D, U, ρ and ν are in SI, the Reynolds number that follows, and the factors between results and SI."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Literal, Self, get_args

from pydantic import Field, model_validator

from alsph.parameters import Parameters, choose
from alsph.text import shown

Quantity = Literal[
    "length",
    "time",
    "velocity",
    "acceleration",
    "frequency",
    "rate",
    "pressure",
    "force",
    "force_per_length",
    "moment_per_length",
]

QUANTITIES: dict[Quantity, tuple[str, tuple[int, int, int]]] = {
    "length": ("m", (0, 0, 1)),
    "time": ("s", (0, -1, 1)),
    "velocity": ("m/s", (0, 1, 0)),
    "acceleration": ("m/s²", (0, 2, -1)),
    "frequency": ("Hz", (0, 1, -1)),
    "rate": ("1/s", (0, 1, -1)),
    "pressure": ("Pa", (1, 2, 0)),
    "force": ("N", (1, 2, 2)),
    "force_per_length": ("N/m", (1, 2, 1)),
    "moment_per_length": ("N m/m", (1, 2, 2)),
}
"""Unit of each quantity, and its exponents of ρ, U and D. In 2-D forces and moments are per length across the plane."""


class Units(Parameters):
    """What the reference values of a case are in SI; from them follows its Reynolds number.

    Raises
    ------
    ConfigError
        If a value is missing, or no positive number.

    Examples
    --------
    >>> water = Units(length=0.5, velocity=0.25, density=1000, kinematic_viscosity=1e-6)
    >>> water.reynolds, water.factor("time"), water.factor("force_per_length")
    (125000.0, 2.0, 31.25)
    """

    length: float = Field(gt=0, description="reference length D [m]")
    velocity: float = Field(gt=0, description="reference velocity U [m/s]")
    density: float = Field(gt=0, description="density of the fluid, ρ [kg/m³]")
    kinematic_viscosity: float = Field(gt=0, description="kinematic viscosity of the fluid, ν [m²/s]")

    @model_validator(mode="after")
    def _can_be_reckoned_with(self) -> Self:
        values = [self.reynolds, *map(self.factor, QUANTITIES)]
        if not all(0 < value < math.inf for value in values):
            raise ValueError("units: what follows from them is too large or too small for a number; are they in SI?")
        return self

    @classmethod
    def of(cls, given: Units | Mapping[str, Any]) -> Units:
        """Return units that are given as such, or as the table of a file."""
        if isinstance(given, Units):
            return given
        if not isinstance(given, Mapping):
            raise ValueError(f"must be alsph.Units, or a table of {', '.join(cls.model_fields)}, not {shown(given)}")
        return cls(**{str(name): value for name, value in given.items()})

    @property
    def reynolds(self) -> float:
        """Reynolds number UD/ν [-], to 12 digits, so that rounding makes no other flow of the same."""
        return float(f"{self.velocity * self.length / self.kinematic_viscosity:.12g}")

    def factor(self, quantity: Quantity) -> float:
        """Return what one unit of a result is in SI: ``run.history["time"] * units.factor("time")`` is in seconds."""
        choose("quantity", quantity, get_args(Quantity))
        _, (density, velocity, length) = QUANTITIES[quantity]
        return float(self.density**density * self.velocity**velocity * self.length**length)

    def told(self) -> str:
        """Return what figures in D and U are in SI, in words."""
        known: dict[str, Quantity] = {"D": "length", "U": "velocity", "D/U": "time", "ρU²": "pressure"}
        return ", ".join(f"{name} = {self.factor(of):.4g} {QUANTITIES[of][0]}" for name, of in known.items())

    def __str__(self) -> str:
        """Return the values in words."""
        return (
            f"D = {self.length:g} m, U = {self.velocity:g} m/s, ρ = {self.density:g} kg/m³, "
            f"ν = {self.kinematic_viscosity:g} m²/s"
        )
