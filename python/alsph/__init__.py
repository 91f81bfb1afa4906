"""Augmented Lagrangian SPH: incompressible flow with particles, without a pressure Poisson solve.

A case is its parameters, a run of it is a folder, and what is read from that is a ``Run``:

======================================================  =====================================================
``cases``                                               the flows, ``cases.Cylinder(...).run(folder)``
``open_run``, ``resume``, ``repeat``, ``watch``         a folder's run: its results, more of it, again, live
``compare``, ``compare_schemes``, ``converge``          runs beside each other, schemes, resolutions
``study``, ``validate``, ``autotune``                   many runs, references, the largest step
``Simulation``, ``Domain``, ``SolidBody``, ``Rigid``    the engine itself, step by step
``Units``, ``errors``                                   SI units, what is raised
======================================================  =====================================================

The other modules are what these are made of. On the command line: ``alsph --help``.

Examples
--------
>>> import alsph
>>> case = alsph.cases.Cylinder(reynolds=200, resolution=20)
>>> run = case.run("runs/re200", until=60, threads=2)  # doctest: +SKIP
"""

import lazy_loader

try:
    from alsph._alsph import __version__
except ImportError as error:
    raise ImportError(
        "alsph's engine is not built (or was built for another Python): in the source folder run "
        f"`maturin develop --release` for development, or `pip install .` to install it [{error}]"
    ) from error

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ += ["__version__"]
