"""Vectors written as expressions of place and time, such as ``"1 + 0.2*sin(2*pi*t), 0"``."""

import ast
from collections.abc import Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from alsph.arrays import FloatArray
from alsph.text import shown

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline


@lru_cache
def _through(*table: float) -> tuple["CubicSpline", FloatArray]:
    """Return the cubic spline through a table t0, v0, t1, v1 ..., and its first and last t."""
    from scipy.interpolate import CubicSpline  # half a second that most commands do without

    at, values = np.array(table[::2], float), np.array(table[1::2], float)
    if not (np.isfinite(at).all() and np.isfinite(values).all() and (np.diff(at) > 0).all()):
        raise ValueError("spline: the table is to have finite numbers, and its times to increase")
    return CubicSpline(at, values), at[[0, -1]]


def spline(t: FloatArray, *table: float) -> FloatArray:
    """Return what a table t0, v0, t1, v1 ... has at t: a cubic spline through it, straight on beyond its ends."""
    if not all(np.ndim(number) == 0 for number in table):
        raise ValueError("spline: the table is to have numbers, not places")
    curve, ends = _through(*map(float, table))
    inside = np.clip(t, *ends)
    return np.asarray(curve(inside) + curve(inside, 1) * (t - inside))


FUNCTIONS: dict[str, Any] = {
    name: getattr(np, name)
    for name in (
        *("sin", "cos", "tan", "arcsin", "arccos", "arctan", "arctan2", "hypot", "sinh", "cosh", "tanh"),
        *("exp", "log", "sqrt", "abs", "sign", "floor", "minimum", "maximum", "where"),
    )
} | {"spline": spline}
"""What an expression may call: functions of numpy, element by element, and tables."""

CONSTANTS = {"pi": np.pi, "e": np.e}

LONGEST = 20_000
"""Characters."""

ALLOWED = (
    *(ast.Expression, ast.BinOp, ast.UnaryOp, ast.Compare, ast.Call, ast.Name, ast.Load, ast.Constant),
    *(ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Pow, ast.Mod, ast.USub, ast.UAdd, ast.Lt, ast.LtE, ast.Gt, ast.GtE),
)


class _Floats(ast.NodeTransformer):
    """Whole numbers, whose powers may take for ever, and comparisons, whose sum is no sum, as floats."""

    def visit_Constant(self, node: ast.Constant) -> ast.Constant:  # noqa: N802 (the library's name)
        assert isinstance(node.value, int | float)
        return ast.copy_location(ast.Constant(float(node.value)), node)

    def visit_Compare(self, node: ast.Compare) -> ast.Call:  # noqa: N802
        compared = self.generic_visit(node)
        assert isinstance(compared, ast.Compare)
        return ast.Call(ast.Name("where", ast.Load()), [compared, ast.Constant(1.0), ast.Constant(0.0)], [])


