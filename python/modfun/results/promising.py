"""Which terms more of equations are worth a fit: how much a step with each explains of residual lines."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .._core import coefficients
from ..base.arrays import C128, F64
from ..base.cached import kept
from ..errors import ModfunError
from ..language.evaluate import function_of
from ..records.corners import driving
from ..records.record import Record
from .estimates import Estimates
from .linear_lines import tape_values
from .worth import Key, Lines

__all__ = ["promising"]

MOST = 20  # terms that are fitted, the most promising ones: of wrong models that none mends steps tell less
SIGNAL = re.compile(r"([A-Za-z_]\w*)('*)")
POWER = re.compile(r"([A-Za-z_]\w*)(?:\*\*2)?\*\1'")  # times the rate: a derivative of the next power


def promising(fit: Estimates, keys: Sequence[Key]) -> set[Key]:
    """The terms among changes that are worth a fit; all of them where their lines do not tell.

    One Gauss-Newton step of the parameters and of the coefficient from the estimate, on the lines of the
    equations' residuals over what noise of the outputs makes of them there.
    """
    terms = [key for key in dict.fromkeys(keys) if key[:1] == ("term",)]
    falls = _falls(fit, tuple(terms)) if len(terms) > MOST else {}
    return {*sorted(falls, key=lambda key: -falls[key])[:MOST]} if falls else {*terms}


@kept
def _falls(fit: Estimates, terms: tuple[Key, ...]) -> dict[Key, float]:
    """By how much log det of the noise's covariance falls with each term; empty where lines do not tell."""
    records = getattr(fit, "unfolded", ()) or fit.records or ()
    if not records or any(rec.dt is None or rec.mask is not None for rec in records) or fit.with_past:
        return {}
    try:
        with np.errstate(all="ignore"):
            parts = [_part(fit, rec, k, terms) for k, rec in enumerate(records)]
    except (ModfunError, ArithmeticError, np.linalg.LinAlgError, KeyError, NameError, TypeError, ValueError):
        return {}  # of samples without a value, or functions that this does not read
    if not all(np.isfinite(own).all() for part in parts for own in part):
        return {}
    size, start = fit.params.size, np.eye(len(parts[0][0]))
    lines = Lines(parts, size)
    before = lines.settled([], start)[0]
    falls = {key: before - lines.settled([size + at], start)[0] for at, key in enumerate(terms)}
    return falls if np.isfinite(before) else {}


