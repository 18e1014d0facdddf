"""`select_terms` around gaps of masked samples, whose bridges would make products of noise candidates."""

from __future__ import annotations

from functools import cache

import modfun as mf
import numpy as np
import pytest
from scipy.integrate import solve_ivp

TRUTH = {"hare'": ("hare", "hare*lynx"), "lynx'": ("lynx", "hare*lynx")}
T = np.linspace(0, 20, 400)


@cache
def motion() -> np.ndarray:
    return solve_ivp(
        lambda t, x: [x[0] - 0.5 * x[0] * x[1], -0.8 * x[1] + 0.4 * x[0] * x[1]], (0, 20), [2, 1],
        t_eval=T, rtol=1e-9, atol=1e-11,
    ).y  # fmt: skip


def selected(seed: int, mask: np.ndarray) -> mf.TermSelection:
    """Prey and predators over 20 s, 15 % noise."""
    clean = motion()
    noise = 0.15 * np.sqrt(np.mean(clean**2, axis=1, keepdims=True))
    y = clean + noise * np.random.default_rng(seed).standard_normal(clean.shape)
    rec = mf.Record(y=y, dt=T[1], outputs=["hare", "lynx"]).weigh(mask=mask)
    return mf.select_terms(rec, "polynomials of hare, lynx up to 2", progress=False)


@pytest.mark.parametrize("start", [150, 354])
def test_one_gap_changes_no_selection(start: int) -> None:
    """Of samples 150 to 158, eight of 24 selections were wrong, six without any term for an equation."""
    mask = np.ones((2, 400), bool)
    mask[1, start : start + 9] = False
    for seed in (4, 9, 13, 22):
        found = selected(seed, mask)
        assert found.terms == TRUTH
        assert not [note for note in found.notes if "whole library" in note]


@pytest.mark.parametrize("length", [5, 9])
def test_nor_do_ten_gaps(length: int) -> None:
    """A polynomial through six samples multiplies their noise where it bridges five."""
    mask = np.ones((2, 400), bool)
    for k, start in enumerate(np.linspace(15, 380, 10).astype(int)):
        mask[k % 2, start : start + length] = False
    for seed in (2, 4):
        assert selected(seed, mask).terms == TRUTH


def test_levels_of_unequal_samples_hold_in_pieces() -> None:
    """`sigma` weighs the samples of a record beside those of its other pieces, too."""
    clean, rng = motion(), np.random.default_rng(0)
    sigma = np.where(np.arange(400) < 200, 1.0, 4.0)
    y = clean + 0.05 * sigma * rng.standard_normal(clean.shape)
    mask = np.ones((2, 400), bool)
    mask[0, 196:205] = False
    rec = mf.Record(y=y, dt=T[1], outputs=["hare", "lynx"], sigma=sigma, mask=mask)
    found = mf.select_terms(rec, "polynomials of hare, lynx up to 2", progress=False)
    assert found.terms == TRUTH
    assert not [note for note in found.notes if "whole library" in note]
    np.testing.assert_allclose(list(found.noise_sd.values()), 0.05 * np.sqrt(np.mean(sigma**2)), rtol=0.15)
