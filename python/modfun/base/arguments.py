"""Arguments that a public call cannot take: said by name, with what it takes instead.

Calls check what only they know (a band that is reversed, matrices that do not fit). That an argument is of
another kind than its annotation shows when something raises: only then are annotations looked at, so that
calls that succeed pay nothing. What raises though all arguments are of their kind is a defect and stays raw.
"""

from __future__ import annotations

import builtins
import inspect
import types
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import wraps
from typing import Any, TypeVar, Union, get_args, get_origin

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ModfunError, SpecError
from .arrays import C128, F64
from .names import nearest

__all__ = [
    "Thing",
    "by_name",
    "complexes",
    "is_sequence",
    "meant",
    "public",
    "real",
    "reals",
    "shown",
    "whole",
]

Thing = TypeVar("Thing", bound=Callable[..., Any])
_NO_NUMBERS = (bool, np.bool_, str, bytes, complex, np.complexfloating, np.datetime64, np.timedelta64)
_WORDS = {"c": "complex", "U": "text", "S": "text", "M": "dates", "m": "durations"}
# What others call an option, its name here, and what it is.
_STEP = ("ts", "dt", "delta_t", "timestep", "sample_time", "sampling_time")
_CALLED = (
    (_STEP, "dt", "the sampling interval in seconds"),
    (_STEP, "intervals", "the number of sampling intervals, duration/dt"),
    (("n", "np", "order", "orders"), "poles", "their number"),
    (("nz",), "zeros", "their number"),
    (("iodelay", "inputdelay"), "delay", "in seconds"),
    (("u", "signal"), "input", "samples, a text such as 'sin(t)', or mf.signals"),
    (("x0", "y0"), "initial_state", "at the first sample"),
    (("noise",), "nsr", "noise over signal, such as 0.1"),
    (
        ("sigma", "std", "noise_std"),
        "nsr",
        "the standard deviation of the noise over the rms of the response",
    ),
    (("rng", "random_state"), "seed", "a whole number"),
    (("n", "runs"), "replicates", "their number"),
    (("n_jobs",), "threads", "their number"),
    (("m", "lines", "n_harmonics"), "harmonics", "the highest modulating index M"),
)
# What makes a system of coefficients, where a class is called with them.
_MADE_BY = {
    "TransferFunction": "It says what is estimated; a system with numbers is mf.tf(num, den)",
    "LTI": "A system of coefficients is mf.tf(num, den), one of matrices mf.ss(A, B, C, D)",
}
_RAW = (TypeError, ValueError, AttributeError, LookupError, ArithmeticError, NotImplementedError)


# One argument --------------------------------------------------------------------------------------


def reals(what: str, name: str, given: Any, kind: type[ModfunError] = SpecError) -> F64:
    """Return an argument as an array of real numbers, of any shape; `kind` is raised where it is none."""
    return np.asarray(_numbers(what, name, given, kind, "fiub"), dtype=np.float64)


def complexes(what: str, name: str, given: Any, kind: type[ModfunError] = SpecError) -> C128:
    """Return an argument as an array of numbers, real or complex; otherwise as `reals`."""
    return np.asarray(_numbers(what, name, given, kind, "fiubc"), dtype=np.complex128)


def by_name(what: str, name: str, given: Any, names: Sequence[str]) -> Any:
    """Return numbers that were given by name in the order of `names`; anything but a mapping as it is."""
    if not isinstance(given, Mapping):
        return given
    for own in given:
        if own not in names:
            raise SpecError(f"{what}: {name} names {own!r}; {nearest(own, names)}")
    if lacking := [own for own in names if own not in given]:
        raise SpecError(f"{what}: {name} has no value of {', '.join(lacking)}; give one of each")
    return [given[own] for own in names]


def _numbers(what: str, name: str, given: Any, kind: type[ModfunError], kinds: str) -> NDArray[Any]:
    try:
        array = np.asarray(given)
        if array.dtype.kind == "O":
            array = array.astype(np.complex128 if "c" in kinds else np.float64)
    except Exception as error:  # of whatever the conversion of an unknown object raises
        raise kind(f"{what}: {name}={shown(given)} cannot be read as numbers ({error})") from None
    if array.dtype.kind not in kinds:
        words = _WORDS.get(array.dtype.kind, "no array of numbers")
        raise kind(f"{what}: {name}={shown(given)} is {words}; give real numbers")
    if np.ma.isMaskedArray(given) and np.ma.getmaskarray(given).any():
        raise kind(f"{what}: {name} has masked entries; give numbers")
    if array.dtype.itemsize > (16 if array.dtype.kind == "c" else 8):
        with np.errstate(over="ignore"):  # a long double beyond the range is inf
            return array.astype(np.complex128 if array.dtype.kind == "c" else np.float64)
    return array


