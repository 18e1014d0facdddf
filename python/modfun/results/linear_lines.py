"""Lines of linear equations and state spaces: residuals, and columns of parameters, changes and ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from .._core import coefficients
from ..base.arrays import C128, F64
from ..models.noise import Noise
from ..records.corners import driving
from ..records.record import Record
from .estimates import Estimates

__all__ = [
    "Linear",
    "columns_of",
    "equation_lines",
    "linear_of",
    "lines_beside",
    "output_lines",
    "responses_of",
    "signal_lines",
    "straight",
    "tape_values",
    "testable",
    "with_levers",
]

FINE = 40  # samples per period of the highest line, beyond which kinks of held inputs are below the noise
FUNCTIONS = {"ln": "log"} | {name: name for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp")}
FUNCTIONS |= {name: name for name in ("sqrt", "abs")}


@dataclass(frozen=True)
class Linear:
    """Linear equations with numbers, Σ g s^k V = 0 on every line.

    Attributes
    ----------
    of : list of int
        Channel of each signal that moves, outputs first.
    rows : list of int
        Where it stands among the channels of the formulas.
    kinds : list of sequence of str
        How it is summed, in all records or in each.
    late : list of float
        Its delay, s.
    weights : ndarray, shape (1 + p + change, equation, order * signal)
        g, and its derivatives to parameters and to changes, which are how late each channel was recorded.
    """

    of: list[int]
    rows: list[int]
    kinds: list[Sequence[str]]
    late: list[float]
    weights: F64


def testable(fit: Estimates) -> bool:
    """Whether residuals of the outputs are those of noise on even samples."""
    noise, records = fit.options.noise, fit.records or ()
    return (
        not fit.layout.rational
        and (noise in ("output", "coloured") or (isinstance(noise, Noise) and noise.u is None))
        and fit.options.method in ("awls", "ml")
        and not (fit.with_past or fit.instrumented)
        and len(fit.row_names) == len(fit.outputs)
        and len(records) == len(fit.lines) > 0
        and all([rec.dt is not None and rec.mask is None and rec.sigma is None for rec in records])
        and all([level > 0 for level in fit.noise_cov.diagonal().tolist()])
    )


def straight(fit: Estimates) -> bool:
    """Whether no held inputs, or ones known at all times, leave kinks in outputs between their samples."""
    if _unfolded(fit):
        return True
    step = max([rec.dt or 0.0 for rec in fit.records or ()])
    held = any([rec.functions or "zoh" in rec.intersample for rec in fit.records or ()])
    return not (held and fit.band[1] * step * FINE > 2 * np.pi)


def linear_of(fit: Estimates) -> Linear | None:
    """The equations with their estimates; None where a signal is more than a channel."""
    layout: Any = fit.layout
    signals = _signals(layout)
    if signals is None:
        return None
    words, params, size = layout.formulas.words, fit.params.tolist(), fit.params.size
    of, rows, chosen = signals
    at = {j: place for place, j in enumerate(chosen)}
    values = tape_values(words["coefficients"], params)
    terms, shape = words["terms"], (len(layout.orders), max(layout.orders) + 2, len(of))
    weights = np.zeros((1 + size + len(fit.outputs) + len(fit.inputs), *shape))
    given = [words["signals"][j] for j in chosen]
    for (equation, j, order), value in zip(terms, values, strict=False):
        if j in at:
            weights[0, equation, order, at[j]] += value
            weights[1 + size + of[at[j]], equation, order + 1, at[j]] -= value
            if (p := given[at[j]][2]) is not None:
                weights[1 + p, equation, order + 1, at[j]] -= value
    for (term, p), slope in zip(words["slopes"], values[len(terms) :], strict=True):
        equation, j, order = terms[term]
        if j in at:
            weights[1 + p, equation, order, at[j]] += slope
    return Linear(
        of,
        rows,
        [kinds for kinds, _, _ in given],
        [delay if p is None else params[p] for _, delay, p in given],
        weights.reshape(*weights.shape[:2], -1),
    )


def with_levers(fit: Estimates, model: Linear, pairs: Sequence[tuple[int, int]]) -> Linear:
    """The equations with a lever as each change: output i shows a part of the derivative of output j, too."""
    kept = 1 + fit.params.size
    shape = (*model.weights.shape[1:2], -1, len(model.of))
    weights = np.zeros((kept + len(pairs), *model.weights[0].reshape(shape).shape))
    weights[:kept] = model.weights[:kept].reshape(kept, *weights.shape[1:])
    for own, (i, j) in zip(weights[kept:], pairs, strict=True):
        own[:, 1:, model.of.index(j)] = weights[0][:, :-1, model.of.index(i)]
    return replace(model, weights=weights.reshape(len(weights), weights.shape[1], -1))


def columns_of(fit: Estimates, model: Linear, k: int, exact: bool) -> F64 | None:
    """Columns (parameters, changes, residuals) of a record over its lines, without what its ends explain.

    Real parts of all outputs, line after line, then imaginary ones; None where the equations are singular.
    """
    outputs = len(fit.outputs)
    v, p, turned, powers, shapes = signal_lines(fit, model, k, exact)
    own = [(j, channel) for j, channel in enumerate(model.of) if channel < outputs]
    noise_cov = fit.noise_cov
    if fit.record_levels is not None:
        noise_cov = noise_cov * np.outer(fit.level_ratios[k], fit.level_ratios[k])
    try:
        factor = np.linalg.cholesky(noise_cov)
        whiten: Any = np.linalg.inv(p.transpose(2, 0, 1) @ factor).transpose(1, 2, 0)
    except np.linalg.LinAlgError:
        return None
    e = model.weights[0] @ (powers[:, None] * v).reshape(-1, v.shape[1])
    whitened = np.concatenate([(z := (whiten * e).sum(axis=1).ravel()).real, z.imag])
    if not np.isfinite(whitened).all():
        return None
    basis = _real(_ends(fit, whiten, shapes))
    basis /= np.sqrt(np.einsum("pn,pn->p", basis, basis))[:, None]
    q = np.linalg.qr(basis.T)[0]
    whitened -= q @ (q.T @ whitened)
    half = whitened.size // 2
    noise = factor @ (whitened[:half] + 1j * whitened[half:]).reshape(outputs, -1)
    for j, channel in own:
        v[j] -= turned[j] * noise[channel]
    found = model.weights[1:] @ (powers[:, None] * v).reshape(-1, v.shape[1])
    columns = _real((whiten[None] * found[:, None]).sum(axis=2))
    columns -= (columns @ q) @ q.T
    return np.concatenate([columns, whitened[None]])


def output_lines(fit: Estimates) -> list[tuple[C128, C128]] | None:
    """Residuals of the outputs (output, line) of each record, and what its ends add (column, output, line).

    None where equations are not linear, or singular.
    """
    model = linear_of(fit) if len(fit.outputs) and testable(fit) and straight(fit) else None
    found = []
    for k in range(len(fit.lines) if model else 0):
        assert model is not None
        v, p, _, powers, shapes = signal_lines(fit, model, k, exact=True)
        e = model.weights[0] @ (powers[:, None] * v).reshape(-1, v.shape[1])
        try:
            inverse: Any = np.linalg.inv(p.transpose(2, 0, 1)).transpose(1, 2, 0)
        except np.linalg.LinAlgError:
            return None
        found.append(((inverse * e).sum(axis=1), _ends(fit, inverse, shapes)))
    return found or None


def lines_beside(
    fit: Estimates, terms: Sequence[tuple[int | str, str, int]]
) -> list[tuple[C128, C128, C128]] | None:
    """Residuals of the outputs of each record, (output, line), columns of changes, and what its ends add.

    Columns are (change, output, line): of the parameters, of how late each channel was recorded, of a drift
    of each equation, and for each of `terms` of a derivative of a channel in an equation, which is that of an
    output's rate where it is given by name. None where equations are not linear, or singular. Kinks of held
    inputs are left in them.
    """
    model = linear_of(fit) if testable(fit) else None
    if model is None:
        return None
    channels, places = [*fit.outputs, *fit.inputs], {of: j for j, of in enumerate(model.of)}
    weights = model.weights.reshape(*model.weights.shape[:2], -1, len(model.of))
    rates = weights[0][:, 1, [places[k] for k in range(len(fit.outputs))]]
    more = np.zeros((len(terms), *weights.shape[1:]))
    for own, (where, x, order) in zip(more, terms, strict=True):
        rate = rates[:, channels.index(where)] if isinstance(where, str) else np.eye(len(rates))[where]
        equation = int(np.argmax(np.abs(rate)))
        if (at := places.get(channels.index(x))) is not None:
            own[equation, order, at] = rate[equation]
    every = np.concatenate([model.weights, more.reshape(len(terms), *model.weights.shape[1:])])
    found = []
    for k in range(len(fit.lines)):
        v, p, _, powers, shapes = signal_lines(fit, model, k, exact=False)
        rows = every @ (powers[:, None] * v).reshape(-1, v.shape[1])
        try:
            inverse: Any = np.linalg.inv(p.transpose(2, 0, 1)).transpose(1, 2, 0)
        except np.linalg.LinAlgError:
            return None
        rows = np.einsum("oel,cel->col", inverse, rows)
        drift = inverse.transpose(1, 0, 2) / shapes[1]
        columns = np.concatenate(
            [rows[1 : rows.shape[0] - len(terms)], drift, rows[len(rows) - len(terms) :]]
        )
        found.append((rows[0], columns, _ends(fit, inverse, shapes)))
    return found


def equation_lines(fit: Estimates) -> list[C128] | None:
    """Residuals of linear equations (equation, line) of each record over what noise of the high band makes.

    Without what ends of the records add. None where equations are not linear, times are uneven, or no noise
    is seen.
    """
    model, levels = linear_of(fit), fit.high_band_levels
    if any(rec.dt is None for rec in fit.records or ()):
        return None
    if model is None or len(levels) != len(fit.outputs) or not np.all(levels > 0):
        return None
    found = []
    for k in range(len(fit.lines)):
        v, p, _, powers, shapes = signal_lines(fit, model, k, exact=False)
        e = model.weights[0] @ (powers[:, None] * v).reshape(-1, v.shape[1])
        noise = np.sqrt(np.einsum("eol,o->el", np.abs(p) ** 2, levels**2) / fit.intervals[k])
        for row, (own, order) in enumerate(zip(noise, fit.layout.orders, strict=True)):
            q = np.linalg.qr(_real((shapes[: order + 1] / own)[:, None]).T)[0]
            both = _real((e[row] / own)[None, None])[0]
            both -= q @ (q.T @ both)
            e[row] = both[: own.size] + 1j * both[own.size :]
        found.append(e)
    return found


@lru_cache(32)
def _signals(layout: Any) -> tuple[list[int], list[int], list[int]] | None:
    """Channels of signals that move, their rows among the formulas' channels, and which signals these are."""
    formulas, found = layout.formulas, list[tuple[int, int, int]]()
    if formulas.words["signal_slopes"] or tuple(formulas.noisy) != layout.outputs:
        return None
    operations, results = formulas.words["formulas"]
    for j, result in enumerate(results[: len(formulas.words["signals"])]):
        name, _, row, _ = operations[result]
        if name == "constant":
            continue  # nothing on lines but line 0
        if name != "input" or row >= len(formulas.channels):
            return None
        channel = formulas.channels[row]
        if channel.late or channel.kind not in ("output", "input", "held"):
            return None
        found.append((channel.of + (0 if channel.kind == "output" else len(layout.outputs)), row, j))
    of, rows, chosen = (list(part) for part in zip(*found, strict=True))
    return of, rows, chosen


