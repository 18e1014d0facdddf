"""Whether the records of one fit agree on its parameters, and which channel of which record does not."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

import numpy as np

from ..base.arrays import F64
from ..base.cached import kept
from .cures import ENOUGH, again, again_at_all, likely_cure, on_band
from .diagnosis import level_p
from .doubts import SURE, Doubt
from .estimates import Estimates
from .odd_channels import Change, likeliest_change, told, told_both, votes
from .time_steps import other_step

__all__ = ["unlike_alone", "unlike_records"]

MOST = 64  # records that are fitted alone
SHOWN = 2  # parameters
FEWEST = 2  # equations a parameter
LITTLE = 0.5  # of the power of the noise: what is left besides, if it is so small a part of what was
EXPLAINED = 0.01
DROWNED = 10.0  # times the usual level of noise of records
ALIKE = 0.01  # relative: steps that differ by rounding


def unlike_records(fit: Estimates) -> Doubt | None:
    """That records have parameters of their own: each alone leaves only the noise, and all together do not.

    A Wald test of the estimates of each. Where the scale of one channel in some of the records explains it,
    that is named. Where the model is wrong for every record, or one change of it explains all, records say
    nothing of parameters.
    """
    each, right = _alone(fit)
    if not right:
        return None
    if len(right) < len(each):
        return _of_rest(fit, each, _joined(fit, right))
    fits = [own for own in each if own is not None]
    values, errors = (np.array([getattr(own, name) for own in fits]) for name in ("params", "bse"))
    covs = [own.cov_params() for own in fits]
    if not np.all(errors > 0):
        return None
    parts = _weighted(values, covs)
    p = _p_value(parts, range(len(fits)))
    if not p < SURE:
        return None
    most = [right[at] for at in _agreeing(parts)]
    if (len(most) > 1 or len(right) == 2) and (slip := _of_rest(fit, each, most)):
        return slip
    cure = likely_cure(fit) if fit.usable and not fit.layout.rational else None
    if cure is not None and cure.level_p > ENOUGH:
        return None
    return Doubt(
        f"The records disagree on the parameters (p = {p:.1g}): {_told(fit, values, errors)}. Each alone is "
        "explained up to its noise, all together are not, as those of two flight conditions. First fit "
        "records of one condition at a time."
    )


@kept
def _alone(fit: Estimates) -> tuple[list[Estimates | None], list[int]]:
    """Fits of each record of a list that fails or leaves more than noise, and which of them leave only noise.

    Nothing of other fits; None where a record allows no fit.
    """
    records = fit.records or ()
    if not 1 < len(records) <= MOST or fit.again is None or not fit.params.size:
        return [], []
    if fit.usable and fit.success and not level_p(fit) < SURE and not _drowned(fit):
        return [], []
    # Of records with other steps the band of one is not that of another, or beyond its last line.
    steps = [rec.duration / rec.intervals for rec in records]
    alike = max(steps) < (1 + ALIKE) * min(steps)
    options = on_band(fit, fit.band) if fit.usable and alike else fit.options
    each = [again_at_all(fit, (rec,), fit.structure, options) for rec in records]
    return each, [k for k, own in enumerate(each) if own is not None and _right(own, len(each))]


def _drowned(fit: Estimates) -> bool:
    """Whether one record has so high a level of its own that it counts for nothing."""
    levels = fit.record_levels
    return levels is not None and bool(np.max(levels) > DROWNED * np.median(levels))


def unlike_alone(fit: Estimates) -> tuple[int, Estimates | None] | None:
    """The first record, with its own fit, of those without which a list leaves only the noise."""
    each, right = _alone(fit)
    if not len(each) / 2 < len(right) < len(each) or _others(fit) is None:
        return None
    k = min({*range(len(each))} - {*right})
    return k, each[k]


@kept
def _others(fit: Estimates) -> Estimates | None:
    """The fit of the records that leave only noise alone, where it does so, too."""
    return _together(fit, _alone(fit)[1])


def _together(fit: Estimates, right: Sequence[int]) -> Estimates | None:
    """The fit of these records, where it leaves only the noise."""
    records = fit.records or ()
    found = again(fit, tuple([records[k] for k in right]), fit.structure, fit.options)
    return found if found is not None and _explains(fit, found) else None


def _joined(fit: Estimates, right: Sequence[int]) -> list[int]:
    """These records with those that only together with them leave only noise, as no input of theirs moves."""
    found = list(right)
    for k in sorted({*range(len(fit.records or ()))} - {*right}):
        found += [k] if _together(fit, [*found, k]) is not None else []
    return sorted(found)


def _right(fit: Estimates, count: int = 1) -> bool:
    """Whether a fit leaves only the noise."""
    return fit.usable and fit.success and level_p(fit) > ENOUGH / count


def _explains(fit: Estimates, other: Estimates) -> bool:
    """Whether another fit leaves the noise, or beside what this one leaves next to nothing more.

    Inputs that are a little noisy leave more than the noise of the outputs in a fit that is right, too.
    """
    if not (other.usable and other.success):
        return False
    before, after = (one.chi2 / one.df_resid - 1 if one.usable else inf for one in (fit, other))
    return level_p(other) > ENOUGH or after < min(LITTLE, EXPLAINED * before)


def _of_channels(fit: Estimates, base: Estimates | None, right: Sequence[int]) -> list[Change]:
    """The change of a channel in every record but the right ones with which only the noise is left of all.

    `base`: the fit of the right ones.
    """
    records = fit.records or ()
    if base is None:
        return []
    changed, found = list(records), list[Change]()
    for k in sorted({*range(len(records))} - {*right}):
        change = likeliest_change(base, records[k], k)
        if change is None:
            return []
        changed[k] = change.undone(records[k])
        found.append(change)
    whole = again(fit, tuple(changed), fit.structure, fit.options)
    return found if whole is not None and _explains(fit, whole) else []


def _of_step(fit: Estimates, base: Estimates, own: Estimates | None, k: int) -> Doubt | None:
    """That record `k` has another time step than the others say, where only the noise is left of all so.

    `base`: the fit of the others; `own`: of the record.
    """
    records = list(fit.records or ())
    own = own if own is not None and _right(own) else None
    slip = other_step(base, records[k], k, own)
    if slip is None:
        return None
    records[k] = slip.undone(records[k])
    whole = again(fit, tuple(records), fit.structure, fit.options)
    # Of a record whose lines lie beyond the band of the others nothing is left, either.
    told = whole is not None and _right(whole) and whole.rows[k] > FEWEST * whole.params.size
    return slip.told(fit, own, base) if told else None


def _of_rest(fit: Estimates, each: Sequence[Estimates | None], most: Sequence[int]) -> Doubt | None:
    """The time step or channel with which the rest of the records agree with these.

    Only records in which a channel moves tell whether it is wrong. Where as many say the one as the other,
    nothing but a unit tells which are wrong: the larger numbers are named.
    """
    rest = sorted({*range(len(each))} - {*most})
    base = _together(fit, most)
    if base is None or not rest:
        return None
    if len(rest) == 1 and (slip := _of_step(fit, base, each[rest[0]], rest[0])):
        return slip
    found, sure = _of_channels(fit, base, most), list[Change]()
    while found:
        one = found[0]
        same = [own for own in found if own.same(one)]
        found = [own for own in found if own not in same]
        silent = [k for k in most if not votes(base, (fit.records or ())[k], one)]
        against = [one.inverse(k) for k in most if k not in silent]
        if not against or len(against) == len(same):
            first, second = same, against or [one.inverse(k) for k in most]
            if one.size < 1:
                first, second = second, first
            return told(fit, first) if first[0].unit else told_both(fit, first, second, silent)
        sure += same if len(same) < len(against) else against
    return told(fit, sure) if sure else None


def _weighted(values: F64, covs: Sequence[F64]) -> tuple[F64, F64, F64]:
    """Weights of estimates, weighted estimates and their squares, about a middle one."""
    weights, about = np.array([np.linalg.pinv(cov) for cov in covs]), values - np.median(values, axis=0)
    first = np.einsum("kij,kj->ki", weights, about)
    return weights, first, np.einsum("ki,ki->k", first, about)


def _far(parts: tuple[F64, F64, F64], chosen: Sequence[int]) -> float:
    """Chi-square of these estimates about their mean."""
    weight, first, square = (part[list(chosen)].sum(axis=0) for part in parts)
    return max(float(square - first @ np.linalg.pinv(weight) @ first), 0.0)


def _p_value(parts: tuple[F64, F64, F64], chosen: Sequence[int]) -> float:
    """Wald test that all have the same parameters, in units of their errors."""
    from scipy.special import chdtrc

    return float(chdtrc((len(chosen) - 1) * parts[1].shape[1], _far(parts, chosen)))


def _agreeing(parts: tuple[F64, F64, F64]) -> list[int]:
    """Those that agree: one by one those are left out without which the others agree best."""
    chosen = list(range(len(parts[0])))
    while len(chosen) > 1 and _p_value(parts, chosen) < SURE:
        chosen.remove(min(chosen, key=lambda k: _far(parts, [j for j in chosen if j != k])))
    return chosen


def _told(fit: Estimates, values: F64, errors: F64) -> str:
    """The parameters that differ most, and in which records they are smallest and largest."""
    weights = errors**-2
    mean = (weights * values).sum(axis=0) / weights.sum(axis=0)
    far = (weights * (values - mean) ** 2).sum(axis=0)
    said = []
    for at in np.argsort(-far)[:SHOWN]:
        ends = sorted({int(np.argmin(values[:, at])), int(np.argmax(values[:, at]))})
        own = [f"{values[k, at]:.4g} ± {errors[k, at]:.2g} in record {k}" for k in ends]
        said.append(f"{fit.param_names[at]} is {' and '.join(own)}")
    return ", ".join(said)
