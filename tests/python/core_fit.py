"""How the numerical tests call the compiled core: one fit of records, and many replicates of one."""

import numpy as np
from modfun import _core
from oracle.lines import Record

DEFAULTS = {
    "method": "ml",
    "noise": "output",
    "initial_state": "unknown",
    "states": [],
    "trend": None,
    "rule": "gregory",
    "extended": True,
    "band": None,
    "harmonics": None,
    "tol": 1e-9,
    "maxiter": 50,
}
STATUS = ("ok", "maxiter", "rank", "nonfinite")


def _structure(order, numerators, kinds):
    return {
        "order": order,
        "numerators": list(numerators),
        "delays": [0.0] * len(numerators),
        "intersample": [list(kinds)],
    }


def _fitter(samples, steps, order, numerators, kinds, options):
    structure = _structure(order, numerators, kinds)
    return _core.Fitter(samples, steps, **structure, **(DEFAULTS | options))


def fit(records, order, numerators, **options):
    """`_core.Fitter.fit` of oracle records (one or a list), options as DEFAULTS where not given."""
    records = [records] if isinstance(records, Record) else records
    samples, steps = [r.y.size for r in records], [r.dt for r in records]
    return _fitter(samples, steps, order, numerators, records[0].kinds, options).fit(
        [np.ascontiguousarray(r.y[None]) for r in records],
        [np.ascontiguousarray(r.u) for r in records],
    )


def fit_many(y, u, dt, order, numerators, kinds=None, threads=1, **options):
    """`_core.Fitter.fit_many` of outputs (replicate, time) with the shared inputs u (nu, time)."""
    kinds = kinds or ["smooth"] * len(numerators)
    return _fitter([y.shape[1]], [dt], order, numerators, kinds, options).fit_many(
        np.ascontiguousarray(y[:, None, :]), np.ascontiguousarray(u[None]), threads=threads
    )


def standard_errors(found, kind="nonrobust"):
    """Square roots of the diagonal of a covariance of `fit`."""
    return np.sqrt(np.diag(found[f"cov_{kind}"]))


def relative(estimate, truth):
    """Root mean square of the relative errors of the parameters."""
    return float(np.sqrt(np.mean((np.asarray(estimate) / truth - 1) ** 2)))