def tape_values(tape: tuple[Any, Sequence[int]], params: Sequence[float]) -> list[float]:
    """What a tape makes of parameters; nan where it holds a function that coefficients rarely have."""
    found: list[float] = []
    operations, results = tape
    for name, value, a, b in operations:
        if name == "constant":
            found.append(value)
        elif name == "input":
            found.append(params[a])
        elif name == "add":
            found.append(found[a] + found[b])
        elif name == "multiply":
            found.append(found[a] * found[b])
        elif name == "divide" and found[b]:
            found.append(found[a] / found[b])
        elif name == "whole" and (found[a] or value > 0):
            found.append(found[a] ** int(value))
        else:
            found.append(float(getattr(np, FUNCTIONS[name])(found[a])) if name in FUNCTIONS else float("nan"))
    return [found[at] for at in results]


def signal_lines(
    fit: Estimates, model: Linear, k: int, exact: bool
) -> tuple[C128, C128, list[Any], C128, C128]:
    """Signals (signal, line) of a record, P (equation, output, line), turns by delays, and `_powers`."""
    rec: Any = (_unfolded(fit) or fit.records or ())[k]
    layout: Any = fit.layout
    low, high = max(fit.lines[k][0], 1), fit.lines[k][1]
    outputs = len(fit.outputs)
    powers, shapes = _powers(low, high, fit.omega0[k], max(layout.orders) + 2)
    u = driving(rec, fit.options.rule) if exact or rec.functions else rec.u
    rows = layout.formulas.rows(rec.y, u, rec.t, record=k)[model.rows]
    kinds = [kinds[k if len(kinds) > 1 else 0] for kinds in model.kinds]
    delays = [late / rec.dt for late in model.late]
    start = rec.intervals - fit.intervals[k]
    v = coefficients(np.ascontiguousarray(rows), high, kinds, delays, start, None)[:, low:]
    turned, sums = _sums(fit, model, powers)
    return v, sums[:, :outputs], turned, powers, shapes


