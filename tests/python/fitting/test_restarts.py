"""Searches that lead nowhere begin again at sizes that the equation and its record ask for."""

from __future__ import annotations

import modfun as mf
import numpy as np
import pytest
from modfun.fitting.scales import sizes
from scipy.integrate import solve_ivp

GROWTH = ["X' = mu*S/(Ks + S)*X", "S' = -mu*S/(Ks + S)*X/Y"]


def fermentation(seed: int) -> mf.Record:
    """Growth after Monod, mu = 0.5, Ks = 2, Y = 0.45, under 2 to 3 % noise."""
    t = np.linspace(0, 20, 81)

    def slope(_: float, x: np.ndarray) -> list[float]:
        grown = 0.5 * x[1] / (2.0 + x[1]) * x[0]
        return [grown, -grown / 0.45]

    y = solve_ivp(slope, (0, 20), [0.2, 20], t_eval=t, rtol=1e-9).y
    noise = 0.15 * np.random.default_rng(seed).standard_normal(y.shape) * np.array([[1], [2]])
    return mf.Record(y=y + noise, dt=t[1], outputs=["X", "S"])


def glucose(seed: int) -> mf.Record:
    """Bergman's minimal model, p1 = 0.03, p2 = 0.025, p3 = 1.5e-5, every two minutes under 2 % noise."""
    t = np.arange(0, 181, 2.0)

    def insulin(t: np.ndarray | float) -> np.ndarray:
        return 10 + 120 * np.exp(-t / 6.0) + 60 * np.exp(-(((t - 35) / 25) ** 2))

    def slope(t: float, x: np.ndarray) -> list[float]:
        return [-(0.03 + x[1]) * x[0] + 0.03 * 90, -0.025 * x[1] + 1.5e-5 * (insulin(t) - 10)]

    y = solve_ivp(slope, (0, 180), [290, 0], t_eval=t, rtol=1e-9, atol=1e-11).y[0]
    y += 2.5 * np.random.default_rng(seed).standard_normal(t.size)
    return mf.Record(y={"G": y}, u={"I": insulin(t)}, dt=2.0, intersample="smooth")


@pytest.mark.parametrize("seed", [2, 3, 6])
def test_growth_that_ran_off(seed: int) -> None:
    """They ended with Ks = 1.4e10, without an estimate, or on bounds of the search."""
    told = {"mu": mf.Free(0.4, min=0), "Ks": mf.Free(1.0, min=0.01), "Y": mf.Free(0.4, min=0.01)}
    fit = mf.fit(fermentation(seed), mf.Equation(GROWTH, outputs=["X", "S"], params=told))
    assert fit.success
    assert np.all(np.abs(fit.params - [0.5, 2.0, 0.45]) < 4 * fit.bse)
    assert fit["Ks"] < 3


@pytest.mark.parametrize("seed", [0, 4, 14, 19, 20, 30, 38, 39, 45])
def test_glucose_that_ran_off(seed: int) -> None:
    """They ended with p1 = -1.6e6 or p2 = -1e11, and "raise maxiter"."""
    model = mf.Equation(
        ["G' = -(p1 + X)*G + p1*Gb", "X' = -p2*X + p3*(I - Ib)"],
        outputs=["G"], inputs=["I"], hidden=["X"], params={"Ib": 10.0, "Gb": 90.0},
    )  # fmt: skip
    fit = mf.fit(glucose(seed), model)
    assert fit.success
    assert np.all(np.abs(fit.params - [0.03, 0.025, 1.5e-5]) < 4 * fit.bse)


def test_sizes() -> None:
    """Rates go by the speed of the record, saturations by its channels, gains by both."""
    rec = fermentation(0)
    mu, ks, y = sizes(mf.Equation(GROWTH, outputs=["X", "S"]), ["mu", "Ks", "Y"], [rec])
    assert 0.1 < mu < 3
    assert 5 < ks < 20
    assert 0.2 < y < 2


def test_size_of_a_gain() -> None:
    """p3 is a rate of a rate and unit of insulin."""
    model = mf.Equation(
        ["G' = -(p1 + X)*G + p1*Gb", "X' = -p2*X + p3*(I - Ib)"],
        outputs=["G"], inputs=["I"], hidden=["X"], params={"Ib": 10.0, "Gb": 90.0},
    )  # fmt: skip
    assert 1e-6 < sizes(model, ["p3"], [glucose(0)])[0] < 3e-4


@pytest.mark.parametrize(
    ("text", "size"),
    [("y' + a*y**3 = 0", 5e-3), ("D(y, 2) + a*y = 0", 0.5), ("y' + c*y/(a + y) = 0", 10.0), ("y' = -a", 5.0)],
)
def test_sizes_of_sums(text: str, size: float) -> None:
    """Of y = 10 sqrt(2) sin(0.7 t): a zero on the other side is of every size."""
    t = np.linspace(0, 100, 1001)
    rec = mf.Record(y=10 * np.sqrt(2) * np.sin(0.7 * t), dt=t[1])
    assert sizes(mf.Equation(text), ["a"], [rec])[0] == pytest.approx(size, rel=0.6)


@pytest.mark.parametrize("seed", range(2))
def test_a_motor_as_a_state_space_needs_no_starts(seed):
    """Current and speed of a motor whose entries are products of parameters ended as "rank" always."""
    truth = {"R": 1.2, "L": 0.004, "K": 0.05, "J": 1.5e-4, "b": 2e-4}
    motor = mf.StateSpace(
        [["-R/L", "-K/L"], ["K/J", "-b/J"]], [["1/L"], [0]], states=["i", "w"], inputs=["V"]
    )
    rng = np.random.default_rng(seed)
    volts = np.repeat(rng.choice([-6.0, 6.0], 80), 10)
    dt = 0.001
    clean = motor.model(truth).simulate(u=volts, dt=dt, initial_state=[0.3, 20.0], intersample="zoh")
    noise = rng.standard_normal(clean.shape) * 0.03 * clean.std(axis=1, keepdims=True)
    rec = mf.Record(clean + noise, volts, dt=dt, outputs=["i", "w"], inputs=["V"], intersample="zoh")
    fit = mf.fit(rec, motor)
    assert fit.success
    for name, value in truth.items():
        assert abs(fit[name] - value) < 4.5 * fit.bse[fit.param_names.index(name)]
