"""What is doubtful about a fit: the warnings it is made with, and what its check finds."""

from __future__ import annotations

import math
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.tables import Findings
from ..models.noise import Noise
from .diagnosis import Diagnosis, diagnose, disagreement, fewest_samples, growth, overlapping, surely_stable
from .estimates import Estimates

__all__ = ["FINEST", "UNLIKELY", "check", "numbers", "on_bound", "too_large", "too_small", "warnings_of"]

FEW_SAMPLES = 8.0  # a period of the highest harmonic
# Ratio of the two standard errors: with white noise and a dozen lines that matter, one record in eight
# passes 2 and one in sixty 2.5. Where few lines matter (a held square wave) HC3 is large for its own
# reasons and one record in four passes 2.5; coloured flight records start at 2.8. Hence the words.
DISAGREE = 2.5
CONDITION = 1e6
# Mean over rms about it. Powers of a channel that far from zero are all but the same regressor.
OFFSET = 1000.0
UNLIKELY = 0.01  # p-value below which a test speaks
SURE = 1e-4  # p-value below which a fit warns by itself
FINEST = 1e-3  # of an output: finer residuals may be errors of the quadrature
LEVEL = 1.5  # ratio of noise levels; with few lines chance makes larger ones, so p-values decide, too
BLOCK = 2**16  # samples
# Noise, % of the output, below which nothing is said of the bias of "ls" and "wls". At 1 % it is a tenth to
# nine tenths of their scatter over bands of up to 20 lines, at 5 % up to twice the scatter.
LITTLE = 0.5


def warnings_of(fit: Estimates) -> list[str]:
    """What deserves a warning when the fit is made."""
    far = _offset(fit)
    if not fit.success:
        return [f"fit: {text}" for text in (fit.message, far, _mean(fit)) if text]
    found = [
        text
        for text in (
            far,
            _mean(fit),
            on_bound(fit),
            _repeated(fit),
            _few_samples(fit),
            _unstable(fit),
            _minima(fit),
            _condition(fit),
        )
        if text
    ]
    if fit.options.method in ("awls", "ml") and (text := _disagreement(fit)):
        found.append(text)
    return [f"fit: {text}" for text in found]


def _offset(fit: Estimates) -> str | None:
    if fit.has_poles:
        return None  # of linear models the core takes offsets out before its sums
    for record in fit.records or ():
        for name, values in zip((*record.outputs, *record.inputs), (*record.y, *record.u), strict=True):
            mean = float(values.mean())
            spread = _rms(values, mean)
            if abs(mean) > OFFSET * spread > 0:
                return (
                    f"Channel {name!r} moves by {spread:.2g} (rms) about {mean:.6g}, which is "
                    f"{abs(mean) / spread:.2g} times larger and costs the equation's terms digits: write the "
                    "equation for deviations from it."
                )
    return None


def _rms(values: NDArray[np.float64], mean: float) -> float:
    """Standard deviation; `std` makes a copy, as large as the record."""
    parts = (values[k : k + BLOCK] - mean for k in range(0, values.size, BLOCK))
    return math.sqrt(sum(float(np.sum(part * part)) for part in parts) / values.size)


def _mean(fit: Estimates) -> str | None:
    """That line 0, the mean of a record, contradicts equations without a constant."""
    without = not fit.layout.rational and fit.trend is None and any(low == 0 for low, _ in fit.lines)
    if not without or fit.df_resid < 2 or not fit.records:
        return None
    from scipy.special import stdtr

    cure = 'Fit with trend="constant", or write a constant into the equation.'
    spread = np.sqrt(np.mean([rec.y.var(axis=1) for rec in fit.records], axis=0))
    means = np.mean([rec.y.mean(axis=1) for rec in fit.records], axis=0)
    if np.any(np.abs(means) > 3 * spread) and np.all(np.abs(fit.params) < fit.bse):
        # The equation took the offset for the signal.
        return (
            f"The outputs move by {numbers(spread)} (rms) about {numbers(means)}, the equation has no "
            f"constant, and no parameter is larger than its standard error. {cure}"
        )
    at = [np.abs(piece[:, 0].real) for piece, (low, _) in zip(fit.pieces, fit.lines, strict=True) if low == 0]
    if not np.any(np.sqrt(np.diag(fit.noise_cov)) > FINEST * spread):
        return None
    # Residuals have unit variance; the degrees of freedom that this one leaves are those of the others.
    worst, others = float(np.max(at)), fit.df_resid - 1
    t = worst / math.sqrt(max(fit.df_resid - worst**2, 1e-9) / others)
    if 2 * float(stdtr(others, -t)) * np.size(at) > SURE:
        return None
    return (
        f"The mean of the record is {t:.2g} standard deviations from what the equation makes of it: channels "
        f"have an offset, and the equation has no constant. {cure}"
    )


