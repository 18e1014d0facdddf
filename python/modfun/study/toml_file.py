"""A study written in TOML: each key is the argument of `MonteCarlo` with the same name."""

from __future__ import annotations

import inspect
import sys
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import rivals
from ..base.names import nearest
from ..base.words import TRENDS
from ..errors import DataError, ModfunError, SpecError
from ..fitting.fit import Estimator
from ..models.free import Free
from ..models.transfer_function import TransferFunction
from ..systems.lti import LTI
from ..systems.making import ss, tf
from . import toml_values as values
from .monte_carlo import MonteCarlo
from .toml_values import Key, Reader

__all__ = ["EXAMPLE", "load"]

EXAMPLE = """\
# A Monte Carlo study: how good are these estimators on records like these?
#
#   modfun mc run study.toml --out runs/a
#
# Each key is the argument of mf.MonteCarlo with the same name. What stands below a line in [brackets]
# belongs to that table, so plain keys come first.

input = "sin(t**2/5)"            # a text in t; a list of samples; a list of these, one per input
duration = 10.0                  # length of a record, s
intervals = 256                  # sampling intervals; a record has one sample more

nsr = [0.05, 0.2, 0.6]           # noise: standard deviation over rms of the response from rest
noise = "white"
initial_state = "zero"           # or "random", or a list of the states at t = 0

estimators = ["ls", "awls", "ml"]
harmonics = 6                    # or band = [0.5, 8.0], in rad/s; without both it is chosen for each system
trend = "none"                   # or "constant", "linear"; without it an unknown offset is fitted, too

replicates = 1000                # records a cell; `modfun mc run --replicates` for more
seed = 1

# One system, or several with names: an axis of the study. System, input and initial_state may be axes.
[system.eq24]                    # y'' + 3 y' + 8 y = 5 u
num = [5]
den = [1, 3, 8]

[system.light]
num = [1]
den = [1, 0.2, 1]

# Estimators with options of their own, instead of the list above:
#
#   [estimators]
#   "ml, wide band" = { method = "ml", harmonics = 20, model = { poles = 2, zeros = 0 } }
#   "at rest" = { method = "ml", initial_state = "rest", model = { poles = 2, zeros = 0 } }
#   "heavy tails" = { method = "ml", robust = true, model = { poles = 2, zeros = 0 } }
#   prior = { method = "ml", model = { poles = 2, zeros = 0, params = { a1 = { start = 2.9, sd = 0.1 } } } }
#   oe = { rival = "output_error", model = { poles = 2, zeros = 0 } }
#   mine = "my_functions:mine"   # mine(record, rng) in my_functions.py beside this file
#
# Functions, too, can make records (generate), noise, initial states, the truth and metrics.
"""

OF_A_RUN = ("threads", "until", "shard", "keep", "draw", "progress")


def load(path: str | Path) -> MonteCarlo:
    """The study in a TOML file.

    Texts such as ``"module:name"`` stand for functions; they are looked for in the folder of the file
    first, as for a script there.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    MonteCarlo

    Raises
    ------
    SpecError
        No such file, no TOML, an unknown key, a value of the wrong kind, a function that is not there, or
        what `MonteCarlo` refuses; the message begins with the file.
    DataError
        As `MonteCarlo` raises it.
    """
    place = Path(path)
    try:
        text = place.read_text(encoding="utf-8-sig")
        told = tomllib.loads(text)
    except FileNotFoundError:
        raise SpecError(
            f"there is no study file {str(place)!r}; `modfun mc init {place}` writes one"
        ) from None
    except OSError as error:
        raise SpecError(f"study file {str(place)!r} cannot be read ({error.strerror or error})") from None
    except (ValueError, RecursionError) as error:  # ValueError: no TOML, no UTF-8, numbers without an end
        raise SpecError(f"{place}: this is not TOML: {error}") from None
    folder = str(place.resolve().parent)
    if folder not in sys.path:
        sys.path.insert(0, folder)
    return study(told, str(place), text)


def study(told: Mapping[str, Any], file: str, text: str = "") -> MonteCarlo:
    """The study that a TOML document tells; `file` begins its messages, `text` tells lines."""
    given: dict[str, Any] = {"estimators": None}
    for name, value in told.items():
        key = Key(file, (name,), KEYS.keys(), text)
        if name in OF_A_RUN:
            raise key.refuse(f" is no part of a study but of a run: modfun mc run --{name}")
        if name not in KEYS:
            raise SpecError(f"{key.place}: there is no key {name!r}; {nearest(name, list(KEYS))}")
        given[name] = KEYS[name](key, value)
    if isinstance(given["estimators"], dict):
        given["estimators"] = {
            name: one.made(given.get("model")) if isinstance(one, Unmade) else one
            for name, one in given["estimators"].items()
        }
    try:
        return MonteCarlo(**given)
    except (SpecError, DataError) as error:
        raise type(error)(f"{file}: {str(error).removeprefix('MonteCarlo: ')}") from error.__cause__
    except MemoryError as error:
        raise SpecError(
            f"{file}: the study does not fit into memory ({error}); take fewer intervals"
        ) from None


