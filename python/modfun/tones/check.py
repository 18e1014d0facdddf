"""What is doubtful about tones: what the record cannot tell, and what their residuals hold."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64
from ..base.tables import Findings

__all__ = ["check"]

DRIVEN = (
    "A motion that noise drives looks alike, too: then fit an equation, "
    'mf.Equation("y\'\' + a1*y\' + a2*y = 0"), with noise="process".'
)
Sinusoids = Any  # that of `results`, which imports this file

UNLIKELY = 0.01  # p-value of each kind of test, over all tones, lines or samples that it looks at
APART = 3.0  # standard errors between two frequencies that the record tells apart
MERGED = 1.5  # lines between two tones that share their amplitudes
FINEST = 1e-9  # of the samples: less is rounding
OWN = 3  # lines on each side of a tone that it takes from the residuals
NEAR = 10  # lines beyond these that show the noise about it
FEWEST = 8  # lines that can show it
DEPENDENT = 1e-6  # what a column has beside the others, over its length
BESIDE = 3.0  # lines from a tone that one close to it has at most
CLOSE = np.arange(0.25, BESIDE + 0.1, 0.25)
FADING = np.array([0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0])  # e-folds over the record
CLEARLY = 6.0  # of BIC
AROUND = 20  # lines on each side of one that may be a further tone
NORMAL = 1.4826  # standard deviation over the median distance from zero, of normal numbers
EFFICIENCY = 0.37  # of that median


def check(found: Sinusoids) -> Findings:
    """What is wrong or doubtful, most important first."""
    title = f"Check of {len(found)} tone{'' if len(found) == 1 else 's'}"
    if not found.success:
        return Findings(title, [f"There is no answer: {found.message}."])
    sentences = list(_unsettled(found))
    if found.lines:
        return Findings(title, sentences, note="Residuals are not tested where lines= chose what is fitted.")
    if found.df_resid < len(found.params) or found.sigma < FINEST * np.std(found.y[found.weights > 0]):
        return Findings(title, sentences, note="There is no noise to test the residuals against.")
    return Findings(title, [*sentences, *_of_residuals(found)])


def _unsettled(found: Sinusoids) -> Iterator[str]:
    """What the record is too short or too noisy for."""
    good, variances = found.weights > 0, np.diag(found.cov)
    span = found.dt * float(np.ptp(np.flatnonzero(good)))
    errors = found.bse[found.kinds.index("amplitude") * len(found) :]
    for i, (omega, size, error) in enumerate(zip(found.omega, found.amplitude, errors, strict=False)):
        beside = np.abs(np.delete(found.omega, i) - omega) * span < MERGED * 2 * np.pi
        # The largest of as many lines as there are, in white noise; of tones that merge each is uncertain.
        p = 0 if beside.any() else -np.expm1(0.5 * good.sum() * np.log1p(-np.exp(-0.5 * (size / error) ** 2)))
        if p > UNLIKELY:
            yield (
                f"Tone {i + 1} at {omega:.4g} rad/s is no larger than peaks of noise may be (p = {p:.2g}): "
                "its frequency may be anywhere, whatever its standard error. Look for fewer tones, or leave "
                "count out."
            )
        if abs(omega) * span < 2 * np.pi:
            yield (
                f"Tone {i + 1} at {omega:.4g} rad/s has less than one period in the {span:.4g} s of the "
                'record and may be a drift. Compare with trend="linear".'
            )
    for i, apart in enumerate(np.diff(found.omega)):
        error = np.sqrt(variances[i] + variances[i + 1] - 2 * found.cov[i, i + 1])
        if apart < APART * error:
            yield (
                f"Tones {i + 1} and {i + 2} are {apart:.2g} ± {error:.2g} rad/s apart: the record does not "
                "tell them from one tone, or from one that decays. Compare with "
                f"count={len(found) - 1}, also damped=True."
            )


def _spikes(found: Sinusoids) -> Iterator[str]:
    """Samples beyond what normal noise has, by a scale that they do not raise."""
    from scipy.special import stdtr

    errors = np.where(found.weights > 0, found.weights * found.errors(), np.nan)
    parts = np.array([errors.real, errors.imag] if np.iscomplexobj(found.y) else [errors])
    size = np.abs(parts) / (NORMAL * np.nanmedian(np.abs(parts)))
    count = np.sum(np.isfinite(size))
    p = 2 * count * stdtr(EFFICIENCY * count, -size)
    wrong = np.any(p < UNLIKELY, axis=0)
    if wrong.any():
        at = int(np.nanargmax(size.max(axis=0)))
        yield (
            f"Samples far from all that tones and noise explain ({int(wrong.sum())} of {found.y.size}, most "
            f"at t = {at * found.dt:.4g} s by {size[:, at].max():.3g} standard deviations) move tones and "
            "may look like some. Leave them out, Record(mask=)."
        )


def _of_residuals(found: Sinusoids) -> list[str]:
    """What the residuals of the samples hold beside white noise."""
    errors = np.where(found.weights > 0, found.weights * np.nan_to_num(found.errors()), 0)
    real = not np.iscomplexobj(found.y)
    power = np.abs(np.fft.fft(errors))[1 : (errors.size + 1) // 2 if real else None] ** 2  # line k at k - 1
    places = found.omega * found.dt / (2 * np.pi) % 1 * errors.size - 1
    far = np.abs(np.arange(power.size) - places[:, None])
    own = np.any(far <= OWN, axis=0)
    about = [~own & (distance <= OWN + NEAR) for distance in far]
    level = np.mean(power[~own]) if not own.all() else np.inf
    noise = np.array([np.mean(power[at]) / level if at.sum() >= FEWEST else 1.0 for at in about])
    changed = _changes(found, errors, np.fmax(noise, 1.0))
    more = list(_further(found, power, far, changed))
    # A further tone would be part of the noise about another.
    return [
        *changed.values(),
        *_spikes(found),
        *(more or _colour(found, about, int(np.sum(~own)), noise, changed)),
    ]


def _changes(found: Sinusoids, errors: NDArray[Any], noise: F64) -> dict[int, str]:
    """Tones that decay or whose frequency moves, by their number: t tests of one more column each.

    `noise` about each tone, over that of the record, is what a column is tested against.
    """
    from scipy.special import stdtr

    n, real = found.y.size, not np.iscomplexobj(found.y)

    def flat(values: NDArray[Any]) -> F64:
        return np.asarray(values.real if real else np.concatenate([values.real, values.imag]))

    t = found.dt * np.arange(n)[:, None]
    waves = found.amplitude * np.exp(t * (1j * found.omega - found.damping) + 1j * found.phase)
    t = t - t.mean()
    trend = (t / np.ptp(t)) ** np.arange(found.offset.size // (1 if real else 2))
    known = [waves, 1j * waves, 1j * t * waves, trend, *([] if real else [1j * trend])]
    tests = [("decays", -t), ("moves", 0.5j * t**2)]
    if "damping" in found.kinds:
        known.append(tests.pop(0)[1] * waves)
    weights = found.weights[:, None]
    basis = np.linalg.qr(flat(weights * np.hstack(known)))[0]
    residual, left = flat(errors), found.df_resid - 1
    said: dict[int, str] = {}
    for i, (kind, by) in product(range(len(found)), tests):
        whole = flat(weights * by * waves[:, i : i + 1])[:, 0]
        column = whole - basis @ (basis.T @ whole)
        length = np.linalg.norm(column)
        if i in said or length < DEPENDENT * np.linalg.norm(whole):
            continue
        value = float(column @ residual) / length**2
        rest = residual - value * column
        error = float(np.sqrt(noise[i] * (rest @ rest) / left)) / length
        p = 2 * float(stdtr(left, -abs(value / error))) * len(found) * len(tests)
        if p < UNLIKELY:
            span = found.dt * n
            close, fading = (
                _beside(found, residual, flat, basis, waves[:, i], shapes / span)
                for shapes in (2j * np.pi * np.append(-CLOSE, CLOSE), np.append(-FADING, FADING))
            )
            bic = [min(_bic(rest, 1), fading if kind == "decays" else np.inf), close]
            if bic[1] < bic[0] - CLEARLY:
                said[i] = (
                    f"Tone {i + 1} at {found.omega[i]:.4g} rad/s is not alone: a further tone within "
                    f"{BESIDE:.2g} lines of it explains the residuals better than a decay or a frequency "
                    f"that moves steadily (p = {p:.1g}). Compare with count={len(found) + 1}. A frequency or "
                    f"amplitude that swings looks alike. {DRIVEN}"
                )
                continue
            words = (
                f"{'decays' if value > 0 else 'grows'}, by a damping of {value:.3g} ± {error:.2g} 1/s "
                f"(p = {p:.1g}). Fit with damped=True."
                if kind == "decays"
                else f"does not keep its frequency, which moves by {value:.3g} ± {error:.2g} rad/s per "
                f"second (p = {p:.1g}). Fit shorter pieces of the record."
            )
            if abs(bic[1] - bic[0]) <= CLEARLY:
                words += f" A further tone close by looks alike: compare with count={len(found) + 1}."
            if kind == "moves" and "damping" in found.kinds:
                words += f" {DRIVEN}"
            said[i] = f"Tone {i + 1} at {found.omega[i]:.4g} rad/s {words}"
    return said


def _bic(rest: F64, count: int) -> float:
    """Of residuals that so many more parameters have left."""
    return rest.size * float(np.log(rest @ rest)) + count * float(np.log(rest.size))


def _beside(
    found: Sinusoids,
    residual: F64,
    flat: Callable[[NDArray[Any]], F64],
    basis: F64,
    wave: NDArray[Any],
    rates: NDArray[Any],
) -> float:
    """BIC of what the likeliest wave more leaves of the residuals: a tone that turns or grows at a rate."""
    time, best = found.dt * np.arange(found.y.size), np.inf
    for rate in rates.tolist():
        turned = found.weights * wave * np.exp(rate * time)
        columns = np.stack([flat(turned), flat(1j * turned)], axis=1)
        columns -= basis @ (basis.T @ columns)
        own = np.linalg.lstsq(columns, residual, rcond=None)[0]
        best = min(best, _bic(residual - columns @ own, 3))
    return best


def _further(found: Sinusoids, power: F64, far: F64, changed: Iterable[int]) -> Iterator[str]:
    """The line that stands out most from those around it, unless it is part of a tone that changes."""
    own = np.any(far <= 1, axis=0)
    for i in changed:
        own |= far[i] <= NEAR
    free, near = np.where(own, 0.0, 1.0), np.ones(2 * AROUND + 1)
    near[AROUND - 1 : AROUND + 2] = 0.0
    count = np.convolve(free, near)[AROUND:-AROUND]
    around = np.convolve(free * power, near)[AROUND:-AROUND]
    enough = ~own & (np.round(count) >= FEWEST)
    if not enough.any():
        return
    # An exponential number over the mean of as many others.
    p = free.sum() * (1 + power[enough] / around[enough]) ** -count[enough]
    if p.min() < UNLIKELY:
        omega = 2 * np.pi * (np.flatnonzero(enough)[p.argmin()] + 1) / (found.y.size * found.dt)
        omega -= 2 * np.pi / found.dt if omega > np.pi / found.dt else 0
        yield (
            f"The residuals have a peak at {omega:.4g} rad/s (p = {p.min():.1g}), which may be a further "
            f"tone. Compare with count={len(found) + 1}."
        )


def _colour(
    found: Sinusoids, about: Sequence[NDArray[np.bool_]], lines: int, noise: F64, changed: Iterable[int]
) -> Iterator[str]:
    """Tones about which the noise has another level than in the record, on which standard errors rest."""
    from scipy.special import fdtr, fdtrc

    said = [i for i in range(len(found)) if i not in changed]
    for i in said:
        m = int(about[i].sum())
        if m < FEWEST or lines - m < FEWEST:
            continue
        rest = (lines - m) * noise[i] / (lines - m * noise[i]) if m * noise[i] < lines else np.inf
        p = 2 * len(found) * min(fdtr(2 * m, 2 * (lines - m), rest), fdtrc(2 * m, 2 * (lines - m), rest))
        if p < UNLIKELY:
            yield (
                f"The noise about tone {i + 1} at {found.omega[i]:.4g} rad/s has {np.sqrt(noise[i]):.2g} "
                f"times the level of the record (p = {p:.1g}), on which its standard errors rest. Fit with "
                "lines=9, whose errors are of the noise near each tone."
            )
