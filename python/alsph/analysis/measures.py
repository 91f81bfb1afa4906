"""What a run is judged by: numbers and profiles beside their reference values."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from alsph.analysis.averages import Estimate
from alsph.analysis.window import DEVELOPING
from alsph.arguments import real, text_of
from alsph.arrays import FloatArray
from alsph.errors import ConfigError
from alsph.tables import html
from alsph.text import shown


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

    Raises
    ------
    ConfigError
        If name or source is no text, or one of the others no number.
    """

    name: str
    value: float
    reference: float = math.nan
    tolerance: float = math.nan
    source: str = ""

    def __post_init__(self) -> None:
        """Refuse what is no measure."""
        text_of("the name of a measure", self.name)
        for name in ("value", "reference", "tolerance"):
            given = getattr(self, name)
            if (found := real(given)) is None:
                raise ConfigError(f"measure '{self.name}': {name} = {shown(given)}: must be a number")
            if not isinstance(given, float):
                object.__setattr__(self, name, found)
        if not isinstance(self.source, str):
            raise ConfigError(f"measure '{self.name}': source = {shown(self.source)}: must be a text")

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
        return (float(self.value) - float(self.reference)) / (abs(self.reference) or 1.0)

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

    Raises
    ------
    ConfigError
        If a curve is no pair of arrays of one length, or the rest no texts.
    """

    name: str
    axes: tuple[str, str]
    computed: tuple[FloatArray, FloatArray]
    reference: tuple[FloatArray, FloatArray]
    source: str

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn."""
        text_of("the name of a profile", self.name)
        if not (_is_pair(self.axes) and all(isinstance(axis, str) for axis in self.axes)):
            raise ConfigError(f"profile '{self.name}': axes = {shown(self.axes)}: must be two texts")
        for name in ("computed", "reference"):
            object.__setattr__(self, name, checked_curve(f"profile '{self.name}': {name}", getattr(self, name)))
        if not isinstance(self.source, str):
            raise ConfigError(f"profile '{self.name}': source = {shown(self.source)}: must be a text")

    def alone(self) -> Self:
        """Return it without its reference."""
        return replace(self, reference=(np.empty(0), np.empty(0)), source="")

    @property
    def file_name(self) -> str:
        """Name of the file, without suffix, that its figure is saved in."""
        return "_".join(re.findall(r"\w+", re.sub(r"-(?=\d)", "minus ", self.name.lower())))


def checked_curve(name: str, given: Any) -> tuple[FloatArray, FloatArray]:
    """Return abscissae and ordinates (n,) of a curve.

    Raises
    ------
    ConfigError
        If they are none; the message begins with `name`.
    """
    pair = [array for each in given if (array := _numbers(each)) is not None] if _is_pair(given) else []
    if len(pair) != 2 or len(pair[0]) != len(pair[1]):
        raise ConfigError(f"{name} = {shown(given)}: must be two arrays of numbers, of one length")
    return pair[0], pair[1]


def _is_pair(value: Any) -> bool:
    return isinstance(value, tuple | list | np.ndarray) and len(value) == 2


def _numbers(values: Any) -> FloatArray | None:
    """Return numbers as an array (n,); None if they are none."""
    try:
        array = np.asarray(values)
        return np.asarray(array, float) if array.ndim == 1 and array.dtype.kind in "iufb" else None
    except (TypeError, ValueError):
        return None