class VectorExpression:
    """A vector as a function of positions and time.

    Parameters
    ----------
    text
        An expression for each component, with commas between: numbers, ``+ - * / ** %``, comparisons, parentheses,
        ``x``, ``y``, ``z`` [D], ``t`` [D/U], ``pi``, ``e``, :data:`FUNCTIONS`, and the names in `numbers`.
    components
        How many there are.
    numbers
        Further names and what they stand for.

    Raises
    ------
    ValueError
        If it is no such expression; says what and where.
    """

    def __init__(self, text: str, components: int, numbers: Mapping[str, float]) -> None:
        self.components = components
        self._arguments = text, components, dict(numbers)
        own = {*"xyzt", *CONSTANTS, *FUNCTIONS}
        self._twice = own & numbers.keys()
        self._names = {**numbers, **CONSTANTS, **FUNCTIONS}
        if len(text) > LONGEST:
            raise ValueError(f"too long, {len(text)} characters; at most {LONGEST}")
        try:
            tree = ast.parse(text.strip(), mode="eval")
        except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
            where = f" near character {error.offset}" if isinstance(error, SyntaxError) and error.offset else ""
            raise ValueError(f"no expression{where}; write one such as 1 + 0.2*sin(2*pi*t), 0") from None
        parts = tree.body.elts if isinstance(tree.body, ast.Tuple) else [tree.body]
        if len(parts) != components:
            apart = "; put commas between them" if len(parts) < components else ""
            raise ValueError(f"{len(parts)} components, and there are {components} directions{apart}")
        try:
            for part in parts:
                self._check(part)
            expressions = [ast.fix_missing_locations(ast.Expression(_Floats().visit(part))) for part in parts]
            self._codes = [compile(expression, "expression", "eval") for expression in expressions]
            self(np.zeros((2, components)), 0.0)
        except (RecursionError, MemoryError):
            raise ValueError("too deep") from None
        except OverflowError:
            raise ValueError("a number in it is too large") from None

    def __reduce__(self) -> tuple[Any, ...]:
        """Be made anew in another process: compiled code cannot go there."""
        return VectorExpression, self._arguments

    def _check(self, part: ast.expr) -> None:
        called = {id(node.func) for node in ast.walk(part) if isinstance(node, ast.Call)}
        for node in ast.walk(part):
            wrong = not isinstance(node, ALLOWED)
            if isinstance(node, ast.Constant):
                wrong = type(node.value) not in (int, float)
            elif isinstance(node, ast.Compare) and len(node.ops) > 1:
                raise ValueError(f"{shown(ast.unparse(node))}: write two comparisons, as (0 < x)*(x < 1)")
            elif isinstance(node, ast.Name):
                self._check_name(node.id)
                wrong = (node.id in FUNCTIONS) != (id(node) in called)
            elif isinstance(node, ast.Call):
                wrong = bool(node.keywords) or not isinstance(node.func, ast.Name)
                if isinstance(node.func, ast.Name) and node.func.id in FUNCTIONS:
                    wanted = getattr(FUNCTIONS[node.func.id], "nin", 3)
                    if node.func.id == "spline":
                        if len(node.args) < 5 or len(node.args) % 2 == 0:
                            raise ValueError(
                                "spline takes t and a table of two pairs or more: spline(t, t0, v0, t1, v1)"
                            )
                    elif len(node.args) != wanted:
                        raise ValueError(f"{node.func.id} takes {wanted} arguments, not {len(node.args)}")
            strange = [own for own in ast.iter_child_nodes(node) if not isinstance(own, ALLOWED)]
            if wrong or any(not ast.unparse(own) for own in strange):  # an operator is told with what it stands between
                power = "; write ** for a power" if any(isinstance(own, ast.BitXor) for own in strange) else ""
                raise ValueError(f"{shown(ast.unparse(node))} cannot be used in an expression{power}")

    def _check_name(self, name: str) -> None:
        known = [*"xyz"[: self.components], "t", *self._names]
        if name in self._twice:
            raise ValueError(f"{name} is a parameter of the case, too, and means something else; rename the parameter")
        if name not in known:
            raise ValueError(f"unknown name {shown(name)}; known: {', '.join(known)}")

    def __call__(self, position: FloatArray, time: float) -> FloatArray:
        """Return the vectors (m, components) at positions (m, components) and a time.

        Raises
        ------
        ValueError
            If a function takes other arguments.
        """
        # Columns of their own: numpy's functions round otherwise where numbers do not follow each other in memory.
        columns = {name: np.ascontiguousarray(column) for name, column in zip("xyz", position.T, strict=False)}
        names: dict[str, Any] = {"__builtins__": {}, **self._names, **columns, "t": np.float64(time)}
        values = np.empty((len(position), self.components))
        for component, code in enumerate(self._codes):
            try:
                with np.errstate(all="ignore"):
                    found = eval(code, names)
                if np.iscomplexobj(found):
                    raise ValueError("is a complex number")
                values[:, component] = found
            except (ArithmeticError, TypeError) as error:
                raise ValueError(f"cannot be computed: {error}") from None
        return values
