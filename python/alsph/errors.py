"""Exceptions: each message says what was wrong, where, and how to mend it, and is fit to be shown."""

from alsph.text import printable


class AlsphError(Exception):
    """Base of all errors that alsph raises on purpose."""

    exit_code = 2

    def __init__(self, message: str) -> None:
        super().__init__(printable(message))


class ConfigError(AlsphError, ValueError):
    """A parameter, a configuration file or an array cannot be used; it may tell several ``mistakes`` at once."""

    def __init__(self, *mistakes: str) -> None:
        super().__init__("; ".join(mistakes))
        self.mistakes = mistakes


class RunFolderError(AlsphError):
    """A run folder cannot be created, written, read or resumed."""


class DamagedError(RunFolderError):
    """A file does not hold what was written to it."""


class OtherPointsError(AlsphError, ValueError):
    """A file holds samples at other points than those that are asked for."""


class SolverError(AlsphError, RuntimeError):
    """The computation broke down; the message names step, time, particle, position and field."""

    exit_code = 1


class SharedError(AlsphError, RuntimeError):
    """A simulation is used where it cannot be: in a forked process, or by two threads at a time."""


class WalltimeError(AlsphError):
    """A run has used up the time that it was given, and can be resumed."""

    exit_code = 75


class Interrupted(KeyboardInterrupt):
    """A run was stopped by Ctrl-C or a signal, and can be resumed; ``exit_code`` is 128 and the signal's number."""

    def __init__(self, message: str, number: int = 2) -> None:
        super().__init__(printable(message))
        self.exit_code = 128 + number
