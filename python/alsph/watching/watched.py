"""What a page shows of a run folder, of which it reads what has changed and writes nothing."""

import io
import json
import math
import time as clock
from collections.abc import Callable
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from alsph import plotting
from alsph.analysis.averages import Estimate
from alsph.arrays import FloatArray
from alsph.cases.source import shown_name
from alsph.errors import RunFolderError
from alsph.folder.durable import mark
from alsph.folder.reading import History
from alsph.plotting.histories import robust_limits
from alsph.results.outcome import has_surface
from alsph.results.run import Run
from alsph.symbols import Symbols
from alsph.text import contents, duration, printable

FILES = ("case.toml", "run.json", "history.csv", "surface.h5", "particles.vtkhdf", "figures")
"""What tells by its time and size that there is something new."""
BUCKETS = 600
"""Parts of a curve of which the page gets least and largest value: about the pixels of a panel."""
SHARE = 5.0
"""An answer is not made again before so many times the time that it took: watching leaves the cores to the run."""
MOST_BYTES = 2**26
"""Of a figure that is shown."""
FIGURES = {".png": "image/png", ".gif": "image/gif"}
WIDTHS = {"wide": 9.0, "narrow": 4.5}
"""Widths of pictures in inches."""
INKS = {"light": "0.15", "dark": "0.8"}
"""Text and axes of pictures on a light and on a dark page."""


class Kept:
    """An answer that is made when it is asked for and what it is of has changed, by one who asks at a time."""

    def __init__(self, share: float = SHARE) -> None:
        self.share, self.lock = share, Lock()
        self.of: object = None
        self.answer, self.rest = b"", 0.0

    def get(self, of: object, make: Callable[[], bytes]) -> bytes:
        """Return the answer."""
        with self.lock:
            began = clock.monotonic()
            if self.of != of and began >= self.rest:
                self.answer, self.of = make(), of
                self.rest = clock.monotonic() + self.share * (clock.monotonic() - began)
            return self.answer


