"""Records of a batch that share their input have the estimates of single fits."""

from __future__ import annotations

from dataclasses import replace

import modfun as mf
import numpy as np
from scipy.integrate import solve_ivp

GLUCOSE = mf.Equation(
    ["G' = -(p1 + X)*G + p1*Gb", "X' = -p2*X + p3*(I - Ib)"],
    outputs=["G"], inputs=["I"], hidden=["X"], params={"Gb": 90.0, "Ib": 10.0},
)  # fmt: skip


def insulin(t: np.ndarray) -> np.ndarray:
    return 10 + 80 * np.exp(-t / 8) + 90 * np.where(t > 20, (t - 20) / 6 * np.exp(1 - (t - 20) / 6), 0)


def glucose(count: int) -> mf.Batch:
    def slopes(at: float, x: np.ndarray) -> list[float]:
        return [-(0.03 + x[1]) * x[0] + 0.03 * 90, -0.02 * x[1] + 1.3e-5 * (insulin(np.array(at)) - 10)]

    t = np.arange(0, 181.0)
    y = solve_ivp(slopes, (0, 180), [290.0, 0.0], t_eval=t, rtol=1e-9, atol=1e-10).y[0]
    y = y + np.random.default_rng(7).normal(size=(count, 1, t.size))
    return mf.Batch(y=y, u=insulin(t), dt=1.0, outputs=["G"], inputs=["I"])


def test_a_logarithm_that_elimination_made() -> None:
    """Its sign in a record stood where the core expected the input: p1 was -2.5 instead of 0.03."""
    batch = glucose(20)
    many = mf.fit_many(batch, GLUCOSE, progress=False)
    assert many.success.all()
    assert many.doubts == ()  # record 19 alone finds another minimum, whose response is farther off
    for k in (0, 9, 18):
        np.testing.assert_allclose(
            many.params[k], mf.fit(batch[k], GLUCOSE, band=many.band).params, rtol=1e-5
        )
    np.testing.assert_allclose(np.median(many.params, axis=0), [0.03, 0.02, 1.3e-5], rtol=0.04)
    inside = np.abs(many.params - [0.03, 0.02, 1.3e-5]) < 2 * many.bse
    assert inside.mean() > 0.85


def test_an_output_at_two_times() -> None:
    """The delayed samples stood where the core expected the input: r was 0.15 instead of 1.2."""
    step, late, parts = 0.05, 20, 10
    fine = np.arange(800 * parts + 1) * step / parts
    u = 0.3 * np.sin(0.7 * fine) + 0.2 * np.sin(1.9 * fine)
    x = np.full(fine.size, 0.6)
    for i in range(fine.size - 1):
        rate = 1.2 - 0.6 * x[max(i - late * parts, 0)]
        middle = x[i] + (rate * x[i] + 0.5 * u[i]) * step / parts / 2
        x[i + 1] = x[i] + (rate * middle + 0.25 * (u[i] + u[i + 1])) * step / parts
    y = x[::parts] + 0.01 * np.random.default_rng(0).normal(size=(8, 1, 801))
    batch = mf.Batch(y=y, u=u[::parts], dt=step, outputs=["x"], inputs=["u"], intersample="smooth")
    many = mf.fit_many(
        batch, mf.Equation("x' = r*x - q*x*x(t - 1) + b*u", outputs=["x"], inputs=["u"]), progress=False
    )
    np.testing.assert_allclose(np.median(many.params, axis=0), [1.2, 0.6, 0.5], rtol=0.01)


def test_estimates_far_from_single_fits_are_named() -> None:
    """Where they are closer to the samples, and by several standard errors."""
    many = mf.fit_many(glucose(8), GLUCOSE, progress=False)
    moved = replace(many, params=many.params + 5 * many.bse_even * [1.0, 0.0, 0.0])
    assert "3 of 3 records that were fitted alone have other estimates than among many" in moved.doubts[0]
    assert "record 0: p1 = 0.02926 ± 0.001" in moved.doubts[0]
    assert "mf.fit(data[k], model)" in repr(moved)
    assert replace(many, params=many.params + 0.5 * many.bse_even).doubts == ()