def responses_of(fit: Estimates, model: Linear, k: int, low: int, high: int) -> C128:
    """What each input makes of each output on lines of a record, (output, input, line)."""
    powers, _ = _powers(low, high, fit.omega0[k], max(fit.layout.orders) + 2)
    sums = _sums(fit, model, powers)[1].transpose(2, 0, 1)
    outputs = len(fit.outputs)
    found = -np.linalg.solve(sums[:, :, :outputs], sums[:, :, outputs:])
    return np.asarray(found.transpose(1, 2, 0))


def _sums(fit: Estimates, model: Linear, powers: C128) -> tuple[list[Any], C128]:
    """Turns by delays, and what stands before each channel in each equation, (equation, channel, line)."""
    turned = [np.exp(-powers[1] * late) if late else 1.0 for late in model.late]
    each = model.weights[0].reshape(len(fit.outputs), len(powers), -1).transpose(0, 2, 1) @ powers
    sums = np.zeros((len(fit.outputs), len(fit.outputs) + len(fit.inputs), powers.shape[1]), complex)
    for j, channel in enumerate(model.of):
        sums[:, channel] += each[:, j] * turned[j]
    return turned, sums


def _ends(fit: Estimates, whiten: C128, shapes: C128) -> C128:
    """What ends of a record and a drift add, (column, output, line).

    A derivative more than the equations have is that of a channel's shift.
    """
    layout: Any = fit.layout
    ends = [whiten[:, row] * shapes[j] for row, order in enumerate(layout.orders) for j in range(order + 1)]
    if fit.trend == "linear":
        ends += [whiten[:, row] / shapes[1] for row in range(len(fit.outputs))]
    return np.array(ends)


def _unfolded(fit: Any) -> tuple[Record, ...]:
    """Records without what sampling folds into lines under held inputs, of fits that took it out."""
    found: tuple[Record, ...] = fit.unfolded
    return found


@lru_cache(32)
def _powers(low: int, high: int, omega0: float, count: int) -> tuple[C128, C128]:
    """Powers of s on lines, (power, line), and the same with 1 at the highest line."""
    s = 1j * omega0 * np.arange(low, high + 1)
    powers = np.asarray(s ** np.arange(count)[:, None], dtype=np.complex128)
    return powers, np.asarray(powers / np.abs(powers[:, -1:]))


def _real(rows: C128) -> F64:
    """Real parts and imaginary parts of (row, output, line), side by side."""
    flat = rows.reshape(len(rows), -1)
    return np.concatenate([flat.real, flat.imag], axis=1)
