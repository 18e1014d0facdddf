"""Whether the records of one fit agree on its parameters, and which channel of which record does not."""

from __future__ import annotations

from collections.abc import Sequence
from math import log

import numpy as np

from ..base.arrays import F64
from ..base.cached import kept
from .cures import ENOUGH, again, again_at_all, likely_cure, on_band
from .diagnosis import level_p
from .doubts import SURE, Doubt
from .estimates import Estimates
from .odd_channels import Change, likeliest_change, told

__all__ = ["unlike_alone", "unlike_records"]

MOST = 64  # records that are fitted alone
SHOWN = 2  # parameters
DROWNED = 10.0  # times the usual level of records
CLOCKS = (10.0, 0.1, 2.0, 0.5, 4.0, 0.25, 5.0, 0.2, 100.0, 0.01, 1000.0, 0.001, 60.0, 1 / 60)  # usual slips
SLACK = 0.15  # of the logarithm of a speed


def unlike_records(fit: Estimates) -> Doubt | None:
    """That records have parameters of their own: each alone leaves only the noise, and all together do not.

    A Wald test of the estimates of each. Where the scale of one channel in some of the records explains it,
    that is named. Where the model is wrong for every record, or one change of it explains all, records say
    nothing of parameters.
    """
    each, right = _alone(fit)
    if each and (clock := _of_clock(fit, _on_own_bands(fit, each, right))):
        return Doubt(clock)
    if not right:
        return None
    if len(right) < len(each):
        found = _of_channels(fit, _others(fit), right)
        return told(fit, found) if found else None
    fits = [own for own in each if own is not None]
    values, errors = (np.array([getattr(own, name) for own in fits]) for name in ("params", "bse"))
    covs = [own.cov_params() for own in fits]
    if not np.all(errors > 0) or not (p := _p_value(values, covs)) < SURE:
        return None
    for k in right:
        others = [j for j in right if j != k]
        if len(others) > 1 and not _p_value(values[others], [covs[j] for j in others]) > ENOUGH:
            continue
        found = _of_channels(fit, _together(fit, others), others)
        # Of two records the one with the larger numbers is named.
        if found and not (len(others) == 1 and k == 0 and found[0].size < 1):
            return told(fit, found)
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
    options = on_band(fit, fit.band) if fit.usable else fit.options
    each = [again_at_all(fit, (rec,), fit.structure, options) for rec in records]
    right = [k for k, own in enumerate(each) if own is not None and _right(own, len(each))]
    if (
        fit.usable
        and 2 * len(right) <= len(each)
        and fit.options.band is None
        and fit.options.harmonics is None
    ):
        # A band that one record with a wrong clock asks for suits no other.
        each = [again_at_all(fit, (rec,), fit.structure, fit.options) for rec in records]
        right = [k for k, own in enumerate(each) if own is not None and _right(own, len(each))]
    return each, right


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
    return found if found is not None and _right(found) else None


def _right(fit: Estimates, count: int = 1) -> bool:
    """Whether a fit leaves only the noise."""
    return fit.usable and fit.success and level_p(fit) > ENOUGH / count


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
    return found if whole is not None and _right(whole) else []


def _on_own_bands(fit: Estimates, each: Sequence[Estimates | None], right: Sequence[int]) -> list[Estimates]:
    """Fits of each record, all of which leave only the noise; nothing where one does not.

    On bands of their own where that of all suits some only, as one that a record with a wrong clock asks for.
    """
    found, free = list(each), fit.options.band is None and fit.options.harmonics is None
    for k in sorted({*range(len(each))} - {*right}) if free and fit.layout.rational else ():
        found[k] = again(fit, (fit.records[k],), fit.structure, fit.options) if fit.records else None
    alone = [own for own in found if own is not None and _right(own, len(each))]
    return alone if len(alone) == len(each) else []


def _of_clock(fit: Estimates, fits: Sequence[Estimates]) -> str:
    """That one record is as fast as with another time step, in words; nothing where none is."""
    records = fit.records or ()
    if not fit.layout.rational:
        return ""
    each = [own.layout.polynomials(own.params, 0)[0] for own in fits]
    for k, own in enumerate(each):
        others, dt = [den for j, den in enumerate(each) if j != k], records[k].dt
        for size in CLOCKS if dt else ():
            if dt and all(_faster(own, den, size) for den in others):
                speed = f"{size:g} times as fast as" if size > 1 else f"{1 / size:g} times slower than"
                either = ", unless that of the other is wrong" if len(each) == 2 else ""
                return (
                    f"Record {k} by itself is explained up to its noise, as the others are, and is {speed} "
                    f"they: its time step seems to be {dt * size:.4g} s and not {dt:.4g} s{either}. First "
                    "look at its clock."
                )
    return ""


def _faster(one: F64, other: F64, size: float) -> bool:
    """Whether the coefficients of a denominator are those of another one in a time that is scaled so."""
    orders = np.arange(1, one.size)
    with np.errstate(all="ignore"):
        off = np.log(one[1:] / other[1:]) - orders * log(size)
    return one.size > 1 and bool(np.all(np.abs(off) < SLACK * orders))


def _p_value(values: F64, covs: Sequence[F64]) -> float:
    """Wald test that all have the same parameters, in units of their errors."""
    from scipy.special import chdtrc

    weights = [np.linalg.pinv(cov) for cov in covs]
    mean = np.linalg.pinv(sum(weights)) @ sum(w @ own for w, own in zip(weights, values, strict=True))
    far = sum(float((own - mean) @ w @ (own - mean)) for w, own in zip(weights, values, strict=True))
    return float(chdtrc((len(values) - 1) * mean.size, far))


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
