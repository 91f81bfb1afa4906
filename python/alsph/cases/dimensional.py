"""Reynolds number and units of a case: the one follows from the others."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Self

from pydantic import Field, model_validator

from alsph.cases.method import Method
from alsph.errors import ConfigError
from alsph.symbols import GENERAL, Symbols
from alsph.units import Units

ROUNDING = 1e-6
"""Share by which a Reynolds number that is given may miss that of the units."""


class Dimensional(Method):
    """The part of :class:`alsph.cases.Case` that ties it to the world: all else is in D, U and ρ."""

    symbols: ClassVar[Symbols] = GENERAL
    """What results, figures and options call D and U."""

    reynolds: float = Field(default=100.0, gt=0, description="Reynolds number UD/ν [-]")
    units: Units | None = Field(
        default=None, description="what D, U, ρ and ν are in SI, from which the Reynolds number follows; none: not said"
    )

    def __init__(self, *unnamed: Any, **values: Any) -> None:
        if values.get("units") is not None:
            values["units"] = units = _units(values["units"])
            if values.get("reynolds") is None:
                alike = type(self)(*unnamed, **values | {"units": None, "reynolds": units.reynolds})
                values["reynolds"] = units.reynolds * alike.reynolds_length
        super().__init__(*unnamed, **values)

    @model_validator(mode="after")
    def _units_and_reynolds_agree(self) -> Self:
        if self.units is None:
            return self
        follows = self.units.reynolds * self.reynolds_length
        if not math.isclose(self.reynolds, follows, rel_tol=ROUNDING):
            told = f"the units ({self.units}) make it {follows:.10g}; leave one of the two out"
            raise ConfigError(f"reynolds = {self.reynolds:.10g}: {told}")
        if not math.isclose(self.kinematic_viscosity * self.units.reynolds, 1.0, rel_tol=2 * ROUNDING):
            told = "forms its Reynolds number with another length than `reynolds_length` says; override that"
            raise ConfigError(f"units: {type(self).__name__} {told}, not `kinematic_viscosity`")
        return self

    @property
    def reynolds_length(self) -> float:
        """Length that the Reynolds number is formed with [D]."""
        return 1.0

    @property
    def kinematic_viscosity(self) -> float:
        """Kinematic viscosity ν [UD]."""
        return self.reynolds_length / self.reynolds


def _units(given: Any) -> Units:
    """Return units; an error names the parameter."""
    try:
        return Units.of(given)
    except ConfigError as error:
        prefixed = (
            mistake if mistake.startswith(("units:", "and ")) else f"units.{mistake}" for mistake in error.mistakes
        )
        raise ConfigError(*prefixed) from None
    except ValueError as error:
        raise ConfigError(f"units: {error}") from None
