"""Residuals of a response at all samples that follow their neighbours, as what a model misses does."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..records.record import Record
from .sample_levels import rounding_noise

__all__ = ["following_p", "follows"]

SURE = 1e-4  # p-value below which neighbours agree beyond doubt


def follows(fit: Any) -> str:
    """That residuals of a response follow each other beyond doubt, in words; empty where they do not."""
    p = float(getattr(fit, "follow_p", float("nan")))
    return f"follow each other from sample to sample (p = {p:.2g})" if p < SURE else ""


def following_p(records: Sequence[Record], left: Sequence[F64], weights: Iterable[F64]) -> float:
    """Probability that neighbouring residuals of noise without memory agree so much; the least over outputs.

    Lines of a slow response are few, and the high band scatters by itself. Products of neighbours have a mean
    of zero, or less after least squares, and add up to a normal sum on the scale of their own squares,
    whatever the law and the change of the noise.

    Where a signal passes slowly from one step of coarsely rounded samples to the next, errors of the rounding
    follow each other, too. Noise of standard deviation s below steps q takes exp(-(2 pi s/q)^2) of their
    covariance, q^2/12 at most, away (the first harmonic of a sawtooth, seen through the noise twice).

    Parameters
    ----------
    records : sequence of Record
    left : sequence of (output, time) arrays
        Residuals in units of the noise of the samples that count, 0 of others.
    weights : iterable of (output, time) arrays
        Of the samples in the residuals, for their rounding.

    References
    ----------
    B. Widrow, I. Kollar, Quantization noise, Cambridge University Press 2008, chapters 4 and 9.
    """
    from scipy.special import ndtr

    total, square = np.zeros(len(left[0])), np.zeros(len(left[0]))
    for rec, own, weight in zip(records, left, weights, strict=True):
        products = own[:, 1:] * own[:, :-1]
        coarse = _of_rounding(rec, own, weight)
        total += np.sum(products - coarse[:, None] * weight[:, 1:] * weight[:, :-1], axis=1)
        square += np.sum(products**2, axis=1)
    if not np.all(square > 0):
        return float("nan")
    return min(1.0, len(total) * float(np.min(ndtr(-total / np.sqrt(square)))))


def _of_rounding(rec: Record, left: F64, weight: F64) -> Any:
    """Covariance of the errors of neighbouring samples that rounding makes in each output."""
    rounded = rounding_noise(rec) ** 2
    own = np.where(weight > 0, left / np.where(weight > 0, weight, 1.0), 0.0)
    # Between neighbours the noise shows and what is slow does not.
    seen = np.mean(np.diff(own, axis=1) ** 2, axis=1) / 2
    beside = np.maximum(seen - rounded, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(rounded > 0, rounded * np.exp(-((2 * np.pi) ** 2) * beside / (12 * rounded)), 0.0)
