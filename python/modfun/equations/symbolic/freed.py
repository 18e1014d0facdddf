"""Equations with a free number for each coefficient, and the parameters whose coefficients come nearest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import sympy

from ...base.arrays import F64
from .compiled import Compiled, Delayed
from .meaning import parameter

__all__ = ["FreedEquations", "far", "freed"]

SEED, STARTS = 20, 24
DECADES = 1.0  # standard deviation of the starts about their centres
FURTHEST = 100  # evaluations from a start
ROUGH = 0.1  # of a coefficient: what the first search takes for its error at least
EQUAL = 2.0  # difference of chi-squares, and
LEVEL = 0.01  # the same as a part, within which sets of parameters match alike
TURNED = 4.0  # decades


@dataclass(frozen=True, eq=False)
class FreedEquations:
    """Equations whose coefficients are their parameters, in the place of a model.

    Attributes
    ----------
    own : Compiled
        The equations.
    parameters : tuple of sympy.Symbol
        Those of the model.
    coefficients : tuple of sympy.Expr
        What each parameter of `own` is of these.
    trend : str or None
        That of the model.
    """

    own: Compiled
    parameters: tuple[sympy.Symbol, ...]
    coefficients: tuple[sympy.Expr, ...]
    trend: str | None

    def compiled(self, *_channels: Any) -> Compiled:
        """The equations, as those of a model for the channels of a record."""
        return self.own

    @cached_property
    def functions(self) -> tuple[Callable[[F64], F64], Callable[[F64], F64]]:
        """Coefficients of parameters, and their slopes (coefficient, parameter)."""
        symbols, matrix = list(self.parameters), sympy.Matrix(self.coefficients)
        value, slope = (sympy.lambdify([symbols], e, "numpy") for e in (matrix, matrix.jacobian(symbols)))
        return lambda x: np.ravel(value(x)).astype(float), lambda x: slope(x).astype(float)

    def nearest(self, given: F64, cov: F64, centres: F64, low: F64, high: F64) -> F64 | None:
        """Parameters within bounds whose coefficients are nearest to given ones, by the errors of these.

        Of several sets that match alike, as two time constants exchanged, that nearest to the centres; None
        where no start leads to any.
        """
        errors = np.sqrt(np.diag(cov))
        try:
            whiten = np.linalg.inv(np.linalg.cholesky(cov / np.outer(errors, errors))) / errors
        except np.linalg.LinAlgError:
            return None
        rough = np.diag(1 / np.maximum(errors, ROUGH * np.abs(given)))
        rng = np.random.default_rng(SEED)
        ends: list[tuple[float, F64]] = []
        for k in range(STARTS):
            # The centres themselves first; from the second half on with signs of any kind.
            away = np.exp((k > 0) * DECADES * np.log(10) * rng.normal(size=centres.size))
            signs = rng.choice([1.0, -1.0], centres.size) if k >= STARTS // 2 else 1.0
            x: F64 | None = np.clip(centres * away * signs, low, high)
            for weights in (rough, whiten):
                x = None if x is None else self.led(x, given, weights)
                x = None if x is None else np.clip(x, low, high)
            if x is not None:
                left = whiten @ (self.functions[0](x) - given)
                ends.append((float(left @ left), x))
        if not ends:
            return None
        most = (1 + LEVEL) * min([chi2 for chi2, _ in ends]) + EQUAL
        return min([x for chi2, x in ends if chi2 <= most], key=lambda x: far(x, centres))

    def led(self, start: F64, given: F64, weights: F64) -> F64 | None:
        """Where least squares of weighted differences to given coefficients leads; None without a value."""
        from scipy.optimize import least_squares

        value, slope = self.functions
        size = np.where(start == 0, 1.0, np.abs(start))
        try:
            with np.errstate(all="ignore"):
                ended = least_squares(
                    lambda z: weights @ (value(z * size) - given),
                    start / size,
                    lambda z: weights @ slope(z * size) * size,
                    method="lm",
                    max_nfev=FURTHEST,
                )
        except (ValueError, ArithmeticError):  # where a coefficient has no value
            return None
        x: F64 = ended.x * size
        return x if np.all(np.isfinite(x)) else None


def far(x: F64, centres: F64) -> float:
    """Decades between parameters and centres, as many as `TURNED` for another sign."""
    ratios = np.maximum(np.abs(x / centres), 1e-300)
    return float(np.sum(np.abs(np.log10(ratios)) + TURNED * (np.sign(x) != np.sign(centres))))


def freed(compiled: Compiled, trend: str | None) -> FreedEquations | None:
    """Linear equations with a parameter for each coefficient that has some; None of others and free delays.

    In nonlinear signals noise bends what is linear in coefficients: matched to these, 3 of 9 records of
    glucose and insulin ended 6 standard errors off.
    """
    symbols = [parameter(name) for name in compiled.parameters]
    late = [own.args[1] for term in compiled.terms for own in term.signal.atoms(Delayed)]
    if not compiled.is_linear or any(delay.free_symbols for delay in late):
        return None
    found: dict[sympy.Expr, sympy.Symbol] = {}
    terms = []
    for term in compiled.terms:
        own, sign = term.coefficient, 1
        if own.free_symbols:
            if -own in found:
                own, sign = -own, -1
            own = found.setdefault(own, sympy.Symbol(f"coefficient {len(found) + 1}", real=True))
        terms.append(replace(term, coefficient=sign * own))
    if len(found) < len(symbols):
        return None
    names = tuple([symbol.name for symbol in found.values()])
    made = replace(compiled, parameters=names, free={}, terms=tuple(terms))
    return FreedEquations(made, tuple(symbols), tuple(found), trend)
