"""Noise that drives a system with a pole at zero: on line 0 its equation does not know the output."""

from typing import Any

import modfun as mf
import numpy as np
import pytest
from oracle import process_noise as oracle
from oracle.systems import simulate
from scipy.stats import binom

DEN, NUM = [1.0, 1.2, 0.0], [[3.0]]
TRUTH = np.array([1.2, 3.0])
DT, INTERVALS = 10 / 256, 256
CHIRP = [lambda t: np.sin(t**2 / 5)]
CLEAN, INPUTS = simulate(DEN, NUM, CHIRP, DT, INTERVALS)
CART = mf.Equation("y'' + a1*y' = b0*u")


def record(density: float, sigma: float, rng: np.random.Generator) -> mf.Record:
    y = CLEAN + sigma * rng.standard_normal(INTERVALS + 1)
    if density:
        y = y + oracle.drawn(DEN, density, DT, INTERVALS, rng, rest=True)
    return mf.Record(y=y, u=INPUTS[0], dt=DT, intersample="smooth")


@pytest.mark.statistics
@pytest.mark.parametrize(("density", "sigma"), [(0.1, 0.02), (0.01, 0.05)])
def test_near_the_bound_of_the_kalman_filter(density: float, sigma: float) -> None:
    """100 records: rmse to 7 %, above 1.25 of a bound that is met in 1 of 1,000 of four; coverage alike."""
    bound = oracle.bound(
        DEN[:2], NUM, CHIRP, density, sigma, DT, INTERVALS, lambda x: ([1.0, x[0], 0.0], [[x[1]]])
    )
    rng, errors, inside, levels = np.random.default_rng(4), [], [], []
    for _ in range(100):
        fit = mf.Estimator(CART, noise="process")(record(density, sigma, rng))
        assert fit.lines[0][0] == 0
        assert fit.usable
        assert fit.process_levels is not None
        errors.append(fit.params - TRUTH)
        limits = fit.conf_int()
        inside.append((limits[:, 0] < TRUTH) & (limits[:, 1] > TRUTH))
        levels.append(fit.process_levels[0])
    rmse = np.sqrt(np.mean(np.square(errors), axis=0))
    assert np.all(rmse < 1.25 * np.sqrt(np.diag(bound))[:2])
    assert np.all(np.sum(inside, axis=0) >= binom.ppf(5e-4, 100, 0.94))
    assert np.mean(levels, axis=0) == pytest.approx([sigma**2, density], rel=0.1)


@pytest.mark.parametrize("noise", ["process", "equation"])
def test_line_zero_joins_the_others(noise: str) -> None:
    """It tells a little more than the lines beside it: estimates agree within a standard error."""
    rec = record(0.1, 0.01, np.random.default_rng(3))
    fit, without = (mf.fit(rec, CART, noise=noise, band=(low, 20.0)) for low in (0.0, 0.5))
    assert (fit.status, without.status) == ("ok", "ok")
    assert (fit.lines[0][0], without.lines[0][0]) == (0, 1)
    assert np.all(np.abs(fit.params - without.params) < without.bse)
    assert not np.any(fit.params == without.params)
    assert np.all((fit.bse < 1.2 * without.bse) & (fit.bse > 0.5 * without.bse))


def test_without_noise_that_drives_it() -> None:
    """The level of it may be 0, which makes line 0 exact."""
    rng = np.random.default_rng(5)
    fits = [mf.Estimator(CART, noise="process")(record(0.0, 0.1, rng)) for _ in range(10)]
    assert all(fit.usable for fit in fits)
    assert np.any([fit.process_levels[0][1] == 0 for fit in fits])  # type: ignore[index]
    assert np.all(np.abs([(fit.params - TRUTH) / fit.bse for fit in fits]) < 4)


def test_state_equations_of_which_one_integrates() -> None:
    """Where only one row of A vanishes, and where all of it does."""
    cart = mf.StateSpace([[0, 1], [0, "a"]], [[0], ["b"]], states=["x", "v"], inputs=["u"])
    tank = mf.StateSpace([[0]], [["b"]], states=["h"], inputs=["u"])
    words: dict[str, Any] = {"input": "sin(t**2/5)", "duration": 10.0, "intervals": 256, "seed": 2}
    for structure, truth, noise in ((cart, {"a": -1.2, "b": 3.0}, [0.01, 0.1]), (tank, {"b": 2.0}, [0.1])):
        rec = mf.simulate(structure.model(truth), nsr=0.02, process_noise=noise, **words)
        fit = mf.fit(rec, structure, noise="process", trend=None)
        assert (fit.status, fit.lines[0][0]) == ("ok", 0)
        assert np.all(np.abs(fit.params - np.array([truth[name] for name in fit.param_names])) < 4 * fit.bse)
        assert np.all(fit.bse < 0.2)


@pytest.mark.parametrize("trend", [None, "constant"])
def test_a_transfer_function_that_holds_its_pole_at_zero_is_the_equation(trend: str | None) -> None:
    rec = record(0.1, 0.02, np.random.default_rng(5))
    held = mf.TransferFunction(poles=2, zeros=0, params={"a2": 0.0})
    one = mf.fit(rec, held, noise="process", trend=trend)
    other = mf.fit(rec, CART, noise="process", trend=trend, band=(one.lines[0][0] * one.omega0[0], 30.2))
    assert (one.status, one.lines) == (other.status, other.lines)
    assert one.params == pytest.approx(other.params, rel=1e-6)
    assert one.bse == pytest.approx(other.bse, rel=1e-5)
    assert one.process_noise()["level"] == pytest.approx(other.process_noise()["level"], rel=1e-5)
