"""Outputs above zero whose noise goes with their level, as of counts and concentrations."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from ..base.arrays import F64
from ..base.cached import kept
from ..errors import ModfunError
from ..records.record import Record
from .cures import STRONG, again, furthest, on_band
from .doubts import Doubt, noise_free
from .estimates import Estimates

__all__ = ["misweighted", "multiplied"]

COUNTED, IN_PROPORTION = 0.5, 1.0  # powers of the level that noise goes with: of counts, and of scales
WIDE = 10.0  # times its least sample that an output reaches, where it matters which of these it is
RISES = 2.0  # by how much third differences of its upper half are larger than those of its lower half
FEW, LIKELIER = 64, 10.0  # samples of all records, and by which -2 log likelihood falls beside so many
CERTAIN = 20.0  # by which -2 log likelihood falls: chance does that to one record of 100,000
OTHER = 1.25  # errors over those of the cure, or these over the former: another interval
FOLLOWS = 3.0  # standard deviations of the lag-one correlation of white noise


def misweighted(fit: Estimates) -> Doubt | None:
    """The same, of few samples or outputs that equations divide by, where it is beyond doubt."""
    if fit.layout.rational or not (_is_few(fit) or (_may_rise(fit.records or ()) and _divides(fit))):
        return None
    found = multiplied(fit)
    return found if found and found.sure else None


@kept
def multiplied(fit: Estimates) -> Doubt | None:
    """That noise which goes with the level of the outputs explains samples far better than an even one.

    Beyond doubt where the equations divide by outputs or take their logarithms, so that the lines are
    weighted by what an even noise would do there, the other fit leaves white noise, and intervals change.
    A dozen samples over decades, as of growth, are fitted at the high ones alone by an even noise: what this
    leaves of the low ones says nothing of their noise, and the other fit is made in any case.
    """
    records, plain = fit.records or (), fit.options.noise == "output"
    if fit.layout.rational or not plain or not _above_zero(records):
        return None
    before = _simulated(fit)
    if before is None or noise_free(fit) is not None:
        return None
    few, divided, even = _is_few(fit), _divides(fit), _criterion(records, before, 0.0)
    needed = LIKELIER if few else CERTAIN if divided else STRONG
    powers = (IN_PROPORTION, COUNTED) if divided else (IN_PROPORTION,)
    if not (few or even - min(_criterion(records, before, power) for power in powers) > needed):
        return None
    levels = [rec.y for rec in records] if few else before  # noisy counts that weight themselves bias a fit
    weighted = [found for power in powers if (found := _weighted(fit, power, levels)) is not None]
    if not weighted:
        return None
    other, after, power = min(weighted, key=lambda one: _criterion(records, *one[1:]))
    if few:  # the response of sums that err is none that an even noise asks for
        even = min(even, _criterion(records, after, 0.0))
    if not (gain := even - _criterion(records, after, power)) > needed:
        return None
    what, cure = _WORDS[power]
    text = (
        f"The noise goes with {what}. First try {cure}, of outputs above zero: -2 log likelihood of the "
        f"samples beside the simulated response falls by {gain:.3g}"
    )
    certain = (divided or few) and gain > CERTAIN
    if not (certain and _is_white(records, after, power) and _changes(fit, other)):
        return Doubt(text + ".", sure=False)
    name, was, now, _ = furthest(fit, other)
    text = f"{text}, and {name} becomes {now} (was {was})."
    if few:
        return Doubt(text)
    return Doubt(
        f"{text} The equations divide by an output or take its "
        'logarithm: standard errors for even noise do not hold, those of cov_type="HC3" nearly do.'
    )


_WORDS = {
    IN_PROPORTION: ("the level of the outputs", 'noise="log-normal"'),
    COUNTED: (
        "the square root of the outputs, as that of counts does",
        "rec.weigh(sigma=np.sqrt(fit.predict(rec).y))",
    ),
}


def _above_zero(records: tuple[Record, ...]) -> bool:
    """Whether there are records, all with outputs above zero and without noise levels of their own."""
    return bool(records) and not any(
        rec.mask is not None or rec.sigma is not None or np.any(rec.y <= 0) for rec in records
    )


def _is_few(fit: Estimates) -> bool:
    """Whether a fit has few samples, all above zero, that span much."""
    records = fit.records or ()
    if not _above_zero(records):
        return False
    wide = all([np.all(rec.y.max(axis=1) > WIDE * rec.y.min(axis=1)) for rec in records])
    return wide and sum([rec.y.size for rec in records]) <= FEW


def _may_rise(records: tuple[Record, ...]) -> bool:
    """Whether outputs stay above zero, span much, and have rougher samples where they are high."""
    if not _above_zero(records):
        return False
    for rec in records:
        for y in rec.y:
            if y.size < 16 or not y.max() > WIDE * y.min():
                continue
            rough = np.diff(y, 3) ** 2
            high = y[1:-2] > np.median(y)
            if high.any() and np.mean(rough[high]) > RISES**2 * np.mean(rough[~high]):
                return True
    return False


@kept
def _divides(fit: Estimates) -> bool:
    """Whether the fitted terms hold logarithms or negative powers of outputs."""
    import sympy

    layout: Any = fit.layout
    outputs = {sympy.Symbol(name, real=True) for name in fit.outputs}
    parts = [
        part for term in layout.compiled.terms for part in (term.signal, term.factor) if part is not None
    ]
    logs = [one.args[0] for part in parts for one in part.atoms(sympy.log)]
    below = [sympy.denom(part) for part in parts]
    return any(one.free_symbols & outputs for one in (*logs, *below))


def _weighted(fit: Estimates, power: float, levels: list[F64]) -> tuple[Estimates, list[F64], float] | None:
    """The fit with the noise that goes with such a power of the level, and its responses.

    Few samples are weighed by their size where sums do not fit their logarithms, or not on that band.
    """
    records, options = fit.records or (), on_band(fit, fit.band)
    weighed = tuple([rec.weigh(sigma=y**power) for rec, y in zip(records, levels, strict=True)])
    logs = power == IN_PROPORTION
    ways = [(records, options.replace(noise="log-normal")) if logs else (weighed, options)]
    for told, how in [*ways, *[(weighed, fit.options)] * _is_few(fit)]:
        other = again(fit, told, fit.structure, how)
        simulated = _simulated(other) if other is not None and other.success else None
        if other is not None and simulated is not None:
            return other, simulated, power
    return None


def _simulated(fit: Estimates) -> list[F64] | None:
    """Responses of a fit to its records; None where they are not above zero."""
    try:
        found = [cast(Any, fit).simulate(rec)[0] for rec in fit.records or ()]
    except (ModfunError, np.linalg.LinAlgError):  # a response that leaves the range of numbers
        return None
    return found if all(np.all(np.isfinite(y)) and np.all(y > 0) for y in found) else None


def _residuals(y: F64, simulated: F64, power: float) -> F64:
    """What is white of an even level if the noise goes with a power of the response."""
    return np.log(y / simulated) if power == IN_PROPORTION else (y - simulated) / simulated**power


def _criterion(records: tuple[Record, ...], simulated: list[F64], power: float) -> float:
    """-2 log likelihood of samples under such noise, which is white, but for a constant."""
    total = 0.0
    for rec, response in zip(records, simulated, strict=True):
        size = np.log(np.mean(_residuals(rec.y, response, power) ** 2, axis=1))
        level = rec.y if power == IN_PROPORTION else response
        total += rec.y.shape[1] * float(np.sum(size + 2 * power * np.mean(np.log(level), axis=1)))
    return total


def _is_white(records: tuple[Record, ...], simulated: list[F64], power: float) -> bool:
    """Whether neighbouring residuals are not alike, as they are where the model is wrong."""
    for rec, response in zip(records, simulated, strict=True):
        e = _residuals(rec.y, response, power)
        alike = np.sum(e[:, 1:] * e[:, :-1], axis=1) / np.sum(e**2, axis=1)
        if np.any(alike * np.sqrt(e.shape[1]) > FOLLOWS):
            return False
    return True


def _changes(fit: Estimates, other: Estimates) -> bool:
    """Whether intervals become others: of another width, or elsewhere."""
    free = (fit.bse > 0) & (other.bse > 0)
    ratio, far = fit.bse[free] / other.bse[free], np.abs(other.params - fit.params)[free] / fit.bse[free]
    return bool(np.any((ratio > OTHER) | (ratio < 1 / OTHER) | (far > 1)))
