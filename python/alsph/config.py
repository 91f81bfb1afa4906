"""Configuration files: a case and the settings of a run, from and to TOML."""

import os
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import tomli_w
from pydantic import Field

from alsph import cases
from alsph.errors import ConfigError
from alsph.parameters import Parameters

Made = TypeVar("Made")


class RunSettings(Parameters):
    """Settings of a run: how long, on how many threads, and what is written when."""

    until: float | None = Field(default=None, gt=0, description="end time [D/U]; the case's own default if not given")
    threads: int | None = Field(default=None, ge=1, le=4096, description="number of threads; all cores if not given")
    initial_run: str | None = Field(
        default=None,
        description="run folder whose last flow to start with, at any resolution; the case's own start if not given",
    )
    output_interval: float = Field(default=1.0, gt=0, description="time between two outputs of the particles [D/U]")
    surface_interval: float = Field(
        default=0.1, gt=0, description="time between two samples of the surface pressure [D/U]"
    )
    checkpoint_minutes: float = Field(default=10.0, gt=0, description="longest time between two checkpoints [min]")
    flush_seconds: float = Field(
        default=2.0, gt=0, description="longest time that rows of the history stay unwritten [s]"
    )


@dataclass(frozen=True)
class Config:
    """A case and the settings of its run."""

    case: cases.Case
    run: RunSettings = RunSettings()

    @property
    def until(self) -> float:
        """End time [D/U]."""
        return self.run.until or self.case.default_until

    @property
    def work(self) -> float:
        """About how many pairs of particles a run goes over: what the time that it takes is proportional to."""
        case = self.case
        neighbours = case.support_layers**case.space_dimensions
        iteration = 8 if case.algorithm in (1, "original") else 4
        passes = 5 + iteration * case.max_iterations + 2 * case.projection_sweeps
        steps = self.until * case.resolution / case.time_step
        return float(case.particle_estimate() * neighbours * steps * passes)

    def tables(self) -> dict[str, Any]:
        """Return the content of the configuration file; what is not set is left out."""
        return self.case_tables() | {"run": self.run.model_dump(exclude_none=True) | {"until": self.until}}

    def case_tables(self) -> dict[str, Any]:
        """Return the same without the settings of the run."""
        values = self.case.model_dump(include=set(self.case.parameter_names()))
        values = {name: values[name] for name in self.case.parameter_names()}
        return {"case": self.case.name} | {name: value for name, value in values.items() if value is not None}

    def save(self, path: Path) -> None:
        """Write the configuration with all its parameters to a TOML file."""
        path.write_text(tomli_w.dumps(self.tables(), multiline_strings=True), encoding="utf-8")


def from_tables(tables: dict[str, Any], *folders: Path) -> Config:
    """Return the configuration with these tables: ``case``, the parameters of the case, and a table ``run``.

    Parameters
    ----------
    tables
        The tables.
    *folders
        Folders that the path of an outline or an initial run in them may start from; the present one if none is given.

    Raises
    ------
    ConfigError
        If a key is unknown or a value cannot be used; the message starts with the key's path.
    """
    parameters = dict(tables)
    name, run = parameters.pop("case", None), parameters.pop("run", {})
    if not isinstance(name, str):
        raise ConfigError('case: missing, or not a string; add for instance case = "cylinder"')
    if not isinstance(run, dict):
        raise ConfigError(f"run = {run!r}: must be a table, [run]")
    shape = parameters.get("shape")
    if isinstance(shape, str) and shape not in cases.body.SHAPES:
        parameters["shape"] = _found(shape, folders)
    if isinstance(initial_run := run.get("initial_run"), str):
        run = run | {"initial_run": _found(initial_run, (*folders, Path()))}
    case = cases.find(name)(**parameters)
    try:
        return Config(case, RunSettings(**run))
    except ConfigError as error:
        raise ConfigError(f"run.{error}") from None


def _found(path: str, folders: tuple[Path, ...]) -> str:
    """Return a path in the first of some folders that has it; in the first one if none has."""
    paths = [folder / path for folder in folders or (Path(),)]
    return str(next((path for path in paths if os.path.exists(path)), paths[0]))


def load(path: str | Path, *folders: Path) -> Config:
    """Read a configuration file.

    Parameters
    ----------
    path
        The file.
    *folders
        Folders that the path of an outline or an initial run in it may start from; its own if none is given.

    Raises
    ------
    ConfigError
        If it cannot be read or used; the message starts with the file's name.
    """
    return read(path, lambda tables: from_tables(tables, *(folders or (Path(path).parent,))))


def read(path: str | Path, make: Callable[[dict[str, Any]], Made]) -> Made:
    """Return what a function makes of the tables of a TOML file.

    Raises
    ------
    ConfigError
        If the file cannot be read, or the function raises one; the message starts with the file's name.
    """
    try:
        return make(tomllib.loads(Path(path).read_text(encoding="utf-8")))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: not a TOML file: {error}") from None
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None
