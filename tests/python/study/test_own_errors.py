"""Coverage of estimators that return standard errors beside their parameters."""

from __future__ import annotations

import modfun as mf
import numpy as np

TWO = mf.TransferFunction(poles=2, zeros=0)


def with_errors(rec, rng, factor=1.0):
    fit = mf.fit(rec, TWO, harmonics=8, trend=None)
    own = dict(zip(fit.param_names, fit.params.tolist(), strict=True))
    return own | {f"{k}_se": factor * e for k, e in zip(fit.param_names, fit.bse.tolist(), strict=True)}


def test_intervals_of_own_errors_are_counted_over_a_grid():
    """200 records each: 95 % cover, and of errors of half the size 67 %."""
    res = mf.MonteCarlo(
        system=mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10, intervals=128, nsr=[0.1, 0.2],
        replicates=200, seed=3,
        estimators={
            "whole": with_errors,
            "half": lambda rec, rng: with_errors(rec, rng, 0.5),
            "some": lambda rec, rng: {**with_errors(rec, rng), "a2_se": float("nan")},
            "bare": lambda rec, rng: mf.fit(rec, TWO, harmonics=8).params,
        },
    ).run(progress=False)  # fmt: skip
    whole, half, some, bare = np.moveaxis(np.asarray(res.coverage), -2, 0)
    assert whole.shape == (2, 3)
    assert np.all((whole > 0.87) & (whole <= 1))
    assert np.all((half > 0.5) & (half < 0.8))
    assert np.array_equal(some[:, [0, 2]], whole[:, [0, 2]])
    assert np.all(np.isnan(some[:, 1]))
    assert np.all(np.isnan(bare))
