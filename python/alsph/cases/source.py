"""Cases in a Python file of the user's, as ``my_cases.py:CylinderArray``."""

from __future__ import annotations

import inspect
import linecache
import os
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any, Self

from pydantic import Field, model_validator

from alsph.cases.answers import reason
from alsph.cases.base import Case, name_of, title_of
from alsph.errors import ConfigError
from alsph.parameters import Parameters, suggest
from alsph.text import contents, sha256, shown

LARGEST_FILE = 2**20
"""Size of the largest file that is read [bytes]."""

REFERENCE = re.compile(r"(?P<path>.+\.py)(:(?P<name>[^\W\d]\w*))?")
"""How such a case is asked for."""


NEWLINE = re.compile("\r+\n?")
"""Ends of lines of other systems, which a case.toml does not keep."""


class Source(Parameters):
    """A case class and the Python file that it stands in. A run folder holds them, and so needs no file beside it."""

    file: str = Field(description="name of the file")
    name: str = Field(min_length=1, description="name of the class")
    sha256: str = Field(description="SHA-256 of the text")
    text: str = Field(description="what stands in the file")

    @model_validator(mode="after")
    def _sound(self) -> Self:
        if self.sha256 != sha256(self.text):
            raise ValueError(f"{self.file}: the text is not that which its sha256 is of")
        return self

    @classmethod
    def of(cls, table: dict[str, Any]) -> Self:
        """Return the source of a table of a configuration.

        Raises
        ------
        ConfigError
            If it is none.
        """
        if unknown := table.keys() - cls.model_fields:
            raise ConfigError(f"case.{min(unknown)}: unknown; the table of a case has {', '.join(cls.model_fields)}")
        try:
            return cls(**table)
        except ConfigError as error:
            raise ConfigError(*(f"case.{mistake}" for mistake in error.mistakes)) from None

    def model(self) -> type[Case]:
        """Run the file, if that has not been done, and return the class.

        Raises
        ------
        ConfigError
            If the file cannot be run, or there is no such case in it.
        """
        return _one(self.name, self.file, self.text)


def shown_name(reference: object) -> str:
    """Return what stands for a case in a configuration in short: its name, or ``FILE.py:CLASS``."""
    return f"{reference.get('file')}:{reference.get('name')}" if isinstance(reference, dict) else str(reference)


def is_reference(name: str) -> bool:
    """Whether a name is that of a case in a file."""
    return REFERENCE.fullmatch(name) is not None


def read(name: str, *folders: Path) -> type[Case]:
    """Return the case ``FILE.py:CLASS``, or the only one of ``FILE.py``.

    Parameters
    ----------
    name
        The file, and the class in it.
    *folders
        Where the file's path may start from; the present folder if none is given.

    Raises
    ------
    ConfigError
        If the file cannot be read or run, or there is no such case in it.
    """
    match = REFERENCE.fullmatch(name)
    assert match
    paths = [folder / match["path"] for folder in folders or (Path(),)]
    path = next((path for path in paths if os.path.isfile(path)), paths[0])
    try:
        text = NEWLINE.sub("\n", contents(path, LARGEST_FILE).decode("utf-8-sig"))
    except OSError as error:
        raise ConfigError(f"{shown(str(path))}: cannot be read ({error.strerror})") from None
    except ValueError:
        raise ConfigError(f"{shown(str(path))}: not a Python file: it is not text in UTF-8") from None
    return _one(match["name"], path.name, text)


def _one(name: str | None, file: str, text: str) -> type[Case]:
    """Return the case class of that name in a file, or the only one."""
    found = {model.__name__: model for model in _own(_module(file, text))}
    usable = {name: model for name, model in found.items() if not inspect.isabstract(model)}
    if not usable:
        lacking = [f"{name} lacks {', '.join(sorted(model.__abstractmethods__))}" for name, model in found.items()]
        expected = "a class that derives from one of alsph.cases"
        raise ConfigError(f"{file}: " + ("; ".join(lacking) or f"has no case, {expected}"))
    if name is None and len(usable) > 1:
        raise ConfigError(f"{file}: has the cases {', '.join(usable)}; say which, as {file}:{next(iter(usable))}")
    name = name or next(iter(usable))
    if name in found.keys() - usable.keys():
        raise ConfigError(f"{file}: {name} lacks {', '.join(sorted(found[name].__abstractmethods__))}")
    if name not in usable:
        raise ConfigError(f"{file}: has no case '{name}'; {suggest(name, usable)}")
    return usable[name]


def _own(module: ModuleType) -> list[type[Case]]:
    """Return the case classes that a module defines, without those whose names say that they are of no use alone."""
    classes = (value for value in vars(module).values() if isinstance(value, type) and issubclass(value, Case))
    own = (model for model in classes if model.__module__ == module.__name__ and not model.__name__.startswith("_"))
    return list(dict.fromkeys(own))


def _module(file: str, text: str) -> ModuleType:
    """Return the module of a file, which is run once."""
    name = f"alsph_file_{sha256(file + text)[:16]}"
    if name in sys.modules:
        return sys.modules[name]
    # Messages of Python show lines of the text as it was run, whatever the file holds by then.
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    sys.modules[name] = module = ModuleType(name)
    try:
        exec(compile(text, file, "exec"), vars(module))
        for model in _own(module):
            _complete(model, Source(file=file, name=model.__name__, sha256=sha256(text), text=text))
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        raise ConfigError(f"{file}: {reason(error, file)}") from None
    except BaseException:
        del sys.modules[name]
        raise
    return module


def _complete(model: type[Case], source: Source) -> None:
    """Give a class its source and, where it has none of its own, a name and a title."""
    own = vars(model)
    if "name" not in own:
        model.name = name_of(model)
    if "title" not in own:
        model.title = title_of(model)
    if not (isinstance(model.name, str) and re.fullmatch(r"[\w-]+", model.name)):
        raise ValueError(f"name = {model.name!r} of {model.__name__}: may hold letters, digits, _ and - only")
    if not isinstance(model.title, str):
        raise ValueError(f"title = {model.title!r} of {model.__name__}: must be a text")
    model.model_rebuild()
    model.code = source
