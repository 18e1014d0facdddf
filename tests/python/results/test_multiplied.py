"""The check of a fit says where noise multiplies outputs that stay above zero."""

import warnings

import modfun as mf
import numpy as np
import pytest
from scipy.integrate import solve_ivp

PREY = mf.Equation(["h' = a*h - b*h*l", "l' = d*h*l - g*l"], outputs=["h", "l"])
T = np.arange(0, 25.01, 0.25)


@pytest.fixture(scope="module")
def clean():
    def rates(_, x):
        return [0.8 * x[0] - 0.04 * x[0] * x[1], 0.015 * x[0] * x[1] - 0.6 * x[1]]

    return solve_ivp(rates, (0, 25), [30, 8], t_eval=T, rtol=1e-9, atol=1e-9).y


def said(y):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit = mf.fit(mf.Record(y={"h": y[0], "l": y[1]}, dt=0.25), PREY)
    return 'noise="log-normal"' in str(fit.check())


@pytest.mark.parametrize("seed", range(5))
def test_noise_that_multiplies_is_named(clean, seed):
    assert said(clean * np.exp(0.1 * np.random.default_rng(seed).standard_normal(clean.shape)))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("noise", [0.02, 0.1])
def test_noise_that_adds_is_not(clean, seed, noise):
    size = noise * clean.std(axis=1)[:, None]
    assert not said(np.abs(clean + size * np.random.default_rng(seed).standard_normal(clean.shape)) + 1e-9)


EPIDEMIC = mf.Equation(
    ["S' = -beta*S*I/5000", "I' = beta*S*I/5000 - g*I"], outputs=["I"], hidden=["S"]
)  # fitted by log(I)


@pytest.fixture(scope="module")
def cases():
    def rates(_, x):
        return [-0.5 * x[0] * x[1] / 5000, 0.5 * x[0] * x[1] / 5000 - 0.15 * x[1]]

    return solve_ivp(rates, (0, 60), [4990, 10], t_eval=np.arange(61.0), rtol=1e-10, atol=1e-8).y[1]


def warned(y):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        mf.fit(mf.Record(y={"I": y}, dt=1.0), EPIDEMIC)
    return [str(one.message) for one in caught]


@pytest.mark.parametrize("seed", range(3))
def test_counts_whose_equation_takes_logarithms_are_the_one_warning(cases, seed):
    rng = np.random.default_rng(seed)
    (counted,) = warned(np.maximum(rng.poisson(cases), 1.0))
    assert "First try rec.weigh(sigma=np.sqrt(fit.predict(rec).y))" in counted
    (scaled,) = warned(cases * np.exp(0.05 * rng.standard_normal(61)))
    assert 'First try noise="log-normal"' in scaled


@pytest.mark.parametrize("seed", range(5))
def test_even_noise_beside_logarithms_is_no_warning(cases, seed):
    assert not warned(cases[8:50] + 10 * np.random.default_rng(seed).standard_normal(42))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("even", [False, True])
def test_growth_over_three_decades_shows_noise_in_proportion(seed: int, even: bool) -> None:
    """Fifteen samples of 12 % noise: the default was 5 errors off in silence. None of 60 with even noise."""
    t = np.array([0, 2, 4, 6, 7, 9, 11, 13, 14, 16, 18, 20, 23, 25, 28.0])
    clean = 50 * np.exp(0.9 / 0.12 * (1 - np.exp(-0.12 * t)))
    e = np.random.default_rng(seed).standard_normal(t.size)
    rec = mf.Record(y=np.maximum(clean + 8 * e, 5) if even else clean * np.exp(0.12 * e), t=t, outputs=["V"])
    model = mf.Equation(
        "V' = b*V*log(K/V)", outputs=["V"], params={"b": mf.Free(0.2, min=0), "K": mf.Free(5e4, min=1)}
    )
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        mf.fit(rec, model)
    said = " ".join(str(one.message) for one in seen)
    assert ('First try noise="log-normal"' in said) != even