class Watched:
    """The run in a folder, which may go on, be replaced, damaged or removed meanwhile.

    Parameters
    ----------
    path : path
        The run folder.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._history, self._reading = History(self.path / "history.csv"), Lock()
        self._state, self._results = Kept(), Kept()
        self._pictures = {(name, width, ink): Kept(0) for name in plotting.FIELDS for width in WIDTHS for ink in INKS}
        self._drawing = Lock()

    def _now(self) -> tuple[object, ...]:
        return tuple(mark(self.path / name) for name in FILES)

    def state(self) -> bytes:
        """Return as JSON how far the run is, its curves, and what there is to be drawn."""
        of, run = self._now(), Run(self.path)
        return self._state.get((of, run.status), lambda: _json(self._found(run)))

    def _found(self, run: Run) -> dict[str, Any]:
        problems: list[str] = []
        with self._reading:
            run.history = _tried(problems, self._history.read, {"time": np.empty(0)})
        return {
            "folder": printable(str(self.path)),
            "case": printable(str(run.info.get("case") or shown_name(run.case.get("case")))).replace("_", " "),
            "reynolds": f"{run.case['reynolds']:g}",
            "resolution": f"{run.case['resolution']:g}",
            "status": printable(run.status),
            "message": printable(str(run.info.get("message", ""))),
            "clock": run.symbols.clock,
            "length": run.symbols.length,
            "progress": _tried(problems, lambda: _progress(run), {}),
            "time": _thinned(run.history["time"]),
            "panels": [
                *_tried(problems, lambda: _forces(run), []),
                *_tried(problems, lambda: _numerics(run), []),
            ],
            "fields": list(plotting.FIELDS),
            "snapshot": mark(self.path / "particles.vtkhdf"),
            "figures": self._figures(),
            "problems": list(dict.fromkeys(problems)),
        }

    def results(self) -> bytes:
        """Return as JSON means with their uncertainty, and remarks."""
        of, run = self._now(), Run(self.path)

        def judge() -> bytes:
            problems: list[str] = []
            with self._reading:
                history = _tried(problems, self._history.read, None)
            if history is None:
                return _json({"problems": problems})
            run.history = history
            return _json(_judged(run, problems))

        return self._results.get((of, run.status), judge)

    def picture(self, field: str, width: str, ink: str) -> bytes:
        """Return a field of the newest snapshot as PNG, drawn once.

        Parameters
        ----------
        field : str
            One of the names in ``alsph.plotting.FIELDS``.
        width : {"wide", "narrow"}
        ink : {"light", "dark"}
            For what kind of page.

        Raises
        ------
        RunFolderError
            If there is no such picture.
        """
        if (field, width, ink) not in self._pictures:
            raise RunFolderError("no such picture")

        def draw() -> bytes:
            run = Run(self.path)
            with self._drawing:
                return _png(run, field, WIDTHS[width], INKS[ink])

        return self._pictures[field, width, ink].get(mark(self.path / "particles.vtkhdf"), draw)

    def figure(self, name: str) -> tuple[str, bytes]:
        """Return kind and content of one of the run's figures.

        Raises
        ------
        RunFolderError
            If there is none of that name.
        """
        if name not in {figure["name"] for figure in self._figures()}:
            raise RunFolderError("no such figure")
        path = self.path / "figures" / name
        return FIGURES[path.suffix], contents(path, MOST_BYTES)

    def _figures(self) -> list[dict[str, Any]]:
        """Return the names of the figures, the newest first; files elsewhere, behind links, are none."""
        folder = self.path / "figures"
        try:
            if folder.is_symlink():
                return []
            marks = {entry: mark(entry) for entry in folder.iterdir() if entry.suffix in FIGURES}
        except OSError:  # none have been drawn yet
            return []
        newest = sorted((mark, entry.name) for entry, mark in marks.items() if mark)
        return [{"name": name, "of": mark} for mark, name in reversed(newest)]


def _tried(problems: list[str], make: Callable[[], Any], otherwise: Any) -> Any:
    """Return what is made of files that may be damaged, by code that may be the user's; note what is wrong."""
    try:
        return make()
    except Exception as error:
        problems.append(printable(str(error)) or type(error).__name__)
        return otherwise


def _progress(run: Run) -> dict[str, Any]:
    """How far the run is, and when it will have ended if it goes on as fast as it did on the whole."""
    time, until = run.history["time"], run.info.get("until")
    until = until if isinstance(until, int | float) and until > 0 else run.config.until
    reached = max(float(time[-1]) if len(time) else 0.0, float(run.info.get("time", 0.0)))
    seconds = float(run.info.get("seconds", 0.0))
    running = run.status == "running"
    if running:  # run.json is written every now and then, the history every other second
        written = [(run.path / name).stat().st_mtime for name in ("run.json", "history.csv") if len(time)]
        seconds += max(0.0, written[1] - written[0]) if written else 0.0
    settings = run.case.get("run")
    most = "at most " * (isinstance(settings, dict) and settings.get("until") == "converged" and running)
    found = {"time": f"{reached:.4g}", "until": f"{most}{until:g}", "share": min(1.0, reached / until)}
    found |= {"steps": len(time), **({"seconds": duration(seconds)} if seconds > 0 else {})}
    if running and 0 < reached < until and seconds > 0:
        found["left"] = (most or "about ") + duration(seconds * (until - reached) / reached)
    return found


def _panel(symbols: Symbols, title: str, curves: dict[str, FloatArray], **options: Any) -> dict[str, Any]:
    """Return curves over time as they are drawn in a panel."""
    return {"title": symbols(title), "curves": {name: _thinned(values) for name, values in curves.items()}, **options}


