"""Whether the records of one fit agree on its parameters."""

from __future__ import annotations

import numpy as np

from ..base.arrays import F64
from .cures import ENOUGH, again, of_written, on_band
from .diagnosis import level_p
from .doubts import SURE, Doubt
from .estimates import Estimates

__all__ = ["unlike_records"]

MOST = 64  # records that are fitted alone
SHOWN = 2  # parameters


def unlike_records(fit: Estimates) -> Doubt | None:
    """That records have parameters of their own: each alone leaves only the noise, and all together do not.

    A Wald test of the estimates of each. Where the model is wrong for one record already, or one change of it
    explains all, records say nothing of parameters.
    """
    records = fit.records or ()
    if not 1 < len(records) <= MOST or fit.again is None or not fit.params.size or not level_p(fit) < SURE:
        return None
    each, options = list[Estimates](), on_band(fit, fit.band)
    for rec in records:
        own = again(fit, (rec,), fit.structure, options)
        if own is None or not own.success or not level_p(own) > ENOUGH / len(records):
            return None
        each.append(own)
    values, errors = (np.array([getattr(own, name) for own in each]) for name in ("params", "bse"))
    if not np.all(errors > 0) or not (p := _p_value(values, [own.cov_params() for own in each])) < SURE:
        return None
    cure = None if fit.layout.rational else of_written(fit, first_only=True)
    if cure is not None and cure.level_p > ENOUGH:
        return None
    return Doubt(
        f"The records disagree on the parameters (p = {p:.1g}): {_told(fit, values, errors)}. Each alone is "
        "explained up to its noise, all together are not, as those of two flight conditions. First fit "
        "records of one condition at a time."
    )


def _p_value(values: F64, covs: list[F64]) -> float:
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
