"""What may be asked of the results of a run, by those who do not read its folder."""

from pathlib import Path
from typing import Any, Protocol

from alsph.analysis.averages import Estimate
from alsph.analysis.loads import Divergence, Load, PressureCoefficient
from alsph.analysis.window import Window
from alsph.arrays import FloatArray
from alsph.geometry.particles import Snapshot


class Record(Protocol):
    """What cases, fields at points and ledgers ask of a run; :class:`alsph.Run` answers, and says what each is."""

    path: Path
    info: dict[str, Any]

    def file(self, name: str) -> Path:
        """Return a file of the run folder."""

    @property
    def status(self) -> str:
        """How far the run is."""

    @property
    def spacing(self) -> float:
        """Particle spacing Δx [D]."""

    @property
    def history(self) -> dict[str, FloatArray]:
        """Columns of the history, one entry a step."""

    @property
    def times(self) -> FloatArray:
        """Times tU/D of the snapshots, shape (k,)."""

    def snapshot(self, time: float | None = None) -> Snapshot:
        """Particles of the snapshot nearest to a time tU/D, the last one if None."""

    @property
    def body(self) -> str | None:
        """Name of the body that drag and lift are those of."""

    @property
    def window(self) -> Window:
        """Averaging window."""

    @property
    def drag(self) -> Load:
        """Drag coefficient."""

    @property
    def lift(self) -> Load:
        """Lift coefficient."""

    def load(self, axis: str, body: str | None = None) -> Load:
        """Force coefficient of a body along an axis."""

    def moment(self) -> Load:
        """Pitching moment coefficient."""

    @property
    def strouhal(self) -> Estimate:
        """Strouhal number of the lift."""

    @property
    def averaged(self) -> dict[str, Estimate]:
        """Mean drag C_D' and, with shedding, rms lift C_L' and Strouhal number Sr."""

    @property
    def divergence(self) -> Divergence:
        """Velocity divergence."""

    @property
    def pressure_coefficient(self) -> PressureCoefficient:
        """Mean pressure coefficient on the surface."""