def _forces(run: Run) -> list[dict[str, Any]]:
    """Return drag and lift of the bodies, of runs without any the kinetic energy."""
    time = run.history["time"]
    if not run.body:
        missing = np.full(len(time), np.nan)
        kinetic, potential = (run.history.get(f"{name}_energy", missing) for name in ("kinetic", "potential"))
        if has_surface(run.history) and potential.any():
            curves = {"kinetic": kinetic, "potential": potential, "both": kinetic + potential}
            return [_panel(run.symbols, "energy E / ρU² Dᵈ", curves)]
        return [_panel(run.symbols, "kinetic energy E / ρU² Dᵈ", {"energy": kinetic})]
    found = []
    for name, axis in (("drag", "x"), ("lift", "y")):
        curves = {part: run.coefficient(axis, part) for part in ("total", "pressure", "viscous")}
        limits = robust_limits([(time, values) for values in curves.values()])
        found.append(_panel(run.symbols, f"{name} coefficient", curves, of=name, limits=limits))
    return found


def _numerics(run: Run) -> list[dict[str, Any]]:
    """Return divergence, iterations and time step."""
    history, missing = run.history, np.full(len(run.history["time"]), np.nan)
    largest, mean = (history.get(f"divergence_{name}", missing) for name in ("max", "mean"))
    return [
        _panel(run.symbols, "velocity divergence |∇·u| D/U", {"largest": largest, "mean": mean}, log=True),
        _panel(run.symbols, "iterations of a step", {"iterations": history.get("iterations", missing)}),
        _panel(run.symbols, "time step ΔtU/Δx", {"time step": history.get("time_step", missing) / run.spacing}),
    ]


def _thinned(values: FloatArray) -> list[float | None]:
    """Return a curve, of a long one the least and the largest value of each of equal parts, as numbers of JSON.

    Times, which grow, are so thinned to begin and end of the parts.
    """
    if len(values) > 2 * BUCKETS:
        first = np.linspace(0, len(values), BUCKETS, endpoint=False).astype(int)
        values = np.stack([np.fmin.reduceat(values, first), np.fmax.reduceat(values, first)], axis=1).ravel()
    return [float(f"{value:.6g}") if math.isfinite(value) else None for value in values.tolist()]


def _judged(run: Run, problems: list[str]) -> dict[str, Any]:
    """Return what ``alsph info`` tells, the window, the means that are drawn, and the remarks."""
    resolution = run.symbols("resolution, D/Δx")
    known = ("case", "Reynolds number", resolution, "status", "message", "computing time")
    summary = _tried(problems, run.summary, {})
    rows = [(name, value) for name, value in summary.items() if name not in known and not name.startswith("remark ")]
    found: dict[str, Any] = {
        "rows": [[printable(name), _words(value, summary["averaging rule"])] for name, value in rows],
        "remarks": [printable(remark) for remark in _tried(problems, lambda: run.remarks, [])],
        "problems": problems,
    }
    if summary and run.body and run.window.edges.size:
        found["window"] = [run.window.start, run.window.end]
        means = {"drag": run.drag.mean, "lift": run.lift.mean}
        found["means"] = {name: [float(mean), str(mean)] for name, mean in means.items() if math.isfinite(mean)}
    return found


def _words(value: object, rule: str) -> str:
    """Return a result as it is read: where there is no number, why."""
    if isinstance(value, Estimate) and math.isnan(value):
        return f"none yet: {'see the averaging rule' if value.note == rule else value.note}"
    return printable(str(value))


def _png(run: Run, field: str, width: float, ink: str) -> bytes:
    """Draw a field of the newest snapshot on a ground that lets the page through."""
    import matplotlib

    inked = ("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color")
    grounds = ("figure.facecolor", "axes.facecolor", "savefig.facecolor")
    settings: dict[Any, str] = dict.fromkeys(inked, ink) | dict.fromkeys(grounds, "none")
    with matplotlib.rc_context(settings):
        snapshot = run.snapshot()
        figure = plotting.field(snapshot, field, run.spacing, width=width, plane=run.plane(snapshot))
        plotting.rename(figure, run.symbols)
        file = io.BytesIO()
        figure.savefig(file, format="png", dpi=150, bbox_inches="tight")
    return file.getvalue()


def _json(content: object) -> bytes:
    return json.dumps(content, allow_nan=False).encode()
