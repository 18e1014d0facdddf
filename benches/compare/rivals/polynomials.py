"""Polynomials of Box and Muller's transform, ascending, right to 2e-10: enough for noise."""

import numpy as np


def _fitted(f, low, high, degree):
    """Ascending coefficients of a polynomial near the best one on an interval."""
    return tuple(
        np.polynomial.Chebyshev.interpolate(f, degree, (low, high))
        .convert(kind=np.polynomial.Polynomial)
        .coef
    )


def _log_rest(f):
    """(log(1 + f) - f + f²/2)/f³, by its series near 0."""
    k = np.arange(60)[:, None]
    series = np.sum((-1.0) ** k * f**k / (k + 3), axis=0)
    with np.errstate(all="ignore"):
        return np.where(np.abs(f) < 0.3, series, (np.log1p(f) - f + f * f / 2) / f**3)


ROOT = np.sqrt(0.5)
LOG = _fitted(_log_rest, ROOT - 1, 2 * ROOT - 1, 9)
SIN = _fitted(lambda x: np.sinc(np.sqrt(x) / np.pi), 1e-18, (np.pi / 4) ** 2, 4)
COS = _fitted(lambda x: np.cos(np.sqrt(x)), 0.0, (np.pi / 4) ** 2, 4)
