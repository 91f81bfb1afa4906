"""Figures that notebooks show."""

import io

from matplotlib.figure import Figure


class Picture(Figure):
    """A figure that is shown where a notebook ends a cell with it, whatever the notebook has imported."""

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        self.savefig(buffer, format="png")
        return buffer.getvalue()
