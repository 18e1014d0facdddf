"""A search of terms goes on where an estimate on its way leaves the range of numbers."""

import modfun as mf
import numpy as np
from scipy.integrate import solve_ivp


def test_a_step_beyond_the_range_of_numbers_is_taken_back() -> None:
    """A + B <-> C -> D at 1 % noise: the bare error of a solver, "array must not contain infs or NaNs"."""

    def rates(_: float, x: np.ndarray) -> list[float]:
        forth, back, on = 0.8 * x[0] * x[1], 0.3 * x[2], 0.5 * x[2]
        return [back - forth, back - forth, forth - back - on, on]

    t = np.linspace(0, 10, 61)
    x = solve_ivp(rates, (0, 10), (1, 0.6, 0, 0), t_eval=t, rtol=1e-10, atol=1e-12, method="LSODA").y
    noise = 0.01 * x.std(axis=1, keepdims=True) * np.random.default_rng(3000).standard_normal(x.shape)
    rec = mf.Record(y=x + noise, dt=t[1], outputs=list("ABCD"))
    found = mf.select_terms(rec, "polynomials of A, B, C, D up to 2", progress=False)
    assert set(found.terms) == {"A'", "B'", "C'", "D'"}