# Systems and structures --------------------------------------------------------------------------


def _systems(key: Key, value: Any) -> Any:
    """One system, or a table of names for several."""
    inner = value.values() if isinstance(value, dict) else ()
    if inner and all(isinstance(one, dict) or values.is_function(one) for one in inner):
        return {name: _system(key.below(name), one) for name, one in value.items()}
    return _system(key, value)


def _system(key: Key, value: Any) -> LTI:
    if values.is_function(value):
        found = values.imported(key, value)
        if not isinstance(found, LTI):
            raise key.refuse(f" = {value!r} is a {type(found).__name__}; name an mf.tf or mf.ss")
        return found
    if not isinstance(value, dict):
        raise key.wrong(value, "a table, as { num = [5], den = [1, 3, 8] }")
    matrices = bool(value.keys() & set("ABCD"))
    needed = ("A", "B", "C") if matrices else ("num", "den")
    known = dict.fromkeys([*needed, *("D" * matrices), "delay"], _matrix)
    given = key.read(value, known)
    missing = [name for name in needed if name not in value]
    if missing:
        raise key.refuse(f" lacks {' and '.join(missing)}; give num and den, or A, B, C (and D)")
    made: LTI = _made(key, ss if matrices else tf, **given)
    return made


def _matrix(key: Key, value: Any) -> Any:
    if not values.numeric(value):
        raise key.wrong(value, "numbers: a list, or lists in a list as in Python")
    return value


def _structure(key: Key, value: Any) -> TransferFunction:
    if not isinstance(value, dict) or "poles" not in value:
        raise key.wrong(value, "a table, as { poles = 2, zeros = 0 }")
    made: TransferFunction = _made(key, TransferFunction, **key.read(value, STRUCTURE))
    return made


def _zeros(key: Key, value: Any) -> Any:
    each = value if isinstance(value, list) else [value]
    if not all(values.is_a(one, int) or one == "none" for one in each):
        raise key.wrong(value, 'a whole number, or a list with one per input, "none" where it has no path')
    degrees = [None if one == "none" else one for one in each]
    return degrees if isinstance(value, list) else degrees[0]


def _parameter(key: Key, value: Any) -> Any:
    """A number that is held, or the words of `mf.Free`."""
    if isinstance(value, dict):
        return _made(key, Free, **key.read(value, FREE))
    if not values.is_a(value, int, float):
        raise key.wrong(value, "a number, or what is known of it, as { start = 2.9, sd = 0.1 }")
    return value


def _delay(key: Key, value: Any) -> Any:
    if isinstance(value, dict):
        return _parameter(key, value)
    return values.several("seconds: a number, a list with one per input, or { max = 0.5 }", int, float)(
        key, value
    )


FREE: dict[str, Reader] = dict.fromkeys(("start", "min", "max", "sd"), values.plain("a number", int, float))
STRUCTURE: dict[str, Reader] = {
    "poles": values.plain("a whole number", int),
    "zeros": _zeros,
    "delay": _delay,
    "params": values.table(_parameter, "a table, as { a1 = 3.0, a2 = { start = 8.1, sd = 0.2 } }"),
    "denominator": values.plain('"common" or "separate"', str),
}


# Signals -----------------------------------------------------------------------------------------


def _input(key: Key, value: Any) -> Any:
    """A text, samples or a function, or a list of them, one per input."""
    if values.is_function(value):
        return values.function("a function of t")(key, value)
    if isinstance(value, str) or (isinstance(value, list) and values.numeric(value)):
        return value
    if isinstance(value, list) and not any(values.is_a(one, int, float) for one in value):
        return [_input(key.below(str(k)), one) for k, one in enumerate(value)]
    raise key.wrong(value, 'a text in t, as "sin(t**2/5)", a list of samples, or a list of these')


def _state(key: Key, value: Any) -> Any:
    if values.is_function(value):
        return values.function("a function of rng")(key, value)
    if isinstance(value, str) or (isinstance(value, list) and values.numeric(value)):
        return value
    raise key.wrong(value, '"zero", "random", a list of the states at t = 0, or "module:name"')


def _known_state(key: Key, value: Any) -> Any:
    if not isinstance(value, str) and not (isinstance(value, list) and values.numeric(value)):
        raise key.wrong(value, '"unknown", "rest", "zero", "periodic", or a list: the state at t = 0')
    return value


def _noise(key: Key, value: Any) -> Any:
    if value == "white":
        return value
    return values.function('"white", or a function of (rng, y, dt)')(key, value)


