"""Noise that a loop feeds back: seen, with its bias, and not where there is none."""

from __future__ import annotations

import warnings

import loops
import modfun as mf
import numpy as np
import pytest
from loops import LEVEL, MODEL
from modfun.results.feedback import LAGS, PAST, _granger, _lags, _led, _residuals, feedback
from scipy.signal import lfilter
from scipy.stats import f


def said(rec: mf.Record, model: mf.TransferFunction = MODEL, **words: object) -> str:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        mf.fit(rec, model, **words)  # type: ignore[arg-type]
    return "; ".join(str(one.message) for one in caught)


def test_a_loop_warns_with_the_cure_that_helps() -> None:
    """20 records at 30 % noise, where the bias is 0.85 standard deviations: of 60 others 93 % warned; fewer
    than 15 of 20 have a chance of 0.003. `check` finds it in at least as many.
    """
    warned = 0
    for seed in range(100, 120):
        rec = loops.record(LEVEL, seed)
        text = said(rec)
        warned += "u follows earlier residuals of y" in text and 'reference="r"' in text
        assert "follows earlier" not in said(rec, reference="r")
    assert warned >= 15


@pytest.mark.statistics
def test_the_bias_is_about_right() -> None:
    """Over 60 records the mean of what is said is 0.7 to 2 times the largest bias: its own scatter is 0.3
    standard errors per record, and it is the largest of three.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fits = [mf.fit(loops.record(LEVEL, seed), MODEL) for seed in range(60)]
    found = [feedback(fit) for fit in fits]
    told = np.mean([one.bias for one in found if one])
    errors = np.array([fit.params for fit in fits]) - loops.TRUTH
    true = np.max(np.abs(errors.mean(axis=0) / errors.std(axis=0)))
    assert true > 0.5
    assert 0.7 < told / true < 2.0


@pytest.mark.parametrize("pole", [0.0, 0.9])
@pytest.mark.parametrize("kind", ["sweep", "held noise", "loop without noise"])
def test_open_loops_do_not_warn(kind: str, pole: float) -> None:
    """40 records each; a chance of 1e-4 per record at the stated level."""
    rng = np.random.default_rng(1)
    system, words = mf.tf([5], [1, 3, 8]), {"duration": 20.0, "intervals": 400}
    if kind == "sweep":
        clean = mf.simulate(system, input="sin(t**2/5)", **words)
    elif kind == "held noise":
        u = lfilter([1], [1, -0.9], rng.standard_normal(401))
        clean = mf.simulate(system, input=u, intersample="zoh", **words)
    else:
        clean = loops.record(0.0, 0)
    count, size = clean.t.size, clean["y"].std()
    for _ in range(40):
        white = rng.standard_normal(count + 200)
        noise = lfilter([np.sqrt(1 - pole**2)], [1, -pole], white)[200:]
        fit = mf.fit(clean.assign(y=clean["y"] + 0.1 * size * noise), MODEL)
        assert not any("earlier residuals" in text for text in fit.check())


@pytest.mark.oracle
def test_the_regression_is_that_of_least_squares() -> None:
    """F test, coefficients and their covariance by two regressions with columns written out."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit = mf.fit(loops.record(LEVEL, 3), MODEL)
    e = _residuals(fit, 0)[0]
    found = _granger(_led(fit)[0, 0], e, _lags(fit, 0))
    assert found is not None
    u = fit.records[0].u[0, -fit.intervals[0] - 1 : -1]
    u = u - u.mean()
    first = 0 if fit.intersample == ("zoh",) else 1
    rows = [[1.0, *u[t - PAST : t][::-1], *e[t - LAGS : t + 1 - first][::-1]] for t in range(PAST, u.size)]
    columns, side = np.array(rows), u[PAST:]
    both = np.linalg.lstsq(columns, side, rcond=None)[0]
    alone = np.linalg.lstsq(columns[:, : PAST + 1], side, rcond=None)[0]
    left = np.sum((side - columns @ both) ** 2)
    gained = np.sum((side - columns[:, : PAST + 1] @ alone) ** 2) - left
    free, more = side.size - columns.shape[1], columns.shape[1] - PAST - 1
    assert found.p_value == pytest.approx(f.sf(gained / more / (left / free), more, free), rel=1e-6)
    np.testing.assert_allclose(found.coefficients, both[1:], rtol=0, atol=1e-8 * np.abs(both).max())
    cov = left / free * np.linalg.inv(columns.T @ columns)[1:, 1:]
    np.testing.assert_allclose(found.cov, cov, rtol=0, atol=1e-7 * np.abs(cov).max())


def test_inputs_that_follow_from_their_past_are_not_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    """Coarse samples of a sweep, which cubics do not foresee: a regression on its past does."""
    monkeypatch.setattr("modfun.results.feedback._residuals", lambda *_: pytest.fail("looked at"))
    sweep = mf.simulate(
        mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=20.0, intervals=256, nsr=0.1, seed=0
    )
    mf.fit(sweep, MODEL)
    with pytest.raises(pytest.fail.Exception, match="looked at"):
        mf.fit(loops.record(LEVEL, 0), MODEL)
