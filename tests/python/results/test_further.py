"""Tests of further columns object to right models as rarely as they promise, and find what is there."""

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
    with pytest.warns(mf.ModfunWarning, match=r"First try a delay, delay=mf.Free\(min=0, max=\d") as caught:
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
