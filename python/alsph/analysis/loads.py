"""Loads, divergence and surface pressure of a run, averaged over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from alsph.analysis.averages import Estimate
from alsph.arrays import FloatArray
from alsph.errors import ConfigError
from alsph.geometry.surface import Surface


@dataclass(frozen=True)
class Load:
    """A coefficient of a force, F / (½ρU²A), or moment, M / (½ρU²c²), over the averaging window.

    Attributes
    ----------
    mean, rms, amplitude : Estimate
        Time average (21), root mean square about zero (23), and amplitude of the fundamental.
    pressure, viscous : Estimate
        Time averages of the two parts.
    """

    mean: Estimate
    rms: Estimate
    amplitude: Estimate
    pressure: Estimate
    viscous: Estimate


@dataclass(frozen=True)
class Divergence:
    """|∇·u| of the fluid particles in U/D over the averaging window.

    Attributes
    ----------
    mean, sum, max : Estimate
        Time averages of the mean, the sum and the maximum over the particles, where a step takes its derivatives: with
        derivatives before or behind its middle (``algorithm`` 1 and 2, ``shadloo``) not where it ends. The paper's
        "mean velocity divergence" is ``sum`` times the length of its averaging period.
    at_end : Estimate
        The mean over the particles where steps end, of some snapshots in the window; NaN without any.
    """

    NAMES: ClassVar[dict[str, str]] = {
        "mean": "mean velocity divergence, |∇·u| D/U",
        "at_end": "mean velocity divergence at the end of a step, |∇·u| D/U",
        "max": "mean of the largest velocity divergence, |∇·u| D/U",
    }
    """What these are called among results."""

    mean: Estimate
    sum: Estimate
    max: Estimate
    at_end: Estimate

    def told(self) -> dict[str, Estimate]:
        """Return the results by name, without that of snapshots where there are none."""
        found = {name: getattr(self, part) for part, name in self.NAMES.items()}
        return {name: value for name, value in found.items() if value is not self.at_end or not np.isnan(value)}


@dataclass(frozen=True, eq=False)
class PressureCoefficient:
    """Pressure coefficient on the surface over the averaging window, relative to the mean inlet pressure.

    Attributes
    ----------
    theta : ndarray, shape (m,)
        Degrees from the front stagnation point.
    mean, deviation : ndarray, shape (m,)
        Time average (22) and standard deviation in time; NaN where there are too few samples.
    samples : int
        Number of samples in the window.
    developing : bool
        Whether the flow still develops in the window.
    surface : Surface, optional
        Where the samples were taken: x/c, side, arc length, normal and length of each piece of the surface, shape (m,).
    """

    theta: FloatArray
    mean: FloatArray
    deviation: FloatArray
    samples: int
    developing: bool = False
    surface: Surface | None = None

    def of(self, parts: Sequence[int]) -> PressureCoefficient:
        """Return the coefficient on some of the closed curves, by their numbers.

        Raises
        ------
        ConfigError
            If an older version has not written where the samples were taken.
        """
        if self.surface is None:
            raise ConfigError("pressure coefficient: an older version has not written which body it is of")
        chosen = np.isin(self.surface.part, parts)
        surface = Surface(**{name: values[chosen] for name, values in self.surface.arrays().items()})
        return replace(
            self, theta=self.theta[chosen], mean=self.mean[chosen], deviation=self.deviation[chosen], surface=surface
        )

    def force(self, part: int | None = None) -> FloatArray:
        """Pressure parts of the mean drag and lift coefficient, −∮ C_p n ds: a check of the recorded ones.

        Parameters
        ----------
        part : int, optional
            Number of the closed curve; all of them if None.

        Returns
        -------
        ndarray, shape (2,)
            NaN where there are no samples, or an older version has not written where they were taken.
        """
        if self.surface is None:
            return np.full(2, np.nan)
        chosen = self.mean if part is None else np.where(self.surface.part == part, self.mean, 0.0)
        return -self.surface.integral(chosen)
