"""The options of a command, from the parameters of a case and the settings of a run."""

import copy
import functools
import inspect
import re
import types
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import typer
from typer.main import get_command

from alsph import cases, config, run_settings
from alsph.cases.driven import RULES
from alsph.cases.method import OWN, Method
from alsph.cli.common import WORDS, number_of, one_of
from alsph.cli.help import App, Group
from alsph.cli.terminal import exit_codes
from alsph.config import Config
from alsph.errors import ConfigError
from alsph.parameters import Parameters, describe_default
from alsph.run_settings import RunSettings
from alsph.symbols import Symbols
from alsph.units import Units

METAVARS: dict[Any, str] = {int: "INTEGER", float: "FLOAT", list[str]: "TEXT"}

OWN_DEFAULT = "the case's own default"
"""What the description of `until` says of it."""

UNITS = {f"units_{name}" for name in Units.model_fields}
"""The entries of the table `units` as options."""


@dataclass(frozen=True)
class Given:
    """What a command is given: the tables of a case or its file, and the values of the options."""

    tables: dict[str, Any]
    values: dict[str, Any]

    @cached_property
    def config(self) -> Config:
        """The configuration that they make."""
        return config.from_tables(config.overridden(self.tables, self.values))


def _case_command(model: type[cases.Case], action: Callable[..., None]) -> Callable[..., None]:
    """Return a command for a case: `action` called with what is given.

    An option of the action's own takes the place of a parameter of all cases of the same name.
    """
    own = list(inspect.signature(action).parameters.values())[1:]
    owned = {parameter.name for parameter in own}
    taken = (owned - cases.Case.model_fields.keys()) | RunSettings.model_fields.keys() | UNITS
    names = [name for name in model.parameter_names() if name not in {"units", *owned}]
    if clashes := sorted((taken | {"context", "case", "run"}) & model.model_fields.keys()):
        raise ConfigError(
            f"{model.__name__}: its parameter '{clashes[0]}' has the name of an option; give it another one"
        )
    try:
        case = model()
        until, hidden = f"{case.checked_until:g}", idle(model, case)
    except Exception:  # parameters that must be given
        until, hidden = OWN_DEFAULT, idle(model, None)

    @exit_codes()
    def command(context: typer.Context, **values: Any) -> None:
        extra = {parameter.name: values.pop(parameter.name) for parameter in own}
        tables: dict[str, Any] = context.obj.tables() if context.obj else {"case": model.declaration(), "run": {}}
        joined = {name: "; ".join(value) or None for name, value in values.items() if isinstance(value, list)}
        given = {name: value for name, value in (values | joined).items() if value is not None}
        if units := {name.removeprefix("units_"): given.pop(name) for name in UNITS & given.keys()}:
            given["units"] = units = tables.get("units", {}) | units
            if missing := [f"--units-{name.replace('_', '-')}" for name in Units.model_fields if name not in units]:
                raise ConfigError(f"units: all four or none; give {', '.join(missing)}, too")
        action(Given(tables, given), **extra)

    first = inspect.Parameter("context", inspect.Parameter.KEYWORD_ONLY, annotation=typer.Context)
    told = functools.partial(_options, symbols=model.symbols, idle=hidden)
    parameters = [
        first,
        *(_renamed(parameter, model.symbols) for parameter in own),
        *told("Parameters of the problem", model, [name for name in names if name not in Method.model_fields]),
        *told("Parameters of the method", model, [name for name in names if name in Method.model_fields]),
        *told("Units, all four or none", Units, Units.model_fields, "units_", required=""),
        *told("Settings of the run", RunSettings, RunSettings.model_fields, until=until),
    ]
    functools.update_wrapper(command, action)
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return command


def _renamed(parameter: inspect.Parameter, symbols: Symbols) -> inspect.Parameter:
    """Return an option of an action whose help has a case's names of D and U."""
    kind, option = get_args(parameter.annotation)
    option = copy.copy(option)
    option.help = symbols(option.help)
    return parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY, annotation=Annotated[kind, option])


def idle(model: type[cases.Case], case: cases.Case | None) -> set[str]:
    """Return the options that have nothing to choose or to act on, in a case and, if it can be made, by default.

    What acts with one of the choices of a parameter of the problem is not among them.
    """
    choices = {name: _option_type(field.annotation)[1] for name, field in model.model_fields.items()}
    found = {*model.idle} | {name for name, few in choices.items() if len(few) == 1}
    found |= {name for name, schemes in OWN.items() if not {*schemes} & {*choices["scheme"]}}
    said = [method for method in RULES if getattr(model, method) is not getattr(cases.Case, method)]
    found |= {RULES[method] for method in said}
    if choices["shifting"] == ("none",):
        found |= {"shift_coefficient", "shift_limit"}
    if case is not None:
        found |= set.intersection(*map(_without_effect, _chosen(case)))
    return found


def _chosen(case: cases.Case) -> Iterator[cases.Case]:
    """Yield a case, and it with each other choice of a parameter of the problem that can be made alone."""
    yield case
    fields = type(case).model_fields
    for name in fields.keys() - Method.model_fields.keys():
        for choice in _option_type(fields[name].annotation)[1]:
            with suppress(ConfigError):
                yield case.replace(**{name: choice})


