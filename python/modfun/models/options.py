"""The options of a fit: checked once, kept with the result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from typing import Any, TypedDict

import numpy as np

from ..base.arguments import meant, real, reals, whole
from ..base.names import nearest
from ..base.samples import band_edges
from ..base.words import TRENDS
from ..errors import SpecError
from .noise import Noise
from .process import ProcessNoise

__all__ = ["MOST", "MOST_THREADS", "WORDS", "Choices", "Options"]

WORDS: dict[str, tuple[str, ...]] = {
    "method": ("ls", "wls", "awls", "ml"),
    "noise": ("output", "process", "equation", "coloured", "errors-in-variables", "log-normal"),
    "cov_type": ("spectral", "HC3", "nonrobust"),
    "initial_state": ("unknown", "zero", "rest", "periodic"),
    "rule": ("staircase", "trapezoid", "parabolic", "gregory"),
}
# What others call a choice, and what it is called here.
_CALLED = {
    ("cov_type", "classical"): "classical standard errors are 'nonrobust'",
    ("noise", "white"): "white noise of the outputs is 'output', white noise in the equations 'equation'",
}
SWITCHES = {
    "stable": "an unstable estimate gives way to the nearest stable model",
    "robust": "samples are weighted by Student's t, for spikes and heavy tails",
}
_REPORTED = ("cov_type", "output_weights", "correct", "stable", "robust", "reference")
MOST = 10**9
MOST_THREADS = 10_000


class Choices(TypedDict, total=False):
    """What may be given to `fit`, `Estimator` and `fit_many` by keyword; see `fit`."""

    method: str
    band: float | tuple[float, float] | None
    harmonics: int | None
    trend: str | None
    noise: str | Noise | ProcessNoise
    cov_type: str
    output_weights: Any
    correct: bool
    rule: str
    extended: bool
    tol: float
    maxiter: int
    stable: bool
    initial_state: Any
    robust: bool
    reference: str | Sequence[str] | None


@dataclass(frozen=True)
class Options:
    """Checked options of a fit; `band` is None or (lower, upper) in rad/s."""

    method: str = "ml"
    band: tuple[float, float] | None = None
    harmonics: int | None = None
    trend: str | None = "auto"
    noise: str | Noise | ProcessNoise = "output"
    cov_type: str = "spectral"
    output_weights: tuple[Any, ...] | None = None
    correct: bool = True
    rule: str = "gregory"
    extended: bool = True
    tol: float = 1e-9
    maxiter: int = 50
    stable: bool = field(default=False, repr=False)
    # A word, or the given state of each record.
    initial_state: str | tuple[tuple[float, ...], ...] = field(default="unknown", repr=False)
    robust: bool = field(default=False, repr=False)
    reference: tuple[str, ...] = field(default=(), repr=False)

    def __repr__(self) -> str:
        # Studies on disk are known by this text: options that came later are in it where they are given.
        shown = [f.name for f in fields(self) if f.repr or getattr(self, f.name) != f.default]
        return f"Options({', '.join(f'{name}={getattr(self, name)!r}' for name in shown)})"

    @classmethod
    def checked(cls, what: str, own: tuple[str, ...] = (), /, **given: Any) -> Options:
        """Options from what a user wrote.

        Parameters
        ----------
        what : str
            Whose options they are, for the messages ("fit", "Estimator", ...).
        own : tuple of str, default ()
            Arguments that the call has besides, which a misspelt name may mean.
        **given
            The options.

        Raises
        ------
        SpecError
            An unknown option or word, or a number out of range.
        """
        # Equal tuples may hold values of other types, so a band of two edges is looked at every time.
        look = _checked if isinstance(given.get("band"), tuple) else _looked_up
        try:
            return look(what, own, **given)
        except TypeError:  # a list or array is not a key
            return _checked(what, own, **given)

    @property
    def fitted_trend(self) -> str | None:
        """The trend, "auto" settled: "constant", as trimmed records of linear models need."""
        return "constant" if self.trend == "auto" else self.trend

    def settled(self) -> Options:
        """The same with trend="auto" settled."""
        return self.replace(trend=self.fitted_trend)

    def replace(self, **changes: Any) -> Options:
        """The same with some options changed (unchecked)."""
        return replace(self, **changes)

    def plain(self) -> Options:
        """The same as one problem of least squares, without what `fit` makes of its answer and records."""
        return self if self.is_plain else self.replace(reference=(), robust=False, stable=False)

    @property
    def is_plain(self) -> bool:
        """Whether they ask for one problem of least squares."""
        return not (self.robust or self.stable or self.reference)

    def given(self) -> dict[str, Any]:
        """Options that differ from the defaults, by name."""
        return {f.name: getattr(self, f.name) for f in fields(self) if getattr(self, f.name) != f.default}

    def states(self, records: int) -> list[list[float]]:
        """Given initial states, one a record; none where they are not given in numbers.

        Raises
        ------
        SpecError
            For another number of records.
        """
        given = () if isinstance(self.initial_state, str) else self.initial_state
        if len(given) not in (0, 1, records):
            raise SpecError(
                f"fit: initial_state= holds {len(given)} states for {records} record(s); give one for all, "
                "or one per record of one problem"
            )
        return [list(state) for state in (given * records if len(given) == 1 else given)]

    def core(self) -> dict[str, Any]:
        """Keywords of the compiled core (all but the choice of the reported covariance)."""
        words = {name: value for name, value in self.__dict__.items() if name not in _REPORTED}
        if not isinstance(self.initial_state, str):
            words["initial_state"] = "zero"  # beside which the given state moves
        return words | {"trend": self.fitted_trend}

    def refuse_alone(self, what: str) -> None:
        """Refuse options that make more of a fit than one problem of least squares.

        Raises
        ------
        SpecError
        """
        for name in (*SWITCHES, "reference"):
            if getattr(self, name):
                raise SpecError(
                    f"{what}: {name}={getattr(self, name)!r} is for mf.fit, mf.fit_many, Estimators and "
                    "studies; leave it out"
                )

    @property
    def drives(self) -> bool:
        """Whether noise drives the system, beside that of the samples."""
        return self.noise == "process" or isinstance(self.noise, ProcessNoise)

    @property
    def fits_covariance(self) -> bool:
        """Whether the covariance of the noise of several outputs is fitted beside the parameters."""
        known = self.output_weights is not None or isinstance(self.noise, Noise)
        return not (known or self.drives or self.noise == "errors-in-variables")

    @property
    def plain_noise(self) -> bool:
        """Whether the noise is white on one output, in its equation, or both: what the fastest path fits."""
        return self.noise in ("output", "process", "equation") and self.output_weights is None


def _checked(what: str, own: tuple[str, ...] = (), /, **given: Any) -> Options:
    for name in given:
        if name not in Options.__dataclass_fields__:
            known = list(dict.fromkeys([*own, *Options.__dataclass_fields__]))
            raise SpecError(f"{what}: there is no option {name!r}; {meant(name, known)}")
    for name, words in WORDS.items():
        if name == "noise" and isinstance(given.get(name), Noise | ProcessNoise):
            continue
        if name == "initial_state" and not isinstance(given.get(name, ""), str):
            continue
        if name in given and not (isinstance(given[name], str) and given[name] in words):
            value = given[name]
            hint = _CALLED.get((name, str(value).lower())) or nearest(value, words)
            raise SpecError(f"{what}: {name}={value!r} is not available; {hint}")
    trend = given.get("trend")
    if trend is not None and not (isinstance(trend, str) and trend in ("auto", *TRENDS)):
        raise SpecError(f"{what}: trend={trend!r} is not available; use 'constant', 'linear', 'auto' or None")
    checked = dict(given)
    if given.get("band") is not None:
        checked["band"] = band_edges(what, given["band"])
    if given.get("output_weights") is not None:
        checked["output_weights"] = _weights(what, given["output_weights"])
        if given.get("noise", "output") != "output":
            raise SpecError(
                f'{what}: output_weights= goes with noise="output"; noise= says the weights itself'
            )
    drives = given.get("noise") == "process" or isinstance(given.get("noise"), ProcessNoise)
    if drives and given.get("method", "ml") != "ml":
        raise SpecError(
            f'{what}: noise="process" estimates levels by likelihood, which method={given["method"]!r} has '
            'not; take method="ml"'
        )
    if not isinstance(given.get("initial_state", ""), str):
        checked["initial_state"] = _states(what, given["initial_state"])
    if "reference" in given:
        checked["reference"] = _references(what, given["reference"])
    if given.get("harmonics") is not None:
        if checked.get("band") is not None:
            raise SpecError(
                f"{what}: band={given['band']!r} and harmonics={given['harmonics']!r} say the same thing "
                "twice; give one of them, or neither for the default rule"
            )
        checked["harmonics"] = whole(what, "harmonics", given["harmonics"], 1, MOST)
    if "maxiter" in given:
        checked["maxiter"] = whole(what, "maxiter", given["maxiter"], 1, MOST)
    if "tol" in given:
        checked["tol"] = real(what, "tol", given["tol"])
        if not 0 < checked["tol"] < 1:
            raise SpecError(f"{what}: tol={given['tol']!r} must lie between 0 and 1; the default is 1e-9")
    if "extended" in given and not isinstance(given["extended"], bool | np.bool_):
        raise SpecError(
            f"{what}: extended={given['extended']!r} must be True (indices from -n/2, no information "
            "lost) or False (the report's 0..M)"
        )
    if "correct" in given and not isinstance(given["correct"], bool | np.bool_):
        raise SpecError(
            f"{what}: correct={given['correct']!r} must be True (what noise adds to nonlinear signals is "
            "taken out) or False"
        )
    for name, does in SWITCHES.items():
        if name in given and not isinstance(given[name], bool | np.bool_):
            raise SpecError(f"{what}: {name}={given[name]!r} must be True ({does}) or False")
    for name in ("extended", "correct", *SWITCHES):
        if name in given:
            checked[name] = bool(given[name])
    return Options(**checked)


_looked_up = lru_cache(64, typed=True)(_checked)


def _references(what: str, given: Any) -> tuple[str, ...]:
    names = (given,) if isinstance(given, str) else tuple(given or ())
    if not all(isinstance(name, str) for name in names) or len(set(names)) < len(names):
        raise SpecError(
            f"{what}: reference={given!r} must be the name of a channel that the record keeps, or several"
        )
    return names


def _states(what: str, given: Any) -> tuple[tuple[float, ...], ...]:
    states = reals(what, "initial_state", given)
    if states.ndim not in (1, 2) or not states.size or not np.all(np.isfinite(states)):
        raise SpecError(
            f"{what}: initial_state={given!r} must be y, y', ... of the free response at the first sample, "
            f"or a list of these, one per record; or one of {', '.join(WORDS['initial_state'])}"
        )
    return tuple(map(tuple, np.atleast_2d(states).tolist()))


def _weights(what: str, given: Any) -> tuple[Any, ...]:
    weights = reals(what, "output_weights", given)
    matrix = weights.ndim == 2 and weights.shape[0] == weights.shape[1]
    if not (weights.ndim == 1 or matrix) or not weights.size or not np.all(np.isfinite(weights)):
        raise SpecError(
            f"{what}: output_weights={given!r} must be one number an output (1/variance of its noise), or "
            "the inverse covariance matrix"
        )
    smallest = np.min(weights) if weights.ndim == 1 else np.min(np.linalg.eigvalsh(weights))
    if not smallest > 0:
        raise SpecError(f"{what}: output_weights={given!r} must be positive (a matrix: positive definite)")
    plain = weights.tolist()
    return tuple(plain) if weights.ndim == 1 else tuple(map(tuple, plain))
