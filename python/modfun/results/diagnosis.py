"""Numbers that tell whether a fit can be believed; `check` puts them into words."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import comb, inf, isfinite, nan

import numpy as np

from ..base.arrays import F64
from ..base.cached import kept
from ..models.noise import Noise
from ..systems.polynomials import roots_of
from .estimates import Estimates
from .further import Explained, further
from .line_tests import Whiteness, colour_of_lines, correlation_of_lines
from .sample_levels import beside_samples

__all__ = [
    "Diagnosis",
    "chi_square",
    "diagnose",
    "fewest_samples",
    "growth",
    "high_band_df",
    "level_p",
    "level_ratio",
    "lower_p",
    "overlapping",
    "poles_of",
    "surely_stable",
    "worst_colour",
]

ROUNDING = 1e-7
PIECE = 1 << 15  # intervals of which long records' levels are made
LEAST = 4  # lines of which a level is made
LEAST_DF = 4.5  # of such a level: an F law has a variance beyond 4


@dataclass(frozen=True)
class Diagnosis:
    """Tests of one fit; `Fit.check` speaks where a p-value is below 0.01.

    Attributes
    ----------
    chi2_p : float
        Probability of a chi-square as large, at the noise level of the high band, whose own scatter is
        counted (`level_p`). `check` objects below 0.01, and above 0.99 where the ratio is below 1/1.5.
    level_ratio : float
        Noise level of the fit over that of the high band.
    correlation, colour : Whiteness
        Neighbouring lines (Ljung-Box); level over the band (Kolmogorov-Smirnov). Of several outputs the
        worst, its p-value times their number. `check` objects below 0.01.
    correlated, coloured : str
        Which output that is.
    colour_ratio : float
        Level of the lower over that of the upper half of the band.
    further : tuple of Explained
        What further columns would explain of the residuals, an event last. `check` objects below 0.01 over
        their number.
    """

    chi2_p: float
    level_ratio: float
    correlation: Whiteness
    correlated: str
    colour: Whiteness
    coloured: str
    colour_ratio: float
    further: tuple[Explained, ...]


def diagnose(fit: Estimates, enough: float = 1.0) -> Diagnosis:
    """All tests of a fit with finite parameters; p-values of further columns are exact up to `enough`."""
    found = [[piece[i] for piece in fit.pieces] for i in range(len(fit.row_names))]
    correlations = [correlation_of_lines(pieces)[0] for pieces in found]
    close = _worst(correlations)
    colour, dim, ratio = worst_colour(fit)
    return Diagnosis(
        chi2_p=level_p(fit),
        level_ratio=level_ratio(fit),
        correlation=_corrected(correlations, close),
        correlated=fit.row_names[close],
        colour=colour,
        coloured=fit.row_names[dim],
        colour_ratio=ratio,
        further=further(fit, enough),
    )


def worst_colour(fit: Estimates) -> tuple[Whiteness, int, float]:
    """The test of one level over the band in the row that it finds least even, its number and ratio."""
    colours = [colour_of_lines([piece[i] for piece in fit.pieces]) for i in range(len(fit.row_names))]
    tests = [colour for colour, _ in colours]
    dim = _worst(tests)
    return _corrected(tests, dim), dim, colours[dim][1]


def level_ratio(fit: Estimates) -> float:
    """Noise level of the fit over that of the high band."""
    with np.errstate(divide="ignore", invalid="ignore"):
        # Over all outputs: chi-square a degree of freedom is the mean square of their ratios.
        return float(np.sqrt(np.divide(fit.chi2, fit.df_resid)))


def chi_square(fit: Estimates) -> tuple[float, float]:
    """Chi-square of the residuals at the level that they are judged by, and its degrees of freedom.

    Of lines, or of all samples where these are least squares of the response.
    """
    df = float(fit.df_resid)
    if getattr(fit, "by_response", False):  # of equations
        df = float(fit.df_spectral[0])
    with np.errstate(invalid="ignore", divide="ignore"):
        return float(np.divide(fit.chi2 * df, fit.df_resid)), df


@kept
def level_p(fit: Estimates) -> float:
    """Probability of a chi-square as large as the fit's if the model is right; nan where there is none.

    Chi-square's own law where the level was given. A level seen in the high band scatters itself, and
    independently of the residuals: it comes from other lines. Then chi-square a degree of freedom has an F
    law with `df_resid` and the level's degrees of freedom, as many times these as outputs (equations) have
    independent noise: p outputs whose noise is correlated by r count as p^2/sum(r^2). Of several records of
    equations it is a mean of ratios to the level of each, see `_above`. Residuals of a response at all
    samples are tested against their neighbours, too, see `following_p`.
    """
    from scipy.special import chdtrc, fdtrc

    chi2, df = chi_square(fit)
    if not (isfinite(chi2) and df > 0):
        return 0.0 if chi2 == inf else nan
    if isinstance(fit.options.noise, Noise):
        return float(chdtrc(df, chi2))
    ratio, follow_p = chi2 / df, getattr(fit, "follow_p", nan)
    rows = independent = float(len(fit.row_names))
    if rows > 1 and fit.options.noise == "output" and fit.noise_cov.shape == (rows, rows):
        level = np.sqrt(np.diag(fit.noise_cov))
        independent = rows**2 / float(np.sum((fit.noise_cov / np.outer(level, level)) ** 2))
        df *= independent / rows
    levels = getattr(fit, "levels", None)  # of equations, one for each output of each record
    if levels is None or len(levels) == 1:
        p = float(fdtrc(df, independent * high_band_df(fit), ratio))
    else:
        each = [_level_df(n, max(fit.layout.orders, default=0) + 2) for n in fit.intervals]
        p = _above(ratio, df, independent, each)
    # Of many samples, what is slow shows in neighbours that agree long before it doubles the level.
    p = min(p, follow_p) if isfinite(follow_p) else p
    # A level beside neighbours holds motion between them, too: residuals below it say nothing.
    return min(p, 0.5) if beside_samples(fit) else p


def lower_p(fit: Estimates, other: Estimates, ratio: float) -> float:
    """Probability by F of residuals that are so many times smaller in a fit with a constant, by chance.

    With the few lines of a narrow band that is common.
    """
    from scipy.special import fdtrc

    left = other.df_resid - fit.noise_levels.size * bool(other.with_past)  # the past's levels are estimated
    if left < 1:
        return 1.0
    more = max(fit.df_resid - left, 1)
    return float(fdtrc(more, left, (ratio**2 * fit.df_resid - left) / more))


def high_band_df(fit: Estimates) -> float:
    """Degrees of freedom of the high band's noise level of one output, 2 mean^2/variance of its square.

    Of a record: the mean over L lines that were differenced q times, whose squares are correlated as
    (C(2q, q + k)/C(2q, q))^2 at distance k. The mean over records of equal noise: r^2/sum(1/df).
    """
    return level_df(fit.intervals, max(fit.layout.orders, default=0))


def level_df(intervals: Iterable[int], order: int) -> float:
    """The same from the numbers of intervals of the records and the order of the model."""
    each = [_level_df(n, order + 2) for n in intervals]
    return len(each) ** 2 / sum(1 / df for df in each)


@lru_cache(maxsize=64)
def _level_df(intervals: int, q: int) -> float:
    # Long records are cut into pieces, as in rust/core/noise_level.rs.
    piece = intervals if intervals < 2 * PIECE else min(max(8 * q, PIECE), intervals)
    lines = max(piece // 2 - -(-piece // 4) - q + 1, LEAST)
    centre, near = comb(2 * q, q), min(q, lines - 1)
    spread = sum((1 - abs(k) / lines) * (comb(2 * q, q + k) / centre) ** 2 for k in range(-near, near + 1))
    return 2 * lines * (intervals // piece) / spread


def _above(ratio: float, df: float, independent: float, each: Sequence[float]) -> float:
    """Probability that a mean of F laws, of so many outputs and the levels of each record, is above a ratio.

    A few samples show a level badly, and the mean of several ratios is larger than that to a common level: of
    three records of 41 samples and three outputs 23 % were beyond the p-value of 1 % of that. The law is that
    of a multiple of an F with the mean and the variance of the true one.
    """
    from scipy.special import fdtrc

    nu, part = np.maximum(each, LEAST_DF), df / (independent * len(each))
    means = nu / (nu - 2)
    variances = 2 * nu**2 * (part + nu - 2) / (part * (nu - 2) ** 2 * (nu - 4))
    mean, spread = float(means.mean()), float(variances.mean()) / (independent * len(each))
    over = df * spread / mean**2 - 2  # more than that of a chi-square
    alike = (4 * (over + 2) + 2 * (df - 2)) / over
    return float(fdtrc(df, alike, ratio * alike / ((alike - 2) * mean)))


def _worst(tests: Sequence[Whiteness]) -> int:
    return int(np.argmin([inf if test.p_value != test.p_value else test.p_value for test in tests]))


def _corrected(tests: Sequence[Whiteness], at: int) -> Whiteness:
    """The worst of several tests with a p-value that allows for their number (Bonferroni)."""
    own = tests[at]
    return replace(own, p_value=min(1.0, own.p_value * len(tests)) if own.p_value == own.p_value else nan)


def growth(fit: Estimates) -> float:
    """Largest real part of the poles, rad/s, 0 within rounding; nan without poles."""
    if not fit.has_poles:
        return nan
    poles = poles_of(fit)
    most = float(np.max(poles.real))
    # A double pole at 0, as of a rigid body, is found to the root of the rounding of the largest one.
    return 0.0 if abs(most) < ROUNDING * min(float(np.max(np.abs(poles))), fit.band[1]) else most


def poles_of(fit: Estimates) -> F64:
    """Poles of a linear model, those of a shared denominator once, rad/s."""
    if not fit.layout.rational:
        return np.asarray(fit.model.poles())
    return np.concatenate([roots_of(fit.polynomials(i)[0]) for _, i in fit.denominators()])


def surely_stable(denominator: Sequence[float]) -> bool:
    """Whether all roots have negative real parts, by Routh's scheme; False where rounding may decide."""
    if len(denominator) <= 3:
        return all([c > 0 for c in denominator])
    upper, lower = list(denominator[::2]), list(denominator[1::2])
    least = 0.0
    while lower:
        if not lower[0] > least:
            return False
        ratio, least = upper[0] / lower[0], 1e-9 * abs(upper[1] if len(upper) > 1 else 0.0)
        upper, lower = lower, [a - ratio * b for a, b in zip(upper[1:], [*lower[1:], 0.0], strict=False)]
    return True


