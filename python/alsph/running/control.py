"""How a run is stopped: by signals, by the wall clock."""

import contextlib
import math
import re
import signal
import threading
import time as clock
from collections.abc import Iterator
from dataclasses import dataclass, field
from types import FrameType

from alsph.arguments import number, whole
from alsph.errors import ConfigError, Interrupted
from alsph.text import shown


@dataclass(frozen=True)
class Control:
    """What a run obeys beside its configuration.

    Attributes
    ----------
    progress : bool
        Report progress.
    stop : threading.Event
        Ends the run as Ctrl-C does once it is set, which another thread may do.
    walltime : float
        Seconds after which the run is to have written a checkpoint and ended.
    retry : int
        How often a run that breaks down goes back to a checkpoint and on with a smaller time step.
    """

    progress: bool = True
    stop: threading.Event = field(default_factory=threading.Event)
    walltime: float = math.inf
    retry: int = 0
    deadline: float = field(init=False)

    def __post_init__(self) -> None:
        """Refuse what makes no sense."""
        if not isinstance(self.progress, bool):
            raise ConfigError(f"progress = {shown(self.progress)}: must be True or False")
        object.__setattr__(self, "retry", whole("retry", self.retry, 0))
        object.__setattr__(self, "deadline", clock.monotonic() + number("walltime", self.walltime, above=0, unit="s"))


@contextlib.contextmanager
def interruptible(event: threading.Event) -> Iterator[list[int]]:
    """Have Ctrl-C, SIGTERM and SIGHUP set an event, so that no write is cut short; gives the signals that have come.

    Another one a second later or more interrupts at once; before, it is an echo from the terminal or a wrapper.
    """
    first, numbers = math.inf, []

    def handler(number: int, _frame: FrameType | None) -> None:
        nonlocal first
        if clock.monotonic() > first + 1.0:
            raise Interrupted("stopped at once; `alsph resume` goes on from the last checkpoint", number)
        first = min(first, clock.monotonic())
        numbers.append(number)
        event.set()

    main = threading.current_thread() is threading.main_thread()
    caught = [signal.SIGINT, signal.SIGTERM]
    if getattr(signal, "SIGHUP", None) and signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # as nohup has it
        caught.append(signal.SIGHUP)
    previous = {number: signal.signal(number, handler) for number in caught if main}
    try:
        yield numbers
    finally:
        for number, old in previous.items():
            signal.signal(number, old)


def seconds_of(text: str | None) -> float:
    """Return a length of time given as [D-]HH:MM:SS in seconds; without end if None.

    Raises
    ------
    ConfigError
        If the text is no such length.
    """
    if text is None:
        return math.inf
    match = re.fullmatch(r"(?:(\d+)-)?(\d+):([0-5]\d):([0-5]\d)", text)
    if not match:
        raise ConfigError(f"walltime = {text!r}: must be [D-]HH:MM:SS, as 01:30:00 or 2-00:00:00")
    days, hours, minutes, seconds = (int(part or 0) for part in match.groups())
    return float(((24 * days + hours) * 60 + minutes) * 60 + seconds)
