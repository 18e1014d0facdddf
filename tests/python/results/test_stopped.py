"""Searches that stop: too many poles beside a delay, actuators that saturate, and bounds that are bounds."""

import modfun as mf
import numpy as np
import pytest
from flights import warned

LATE = mf.Free(min=0, max=0.1)
STEPS = ((0.5, 1300), (1.3, 1500), (2.1, 1400), (3.0, 1900))


def motor(seed, limit=np.inf, delay=0.018):
    """Revolutions of a motor whose command is held, and acts up to a limit."""
    t = 0.005 * np.arange(801)
    u = np.full(t.size, 1200.0)
    for begin, value in STEPS:
        u[t >= begin - 1e-9] = value
    plant = mf.tf([9.2 / 0.065], [1, 1 / 0.065], delay=delay)
    y = np.ravel(plant.simulate(u=np.minimum(u, limit) - 1200, dt=0.005, intersample="zoh"))
    y = y + 40 * np.random.default_rng(seed).standard_normal(t.size)
    return mf.Record(y=y, u=u, dt=0.005, outputs="rpm", inputs="pwm")


def first_order(late):
    return mf.TransferFunction(poles=1, zeros=0, delay=late)


@pytest.mark.parametrize("seed", range(8))
def test_a_saturated_actuator_comes_before_the_bound(seed):
    """Said was "Widen it"."""
    text = warned(motor(seed, limit=1600), first_order(LATE))[1]
    assert "The actuator saturates: pwm acts up to 1" in text
    rec = motor(seed, limit=1600)
    cure = text.split("without one, try ")[1].removesuffix(".")
    better, text = warned(eval(cure, {"np": np, "rec": rec}), first_order(LATE))
    assert (better["a1"], text) == (pytest.approx(1 / 0.065, rel=0.05), "")


@pytest.mark.parametrize("seed", range(10))
def test_a_bound_that_is_too_narrow_is_still_named(seed):
    text = warned(motor(seed), first_order(mf.Free(min=0, max=0.008)))[1]
    assert "delay ended on a bound" in text
    assert warned(motor(seed), first_order(LATE))[1] == ""


def test_a_search_with_too_many_poles_ends_on_no_bound():
    """A delay that was still held was called on its bound, and another shape of the input advised."""
    seen = 0
    for seed in range(8):
        fit, text = warned(motor(seed), mf.TransferFunction(poles=2, zeros=0, delay=LATE))
        if fit.success or not text:
            continue
        seen += 1
        assert "the record does not show so many poles. First try poles=1, with which it settles" in text
        assert "on its bound" not in repr(fit)
        assert not any("residuals are only" in said for said in fit.check())
    assert seen


def test_a_search_in_a_valley_names_what_is_hardly_told_apart():
    """The speed alone tells K, J and b of a motor to 93, 95 and 1,000 %: blamed was turbulence."""
    step, n, rng = 2e-3, 2000, np.random.default_rng(0)
    motor = mf.StateSpace(
        [["-R/L", "-K/L"], ["K/J", "-b/J"]], ["1/L", 0], [0, 1], states=["i", "w"], inputs=["v"],
        params={"R": 2.0, "L": 5e-3},
    )  # fmt: skip
    v = np.repeat(rng.choice([2.0, 8.0], n // 20 + 1), 20)[: n + 1]
    system = motor.model({"K": 0.05, "J": 2e-4, "b": 1e-4})
    y = system.simulate(u=v, dt=step, initial_state=[0.5, 60.0], intersample="zoh")
    rec = mf.Record(y={"w": np.ravel(y) + 0.5 * rng.standard_normal(n + 1)}, u={"v": v}, dt=step)
    with pytest.warns(mf.ModfunWarning, match=r"K, J and b can hardly be told apart \(condition index"):
        fit = mf.fit(rec, motor, maxiter=10)
    assert fit.status == "maxiter"
    assert "turbulence" not in str(fit.check())
