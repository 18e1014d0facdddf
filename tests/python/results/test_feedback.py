"""Noise that a loop feeds back: seen, with its bias, and not where there is none."""

from __future__ import annotations

import warnings

import loops
import modfun as mf
import numpy as np
import pytest
from loops import LEVEL, MODEL, TRUTH
from modfun.results.feedback import _loop, _residuals, feedback
from modfun.results.followers import LAGS, PAST, granger, lags_of, led_inputs
from scipy.signal import lfilter
from scipy.stats import f


def said(rec: mf.Record, model: mf.TransferFunction = MODEL, **words: object) -> str:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        mf.fit(rec, model, **words)  # type: ignore[arg-type]
    return "; ".join(str(one.message) for one in caught)


def test_a_loop_warns_with_the_cure_that_helps() -> None:
    """20 records at 30 % noise, where the bias is 0.8 standard deviations: of 300 others 99.7 % warned. At a
    rate of 97 % fewer than 17 of 20 have a chance of 0.003. `check` finds it in at least as many.
    """
    warned = 0
    for seed in range(100, 120):
        rec = loops.record(LEVEL, seed)
        text = said(rec)
        warned += "u follows earlier residuals of y" in text and 'reference="r"' in text
        assert "follows earlier" not in said(rec, reference="r")
    assert warned >= 17


STABLE = np.array([3.0, 8.0, 5.0])
# Plant, gains of the controller, noise over the response, largest bias by 1,500 records.
LOOPS = {
    "strong": (TRUTH, (1.5, 0.7), 0.3, 0.81),
    "half": (TRUTH, (1.5, 0.7), 0.1, 0.28),
    "quarter": (TRUTH, (1.5, 0.7), 0.05, 0.15),
    "weak": (TRUTH, (0.7, 0.3), 0.3, 0.81),
    "stable": (STABLE, (1.0, 0.3), 0.3, 0.07),
    "stable, weak": (STABLE, (0.5, 0.1), 0.3, 0.05),
}


def flights(which: str, seeds: range) -> tuple[list[mf.Record], np.ndarray]:
    """Records of a loop, and the parameters of its plant."""
    truth, gains, share, _ = LOOPS[which]
    level = share * float(loops.flown(0.0, 0, truth=truth, gains=gains)[0].std())
    return [loops.record(level, seed, truth=truth, gains=gains) for seed in seeds], truth


@pytest.mark.parametrize("which", LOOPS)
def test_a_bias_is_said_before_it_exceeds_a_third(which: str) -> None:
    """30 records each. Of 300 others 99 % warned where the bias is above 0.6 standard deviations, 96 % where
    it is 0.28, and none or one below 0.16: the chance that this fails is below 0.003 in each.
    """
    warned = sum("follows earlier residuals" in said(rec) for rec in flights(which, range(200, 230))[0])
    bias = LOOPS[which][-1]
    if bias < 0.2:
        assert warned <= 2
    else:
        assert warned >= (27 if bias > 0.5 else 24)


