"""Configuration files: a case and the settings of a run, from and to TOML."""

import os
import re
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar

import tomli_w

from alsph import cases
from alsph.analysis.planes import grids
from alsph.analysis.probes import points
from alsph.arrays import FloatArray
from alsph.cases import answers
from alsph.errors import ConfigError, RunFolderError
from alsph.parameters import Parameters
from alsph.run_settings import LATEST, UNCERTAINTY, superseded
from alsph.run_settings import RunSettings as RunSettings
from alsph.text import contents, shown

Made = TypeVar("Made")
Set = TypeVar("Set", bound=Parameters)

MOST_BYTES = 2**22
"""Of a configuration file."""

LONG_KEY = re.compile(r"""(?<![\w-])(?:(?:"[^"\n]*"|'[^'\n]*'|[\w-]+)[ \t]*\.[ \t]*){99}""")


KEPT = (str, bool, int, float, list, dict, Parameters, type(None))
"""Kinds of parameters that a configuration file gives back."""


@dataclass(frozen=True)
class Config:
    """A case and the settings of its run."""

    case: cases.Case
    run: RunSettings = RunSettings()

    def __post_init__(self) -> None:
        """Refuse a run that cannot converge."""
        if self.converges and not self.case.is_averaged:
            told = f"{self.case.name} has no body in a stream, whose drag, lift and shedding would be averaged"
            remedy = f"give an end time, as until = {self.case.checked_until:g}"
            raise ConfigError(f'run.until = "converged": {told}; {remedy}')

    @property
    def name(self) -> str:
        """Name of the case."""
        return self.case.name

    @property
    def converges(self) -> bool:
        """Whether the run ends when it has converged (:mod:`alsph.results.ending`)."""
        return self.run.until == "converged"

    @property
    def until(self) -> float:
        """End time, the latest one of a run that ends when it has converged [D/U]."""
        given = self.run.until
        if given == "converged":
            return self.run.latest or LATEST * self.case.checked_until
        return given or self.case.checked_until

    @property
    def until_in_words(self) -> str:
        """The end time in words."""
        return f"{'at most ' if self.converges else ''}{self.until:g}"

    @property
    def uncertainty(self) -> float:
        """Largest ± of mean drag and Strouhal number over their values with which the run has converged."""
        return self.run.uncertainty or UNCERTAINTY

    @property
    def ending(self) -> dict[str, Any]:
        """The settings that say when the run ends, none left open."""
        if self.converges:
            return {"until": "converged", "uncertainty": self.uncertainty, "latest": self.until}
        return {"until": self.until}

    @property
    def remarks(self) -> list[str]:
        """What is to be said of the case, and of where its bodies go up to an end time that is known."""
        case, until = self.case, self.until
        found = answers.listed(case, "remarks", str, case.remarks)
        if self.converges:
            return found
        return found + answers.listed(case, "remarks_until", str, lambda: case.remarks_until(until))

    @property
    def work(self) -> float:
        """About how many pairs of particles a run goes over: what the time that it takes is proportional to."""
        case = self.case
        neighbours = case.support_layers**case.space_dimensions
        steps = self.until * case.resolution / case.expected_time_step()
        return float(case.particle_estimate() * neighbours * steps * case.passes)

    @property
    def probes(self) -> FloatArray:
        """Points (m, d) of the probes [D].

        Raises
        ------
        ConfigError
            If they are no points of the domain.
        """
        return self._within("probes", self.case.space_dimensions)

    @property
    def gauges(self) -> FloatArray:
        """Places (m, d − 1) of the gauges of depth, along x and in 3-D y [D].

        Raises
        ------
        ConfigError
            If the case has no water that lies in a tank, they are no places of the domain, or one is there twice.
        """
        if self.run.gauges and not self.case.has_depth:
            told = "no gauges: it has no water that lies on a floor at rest"
            raise ConfigError(f"run.gauges = {shown(self.run.gauges)}: {self.case.name} takes {told}; leave them out")
        found = self._within("gauges", self.case.space_dimensions - 1)
        places = [", ".join(f"{x:g}" for x in place) for place in found]
        if twice := next((place for place in places if places.count(place) > 1), ""):
            raise ConfigError(f"run.gauges = {shown(self.run.gauges)}: {twice} is there twice, to six digits")
        return found

    def _within(self, setting: str, dimensions: int) -> FloatArray:
        """Return points (m, d') of a setting, by their first coordinates, if they are in the domain."""
        name, domain = f"run.{setting}", self.case.checked_domain
        found = points(getattr(self.run, setting) or [], dimensions, name)
        lower, upper = (list(corner[:dimensions]) for corner in (domain.lower, domain.upper))
        for point in found[~domain.contains(found)]:
            told = f"{name}: {point.tolist()} lies outside of the domain, {lower} to {upper} [D]"
            raise ConfigError(self.case.symbols(told))
        return found

    @property
    def planes(self) -> list[tuple[FloatArray, ...]]:
        """Coordinates along x, y and, in 3-D, z of the points of each plane [D].

        Raises
        ------
        ConfigError
            If one is no plane of the domain, or they have too many points.
        """
        case = self.case
        if not self.run.planes:
            return []
        return grids(self.run.planes, case.checked_domain, case.particle_spacing, case.middle)

    def tables(self) -> dict[str, Any]:
        """Return the content of the configuration file; what is not set is left out."""
        return self.case_tables() | {"run": self.run.model_dump(exclude_none=True) | self.ending}

    def case_tables(self) -> dict[str, Any]:
        """Return the same without the settings of the run."""
        values = self.case.model_dump(include=set(self.case.parameter_names()))
        values = {name: values[name] for name in self.case.parameter_names()}
        return {"case": self.case.declaration()} | {name: value for name, value in values.items() if value is not None}

    def flow_tables(self) -> dict[str, Any]:
        """Return those of the case without what changes no result."""
        return of_the_flow(self.case_tables())

    def check(self) -> None:
        """Refuse parameters that a file cannot give back, and an end time, probes, planes and gauges that cannot be.

        Raises
        ------
        ConfigError
            If there are some; the message names them.
        """
        kind, own = type(self.case), self.case.parameter_names()
        if wrong := [name for name in own if name in ("case", "run") or name in RunSettings.model_fields]:
            raise ConfigError(f"{wrong[0]}: a setting of the run; a parameter of {kind.__name__} needs another name")
        table = {name: value for name, value in self.case_tables().items() if name != "case"}
        try:
            kept = kind(**tomllib.loads(tomli_w.dumps(table))) == self.case
        except (ConfigError, TypeError, ValueError):
            kept = False
        if not kept:
            values = {name: getattr(self.case, name) for name in own}
            odd = [name for name, value in values.items() if not isinstance(value, KEPT)] or list(table)
            told = f"{odd[0]} = {shown(values[odd[0]])}: a parameter of {kind.__name__} that its file cannot give back"
            raise ConfigError(f"{told}; use numbers, texts, true or false, and lists of them")
        _ = self.until, self.probes, self.planes, self.gauges
        for name in ("probe", "plane", "gauge"):
            if getattr(self.run, f"{name}_interval") and not getattr(self.run, f"{name}s"):
                raise ConfigError(f"run.{name}_interval: there are no {name}s; say where by {name}s, or leave it out")

    def text(self) -> str:
        """Return the configuration with all its parameters as TOML."""
        return tomli_w.dumps(self.tables(), multiline_strings=True)

    def save(self, path: Path) -> None:
        """Write the configuration with all its parameters to a TOML file."""
        path.write_bytes(self.text().encode())


