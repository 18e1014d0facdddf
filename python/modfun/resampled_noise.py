"""Noise for the bootstrap: normal samples of the fit's level, or its residuals with their phases drawn."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from . import _core
from .errors import DataError, SpecError
from .records import Record
from .results import Fit
from .simulation import _spectrum
from .validation import trend_columns

__all__ = ["Noise", "white", "wild"]

F64 = NDArray[np.float64]
C128 = NDArray[np.complex128]
# Noise of a replicate, by its number: an array a record.
Noise = Callable[[int], list[F64]]
LEAST = 1e-4  # of the largest |A|: the floor of the fit's own weights


def white(fit: Fit, records: tuple[Record, ...], clean: list[F64], seed: int) -> Noise:
    """Independent normal samples of the noise level that the fit found."""
    if fit.options.noise != "output":
        raise SpecError(
            f"bootstrap: kind='parametric' draws noise on the output and the fit has noise="
            f"{fit.options.noise!r}; use kind='wild', which assumes no colour"
        )
    sigma = fit.sigma
    if fit.options.method not in ("awls", "ml"):
        errors = [rec.y[0] - y for rec, y in zip(records, clean, strict=True)]
        nuisance = fit.order + len(trend_columns(records[0].t, fit.trend))
        freedom = sum(e.size for e in errors) - fit.params.size - nuisance * len(records)
        sigma = float(np.sqrt(sum(e @ e for e in errors) / freedom))

    def draw(replicate: int) -> list[F64]:
        return [
            sigma * _core.normals(seed, "bootstrap", 0, replicate, k, y.size) for k, y in enumerate(clean)
        ]

    return draw


def wild(fit: Fit, records: tuple[Record, ...], clean: list[F64], seed: int) -> Noise:
    """The residuals with each line of their spectrum turned by a random angle."""
    if any(rec.dt is None for rec in records):
        raise DataError(
            "bootstrap: kind='wild' needs the spectrum of the residuals and a record is sampled unevenly; "
            "resample it, or use kind='parametric'"
        )
    leads = [rec.intervals - used for rec, used in zip(records, fit.intervals, strict=True)]
    lines: list[C128] = []
    for rec, y, lead in zip(records, clean, leads, strict=True):
        e = (rec.y[0] - y)[lead:]
        ends = 0.5 * (e[0] + e[-1])  # one period on the record's own lines, its ends counted half each
        lines.append(np.fft.rfft(np.concatenate([[ends], e[1:-1]])))
    _unshrink(fit, records, clean, leads, lines)
    sizes = [np.abs(own) for own in lines]

    def draw(replicate: int) -> list[F64]:
        found = []
        for k, (size, period, lead) in enumerate(zip(sizes, fit.intervals, leads, strict=True)):
            z = _core.normals(seed, "bootstrap", 0, replicate, k, 2 * size.size)
            turn = z[::2] + 1j * z[1::2]
            turn[0] = turn[0].real  # real lines keep or change their sign
            if period % 2 == 0:
                turn[-1] = turn[-1].real
            e = np.fft.irfft(size * turn / np.abs(turn), period)
            found.append(np.concatenate([np.zeros(lead), e, e[:1]]))
        return found

    return draw


def _unshrink(
    fit: Fit, records: tuple[Record, ...], clean: list[F64], leads: list[int], lines: list[C128]
) -> None:
    """Give the lines of the fit's band, in place, the size of noise: e/(1 − h) as HC3 has it.

    The model's response is Y = (BU + T)/A, so the columns of its Jacobian are −sⁿ⁻ⁱY/A, s^k U/A, and a
    record s^j/A and the trend's. e is what the lines hold beside these, h the columns' leverage. Rows are
    weighted as the method weights; for "ls", whose rows are differences of lines, that is an approximation.
    """
    den, _ = fit.polynomials()
    n, p = fit.order, fit.params.size
    flat = fit.options.method in ("awls", "ml") and fit.options.noise == "output"
    blocks, sizes, errors, weights = [], [], [], []
    for k, (rec, y) in enumerate(zip(records, clean, strict=True)):
        low, high = fit.lines[k]
        ys, us = _spectrum(
            rec._like(y=y[None]), high, fit.options.rule, fit.layout.delays(fit.params), leads[k]
        )
        m = np.arange(high + 1)
        s = 1j * fit.omega0[k] * m
        a = np.polyval(den, s)
        a = np.where(np.abs(a) > LEAST * np.abs(a).max(), a, LEAST * np.abs(a).max())
        columns = [-(s ** (n - i)) * ys[0] / a for i in range(1, n + 1)]
        for u, degree in zip(us, fit.layout.numerators[0], strict=True):
            columns += [s**j * u / a for j in range(-1 if degree is None else degree, -1, -1)]
        trend = [m == 0, 1j / (2 * np.pi * np.maximum(m, 1))]  # spectra of 1 and of t/T − ½ (but for line 0)
        own = [*(s**j / a for j in range(n)), *trend[: len(trend_columns(rec.t, fit.trend))]]
        block = np.zeros((high + 1, p + len(own) * len(records)), complex)
        block[:, :p] = np.array(columns).T
        block[:, p + k * len(own) : p + (k + 1) * len(own)] = np.array(own).T
        weight = a / np.abs(a) if flat else a.copy()  # Re and Im of the equation's rows, as in HC3
        weight[0] *= np.sqrt(0.5)  # a real line has all of its variance in Re
        block *= weight[:, None]
        sizes.append(np.sum(np.abs(block) ** 2, axis=0))  # of all lines, left out or not
        blocks.append(block[low:])
        errors.append((lines[k][: high + 1] * weight)[low:])
        weights.append(weight[low:])
    whole = np.vstack(blocks) / np.sqrt(sum(sizes))
    q, singular, _ = np.linalg.svd(np.vstack([whole.real, whole.imag]), full_matrices=False)
    q = q[:, singular > 1e-10 * singular[0]]  # an offset lives on the line 0, which may be left out
    both = np.concatenate(errors)
    e = np.concatenate([both.real, both.imag])
    h = np.sum(q**2, axis=1)
    e = np.where(h < 1 - 1e-6, (e - q @ (q.T @ e)) / (1 - h), 0.0)  # a line taken whole has no say
    grown = (e[: both.size] + 1j * e[both.size :]) / np.concatenate(weights)
    ends = np.cumsum([len(block) for block in blocks])
    for line, part, (low, high) in zip(lines, np.split(grown, ends[:-1]), fit.lines, strict=True):
        line[low : high + 1] = part
