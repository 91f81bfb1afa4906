"""The base of all validated parameter sets: strict types, unknown names refused, errors in one line."""

import difflib
import inspect
from collections.abc import Iterable
from typing import Any, NoReturn, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from alsph.errors import ConfigError
from alsph.tables import html
from alsph.text import shown

WHOLE, NUMBER = "must be a whole number", "must be a number"
LONGEST_PATH = 300

LARGEST = 1e15
"""No parameter is as large."""

WORDS = {
    "int_type": WHOLE,
    "int_from_float": WHOLE,
    "int_parsing": WHOLE,
    "int_parsing_size": "must be a smaller number",
    "float_type": NUMBER,
    "float_parsing": NUMBER,
    "finite_number": "must be a finite number",
    "greater_than": "must be greater than {gt:g}",
    "greater_than_equal": "must be greater than or equal to {ge:g}",
    "less_than": "must be less than {lt:g}",
    "less_than_equal": "must be less than or equal to {le:g}",
    "bool_type": "must be true or false",
    "string_type": "must be a text",
    "string_too_short": "must not be empty",
    "string_pattern_mismatch": "may hold letters, digits, _ and - only",
    "literal_error": "must be {expected}",
    "list_type": "must be a list",
    "dict_type": "must be a table",
    "value_error": "{error}",
    "missing": "is missing",
}
"""What is wrong with a value, by pydantic's type of the error, with the entries of its context."""

MOST_MISTAKES = 3
"""How many are told at once."""


PYDANTICS = {name for name in dir(BaseModel) if not name.startswith("__")}
"""Names that a set of parameters has of pydantic."""


