"""What a run records of its simulation as it goes, beside particles and history."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from numpy.typing import NDArray

from alsph.engine.simulation import Simulation


@runtime_checkable
class Output(Protocol):
    """A file of a run folder that grows as the run does.

    A case adds its own by :meth:`alsph.cases.Case.outputs`; docs/add_your_own.md has one. What is recorded is
    appended to the file with the next checkpoint, so that a run which is cut and resumed leaves the file of a whole
    one.

    Attributes
    ----------
    file : str
        Its name in the run folder; of a case of your own ``output_NAME.csv`` or the like.
    interval : float
        Time between two records [D/U].
    """

    file: str
    interval: float

    def record(self, simulation: Simulation, rows: Mapping[str, NDArray[Any]]) -> None:
        """Keep what is to be known of the simulation now; `rows` are those of the history since the last call."""

    def append(self, path: Path) -> None:
        """Append what has been recorded to the file, which may not exist yet, and then forget it."""

    def truncate(self, path: Path, time: float) -> None:
        """Drop what is later than `time` [D/U] from the file: the run goes on from a checkpoint of that time."""
