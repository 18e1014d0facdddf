"""Windows of a stream that are forgotten: their weights, and what these do to a fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import ceil, exp, log

import numpy as np

from ..errors import SpecError
from ..results.fit import Fit

__all__ = ["loss", "unweighted", "weights_of"]

LEAST = 0.01  # weight of a window that is no longer remembered
MOST = 50  # windows remembered


def weights_of(window: float, forgetting: float | None) -> tuple[float, ...]:
    """Weights of windows back in time, down to LEAST."""
    if forgetting is None:
        return (1.0,)
    count = -log(LEAST) * forgetting / window
    if count <= 1:
        raise SpecError(
            f"Stream: forgetting={forgetting:g} s leaves nothing of the windows before the last one, "
            f"{window:g} s; leave it out, or take shorter windows"
        )
    if count > MOST:
        raise SpecError(
            f"Stream: forgetting={forgetting:g} s would keep {count:.3g} windows of {window:g} s, at most "
            f"{MOST} are kept; give longer windows"
        )
    return tuple(exp(-k * window / forgetting) for k in range(ceil(count)))


def unweighted(fit: Fit, weights: Sequence[float]) -> Fit:
    """A fit of weighted windows with noise, residuals and errors as of the windows themselves.

    The samples of window k were multiplied by √w_k. With mean(w) = Σw/K its cost is that of noise mean(w) σ²;
    its degrees of freedom are those of the chi-square that fits a weighted sum of such.
    """
    if len(weights) == 1:
        return fit
    w = np.array(weights)
    mean, free = w.mean(), max(round(fit.df_resid * w.sum() ** 2 / (w.size * np.sum(w**2))), 1)
    return replace(
        fit,
        window_weights=tuple(weights),
        cost=fit.cost * free / (fit.df_resid * mean),
        df_resid=free,
        noise_cov=fit.noise_cov / mean,
        noise_scale=fit.noise_scale / mean,
        cov_nonrobust=fit.cov_nonrobust * loss(weights),
        cov_spectral=fit.cov_spectral * loss(weights),
        pieces=tuple(piece * (mean / one) ** 0.5 for piece, one in zip(fit.pieces, weights, strict=True)),
    )


def loss(weights: Sequence[float]) -> float:
    """What unequal weights of windows that tell alike cost: variance over that of equal weights."""
    w = np.array(weights)
    return float(w.size * np.sum(w**2) / w.sum() ** 2)