def on_bound(fit: Estimates) -> str | None:
    """That parameters ended on their bounds."""
    if not fit.at_bound:
        return None
    which, them = ("a bound", "it") if len(fit.at_bound) == 1 else ("bounds", "them")
    return (
        f"{', '.join(fit.at_bound)} ended on {which}: the data would have {them} elsewhere, and the other "
        f"standard errors hold only if the bound is right. Widen it, or hold {them} there if that is known."
    )


def _repeated(fit: Estimates) -> str | None:
    """That samples are counted twice: records that overlap, or outputs that are the same."""
    records = fit.records or ()
    for name, other in combinations(fit.outputs, 2):
        if records and all(np.array_equal(rec[name], rec[other]) for rec in records):
            return (
                f"Outputs {name!r} and {other!r} are the same samples: they count as two measurements, and "
                "the errors are too small; leave one out."
            )
    pair = overlapping([rec.y for rec in records])
    if pair is None:
        return None
    first, second, count = pair
    return (
        f"Records {first} and {second} share {count} samples of the outputs: they count as new data, and the "
        "errors are too small. Give each sample once; cut windows without overlap."
    )


def _few_samples(fit: Estimates) -> str | None:
    samples = fewest_samples(fit)
    if samples >= FEW_SAMPLES:
        return None
    return (
        f"The highest harmonic used, {fit.band[1]:.4g} rad/s, has {samples:.1f} samples a period; below "
        f"{FEW_SAMPLES:.0f} quadrature errors grow: lower the band or sample faster."
    )


def _unstable(fit: Estimates) -> str | None:
    if not fit.has_poles:
        return None
    if fit.layout.rational and all(map(surely_stable, fit.layout.denominators(fit.params))):
        return None
    growing = growth(fit)
    if growing <= 0:
        return None
    return (
        f"The estimate is unstable: a pole has real part {growing:.4g} rad/s (time to double "
        f"{np.log(2) / growing:.3g} s). Right for an unstable system, else a sign of too many poles or a "
        "band without signal."
    )


def _minima(fit: Estimates) -> str | None:
    rule = fit.band_rule
    if rule is None or not fit.layout.rational:
        return None
    wide, narrow = rule["cost_wide"], rule["cost_narrow"]
    # Of several outputs the costs are N log det of the noise's covariance: absolute differences count.
    apart = 1e-6 * min(wide, narrow) if len(fit.outputs) == 1 else 0.01
    if not (np.isfinite(wide) and np.isfinite(narrow)) or abs(wide - narrow) <= apart:
        return None
    return (
        f"Two minima were found over the wide band, with costs {min(wide, narrow):.6g} and "
        f"{max(wide, narrow):.6g}; the lower one was taken. Often a delay is missing from the structure, or "
        "it has too many poles."
    )


def _condition(fit: Estimates) -> str | None:
    if fit.condition_bound <= CONDITION or fit.cond <= CONDITION:
        return None
    return (
        f"The regressors are nearly dependent (condition number {fit.cond:.2g}): take fewer poles or zeros, "
        "or a record with more excitation."
    )


def _disagreement(fit: Estimates, d: Diagnosis | None = None) -> str | None:
    """That the two kinds of standard errors differ, and which of them the residual tests favour.

    In white noise nine in ten records of a light mode pass these tests, and classical intervals held the
    truth in 96 % of them; in AR(.6) and AR(.95) noise none of 300 each did.
    """
    ratio = disagreement(fit)
    if not ratio > DISAGREE:
        return None
    d = d or diagnose(fit)
    tests = (d.colour.p_value, d.correlation.p_value)
    said = f"Classical and HC3 standard errors differ by a factor of up to {ratio:.2g}"
    if min(tests) < UNLIKELY or too_large(d):
        learnt = fit.layout.rational and fit.options.noise == "output" and fit.records is not None
        other = ', noise="coloured"' if learnt else ""
        return (
            f"{said}, and the residual tests object: the noise is not white over the band or the model too "
            f"simple, and classical errors do not hold. Take HC3{other} or a narrower band (now up to "
            f"{fit.band[1]:.4g} rad/s)."
        )
    if not all(p >= UNLIKELY for p in tests):
        return (
            f"{said}: the noise is not white, the model too simple, or few lines carry the information and "
            "HC3 is off. The band has too few lines to test which; take the larger."
        )
    return (
        f"{said}, and the residual tests see neither colour nor misfit: few lines carry the information, and "
        'HC3 is the one that is off. Take the classical ones, cov_type="nonrobust", unless you know that '
        "the noise is coloured."
    )