def real(what: str, name: str, given: Any, *, finite: bool = True) -> float:
    """Return an argument as one real number."""
    try:
        if isinstance(given, _NO_NUMBERS) or np.ndim(given):
            raise TypeError
        number = float(given)
    except Exception:
        raise SpecError(f"{what}: {name}={shown(given)} must be a number") from None
    if finite and not np.isfinite(number):
        raise SpecError(f"{what}: {name}={shown(given)} must be finite")
    return number


def whole(what: str, name: str, given: Any, least: int, most: int) -> int:
    """Return an argument as a whole number within bounds."""
    known = isinstance(given, int | np.integer) and not isinstance(given, bool | np.timedelta64)
    if not known or not least <= given <= most:
        raise SpecError(f"{what}: {name}={shown(given)} must be a whole number from {least} to {most}")
    return int(given)


def shown(value: Any) -> str:
    """At most 60 characters of what a value looks like."""
    try:
        text = repr(value)
    except Exception:
        text = f"<{type(value).__name__}>"
    return text if len(text) <= 60 else text[:57] + "..."


# All arguments of a call ---------------------------------------------------------------------------


def public(thing: Thing, within: str = "") -> Thing:
    """Decorate a function, or a class for its constructor and methods: misfits are a SpecError.

    `within` stands before a name that users know by more than itself, "plot." of `plot.bode`. Methods that a
    class has of another of this package count as its own.
    """
    if not isinstance(thing, type):
        return _explained(thing, f"{within}{thing.__name__}")  # type: ignore[no-any-return]
    own_package = __name__.split(".")[0]
    bases = [base for base in reversed(thing.__mro__) if base.__module__.split(".")[0] == own_package]
    for name, member in {name: member for base in bases for name, member in vars(base).items()}.items():
        if not inspect.isfunction(member) or hasattr(member, "__wrapped__"):  # the latter of a public class
            continue
        if not name.startswith("_") or name in ("__init__", "__getitem__"):
            own = thing.__name__ if name == "__init__" else f"{thing.__name__}.{name}"
            setattr(thing, name, _explained(member, own))
    return thing


def _explained(function: Any, name: str) -> Any:
    @wraps(function)
    def call(*args: Any, **given: Any) -> Any:
        try:
            return function(*args, **given)
        except _RAW as error:
            if not isinstance(error, ModfunError):
                _blame(function, name, args, given)
            raise

    if "Never" in function.__annotations__.values():  # what collects misspelt options is not shown
        written = inspect.signature(function)
        shown = [p for p in written.parameters.values() if p.annotation != "Never"]
        call.__signature__ = written.replace(parameters=shown)  # type: ignore[attr-defined]
    return call


def _blame(function: Any, name: str, args: tuple[Any, ...], given: dict[str, Any]) -> None:
    """Raise SpecError for the first argument that is not of its kind."""
    written = inspect.signature(function)
    try:
        bound = written.bind(*args, **given).arguments
    except TypeError:
        _refuse_call(written, name, args, given)
        return
    meant = inspect.signature(function, locals=_Meanings(function.__globals__), eval_str=True).parameters
    for key, parameter in meant.items():
        if key not in bound or parameter.annotation is parameter.empty:
            continue
        values = {key: bound[key]}
        if parameter.kind is parameter.VAR_POSITIONAL:
            values = {f"{key}[{k}]": one for k, one in enumerate(bound[key])}
        elif parameter.kind is parameter.VAR_KEYWORD:
            values = bound[key]
        words = str(written.parameters[key].annotation).split(" | ")
        for own, value in values.items():
            # `str | ArrayLike` is `ArrayLike` to Python, which takes text, too, and no text is an array here.
            if not (isinstance(value, str) and "str" in words) and not _surely_fits(
                value, parameter.annotation
            ):
                raise SpecError(
                    f"{name}: {own}={shown(value)} is of type {type(value).__name__}; it takes "
                    f"{_written(written.parameters[key].annotation)}"
                ) from None


