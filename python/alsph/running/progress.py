"""Progress of a run: a live bar on a terminal, a line that changes in a notebook, one every ten seconds elsewhere."""

import time as clock
from contextlib import suppress
from types import TracebackType
from typing import Any, Self

from rich.console import Console, Group
from rich.live import Live
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.text import Text

from alsph.text import duration

PLAIN_SECONDS, NOTEBOOK_SECONDS = 10.0, 0.5


class Reporter:
    """Reports a run to the user.

    Parameters
    ----------
    until
        End time [D/U].
    time
        Time at the start [D/U].
    at_most
        Whether it may end earlier.
    enabled
        Report at all.
    """

    def __init__(self, until: float, time: float, *, at_most: bool = False, enabled: bool = True) -> None:
        self._until, self._first_time, self._enabled = until, time, enabled
        self._eta, self._judgement = "ETA at most" if at_most else "ETA", ""
        console = Console(highlight=False)
        self._console = console
        self._live: Live | None = None
        self._line: Any = None
        if enabled and console.is_jupyter:  # where rich would need ipywidgets
            from IPython.display import display

            self._line = display({"text/plain": "started"}, raw=True, display_id=True)  # type: ignore[no-untyped-call]
        elif enabled and console.is_terminal:
            rate = TextColumn("{task.description}  " + self._eta)
            self._bar = Progress(BarColumn(), TaskProgressColumn(), rate, TimeRemainingColumn(), console=console)
            self._task = self._bar.add_task("", total=until)
            self._bar.update(self._task, completed=time)
            self._live = Live(self._bar, console=console)
        self._start = self._last_line = clock.monotonic()
        self._steps = 0

    def __enter__(self) -> Self:
        """Show the bar."""
        if self._live:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop the bar."""
        if self._live:
            with suppress(OSError, ValueError):  # a terminal that has been closed
                self._live.stop()

    def say(self, line: str) -> None:
        """Print a line."""
        if self._enabled:
            try:
                self._console.print(line, markup=False, soft_wrap=True)
            except (OSError, ValueError, SystemExit):
                self._enabled = False

    def judged(self, judgement: str, until: float) -> None:
        """Take in what the run has come to, told from now on, and when it will end at the latest [D/U]."""
        self._judgement, self._until = judgement, until
        if self._live:
            self._bar.update(self._task, total=until)

    def update(self, rows: dict[str, Any]) -> None:
        """Report new rows of the history; where nobody listens any more, say nothing from then on."""
        if self._enabled and len(rows["step"]):
            try:
                self._report(rows)
            except (OSError, ValueError, SystemExit):  # a closed pipe or terminal, which must not end a run
                self._enabled = False

    def _report(self, rows: dict[str, Any]) -> None:
        now = clock.monotonic()
        self._steps += len(rows["step"])
        time, seconds = float(rows["time"][-1]), now - self._start
        rate = f"{self._steps / seconds:.1f} steps/s" if seconds > 0 else ""
        pause = NOTEBOOK_SECONDS if self._line else PLAIN_SECONDS
        if self._live:
            self._bar.update(self._task, completed=min(time, self._until), description=rate)
            self._live.update(Group(self._bar, Text(physics_line(rows)), *map(Text, filter(None, [self._judgement]))))
        elif now - self._last_line >= pause or (self._line and time >= self._until):
            self._last_line = now
            done = (time - self._first_time) / (self._until - self._first_time)
            left = duration(seconds * (1 / done - 1)) if done > 0 else "?"
            line = f"{100 * min(1.0, time / self._until):5.1f} %  {rate}  {self._eta} {left}  {physics_line(rows)}"
            line += f"  {self._judgement}" * bool(self._judgement)
            if self._line:
                self._line.update({"text/plain": line}, raw=True)
            else:
                self._console.print(line, markup=False, soft_wrap=True)


def physics_line(rows: dict[str, Any]) -> str:
    """Return the last row of the history in words."""
    last = {name: values[-1] for name, values in rows.items()}
    parts = [
        f"t* {last['time']:.3f}",
        f"{last['iterations']:d} iter",
        f"max|∇·u| {last['divergence_max']:.1e}",
    ]
    if "drag_coefficient" in last:
        parts += [f"C_D {last['drag_coefficient']:.3f}", f"C_L {last['lift_coefficient']:+.3f}"]
    count = sum(int(last[kind]) for kind in ("fluid", "inlet", "outlet", "solid"))
    return "  ".join([*parts, f"{count} particles"])
