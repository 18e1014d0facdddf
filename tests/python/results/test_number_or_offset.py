"""A number that equations share and get wrong is named before an offset of a channel that explains less."""

from __future__ import annotations

import modfun as mf
import numpy as np
import pytest
from scipy.integrate import solve_ivp

MODEL = mf.Equation(["x' = -x + a*z + x**2*z", "z' = b - a*z - x**2*z"], outputs=["x", "z"])


def selkov(seed: int, number: float, offset: float = 0.0) -> mf.Record:
    """Glycolysis over 40 s, 5 % noise; z is measured with an offset."""
    t = np.linspace(0.0, 40.0, 161)

    def rates(t: float, x: list[float]) -> list[float]:
        reaction = 0.08 * x[1] + number * x[0] ** 2 * x[1]
        return [reaction - x[0], 0.6 - reaction]

    y = solve_ivp(rates, (0, 40), [0.5, 1.5], t_eval=t, rtol=1e-9, atol=1e-11).y
    y = y + 0.05 * y.std(axis=1, keepdims=True) * np.random.default_rng(seed).standard_normal(y.shape)
    return mf.Record(y=y + np.array([[0.0], [offset]]), t=t, outputs=["x", "z"])


@pytest.mark.parametrize("seed", range(4))
def test_a_wrong_number_of_two_equations_is_named_and_no_offset(seed: int) -> None:
    with pytest.warns(mf.ModfunWarning, match=r"1\.(09|1).* times what they have of z\*x\*\*2") as told:
        mf.fit(selkov(seed, 1.1), MODEL)
    assert not any("offset" in str(one.message) for one in told)


@pytest.mark.parametrize("seed", range(4))
def test_an_offset_is_still_named_where_it_is_one(seed: int) -> None:
    with pytest.warns(mf.ModfunWarning, match=r"Write \(z - c\) for z"):
        mf.fit(selkov(seed, 1.0, offset=0.3), MODEL)


@pytest.mark.parametrize("seed", range(4))
def test_right_equations_are_silent(seed: int) -> None:
    assert mf.fit(selkov(seed, 1.0), MODEL).success
