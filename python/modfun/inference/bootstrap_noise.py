"""Noise for the bootstrap: normal samples of the fit's level, or its residuals with their phases drawn."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .._core import normal_rows
from ..base.arrays import C128, F64
from ..errors import DataError, SpecError
from ..models.noise import Noise
from ..models.transfer_function import TransferFunction
from ..records.mask import refuse_own_noise
from ..records.record import Record
from ..responses.coefficients import spectrum
from ..results.diagnosis import level_p, worst_colour
from ..results.doubts import noise_free
from ..results.fit import Fit
from ..results.initial_state import slopes
from ..results.misfit import UNLIKELY
from ..results.prediction import InitialState
from ..results.regression import trend_columns
from ..results.uneven_noise import changing

__all__ = ["Draw", "chosen", "jacobian_lines", "levels_in_time", "white", "wild"]

Simulated = tuple[F64, InitialState]
# Noise of replicates, by their numbers: an array (replicate, output, time) a record.
Draw = Callable[[range], list[F64]]
Levels = list[F64] | None  # of noise that changes over each record, (output, time)
LEAST = 1e-4  # of the largest |A|: the floor of the fit's own weights


def chosen(fit: Fit, records: tuple[Record, ...]) -> tuple[str, str]:
    """The kind that the noise of a fit asks for, and why."""
    if _of_colour(fit):
        return "wild", "the fit's noise is coloured"
    alike = all(rec.dt is not None and rec.mask is None and rec.sigma is None for rec in records)
    coloured = worst_colour(fit)[0].p_value < UNLIKELY
    p = level_p(fit)
    if alike and not fit.with_past:
        if coloured:
            return "wild", "the residual lines are not of one level over the band"
        if min(p, 1 - p) < UNLIKELY:  # of a short band, whose lines alone hardly show a colour
            return "wild", "the residual lines are not of the level of the high band"
        return "parametric", "the residual lines are of one level"
    why = "the wild kind needs even samples that count alike, and no past"
    if coloured or p < UNLIKELY:
        why += "; the residual lines are not of one level, so intervals may be too narrow"
    return "parametric", why


def levels_in_time(fit: Fit, records: tuple[Record, ...]) -> Levels:
    """Level of the noise of each record (output, time) over its own root mean square; None if it is even."""
    found = None if fit.with_past or noise_free(fit) is not None else changing(fit)
    if found is None:
        return None
    shapes = []
    for rec, level in zip(records, found.levels(), strict=True):
        lead = rec.intervals - level.shape[1]  # before the lines of the fit, and the last sample behind them
        level = level / np.sqrt(np.mean(level**2, axis=1, keepdims=True))
        shapes.append(np.pad(level, ((0, 0), (lead, 1)), mode="edge"))
    return shapes


def white(
    fit: Fit, records: tuple[Record, ...], found: list[Simulated], seed: int, levels: Levels = None
) -> Draw:
    """Independent normal samples of the noise covariance that the fit found, times the records' sigma.

    Where the noise changes over a record, times its level in time. Of log-normal noise they are those of
    the logarithms.
    """
    clean = [y for y, _ in found]
    noise = fit.options.noise
    _refuse_noisy_inputs(fit)
    if _of_colour(fit):
        said = repr(noise) if isinstance(noise, str) else "noise given as spectra"
        raise SpecError(
            f"bootstrap: kind='parametric' draws white noise on the outputs and the fit has noise={said}; "
            "use kind='wild', which assumes no colour"
        )
    root = _root(fit.noise_cov)
    if fit.options.method not in ("awls", "ml"):
        errors = [rec.y - y for rec, y in zip(records, clean, strict=True)]
        nuisance = fit.order + len(trend_columns(records[0].t, fit.trend))
        freedom = sum(e.shape[1] for e in errors) - fit.params.size - nuisance * len(records)
        root = np.diag(np.sqrt(sum(np.sum(e**2, axis=1) for e in errors) / freedom))

    over = fit.level_ratios[:, :, None]

    def draw(block: range) -> list[F64]:
        drawn = []
        for k, (y, rec) in enumerate(zip(clean, records, strict=True)):
            z = normal_rows(seed, "bootstrap", 0, block.start, k, len(block), y.size).reshape(-1, *y.shape)
            # Megabytes are written where they stand.
            e = np.multiply(root, z, out=z) if root.size == 1 else root @ z
            if fit.options.method in ("awls", "ml"):
                e *= over[k]
            if levels is not None:
                e *= levels[k]
            if rec.sigma is not None:
                e *= rec.sigma
            drawn.append(y * np.expm1(e) if noise == "log-normal" else e)
        return drawn

    return draw


def wild(
    fit: Fit, records: tuple[Record, ...], found: list[Simulated], seed: int, levels: Levels = None
) -> Draw:
    """The residuals with each line of their spectrum turned by a random angle, the same for all outputs.

    Where the noise changes over a record, these lines are those of the residuals over its level in time, by
    which the result is multiplied.
    """
    _refuse_noisy_inputs(fit)
    for rec in records:
        refuse_own_noise(
            rec,
            "bootstrap: kind='wild'",
            "use kind='parametric', or pieces without them, rec.window(start, stop)",
        )
    if any(rec.dt is None for rec in records):
        raise DataError(
            "bootstrap: kind='wild' needs the spectrum of the residuals and a record is sampled unevenly; "
            "resample it, or use kind='parametric'"
        )
    if fit.with_past:
        raise SpecError(
            "bootstrap: kind='wild' needs lines of the records alone, and the fit's are those of the records "
            "and their past; use kind='parametric'"
        )
    leads = [rec.intervals - used for rec, used in zip(records, fit.intervals, strict=True)]
    lines = [_lines(rec.y - y, lead) for rec, (y, _), lead in zip(records, found, leads, strict=True)]
    if isinstance(fit.structure, TransferFunction):
        _unshrink(fit, records, [y for y, _ in found], leads, lines)
    else:
        _unshrink_equations(fit, records, [initial for _, initial in found], leads, lines)
    shapes = [_over_period(*own) for own in zip(levels, leads, strict=True)] if levels else []
    for k, shape in enumerate(shapes):
        lines[k] = np.fft.rfft(np.fft.irfft(lines[k], fit.intervals[k]) / shape)

    def draw(block: range) -> list[F64]:
        found = []
        for k, (line, period, lead) in enumerate(zip(lines, fit.intervals, leads, strict=True)):
            z = normal_rows(seed, "bootstrap", 0, block.start, k, len(block), 2 * line.shape[1])
            turn = z.view(complex)[:, None]
            turn[..., 0] = turn[..., 0].real  # real lines keep or change their sign
            if period % 2 == 0:
                turn[..., -1] = turn[..., -1].real
            e = np.fft.irfft(line * turn / np.abs(turn), period)
            if shapes:
                e *= shapes[k]
            found.append(np.concatenate([np.zeros((*e.shape[:2], lead)), e, e[..., :1]], axis=-1))
        return found

    return draw


def _refuse_noisy_inputs(fit: Fit) -> None:
    noise = fit.options.noise
    if noise == "errors-in-variables" or (isinstance(noise, Noise) and noise.u is not None):
        raise SpecError(
            "bootstrap: the fit has noisy inputs, and a replicate would need them without their noise, which "
            "is unknown; use fit.bse, or an mf.MonteCarlo of fit.model with inputs of your choice"
        )


def _of_colour(fit: Fit) -> bool:
    """Whether the fit takes its noise to be coloured, which white samples are not."""
    noise = fit.options.noise
    given = isinstance(noise, Noise) and _coloured(noise.y)
    return bool(fit.options.drives) or noise in ("equation", "coloured") or given


def _coloured(given: object) -> bool:
    return callable(given) or (isinstance(given, tuple) and any(callable(one) for one in given))


def _root(cov: F64) -> F64:
    """The symmetric root of a covariance, kept from being singular."""
    if cov.size == 1:
        return np.asarray(np.sqrt(cov))
    values, vectors = np.linalg.eigh(cov)
    return np.asarray((vectors * np.sqrt(np.maximum(values, 1e-12 * values[-1]))) @ vectors.T)


def _unshrink(
    fit: Fit, records: tuple[Record, ...], clean: list[F64], leads: list[int], lines: list[C128]
) -> None:
    """Give the lines of the fit's band, in place, the size of noise: e/(1 − h) as HC3 has it.

    e is what the lines hold beside the columns of the responses' Jacobian, of the end conditions and of the
    trend, h these columns' leverage. Rows are weighted as the method weights for white noise; for "ls",
    whose rows are differences of lines, and for coloured noise that is an approximation.
    """
    p, outputs = fit.params.size, len(fit.outputs)
    flat = fit.options.method in ("awls", "ml") and fit.options.noise != "equation"
    whiten = np.eye(1) if outputs == 1 else np.linalg.inv(_root(fit.noise_cov))
    blocks, sizes, errors, weights = [], [], [], []
    for k, (rec, y) in enumerate(zip(records, clean, strict=True)):
        low, high = fit.lines[k]
        shared, own, a = jacobian_lines(fit, rec._like(y=y), high, leads[k], fit.omega0[k])
        terms = own.shape[0] * outputs
        block = np.zeros((outputs, high + 1, p + terms * len(records)), complex)
        block[:, :, :p] = shared.transpose(1, 2, 0)
        for i in range(outputs):
            first = p + k * terms + i * own.shape[0]
            block[i, :, first : first + own.shape[0]] = own[:, i].T
        # Re and Im of the equation's rows, as in HC3; a real line has all of its variance in Re.
        before, after = (np.ones(a.shape), a / np.abs(a)) if flat else (a, np.ones(a.shape))
        after = after * np.where(np.arange(high + 1) == 0, np.sqrt(0.5), 1.0)
        weight = after[:, None] * (whiten / fit.level_ratios[k])[:, :, None] * before  # (row, output, line)
        block = np.einsum("rom,omc->rmc", weight, block)
        sizes.append(np.sum(np.abs(block) ** 2, axis=(0, 1)))  # of all lines, left out or not
        blocks.append(block[:, low:].reshape(-1, block.shape[2]))
        errors.append(np.einsum("rom,om->rm", weight, lines[k][:, : high + 1])[:, low:].ravel())
        weights.append(weight[:, :, low:])
    stacked = np.vstack(blocks) / np.sqrt(sum(sizes))
    for line, part, weight, (low, high) in zip(
        lines, _grown(stacked, errors), weights, fit.lines, strict=True
    ):
        back = np.linalg.inv(weight.transpose(2, 0, 1))  # (line, output, row)
        line[:, low : high + 1] = np.einsum("mor,rm->om", back, part.reshape(outputs, -1))


def _grown(columns: C128, errors: list[C128]) -> list[C128]:
    """Errors e/(1 − h), h the leverage of the columns on Re and Im of each row."""
    q, singular, _ = np.linalg.svd(np.vstack([columns.real, columns.imag]), full_matrices=False)
    q = q[:, singular > 1e-10 * singular[0]]  # an offset lives on the line 0, which may be left out
    both = np.concatenate(errors)
    e = np.concatenate([both.real, both.imag])
    h = np.sum(q**2, axis=1)
    e = np.where(h < 1 - 1e-6, (e - q @ (q.T @ e)) / (1 - h), 0.0)  # a line taken whole has no say
    grown = e[: both.size] + 1j * e[both.size :]
    return np.split(grown, np.cumsum([one.size for one in errors])[:-1])


def _lines(e: F64, lead: int) -> C128:
    """Spectrum of signals (…, time): one period on the record's own lines, its ends counted half each."""
    e = e[..., lead:]
    ends = 0.5 * (e[..., :1] + e[..., -1:])
    return np.asarray(np.fft.rfft(np.concatenate([ends, e[..., 1:-1]], axis=-1)))


