"""Texts in a small closed language, functions of time and samples: evaluated at given times."""

import ast
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arguments import reals
from ..base.samples import LARGEST
from ..errors import DataError, SpecError
from ..signals.signals import Signals

__all__ = ["Source", "evaluate", "expression", "function", "is_samples", "sources"]

F64 = NDArray[np.float64]
Source = str | Callable[[F64], ArrayLike] | ArrayLike

# Long or deep text is never a signal; the limits keep Python's own parser far from its stack.
_MAX_LENGTH = 1000
_MAX_DEPTH = 200

_CONSTANTS = {"pi": np.pi, "e": np.e}
_FUNCTIONS: dict[str, tuple[int, Callable[..., Any]]] = {
    "sin": (1, np.sin),
    "cos": (1, np.cos),
    "tan": (1, np.tan),
    "asin": (1, np.arcsin),
    "acos": (1, np.arccos),
    "atan": (1, np.arctan),
    "sinh": (1, np.sinh),
    "cosh": (1, np.cosh),
    "tanh": (1, np.tanh),
    "exp": (1, np.exp),
    "log": (1, np.log),
    "sqrt": (1, np.sqrt),
    "abs": (1, np.abs),
    "sign": (1, np.sign),
    "floor": (1, np.floor),
    "step": (1, lambda x: np.heaviside(x, 1.0)),
    "min": (2, np.minimum),
    "max": (2, np.maximum),
    "where": (3, lambda c, a, b: np.where(c != 0, a, b)),
}
_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
    ast.Mod: np.mod,
}
_UNARY: dict[type[ast.unaryop], Callable[[Any], Any]] = {ast.UAdd: np.positive, ast.USub: np.negative}
_COMPARE: dict[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Lt: np.less,
    ast.LtE: np.less_equal,
    ast.Gt: np.greater,
    ast.GtE: np.greater_equal,
}
_ALLOWED = (
    f"{', '.join(_CONSTANTS)}, numbers, + - * / ** % < <= > >=, parentheses and {', '.join(_FUNCTIONS)}"
)


def evaluate(source: Source, t: ArrayLike) -> F64:
    """Values of a signal at given times.

    Parameters
    ----------
    source : str, callable or array_like
        Text such as ``"sin(t**2/5)"`` in a small closed language: ``t``, ``pi``, ``e``, numbers, the
        operators ``+ - * / ** %``, the comparisons ``< <= > >=`` (1 where true, else 0) and the functions
        sin, cos, tan, asin, acos, atan, sinh, cosh, tanh, exp, log, sqrt, abs, sign, floor, step (1 from 0
        on), min, max, where(condition, a, b). Text is parsed, never executed. A callable gets the array
        of times (or, if it cannot take arrays, one time after the other). An array holds one value a time.
    t : array_like, shape (time,)
        Times in seconds.

    Returns
    -------
    ndarray, shape (time,)
        The values, finite.

    Raises
    ------
    SpecError
        Text with a name, operator or construct outside the language.
    DataError
        Values of the wrong number, or not finite.

    Examples
    --------
    >>> evaluate("2*step(t - 1)", [0.0, 1.0, 2.0])
    array([0., 2., 2.])
    """
    times = np.ascontiguousarray(t, dtype=np.float64)
    if isinstance(source, str):
        what = f"the signal {source if len(source) <= 60 else source[:57] + '...'!r}"
        values: Any = _Text(source).at({"t": times})
    elif callable(source):
        what = f"the signal from {getattr(source, '__name__', type(source).__name__)}"
        values = _call(source, times, what)
    else:
        what = "the signal given as an array"
        values = source
    array = reals("evaluating a signal", "samples", values, DataError)
    if array.ndim == 0 and not is_samples(source):
        array = np.full(times.shape, float(array))
    if array.shape != times.shape:
        raise DataError(
            f"evaluating {what}: it has shape {array.shape}, but there are {times.size} times; "
            "give one value a time (N intervals have N+1 samples)"
        )
    finite = np.isfinite(array)
    if not finite.all():
        k = int(np.argmin(finite))
        raise DataError(
            f"evaluating {what}: it is {array[k]} at t = {times[k]:g} s; "
            "change the signal so that it is finite at all times used"
        )
    if array.size and np.abs(array).max() > LARGEST:
        raise DataError(
            f"evaluating {what}: it reaches {np.abs(array).max():.3g}, whose square is no number; give it in "
            "another unit"
        )
    return np.ascontiguousarray(array)


