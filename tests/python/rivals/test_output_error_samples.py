"""Output error from a known start, at uneven times, of masked samples, and of what cannot be told apart."""

from typing import Any

import modfun as mf
import numpy as np
import pytest
from modfun.rivals import output_error

ORAL = mf.Equation(
    ["g' = -ka*g + u", "c' = ka*g/V - ke*c"], outputs=["c"], hidden=["g"],
    params={"V": mf.Free(15, min=1), "ka": mf.Free(1, min=0.01), "ke": mf.Free(0.2, min=0)},
)  # fmt: skip
TRUTH = {"V": 20.0, "ka": 1.2, "ke": 0.25}
START = {"V": 15.0, "ka": 1.0, "ke": 0.2}
TIMES = np.array([0, 0.25, 0.5, 0.75, 1, 1.5, 2, 3, 4, 6, 8, 10, 12, 16, 24])


def dosed(t: np.ndarray, seed: int, **how: Any) -> mf.Record:
    """A dose of 100 mg before the second sample, and concentrations with 3 % of noise."""
    u = np.zeros(t.size)
    u[0] = 100 / (t[1] - t[0])
    c = ORAL.model(TRUTH).simulate(u=u, t=t, intersample="zoh")
    c = c + 0.03 * c.std() * np.random.default_rng(seed).standard_normal(c.size)
    return mf.Record(y=c, u=u, t=t, outputs=["c"], intersample="zoh", **how)


def z(found: Any) -> np.ndarray:
    return np.array([(found[name] - value) / found.bse[name] for name, value in TRUTH.items()])


def test_samples_at_uneven_times_from_a_known_start():
    """It was refused: "sampled unevenly; resample it", and the known start raised a ValueError of NumPy."""
    found = [output_error(ORAL, start=START, initial_state="zero")(dosed(TIMES, seed)) for seed in range(10)]
    # Means of 30 squares of t with 12 degrees of freedom exceed 2.2 once in 1,000 times.
    assert 0.4 < np.mean([z(one) ** 2 for one in found]) < 2.2


def test_masked_samples_have_no_say():
    grid = np.arange(241) / 10
    mask = np.isin(np.arange(241), np.round(10 * TIMES).astype(int))
    rec = dosed(grid, 1, mask=mask)
    wrong = rec._like(y=np.where(mask, rec.y, 7.0))
    solved = [output_error(ORAL, start=START, initial_state="zero").solve(one) for one in (rec, wrong)]
    assert solved[0].params == solved[1].params
    assert solved[0].simulated[0].shape == rec.y.shape
    assert np.all(np.abs(z(output_error(ORAL, start=START, initial_state="zero")(rec))) < 4)


def test_an_offset_at_uneven_times():
    rec = dosed(TIMES, 2)
    moved = rec._like(y=rec.y + 0.5 + 0.02 * rec.t)
    solved = output_error(ORAL, start=START, initial_state="zero", trend="linear").solve(moved)
    slope = 0.02 * rec.duration / 2
    np.testing.assert_allclose(solved.trends[0], [[0.5 + slope, slope]], atol=0.4)


def test_parameters_that_cannot_be_told_apart_are_named():
    """It asked for a start although one was given."""
    twice = mf.Equation("c' = -k*c + (a + b)*u + e*u**2*c", outputs=["c"])
    u = np.repeat([0.0, 1.0, 0.0, 2.0], 25)
    y = np.random.default_rng(0).standard_normal(100)
    rec = mf.Record(y=y, u=u, dt=0.1, outputs=["c"], intersample="zoh")
    with pytest.raises(mf.errors.FitError, match=r"hardly tell a and b apart, hold or bound one of them"):
        output_error(twice, start={"k": 1.0, "a": 1.0, "b": 1.0, "e": 0.1}, maxiter=1)(rec)


def test_outputs_that_are_masked_at_different_samples_are_refused():
    both = mf.Equation(["x' = -a*x + z", "z' = -b*z"], outputs=["x", "z"])
    y = np.random.default_rng(0).standard_normal((2, 50))
    mask = np.ones((2, 50), bool)
    mask[0, 3] = False
    rec = mf.Record(y=y, dt=0.1, outputs=["x", "z"], mask=mask)
    with pytest.raises(mf.errors.DataError, match="1 masked samples"):
        output_error(both, start={"a": 1.0, "b": 1.0})(rec)


def test_the_starts_of_a_model_are_starts():
    """Sums begin Michaelis and Menten's law at a finite escape from 21 samples: 20 of 20 had no start."""
    told = {"V": mf.Free(1, min=0), "K": mf.Free(3, min=0)}
    law = mf.Equation("y' = -V*y/(K + y)", params=told)
    t = np.arange(0, 10.1, 0.5)
    clean = law.model({"V": 2.0, "K": 5.0}).simulate(t=t, initial_state=[10.0]).ravel()
    for seed in range(4):
        rec = mf.Record(y=clean + 0.05 * np.random.default_rng(seed).standard_normal(t.size), t=t)
        found = mf.rivals.output_error(law)(rec)
        assert abs(found["K"] - 5.0) < 4 * found.bse["K"]
