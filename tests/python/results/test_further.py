"""Tests of further columns object to right models as rarely as they promise, and find what is there."""

import re
import warnings
from collections import Counter

import modfun as mf
import numpy as np
import pytest
from modfun.results.further import event, further
from scipy.signal import lfilter

PLANT = mf.tf([5], [1, 3, 8])
CLEAN = mf.simulate(PLANT, input="sin(t**2/5)", duration=20.0, intervals=512)
TWO = mf.TransferFunction(poles=2, zeros=0)


def fits(count, pole=0.0, **changes):
    """Right models of records in noise of 5 %, white or of AR(1) colour."""
    rng = np.random.default_rng(0)
    for _ in range(count):
        white = rng.standard_normal(CLEAN.t.size + 200)
        noise = lfilter([np.sqrt(1 - pole**2)], [1, -pole], white)[200:]
        yield mf.fit(CLEAN.assign(y=CLEAN["y"] + 0.05 * CLEAN["y"].std() * noise), TWO, **changes)


@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_right_models_are_rejected_at_most_at_the_stated_rate(pole):
    """300 fits, each test at .01: more than 11 of one kind have a chance of 1e-4 at the stated rate."""
    said = Counter(one.what for fit in fits(300, pole) for one in further(fit) if one.p_value < 0.01)
    assert not said or max(said.values()) <= 11