def overridden(tables: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Return the tables of a configuration with other parameters and settings, without those that they supersede."""
    gone = cases.method.superseded(changes, tables)
    kept = {name: value for name, value in tables.items() if name not in gone}
    settings = {name: value for name, value in changes.items() if name in RunSettings.model_fields}
    parameters = {name: value for name, value in changes.items() if name not in settings}
    run = {name: value for name, value in tables.get("run", {}).items() if name not in superseded(settings)}
    return kept | parameters | {"run": run | settings}


def of_the_flow(tables: dict[str, Any]) -> dict[str, Any]:
    """Return the tables of a case without its units, of which no more than the Reynolds number counts."""
    return {name: value for name, value in tables.items() if name != "units"}


def from_tables(tables: dict[str, Any], *folders: Path) -> Config:
    """Return the configuration with these tables: ``case``, the parameters of the case, and a table ``run``.

    Parameters
    ----------
    tables
        The tables.
    *folders
        Folders that the path of an outline, a case's file or an initial run in them may start from; the present one if
        none is given.

    Raises
    ------
    ConfigError
        If a key is unknown or a value cannot be used; the message starts with the key's path.
    """
    parameters = dict(tables)
    name, run = parameters.pop("case", None), parameters.pop("run", {})
    if not isinstance(name, str | dict):
        raise ConfigError('case: missing, or not a string; add for instance case = "cylinder"')
    if not isinstance(run, dict):
        raise ConfigError(f"run = {shown(run)}: must be a table, [run]")
    shape = parameters.get("shape")
    if isinstance(shape, str) and shape != cases.body_3d.CUBE and not cases.body.is_name(shape):
        parameters["shape"] = _found(shape, folders)
    if isinstance(initial_run := run.get("initial_run"), str):
        run = run | {"initial_run": _found(initial_run, (*folders, Path()))}
    model = cases.find(name, *folders)
    _check_places(model, parameters, run)
    mistakes: list[str] = []
    case, settings = _made(model, parameters, "", mistakes), _made(RunSettings, run, "run.", mistakes)
    if case is None or settings is None:
        raise ConfigError(*mistakes)
    return Config(case, settings)


def _made(kind: type[Set], values: dict[str, Any], prefix: str, mistakes: list[str]) -> Set | None:
    """Return a set of parameters, or add what is wrong with them to the mistakes."""
    try:
        return kind(**values)
    except ConfigError as error:
        mistakes += [f"{prefix}{mistake}" for mistake in error.mistakes]
    except Exception as error:  # in the user's own code
        if not (code := vars(kind).get("code")):
            raise
        mistakes.append(f"{code.file}: {answers.reason(error, code.file)}")
    return None


def _check_places(model: type[cases.Case], parameters: dict[str, Any], run: dict[str, Any]) -> None:
    """Refuse tables that are not known, and what stands in the table of the other kind."""
    for name, value in parameters.items():
        if isinstance(value, dict) and name not in model.model_fields:
            known = "did you mean [run]?" if get_close_matches(name, ["run"]) else "only [run] is"
            raise ConfigError(f"[{name}]: unknown table; {known}")
        if name in RunSettings.model_fields and name not in model.model_fields:
            raise ConfigError(f"{name}: a setting of the run; put it below a line [run]")
    for name in run:
        if name in model.model_fields and name not in RunSettings.model_fields:
            raise ConfigError(f"run.{name}: a parameter of the case; put it above the line [run]")


def _found(path: str, folders: tuple[Path, ...]) -> str:
    """Return a path in the first of some folders that has it; as it is if none has."""
    paths = [folder / path for folder in folders or (Path(),)]
    return str(next((path for path in paths if os.path.exists(path)), path))


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


def of_run(folder: Path) -> Config:
    """Return the resolved configuration of a run folder.

    Raises
    ------
    RunFolderError
        If it has none, or one that cannot be used.
    """
    if not (folder / "case.toml").is_file():
        raise RunFolderError(f"{folder}: not a run folder that alsph can use, it has no case.toml")
    try:
        return load(folder / "case.toml", folder, Path())
    except ConfigError as error:
        if "unknown case" in str(error):
            raise RunFolderError(str(error)) from None
        remedy = (
            "it is of an older alsph and does not hold the outline: put the file into it, or go to where it was run"
            if "shape = '" in str(error)
            else "the folder is damaged or was made by another version"
        )
        raise RunFolderError(f"{error}; {remedy}") from None


def read(path: str | Path, make: Callable[[dict[str, Any]], Made]) -> Made:
    """Return what a function makes of the tables of a TOML file.

    Raises
    ------
    ConfigError
        If the file cannot be read, or the function raises one; the message starts with the file's name.
    """
    try:
        tables = _tables(contents(Path(path), MOST_BYTES).decode("utf-8-sig"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: not a TOML file: it is not text in UTF-8; save it as such") from None
    except RecursionError:
        raise ConfigError(f"{path}: not a TOML file that alsph can use: it is nested too deeply") from None
    except ValueError as error:
        raise ConfigError(f"{path}: not a TOML file: {_reason(error)}") from None
    try:
        return make(tables)
    except RecursionError:
        raise ConfigError(f"{path}: nested too deeply") from None
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None


def _tables(text: str) -> dict[str, Any]:
    """Parse TOML; keys of very many parts, which take the parser memory by their square, are refused."""
    if LONG_KEY.search(text):
        raise RecursionError
    return tomllib.loads(text.replace("\r\n", "\n"))


def _reason(error: ValueError) -> str:
    """Return what the parser says; if it is Python that says it, a number has thousands of digits."""
    if not isinstance(error, tomllib.TOMLDecodeError):
        return "a number in it has too many digits"
    return f"{error}; texts stand in quotes" if "Invalid value" in str(error) else str(error)
