"""Figures of a run, as pure functions: results in, :class:`matplotlib.figure.Figure` out, no global state."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from alsph.arguments import path_of
from alsph.errors import ConfigError
from alsph.folder.durable import check_target, replacing
from alsph.parameters import suggest
from alsph.symbols import GENERAL, Symbols
from alsph.text import in_figure

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend


TIME_LABEL = "$tU/D$"

PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#555555")
"""Colours of curves: those of Okabe and Ito (2008), which the colour-blind tell apart, grey for black and yellow."""

MARKERS = "osD^v<>pPX"
"""What tells curves apart in print, and to who sees no colours."""

BESIDE = "beside"
"""Identifies legends on the right of the panels, which a title does not stand above."""

MARKED = 8
"""Number of markers of a curve that has a point a step."""


def line(number: int, of: int, points: int, *, logarithmic: bool = False) -> dict[str, Any]:
    """Return how matplotlib is to draw a curve: its colour, and where it is one of several markers at some points.

    Parameters
    ----------
    number : int
        Number of the curve in the figure, from 0.
    of : int
        How many curves there are.
    points : int
        How many points it has.
    logarithmic : bool
        Whether they stand closer and closer on the abscissa.
    """
    colour = {"color": PALETTE[number % len(PALETTE)]}
    if of == 1:
        return colour
    places = (np.arange(MARKED) + 0.5 + 0.15 * (number % 4)) / MARKED  # not on those of the next curve
    index = np.unique(points**places - 1 if logarithmic else (points - 1) * places).astype(int)
    marker = {"marker": MARKERS[number % len(MARKERS)], "ms": 4, "markevery": index[(index >= 0) & (index < points)]}
    return colour | marker


def blank(width: float, height: float, layout: Literal["constrained", "compressed"] = "constrained") -> Figure:
    """Return an empty figure of a size in inches."""
    from alsph.plotting.picture import Picture  # half a second that only pictures take

    return Picture(figsize=(width, height), layout=layout)


def nothing_to_draw(figure: Figure, why: str) -> None:
    """Say in each panel of a figure why it is empty."""
    for axes in figure.axes:
        axes.text(0.5, 0.5, why, ha="center", transform=axes.transAxes)


def save(figure: Figure, path: str | Path, **options: Any) -> None:
    """Save a figure in a file, whose folder is made; what was there is replaced, nothing is written through a link.

    Parameters
    ----------
    figure : Figure
    path : path
        The file, whose suffix says the format: PNG if there is none.
    **options
        Of matplotlib's ``savefig``.

    Raises
    ------
    ConfigError
        If the format is unknown.
    RunFolderError
        If the file is a link or a special file.
    """
    path = path_of("path", path)
    path = path if path.suffix else path.with_suffix(".png")
    known = figure.canvas.get_supported_filetypes()
    if (kind := path.suffix[1:].lower()) not in known:
        raise ConfigError(f"{path}: '{kind}' is no format of figures; {suggest(kind, known)}")
    path.parent.mkdir(parents=True, exist_ok=True)
    check_target(path)
    with replacing(path) as temporary:
        figure.savefig(temporary, format=kind, **options)


def title(flows: Sequence[Mapping[str, Any]]) -> str:
    """Return what pictures are of, from the parameters of each flow: ``case``, ``reynolds``, ``resolution``."""
    parts = [in_figure(", ".join(dict.fromkeys(str(flow.get("case")) for flow in flows)).replace("_", " "))]
    for symbol, name in (("Re", "reynolds"), (r"$D/\Delta x$", "resolution")):
        known = sorted({value for flow in flows if isinstance(value := flow.get(name), int | float)})
        if known:
            parts.append(f"{symbol} = {', '.join(f'{value:g}' for value in known)}")
    return ", ".join(parts)


def head(figure: Figure, title: str) -> None:
    """Write what a figure is of above its panels."""
    beside = sum(_width(figure, legend) for legend in figure.legends if legend.get_gid() == BESIDE)
    figure.suptitle(title, fontsize="medium", x=0.5 - 0.5 * beside / figure.get_figwidth())


def legend_beside(figure: Figure, handles: Sequence[Artist], labels: Sequence[str]) -> None:
    """Put a legend on the right of the panels, which stay as wide as they are beside one of 1.5 inches."""
    legend = figure.legend(handles, labels, loc="outside right upper", fontsize="small", frameon=False)
    legend.set_gid(BESIDE)
    figure.set_figwidth(figure.get_figwidth() + max(0.0, _width(figure, legend) - 1.5))


def _width(figure: Figure, legend: Legend) -> float:
    """Return the width of a legend of a figure [inch]."""
    return float(legend.get_window_extent().width / figure.dpi)


def rename(figure: Figure, symbols: Symbols) -> None:
    """Write a figure's labels, which speak of D and U, in the names of a case."""
    from matplotlib.text import Text

    if symbols != GENERAL:
        for label in figure.findobj(Text):
            label.set_text(symbols(label.get_text()))


def remark(figure: Figure, text: str) -> None:
    """Write a remark below a figure."""
    if text:
        width = int(figure.get_size_inches()[0] * 17)  # letters in a line
        figure.supxlabel(
            textwrap.fill(text, width), fontsize="x-small", color="0.3", x=0.01, ha="left", parse_math=False
        )
