"""The heave of a floating body by linear theory."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from alsph.arrays import FloatArray

SOURCE = "linear theory (boundary elements)"

STEP = 0.05
"""Time step that it is told at [√(L/g)]."""


@cache
def linear_heave(
    until: float, section: tuple[complex, ...], mass: float, depth: float, tank_length: float
) -> tuple[FloatArray, FloatArray]:
    """Return the heave of a floating body, let go above its draught, in a flow that disturbs the surface but little.

    Green's identity on constant elements along the immersed half of the body, the level surface and the end of the
    tank, with images in the middle and beyond the floor, turns ∂η/∂t = ∂φ/∂y, ∂φ/∂t = −gη and Newton's law into
    ordinary differential equations, which are solved exactly. For a cylinder in a deep and long tank it is the motion
    of Maskell and Ursell (Journal of Fluid Mechanics 44 (1970) 303).

    Parameters
    ----------
    until : float
        Time to follow it to [√(L/g), of any length L].
    section : tuple of complex
        Ends x + iy of the elements along the right half of the immersed section of a symmetric body, from its keel to
        the level surface, at y = 0 [L]; those of surface and end are as long as the last one.
    mass : float
        Of the body, whose section is immersed to that draught [ρL²].
    depth, tank_length : float
        Depth of the water and length of the tank [L].

    Returns
    -------
    time, height : array of shape (n,)
        Times since it was let go [√(L/g)]; the height over its draught, over that at first.
    """
    from scipy.linalg import expm  # half a second that most commands do without

    body, half = np.array(section), tank_length / 2
    beam, panel = float(body[-1].real), abs(body[-1] - body[-2])
    surface = np.linspace(beam, half, 1 + round((half - beam) / panel)) + 0j
    wall = half - 1j * np.linspace(0, depth, 1 + round(depth / panel))
    lines = body, surface, wall
    ends = np.stack([np.concatenate([line[:-1] for line in lines]), np.concatenate([line[1:] for line in lines])])
    size = np.abs(ends[1] - ends[0])
    source = dipole = np.zeros((len(size), len(size)))
    for image, way_round in ((ends, 1), (-ends.conj(), -1), (ends.conj() - 2j * depth, -1), (-ends - 2j * depth, 1)):
        u, v = ((ends.mean(axis=0)[:, None] - end) / ((image[1] - image[0]) / size) for end in (image[1], image[0]))
        source = source + (u * np.log(u) - u - v * np.log(v) + v).real
        dipole = dipole + way_round * np.angle(u / v)
    np.fill_diagonal(dipole, 0.0)
    np.fill_diagonal(dipole, -dipole.sum(axis=1))
    place = np.repeat(np.arange(3), [len(line) - 1 for line in lines])
    below, level = place == 0, place == 1
    # The length of the body's elements along x, or the velocity through them at unit speed.
    across = (ends[1] - ends[0])[below].real
    known = np.column_stack([-dipole[:, level], source[:, below] @ (across / size[below])])
    found = np.linalg.solve(np.where(level, -source, dipole), known)
    force, rise = 2 * across @ found[below], found[level]
    inertia, count = mass + force[-1], int(level.sum())
    # η, φ at the surface; height and velocity of the body.
    system = np.zeros((2 * count + 2,) * 2)
    system[:count, count:-2], system[:count, -1] = rise[:, :-1], rise[:, -1]
    system[count:-2, :count] = -np.eye(count)
    system[-2, -1] = 1
    system[-1, :count], system[-1, -2] = force[:-1] / inertia, -2 * beam / inertia
    propagator = expm(STEP * system)
    state, heights = np.eye(2 * count + 2)[-2], []
    for _ in range(math.ceil(until / STEP) + 1):
        heights.append(state[-2])
        state = propagator @ state
    return STEP * np.arange(len(heights), dtype=float), np.array(heights)
