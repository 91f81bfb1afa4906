"""Augmented Lagrangian SPH: incompressible flow with particles, without a pressure Poisson solve.

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
