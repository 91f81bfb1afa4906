"""The base of all validated parameter sets: strict types, unknown names refused, errors in one line."""

import difflib
import inspect
from collections.abc import Iterable
from typing import Any, NoReturn, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from alsph.errors import ConfigError


class Parameters(BaseModel):
    """An immutable set of named, validated parameters; :meth:`replace` makes another one.

    Raises
    ------
    ConfigError
        If a name is unknown or a value has the wrong type or lies out of range.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False, validate_default=True)

    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**{name: _plain(value) for name, value in values.items()})
        except ValidationError as error:
            raise ConfigError(_one_line(type(self), error)) from None

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
            f"{name} : default {describe_default(cls, name)}\n    {cls.describe(name)}" for name in cls.model_fields
        ]
        cls.__doc__ = f"{inspect.cleandoc(cls.__doc__ or '')}\n\nParameters\n----------\n" + "\n".join(lines)

    @classmethod
    def describe(cls, name: str) -> str:
        """Return what the parameter `name` means, with its unit."""
        return cls.model_fields[name].description or name


def describe_default(model: type[Parameters], name: str) -> str:
    """Return the default of a parameter as a user would type it."""
    default = model.model_fields[name].default
    return "automatic" if default is None else f"{default:.6g}" if isinstance(default, float) else str(default).lower()


def suggest(name: str, known: Iterable[str]) -> str:
    """Return ``did you mean ...?`` for a misspelt name, or the list of what is known."""
    known = list(known)
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return f"did you mean '{close[0]}'?" if close else f"known: {', '.join(known)}"


def _plain(value: Any) -> Any:
    """Numpy scalars as Python numbers, so that parameters may come from arrays."""
    return value.item() if isinstance(value, np.generic) else value


def _one_line(model: type[Parameters], error: ValidationError) -> str:
    first, *others = error.errors()
    name = str(first["loc"][0]) if first["loc"] else ""
    message = first["msg"].removeprefix("Value error, ").replace("Input should", "must", 1)
    if first["type"] == "extra_forbidden":
        text = f"{name}: unknown parameter; {suggest(name, model.model_fields)}"
    elif name:
        value = repr(first["input"])
        value = value if len(value) < 200 else f"{value[:200]}..."
        text = f"{name} = {value}: {message} ({model.describe(name)})"
    else:
        text = message
    return f"{text} (and {len(others)} more)" if others else text
