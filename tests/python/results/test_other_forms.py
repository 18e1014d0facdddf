"""A constant that lowers the residuals of a wrong law is not taken for an offset of its channels."""

import warnings
from typing import Any

import modfun as mf
import numpy as np

LOGISTIC = mf.Equation("n' = r*n - q*n**2", outputs=["n"])
T = np.linspace(0, 15, 121)
GOMPERTZ = 10 * np.exp(np.log(0.08) * np.exp(-0.4 * T))
GROWTH = 10 / (1 + 11.5 * np.exp(-0.8 * T))


def said(clean: Any, seed: int) -> str:
    y = clean + 0.12 * np.random.default_rng(seed).standard_normal(T.size)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        mf.fit(mf.Record(y=y, t=T, outputs=["n"]), LOGISTIC)
    return " ".join(str(one.message) for one in caught)


def test_another_law_is_named_beside_the_constant() -> None:
    """Of 10 such records, 9 were said to have an offset; with the constant r is half, and no check doubts."""
    for seed in range(1, 6):
        text = said(GOMPERTZ, seed)
        assert "or the law has another form" in text
        assert "n*log(n)" in text
        assert text.index("n*log(n)") < text.index("onstant, + m")
    assert "First try a term in n*log(n): BIC" in said(GOMPERTZ, 1)


def test_an_offset_of_the_right_law_is_said_too() -> None:
    for seed in range(4):
        assert "rite (n - c) for n in the equation" in said(GROWTH + 3, seed)
        assert "The constant, + m" in said(GROWTH + 3, seed)
        assert not said(GROWTH, seed)
    assert "First try" not in said(GROWTH + 3, 1)
