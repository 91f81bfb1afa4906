"""Pulsating flow between plates, with its exact solution."""

import math
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from alsph.arrays import FloatArray
from alsph.cases.plates import Plates


class PulsatingChannel(Plates):
    """Flow between plates at rest, D apart, that a body force 8U²/(Re D) (1 + a cos ωt) along x drives.

    Plane Womersley flow: with a = 0 the parabola with U in the middle; the flow starts with the exact one
    (J. R. Womersley, J. Physiol. 127 (1955) 553, between plates).
    """

    name: ClassVar[str] = "pulsating_channel"
    title: ClassVar[str] = "pulsating flow between plates (Womersley)"
    upper_velocity: ClassVar[float] = 0.0
    source: ClassVar[str] = "exact solution (Womersley)"

    womersley: float = Field(default=4.0, gt=0, le=30, description="Womersley number, ½D √(ω/ν) [-]")
    amplitude: float = Field(default=1.0, ge=0, le=20, description="a, of the force over its mean [-]")

    @property
    def frequency(self) -> float:
        """Angular frequency ω [U/D]."""
        return 4 * self.womersley**2 / self.reynolds

    @property
    def stokes_layer(self) -> float:
        """Thickness √(2ν/ω) of the layer at the plates that follows the force [D]."""
        return math.sqrt(2 / (self.frequency * self.reynolds))

    @property
    def boundary_layer(self) -> float:
        """Twice that of Stokes' layer, of which the pulsation takes about so much to end."""
        return 2 * self.stokes_layer

    @property
    def default_until(self) -> float:
        """Two periods."""
        return 4 * math.pi / self.frequency

    def body_force(self) -> list[float]:
        """Return the mean force, which keeps the parabola moving."""
        return [8 / self.reynolds, 0.0]

    def forcing(self, position: FloatArray, time: float) -> ArrayLike:
        """Return the part of the force that changes."""
        return [8 / self.reynolds * self.amplitude * np.cos(self.frequency * time), 0.0]

    def profile(self, y: FloatArray, time: float) -> FloatArray:
        """Return the exact velocity (n,) along x [U] at heights y (n,) [D] and a time [D/U]."""
        root = np.sqrt(1j * self.frequency * self.reynolds)
        shape = (1 - np.cosh(root * (y - 0.5)) / np.cosh(root / 2)) / (1j * self.frequency)
        swing = 8 / self.reynolds * self.amplitude * shape * np.exp(1j * self.frequency * time)
        return np.asarray(4 * y * (1 - y) + swing.real)

    def initial_profile(self, y: FloatArray) -> FloatArray:
        """Return the exact velocity (n,) along x at the start [U]."""
        return self.profile(y, 0.0)
