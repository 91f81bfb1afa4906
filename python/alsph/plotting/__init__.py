"""Figures of runs and of their fields, as pure functions: results in, :class:`matplotlib.figure.Figure` out."""

from alsph.plotting.animation import Film, animate
from alsph.plotting.curves import Curve, convergence, gauges, panels, pressure_coefficient, probes, profile
from alsph.plotting.histories import coefficients, forces, ledger, spectrum
from alsph.plotting.pictures import FIELDS, extent_of, field, field_style, fields
from alsph.plotting.setup import start
from alsph.plotting.style import PALETTE, head, remark, rename, save, title

__all__ = [
    "FIELDS",
    "PALETTE",
    "Curve",
    "Film",
    "animate",
    "coefficients",
    "convergence",
    "extent_of",
    "field",
    "field_style",
    "fields",
    "forces",
    "gauges",
    "head",
    "ledger",
    "panels",
    "pressure_coefficient",
    "probes",
    "profile",
    "remark",
    "rename",
    "save",
    "spectrum",
    "start",
    "title",
]