def _part(fit: Any, rec: Record, k: int, terms: Sequence[Key]) -> tuple[C128, C128, C128]:
    """Residuals (equation, line), columns (column, equation, line) and what ends add, in unit noise."""
    from ..equations.symbolic.sampled import sampled as signals_of

    layout: Any = fit.layout
    formulas, words, params = layout.formulas, layout.formulas.words, fit.params
    low, high = max(fit.lines[k][0], 1), fit.lines[k][1]
    equations, count = len(layout.orders), len(words["signals"])
    s = 1j * fit.omega0[k] * np.arange(low, high + 1)
    powers = s ** np.arange(max(layout.orders) + 3)[:, None]
    u = driving(rec, fit.options.rule)
    start = rec.intervals - fit.intervals[k]
    levels = fit.levels[k]

    def lines(rows: Sequence[F64], kinds: Sequence[str], late: Sequence[float]) -> C128:
        steps = [delay / (rec.dt or 1.0) for delay in late]
        return coefficients(np.ascontiguousarray(rows), high, kinds, steps, start, None)[:, low:]

    sampled = signals_of(formulas, formulas.rows(rec.y, u, rec.t, record=k), levels, params)
    late = [delay if p is None else float(params[p]) for _, delay, p in words["signals"]]
    kinds = [own[k if len(own) > 1 else 0] for own, _, _ in words["signals"]]
    v = lines(sampled[:count], kinds, late)
    values = tape_values(words["coefficients"], params.tolist())
    g = np.array(values[: len(words["terms"])])
    e, columns = np.zeros((equations, s.size), complex), np.zeros((params.size, equations, s.size), complex)
    into: dict[int, list[tuple[int, int]]] = {}
    for slope_of, p, j in words["signal_slopes"]:
        into.setdefault(slope_of, []).append((p, j))
    for own, (equation, j, order) in zip(g, words["terms"], strict=True):
        e[equation] += own * powers[order] * v[j]
        for p, at in into.get(j, ()):
            columns[p, equation] += own * powers[order] * v[at]
        if (p := words["signals"][j][2]) is not None:
            columns[p, equation] -= own * powers[order + 1] * v[j]
    for (term, p), slope in zip(words["slopes"], values[len(g) :], strict=True):
        equation, j, order = words["terms"][term]
        columns[p, equation] += slope * powers[order] * v[j]
    if less := getattr(fit, "less", ()):
        e -= lines(less[k], [fit.options.rule] * equations, [0.0] * equations)
    more = np.zeros((len(terms), equations, s.size), complex)
    for own, (_, equation, term) in zip(more, terms, strict=True):
        order, row, kind = _signal(fit, rec, u, term)
        own[int(equation)] = powers[order] * lines([row], [kind], [0.0])[0]
    ends = np.array(
        [
            [powers[j] * (row == equation) / abs(powers[j, -1]) for row in range(equations)]
            for equation, order in enumerate(layout.orders)
            for j in range(order + 1)
        ]
    )
    if getattr(fit, "trend", None) == "linear":
        ends = np.concatenate([ends, np.eye(equations)[:, :, None] / powers[1]])
    white = _whitener(words, g, sampled, powers, levels)
    return (
        np.einsum("lij,jl->il", white, e),
        np.einsum("lij,cjl->cil", white, np.concatenate([columns, more])),
        np.einsum("lij,cjl->cil", white, ends),
    )


def _whitener(words: dict[str, Any], g: F64, sampled: Sequence[F64], powers: C128, levels: F64) -> C128:
    """What makes unit noise of the equations, (line, equation, equation), by means of the noise's slopes."""
    equations, count = len(words["orders"]), len(words["signals"])
    total: C128 = np.zeros((powers.shape[1], equations, equations), complex)
    for channel, level in enumerate(levels):
        slopes = {
            j: sampled[count + at] for at, (j, own) in enumerate(words["sensitivities"]) if own == channel
        }
        at = [term for term, (_, j, _) in enumerate(words["terms"]) if j in slopes]
        rows = np.array([slopes[words["terms"][term][1]] for term in at])
        common = rows @ rows.T / max(rows.shape[-1], 1) if at else np.zeros((0, 0))
        gains = np.zeros((equations, len(at), powers.shape[1]), complex)
        for place, term in enumerate(at):
            equation, _, order = words["terms"][term]
            gains[equation, place] = level * g[term] * powers[order]
        total += np.einsum("eal,ab,fbl->lef", gains, common, gains.conj())
    return np.asarray(np.linalg.inv(np.linalg.cholesky(total)), dtype=np.complex128)


def _signal(fit: Estimates, rec: Record, u: F64, term: str) -> tuple[int, F64, str]:
    """A term as a derivative of a signal, in samples, and how these stand for it."""
    channels = dict(zip((*fit.outputs, *fit.inputs), (*rec.y, *u), strict=True))
    rule = fit.options.rule
    if found := SIGNAL.fullmatch(term):
        name = found[1]
        word = fit.intersample[fit.inputs.index(name)] if name in fit.inputs else "smooth"
        return len(found[2]), channels[name], rule if word == "smooth" else word
    if found := POWER.fullmatch(term):
        power = term.count("**2") + 2
        return 1, channels[found[1]] ** power / power, rule
    function: Callable[..., Any] = function_of(term, [*channels])
    return 0, np.broadcast_to(np.asarray(function(channels), dtype=float), rec.t.shape), rule