def function(source: Source) -> Callable[[F64], F64]:
    """`evaluate` of text or a function of t for many calls: text is read once."""
    if not isinstance(source, str):
        return lambda t: evaluate(source, t)
    parsed = _Text(source)
    return lambda t: np.asarray(parsed.at({"t": t}) + np.zeros(t.shape), dtype=np.float64)


def expression(text: str, names: Sequence[str]) -> Callable[[Mapping[str, float]], float]:
    """A text in given names as a function of their values; the language is that of `evaluate`.

    Parameters
    ----------
    text : str
        Such as ``"a1/(2*sqrt(a2))"``.
    names : sequence of str
        What may stand in it besides constants and functions.

    Returns
    -------
    callable
        Takes a mapping from name to value; nan or inf where the expression has no value.

    Raises
    ------
    SpecError
        Text with a name, operator or construct outside the language.
    """
    parsed = _Text(text, names, "expression")
    return lambda values: float(parsed.at({name: np.float64(values[name]) for name in names}))


def sources(given: Any, inputs: int) -> list[Source]:
    """One source an input, from what a user may give: one source, a sequence, a 2-D array, Signals, None."""
    found: list[Source]
    if isinstance(given, list | tuple) and any(isinstance(one, Signals) for one in given):
        raise SpecError(
            "giving the input: a list with mf.signals in it; give Signals alone, several inputs as "
            "multisine([...]), first.then(second), or mf.signals.Signals(u, dt, names)"
        )
    if given is None:
        found = []
    elif isinstance(given, Signals):
        found = given.sources()
    elif isinstance(given, str) or callable(given):
        found = [given]
    elif isinstance(given, list | tuple) and any(not is_samples(s) or np.ndim(s) for s in given):
        found = list(given)  # signals, not the samples of one
    else:
        array = reals("simulating", "the input", given, DataError)
        found = [array] if array.ndim < 2 else list(array)
    if len(found) != inputs:
        raise SpecError(
            f"giving the input: {len(found)} signal(s) for a system with {inputs} input(s); "
            "give one a system input, as a list or as an array (input, time)"
        )
    return found


def is_samples(source: Source) -> bool:
    return not isinstance(source, str) and not callable(source)


def _call(function: Callable[[F64], ArrayLike], times: F64, what: str) -> Any:
    try:
        try:
            return function(times)
        except (TypeError, ValueError):
            # Functions written with the math module or with `if t > 1` take one time after the other.
            return [float(function(x)) for x in times]  # type: ignore[arg-type]
    except Exception as error:
        raise DataError(f"evaluating {what}: it raised {type(error).__name__}: {error}") from error


