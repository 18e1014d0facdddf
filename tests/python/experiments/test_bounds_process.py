"""The Cramér–Rao bound under process noise beside the likelihood of all samples."""

from typing import Any

import modfun as mf
import numpy as np
import pytest
from oracle import process_noise as oracle

DEN, NUM, T, N = [1.0, 3.0, 8.0], [[5.0]], 10.0, 256
EQ24 = mf.tf([5], DEN)
SIGMA, LEVEL = 0.03, 0.25
VALUES = {"a": 3.0, "k": 8.0, "b": 5.0}


def record(intervals: int = N) -> mf.Record:
    return mf.simulate(EQ24, input="sin(t**2/5)", duration=T * intervals / N, intervals=intervals)


@pytest.mark.parametrize(("level", "sigma", "offset"), [(0.25, 0.03, True), (0.6, 0.005, False)])
def test_it_is_that_of_the_dense_covariance(level: float, sigma: float, offset: bool) -> None:
    given: list[Any] = [DEN, NUM, [lambda t: np.sin(t**2 / 5)], level**2, sigma, T / N, N]
    given += [lambda x: ([1.0, *x[:2]], [[x[2]]]), offset]
    exact = oracle.bound(*given, restricted=False)
    bound = mf.crlb(EQ24, record(), sigma=sigma, process_noise=level, trend="constant" if offset else None)
    np.testing.assert_allclose(bound.cov, exact[:3, :3], rtol=1e-5)
    # The restricted likelihood, which integrates the initial state out, tells hardly less.
    np.testing.assert_allclose(bound.sd, np.sqrt(np.diag(oracle.bound(*given)))[:3], rtol=0.01)


def test_noise_in_an_equation_through_an_input_and_in_a_transfer_function_is_one() -> None:
    rec = record()
    bound = mf.crlb(EQ24, rec, sigma=SIGMA, process_noise=LEVEL)
    own = {"states": ["x", "v"], "C": [[1, 0]]}
    model = mf.StateSpace([[0, 1], ["-k", "-a"]], [[0], ["b"]], inputs=["u"], **own)
    named = rec.rename(u="u") if "u" not in rec.inputs else rec
    states = mf.crlb(model, named, params=VALUES, sigma=SIGMA, process_noise=[0.0, LEVEL])
    for name, other in zip(("a1", "a2", "b0"), ("a", "k", "b"), strict=True):
        assert states[other] == pytest.approx(bound[name], rel=1e-6)
    gusty = mf.StateSpace([[0, 1], ["-k", "-a"]], [[0, 0], ["b", 1]], inputs=["u", "w"], **own)
    noise = mf.ProcessNoise(w=LEVEL)
    through = mf.crlb(gusty, named, params=VALUES, sigma=SIGMA, process_noise=noise)
    assert through["k"] == pytest.approx(bound["a2"], rel=1e-6)


def test_without_process_noise_in_the_limit() -> None:
    plain, tiny = (mf.crlb(EQ24, record(), sigma=SIGMA, process_noise=level) for level in (0.0, 1e-5))
    np.testing.assert_allclose(tiny.cov, plain.cov, rtol=1e-5)


def test_masked_and_weighted_samples() -> None:
    rec = record()
    keep = np.arange(N + 1) <= 200
    masked = mf.crlb(EQ24, rec.weigh(mask=keep), sigma=SIGMA, process_noise=LEVEL)
    short = mf.crlb(EQ24, record(200), sigma=SIGMA, process_noise=LEVEL)
    np.testing.assert_allclose(masked.cov, short.cov, rtol=1e-6)
    weighed = mf.crlb(EQ24, rec.weigh(sigma=np.full(N + 1, 2.0)), sigma=SIGMA, process_noise=LEVEL)
    twice = mf.crlb(EQ24, rec, sigma=2 * SIGMA, process_noise=LEVEL)
    np.testing.assert_allclose(weighed.cov, twice.cov, rtol=1e-9)


def test_a_known_start_tells_more_and_records_add_up() -> None:
    rec = record()
    bound = mf.crlb(EQ24, rec, sigma=SIGMA, process_noise=LEVEL)
    known = mf.crlb(EQ24, rec, sigma=SIGMA, process_noise=LEVEL, initial_state="zero")
    assert np.all(known.sd < bound.sd)
    two = mf.crlb(EQ24, [rec, rec], sigma=SIGMA, process_noise=LEVEL)
    np.testing.assert_allclose(two.cov, bound.cov / 2, rtol=1e-9)


def test_of_a_fit_its_levels() -> None:
    rec = mf.simulate(EQ24, input="sin(t**2/5)", duration=T, intervals=N, nsr=0.1, process_noise=0.4, seed=1)
    fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0), noise="process")
    sensor, process = fit.process_noise()["level"]
    again = mf.crlb(
        fit.model, rec, sigma=sensor, process_noise=process, trend=fit.trend, start=fit.initial_state().state
    )
    np.testing.assert_allclose(mf.crlb(fit).sd, again.sd, rtol=1e-9)
    assert np.all(fit.bse / again.sd < 1.5)
    assert np.all(fit.bse / again.sd > 0.7)


def test_of_a_fit_with_levels_of_ones_own() -> None:
    rec = mf.simulate(EQ24, input="sin(t**2/5)", duration=T, intervals=N, nsr=0.1, seed=1)
    fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    told = mf.crlb(fit, rec, sigma=float(np.sqrt(fit.noise_cov[0, 0])), process_noise=5.0)
    np.testing.assert_allclose(mf.crlb(fit, rec, process_noise=5.0).sd, told.sd, rtol=1e-9)
    assert np.all(mf.crlb(fit, process_noise=5.0).sd > 10 * mf.crlb(fit).sd)
    with pytest.raises(mf.SpecError, match="process_noise=-5 must be a level of at least 0"):
        mf.crlb(fit, process_noise=-5)


def test_what_is_refused() -> None:
    decay = mf.Equation("y' + a*y**3 = u").model({"a": 1.0})
    rec = mf.simulate(decay, input="sin(t)", duration=5.0, intervals=50)
    with pytest.raises(mf.SpecError, match="crlb: process_noise= is for linear systems"):
        mf.crlb(decay, rec, sigma=0.1, process_noise=0.1)
    with pytest.raises(mf.SpecError, match="crlb: process_noise=-1 must be a level of at least 0"):
        mf.crlb(EQ24, record(), sigma=0.1, process_noise=-1)
    with pytest.raises(mf.SpecError, match="crlb: process_noise: 'w' is not an input of the system"):
        mf.crlb(
            mf.StateSpace([["-a"]], [[1]], states=["x"], inputs=["u"]), record(), params={"a": 1.0},
            sigma=0.1, process_noise=mf.ProcessNoise(w=1.0),
        )  # fmt: skip
