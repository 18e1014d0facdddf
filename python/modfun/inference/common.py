"""What candidates of any kind are compared on: one band, and one noise level to count their cost in."""

from __future__ import annotations

from collections.abc import Iterable
from math import nan, sqrt
from typing import Any

import numpy as np

from ..records.record import Record
from ..results.diagnosis import high_band_df
from ..results.doubts import noise_free
from ..results.fit import Fit
from ..results.uneven_noise import UNEVEN, in_words, uneven

__all__ = ["change_of_noise", "contradicts", "levels", "same_samples", "widest"]

DOUBT = 1e-3  # two levels that white noise makes differ so much once in 1/DOUBT records are not of one noise


def widest(intervals: Iterable[int], omega0: Iterable[float]) -> float:
    """Upper edge of the wide band of the default rule that all records have, rad/s."""
    return min(max(n // 8, min(n // 4, 16)) * w for n, w in zip(intervals, omega0, strict=True))


def contradicts(ratio: float, df: float, high_df: float) -> bool:
    """Whether residuals of the largest candidate contradict the noise level of the high band.

    Parameters
    ----------
    ratio : float
        Variance of the residuals over that of the high band.
    df, high_df : float
        Their degrees of freedom.
    """
    from scipy.special import fdtr

    below = float(fdtr(df, high_df, ratio))
    return min(below, 1 - below) < DOUBT / 2


def levels(row: dict[str, Any], fit: Fit, finest: float) -> tuple[float, float, tuple[str, ...]]:
    """Noise level of the high band; the same pooled with a candidate's, nan where they disagree.

    The candidate that settled and leaves least: as a rule the largest, unless its search ended elsewhere.
    """
    high = fit.high_band_sigma
    if row["sigma"] < finest:
        text = (
            f"The least residuals of a candidate, {row['sigma']:.3g}, are finer than a thousandth of "
            f"the output and may be errors of the quadrature: candidates count as equal down to {finest:.3g}."
        )
        return high, finest, (text,)
    if not high > 0:
        return nan, nan, ("No empty high band tells the noise level: the criterion is BIC.",)
    free, df = high_band_df(fit), row["df_resid"]
    if contradicts((row["sigma"] / high) ** 2, df, free):
        text = (
            f"The high band says a noise level of {high:.3g}, the least residuals of a candidate "
            f"{row['sigma']:.3g}: the noise is not white, or no candidate is large enough. "
            "The criterion is BIC, and orders tend to be too high where the noise is coloured."
        )
        return high, nan, (text,)
    pooled = sqrt((df * row["sigma"] ** 2 + free * high**2) / (df + free))
    return high, pooled, (f"Noise level {pooled:.3g}, of the high band and the residuals together.",)


def change_of_noise(fits: Iterable[Fit]) -> tuple[str, ...]:
    """That the noise changes over the records, by the first candidate whose residuals can tell.

    Those of an unstable one may run away.
    """
    for fit in fits:
        found = uneven(fit)
        if found is None:
            continue
        if found.p_value > UNEVEN or noise_free(fit) is not None:
            break
        return (
            f"{in_words(fit, found)} Orders tend to be too high where the noise changes. Compare candidates "
            "on a piece of even noise, rec.window(start, stop), or by the .bic of their fits to "
            "rec.weigh(sigma=level) over one band.",
        )
    return ()


def same_samples(one: Record, other: Record) -> bool:
    """Whether two records hold the same samples: fits read some inputs otherwise than they were given."""
    if one is other:
        return True
    channels = (one.outputs, one.inputs) == (other.outputs, other.inputs)
    return channels and all(
        [np.array_equal(getattr(one, own), getattr(other, own)) for own in ("t", "y", "u")]
    )