class _Text:
    """A parsed signal text; refuses what is outside the language when made."""

    def __init__(self, text: str, names: Sequence[str] = ("t",), what: str = "signal") -> None:
        self.text = text
        self.names = names
        self.what = what
        self.allowed = f"allowed are {', '.join(names)}, {_ALLOWED}"
        if len(text) > _MAX_LENGTH:
            raise SpecError(
                f"reading the {what}: it has {len(text)} characters, at most {_MAX_LENGTH} are read; "
                "pass a function instead"
            )
        try:
            tree = ast.parse(text.strip(), mode="eval")
        except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
            reason = error.msg if isinstance(error, SyntaxError) else type(error).__name__
            raise SpecError(f"reading the {what} {text[:60]!r}: {reason}; {self.allowed}") from None
        self.body = tree.body
        self.check(self.body, 0)

    def refuse(self, node: ast.AST, reason: str) -> SpecError:
        token = ast.unparse(node) if isinstance(node, ast.expr) else type(node).__name__
        return SpecError(
            f"reading the {self.what} {self.text[:60]!r}: {token[:40]!r} {reason}; {self.allowed}"
        )

    def check(self, node: ast.expr, depth: int) -> None:
        if depth > _MAX_DEPTH:
            raise SpecError(
                f"reading the {self.what}: it is nested more than {_MAX_DEPTH} deep; pass a function instead"
            )
        match node:
            case ast.Constant(value=bool()) | ast.Constant(value=complex()):
                raise self.refuse(node, "is not a real number")
            case ast.Constant(value=int() | float() as number):
                try:
                    float(number)
                except OverflowError:
                    raise SpecError(f"reading the {self.what}: it has a number above 1e308") from None
            case ast.Name(id=name):
                if name in _FUNCTIONS:
                    raise self.refuse(node, f"is a function: write {name}(...)")
                if name not in self.names and name not in _CONSTANTS:
                    raise self.refuse(node, "is not a known name")
            case ast.BinOp(left=left, op=op, right=right):
                if isinstance(op, ast.BitXor):
                    raise self.refuse(node, "uses ^: a power is written **")
                if type(op) not in _BINARY:
                    raise self.refuse(node, "uses an unknown operator")
                self.check(left, depth + 1)
                self.check(right, depth + 1)
            case ast.UnaryOp(op=sign, operand=operand):
                if type(sign) not in _UNARY:
                    raise self.refuse(node, "uses an unknown operator")
                self.check(operand, depth + 1)
            case ast.Compare(left=left, ops=ops, comparators=others):
                if any(type(op) not in _COMPARE for op in ops):
                    raise self.refuse(node, "uses an unknown comparison")
                for part in [left, *others]:
                    self.check(part, depth + 1)
            case ast.Call(func=ast.Name(id=name), args=args, keywords=[]) if name in _FUNCTIONS:
                wanted = _FUNCTIONS[name][0]
                if len(args) != wanted:
                    raise self.refuse(node, f"has {len(args)} argument(s), {name} takes {wanted}")
                for part in args:
                    self.check(part, depth + 1)
            case ast.Call(func=func):
                raise self.refuse(func, "is not a known function")
            case _:
                raise self.refuse(node, "is not part of the language")

    def at(self, values: Mapping[str, Any]) -> Any:
        # Overflow and invalid operations show as inf and nan, which the caller reports with their time.
        with np.errstate(all="ignore"):
            return self.value(self.body, values)

    def value(self, node: ast.expr, given: Mapping[str, Any]) -> Any:
        match node:
            case ast.Constant(value=number):
                return np.float64(number)  # type: ignore[arg-type]  # never an int: powers cannot grow
            case ast.Name(id=name):
                return given[name] if name in given else np.float64(_CONSTANTS[name])
            case ast.BinOp(left=left, op=op, right=right):
                return _BINARY[type(op)](self.value(left, given), self.value(right, given))
            case ast.UnaryOp(op=sign, operand=operand):
                return _UNARY[type(sign)](self.value(operand, given))
            case ast.Compare(left=left, ops=ops, comparators=others):
                values = [self.value(part, given) for part in [left, *others]]
                true = [_COMPARE[type(op)](a, b) for op, a, b in zip(ops, values, values[1:], strict=False)]
                # One by one: numbers among signals are of another shape.
                return reduce(np.logical_and, true).astype(np.float64)
            case ast.Call(func=ast.Name(id=name), args=args):
                return _FUNCTIONS[name][1](*(self.value(part, given) for part in args))
        raise AssertionError(f"unchecked node {type(node).__name__}")
