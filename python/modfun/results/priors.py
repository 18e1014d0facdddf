"""What was known of parameters beforehand, and whether the records agree."""

from __future__ import annotations

from math import nan
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ..base.arrays import F64
    from .estimates import Estimates

__all__ = ["contradicted_priors", "distance", "known_beforehand", "shares"]

TOLD = 1e-10  # of a prior's variance: what the record must take from it to be heard
LEAST = 1e-3  # part of the residual variance that is noise in any case


def known_beforehand(fit: Estimates) -> list[str]:
    """Means and standard deviations beforehand, in words."""
    return [f"{fit.param_names[k]} = {mean:.6g} ± {sd:.4g}" for k, mean, sd in fit.layout.priors]


def distance(fit: Estimates) -> float:
    """Σ ((θ − mean)/sd)² over what was known: their part of −2 log likelihood."""
    return float(sum(((fit.params[k] - mean) / sd) ** 2 for k, mean, sd in fit.layout.priors))


def shares(fit: Estimates) -> tuple[F64, F64]:
    """What estimates take of the errors that the records alone would leave, and what errors of priors add.

    With B the information of records and priors, of which P is the priors' own, an error e of the records
    alone and an error p of the means are (1 − B⁻¹P) e + B⁻¹P p: the first matrix, and B⁻¹PB⁻¹.
    """
    both = np.nan_to_num(fit.cov_nonrobust)
    told = np.zeros(len(both))
    for k, _, sd in fit.layout.priors:
        told[k] = sd**-2
    pulled = both * told
    return np.eye(len(both)) - pulled, pulled @ both


def contradicted_priors(fit: Estimates) -> tuple[float, str]:
    """Probability that records which agree with all priors are so far from them, and the farthest one's name.

    nan where the records say nothing beside the priors, because these are far sharper.

    In directions in which the priors have variance 1 and the estimates p, at distances g from the means: the
    records alone have the variance p/(1 − p) and lie g/(1 − p) from the means. Their compromise raises the
    weighted sum of squares by Σ g² p/(1 − p), which does not count as noise.
    """
    if not fit.layout.priors:
        return nan, ""
    from scipy.special import fdtrc

    place, means, sds = (np.array(column) for column in zip(*fit.layout.priors, strict=True))
    with np.errstate(all="ignore"):  # of any numbers
        gaps: F64 = (fit.params[place] - means) / sds
        both = fit.cov_nonrobust[np.ix_(place, place)] / sds / sds[:, None]
    if not (np.isfinite(both).all() and np.isfinite(gaps).all()):
        return nan, ""
    p, vectors = np.linalg.eigh(both)
    heard = 1 - p > TOLD
    if not heard.any():
        return nan, ""
    p, squares = p[heard], (vectors.T @ gaps)[heard] ** 2
    noise = max(1 - float(np.sum(squares * p / (1 - p))) / fit.df_resid, LEAST)
    statistic = float(np.mean(squares / ((1 - p) * (1 - p + noise * p))))
    farthest = int(np.argmax(np.abs(gaps) / np.sqrt(np.maximum(1 - np.diag(both), TOLD))))
    return float(fdtrc(p.size, fit.df_resid, statistic)), fit.param_names[int(place[farthest])]