def _without_effect(case: cases.Case) -> set[str]:
    """Return the options that have nothing to act on in a case."""
    bodies, domain = case.checked_bodies, case.checked_domain
    acts = {
        "wall_velocity": bodies,
        "wall_pressure": bodies,
        "body_motion": case.moved_bodies,
        "surface_velocity": case.sliding_bodies,
        "inlet_velocity": [*domain.inlets()],
        "surface_interval": case.surface_points(),
        "initial_run": not domain.meets_air,
        **dict.fromkeys(("gauges", "gauge_interval"), case.has_depth),
        **dict.fromkeys(run_settings.OF_CONVERGED, case.is_averaged),
    }
    return {name for name, on in acts.items() if not on}


class CaseGroup(Group):
    """Commands named after the cases; the name of a TOML file stands for the case in it, with its parameters.

    A case of the user's is FILE.py:CLASS.
    """

    action: Callable[..., None]
    beside: Mapping[str, Any] = {}
    """Commands that are of no case, by name."""
    listed = "Cases"

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of the cases."""
        return list(cases.CASES)

    def summaries(self, ctx: Any) -> Iterator[tuple[str, str]]:
        """Yield the name of each case and what it is."""
        return ((name, model.title) for name, model in cases.CASES.items())

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return the command of a case, or of the case in a file."""
        if cmd_name in self.beside:
            return self.beside[cmd_name]
        with exit_codes():
            if cmd_name.endswith(".toml"):
                ctx.obj = config.load(cmd_name)
            model = type(ctx.obj.case) if ctx.obj else cases.find(cmd_name)
            app = App()
            text = re.sub(r":\w+:`([^`]*)`", r"\1", (model.__doc__ or "").split("Parameters\n---")[0].strip())
            app.command(model.name, help=text, short_help=model.title)(_case_command(model, self.action))
            return get_command(app)
        raise AssertionError("the block ends in one way or the other")


def group_of_cases(action: Callable[..., None], base: type[CaseGroup] = CaseGroup) -> type[CaseGroup]:
    """Return a group of commands, one a case: `action` called with what is given (:class:`Given`)."""
    return type("Cases", (base,), {"action": staticmethod(action)})


def _options(
    section: str,
    model: type[Parameters],
    names: Iterable[str],
    prefix: str = "",
    *,
    symbols: Symbols,
    idle: Collection[str],
    until: str = OWN_DEFAULT,
    required: str = "  [required]",
) -> Iterator[inspect.Parameter]:
    """Make an option of each named field of a model, hidden if it is `idle`; `until` is when a run of the case ends."""
    for name in names:
        kind, choices = _option_type(model.model_fields[name].annotation)
        told = () if name == "until" and not _converges(idle) else choices
        flag = f"--{prefix}{name}".replace("_", "-")
        option = typer.Option(
            f"{flag}/--no-{flag[2:]}" if kind is bool else flag,
            help=symbols(_told(model, name, idle)).replace(OWN_DEFAULT, until) + _default(model, name, required),
            hidden=name in idle,
            show_default=False,
            rich_help_panel=section,
            parser=number_of(kind, choices) if kind in WORDS else _choice_of(choices) if choices else None,
            **(one_of(*told, beside=METAVARS.get(kind, "")) if told else {"metavar": METAVARS.get(kind)}),
        )
        yield inspect.Parameter(
            prefix + name,
            inspect.Parameter.KEYWORD_ONLY,
            default=None,
            annotation=Annotated[Union[kind, None], option],  # noqa: UP007
        )


def _told(model: type[Parameters], name: str, idle: Collection[str]) -> str:
    """Return what is told of a parameter: of `until` only what the case can do."""
    text = model.describe(name)
    return text if _converges(idle) else text.replace(run_settings.OR_CONVERGED, "")


def _converges(idle: Collection[str]) -> bool:
    """Whether runs of the case may end when their averages are known well enough."""
    return not {*run_settings.OF_CONVERGED} <= {*idle}


def _default(model: type[Parameters], name: str, required: str) -> str:
    """Return what is told of a default; what holds where nothing is given is part of what a parameter means."""
    field = model.model_fields[name]
    if field.is_required():
        return required
    return "" if field.default is None else f"  [default: {describe_default(model, name)}]"


def _option_type(annotation: Any) -> tuple[Any, tuple[Any, ...]]:
    """Return the type that an option is read as, and its choices if there are few."""
    union = get_origin(annotation) in (Union, types.UnionType)
    members = {member: get_origin(member) or member for member in (get_args(annotation) if union else (annotation,))}
    if {str, list} <= {*members.values()}:
        return list[str], ()  # a text that lists things: the option may be repeated
    kinds = [member for member, origin in members.items() if origin not in (Literal, type(None))]
    choices = [choice for member, origin in members.items() if origin is Literal for choice in get_args(member)]
    return kinds[0] if kinds else str, tuple(choices)


def _choice_of(choices: tuple[Any, ...]) -> Callable[[str], Any]:
    """Return a function that finds the choice with a given text."""

    def choice(text: str) -> Any:
        return next((choice for choice in choices if str(choice) == text), text)

    return choice
