"""Records most of whose samples are masked, and equations across gaps: errors are of the samples left."""

import warnings

import modfun as mf
import numpy as np
import pytest
from scipy.signal import lfilter

pytestmark = pytest.mark.statistics

DUFFING = mf.Equation("y'' + d*y' + a*y + b*y**3 = u")


def rms(fits, truth):
    """Root mean square of errors in standard errors, by parameter."""
    return np.sqrt(np.mean([((fit.params - truth) / fit.bse) ** 2 for fit in fits], axis=0))


@pytest.mark.parametrize("lost", [0.35, 0.5])
def test_scattered_gaps_cost_what_they_hide(lost):
    """Standard errors within 15 % of the bound of the samples that are left, and errors as large as they say.

    The root mean square of 40 normal errors is between 0.6 and 1.4, with probability 0.9997 each.
    """
    plant, model, truth = mf.tf([5], [1, 3, 8]), mf.TransferFunction(poles=2, zeros=0), [3.0, 8.0, 5.0]
    fits, bounds = [], []
    for seed in range(40):
        rec = mf.simulate(plant, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=seed)
        rec = rec.weigh(mask=np.random.default_rng(seed).random(257) > lost)
        fits.append(mf.fit(rec, model))
        bounds.append(mf.crlb(plant, rec, nsr=0.1, trend="constant").sd)
    np.testing.assert_allclose(np.median([f.bse for f in fits], axis=0), np.mean(bounds, axis=0), rtol=0.15)
    assert np.all((rms(fits, truth) > 0.6) & (rms(fits, truth) < 1.4))


@pytest.mark.parametrize("every", [10, 20])
def test_analyses_every_few_samples_are_no_more_than_they_are(every):
    """They had been counted as so many samples: errors were 5 to 130 times the standard errors.

    The root mean square of 12 normal errors is below 1.7 with probability 0.9995 each.
    """
    model, fits = mf.TransferFunction(poles=1, zeros=0, delay=mf.Free(min=0, max=40)), []
    for seed in range(12):
        rng, decay = np.random.default_rng(seed), np.exp(-1 / 30)
        u = np.repeat(rng.choice([-1.0, 1.0], 72), 25)
        late = np.r_[np.full(6, u[0]), u][:1800] - u[0]
        y = 70 + lfilter([0, 2 * (1 - decay)], [1, -decay], late) + 0.05 * rng.standard_normal(1800)
        rec = mf.Record(y=y, u=u, dt=2.0, intersample="zoh", mask=np.arange(1800) % every == 0)
        fits.append(mf.fit(rec, model))
    assert np.all(rms(fits, [1 / 60, 1 / 30, 12.0]) < 1.7)


def test_a_start_at_rest_holds_where_half_of_the_samples_are_masked():
    """One of eight had been 8 to 14 standard errors off, and the start at rest was called false.

    The root mean square of 12 normal errors is below 1.7 with probability 0.9995 each.
    """
    plant, model = mf.tf([4], [1, 0.8, 16]), mf.TransferFunction(poles=2, zeros=0)
    clean = mf.simulate(plant, input="sin(t**2/2.5)", duration=8.0, intervals=200)
    rng, fits = np.random.default_rng(3), []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for _ in range(12):
            y = clean.y[0] + 0.1 * clean.y.std() * rng.standard_normal(201)
            rec = mf.Record(y=y, u=clean.u, dt=0.04, intersample="smooth", mask=rng.random(201) > 0.5)
            fits.append(mf.fit(rec, model, initial_state="rest"))
    assert np.all(rms(fits, [0.8, 16.0, 4.0]) < 1.7)


@pytest.mark.parametrize("gap", [9, 20])
def test_equations_are_fitted_on_either_side_of_a_gap(gap):
    """Of 12 records with 9 samples masked 6 had not settled and others were up to 14 errors off, in silence.

    The root mean square of 12 normal errors is below 1.7 with probability 0.9995 each.
    """
    truth, fits = {"d": 0.3, "a": 1.0, "b": 0.5}, []
    for seed in range(12):
        rec = mf.simulate(
            DUFFING.model(truth), input="1.2*sin(1.1*t) + sin(2.3*t)", duration=20, intervals=400, nsr=0.05,
            seed=seed, initial_state=[0.3, 0],
        )  # fmt: skip
        at, mask = np.random.default_rng(seed).integers(30, 360), np.ones(401, bool)
        mask[at : at + gap] = False
        fits.append(mf.fit(rec.weigh(mask=mask), DUFFING))
    assert all(fit.success and fit.records[0].t.size == 401 for fit in fits)
    assert np.all(rms(fits, list(truth.values())) < 1.7)


def test_few_samples_between_gaps_are_no_error():
    """What lies between two gaps was cut out, and refused for its few samples in words nobody asked for."""
    rec = mf.simulate(
        mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=1
    )
    fit = mf.fit(
        rec.weigh(mask=np.random.default_rng(1).random(257) > 0.65), mf.TransferFunction(poles=2, zeros=0)
    )
    assert fit.success
    assert np.all(np.abs((fit.params - [3.0, 8.0, 5.0]) / fit.bse) < 3.5)


@pytest.mark.parametrize(
    ("model", "per_sigma"),
    [(mf.TransferFunction(poles=2, zeros=0), True), (mf.Equation("y'' + a*y' + b*y = c*u"), False)],
)
def test_a_common_factor_of_sigma_changes_at_most_the_unit_of_the_noise(model, per_sigma):
    """Standard errors were up to twice as large, since the errors of bridged samples had no such factor."""
    rec = mf.simulate(
        mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.05, seed=1
    ).weigh(mask=np.random.default_rng(0).random(257) > 0.7)
    fit = mf.fit(rec, model)
    same = mf.fit(rec._like(sigma=np.full(rec.y.shape, 1e-3)), model)
    unit = 1e-3 if per_sigma else 1.0
    np.testing.assert_allclose(same.params, fit.params, rtol=1e-5)
    np.testing.assert_allclose([*same.bse, same.sigma * unit], [*fit.bse, fit.sigma], rtol=1e-5)
