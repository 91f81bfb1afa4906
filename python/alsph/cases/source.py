"""Cases in a Python file of the user's, as ``my_cases.py:CylinderArray``."""

from __future__ import annotations

import hashlib
import inspect
import linecache
import re
import sys
import traceback
from pathlib import Path
from types import ModuleType
from typing import Self

from pydantic import Field, model_validator

from alsph.cases.base import Case
from alsph.errors import ConfigError
from alsph.parameters import Parameters, suggest
from alsph.text import contents

LARGEST_FILE = 2**20
"""Size of the largest file that is read [bytes]."""

REFERENCE = re.compile(r"(?P<path>.+\.py)(:(?P<name>[^\W\d]\w*))?")
"""How such a case is asked for."""


class Source(Parameters):
    """A case class and the Python file that it stands in. A run folder holds them, and so needs no file beside it."""

    file: str = Field(description="name of the file")
    name: str = Field(description="name of the class")
    sha256: str = Field(description="SHA-256 of the text")
    text: str = Field(description="what stands in the file")

    @model_validator(mode="after")
    def _sound(self) -> Self:
        if self.sha256 != _sha256(self.text):
            raise ValueError(f"{self.file}: the text is not that which its sha256 is of")
        return self

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
    path = next((path for path in paths if path.is_file()), paths[0])
    try:
        text = contents(path, LARGEST_FILE).decode("utf-8-sig").replace("\r\n", "\n")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: not a Python file: it is not text in UTF-8") from None
    if (folder := str(path.resolve().parent)) not in sys.path:
        sys.path.append(folder)  # as of a script: it may import what lies beside it
    return _one(match["name"], path.name, text)


def _one(name: str | None, file: str, text: str) -> type[Case]:
    """Return the case class of that name in a file, or the only one."""
    module = _module(file, text)
    found = {
        name: value
        for name, value in vars(module).items()
        if isinstance(value, type) and issubclass(value, Case) and value.__module__ == module.__name__
    }
    usable = {name: model for name, model in found.items() if not inspect.isabstract(model)}
    if not usable:
        lacking = [f"{name} lacks {', '.join(sorted(model.__abstractmethods__))}" for name, model in found.items()]
        expected = "a class that derives from one of alsph.cases"
        raise ConfigError(f"{file}: " + ("; ".join(lacking) or f"has no case, {expected}"))
    if name is None and len(usable) > 1:
        raise ConfigError(f"{file}: has the cases {', '.join(usable)}; say which, as {file}:{next(iter(usable))}")
    name = name or next(iter(usable))
    if name not in usable:
        raise ConfigError(f"{file}: has no case '{name}'; {suggest(name, usable)}")
    return usable[name]


def _module(file: str, text: str) -> ModuleType:
    """Return the module of a file, which is run once."""
    name = f"alsph_file_{_sha256(text)[:16]}"
    if name in sys.modules:
        return sys.modules[name]
    module = ModuleType(name)
    # Messages of Python show lines of the text as it was run, whatever the file holds by then.
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    module.__file__ = file
    sys.modules[name] = module
    try:
        exec(compile(text, file, "exec"), vars(module))
        for own, model in vars(module).copy().items():
            if isinstance(model, type) and issubclass(model, Case) and model.__module__ == name:
                _complete(model, Source(file=file, name=own, sha256=_sha256(text), text=text))
    except Exception as error:
        del sys.modules[name]
        raise ConfigError(f"{file}: {_reason(error, file)}") from None
    return module


def _complete(model: type[Case], source: Source) -> None:
    """Give a class its source and, where it has none of its own, a name and a title."""
    own = vars(model)
    if "name" not in own:
        model.name = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", model.__name__).lower()
    if "title" not in own:
        first = (model.__doc__ or "").strip().partition("\n")[0].rstrip(".")
        model.title = first[:1].lower() + first[1:] or model.name
    if not re.fullmatch(r"[\w-]+", model.name):
        raise ValueError(f"name = {model.name!r} of {model.__name__}: may hold letters, digits, _ and - only")
    model.code = source


def _reason(error: Exception, file: str) -> str:
    """Say where in a file what went wrong."""
    if isinstance(error, SyntaxError):
        return f"line {error.lineno}: {error.msg}"
    if isinstance(error, ModuleNotFoundError):
        hint = f"; a run folder holds {file} alone: set PYTHONPATH to where the rest is, or install it"
    else:
        hint = ""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    where = f"line {lines[-1]}: " if lines else ""
    return f"{where}{type(error).__name__}: {error}{hint}"


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
