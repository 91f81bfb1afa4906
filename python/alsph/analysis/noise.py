"""Noise of pressure and loads: what of them changes from particle to particle, or while the flow goes on by one."""

import numpy as np

from alsph.analysis.sampling import REACH, interpolate_parts, with_images
from alsph.analysis.window import Window
from alsph.arrays import FloatArray
from alsph.geometry.particles import Kind, Snapshot


def pressure_noise(snapshot: Snapshot, spacing: float) -> float:
    """Return the noise of the pressure in the fluid of a snapshot [ρU²].

    It is the root mean square of p - p', where p' is the parabola fitted to p at the nearest particles of the fluid
    (:func:`alsph.analysis.sampling.interpolate`), in units of what the same leaves of white noise of unit amplitude at
    the same particles.

    Parameters
    ----------
    snapshot : Snapshot
    spacing : float
        Particle spacing Δx [D].

    Returns
    -------
    float
        The amplitude a of white noise, and nothing of a pressure that is quadratic in space; of a smooth one of wave
        number k a rest that vanishes as (kΔx)³: 0.3 % of its amplitude with 20 particles a wave.

    Notes
    -----
    Particles in buffers and images beyond periodic sides are fitted to, and not judged; those of solids, whose pressure
    a rule of the wall makes, are neither. It takes the shortest waves alone, those below some 6 Δx: sound of a weakly
    compressible fluid that is longer is none.
    """
    fluid = snapshot.fluid
    position, judged = snapshot.position[fluid], snapshot.kind[fluid] == Kind.FLUID
    white = np.random.default_rng(0).standard_normal(len(position))
    fields = np.column_stack([snapshot.pressure[fluid], white])
    if not judged.any():
        return float("nan")
    around = with_images(position, fields, snapshot.domain, REACH * spacing)
    smooth, _ = interpolate_parts(*around, position[judged], spacing)
    noise, unit = np.sqrt(np.mean((fields[judged] - smooth) ** 2, axis=0))
    return float(noise / unit)


def load_noise(time: FloatArray, coefficient: FloatArray, window: Window, spacing: float) -> float:
    """Return the noise of a force coefficient C over the window.

    It is the root mean square of the second difference C(t - τ) - 2 C(t) + C(t + τ) over √6, with τ = Δx/U whatever the
    step, so that schemes with steps of different lengths are measured alike. Between steps C is taken as linear.

    Parameters
    ----------
    time, coefficient : ndarray, shape (steps,)
    window : Window
    spacing : float
        Particle spacing Δx [D].

    Returns
    -------
    float
        The amplitude a of white noise, up to a tenth less as interpolated; of an oscillation of angular frequency ω and
        amplitude A a rest of (ωτ)² A/√12. NaN where the window is shorter than 2 τ.
    """
    if not len(time):
        return float("nan")
    inside = time[(time >= max(window.start, time[0] + spacing)) & (time <= min(window.end, time[-1] - spacing))]
    if not len(inside):
        return float("nan")
    before, at, after = (np.interp(inside + lag, time, coefficient) for lag in (-spacing, 0.0, spacing))
    return float(np.sqrt(np.mean((before - 2 * at + after) ** 2) / 6))
