"""Outputs that are stamped early, as averages over an interval stamped at its start are."""

from __future__ import annotations

import warnings

import modfun as mf
import numpy as np
import pytest

STEP, FINE = 30.0, 2.0  # s: of the averages, and of the samples that they are made of
PER = int(STEP / FINE)


def averaged(seed: int, *, held: int, both: bool) -> mf.Record:
    """Averages of a lag of 60 s, gain 2, dead time 11 s; of the input, too, or its values at their start.

    The mean of 15 samples lies at 14 s, so that the delay of the record is a second longer: 12 s.
    """
    rng = np.random.default_rng(seed)
    u = np.repeat(2.0 * rng.integers(0, 2, 5000 // held + 1) - 1, held)[:4500]
    y = mf.tf([2.0], [60.0, 1.0], delay=11.0).simulate(u=u, dt=FINE, intersample="zoh")
    y = y + 0.05 * rng.standard_normal(y.size)
    means = y.reshape(-1, PER).mean(axis=1)
    inputs = u.reshape(-1, PER).mean(axis=1) if both else u[::PER]
    return mf.Record(y=means, u=inputs, dt=STEP, intersample="zoh")


def fitted(rec: mf.Record) -> tuple[mf.Fit, str]:
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        fit = mf.fit(rec, mf.TransferFunction(poles=1, zeros=0, delay=mf.Free(min=0, max=90)))
    return fit, " ".join(str(one.message) for one in said)


@pytest.mark.parametrize(("both", "word", "held"), [(False, "foh", 30), (True, "smooth", 25)])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_averages_stamped_at_their_start_are_named_with_the_cure(
    seed: int, both: bool, word: str, held: int
) -> None:
    rec = averaged(seed, held=held, both=both)
    fit, said = fitted(rec)
    assert fit["delay"] == 0.0
    assert "y seems to be stamped early" in said
    assert f"First declare intersample={word!r}" in said
    assert "ended on a bound" not in str(fit.check())
    cured, _ = fitted(mf.Record(y=rec.y, u=rec.u, dt=STEP, intersample=word))
    assert cured["delay"] == pytest.approx(12.0, abs=1.0)
    assert 1 / cured["a1"] == pytest.approx(60.0, rel=0.03)


def test_one_of_two_inputs_has_the_delay_that_ends_on_zero() -> None:
    rng = np.random.default_rng(4)
    u, v = (np.repeat(2.0 * rng.integers(0, 2, 100) - 1, 3) for _ in range(2))
    fine = [np.repeat(x, PER) for x in (u, v)]
    y = mf.tf([[[2.0], [1.0]]], [60.0, 1.0], delay=[[4.0, 40.0]]).simulate(u=fine, dt=FINE, intersample="zoh")
    means = (y + 0.05 * rng.standard_normal(y.size)).reshape(-1, PER).mean(axis=1)
    rec = mf.Record(y=means, u=[u, v], dt=STEP, inputs=["u", "v"], intersample="zoh")
    model = mf.TransferFunction(poles=1, zeros=[0, 0], delay=[mf.Free(max=60), 40.0])
    with pytest.warns(mf.ModfunWarning, match=r"y seems to be stamped early.*intersample=\['foh', 'foh'\]"):
        mf.fit(rec, model)


def test_outputs_a_part_of_a_step_early_are_stored_a_step_later() -> None:
    t = 10.0 * np.arange(400)
    plant = mf.tf([2.0], [1800.0, 90.0, 1.0])
    u = "sin(t**2/2e5) + sin(t/70)"
    y = plant.simulate(u=u, dt=5.0, intervals=800)[1::2]  # half a step after each time
    noise = 0.02 * np.random.default_rng(0).standard_normal(400)
    rec = mf.Record(y=y + noise, u=np.sin(t**2 / 2e5) + np.sin(t / 70), dt=10.0, intersample="smooth")
    model = mf.TransferFunction(poles=2, zeros=0, delay=mf.Free(max=20))
    with pytest.warns(mf.ModfunWarning, match=r"y seems to be stamped early") as said:
        mf.fit(rec, model)
    assert "rec.window(rec.t[1], rec.t[-1]).assign(y=rec['y'][:-1])" in str(said[0].message)
    later = rec.window(rec.t[1], rec.t[-1]).assign(y=rec["y"][:-1])
    fit = mf.fit(later, mf.TransferFunction(poles=2, zeros=0, delay=mf.Free(max=30)))
    assert fit["delay"] - 10.0 == pytest.approx(-5.0, abs=0.5)


@pytest.mark.parametrize(("num", "poles"), [([2.0], 1), ([300.0, 2.0], 2)])
def test_no_output_is_early_where_there_is_no_delay_or_a_lead_is_missing(
    num: list[float], poles: int
) -> None:
    rng = np.random.default_rng(5)
    u = np.repeat(2.0 * rng.integers(0, 2, 80) - 1, 5)
    den = [60.0, 1.0] if poles == 1 else [1800.0, 90.0, 1.0]
    y = mf.tf(num, den).simulate(u=u, dt=10.0, intersample="zoh")
    rec = mf.Record(y=y + 0.05 * y.std() * rng.standard_normal(y.size), u=u, dt=10.0, intersample="zoh")
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        fit = mf.fit(rec, mf.TransferFunction(poles=poles, zeros=0, delay=mf.Free(max=40)))
    assert fit["delay"] < 0.5
    assert not any("early" in str(one.message) for one in said)