def _over_period(level: F64, lead: int) -> F64:
    """A level over the samples of which `_lines` are, the ends again half each."""
    own = level[:, lead:-1].copy()
    own[:, 0] = 0.5 * (own[:, 0] + level[:, -1])
    return own


def _unshrink_equations(
    fit: Fit, records: tuple[Record, ...], initial: list[InitialState], leads: list[int], lines: list[C128]
) -> None:
    """As `_unshrink`, for equations: the columns are the spectra of the responses' slopes."""
    p = fit.params.size
    columns = [
        _lines(slopes(fit, rec, own), lead) for rec, own, lead in zip(records, initial, leads, strict=True)
    ]
    width = p + sum(len(one) - p for one in columns)
    blocks, errors, at = [], [], p
    for column, line, (low, high), level in zip(columns, lines, fit.lines, fit.noise_levels, strict=True):
        half = np.where(np.arange(low, high + 1) == 0, np.sqrt(0.5), 1.0) / level[:, None]
        block = np.zeros((len(level), high - low + 1, width), complex)
        shaped = (column[:, :, low : high + 1] * half).transpose(1, 2, 0)
        block[:, :, :p], block[:, :, at : at + shaped.shape[2] - p] = shaped[:, :, :p], shaped[:, :, p:]
        at += shaped.shape[2] - p
        blocks.append(block.reshape(-1, width))
        errors.append((line[:, low : high + 1] * half).ravel())
    stacked: C128 = np.vstack(blocks)
    size = np.linalg.norm(stacked, axis=0)
    grown = _grown(np.asarray(stacked / np.where(size > 0, size, 1.0)), errors)
    for line, part, (low, high), level in zip(lines, grown, fit.lines, fit.noise_levels, strict=True):
        half = np.where(np.arange(low, high + 1) == 0, np.sqrt(0.5), 1.0) / level[:, None]
        line[:, low : high + 1] = part.reshape(len(level), -1) / half


