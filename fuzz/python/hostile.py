"""Values that a call does not expect: made from what it does expect, or from nothing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

Rng = np.random.Generator
EXTREMES = (
    0.0,
    -0.0,
    5e-324,
    1e-308,
    -1e-300,
    1e-100,
    1e100,
    1e300,
    1.7e308,
    -1.7e308,
    np.inf,
    -np.inf,
    np.nan,
)


class Plain:
    """An object that is nothing."""


class Refuses:
    """An object whose every conversion raises."""

    def __array__(self, *_: Any, **__: Any) -> Any:
        raise ValueError("no array of me")

    def __float__(self) -> float:
        raise ValueError("no number of me")

    def __len__(self) -> int:
        raise ValueError("no length of me")


# Made anew at each call, so that no case leaves anything to the next.
THINGS: tuple[Callable[[], Any], ...] = (
    lambda: None,
    lambda: True,
    lambda: "",
    lambda: "nan",
    lambda: "y",
    lambda: "a1",
    lambda: "x" * 5000,
    lambda: "\x00\ud800é",
    lambda: "__import__('os').abort()",
    lambda: b"bytes",
    lambda: [],
    lambda: (),
    lambda: {},
    lambda: set(),
    lambda: [[]],
    lambda: [None],
    lambda: ["a", "b"],
    lambda: ["a", "a"],
    lambda: [1, "two", None],
    lambda: [[1.0], [1.0, 2.0]],
    lambda: {"a": 1},
    lambda: {"a1": None},
    lambda: {1: 2},
    lambda: {"y": [1, 2, 3]},
    lambda: object(),
    lambda: Plain,
    Plain,
    Refuses,
    lambda: len,
    lambda: lambda *_: 1.0,
    lambda: lambda *_: "text",
    lambda: lambda: None,
    lambda: (x for x in (1, 2)),
    lambda: range(3),
    lambda: slice(1, 2),
    lambda: ...,
    lambda: 0,
    lambda: 1,
    lambda: -1,
    lambda: 2,
    lambda: 3,
    lambda: 101,
    lambda: 10**9,
    lambda: 2**31,
    lambda: 2**63,
    lambda: -(2**63) - 1,
    lambda: 10**30,
    lambda: 10**400,
    lambda: 0.5,
    lambda: 1.5,
    lambda: -0.5,
    lambda: 1 + 2j,
    lambda: complex(np.nan, np.inf),
    lambda: np.float64(0.1),
    lambda: np.float32(0.1),
    lambda: np.int8(-3),
    lambda: np.uint64(2**64 - 1),
    lambda: np.bool_(True),
    lambda: np.str_("u"),
    lambda: np.datetime64("2026-01-01"),
    lambda: np.timedelta64(3, "s"),
    lambda: np.array(1.0),
    lambda: np.array(None),
    lambda: np.array("text"),
    lambda: np.zeros(0),
    lambda: np.zeros((0, 0)),
    lambda: np.zeros((1, 0, 3)),
    lambda: np.zeros((2, 2, 2, 2)),
    lambda: np.ones(1),
    lambda: np.ones(7),
    lambda: np.ones((3, 3)),
    lambda: np.array([1, "a", None], dtype=object),
    lambda: np.array([1 + 1j, 2.0]),
    lambda: np.array([True, False]),
    lambda: np.array(["a", "b"]),
    lambda: np.array([(1, 2.0)], dtype=[("a", int), ("b", float)]),
    lambda: np.array(["2026-01-01"], dtype="M8[s]"),
    lambda: np.ma.masked_array([1.0, 2.0], mask=[True, False]),
    *[(lambda value: lambda: value)(x) for x in EXTREMES],
    *[(lambda value: lambda: np.full(5, value))(x) for x in EXTREMES],
    *[(lambda value: lambda: (0.5, value))(x) for x in EXTREMES],
    lambda: (8.0, 0.5),
    lambda: (1.0, 1.0),
    lambda: (-1.0, 2.0),
    lambda: (1.0, 2.0, 3.0),
)


def anything(rng: Rng) -> Any:
    """One of the things."""
    return THINGS[rng.integers(len(THINGS))]()


def spoilt(value: Any, rng: Rng) -> Any:
    """Return `value` with something wrong inside; anything at all where there is no such inside."""
    try:
        return _spoilt(value, rng)
    except (TypeError, ValueError, OverflowError):
        return anything(rng)


def _spoilt(value: Any, rng: Rng) -> Any:
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and rng.random() < 0.95:
        return ARRAYS[rng.integers(len(ARRAYS))](value, rng)
    if isinstance(value, Mapping) and value and rng.random() < 0.85:
        return _mapping(dict(value), rng)
    if isinstance(value, list | tuple) and value and rng.random() < 0.85:
        return _sequence(value, rng)
    if isinstance(value, str) and value and rng.random() < 0.5:
        at = int(rng.integers(len(value)))
        return value[:at] + str(rng.choice(list("x'(*/_, \n\x000é"))) + value[at + int(rng.integers(2)) :]
    if isinstance(value, int | float) and not isinstance(value, bool) and rng.random() < 0.6:
        return NUMBERS[rng.integers(len(NUMBERS))](value, rng)
    return anything(rng)


def _mapping(value: dict[Any, Any], rng: Rng) -> Any:
    key = list(value)[rng.integers(len(value))]
    match rng.integers(5):
        case 0:
            del value[key]
        case 1:
            value[_hashable(rng)] = value[key]
        case 2:
            return list(value.values())
        case _:
            value[key] = spoilt(value[key], rng) if rng.random() < 0.5 else anything(rng)
    return value


def _hashable(rng: Rng) -> Any:
    return [None, 3, 1.5, "", "a1", ("y",), "\x00", True, np.nan, -1.0][rng.integers(10)]


def _sequence(value: Any, rng: Rng) -> Any:
    parts = list(value)
    at = int(rng.integers(len(parts)))
    match rng.integers(6):
        case 0:
            del parts[at]
        case 1:
            parts.insert(at, parts[at])
        case 2:
            parts.reverse()
        case 3:
            return dict(enumerate(parts))
        case _:
            parts[at] = spoilt(parts[at], rng) if rng.random() < 0.5 else anything(rng)
    return type(value)(parts) if type(value) in (list, tuple) else parts


NUMBERS: tuple[Callable[[Any, Rng], Any], ...] = (
    lambda x, rng: -x,
    lambda x, rng: x * 0,
    lambda x, rng: x + 1,
    lambda x, rng: x - 1,
    lambda x, rng: x * 1e6,
    lambda x, rng: x * 1e-6,
    lambda x, rng: x * 10.0 ** float(rng.integers(-300, 300)),
    lambda x, rng: x * 10 ** int(rng.integers(1, 30)),
    lambda x, rng: str(x),
    lambda x, rng: [x],
    lambda x, rng: np.array(x),
    lambda x, rng: np.array([x, x]),
    lambda x, rng: complex(x, 1.0),
    lambda x, rng: np.float32(x),
    lambda x, rng: float(x) + 0.5,
    lambda x, rng: EXTREMES[rng.integers(len(EXTREMES))],
)


def _put(x: np.ndarray[Any, Any], rng: Rng, value: float) -> Any:
    found = np.array(x, dtype=float)
    if found.size:
        found.flat[rng.integers(found.size)] = value
    return found


def _every_other(x: np.ndarray[Any, Any]) -> Any:
    wide = np.zeros((*x.shape[:-1], 2 * x.shape[-1]) if x.ndim else (2,), dtype=x.dtype)
    wide[..., ::2] = x
    return wide[..., ::2]


def _frozen(x: np.ndarray[Any, Any]) -> Any:
    found = x.copy()
    found.flags.writeable = False
    return found


def _ladder(x: np.ndarray[Any, Any]) -> Any:
    return x * 10.0 ** np.linspace(-300, 300, x.size).reshape(x.shape)


def _silent(f: Callable[[np.ndarray[Any, Any], Rng], Any]) -> Callable[[np.ndarray[Any, Any], Rng], Any]:
    def quiet(x: np.ndarray[Any, Any], rng: Rng) -> Any:
        with np.errstate(all="ignore"):
            return f(x, rng)

    return quiet


# The right shape with wrong numbers, right numbers in the wrong form, and forms that should not matter.
ARRAYS: tuple[Callable[[np.ndarray[Any, Any], Rng], Any], ...] = tuple(
    map(
        _silent,
        (
            lambda x, rng: _put(x, rng, np.nan),
            lambda x, rng: _put(x, rng, np.inf),
            lambda x, rng: _put(x, rng, 1.7e308),
            lambda x, rng: _put(x, rng, -1e300),
            lambda x, rng: x * 1e300,
            lambda x, rng: x * 1e150,
            lambda x, rng: x * 1e-150,
            lambda x, rng: x * 1e-300,
            lambda x, rng: x * 1e-320,
            lambda x, rng: x * 10.0 ** float(rng.integers(-308, 308)),
            lambda x, rng: _ladder(x),
            lambda x, rng: np.zeros_like(x),
            lambda x, rng: np.ones_like(x),
            lambda x, rng: np.full(x.shape, 1e308),
            lambda x, rng: np.arange(x.size, dtype=float).reshape(x.shape),
            lambda x, rng: (-1.0) ** np.arange(x.size).reshape(x.shape),
            lambda x, rng: rng.choice(np.array(EXTREMES), x.shape),
            lambda x, rng: rng.choice(np.array(EXTREMES[:10]), x.shape),
            lambda x, rng: np.sign(x),
            lambda x, rng: x + 1e18,
            lambda x, rng: -x,
            lambda x, rng: x[..., ::-1] if x.ndim else x,
            lambda x, rng: x.T,
            lambda x, rng: x.ravel(),
            lambda x, rng: x[..., :-1] if x.ndim else x,
            lambda x, rng: x[..., : int(rng.integers(0, 9))] if x.ndim else x,
            lambda x, rng: np.repeat(x, 2, axis=-1) if x.ndim else x,
            lambda x, rng: np.concatenate([x, x]) if x.ndim else x,
            lambda x, rng: x[None],
            lambda x, rng: x[..., None],
            lambda x, rng: x[:0] if x.ndim else x,
            lambda x, rng: _every_other(x),
            lambda x, rng: np.asfortranarray(x),
            lambda x, rng: _frozen(x),
            lambda x, rng: np.broadcast_to(x, (3, *x.shape)),
            lambda x, rng: np.lib.stride_tricks.as_strided(x, x.shape, (0,) * x.ndim),
            lambda x, rng: x.astype(np.float32),
            lambda x, rng: x.astype(np.float16),
            lambda x, rng: x.astype(np.longdouble),
            lambda x, rng: x.astype(">f8"),
            lambda x, rng: x.astype(np.int8),
            lambda x, rng: x.astype(np.uint64),
            lambda x, rng: x.astype(bool),
            lambda x, rng: x.astype(complex),
            lambda x, rng: x + 1j,
            lambda x, rng: x.astype(object),
            lambda x, rng: np.where(x > 0, None, x),
            lambda x, rng: x.astype(str),
            lambda x, rng: x.astype("M8[s]"),
            lambda x, rng: np.ma.masked_array(x, mask=x > np.mean(x) if x.size else False),
            lambda x, rng: x.tolist(),
            lambda x, rng: tuple(map(str, x.ravel())),
            lambda x, rng: memoryview(np.ascontiguousarray(x)),
        ),
    )
)
