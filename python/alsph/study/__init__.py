"""Parameter studies: declared, cached, resumable, parallel, and drawn.

Examples
--------
>>> from alsph import study
>>> results = study.run("reynolds", preset="quick", output="runs/studies")  # doctest: +SKIP
>>> results.rows[0]["mean drag coefficient"]  # doctest: +SKIP
"""

from alsph.study.declaration import Figure, Point, Published, Study, Sweep, load, shipped
from alsph.study.execution import run
from alsph.study.results import Results, check_names
from alsph.study.state import State, states

__all__ = [
    "Figure",
    "Point",
    "Published",
    "Results",
    "State",
    "Study",
    "Sweep",
    "check_names",
    "load",
    "run",
    "shipped",
    "states",
]