def _biased(fit: Estimates) -> str | None:
    """That one-shot estimates are biased by noise, unless the high band shows next to none."""
    method = fit.options.method
    if method not in ("ls", "wls") or fit.options.noise == "equation" or fit.records is None:
        return None
    spread = np.sqrt(np.mean([rec.y.var(axis=1) for rec in fit.records], axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        noise = 100 * float(np.max(fit.high_band_levels / spread))
    if noise < LITTLE:
        return None
    seen = (
        f" (here noise of {noise:.2g} % of the output is seen in the unused high band)" if noise > 0 else ""
    )
    return (
        f'method="{method}" is biased by noise on the output{seen}, the more the wider the band, and no '
        'standard error counts that: compare with method="ml".'
    )


def too_large(d: Diagnosis) -> bool:
    """Whether the residuals are more than the noise of the high band explains."""
    return d.chi2_p < UNLIKELY


def too_small(d: Diagnosis) -> bool:
    """Whether they are far less."""
    return d.chi2_p > 1 - UNLIKELY and d.level_ratio < 1 / LEVEL


def check(fit: Estimates) -> Findings:
    """What is wrong or doubtful about a fit; see `Fit.check`."""
    title = f"Check of {fit!r}"
    if not fit.usable:
        return Findings(title, [fit.message])
    d = diagnose(fit)
    found: list[str | None] = [None if fit.success else fit.message, _biased(fit), _unstable(fit)]
    if too_large(d):
        found.append(
            f"The residuals are {d.level_ratio:.3g} times {_reference(fit)}: chi-square {fit.chi2:.4g} for "
            f"{fit.df_resid} degrees of freedom (p = {d.chi2_p:.2g}). Either the model misses something, or "
            "the record was low-pass filtered and the high band is empty of noise, as flight records often "
            "are."
        )
    elif too_small(d):
        found.append(
            f"The residuals are only {d.level_ratio:.3g} of {_reference(fit)}: the noise is stronger at high "
            "frequency, or there is signal there."
        )
    if d.colour.p_value < UNLIKELY:
        found.append(
            f"The residual lines{_of(fit, d.coloured)} are not of one level over the band (lower half "
            f"{d.colour_ratio:.3g} times the upper half, p = {d.colour.p_value:.2g}): the noise is coloured "
            "or the model misses part of the band; classical standard errors do not hold, HC3 does."
        )
    if d.correlation.p_value < UNLIKELY:
        found.append(
            f"Neighbouring residual lines{_of(fit, d.correlated)} are correlated (Ljung-Box "
            f"{d.correlation.statistic:.3g}, p = {d.correlation.p_value:.2g}): something short in "
            "time is not explained, such as a gust, a step of another input or clipping; look at "
            "plot_response()."
        )
    for lag in d.lags:
        if lag.p_value >= UNLIKELY:
            continue
        if lag.path:
            found.append(
                f"The residuals correlate with {lag.channel}: {'more' if lag.amount > 0 else 'less'} delay "
                f"by about {abs(lag.amount):.3g} s (standard error {lag.bse:.2g}, p = {lag.p_value:.2g}) or "
                "one more zero would reduce them."
            )
        else:
            found.append(
                f"The residuals correlate with {lag.channel} (p = {lag.p_value:.2g}), which has no path in "
                "the structure: give it zeros."
            )
    found += [
        _mean(fit),
        on_bound(fit),
        _repeated(fit),
        _disagreement(fit, d),
        _minima(fit),
        _few_samples(fit),
        _condition(fit),
    ]
    return Findings(title, [text for text in found if text])


def _of(fit: Estimates, output: str) -> str:
    return f" of {output}" if len(fit.row_names) > 1 else ""


def numbers(values: Any) -> str:
    return ", ".join(f"{value:.4g}" for value in np.atleast_1d(values))


def _reference(fit: Estimates) -> str:
    """The level that residuals are compared with."""
    if isinstance(fit.options.noise, Noise):
        return "the noise that was given"
    if fit.options.noise == "errors-in-variables":
        return "the noise seen in the unused high band"
    return (
        f"the noise level of the unused high band ({numbers(fit.sigma)} against "
        f"{numbers(fit.high_band_sigma)})"
    )
