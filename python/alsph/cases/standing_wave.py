"""A standing wave in a tank, with the exact frequency and decay of small waves in a viscous fluid."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from alsph.analysis.measures import Measure
from alsph.analysis.record import Record
from alsph.arrays import Arrays, FloatArray
from alsph.cases.free_surface import FreeSurface
from alsph.geometry.domain import Domain
from alsph.geometry.lattice import cell_centres, lattice

WAVE = np.pi
"""Wave number k [1/H]: half a wave in a tank as long as it is deep."""

VISCOUS = 50.0
"""Reynolds number below which the flow that begins at rest is not that of the mode alone, by more than 1 %."""


class StandingWave(FreeSurface):
    """Half a wave in a square tank of water H deep with slip walls, let go from rest.

    The reference is the linear theory of a viscous fluid of that depth; 2νk² is too large a decay by 33 % at Re = 50.
    """

    name: ClassVar[str] = "standing_wave"
    title: ClassVar[str] = "standing wave in a tank"
    later_names: ClassVar[tuple[str, ...]] = (
        *FreeSurface.later_names,
        "frequency of the wave, √(g/H)",
        "decay rate of the amplitude, √(g/H)",
    )

    resolution: int = Field(default=40, ge=8, description="particles over the depth, H/Δx [-]")
    reynolds: float = Field(default=500, gt=0, description="Reynolds number √(gH)H/ν [-]")
    amplitude: float = Field(default=0.05, gt=0, le=0.2, description="amplitude of the wave at the start [H]")

    @property
    def default_until(self) -> float:
        """Nearly three periods."""
        return 10.0

    def domain(self) -> Domain:
        """Return the tank, whose top is open."""
        return Domain([0, 0], [1, 2], [("slip", "slip"), ("slip", "air")])

    @property
    def initial_volume(self) -> float:
        """That of the water [H²]."""
        return 1.0

    def particles(self) -> Arrays:
        """Return a lattice, at rest, that the flow of the wave has carried along: its volume is as it was.

        So a wave of finite height has the second order of Stokes's, too, of crests higher than troughs are deep.
        """
        from scipy.integrate import solve_ivp  # half a second that most commands do without

        def flow(_: float, position: FloatArray) -> FloatArray:
            x, y = WAVE * position.reshape(2, -1)
            velocity = np.stack([-np.cosh(y) * np.sin(x), np.sinh(y) * np.cos(x)])
            return np.asarray(velocity.ravel() / np.sinh(WAVE))

        start = lattice(*[cell_centres(self.resolution, self.particle_spacing)] * 2).T
        moved = solve_ivp(flow, (0, self.amplitude), start.ravel(), method="DOP853", rtol=1e-10, atol=1e-12)
        x, y = position = moved.y[:, -1].reshape(2, -1)
        wave = self.amplitude * np.cosh(WAVE * y) / np.cosh(WAVE) * np.cos(WAVE * x)
        return self.fluid(position.T, np.zeros_like(position.T), 1 - y + wave)

    def growth(self) -> complex:
        """Return −(decay rate) + i (frequency) of the mode [√(g/H)], from the linear theory.

        The stream function is (a sinh ky + b sinh my) sin kx e^{st}, m² = k² + s/ν: without shear at the floor and at
        the surface, and with the pressure of the air plus 2ρν ∂v/∂y there.
        """
        from scipy.optimize import newton  # half a second that most commands do without

        nu = self.kinematic_viscosity

        def balance(s: complex) -> complex:
            m = np.sqrt(WAVE**2 + s / nu)
            shear = 2 * WAVE**2 / (m**2 + WAVE**2)
            tension = WAVE / np.tanh(WAVE) - shear * m / np.tanh(m)
            return complex(s / np.tanh(WAVE) + WAVE / s * (1 - shear) + 2 * nu * WAVE * tension)

        return complex(newton(balance, -2 * nu * WAVE**2 + 1j * np.sqrt(WAVE * np.tanh(WAVE)), tol=1e-12, maxiter=200))

    def remarks(self) -> list[str]:
        """Return what is to be borne in mind: a wave so steep that it is not that of linear theory."""
        steep = (WAVE * self.amplitude) ** 2 / 8
        told = f"steep: a wave of ka = {WAVE * self.amplitude:.2g} is compared with linear theory"
        return super().remarks() + [f"{told}; its frequency is about {100 * steep:.2g} % lower"] * (steep > 0.005)

    @property
    def no_reference(self) -> str:
        """Say that the water is so viscous that what is let go from rest is not the mode of linear theory alone."""
        if self.reynolds >= VISCOUS:
            return ""
        return f"it is of a mode of linear theory, and what is let go from rest is that from Re = {VISCOUS:g} on"

    def measures(self, run: Record) -> list[Measure]:
        """Return frequency and decay rate, from the kinetic energy, and what energy was made."""
        from scipy.optimize import curve_fit

        time, energy = run.history.get("time", np.empty(0)), run.history.get("kinetic_energy", np.empty(0))
        exact, rows = self.growth(), self.energy_measures(run)
        if len(time) < 2 or time[-1] * exact.imag < 1.5 * np.pi:  # a wave that creeps back has no frequency
            return rows

        def model(time: Any, size: float, decay: float, frequency: float, phase: float) -> Any:
            return size * np.exp(-2 * decay * time) * (1 - np.cos(2 * frequency * time + phase))

        start = (energy.max() / 2, -exact.real, exact.imag, 0.0)
        try:
            (_, decay, frequency, _), _ = curve_fit(model, time, energy, p0=start)
        except RuntimeError:  # it is no such oscillation
            return rows
        source = "linear theory of a viscous fluid"
        found = [
            Measure("frequency of the wave, √(g/H)", float(frequency), exact.imag, 0.01, source),
            Measure("decay rate of the amplitude, √(g/H)", float(decay), -exact.real, 0.1, source),
        ]
        return self.compared(found) + rows
