"""Input signals as texts in t, functions or samples: evaluated at given times."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arguments import reals
from ..base.arrays import F64
from ..base.samples import LARGEST
from ..errors import DataError, SpecError
from ..language.evaluate import function_of
from .signals import Signals

__all__ = ["Source", "evaluate", "function", "is_samples", "jump_of", "sources"]

STEEPEST = 4  # steps of samples in which jumps are looked for
HALVED = 20

Source = str | Callable[[F64], ArrayLike] | ArrayLike


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
        values: Any = function_of(source, ("t",), "signal")({"t": times})
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
            f"evaluating {what}: it reaches {np.abs(array).max():.3g}, whose square overflows; give it in "
            "another unit"
        )
    return np.ascontiguousarray(array)


def function(source: Source) -> Callable[[F64], F64]:
    """`evaluate` of text or a function of t for many calls: text is read once."""
    if not isinstance(source, str):
        return lambda t: evaluate(source, t)
    read = function_of(source, ("t",), "signal")
    return lambda t: np.asarray(read({"t": t}) + np.zeros(t.shape), dtype=np.float64)


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
            "give one per system input, as a list or as an array (input, time)"
        )
    return found


def is_samples(source: Source) -> bool:
    return not isinstance(source, str) and not callable(source)


def jump_of(source: Source, values: F64, t: F64) -> float | None:
    """Where text or a function of the given values at times t jumps, None where it does not.

    The steepest steps are halved until a continuous function would change no more.
    """
    size = np.abs(np.diff(values))
    at = np.argsort(size)[-STEEPEST:]
    at = at[size[at] > 0]
    low, high = t[at], t[at + 1]
    for _ in range(HALVED if at.size else 0):
        middle = 0.5 * (low + high)
        left, centre, right = np.reshape(evaluate(source, np.r_[low, middle, high]), (3, at.size))
        first = np.abs(centre - left) >= np.abs(right - centre)
        low, high = np.where(first, low, middle), np.where(first, middle, high)
    if not at.size:
        return None
    left, right = np.reshape(evaluate(source, np.r_[low, high]), (2, at.size))
    jumps = np.abs(right - left) > 0.5 * size[at]
    return float(high[jumps].min()) if jumps.any() else None


def _call(function: Callable[[F64], ArrayLike], times: F64, what: str) -> Any:
    try:
        try:
            return function(times)
        except (TypeError, ValueError):
            # Functions written with the math module or with `if t > 1` take one time after the other.
            return [float(function(x)) for x in times]  # type: ignore[arg-type]
    except Exception as error:
        raise DataError(f"evaluating {what}: it raised {type(error).__name__}: {error}") from error