def fewest_samples(fit: Estimates) -> float:
    """Fewest samples per period of the highest harmonic used, over the records."""
    return min(n / max(hi, 1) for n, (_, hi) in zip(fit.intervals, fit.lines, strict=True))


# Samples shared, a tenth of the later record from 10 to 1000; what is less may be chance, or a seam.
FEW, SHARE, MANY = 10, 0.1, 1000
STARTS = 100  # places at which a value may recur; more are those of coarsely rounded samples


def overlapping(outputs: Sequence[F64]) -> tuple[int, int, int] | None:
    """Two records of which one begins within the other, and how many samples (output, time) they share.

    Records follow one another in time or are the same ones; the pair is named by position, the earlier first.
    """
    if len(outputs) < 2:
        return None
    # Of measured samples next to none recur in other records: one look at all of them tells.
    every = np.sort(np.concatenate([y[0] for y in outputs]))
    for j, late in enumerate(outputs):
        least = int(np.clip(SHARE * late.shape[1], FEW, MANY))
        begin = late[:, :least]
        if begin.shape[1] < least or np.all(begin == begin[:, :1]):
            continue
        recur = np.searchsorted(every, begin[0], "right") - np.searchsorted(every, begin[0], "left")
        anchor = int(np.argmin(recur))  # the rarest value
        if not 2 <= recur[anchor] <= STARTS:
            continue
        for i, early in enumerate(outputs):
            for at in np.flatnonzero(early[0] == begin[0, anchor]) - anchor:
                count = min(early.shape[1] - at, late.shape[1])
                if i == j or at < 0 or count < least:
                    continue
                if np.array_equal(early[:, at : at + count], late[:, :count]):
                    return (min(i, j), max(i, j), int(count))
    return None