@pytest.mark.statistics
@pytest.mark.parametrize("which", LOOPS)
def test_the_bias_is_that_of_many_records(which: str) -> None:
    """The mean of what is said of 40 records is within 0.15 standard errors and a quarter of the largest bias
    by 400 records, three of its errors there: the formula is of first order in the noise.
    """
    records, truth = flights(which, range(400))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fits = [mf.fit(rec, MODEL) for rec in records]
    found = [feedback(fit) for fit in fits[:40]]
    errors = np.array([fit.params for fit in fits]) - truth
    true = float(np.max(np.abs(np.mean(errors, axis=0) / np.std(errors, axis=0))))
    told = float(np.mean([one.bias for one in found if one]))
    assert abs(told - true) < 0.15 + 0.25 * true


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
    """The F test of past residuals, by two regressions with columns written out."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit = mf.fit(loops.record(LEVEL, 3), MODEL)
    e = _residuals(fit, 0)[0]
    found = granger(led_inputs(fit)[0, 0], e, lags_of(fit, 0))
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
    assert found == pytest.approx(f.sf(gained / more / (left / free), more, free), rel=1e-6)


@pytest.mark.oracle
def test_the_loop_is_that_of_least_squares() -> None:
    """Coefficients and covariance of the regression on past inputs and outputs with columns written out, and
    the controller they tell of: a gain of 1.5 for steady outputs.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit = mf.fit(loops.record(LEVEL, 3), MODEL)
    found = _loop(fit, 0, 0, [0], _residuals(fit, 0))
    assert found is not None
    whose, c, cov = found
    u, y = (part[0, -fit.intervals[0] - 1 : -1] for part in (fit.records[0].u, fit.records[0].y))
    lags = range(0 if fit.intersample == ("zoh",) else 1, LAGS + 1)
    assert whose == [("u", 0, lag) for lag in range(1, PAST + 1)] + [("y", 0, lag) for lag in lags]
    rows = [[1.0, *u[t - PAST : t][::-1], *(y[t - lag] for lag in lags)] for t in range(PAST, u.size)]
    columns, side = np.array(rows), u[PAST:]
    slopes, (left,) = np.linalg.lstsq(columns, side, rcond=None)[:2]
    np.testing.assert_allclose(c, slopes[1:], rtol=0, atol=1e-8 * np.abs(slopes).max())
    whole = left / (side.size - columns.shape[1]) * np.linalg.inv(columns.T @ columns)[1:, 1:]
    np.testing.assert_allclose(cov, whole, rtol=0, atol=1e-7 * np.abs(whole).max())
    assert c[PAST:].sum() / (1 - c[:PAST].sum()) == pytest.approx(-1.5, abs=0.1)


def test_inputs_that_follow_from_their_past_are_not_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    """Coarse samples of a sweep, which cubics do not foresee: a regression on its past does."""
    monkeypatch.setattr("modfun.results.feedback._residuals", lambda *_: pytest.fail("looked at"))
    sweep = mf.simulate(
        mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=20.0, intervals=256, nsr=0.1, seed=0
    )
    mf.fit(sweep, MODEL)
    with pytest.raises(pytest.fail.Exception, match="looked at"):
        mf.fit(loops.record(LEVEL, 0), MODEL)


def sines(count: int, dt: float, seed: int) -> np.ndarray:
    """Twelve from 0.05 to 1.5 Hz."""
    hertz, t = np.geomspace(0.05, 1.5, 12), dt * np.arange(count + 1)
    phases = np.random.default_rng(seed).uniform(0, 6.28, 12)
    return np.sin(2 * np.pi * np.outer(hertz, t) + phases[:, None]).sum(axis=0) / 3


def helps(rec: mf.Record, model: mf.TransferFunction, **words: str) -> bool:
    """Whether the fit with the command is silent, or uncertain."""
    try:
        told = said(rec, model, reference="r", **words)
    except mf.FitError:
        return False
    return not told or "is uncertain: the standard error" in told


def test_a_command_that_was_tried_in_vain_is_not_advised() -> None:
    """A third-order plant whose command moves its input less than the rate's noise does. In 6 records, the
    reference is advised where the fit with it helps, also if in coloured noise only, and else something else.
    """
    plant, model = ([8.0], np.polymul([1, 2], [1, 1.5, 4])), mf.TransferFunction(poles=3, zeros=0)
    alone = []
    for seed in range(6):
        rec = loops.closed(plant, (1.5, 0.8, 0.5), sines(1000, 0.1, seed), 0.1, 0.1, seed)
        text = said(rec, model)
        assert "u follows earlier residuals of y" in text
        alone.append(helps(rec, model))
        advised = 'First fit with the command of the loop, reference="r"' in text
        assert advised == (alone[-1] or helps(rec, model, noise="coloured"))
        assert ("r moves u too little beside the noise" in text) != advised
    assert 0 < sum(alone) < 6


def test_without_the_command_the_advice_says_how_to_keep_it() -> None:
    rec = loops.record(LEVEL, 100)
    bare = mf.Record(y=rec.y, u=rec.u, dt=loops.DT, intersample="zoh")
    assert 'Record(keep={"r": ...}), and fit with reference="r";' in said(bare)
    other = mf.Record(y=rec.y, u=rec.u, dt=loops.DT, intersample="zoh", keep={"set": rec["r"]})
    assert 'First fit with the command of the loop, reference="set".' in said(other)
