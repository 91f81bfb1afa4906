"""What a study is: a base case, what is swept, what is collected and which figures are drawn."""

import hashlib
import itertools
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from alsph import config
from alsph.config import Config, of_the_flow
from alsph.engine.prescribed import fingerprint
from alsph.errors import AlsphError, ConfigError
from alsph.parameters import Parameters, suggest
from alsph.plotting.pictures import field_style
from alsph.results.run import Run
from alsph.running import beginning

UNHASHED = ("threads", "checkpoint_minutes", "flush_seconds")
"""Settings of a run that change nothing in its results."""

RUNS = "runs"
"""Name of the folder with the run folders of a study."""

COLUMNS = ("status", "time", "seconds", "remarks", "folder")
"""What the rows of a study tell of each run beside its parameters and results."""


class Sweep(Parameters):
    """The values that parameters take. All that are given are combined with each other.

    A parameter is one of the case's, or one of the run's with ``run.`` before it: ``"run.until"``.
    """

    product: dict[str, list[Any]] = Field(default={}, description="parameters and their values, every combination")
    together: dict[str, list[Any]] = Field(
        default={}, description="parameters and their values, taken one by one together"
    )
    sets: list[dict[str, Any]] = Field(default=[], description="sets of parameters")
    until_diverged: dict[str, list[Any]] = Field(
        default={}, description="one parameter whose values are taken in turn until a run diverges"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        lengths = {name: len(values) for name, values in self.together.items()}
        if len(set(lengths.values())) > 1:
            raise ValueError(f"together: needs as many values of each parameter, and has {lengths}")
        if len(self.until_diverged) > 1:
            raise ValueError(f"until_diverged: takes one parameter, not {', '.join(self.until_diverged)}")
        for name, values in [*self.product.items(), *self.together.items(), *self.until_diverged.items()]:
            if not values:
                raise ValueError(f"{name}: has no values")
        ways = {"product": {*self.product}, "together": {*self.together}, "until_diverged": {*self.until_diverged}}
        ways["sets"] = {name for parameters in self.sets for name in parameters}
        for one, other in itertools.combinations(ways, 2):
            for name in sorted(ways[one] & ways[other]):
                raise ValueError(f"{name}: stands in {one} and in {other}; sweep it in one of them")
        for name, values in (self.product | self.together | self.until_diverged).items():
            if name in {f"run.{name}" for name in UNHASHED} and len(values) > 1:
                raise ValueError(f"{name}: changes nothing in the results, so all its runs would be one")
        return self

    def ladders(self) -> Iterator[list[dict[str, Any]]]:
        """Yield the sets of parameters, those of one list to be run in turn until one diverges."""
        products = [
            dict(zip(self.product, values, strict=True)) for values in itertools.product(*self.product.values())
        ]
        zipped = [
            dict(zip(self.together, values, strict=True)) for values in zip(*self.together.values(), strict=True)
        ] or [{}]
        for one, two, three in itertools.product(products, zipped, self.sets or [{}]):
            together = one | two | three
            rungs = [{name: value} for name, values in self.until_diverged.items() for value in values]
            if rungs:
                yield [together | rung for rung in rungs]
            else:
                yield [together]


class Figure(Parameters):
    """A figure of a study."""

    name: str = Field(min_length=1, pattern=r"^[\w-]+$", description="name of its file, without suffix")
    title: str = Field(default="", description="what is drawn")
    kind: Literal["curves", "profile", "fields"] = Field(
        default="curves", description="results over a parameter, a profile of each run, or pictures of fields"
    )
    x: str = Field(default="", description="parameter on the abscissa of curves")
    y: list[str] = Field(default=[], description="results on the ordinates of curves, or names of fields")
    profile: str = Field(default="", description="name of the profile to draw")
    where: dict[str, Any] = Field(default={}, description="only runs with these parameters")
    finest: str = Field(default="", description="only runs with the largest value of this parameter")
    logarithmic: list[Literal["x", "y"]] = Field(default=[], description="logarithmic axes")
    labels: dict[str, str] = Field(default={}, description="other labels of axes than the names of what is drawn")
    view: list[float] = Field(default=[], description="left, right, bottom and top of pictures of fields [D]")

    @model_validator(mode="after")
    def _complete(self) -> Self:
        needed = {"curves": ("x", "y"), "profile": ("profile",), "fields": ("y",)}[self.kind]
        if missing := [name for name in needed if not getattr(self, name)]:
            raise ValueError(f"figure {self.name}: {self.kind} need {' and '.join(missing)}")
        if self.kind == "fields":
            for name in self.y:
                field_style(name)
        if self.view and len(self.view) != 4:
            raise ValueError(f"figure {self.name}: view must be left, right, bottom and top, not {self.view}")
        for name in self.labels:
            if name not in (drawn := [self.x, *self.y]):
                raise ValueError(f"figure {self.name}: labels.{name}: is not drawn; {suggest(name, drawn)}")
        if len({self.labels.get(y, y) for y in self.y}) < len(self.y):
            raise ValueError(f"figure {self.name}: two of y have the same name or label")
        return self

    @property
    def curves(self) -> list[str]:
        """Names of the results that are drawn as curves."""
        return self.y if self.kind == "curves" else []


class Published(Parameters):
    """Results of others to be set beside those of a study."""

    label: str = Field(description="whose they are")
    parameters: dict[str, Any] = Field(default={}, description="parameters that they belong to")
    values: dict[str, float] = Field(description="results by name")


@dataclass(frozen=True)
class Point:
    """One run of a study.

    Attributes
    ----------
    parameters : dict
        The swept parameters.
    config : Config
        The case and the settings of its run.
    after : Point or None
        The run that must not have diverged for this one to be made.
    start : Point or None
        The run whose last flow this one starts with.
    """

    parameters: Mapping[str, Any]
    config: Config
    after: "Point | None" = None
    start: "Point | None" = None

    @cached_property
    def name(self) -> str:
        """Name of the run's folder: the case and a hash of all that its result depends on."""
        own = digest(self.config)
        if self.start is not None:
            own = hashlib.sha256(f"{own} {self.start.name}".encode()).hexdigest()
        return f"{self.config.case.name}_{own[:12]}"

    @property
    def label(self) -> str:
        """The swept parameters in words."""
        return ", ".join(f"{name} {typed(value)}" for name, value in self.parameters.items()) or self.config.case.name

    def tables(self, runs: Path) -> dict[str, Any]:
        """Return the tables of the configuration, `runs` being the folder of the study's run folders."""
        tables = self.config.tables()
        start = {"initial_run": str(runs / self.start.name)} if self.start else {}
        return tables | {"run": tables["run"] | start}


class Study(Parameters):
    """A declared parameter study."""

    name: str = Field(min_length=1, pattern=r"^[\w-]+$", description="its name, that of the folder with its results")
    title: str = Field(default="", description="what is studied")
    source: str = Field(default="", description="where it comes from")
    base: dict[str, Any] = Field(description="a case's configuration, as in its file: case, parameters, run")
    start: dict[str, Any] = Field(
        default={},
        description="what is other in runs that are made before, with whose last flow the runs of the study start",
    )
    sweep: Sweep = Field(default=Sweep(), description="the values that parameters take")
    collect: list[str] = Field(default=[], description="results to tabulate; all if none are given")
    figures: list[Figure] = Field(default=[], description="figures to draw")
    published: list[Published] = Field(default=[], description="results of others")
    preset: str = Field(default="", description="which of a file's presets it is")
    folder: str = Field(default="", description="folder that paths of outlines start from; that of the study's file")

    @model_validator(mode="after")
    def _named(self) -> Self:
        _check_shape({"base": self.base, "start": self.start})
        if self.name == RUNS:
            raise ValueError(f"name: {RUNS} is the folder of the run folders; call the study otherwise")
        for name in self.swept:
            if name in COLUMNS:
                raise ValueError(f"sweep: {name}: a column of the results is called so; call the parameter otherwise")
        names = [figure.name for figure in self.figures]
        for name in {name for name in names if names.count(name) > 1}:
            raise ValueError(f"figure {name}: two figures are called so")
        return self

    @model_validator(mode="after")
    def _drawable(self) -> Self:
        for figure in self.figures:
            for name in filter(None, (figure.x, figure.finest, *figure.where)):
                if name not in self.swept:
                    raise ValueError(f"figure {figure.name}: {name} is not swept; {suggest(name, self.swept)}")
        return self

    @model_validator(mode="after")
    def _starts_once(self) -> Self:
        if self.start and "initial_run" in self.base.get("run", {}):
            raise ValueError("start: base.run has an initial_run; give one of them (that of the starts is start.run's)")
        return self

    @property
    def in_words(self) -> str:
        """Its name, and the preset."""
        return f"{self.name}, preset {self.preset}" if self.preset else self.name

    @property
    def swept(self) -> list[str]:
        """Names of the swept parameters, in the order of the declaration."""
        sweep = self.sweep
        listed = [name for parameters in sweep.sets for name in parameters]
        return list(dict.fromkeys([*sweep.product, *sweep.together, *listed, *sweep.until_diverged]))

    def points(self) -> list[Point]:
        """Return the runs of the study, each once, in the order of the declaration.

        Raises
        ------
        ConfigError
            If a case cannot be made, or its rules give no vectors; the message names the parameters. What a rule
            raises comes out as it is, with a note that names them.
        """
        points: dict[str, Point] = {}
        for ladder in self.sweep.ladders():
            previous = None
            for parameters in ladder:
                config = self._config(parameters)
                every = {name: parameters.get(name, self._unswept(name, config)) for name in self.swept}
                previous = Point(every, config, previous, self._start(parameters))
                try:
                    points.setdefault(previous.name, previous)
                except AlsphError as error:  # in a rule of the case, which the name is formed of
                    raise ConfigError(f"study {self.name}, {previous.label}: {error}") from None
                except Exception as error:
                    error.add_note(f"in the run with {previous.label}")
                    raise
        return list(points.values())

    def _unswept(self, name: str, config: Config) -> Any:
        """Return what a run has of a parameter that others are swept over, and it is not."""
        where, _, key = name.rpartition(".")
        given, made = (self.base.get("run", {}), config.run) if where else (self.base, config.case)
        return given.get(key, getattr(made, key))

    def _start(self, parameters: Mapping[str, Any]) -> Point | None:
        """Return the run that the one with these parameters starts with."""
        if not self.start:
            return None
        other = _flat(self.start)
        both = {name: value for name, value in parameters.items() if name not in other} | other
        point = Point({f"start.{name}": value for name, value in both.items()}, self._config(both))
        if point.config.case.checked_domain.meets_air:
            raise ConfigError(f"study {self.name}: start: {point.config.name} has a free surface, which begins at rest")
        return point

    def _config(self, parameters: Mapping[str, Any]) -> Config:
        tables = self.base | {"run": dict(self.base.get("run", {}))}
        for name, value in parameters.items():
            where, _, key = name.rpartition(".")
            if where not in ("", "run"):
                raise ConfigError(f"study {self.name}: sweep.{name}: must be a parameter of the case, or run.SETTING")
            (tables["run"] if where else tables)[key] = value
        try:
            return config.from_tables(tables, Path(self.folder))
        except ConfigError as error:
            raise ConfigError(f"study {self.name}, {dict(parameters)}: {error}") from None


def with_starts(points: Sequence[Point]) -> list[Point]:
    """Return the runs of a study, before them those that they start with, each once."""
    starts = {point.start.name: point.start for point in points if point.start}
    return list((starts | {point.name: point for point in points}).values())


def digest(configuration: Config, *without: str) -> str:
    """Return a hash, in hexadecimal digits, of all that a run's result depends on, some parameters excepted.

    A run that it begins with counts by its last flow, whatever it is called; rules of place and time by what they give.

    Raises
    ------
    RunFolderError
        If there is no flow in the run that it begins with.
    """
    tables = {name: value for name, value in of_the_flow(configuration.tables()).items() if name not in without}
    tables["run"] = {name: value for name, value in tables["run"].items() if name not in UNHASHED}
    case, initial = configuration.case, configuration.run.initial_run
    if initial is not None:
        tables["run"]["initial_run"] = beginning.flow_sha256(Run(initial))
    for name, rule in case.rules.items():
        centres = case.moved_centres if name == "motion" else None
        tables[name] = fingerprint(name, rule, case.checked_domain, configuration.until, centres)
    return hashlib.sha256(json.dumps(tables, sort_keys=True).encode()).hexdigest()


def shipped() -> dict[str, Path]:
    """Return the files of the studies that come with alsph, by name."""
    folder = Path(str(resources.files("alsph.study"))) / "shipped"
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def load(study: str | Path, preset: str | None = None) -> Study:
    """Read a study.

    Parameters
    ----------
    study
        Name of a study that comes with alsph, or a TOML file: the fields of :class:`Study`, with tables ``[[figure]]``
        and ``[[published]]``, and ``[preset.NAME]`` with values that replace those of the file.
    preset
        Name of a preset; the first one of the file if None.

    Raises
    ------
    ConfigError
        If it cannot be read or used; the message starts with the file's name.
    """
    path = shipped().get(str(study), Path(study))
    if not path.is_file():
        raise ConfigError(
            f"{study}: neither a file nor a study that comes with alsph; {suggest(str(study), shipped())}"
        )
    return config.read(path, lambda tables: _parsed({"folder": str(path.parent)} | tables, preset))


def _parsed(tables: dict[str, Any], preset: str | None) -> Study:
    _check_shape(tables)
    presets = tables.pop("preset", {})
    if preset is not None and preset not in presets:
        known = suggest(preset, presets) if presets else "the file has none"
        raise ConfigError(f"unknown preset '{preset}'; {known}")
    if presets:
        preset = preset or next(iter(presets))
        tables = _merged(tables, presets[preset])
        _check_shape(tables)
        tables["preset"] = preset
    tables["figures"] = [_figure(number, table) for number, table in enumerate(tables.pop("figure", []), 1)]
    tables["published"] = [Published(**table) for table in tables.pop("published", [])]
    tables["sweep"] = Sweep(**tables.get("sweep", {}))
    return Study(**tables)


def _figure(number: int, table: dict[str, Any]) -> Figure:
    """Return a figure of a file; what is wrong with it names its table."""
    try:
        return Figure(**table)
    except ConfigError as error:
        raise ConfigError(*(f"[[figure]] {number}: {mistake}" for mistake in error.mistakes)) from None


def _check_shape(tables: Mapping[str, Any]) -> None:
    """Check that what must be a table, or a list of tables, is one."""
    single = {name: tables.get(name, {}) for name in ("base", "preset", "start", "sweep")}
    for _ in range(2):  # the outer ones first
        for name, value in single.items():
            if not isinstance(value, dict):
                raise ConfigError(f"{name} = {value!r}: must be a table, [{name}]")
        single |= {f"preset.{name}": value for name, value in single["preset"].items()}
        single |= {f"{name}.run": single[name].get("run", {}) for name in ("base", "start")}
    for name in ("figure", "published"):
        entries = tables.get(name, [])
        if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
            raise ConfigError(f"{name}: must be tables with double brackets, [[{name}]]")


def _merged(tables: dict[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return nested tables with the values of others put in their places."""
    merged = dict(tables)
    for name, value in changes.items():
        both = isinstance(value, dict) and isinstance(merged.get(name), dict)
        merged[name] = _merged(merged[name], value) if both else value
    return merged


def _flat(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries of a table with those of its table ``run`` as ``run.NAME``."""
    own = {name: value for name, value in tables.items() if name != "run"}
    return own | {f"run.{name}": value for name, value in tables.get("run", {}).items()}


def text(value: Any) -> str:
    """Return a result as it is shown."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def typed(value: Any) -> str:
    """Return the value of a parameter as it is shown: two that differ do so in words, too."""
    if isinstance(value, float):
        return short if float(short := f"{value:.6g}") == value else repr(float(value))
    return "not given" if value is None else str(value)
