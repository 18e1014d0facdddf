"""Sets of terms that explain a record as well as the chosen ones, and do not contain these."""

import modfun as mf
import numpy as np
import pytest
from modfun.inference.subsets import Subsets
from scipy.integrate import solve_ivp

LIBRARY = "A, B, C, A**2, B**2, A*B"
TRUE = {"A'": {"A", "B"}, "B'": {"A", "B", "B**2"}, "C'": {"B**2"}}


def reaction(seed):
    """A turns to B and back, and B to C at second order, with 3 % noise."""

    def slope(_, x):
        r = 0.8 * x[0] - 0.3 * x[1]
        return [-r, r - 0.15 * x[1] ** 2, 0.15 * x[1] ** 2]

    t = np.linspace(0.0, 20.0, 201)
    x = solve_ivp(slope, (0.0, 20.0), [2.0, 0.0, 0.0], t_eval=t, rtol=1e-10, atol=1e-12).y
    sd = 0.03 * np.sqrt(np.mean(x**2, axis=1, keepdims=True))
    return mf.Record(
        y=x + sd * np.random.default_rng(seed).standard_normal(x.shape), t=t, outputs=list("ABC")
    )


@pytest.mark.parametrize("seed", [3, 6, 9])
def test_two_terms_in_place_of_one_are_told_and_averaged(seed):
    """These records choose A² in place of A and B, told nowhere, with a probability of 0.93–0.99."""
    found = mf.select_terms(reaction(seed), LIBRARY, progress=False)
    assert found.terms["B'"] == ("A**2", "B**2")
    words = (
        "The data hardly tell B': A**2 from B': A and B': B: with B': A and B': B in its place chi2 falls by"
    )
    assert any(words in text and "with one term more" in text for text in found.alike)
    probability = dict(zip(found.inclusion["term"], found.inclusion["probability"], strict=True))
    assert probability["B': A**2"] < 0.9
    assert probability["B': A"] > 0.1
    assert words in found.summary()


def test_one_term_in_place_of_two_is_told():
    found = mf.select_terms(reaction(2), LIBRARY, progress=False)
    assert {left: set(own) for left, own in found.terms.items()} == TRUE
    assert any("B': A and B': B from B': A**2: with B': A**2 in their place" in text for text in found.alike)


def test_the_rate_of_superfluous_terms_is_one_beside_the_true_ones():
    found = mf.select_terms(reaction(2), LIBRARY, progress=False)
    assert (
        "beside the true ones with a probability of at most 1 %; terms in place of true ones"
        in found.summary()
    )


def test_the_best_pair_in_place_of_a_candidate_is_seen():
    """Each of the pair alone is of no use: the beams of a search that begins from one may pass it by."""
    rng = np.random.default_rng(1)
    x = rng.standard_normal((60, 7))
    y = x[:, 0] + x[:, 1] + 0.1 * rng.standard_normal(60)
    keep = np.zeros(7, dtype=bool)
    one = Subsets(x.T @ x, x.T @ y, y @ y, np.full(7, 0.1), keep)
    one._exchange(np.arange(7) == 2)
    best = min(one.found, key=one.found.__getitem__)
    assert np.flatnonzero(np.frombuffer(best, dtype=bool)).tolist() == [0, 1]
    left = y - x[:, :2] @ np.linalg.lstsq(x[:, :2], y)[0]
    assert one.found[best] == pytest.approx(left @ left + 0.2)
