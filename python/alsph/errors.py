"""Exceptions: each message says what was wrong, where, and how to mend it."""


class AlsphError(Exception):
    """Base of all errors that alsph raises on purpose."""

    exit_code = 2


class ConfigError(AlsphError, ValueError):
    """A parameter, a configuration file or an array cannot be used."""


class RunFolderError(AlsphError):
    """A run folder cannot be created, written, read or resumed."""


class SolverError(AlsphError, RuntimeError):
    """The computation broke down; the message names step, time, particle, position and field."""

    exit_code = 1
