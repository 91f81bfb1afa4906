"""What a run is judged by: numbers and profiles beside their reference values."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from alsph.analysis.averages import Estimate
from alsph.analysis.window import DEVELOPING
from alsph.arrays import FloatArray
from alsph.tables import html


@dataclass(frozen=True)
class Measure:
    """A number of a run and what it should be.

    Attributes
    ----------
    name : str
        What it is, with its unit, as in :meth:`alsph.Run.summary`.
    value : float
        As computed; NaN where the run does not tell.
    reference : float
        As it should be; zero for an error norm, NaN where that is not known.
    tolerance : float
        Largest error that passes.
    source : str
        Where the reference comes from.
    """

    name: str
    value: float
    reference: float = math.nan
    tolerance: float = math.nan
    source: str = ""

    def alone(self) -> Self | None:
        """Return it without its reference, None if it is an error norm."""
        return None if self.reference == 0 else replace(self, reference=math.nan, tolerance=math.nan, source="")

    def settling(self, before: Measure) -> Self:
        """Return it, noted to develop if it has changed since `before` by more than half its tolerance (0.5 %)."""
        scale = abs(self.value) if self.reference else 1.0
        change = abs(self.value - before.value)
        if not change > scale * (0.005 if math.isnan(self.tolerance) else self.tolerance / 2):
            return self
        note = f"{DEVELOPING} (changes from {before.value:.4g} over the last quarter of the run)"
        return replace(self, value=Estimate(self.value, note=note))

    @property
    def error(self) -> float:
        """Deviation from the reference over its modulus; the value itself where the reference is zero."""
        return (self.value - self.reference) / (abs(self.reference) or 1.0)

    @property
    def passed(self) -> bool:
        """Whether the error is within the tolerance; a NaN is not."""
        return abs(self.error) <= self.tolerance


def alone(measures: Iterable[Measure]) -> list[Measure]:
    """Return measures without their references, and no error norms."""
    return [own for measure in measures if (own := measure.alone())]


class Measures(list[Measure]):
    """Measures, which notebooks show as a table."""

    def _repr_html_(self) -> str:
        rows = [
            (
                measure.name,
                f"{measure.value}" if isinstance(measure.value, Estimate) else f"{measure.value:.5g}",
                "" if math.isnan(measure.reference) else f"{measure.reference:.5g}",
                "" if math.isnan(measure.error) or not measure.reference else f"{100 * measure.error:+.2g} %",
                measure.source,
            )
            for measure in self
        ]
        return html(("", "value", "reference", "error", "source"), rows, named=True)


@dataclass(frozen=True, eq=False)
class Profile:
    """A computed curve and the reference curve to draw beside it, if there is one.

    Attributes
    ----------
    name : str
        What is drawn; the figure's title.
    axes : (str, str)
        Labels of abscissa and ordinate, with units.
    computed, reference : (x, y)
        Arrays (m,) and (n,) of each; n = 0 where the reference is not known.
    source : str
        Where the reference comes from.
    """

    name: str
    axes: tuple[str, str]
    computed: tuple[FloatArray, FloatArray]
    reference: tuple[FloatArray, FloatArray]
    source: str

    def alone(self) -> Self:
        """Return it without its reference."""
        return replace(self, reference=(np.empty(0), np.empty(0)), source="")

    @property
    def file_name(self) -> str:
        """Name of the file, without suffix, that its figure is saved in."""
        return "_".join(re.findall(r"\w+", re.sub(r"-(?=\d)", "minus ", self.name.lower())))