def _refuse_call(written: inspect.Signature, name: str, args: tuple[Any, ...], given: dict[str, Any]) -> None:
    """Raise SpecError for names that do not exist, arguments without a name, and those that are missing."""
    own = [p for p in written.parameters.values() if p.name != "self"]
    args = args[len(written.parameters) - len(own) :]
    hint = f". {_MADE_BY[name]}" if name in _MADE_BY and (args or {"num", "den"} & {*given}) else ""
    kinds = inspect.Parameter
    options = [p.name for p in own if p.kind in (kinds.POSITIONAL_OR_KEYWORD, kinds.KEYWORD_ONLY)]
    for key in given:
        if key not in options and not any(p.kind is kinds.VAR_KEYWORD for p in own):
            raise SpecError(f"{name}: there is no option {key!r}; {meant(key, options)}{hint}") from None
    placed = [p.name for p in own if p.kind in (kinds.POSITIONAL_ONLY, kinds.POSITIONAL_OR_KEYWORD)]
    if args and not own:
        raise SpecError(f"{name}: it takes no arguments; write {name}()") from None
    if extra := args[len(placed) :]:
        free = [key for key in options if key not in placed and key not in given]
        call = ", ".join([*placed, *(f"{key}=..." for key in free[: len(extra)])]) or f"name={shown(args[0])}"
        count = f"{len(args)} arguments are" if len(args) > 1 else "1 argument is"
        raise SpecError(
            f"{name}: {count} given without a name, at most {len(placed)} may be; write {name}({call}){hint}"
        ) from None
    missing = [p.name for p in own if p.default is p.empty and p.name not in given and p.name in options]
    missing = [key for key in missing if key not in placed[: len(args)]]
    if missing:
        raise SpecError(f"{name}: {', '.join(missing)} is missing; give {missing[0]}=...{hint}") from None
    if twice := [key for key in placed[: len(args)] if key in given]:
        raise SpecError(
            f"{name}: {twice[0]} is given by its name, and is what {shown(args[placed.index(twice[0])])} is "
            f"without a name; write {name}({', '.join(f'{key}=...' for key in options[: len(args) + 1])})"
        ) from None


def meant(key: str, options: Sequence[str]) -> str:
    """What an option is called here that others call so, or the names that are nearest."""
    for called, own, what in _CALLED:
        if key.lower() in called and own in options:
            return f"give {own}=..., {what}"
    if key in ("inputs", "outputs"):
        return f"channels are those of the record, rec.select({key}=[...]); {nearest(key, options)}"
    return nearest(key, options)


def _written(annotation: Any) -> str:
    return annotation if isinstance(annotation, str) else getattr(annotation, "__name__", str(annotation))


class _Meanings(dict[str, Any]):
    """What the names in an annotation mean; anything where only type checkers know."""

    def __missing__(self, name: str) -> Any:
        return getattr(builtins, name, Any)


def _surely_fits(value: Any, kind: Any) -> bool:
    try:
        return _fits(value, kind)
    except Exception:  # of whatever an unknown object raises when it is looked at
        return False


def _fits(value: Any, kind: Any) -> bool:
    origin, parts = get_origin(kind), get_args(kind)
    if kind is None or kind is type(None):
        return value is None
    if kind == ArrayLike or origin is np.ndarray:
        return _is_numbers(value)
    if origin in (Union, types.UnionType):
        return any(_fits(value, part) for part in parts)
    if origin is tuple:
        if not is_sequence(value):
            return False
        each = parts[:1] * len(value) if parts[-1] is ... else parts
        return len(each) == len(value) and all(map(_fits, value, each))
    if origin is Callable:
        return callable(value)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return isinstance(value, Mapping) and all(
            _fits(k, parts[0]) and _fits(v, parts[1]) for k, v in value.items()
        )
    if isinstance(origin, type) and issubclass(origin, Iterable):
        if is_sequence(value):
            return all(_fits(one, parts[0]) for one in value)
        return origin is Iterable and isinstance(value, Iterable) and not isinstance(value, str | bytes)
    if kind is float:
        return _is_real(value)
    if kind is int:
        return isinstance(value, int | np.integer) and not isinstance(value, bool | np.timedelta64)
    if kind is bool:
        return isinstance(value, bool | np.bool_)
    return kind is Any or not isinstance(kind, type) or isinstance(value, kind)


def is_sequence(value: Any) -> bool:
    """Whether it is a row of something: a list, a tuple, an array; no text."""
    if isinstance(value, np.ndarray):
        return value.ndim > 0
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def _is_real(value: Any) -> bool:
    try:
        real("", "", value, finite=False)
    except SpecError:
        return False
    return True


def _is_numbers(value: Any) -> bool:
    try:
        complexes("", "", value)
    except SpecError:
        return False
    return True
