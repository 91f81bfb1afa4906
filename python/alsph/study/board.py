"""Progress of a study: a live table on a terminal, plain lines elsewhere; and the table of its state."""

import time as clock
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from alsph.study.declaration import Point, Study
from alsph.study.state import ENDED, State
from alsph.text import duration, printable

PLAIN_SECONDS = 60.0


class Board:
    """Reports a study to the user.

    Parameters
    ----------
    study
        The study.
    points
        Its runs.
    output
        Where it is.
    enabled
        Report at all.
    """

    def __init__(self, study: Study, points: Sequence[Point], output: Path, *, enabled: bool = True) -> None:
        self.study, self.points, self.output = study, points, output
        self.console = Console(highlight=False, quiet=not enabled, soft_wrap=True)
        self.live = Live(console=self.console, auto_refresh=False) if enabled and self.console.is_terminal else None
        self.first: dict[str, tuple[float, float]] = {}  # time reached and clock when a run was first seen to run
        self.start_work: float | None = None
        self.start = self.last_line = clock.monotonic()
        self.labels = {point.name: point.label for point in points}

    def __enter__(self) -> Self:
        """Show the table."""
        self.say(f"study {self.study.in_words}: {len(self.points)} runs in {self.output}")
        if self.live:
            self.live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop the table."""
        if self.live:
            self.live.stop()

    def say(self, line: str) -> None:
        """Print a line."""
        self.console.print(printable(line), markup=False)

    def ended(self, name: str, how: str) -> None:
        """Report the end of a run."""
        self.say(f"{how}: {self.labels[name]}  ({name})")

    def update(self, found: Mapping[str, State]) -> None:
        """Report the states of the runs by name."""
        now = clock.monotonic()
        for name, state in found.items():
            if state.status == "running":
                self.first.setdefault(name, (state.time, now))
        if self.live:
            self.live.update(self._table(found, now), refresh=True)
        elif now - self.last_line >= PLAIN_SECONDS:
            self.last_line = now
            for point in self.points:
                if found[point.name].status == "running":
                    status, label, reached = self._cells(point, found[point.name], now)
                    self.say(f"  {status:8}  {label}  {reached}")
            self.say(self._total(found, now))

    def _table(self, found: Mapping[str, State], now: float) -> Group:
        """Return a row for each run, its label cut where there is no room for it, what went wrong, and the total."""
        table = Table.grid(padding=(0, 2), expand=True)
        for ratio in (None, 1, None):
            table.add_column(no_wrap=True, overflow="ellipsis", ratio=ratio)
        shown = self.points if len(self.points) <= self.console.height - 4 else self._lively(found)
        for point in shown:
            table.add_row(*(Text(printable(cell)) for cell in self._cells(point, found[point.name], now)))
        failed = [point for point in shown if found[point.name].status == "failed"]
        reasons = [f"{point.label}: {found[point.name].message}" for point in failed]
        return Group(table, *(Text(printable(line), overflow="fold") for line in (*reasons, self._total(found, now))))

    def _lively(self, found: Mapping[str, State]) -> list[Point]:
        """Return the runs that are going on or have failed, where the screen does not hold all."""
        return [point for point in self.points if found[point.name].status in ("running", "failed")]

    def _cells(self, point: Point, state: State, now: float) -> tuple[str, str, str]:
        """Return the status of a run, its label, and how far it is."""
        if state.status != "running":
            return state.status, point.label, ""
        reached = f"t* {state.time:.2f} of {point.config.until_in_words}  ETA {self._left(point, state, now)}"
        return state.status, point.label, reached

    def _left(self, point: Point, state: State, now: float) -> str:
        time, seen = self.first.get(point.name, (state.time, now))
        if state.time <= time:
            return "?"
        most = "at most " * point.config.converges
        return most + duration((now - seen) * (point.config.until - state.time) / (state.time - time))

    def _total(self, found: Mapping[str, State], now: float) -> str:
        counts = Counter(found[point.name].status for point in self.points)
        done, total = (sum(work) for work in zip(*(_work(p, found[p.name]) for p in self.points), strict=True))
        if self.start_work is None:
            self.start_work = done
        ended = sum(counts[status] for status in ENDED)
        line = f"{ended} of {len(self.points)} runs ended ({', '.join(f'{n} {name}' for name, n in counts.items())})"
        if ended == len(self.points):
            return line
        pace = (done - self.start_work) / (now - self.start) if now > self.start else 0.0
        left = duration((total - done) / pace) if pace > 0 else "?"
        return f"{line}, {100 * done / total:.0f} % of the work, ETA of all {left}"


def _work(point: Point, state: State) -> tuple[float, float]:
    """Work done and to be done of a run, in pairs of particles."""
    work = point.config.work
    if state.status in ENDED:
        return work, work
    return work * min(state.time / point.config.until, 1.0), work


def overview(points: Sequence[Point], found: Mapping[str, State]) -> list[str]:
    """Return the state of a study: one line a run, and a total."""
    lines = []
    for point in points:
        state = found[point.name]
        until = point.config.until_in_words
        reached = f"t* {state.time:.4g} of {until}, {duration(state.seconds)}" if state.seconds else ""
        lines.append("  ".join(part for part in (f"{state.status:8}", point.label, reached, state.message) if part))
    counts = Counter(found[point.name].status for point in points)
    return [*lines, f"{len(points)} runs: " + ", ".join(f"{count} {status}" for status, count in counts.items())]