class Parameters(BaseModel):
    """An immutable set of named, validated parameters; :meth:`replace` makes another one.

    Raises
    ------
    ConfigError
        If a name is unknown or a value has the wrong type or lies out of range.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False, validate_default=True)

    def __init__(self, *unnamed: Any, **values: Any) -> None:
        if unnamed:
            kind, name = type(self).__name__, type(self).parameter_names()[0]
            raise ConfigError(f"{kind}: parameters are given by name, as {kind}({name}={shown(unnamed[0])})")
        try:
            super().__init__(**{name: _plain(name, value) for name, value in values.items()})
        except ValidationError as error:
            raise ConfigError(*_mistakes(type(self), error)) from None
        except OverflowError:  # in a validator
            sizes = {name: abs(value) for name, value in values.items() if isinstance(value, int | float)}
            raise ConfigError(f"{max(sizes, key=lambda name: sizes[name], default='a value')}: too large") from None
        given = {name: getattr(self, name) for name in type(self).model_fields}
        large = {
            name: value for name, value in given.items() if isinstance(value, int | float) and abs(value) >= LARGEST
        }
        if large:
            raise ConfigError(*(f"{name} = {value:g}: too large, {LARGEST:g} or more" for name, value in large.items()))

    def replace(self, **changes: Any) -> Self:
        """Return a set with some parameters changed: ``case.replace(reynolds=100)``."""
        return type(self)(**self.model_dump() | changes)

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        """Refuse: parameters stay as they were validated."""
        raise ConfigError(f"{name}: parameters cannot be changed; make another set with .replace({name}={value!r})")

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        """Append the parameters, from their fields, to the docstring."""
        lines = [
            f"{name} : default {describe_default(cls, name)}\n    {cls.describe(name)}"
            for name in cls.parameter_names()
        ]
        cls.__doc__ = f"{inspect.cleandoc(cls.__doc__ or '')}\n\nParameters\n----------\n" + "\n".join(lines)

    def __dir__(self) -> list[str]:
        """Return the names to complete, without those of pydantic."""
        return [name for name in super().__dir__() if name not in PYDANTICS]

    def __repr__(self) -> str:
        """Return the call that makes the set: the parameters that are not as by default, cut where they are long."""
        fields = type(self).model_fields
        values = {name: getattr(self, name) for name in self.parameter_names()}
        changed = {name: value for name, value in values.items() if repr(value) != repr(fields[name].default)}
        return f"{type(self).__name__}({', '.join(f'{name}={shown(value)}' for name, value in changed.items())})"

    __str__ = __repr__

    def _repr_html_(self) -> str:
        rows = [(name, shown(getattr(self, name)), self.describe(name)) for name in self.parameter_names()]
        return html((), rows, named=True, caption=type(self).__name__)

    @classmethod
    def parameter_names(cls) -> list[str]:
        """Return the names of the parameters in the order in which they are told."""
        return list(cls.model_fields)

    @classmethod
    def describe(cls, name: str) -> str:
        """Return what the parameter `name` means, with its unit."""
        return cls.model_fields[name].description or name


def describe_default(model: type[Parameters], name: str) -> str:
    """Return the default of a parameter as a user would type it."""
    if model.model_fields[name].is_required():
        return "must be given"
    default = model.model_fields[name].default
    return "automatic" if default is None else f"{default:.6g}" if isinstance(default, float) else str(default).lower()


def choose(what: str, name: object, known: Iterable[str]) -> None:
    """Refuse a name that is not known.

    Raises
    ------
    ConfigError
        With what is known, or the name that was probably meant.
    """
    known = list(known)
    if name not in known:
        raise ConfigError(f"{what} = {shown(name)}: unknown; {suggest(str(name), known)}")


def suggest(name: str, known: Iterable[str]) -> str:
    """Return ``did you mean ...?`` for a misspelt name, or the list of what is known."""
    known = list(known)
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return f"did you mean '{close[0]}'?" if close else f"known: {', '.join(known)}"


def _plain(name: str, value: Any) -> Any:
    """Numpy scalars as Python numbers, so that parameters may come from arrays; texts must go into a file."""
    if isinstance(value, str) and not value.isascii():
        try:
            value.encode()
        except UnicodeEncodeError:
            raise ConfigError(f"{name} = {shown(value)}: must be a text in UTF-8, as case.toml is") from None
    return value.item() if isinstance(value, np.generic | np.ndarray) and value.ndim == 0 else value


def _mistakes(model: type[Parameters], error: ValidationError) -> list[str]:
    order: dict[int | str, int] = {name: place for place, name in enumerate(model.parameter_names())}
    mistakes = sorted(error.errors(), key=lambda mistake: order.get(mistake["loc"][0], -1) if mistake["loc"] else -1)
    texts = [_mistake(model, mistake) for mistake in mistakes[:MOST_MISTAKES]]
    others = len(mistakes) - len(texts)
    return [*texts, f"and {others} more"] if others else texts


def _mistake(model: type[Parameters], mistake: Any) -> str:
    """Say what is wrong with one value."""
    words = WORDS.get(mistake["type"], "cannot be used").format(**mistake.get("ctx", {}))
    if not mistake["loc"]:
        return words
    name, value = ".".join(map(str, mistake["loc"])), mistake["input"]
    if mistake["type"] == "extra_forbidden":
        return f"{name}: unknown parameter; {suggest(name, model.model_fields)}"
    if mistake["type"] == "missing":
        return f"{name}: {words}"
    if words in (WHOLE, NUMBER) and isinstance(value, str):
        words += ", without quotes"
    if words == NUMBER and isinstance(value, int) and not isinstance(value, bool):
        words = WORDS["int_parsing_size"]
    if words == WHOLE and isinstance(value, float) and value.is_integer():
        words += f", as {value:.0f}"
    typed = shown(value, LONGEST_PATH) if isinstance(value, str) else shown(value)
    told = isinstance(mistake.get("ctx", {}).get("error"), ConfigError)  # such as what is wrong with a line of a file
    return f"{name} = {typed}: {words}" + ("" if told else f" ({model.describe(str(mistake['loc'][0]))})")
