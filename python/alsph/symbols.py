"""What a case calls its reference length and velocity, which texts for all cases call D and U."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

UNIT = re.compile(
    r"(?P<clock>tU/D)"
    r"|(?P<rate_squared>U(?:²|\^2)/D(?:²|\^2))"
    r"|(?P<acceleration>U(?:²|\^2)/D)"
    r"|(?P<time_squared>D(?:²|\^2)/U(?:²|\^2))"
    r"|(?P<time>D/U)"
    r"|(?P<rate>U/D)"
    r"|(?P<pressure>(?:ρ|\\?rho )U(?:²|\^2))"
    r"|(?P<viscosity>(?<![A-Za-z_-])UD(?![A-Za-z_]))"
    r"|(?P<velocity>(?:(?<=Δt)|(?<=Delta t)|(?<![A-Za-z_-]))U(?![A-Za-z_]))"
    r"|(?P<length>(?<![A-Za-z_-])D(?![A-Za-z_]))"
)
"""Where texts speak of D and U: not in words, in 2-D or in C_D."""

FORMULA = re.compile(r"((?<!\\)\$[^$]*\$)")
"""A part of a text that figures show as a formula."""

TYPESET = {"ρ": r"\rho ", "Ω": r"\Omega ", "²": "^2", "₀": "_0", "⁻¹": "^{-1}", "·": r"\cdot "}
"""Letters as formulas have them."""


@dataclass(frozen=True)
class Symbols:
    """The names of a case's reference values.

    Called with a text that speaks of D and U it returns the text with these names.

    Attributes
    ----------
    length, velocity
        Those of the reference length D and velocity U.
    time, rate, acceleration, pressure
        Of D/U, U/D, U²/D and ρU².
    clock
        Of the time as a number, tU/D.

    Examples
    --------
    >>> WATER("end time [D/U]"), WATER("ΔtU/Δx")
    ('end time [√(H/g)]', 'Δt√(gH)/Δx')
    """

    length: str = "D"
    velocity: str = "U"
    time: str = "D/U"
    rate: str = "U/D"
    acceleration: str = "U²/D"
    pressure: str = "ρU²"
    clock: str = "tU/D"

    def __call__(self, text: str) -> str:
        """Return a text in these names."""
        if self == GENERAL:
            return text
        parts = FORMULA.split(text)
        parts[::2] = [UNIT.sub(self._name, part) for part in parts[::2]]
        parts[1::2] = [UNIT.sub(lambda found: _typeset(self._name(found)), part) for part in parts[1::2]]
        return "".join(parts)

    def _name(self, found: re.Match[str]) -> str:
        kind = str(found.lastgroup)
        if kind == "viscosity":
            return f"{self.velocity}·{self.length}"
        return _squared(getattr(self, kind[:-8])) if kind.endswith("_squared") else str(getattr(self, kind))


GENERAL = Symbols()

WATER = Symbols("H", "√(gH)", "√(H/g)", "√(g/H)", "g", "ρgH", "t√(g/H)")
"""Those of water of depth H under gravity g."""


def in_common(symbols: Iterable[Symbols]) -> Symbols:
    """Return the names that are the same for several cases, or D and U."""
    found = {*symbols}
    return found.pop() if len(found) == 1 else GENERAL


def _squared(name: str) -> str:
    root = re.fullmatch(r"√\((.*)\)", name)
    return root[1] if root else f"({name})²"


def _typeset(name: str) -> str:
    """Return a name as it stands in a formula."""
    name = re.sub(r"√\(([^)]*)\)", r"\\sqrt{\1}", name)
    for letter, formula in TYPESET.items():
        name = name.replace(letter, formula)
    return name
