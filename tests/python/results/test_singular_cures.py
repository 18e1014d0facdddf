"""Terms that fit by rounding alone are no cures."""

from __future__ import annotations

from dataclasses import replace

import modfun as mf
import numpy as np
import pytest
from modfun.results.lags import EXTRA
from modfun.results.neighbours import singular


@pytest.mark.parametrize(("extra", "error", "level", "rounding"), [
    (1.9e64, 9e73, 1e-21, True), (1.9e64, 9e73, 0.01, True), (0.4, 0.01, 1e-21, True),
    (0.4, 0.01, 0.01, False),
])  # fmt: skip
def test_what_rounding_leaves_is_no_cure(extra: float, error: float, level: float, rounding: bool) -> None:
    """A Monod reactor at 1e-4 noise was advised of a term in X**2*X' with a coefficient of 1.9e+64."""
    t = np.arange(0, 20, 0.1)
    y = np.exp(-0.3 * t) + 0.01 * np.random.default_rng(0).normal(size=t.size)
    fit = mf.fit(mf.Record(y=y, dt=0.1), mf.Equation(f"y' + a*y + {EXTRA}*y**2 = 0"))
    at = fit.param_names.index(EXTRA)
    params, cov = np.array(fit.params), np.array(fit.cov_spectral)
    params[at], cov[at, at] = extra, error**2
    made = replace(
        fit, params=params, cov_nonrobust=cov, cov_spectral=cov, noise_cov=np.array([[level**2]]),
        record_levels=np.ones((1, 1)),
    )  # fmt: skip
    assert singular(made) == rounding
