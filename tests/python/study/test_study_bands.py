"""Studies of records that a function makes: their default bands, and records of several outputs."""

from __future__ import annotations

from typing import Any

import modfun as mf
import numpy as np
import pytest

ONE = mf.TransferFunction(poles=1, zeros=0)
PLANT = mf.tf([2], [0.5, 1])
TWO = mf.tf([[[5]], [[1, 1]]], [[[1, 3, 8]], [[1, 3, 8]]])
COMMON = mf.TransferFunction(poles=2, zeros=1, denominator="common")
CLEAN = mf.simulate(TWO, input="sin(t**2/5)", duration=10.0, intervals=256)


def random_steps(cell: dict[str, Any], rng: np.random.Generator) -> mf.Record:
    """A plant of first order under another sequence of +1 and -1 in each replicate, heavy-tailed noise."""
    u = np.repeat(rng.choice([-1.0, 1.0], size=5), 8)[:33]
    clean = mf.simulate(PLANT, input=u, duration=1.6, intervals=32, intersample="zoh")
    noise = 0.2 * rng.standard_t(3, 33) / np.sqrt(3)
    return clean.assign(y=lambda rec: rec["y"] + noise)


def two_outputs(cell: dict[str, Any], rng: np.random.Generator) -> mf.Record:
    noise = 0.05 * rng.standard_normal(CLEAN.y.shape)
    return CLEAN.assign(y1=lambda rec: rec["y1"] + noise[0], y2=lambda rec: rec["y2"] + noise[1])


@pytest.mark.parametrize("seed", [10, 24, 36])
def test_where_inputs_differ_no_unlucky_record_gives_its_band_to_all(seed: int) -> None:
    study = mf.MonteCarlo(
        generate=random_steps, truth={"a1": 2.0, "b0": 4.0}, estimators={"ml": mf.Estimator(ONE)},
        replicates=120, seed=seed,
    )  # fmt: skip
    res = study.run(progress=False, keep="samples")
    _, fits = res.replicate(3)
    assert res.samples is not None
    np.testing.assert_allclose(res.samples[0, 3], fits["ml"].params, rtol=1e-10)
    lines = fits["ml"].band[1] * 1.6 / (2 * np.pi)
    assert 5.9 < lines < 8.1
    assert np.all(res.coverage > 0.9)


def test_records_of_two_outputs_are_fitted_by_methods_and_estimators() -> None:
    truth = dict(zip(COMMON.param_names(CLEAN.inputs, CLEAN.outputs), COMMON.theta(TWO), strict=True))
    res = mf.MonteCarlo(
        generate=two_outputs, truth=truth, model=COMMON, estimators={"ml": "ml", "own": mf.Estimator(COMMON)},
        replicates=20, seed=1,
    ).run(progress=False, keep="samples")  # fmt: skip
    assert res.param_names == ("a1", "a2", "b0[y1]", "b1[y1]", "b0[y2]", "b1[y2]")
    assert np.all(np.abs(res.bias) < 4 * res.bias_mcse)
    _, fits = res.replicate(5)
    assert res.samples is not None
    np.testing.assert_allclose(res.samples[:, 5], [fit.params for fit in fits.values()], rtol=1e-9, atol=1e-9)
