"""Couette flow from rest, with its exact transient."""

from typing import ClassVar

import numpy as np

from alsph.arrays import FloatArray
from alsph.cases.plates import TERMS, Plates


class Couette(Plates):
    """Flow between plates, D apart, the lower one at rest; the upper one slides with U along x from the start.

    It tends to u = Uy/D; the exact transient is that of Morris, Fox and Zhu (J. Comput. Phys. 136 (1997) 214), a
    Fourier series.
    """

    name: ClassVar[str] = "couette"
    title: ClassVar[str] = "start-up of plane Couette flow"
    upper_velocity: ClassVar[float] = 1.0
    source: ClassVar[str] = "exact solution (Fourier series)"

    def profile(self, y: FloatArray, time: float) -> FloatArray:
        """Return the exact velocity (n,) along x [U] at heights y (n,) [D] and a time [D/U]."""
        wave = np.pi * TERMS
        transient = 2 * (-1.0) ** TERMS / wave * np.sin(wave * y) * np.exp(-(wave**2) * time / self.reynolds)
        return np.asarray(y + transient.sum(axis=0))