@pytest.mark.parametrize("model", [TWO, mf.TransferFunction(poles=1, zeros=0)])
def test_what_white_noise_explains_is_asked_no_further(model):
    """P-values up to the limit are the same; those above it are not asked whether a slope explains more."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.ModfunWarning)
        fit = mf.fit(next(iter(fits(1, 0.9))).records[0], model)
    exact, some = further(fit), further(fit, enough=0.1)
    low = [one for one in exact if one.p_value <= 0.1]
    assert low == [one for one in some if one.p_value <= 0.1]
    assert bool(low) == (model is not TWO)
    assert all(one.p_value >= other.p_value for one, other in zip(exact, some, strict=True))
    assert some != exact


def test_an_event_has_its_time():
    for fit in fits(3):
        rec = fit.records[0]
        y = rec["y"] + 0.3 * np.exp(-(((rec.t - 7.0) / 0.2) ** 2))
        with pytest.warns(mf.ModfunWarning, match="short at about t = 6.* is in y"):
            found = event(mf.fit(rec.assign(y=y), TWO, harmonics=20))
        assert found.p_value < 1e-4
        assert found.time == pytest.approx(7.0, abs=0.5)


def test_a_cure_lowers_bic_by_what_it_says():
    late = mf.simulate(mf.tf([5], [1, 3, 8], delay=0.3), input="sin(t**2/5)", duration=20.0, intervals=512,
                       nsr=0.05, seed=3)  # fmt: skip
    with pytest.warns(
        mf.ModfunWarning, match=r"First try a delay, delay=mf.Free\(min=0.254, max=0.371\)"
    ) as caught:
        fit = mf.fit(late, TWO)
    assert len(caught) == 1
    cured = mf.fit(late, mf.TransferFunction(poles=2, zeros=0, delay=mf.Free(min=0.0, max=1.0)))
    assert cured["delay"] == pytest.approx(0.3, abs=0.02)
    assert "doubt" in repr(fit)
    assert "doubt" not in repr(cured)


def test_free_motion_with_too_few_poles_is_told_to_take_more():
    t = np.arange(0, 20, 0.05)
    noise = 0.01 * np.random.default_rng(0).standard_normal(t.size)
    rec = mf.Record(y=np.exp(-0.3 * t) * np.cos(2 * t) + noise, dt=0.05)
    with pytest.warns(mf.ModfunWarning, match="First try one more pole, poles=2"):
        mf.fit(rec, mf.TransferFunction(poles=1))
    assert not mf.fit(rec, mf.TransferFunction(poles=2)).check()


def test_without_noise_there_is_nothing_to_test():
    fit = mf.fit(CLEAN, TWO)
    assert not fit.check()
    assert "no noise to test" in fit.check().note
    assert "no noise to test" in str(fit.summary())


def noisy(y, u, dt, hold, seed=0):
    noise = 0.05 * y.std() * np.random.default_rng(seed).standard_normal(y.size)
    return mf.Record(y=y + noise, u=u, dt=dt, intersample=hold)


def test_a_saturating_actuator_is_told_from_something_short():
    u, dt = CLEAN["u"], CLEAN.dt
    y = np.ravel(PLANT.simulate(u=u.clip(-0.6, 0.6), dt=dt, intersample="smooth"))
    with pytest.warns(mf.ModfunWarning, match=r"saturates: u acts from -0.5.* to 0.5.*np.clip\(rec"):
        mf.fit(noisy(y, u, dt, "smooth"), TWO)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_drift_that_looks_like_steep_noise_is_settled_by_a_fit(seed):
    y = CLEAN["y"] + 0.6 * CLEAN["y"].std() * CLEAN.t / 20
    with pytest.warns(mf.ModfunWarning, match='slow drift .* First try trend="linear"'):
        mf.fit(noisy(y, CLEAN["u"], CLEAN.dt, "smooth", seed), TWO)


def test_a_held_input_that_acts_in_its_own_sample_is_taken_a_sample_earlier():
    u = np.repeat(np.random.default_rng(5).standard_normal(103), 5)[:514]
    y = np.ravel(PLANT.simulate(u=u, dt=0.1, intersample="zoh"))
    rec = noisy(y[1:], u[:-1], 0.1, "zoh")
    with pytest.warns(mf.ModfunWarning, match=r"First try u a sample earlier, .* \(y\[:-1\] with u\[1:\]\)"):
        mf.fit(rec, TWO)
    cured = mf.fit(mf.Record(y=rec["y"][:-1], u=u[1:-1], dt=0.1, intersample="zoh"), TWO)
    np.testing.assert_array_less(np.abs(cured.params - [3, 8, 5]), 4 * cured.bse)


@pytest.mark.parametrize(
    ("system", "zeros", "dt", "hold", "late"),
    [
        (([5], [1, 3, 8]), 1, 0.1, 1, 1),
        (([5], [1, 3, 8]), 0, 0.1, 15, 3),
        (([5], [1, 3, 8]), 1, 0.02, 4, 3),
        (([8, 20], [1, 3, 8, 10]), 1, 0.1, 4, 8),
    ],
)
def test_a_prbs_through_a_delay_is_cured_by_the_delay(system, zeros, dt, hold, late):
    """More poles or zeros, which can do the same, were named for 6 of these 16 records."""
    n = 400 if dt == 0.1 else 1000
    for seed in range(4):
        u = np.repeat(np.random.default_rng(seed).choice([-1.0, 1.0], n // hold + 2), hold)[: n + 1]
        made = mf.simulate(
            mf.tf(*system, delay=late * dt),
            input=u, duration=n * dt, intervals=n, intersample="zoh", nsr=0.02, seed=seed,
        )  # fmt: skip
        with pytest.warns(mf.ModfunWarning, match="First try a delay, delay=") as said:
            mf.fit(made, mf.TransferFunction(poles=len(system[1]) - 1, zeros=zeros))
        told = re.findall(r"[\d.]*\d", str(said[0].message).split("delay=")[1].split(":")[0])
        assert min(map(float, told)) - 1e-9 <= late * dt <= max(map(float, told)) + 1e-9


def test_no_unstable_structure_is_the_cure_of_a_stable_fit():
    t = np.arange(0, 20, 0.05)
    u = np.where((t > 2) & (t < 6), 1.0, 0.0)
    y = PLANT.simulate(u=u, dt=0.05, intersample="zoh").ravel()
    y += 0.02 * np.random.default_rng(0).standard_normal(t.size)
    with pytest.warns(mf.ModfunWarning, match="First try one more pole, poles=2, zeros=0"):
        mf.fit(mf.Record(y=y, u=u, dt=0.05), mf.TransferFunction(poles=1, zeros=0))


def test_noise_of_logarithms_is_that_of_logarithms():
    """It was compared with the scatter of the counts: 5 % noise was none, and no test looked at it."""
    t = np.arange(61.0)
    counts = np.random.default_rng(1).poisson(20000 * np.exp(-0.05 * t)).astype(float)
    fit = mf.fit(mf.Record(y=counts, dt=1.0), mf.Equation("y' = -k*y"), noise="log-normal")
    assert "no noise to test" not in str(fit.check())
    still = 20000 * np.exp(-0.05 * t + 1e-7 * np.random.default_rng(1).normal(size=t.size))
    fit = mf.fit(mf.Record(y=still, dt=1.0), mf.Equation("y' = -k*y"), noise="log-normal")
    assert "no noise to test" in str(fit.check())


def test_an_outlying_sample_is_named_with_its_record_and_a_mask_that_leaves_it_out():
    fit = next(fits(1))
    rec = fit.records[0]
    y = rec["y"].copy()
    y[300] += 1.0
    records = [rec, rec.assign(y=y)]
    with pytest.warns(mf.ModfunWarning, match=r"sample of y at t = 11\.\d+ s of record 1 is far"):
        text = next(iter(mf.fit(records, TWO).check()))
    found = re.search(r"records\[1\]\.weigh\(mask=records\[1\]\.t != [\d.]+\)", text)
    assert np.flatnonzero(~eval(found[0], {"records": records}).mask[0]).tolist() == [300]
