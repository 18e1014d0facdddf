"""What is known of noise that drives a system: inputs that nobody measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, sqrt
from typing import Any

import numpy as np

from ..base.arguments import public, real, reals, whole
from ..base.names import nearest
from ..errors import SpecError
from ..records.record import Record
from ..systems.lti import LTI
from ..systems.making import linear, tf

__all__ = ["Numerator", "ProcessNoise", "dryden", "refuse_unknown", "with_inputs"]

Filter = tuple[tuple[float, ...], tuple[float, ...]]
MOST = 2  # degree of a numerator that is estimated


@public
@dataclass(frozen=True)
class Numerator:
    """Filter of process noise whose numerator a fit estimates: c1 s + c0, or c2 s² + c1 s + c0, over `den`.

    Parameters
    ----------
    degree : {1, 2}
        Of the numerator; at most the order of every equation.
    den : sequence of float, default (1,)
        Known denominator, descending powers.

    Raises
    ------
    SpecError
        Another degree, or a denominator without numbers.

    See Also
    --------
    modfun.ProcessNoise : Takes it for an input.

    Notes
    -----
    The spectrum q0 + q1 ω² + q2 ω⁴, over that of `den`, is a sum of white noises that are differentiated 0, 1
    and 2 times, of levels of at least 0. The numerator is its factor without zeros in the right half-plane.
    One of degree 2 therefore has a damping ratio of at least 0.71.

    References
    ----------
    K. J. Åström, Introduction to Stochastic Control Theory, Academic Press, 1970, chapter 4 (spectral
    factorisation).

    Examples
    --------
    >>> import modfun as mf
    >>> mf.ProcessNoise(w=mf.Numerator(1))
    ProcessNoise(w=(c1 s + c0))
    """

    degree: int
    den: tuple[float, ...] = (1.0,)

    def __init__(self, degree: int, den: Sequence[float] = (1.0,)) -> None:
        degree = whole("Numerator", "degree", degree, 1, MOST)
        known = tuple(reals("Numerator", "den", den).ravel().tolist())
        if not known or known[0] == 0 or not np.all(np.isfinite(known)):
            raise SpecError(
                f"Numerator: den={den!r} must be coefficients in descending powers, as in (2.0, 1.0)"
            )
        object.__setattr__(self, "degree", degree)
        object.__setattr__(self, "den", known)

    def filters(self) -> list[Filter]:
        """Those of the noises that add up, from the constant on."""
        return [((1.0, *[0.0] * power), self.den) for power in range(self.degree + 1)]


def factor(levels: Sequence[float]) -> list[float]:
    """Numerator, descending powers, of which |C|² has these coefficients of ω⁰, ω², …, all at least 0."""
    roots = [sqrt(level) for level in levels]
    if len(roots) == MOST + 1:
        roots[1] = sqrt(levels[1] + 2 * roots[0] * roots[2])
    return roots[::-1]


@public
@dataclass(frozen=True, init=False, repr=False)
class ProcessNoise:
    """Noise that enters through unmeasured inputs of the model, such as gusts.

    Parameters
    ----------
    **inputs : float or LTI or Numerator
        By the name of an input of the model: the filter that shapes white noise of unit power spectral
        density (two-sided, of hertz) into it, or a number for white noise of that root of the density. A fit
        estimates a factor for each (`Fit.process_noise`), or the coefficients of a `Numerator`; `simulate`
        takes filters as they are.

    Raises
    ------
    SpecError
        No input, a level that is not above 0, or a filter with a delay or with several inputs or outputs.

    See Also
    --------
    modfun.dryden : Filters of turbulence.
    modfun.fit : Takes it as `noise`.
    modfun.simulate : Takes it as `process_noise`.

    References
    ----------
    V. Klein, E. A. Morelli, Aircraft System Identification, AIAA, 2006, chapter 6 (process noise).

    Examples
    --------
    >>> import modfun as mf
    >>> mf.ProcessNoise(w=mf.dryden(1.5))
    ProcessNoise(w=(1.41421 s + 0.544331) / (s^2 + 1.33333 s + 0.444444))
    """

    filters: tuple[tuple[str, Filter], ...]

    def __init__(self, **inputs: Any) -> None:
        if not inputs:
            raise SpecError(
                "ProcessNoise: name an unmeasured input of the model, as in ProcessNoise(w=1.0); "
                'noise in each equation by itself is noise="process"'
            )
        filters = [
            (name, one)
            for name, own in inputs.items()
            for one in (own.filters() if isinstance(own, Numerator) else [_filter(name, own)])
        ]
        object.__setattr__(self, "filters", tuple(filters))

    @property
    def names(self) -> tuple[str, ...]:
        """Inputs of the model through which it enters."""
        return tuple(dict.fromkeys([name for name, _ in self.filters]))

    @classmethod
    def of_filters(cls, filters: Sequence[tuple[str, Filter]]) -> ProcessNoise:
        """That of which `filters` are these, as files keep them."""
        made = object.__new__(cls)
        kept = [(name, (tuple(num), tuple(den))) for name, (num, den) in filters]
        object.__setattr__(made, "filters", tuple(kept))
        return made

    @property
    def estimated(self) -> tuple[str, ...]:
        """Inputs of which the numerator is estimated."""
        return tuple([name for name, own in self._filters().items() if len(own) > 1])

    @property
    def parts(self) -> tuple[str, ...]:
        """What each filter is for: its input, and of numerators the coefficient, as in "w: c1"."""
        return tuple(
            [
                f"{name}: c{k}" if len(own) > 1 else name
                for name, own in self._filters().items()
                for k in range(len(own))
            ]
        )

    def _filters(self) -> dict[str, list[Filter]]:
        return {name: [own for other, own in self.filters if other == name] for name in self.names}

    def coefficients(self, levels: Sequence[float]) -> list[float]:
        """Factors of the filters and coefficients of numerators, in the order of the filters.

        Parameters
        ----------
        levels : sequence of float
            Squares of factors, and coefficients of a squared numerator, the constant first.

        Returns
        -------
        list of float
        """
        found, left = [], list(levels)
        for own in self._filters().values():
            found += factor(left[: len(own)])[::-1]
            left = left[len(own) :]
        return found

    def scaled(self, levels: Sequence[float]) -> ProcessNoise:
        """The same with the filters that a fit found: `levels` are squares of factors."""
        found, left = {}, list(levels)
        for name, own in self._filters().items():
            num, den = (factor(left[: len(own)]), own[0][1]) if len(own) > 1 else own[0]
            by = 1.0 if len(own) > 1 else sqrt(left[0])
            found[name] = tf(by * np.array(num), den)
            left = left[len(own) :]
        return ProcessNoise(**found)

    def __repr__(self) -> str:
        told = []
        for name, own in self._filters().items():
            num, den = own[0]
            top = (
                _told(num)
                if len(own) == 1
                else f"({' + '.join(_power(k) for k in reversed(range(len(own))))})"
            )
            told.append(f"{name}={top}" + (f" / {_told(den)}" if len(den) > 1 else ""))
        return f"ProcessNoise({', '.join(told)})"


def with_inputs(rec: Record, noise: Any) -> Record:
    """The record with an input of zeros for each unmeasured one; itself where there is none."""
    names = noise.names if isinstance(noise, ProcessNoise) else ()
    if not names or (rec.inputs[-len(names) :] == names and not rec.u[-len(names) :].any()):
        return rec
    taken = [name for name in names if name in (*rec.inputs, *rec.outputs)]
    if taken:
        raise SpecError(
            f"noise=ProcessNoise: {taken[0]!r} is a channel of the record; "
            "name an unmeasured input of the model"
        )
    return rec._like(
        u=np.vstack([rec.u, np.zeros((len(names), rec.t.size))]),
        inputs=(*rec.inputs, *names),
        intersample=(*rec.intersample, *["smooth"] * len(names)),
        _functions=rec._functions,
    )


def refuse_unknown(noise: Any, inputs: Sequence[str]) -> None:
    """Refuse noise through what is no input of equations or a state space."""
    for name in noise.names if isinstance(noise, ProcessNoise) else ():
        if name not in inputs:
            raise SpecError(
                f"fit: noise=mf.ProcessNoise({name}=...): the model has no input {name!r}; "
                f"{nearest(name, inputs)}. Write it into the model as an input that nobody measured, or take "
                'noise="process", one cause in each equation'
            )


def _power(k: int) -> str:
    return f"c{k}" + ("" if k == 0 else " s" if k == 1 else f" s^{k}")


def _filter(name: str, given: Any) -> Filter:
    if isinstance(given, (int, float, np.number)) and not isinstance(given, bool):
        level = real("ProcessNoise", name, given)
        if not (isfinite(level) and level > 0):
            raise SpecError(
                f"ProcessNoise: {name}={given!r} must be a level above 0, or a filter such as mf.dryden(1.5)"
            )
        return (level,), (1.0,)
    system = linear(given, "ProcessNoise")
    if not isinstance(system, LTI) or system.shape != (1, 1) or np.any(system.path_delays != 0):
        raise SpecError(
            f"ProcessNoise: {name}={given!r} must be a number, or a linear system of one input and one "
            "output without delay, such as mf.tf([1], [2, 1]) or mf.dryden(1.5)"
        )
    num, den = (tuple(np.atleast_1d(own).astype(float).tolist()) for own in (system.num, system.den))
    return num, den


def _told(coefficients: tuple[float, ...]) -> str:
    powers = range(len(coefficients) - 1, -1, -1)
    parts = [
        " ".join(
            part
            for part in (f"{c:g}" if c != 1 or not k else "", "s" if k == 1 else f"s^{k}" if k else "")
            if part
        )
        for c, k in zip(coefficients, powers, strict=True)
        if c != 0
    ]
    text = " + ".join(parts).replace("+ -", "- ") or "0"
    return f"({text})" if len(parts) > 1 else text


@public
def dryden(tau: float, sigma: float = 1.0, *, axis: str = "vertical") -> LTI:
    """Filter that makes turbulence of Dryden's spectra from white noise.

    Parameters
    ----------
    tau : float
        Scale length over airspeed, L/V, s.
    sigma : float, default 1
        Standard deviation of the gusts, in the unit of the input that they are.
    axis : {"vertical", "lateral", "longitudinal"}
        The first two have the spectrum tau (1 + 3 (tau omega)²)/(1 + (tau omega)²)², the last
        2 tau/(1 + (tau omega)²), two-sided, of hertz, times sigma².

    Returns
    -------
    LTI
        Its response to white noise of unit density has the standard deviation `sigma`.

    Raises
    ------
    SpecError
        Numbers that are not above 0, or another axis.

    See Also
    --------
    modfun.ProcessNoise : Takes it.

    References
    ----------
    MIL-HDBK-1797, Flying Qualities of Piloted Aircraft, 1997, appendix A, section 4.9.

    Examples
    --------
    >>> import modfun as mf
    >>> mf.dryden(1.5).poles().real.round(3).tolist()
    [-0.667, -0.667]
    """
    for name, value in (("tau", tau), ("sigma", sigma)):
        if not (isfinite(real("dryden", name, value)) and value > 0):
            raise SpecError(f"dryden: {name}={value!r} must be above 0 (tau = scale length over airspeed, s)")
    if axis == "longitudinal":
        return tf([sigma * sqrt(2 * tau)], [tau, 1.0])
    if axis not in ("vertical", "lateral"):
        raise SpecError(f"dryden: axis={axis!r} is not one of 'vertical', 'lateral', 'longitudinal'")
    return tf([sigma * sqrt(3 * tau) * tau, sigma * sqrt(tau)], [tau**2, 2 * tau, 1.0])
