"""Equations and state spaces in noise whose colour is estimated with the parameters."""

from __future__ import annotations

import modfun as mf
import numpy as np
import pytest
from scipy.signal import lfilter

SHORT_PERIOD = mf.Equation(
    ["alpha' = Za*alpha + Zq*q + Zd*de", "q' = Ma*alpha + Mq*q + Md*de"],
    outputs=["alpha", "q"],
    inputs=["de"],
)
TRUE = np.array([-1.2, 0.98, -0.1, -4.0, -1.5, -6.0])
AIRCRAFT = mf.ss([[TRUE[0], TRUE[1]], [TRUE[3], TRUE[4]]], [[TRUE[2]], [TRUE[5]]], np.eye(2), [[0], [0]])
COLOURS = (0.97, 0.8)


def noise(rng: np.random.Generator, samples: int, pole: float) -> np.ndarray:
    """Autoregressive noise of variance 1, long under way."""
    return lfilter([np.sqrt(1 - pole**2)], [1, -pole], rng.standard_normal(samples + 1000))[1000:]


def flight(seed: int, poles: tuple[float, float] = COLOURS, level: float = 0.2) -> mf.Record:
    clean = mf.simulate(AIRCRAFT, input="sin(t**2/2.7)", duration=20.0, intervals=500)
    rng = np.random.default_rng(seed)
    y = clean.y + [level * own.std() * noise(rng, own.size, p) for own, p in zip(clean.y, poles, strict=True)]
    return mf.Record({"alpha": y[0], "q": y[1]}, u={"de": clean.u[0]}, dt=clean.dt)


def fitted(rec, **options):
    return mf.fit(rec, SHORT_PERIOD, harmonics=50, trend="constant", **options)


def test_one_equation_is_the_transfer_function_in_such_noise():
    clean = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=512)
    rng = np.random.default_rng(4)
    y = clean.y[0] + 0.1 * clean.y[0].std() * noise(rng, clean.y.size, 0.97)
    rec = mf.Record(y, u=clean.u[0], dt=clean.dt)
    options = {"harmonics": 60, "trend": "constant"}
    plain = mf.fit(rec, mf.Equation("y'' + a1*y' + a2*y = b0*u"), **options)
    equation = mf.fit(rec, plain.structure, noise="coloured", **options)
    linear = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0), noise="coloured", harmonics=60)
    off = (np.asarray(equation.params) - linear.params) / linear.bse
    moved = (np.asarray(plain.params) - linear.params) / linear.bse
    assert np.max(np.abs(off)) < 0.1 < np.max(np.abs(moved))
    assert np.allclose(equation.bse, linear.bse, rtol=0.1)


def test_a_state_space_is_more_accurate_and_its_intervals_hold():
    white, coloured, inside = [], [], []
    for seed in range(40):
        rec = flight(seed)
        white.append(np.asarray(fitted(rec).params) - TRUE)
        fit = fitted(rec, noise="coloured")
        assert fit.status == "ok"
        low, high = fit.conf_int().T
        coloured.append(np.asarray(fit.params) - TRUE)
        inside.append((low <= TRUE) & (high >= TRUE))
    gain = np.sqrt(np.mean(np.square(white), axis=0) / np.mean(np.square(coloured), axis=0))
    assert np.exp(np.mean(np.log(gain))) > 1.15
    assert gain[2] > 1.5  # the elevator's direct effect, where noise of alpha is weak
    # 240 intervals of 95 %, six a record: below 86 % once in 1e3 trials if those of a record fail together.
    assert np.mean(inside) > 0.86
    z = np.mean(coloured, axis=0) / np.std(coloured, axis=0) * np.sqrt(40)
    assert np.max(np.abs(z)) < 4.2  # false alarm 2e-4


def test_white_noise_stays_white():
    rec = flight(1, poles=(0.0, 0.0), level=0.05)
    plain, coloured = fitted(rec), fitted(rec, noise="coloured")
    assert np.max(np.abs(np.asarray(plain.params) - coloured.params) / plain.bse) < 0.3


def test_a_batch_and_several_records():
    records = [flight(seed) for seed in range(10, 13)]
    options = {"harmonics": 50, "trend": "constant", "noise": "coloured"}
    many = mf.fit_many(records, SHORT_PERIOD, progress=False, **options)
    for own, rec in zip(many.params, records, strict=True):
        fit = fitted(rec, noise="coloured")
        assert np.allclose(own, fit.params, rtol=1e-5, atol=1e-7)
    together = fitted(records, noise="coloured")
    assert np.max(np.abs(np.asarray(together.params) - TRUE) / together.bse) < 4
    assert np.all(together.bse < fitted(records[0], noise="coloured").bse)


def test_check_says_what_it_gains():
    fit = fitted(flight(0))
    (said,) = [str(doubt) for doubt in fit.check() if "Weighting the lines" in str(doubt)]
    assert 'noise="coloured"' in said
    coloured = fitted(flight(0), noise="coloured")
    assert "an autoregression fitted to the residuals" in str(coloured.summary())
    assert 'noise="coloured" comes without a level' in str(coloured.summary())
    assert "times the noise level" not in str(coloured.check())


def test_nonlinear_equations_are_refused_with_the_reason():
    rec = flight(0).select(outputs=["q"])
    with pytest.raises(mf.SpecError, match="nonlinear in the outputs, which spreads their noise"):
        mf.fit(rec, mf.Equation("q' + a*q + b*q**2 = c*de", inputs=["de"]), noise="coloured")
