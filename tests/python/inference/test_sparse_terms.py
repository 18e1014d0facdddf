"""`select_terms` at uneven times with few samples: lines end where the longest step does, and it says so."""

from __future__ import annotations

import warnings

import modfun as mf
import numpy as np
import pytest
from scipy.integrate import solve_ivp

TRUTH = {"x'": {"x", "x*z"}, "z'": {"z", "x*z"}}


def prey(seed: int, samples: int) -> mf.Record:
    """Prey and predators over 20 s at random times, 5 % noise."""
    rng = np.random.default_rng(seed)
    t = np.sort(rng.uniform(0, 20, samples))
    y = solve_ivp(
        lambda t, x: [x[0] - 0.5 * x[0] * x[1], -0.8 * x[1] + 0.4 * x[0] * x[1]], (0, 20), [3, 1], t_eval=t,
        rtol=1e-9, atol=1e-11,
    ).y  # fmt: skip
    return mf.Record(
        y=y + 0.05 * y.std(axis=1, keepdims=True) * rng.standard_normal(y.shape), t=t, outputs=["x", "z"]
    )


@pytest.mark.statistics
def test_terms_of_120_samples_at_random_times_are_right() -> None:
    """At most one of ten is wrong, and says so; before, four of the first twelve were, all in silence."""
    right = 0
    for seed in range(10):
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            found = mf.select_terms(prey(seed, 120), "polynomials of x, z up to 2")
        own = {left: set(terms) for left, terms in found.terms.items()}
        right += own == TRUTH
        assert own == TRUTH or told
    assert right >= 9


def test_a_selection_whose_sampling_is_the_obstacle_says_so() -> None:
    with pytest.warns(mf.ModfunWarning, match=r"longest step between samples is 1.47 s.*steps of at most"):
        found = mf.select_terms(prey(1, 60), "polynomials of x, z up to 2")
    assert "beyond the noise" not in " ".join(found.notes)
    assert "terms may be missing or wrong" in found.summary()


def test_enough_samples_at_random_times_are_silent() -> None:
    found = mf.select_terms(prey(0, 200), "polynomials of x, z up to 2")
    assert {left: set(terms) for left, terms in found.terms.items()} == TRUTH
    assert not any("longest step" in note for note in found.notes)
