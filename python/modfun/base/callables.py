"""Functions of the user that leave the process: whether they can, their names and their sources."""

from __future__ import annotations

import importlib
import inspect
import pickle
import types
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from hashlib import sha256
from typing import Any

import numpy as np

from ..errors import SpecError

__all__ = ["address", "at", "importable", "source"]


def importable(call: Any, what: str, why: str) -> None:
    """Refuse what another process could not import.

    Parameters
    ----------
    call : callable
    what, why : str
        For the message: whose it is, and what needs it to be importable.

    Raises
    ------
    SpecError
        A lambda, a function inside of a function, or an object that cannot be pickled.
    """
    try:
        pickle.dumps(call)
    except Exception as error:
        raise SpecError(
            f"run: {what} is {_said(call)}, which {why} could not import ({error}); define it with def at "
            "the top of a module"
        ) from None


def address(call: Any) -> str:
    """Where a function or class can be imported from, as "module:qualname".

    Raises
    ------
    SpecError
        It cannot: a lambda, a function inside of a function, an instance.
    """
    module, name = getattr(call, "__module__", None), getattr(call, "__qualname__", None)
    if isinstance(call, np.ufunc):  # NumPy 1.26 gives it neither
        name = call.__name__
        module = "numpy" if getattr(np, name, None) is call else None
    if isinstance(module, str) and isinstance(name, str) and "<" not in name:
        return f"{module}:{name}"
    raise SpecError(
        f"run: {_said(call)} has no name to import it by, which a study directory needs; define it with def "
        "at the top of a module, or make it a dataclass defined there"
    )


def at(place: str) -> Any:
    """What stands at "module:qualname"; raises ImportError or AttributeError where nothing does."""
    module, _, name = place.partition(":")
    found: Any = importlib.import_module(module)
    for part in name.split("."):
        found = getattr(found, part)
    return found


def source(call: Any) -> list[Any]:
    """What a function computes with, as plain values: its text; of an object its class and fields."""
    if isinstance(call, partial):
        return [source(call.func), _plain(call.args), _plain(call.keywords)]
    if isinstance(call, types.MethodType):
        return [source(call.__func__), source(call.__self__)]
    if not isinstance(call, types.FunctionType | types.BuiltinFunctionType | type):
        state = {f.name: getattr(call, f.name) for f in fields(call)} if is_dataclass(call) else vars(call)
        return [source(type(call)), _plain(dict(sorted(state.items())))]
    try:
        return [inspect.getsource(call)]
    except (OSError, TypeError):  # typed into an interpreter, or compiled
        code = getattr(call, "__code__", None)
        return _code(code) if code is not None else [f"{call.__module__}:{call.__qualname__}"]


def _plain(value: Any) -> Any:
    """A setting as text, whole arrays and functions included."""
    if isinstance(value, np.ndarray) and value.dtype != object:
        return [value.dtype.str, value.shape, sha256(np.ascontiguousarray(value).tobytes()).hexdigest()]
    if isinstance(value, Mapping):
        return [[str(name), _plain(one)] for name, one in value.items()]
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return source(value) if isinstance(value, types.FunctionType | partial) else repr(value)


def _code(code: types.CodeType) -> list[Any]:
    constants = [_code(c) if isinstance(c, types.CodeType) else repr(c) for c in code.co_consts]
    return [code.co_code.hex(), list(code.co_names), constants]


def _said(call: Callable[..., Any]) -> str:
    name = getattr(call, "__qualname__", None)
    if name is None:
        return f"a {type(call).__name__}"
    if "<lambda>" in name:
        return "a lambda"
    return f"the function {name} inside of another function" if "<locals>" in name else f"{name}"
