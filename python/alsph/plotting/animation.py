"""Films of the particles' fields."""

from __future__ import annotations

import base64
import itertools
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from alsph.analysis.record import Record
from alsph.errors import ConfigError
from alsph.folder.durable import check_target, replacing
from alsph.geometry.plane import Plane
from alsph.plotting import pictures
from alsph.plotting.style import remark, rename
from alsph.symbols import GENERAL, Symbols
from alsph.text import shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Frame = NDArray[np.uint8]

GIF, VIDEO = ".gif", (".mp4", ".webm")
DPI = 100
MOST_SHOWN = 30 * 2**20
"""Bytes of a film up to which a notebook shows it in itself."""

SCALED_BY = 5
"""Number of snapshots, evenly over the film, that the colour scale is made for."""


class Film(type(Path())):  # type: ignore[misc]
    """The path of a film, which a notebook shows where it ends a cell, if it is not very large."""

    def _repr_html_(self) -> str | None:
        kind = self.suffix.lower()
        if kind not in (GIF, *VIDEO) or not self.is_file() or self.stat().st_size > MOST_SHOWN:
            return None
        data = base64.b64encode(self.read_bytes()).decode()
        if kind == GIF:
            return f'<img src="data:image/gif;base64,{data}">'
        return f'<video controls loop src="data:video/{kind[1:]};base64,{data}"></video>'


def animate(
    run: Record,
    name: str,
    path: Path,
    *,
    start: float = -np.inf,
    end: float = np.inf,
    every: int = 1,
    fps: float = 10.0,
    limit: float | None = None,
    view: tuple[float, float, float, float] | None = None,
    title: str = "",
    said: str = "",
    symbols: Symbols = GENERAL,
    plane: Plane | None = None,
    progress: Callable[[int, int], None] = lambda done, count: None,
) -> None:
    """Make a film of a field; see :meth:`alsph.Run.animate`.

    `title` stands above each picture and `said` below, in `symbols`; `plane` is that of a run in 3-D; `progress` is
    called with the number of pictures that are done, and of all.
    """
    numbers = {"start": start, "end": end, "every": every, "fps": fps}
    if wrong := [what for what, value in numbers.items() if not isinstance(value, int | float | np.number)]:
        raise ConfigError(f"{wrong[0]} = {shown(numbers[wrong[0]])}: must be a number")
    if every < 1 or every != int(every):
        raise ConfigError(f"every = {every:g}: must be a whole number above zero")
    if not 0.1 <= fps <= 100:
        raise ConfigError(f"fps = {fps:g}: must lie between 0.1 and 100 pictures a second")
    kind = path.suffix.lower()
    if kind not in (GIF, *VIDEO):
        raise ConfigError(f"{path}: a film ends in .gif, .mp4 or .webm")
    if kind == GIF and abs((played := 100 / max(2, round(100 / fps))) / fps - 1) > 0.02:
        warnings.warn(f"a GIF lasts whole hundredths of a second a picture: {played:.3g} a second", stacklevel=3)
    pictures.field_style(name)
    times = [time for time in run.times if start <= time <= end][:: int(every)]
    if len(times) < 2:
        told = f"a film needs two snapshots or more, and there are {len(times)}"
        if len(run.times[:: int(every)]) < 2:
            raise ConfigError(f"{told}; lower output_interval")
        span = f"the run's lie at tU/D = {run.times[0]:.4g} to {run.times[-1]:.4g}"
        raise ConfigError(f"{told} between start and end; {span}, {len(run.times)} of them")
    view = view or _extent(run, times, plane)
    view = pictures.extent_of(run.snapshot(times[0]), run.spacing, view, plane)
    if limit is None:
        chosen = sorted({times[round(k)] for k in np.linspace(0, len(times) - 1, SCALED_BY)})
        limit = max(pictures.colour_limit(run.snapshot(time), name, run.spacing, view, plane) for time in chosen)

    def frames() -> Iterator[Frame]:
        for done, time in enumerate(times, 1):
            figure = pictures.field(
                run.snapshot(time), name, run.spacing, limit=limit, view=view, title=title, plane=plane
            )
            remark(figure, said)
            rename(figure, symbols)
            yield _pixels(figure)
            progress(done, len(times))

    path.parent.mkdir(exist_ok=True)
    check_target(path)
    with replacing(path) as temporary:
        if kind == GIF:
            _write_gif(frames(), temporary, fps)
        else:
            _write_video(frames(), temporary, fps, kind)


def _extent(run: Record, times: Sequence[float], plane: Plane | None) -> tuple[float, float, float, float] | None:
    """Return the view that holds the fluid at all times if it has a free surface; None: it stays where it is."""
    if not pictures.meets_air(run.snapshot(times[0])):
        return None
    extents = np.array([pictures.extent_of(run.snapshot(time), run.spacing, None, plane) for time in times])
    (left, _, bottom, _), (_, right, _, top) = extents.min(axis=0).tolist(), extents.max(axis=0).tolist()
    return left, right, bottom, top


def _pixels(figure: Figure) -> Frame:
    """Return the picture (rows, columns, 3), both even, as videos want them."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure.set_dpi(DPI)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]
    pixels = np.asarray(canvas.buffer_rgba())[..., :3]  # type: ignore[no-untyped-call]
    rows, columns = (2 * (size // 2) for size in pixels.shape[:2])
    return np.ascontiguousarray(pixels[:rows, :columns])


def _write_gif(frames: Iterator[Frame], path: Path, fps: float) -> None:
    from PIL import Image

    first, rest = Image.fromarray(next(frames)), (Image.fromarray(frame) for frame in frames)
    first.save(path, format="GIF", save_all=True, append_images=rest, duration=10 * max(2, round(100 / fps)), loop=0)


def _write_video(frames: Iterator[Frame], path: Path, fps: float, suffix: str) -> None:
    try:
        import imageio_ffmpeg
    except ImportError:
        raise ConfigError(
            f"a film in the format {suffix} needs imageio-ffmpeg: pip install 'alsph[video]', or ask for .gif"
        ) from None
    first = next(frames)
    options: dict[str, Any] = {"fps": fps, "macro_block_size": 2, "output_params": ["-f", suffix[1:]]}
    codec = {"codec": "libvpx-vp9"} if suffix == ".webm" else {}
    writer = imageio_ffmpeg.write_frames(str(path), first.shape[1::-1], **options, **codec)
    writer.send(None)
    try:
        for frame in itertools.chain([first], frames):
            writer.send(frame)
    finally:
        writer.close()