def _truth(key: Key, value: Any) -> Any:
    if isinstance(value, dict):
        return NUMBERS(key, value)
    return values.function("a table of numbers, or a function of the cell")(key, value)


NUMBERS = values.table(values.plain("a number", int, float), "a table of numbers, as { a1 = 3.0 }")


# Estimators --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Unmade:
    """An estimator that may still need the study's model."""

    key: Key
    make: Callable[..., Any]
    given: dict[str, Any]

    def made(self, model: TransferFunction | None) -> Any:
        """The estimator."""
        own = {"model": model} | self.given
        if own["model"] is None:
            raise self.key.refuse(
                " lacks model; give it there or to the study, as model = { poles = 2, zeros = 0 }"
            )
        return _made(self.key, self.make, **own)


def _estimators(key: Key, value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _estimator(key.below(name), one) for name, one in value.items()}
    if not isinstance(value, list) or not all(isinstance(one, str) for one in value):
        raise key.wrong(value, 'a list of methods, as ["ls", "ml"], or a table of names')
    for one in value:
        if values.is_function(one):
            raise key.refuse(f" lists {one!r}; a function needs a name, as {{ mine = {one!r} }}")
    return value


def _estimator(key: Key, value: Any) -> Any:
    """A method, a function, or a table with options."""
    if values.is_function(value):
        return values.function("a function of (record, rng)")(key, value)
    if isinstance(value, str):
        return value
    if not isinstance(value, dict):
        raise key.wrong(value, 'a method, a table, as { method = "ml", harmonics = 20 }, or "module:name"')
    if "rival" not in value:
        return Unmade(key, Estimator, key.read(value, ESTIMATOR))
    word = value["rival"]
    if word not in RIVALS:
        raise key.below("rival").wrong(word, f"one of {', '.join(RIVALS)}")
    known = {
        name: reader for name, reader in RIVAL.items() if name in inspect.signature(RIVALS[word]).parameters
    }
    return Unmade(key, RIVALS[word], key.read({n: v for n, v in value.items() if n != "rival"}, known))


def _trend(key: Key, value: Any) -> Any:
    if value not in ("none", "auto", *TRENDS[1:]):
        raise key.wrong(value, '"none", "constant", "linear" or "auto"')
    return None if value == "none" else value


def _made(key: Key, make: Callable[..., Any], **given: Any) -> Any:
    """What `make` returns; before what it refuses stands the place in the file."""
    try:
        return make(**given)
    except ModfunError as error:
        raise key.refuse(f": {error}") from None


OPTIONS: dict[str, Reader] = {
    "band": values.several("rad/s: the upper edge, or [lower, upper]", int, float),
    "harmonics": values.plain("a whole number", int),
    "trend": _trend,
    "output_weights": values.several("1/variance of the noise, a number an output", int, float),
    "cov_type": values.plain('"spectral", "HC3" or "nonrobust"', str),
    "rule": values.plain('"gregory", "parabolic", "trapezoid" or "staircase"', str),
    "correct": values.plain("true or false", bool),
    "extended": values.plain("true or false", bool),
    "tol": values.plain("a number", int, float),
    "maxiter": values.plain("a whole number", int),
    "robust": values.plain("true or false", bool),
    "stable": values.plain("true or false", bool),
    "reference": values.several("the name of a channel, or a list of names", str),
}
ESTIMATOR = OPTIONS | {
    "model": _structure,
    "method": values.plain('"ls", "wls", "awls" or "ml"', str),
    "initial_state": _known_state,
    "noise": values.plain('"output", "process", "equation", "coloured" or "errors-in-variables"', str),
}
RIVALS: dict[str, Callable[..., Any]] = {
    "output_error": rivals.output_error,
    "pem": rivals.pem,
    "arx": rivals.arx,
}
RIVAL: dict[str, Reader] = {
    "model": _structure,
    "initial_state": values.plain("a text", str),
    "trend": _trend,
    "start": NUMBERS,
    "maxiter": OPTIONS["maxiter"],
}

KEYS: dict[str, Reader] = {
    "system": _systems,
    "input": values.axis(_input),
    "duration": values.plain("seconds, as 10.0", int, float),
    "intervals": values.plain("a whole number", int),
    "nsr": values.several("a number, or a list of numbers", int, float),
    "noise": _noise,
    "process_noise": values.several("a level, or a list with one per equation", int, float),
    "initial_state": values.axis(_state),
    "generate": values.function("a function of (cell, rng)"),
    "grid": values.table(values.plain("a list", list), "a table of lists, as { df = [3, 30] }"),
    "truth": _truth,
    "estimators": _estimators,
    "metrics": values.table(values.function("a function of (fit, record)"), "a table of functions"),
    "model": _structure,
    "replicates": values.plain("a whole number", int),
    "seed": values.plain("a whole number", int),
    "intersample": values.several('"smooth", "zoh" or "foh", or a list with one per input', str),
    **OPTIONS,
}