def jacobian_lines(fit: Fit, rec: Record, high: int, lead: int, omega0: float) -> tuple[C128, C128, C128]:
    """Columns on the lines 0 to `high`: of the parameters (p, output, line), each output's own, and A.

    An output's response is Y = (BU + T)/A, so they are −sⁿ⁻ʲY/A, s^k U/A and, of a delay, −sBU/A; its own
    are s^j/A and the trend's.
    """
    layout = fit.layout
    m = np.arange(high + 1)
    s = 1j * omega0 * m
    trend = [m == 0, 1j / (2 * np.pi * np.maximum(m, 1))]  # spectra of 1 and of t/T − ½ (but for line 0)
    trend = trend[: len(trend_columns(rec.t, fit.trend))]
    late = {path: len(layout.free) + at for at, path in enumerate(layout.free_delays)}
    shared = np.zeros((fit.params.size, len(fit.outputs), m.size), complex)
    own = np.zeros((max(layout.orders) + len(trend), len(fit.outputs), m.size), complex)
    divisors = np.zeros((len(fit.outputs), m.size), complex)
    for i, n in enumerate(layout.orders):
        den, nums = fit.polynomials(i)
        ys, us = spectrum(rec, high, fit.options.rule, layout.delays(fit.params, i), lead)
        a = np.polyval(den, s)
        a = np.where(np.abs(a) > LEAST * np.abs(a).max(), a, LEAST * np.abs(a).max())
        divisors[i] = a

        def add(coefficient: int, column: C128, i: int = i) -> None:
            at = layout.positions[coefficient]
            if at is not None:  # not held
                shared[at, i] = column

        for j in range(1, n + 1):
            add(layout.places[0][i] + j - 1, -(s ** (n - j)) * ys[i] / a)
        for k, (degree, num, u) in enumerate(zip(layout.numerators[i], nums, us, strict=True)):
            if degree is None:
                continue
            for j in range(degree + 1):
                add(layout.places[1][i][k] + j, s ** (degree - j) * u / a)
            if layout.routes[i][k] in late:
                shared[late[layout.routes[i][k]], i] = -s * np.polyval(num, s) * u / a
        for k, column in enumerate([*trend, *(s**j / a for j in range(n))]):
            own[k, i] = column
    return shared, own, divisors
