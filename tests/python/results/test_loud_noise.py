"""A law that lacks a term, beside noise that seems to explain what it leaves: the term comes first."""

from __future__ import annotations

import warnings

import modfun as mf
import numpy as np
import pytest
from scipy.integrate import solve_ivp

T = np.linspace(0, 15, 1000)
FIRST_ORDER = mf.Equation("s' = -k*s", outputs=["s"])


def saturating(seed: int) -> mf.Record:
    """A substrate degraded by the law of Michaelis and Menten, 5 % noise."""
    s = solve_ivp(lambda t, s: -1.5 * s / (2 + s), (0, 15), [10], t_eval=T, rtol=1e-9, atol=1e-11).y
    noise = 0.05 * np.sqrt(np.mean(s**2)) * np.random.default_rng(seed).standard_normal(s.shape)
    return mf.Record(y=s + noise, dt=T[1], outputs=["s"])


@pytest.mark.parametrize("seed", [0, 1, 4, 13])
def test_a_term_that_leaves_the_noise_comes_first(seed: int) -> None:
    """Seeds 1 and 4 named a slow disturbance first, without a warning; 0 and 13 a constant."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        fit = mf.fit(saturating(seed), FIRST_ORDER)
    assert len(told) == 1
    assert "First try a term in s*s'" in str(told[0].message)
    assert "First try a term in s*s'" in str(next(iter(fit.check())))


def test_noise_beyond_the_range_is_not_called_clean() -> None:
    """Of this fit "nothing wrong was found" beside noise of 150 on a signal below 11."""
    fit = mf.fit(saturating(1), FIRST_ORDER, noise="coloured")
    found = [text for text in map(str, fit.check()) if "The noise that the fit states" in text]
    assert len(found) == 1
    assert "times the range of s" in found[0]
    assert "a term in s*s'" in found[0]


def test_process_noise_does_not_cover_a_term() -> None:
    fit = mf.fit(saturating(0), FIRST_ORDER, noise="process")
    assert "First try a term in s*s'" in " ".join(map(str, fit.check()))


@pytest.mark.parametrize("noise", ["coloured", "process"])
def test_right_laws_in_slow_noise_are_clean(noise: str) -> None:
    rng = np.random.default_rng(3)
    slow = np.zeros(T.size)
    for k in range(1, T.size):
        slow[k] = 0.99 * slow[k - 1] + 0.14 * rng.standard_normal()
    y = 10 * np.exp(-0.3 * T) + 0.3 * slow + 0.05 * rng.standard_normal(T.size)
    fit = mf.fit(mf.Record(y=y, dt=T[1], outputs=["s"]), FIRST_ORDER, noise=noise)
    assert not [text for text in map(str, fit.check()) if "noise of the fit" in text or "states" in text]
