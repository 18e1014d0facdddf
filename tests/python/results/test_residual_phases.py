"""Tests of residual lines take residuals and columns with the same phases, and so find what is there."""

import warnings

import modfun as mf
import numpy as np
import pytest
from modfun.results.further import _Block, _real, further

TWO = mf.TransferFunction(poles=2, zeros=0)


def late(seed: int, nsr: float) -> mf.Record:
    """5/(s² + 3s + 8) behind 0.1 s of delay, under a chirp."""
    plant = mf.tf([5], [1, 3, 8], delay=0.1)
    return mf.simulate(plant, input="sin(t**2/5)", duration=10, intervals=256, nsr=nsr, seed=seed)


def of_two_outputs() -> mf.Record:
    plant = mf.tf([[[5]], [[2, 3]]], [1, 3, 8])
    return mf.simulate(plant, input="sin(t**2/5)", duration=15, intervals=400, nsr=0.1, seed=1)


@pytest.mark.parametrize(
    ("rec", "model", "options"),
    [
        (late(0, 0.1), TWO, {}),
        (late(0, 0.1), TWO, {"method": "awls"}),
        (late(0, 0.1), mf.TransferFunction(poles=2, zeros=0, delay=mf.Free(max=0.5)), {}),
        (of_two_outputs(), mf.TransferFunction(poles=2, zeros=[[0], [1]], denominator="common"), {}),
        (of_two_outputs(), mf.TransferFunction(poles=2, zeros=[[0], [1]], denominator="separate"), {}),
    ],
)
def test_what_the_ends_add_was_fitted_and_is_not_in_the_residuals(rec, model, options):
    """They are fitted freely, so that residuals are orthogonal to them, where phases agree."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.ModfunWarning)
        fit = mf.fit(rec, model, **options)
    for i in range(len(fit.outputs)):
        block = _Block.of(fit, 0, i, None)
        ends, e = _real(block.own), _real(block.residual)
        cosines = ends @ e / np.linalg.norm(ends, axis=1) / np.linalg.norm(e)
        assert np.abs(cosines).max() < 0.01


def test_a_delay_that_a_model_lacks_is_found_in_the_noise():
    """At 20 % noise 34 of 40 were found, and 4 where phases did not agree; right fits are in test_further."""
    found = 0
    for seed in range(20):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", mf.ModfunWarning)
            fit = mf.fit(late(seed, 0.2), TWO)
        found += any(one.what == "response" and one.p_value < 0.01 for one in further(fit))
    assert found >= 12  # fewer have a chance of 1e-3 where 17 of 20 are found
