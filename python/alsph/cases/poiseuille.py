"""Poiseuille flow from rest, with its exact transient."""

from typing import ClassVar

import numpy as np

from alsph.arrays import FloatArray
from alsph.cases.plates import TERMS, Plates


class Poiseuille(Plates):
    """Flow between plates at rest, D apart, that a body force 8U²/(Re D) along x drives from rest.

    It tends to the parabola with the velocity U in the middle; the exact transient is that of Morris, Fox and Zhu
    (J. Comput. Phys. 136 (1997) 214), a Fourier series.
    """

    name: ClassVar[str] = "poiseuille"
    title: ClassVar[str] = "start-up of plane Poiseuille flow"
    upper_velocity: ClassVar[float] = 0.0
    source: ClassVar[str] = "exact solution (Fourier series)"

    def body_force(self) -> list[float]:
        """Return the force that keeps the parabola moving."""
        return [8 / self.reynolds, 0.0]

    def profile(self, y: FloatArray, time: float) -> FloatArray:
        """Return the exact velocity (n,) along x [U] at heights y (n,) [D] and a time [D/U]."""
        odd = np.pi * (2 * TERMS - 1)
        transient = 32 / odd**3 * np.sin(odd * y) * np.exp(-(odd**2) * time / self.reynolds)
        return np.asarray(4 * y * (1 - y) - transient.sum(axis=0))
