"""By how much a shift of a channel or one term more would lower BIC, by regressions of the residual lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, log
from typing import Any

import numpy as np

from ..base.arrays import C128, F64
from ..base.cached import kept
from ..equations.equation import Equation
from ..equations.matrices import names_in, state_of
from ..equations.state_space import StateSpace
from ..models.free import Free
from .estimates import Estimates
from .linear_lines import lines_beside

__all__ = ["Key", "Lines", "worth"]

ROUNDS = 3  # of the noise's covariance
TWIN = 6.0  # taken from a derivative: a rate is the sum of its own equation's terms, which are likelier
LOOKED = 6  # likeliest changes that have these

# "shift" or "late" and a channel; "term", a state or the place of an equation, and what may enter there;
# "numbers", all those in a state space; "drift".
Key = tuple[str, ...]
Term = tuple[int | str, str, int]  # equation, channel and derivative


@kept
def worth(fit: Estimates) -> dict[Key, float]:
    """By how much BIC would fall with each change of several linear equations, about; empty where not told.

    One Gauss-Newton step of the parameters and of the change from the estimate, on the lines of the outputs'
    residuals, whose covariance is the noise's. To first order a lag of a sensor, one of an actuator and a
    delay are shifts in time.
    """
    model = fit.structure
    if isinstance(model, StateSpace):
        terms = _terms(model)
    elif isinstance(model, Equation) and len(model.texts) == len(fit.outputs) > 1 and not model.hidden:
        terms = _derivatives(fit, model)
    else:
        return {}
    found = lines_beside(fit, [pair for _, pair in terms])
    if found is None:
        return {}
    size, outputs, channels = fit.params.size, len(fit.outputs), (*fit.outputs, *fit.inputs)
    order: list[Key] = [*(("shift", name) for name in channels), *[("drift",)] * outputs]
    columns = dict[Key, list[int]]()
    for at, key in enumerate([*order, *(key for key, _ in terms)], size):
        if any(own[at].any() for _, own, _ in found):
            columns.setdefault(key, []).append(at)
    lines = Lines(found, size)
    before, _, cov = lines.settled([], fit.noise_cov)
    firsts = {key: lines.step(at, cov) for key, at in columns.items()}
    likely = sorted(firsts, key=lambda key: firsts[key][0])[:LOOKED]
    rows, falls = fit.df_resid + size, dict[Key, float]()
    for key, places in columns.items():
        after, by, _ = lines.settled(places, firsts[key][2]) if key in likely else firsts[key]
        falls[key] = rows / outputs * (before - after) - len(places) * log(rows) - TWIN * key[-1].count("'")
        if key[0] == "shift":  # sensors are late, and actuators later than their commands
            falls["late", key[1]] = falls[key] if (by > 0) == (key[1] in fit.outputs) else -inf
    return falls


def _derivatives(fit: Estimates, model: Equation) -> list[tuple[Key, Term]]:
    """Channels and their derivatives in each equation, up to one more than it has."""
    names = (*model.outputs, *model.inputs)
    return [
        (("term", str(k), x + "'" * order), (k, x, order))
        for k, most in enumerate(fit.layout.orders)
        for x in names
        for order in range(most + 2)
    ]


def _terms(model: StateSpace) -> list[tuple[Key, Term]]:
    """What may enter the equation of a state, or does by a number, and the channels of both; all measured."""
    shown = [state_of(c, d) for c, d in zip(model.C, model.D, strict=True)]
    if {*shown} != {*range(len(model.states))}:
        return []
    names = [model.outputs[shown.index(i)] for i in range(len(model.states))]
    held = {name for name, given in model.params if not isinstance(given, Free)}
    found = list[tuple[Key, Term]]()
    for i, (a, b) in enumerate(zip(model.A, model.B, strict=True)):
        columns = zip((*model.inputs, *model.states), (*model.inputs, *names), (*b, *a), strict=True)
        for own, x, entry in columns:
            if entry == 0:
                found.append((("term", model.states[i], own), (names[i], x, 0)))
            elif own != model.states[i] and held.issuperset(names_in(((entry,),))):
                found.append((("numbers",), (names[i], x, 0)))
    return found


@dataclass(frozen=True)
class Lines:
    """Residuals, columns and what ends add of each record, parameters first among the columns."""

    parts: Sequence[tuple[C128, C128, C128]]
    size: int

    def settled(self, changes: list[int], cov: F64) -> tuple[float, float, F64]:
        """The same as `step` in rounds of the covariance."""
        found = self.step(changes, cov)
        for _ in range(ROUNDS - 1):
            found = self.step(changes, found[2])
        return found

    def step(self, changes: list[int], cov: F64) -> tuple[float, float, F64]:
        """log det of the covariance of what parameters and changes leave, the last one's size, it."""
        try:
            factor: Any = np.linalg.cholesky(cov)
        except np.linalg.LinAlgError:
            return inf, 0.0, cov
        columns, e = self._whitened(factor, changes)
        by, *_ = np.linalg.lstsq(columns.T, e, rcond=None)
        left = (e - by @ columns).reshape(-1, len(factor)).T
        cov = factor @ (left @ left.T / left.shape[1]) @ factor.T
        sign, size = np.linalg.slogdet(cov)
        return (float(size) if sign > 0 else inf), float(by[-1]) if by.size else 0.0, cov

    def _whitened(self, factor: F64, changes: list[int]) -> tuple[F64, F64]:
        """Columns and residual in unit noise without what ends explain, outputs of one line side by side."""
        inverse: Any = np.linalg.inv(factor)
        chosen = [*range(self.size), *changes]
        found = []
        for e, columns, ends in self.parts:
            basis: Any = _real(ends, inverse).T
            q = np.linalg.qr(basis)[0]
            rows = _real(np.concatenate([columns[chosen], e[None]]), inverse)
            found.append(rows - (rows @ q) @ q.T)
        every = np.concatenate(found, axis=1)
        return every[:-1], every[-1]


def _real(rows: Any, inverse: F64) -> F64:
    """Whitened rows (row, output, line) with real and imaginary parts of a line one after the other."""
    turned = np.einsum("ij,rjl->rli", inverse, rows)
    return np.concatenate([turned.real, turned.imag], axis=1).reshape(len(rows), -1)
