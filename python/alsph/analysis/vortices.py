"""Fields that come of the velocity gradient: vorticity, and two measures of where a vortex is."""

from collections.abc import Callable

import numpy as np

from alsph.arrays import FloatArray


def vorticity(gradient: FloatArray) -> FloatArray:
    """Return the curl of the velocity, (m,) in 2-D and (m, 3) in 3-D, from its gradient (m, d, d)."""
    turning = gradient - np.swapaxes(gradient, 1, 2)  # [:, k, l] is du_k/dx_l - du_l/dx_k
    return np.asarray(turning[:, 1, 0] if gradient.shape[1] == 2 else turning[:, [2, 0, 1], [1, 2, 0]])


def q_criterion(gradient: FloatArray) -> FloatArray:
    """Return Q = ½(‖Ω‖² - ‖S‖²) (m,) of velocity gradients (m, d, d), S and Ω their symmetric and skew parts.

    Above zero the fluid turns faster than it is strained: a vortex after Hunt, Wray and Moin (1988).
    """
    strain, rotation = _parts(gradient)
    return np.asarray(0.5 * ((rotation**2).sum(axis=(1, 2)) - (strain**2).sum(axis=(1, 2))))


def lambda_2(gradient: FloatArray) -> FloatArray:
    """Return the middle eigenvalue (m,) of S² + Ω², S and Ω the symmetric and skew parts of gradients (m, d, d).

    Below zero there is a vortex after Jeong and Hussain (1995). In 2-D the gradient has a third row and column of
    zeros.
    """
    found = np.full(len(gradient), np.nan)
    known = np.isfinite(gradient).all(axis=(1, 2))
    extra = 3 - gradient.shape[1]
    strain, rotation = _parts(np.pad(gradient[known], ((0, 0), (0, extra), (0, extra))))
    found[known] = np.linalg.eigvalsh(strain @ strain + rotation @ rotation)[:, 1]
    return found


def _parts(gradient: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the symmetric and the skew part."""
    transposed = np.swapaxes(gradient, 1, 2)
    return 0.5 * (gradient + transposed), 0.5 * (gradient - transposed)


DERIVED: dict[str, Callable[[FloatArray], FloatArray]] = {"q_criterion": q_criterion, "lambda_2": lambda_2}
"""What is computed where it is asked for, by name."""
