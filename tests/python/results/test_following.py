"""Residuals of a response at all samples that follow their neighbours: a law of cooling that is another."""

import warnings

import modfun as mf
import numpy as np
import pytest
from modfun.results.diagnosis import chi_square, level_p
from modfun.results.following import following_p
from scipy.integrate import solve_ivp

NEWTON = mf.Equation("T' = -k*(T - Ta)", outputs=["T"])
LAWS = {
    "free convection": lambda d: np.abs(d) ** 1.25 / 1500 / 60**0.25,
    "quadratic": lambda d: d / 1500 + 2e-6 * d**2,
    "evaporation": lambda d: d / 1500 + 4e-6 * d**2,
}
FALSE_ALARM = 1e-4  # of each right record, in theory; 200 here raise one in 2 % of all seeds


def mug(law, seed):
    """45 minutes of a mug of 82 degrees in a room of 22.4, every 10 s, to a tenth of a degree."""
    rng, t = np.random.default_rng(seed), np.arange(0, 2701, 10)
    start = [82 + rng.normal()]
    y = solve_ivp(lambda _, x: -LAWS[law](x - 22.4), (0, 2700), start, t_eval=t, rtol=1e-9, atol=1e-9).y[0]
    y = y + 0.08 * rng.standard_normal(t.size)
    return mf.Record(y=np.round(y / 0.1) * 0.1, t=t, outputs="T", units={"T": "degC"})


def said(rec):
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        fit = mf.fit(rec, NEWTON)
    return fit, [str(one.message) for one in told]


@pytest.mark.parametrize(("law", "seed"), [("free convection", 5), ("free convection", 7), ("quadratic", 1)])
def test_another_law_of_cooling_is_warned_of(law, seed):
    """Ta was 28.03 with an error of 0.14, for 22.4, and nothing was said: eight lines show little."""
    fit, told = said(mug(law, seed))
    assert fit.by_response
    assert level_p(fit) < 1e-9
    assert len(told) == 1
    assert "follow each other from sample to sample" in told[0]
    assert "Slow noise of a sensor" in told[0]
    assert chi_square(fit)[1] == 268
    summary = str(fit.summary())
    assert "for 268 degrees of freedom" in summary
    assert "in the unused high band" in summary


def test_what_is_missing_is_named_beside_it():
    fit, told = said(mug("free convection", 1))
    assert "follow each other from sample to sample" in told[0]
    assert "First try a lag of the sensor of T" in told[0]
    assert not any("noise in each equation" in one.lower() for one in fit.check())


def test_a_loaded_fit_says_the_same(tmp_path):
    fit, _ = said(mug("free convection", 5))
    fit.save(tmp_path / "fit.json")
    assert level_p(mf.load(tmp_path / "fit.json")) == level_p(fit)


@pytest.mark.parametrize("seed", range(4))
def test_a_slow_sensor_comes_with_the_term_that_does_as_well(seed):
    """A lag of 520 s, a fifth of the record, was named alone for what is lost by evaporation."""
    _, told = said(mug("evaporation", seed))
    if "a lag of the sensor of T" in told[0]:
        assert "T**2" in told[0]
        assert "which the record hardly tells apart" in told[0]


@pytest.mark.parametrize(("step", "noise"), [(0.1, 0.08), (0.1, 0.02), (0.5, 0.08), (1.0, 0.3), (0.0, 0.08)])
def test_rounding_does_not_follow_itself_beyond_doubt(step, noise):
    """Errors of coarse steps alone agree at neighbouring samples of a slow signal."""
    t, least = np.arange(0, 2701, 5.0), []
    clean = 22.4 + 60 * np.exp(-t / 1500)
    columns = np.stack([np.ones_like(t), np.exp(-t / 1500), t * np.exp(-t / 1500)], 1)
    for seed in range(40):
        y = clean + noise * np.random.default_rng(seed).standard_normal(t.size)
        rec = mf.Record(y=np.round(y / step) * step if step else y, t=t, outputs="T")
        left = rec.y[0] - columns @ np.linalg.lstsq(columns, rec.y[0], rcond=None)[0]
        least.append(following_p((rec,), [left[None]], [np.ones((1, t.size))]))
    assert min(least) > FALSE_ALARM


def test_the_law_without_rounding():
    """p-values of white noise are even: of 400 below 0.05, 20 are expected, and 37 or more in 2 of 10,000."""
    t, rng = np.arange(300.0), np.random.default_rng(1)
    rec, ones = mf.Record(y=rng.standard_normal(t.size), t=t, outputs="y"), [np.ones((1, t.size))]
    p = [following_p((rec,), [rng.standard_normal((1, t.size))], ones) for _ in range(400)]
    assert 6 <= np.sum(np.array(p) < 0.05) < 37


def test_masked_samples_are_no_neighbours():
    rng = np.random.default_rng(2)
    left = np.repeat(rng.standard_normal(150), 2)[None]
    rec = mf.Record(y=rng.standard_normal(300), t=np.arange(300.0), outputs="y")
    assert following_p((rec,), [left], [np.ones((1, 300))]) < FALSE_ALARM
    weight = np.tile([1.0, 0.0], 150)[None]
    assert np.isnan(following_p((rec,), [left * weight], [weight]))
