"""Step tests from rest whose structure is too simple, which a free initial state hides in the gain."""

import modfun as mf
import numpy as np
import pytest
from flights import warned
from modfun.records.steady import flat
from modfun.results.lag_or_delay import acts_by_lag

STEP = np.where(np.arange(600) >= 40, 1.0, 0.0)
LATE = mf.Free(min=0, max=15)
MODEL = mf.TransferFunction(poles=2, zeros=0, delay=LATE)
FOUR_LAGS = mf.tf([2.0], np.poly([-1 / 8, -1 / 5, -1 / 5, -1 / 3]) * 600, delay=1.5)
TWO_LAGS = mf.tf([2.0], np.poly([-1 / 10, -1 / 5]) * 50, delay=5.0)


def bumped(system, seed, **start):
    """A step test of 300 s at 2 Hz whose step follows after 20 s."""
    y = system.simulate(u=STEP, dt=0.5, intersample="zoh", **start).ravel()
    noisy = 10 + y + 0.02 * np.random.default_rng(seed).standard_normal(600)
    return mf.Record(y=noisy, u=STEP, dt=0.5, intersample="zoh")


def gain(fit):
    return fit.params[fit.param_names.index("b0")] / fit.params[fit.structure.poles - 1]


@pytest.mark.parametrize("seed", [1, 4, 12, 25])
def test_four_lags_ask_for_one_more_pole_from_rest(seed):
    """The gain was 1.69 to 1.76 ± 0.06, without a word or with a lag in place of the delay, of gain 2.2."""
    rec = bumped(FOUR_LAGS, seed)
    fit, said = warned(rec, MODEL)
    assert abs(gain(fit) - 2) > 0.1
    assert "The record begins at rest" in said
    assert (
        'First try one more pole beside the delay, poles=3, zeros=0, and initial_state="rest": from' in said
    )
    assert not any("seems to be a lag" in text or "not linear" in text for text in fit.check())
    better, still = warned(rec, mf.TransferFunction(poles=3, zeros=0, delay=LATE), initial_state="rest")
    assert not still
    assert abs(gain(better) - 2) < 0.012  # four standard errors


def test_no_lag_takes_the_place_of_a_delay_that_the_start_at_rest_shows():
    """The record told a lag from the delay, by what the free initial state had taken."""
    fit, _ = warned(bumped(FOUR_LAGS, 4), MODEL)
    assert acts_by_lag(fit) is None


@pytest.mark.statistics
def test_a_right_structure_is_left_alone_from_rest_and_in_motion():
    """One record in 10,000 from rest may be warned of: of 120 with a right structure none was."""
    for seed in range(6):
        start = {} if seed % 2 else {"initial_state": [0.2, 0.03]}
        _, said = warned(bumped(TWO_LAGS, seed, **start), MODEL)
        assert "at rest" not in said


def test_outputs_that_stand_are_told_from_those_that_move():
    rng, t = np.random.default_rng(0), np.arange(600.0)
    noise = rng.standard_normal(600)

    def seen(y, first=40):
        return flat(mf.Record(y=y, u=np.where(t >= first, 1.0, 0.0), dt=0.5))

    assert seen(noise)
    assert seen(noise.round())
    assert seen(np.where(t >= 60, 1.0 + noise, 5.0))  # a sensor whose steps are coarser than its noise
    assert not seen(noise + 0.1 * t)
    assert not seen(noise + 5 * np.exp(-t / 10))
    assert not seen(noise, first=8)  # which tells too little
    assert not seen(noise, first=0)
