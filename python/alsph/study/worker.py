"""One run of a study, on a worker of a cluster or in a process: ``python -m alsph.study.worker FOLDER PARENT``.

The process reads the configuration's tables from its standard input, as JSON, and prints how the run ended.
"""

import contextlib
import json
import os
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from alsph import config
from alsph.errors import AlsphError, RunFolderError, SolverError
from alsph.running.control import Control
from alsph.running.start import complete

POLL_SECONDS = 0.5


def perform(tables: dict[str, Any], path: str, parent: int | None = None) -> str:
    """Bring a run to its end, from wherever its folder stands, and return how it ended.

    Parameters
    ----------
    tables
        The configuration (see :func:`alsph.config.from_tables`).
    path
        The run folder.
    parent
        Process with whose end the run is to stop; the parent of this process if None.

    Returns
    -------
    str
        ``finished``, ``diverged`` or ``stopped``.

    Raises
    ------
    RunFolderError
        If the folder cannot be used.
    """
    folder = Path(path)
    if not folder.parent.is_dir():
        raise RunFolderError(f"{folder.parent}: not seen from this machine; put the output on a shared file system")
    if stop_request(folder).exists():
        return "stopped"
    with _stopped_by(stop_request(folder), parent or os.getppid()) as stop:
        try:
            complete(config.from_tables(tables), folder, Control(progress=False, stop=stop))
        except SolverError:
            return "diverged"
        except KeyboardInterrupt:
            return "stopped"
    return "finished"


def stop_request(folder: Path) -> Path:
    """Return the file, beside a run folder, that asks the run to stop."""
    return folder.with_name(f"{folder.name}.stop")


@contextlib.contextmanager
def _stopped_by(request: Path, parent: int) -> Iterator[threading.Event]:
    """Give an event that is set when the file `request` appears or the parent process is gone."""
    stop, over = threading.Event(), threading.Event()

    def watch() -> None:
        while not over.wait(POLL_SECONDS):
            if request.exists() or os.getppid() != parent:
                stop.set()

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield stop
    finally:
        over.set()
        watcher.join()


def main() -> None:
    """Perform the run that the standard input describes."""
    try:
        print(perform(json.load(sys.stdin), sys.argv[1], int(sys.argv[2])))
    except (AlsphError, OSError) as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
