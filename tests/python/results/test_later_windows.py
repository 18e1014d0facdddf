"""Cures that shorten the window: a delay so long that it leaves the response to the input out is none."""

import re
import warnings

import modfun as mf
import numpy as np
import pytest
from scipy.signal import lsim


def _pitch(seed: int) -> mf.Record:
    """Pitch angle after a doublet of the elevator at 3 to 8 s: a phugoid of 39 s and a short period."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 90.0, 0.04)
    step = np.where((t >= 3) & (t < 5.5), 0.035, np.where((t >= 5.5) & (t < 8), -0.035, 0.0))
    _, u, _ = lsim(([20.0], [1, 20.0]), step, t)
    a = np.array([[-0.035, 4, 0, -9.81], [-0.25 / 75, -1.1, 1, 0], [0, -6, -2, 0], [0, 0, 1, 0]])
    plant = (a, np.array([[0], [-0.1], [-8], [0]]), np.array([[0, 0, 0, 1.0]]), np.zeros((1, 1)))
    _, y, _ = lsim(plant, u, t, X0=[1.5, 0, 0, -0.02])
    y = np.degrees(y) + 2.1 + 0.25 * rng.standard_normal(t.size)
    return mf.Record(y=y, u=np.degrees(u) - 1.3, t=t, outputs="theta", inputs="de")


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("seed", range(3))
def test_a_delay_that_leaves_the_response_out_is_no_cure(seed: int) -> None:
    """BIC fell from 104 to -65 by a delay of 11 s, since the doublet had no response in the window."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        mf.fit(_pitch(seed), mf.TransferFunction(poles=2, zeros=0))
    text = " ".join(str(one.message) for one in said)
    assert "First try" in text
    assert "a delay" not in text
    assert re.search(r"poles=4|zeros=1", text)


def test_a_delay_of_seconds_is_still_named() -> None:
    """The same where the output is late: the window of the right fit starts before the response, too."""
    rng = np.random.default_rng(0)
    t = np.arange(0.0, 60.0, 0.1)
    u = np.where((t >= 3) & (t < 8), 2.0, np.where((t >= 8) & (t < 13), -2.0, 0.0))
    _, y, _ = lsim(([1], [1, 0.5]), np.interp(t - 2.5, t, u), t)
    rec = mf.Record(y=y + 0.05 * rng.standard_normal(t.size), u=u, t=t)
    with pytest.warns(UserWarning, match=r"First try a delay, delay=mf.Free\(min=2.\d+, max=2.\d+\)"):
        mf.fit(rec, mf.TransferFunction(poles=1, zeros=0))


@pytest.mark.filterwarnings("ignore")
def test_models_are_compared_over_the_same_window() -> None:
    """A delay of 11 s was far better by BIC, since it leaves out what the other model has wrong."""
    rec = _pitch(0)
    none = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    late = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0, delay=11.5))
    bic = mf.compare([none, late], rec)["bic"]
    assert not bic[1] < bic[0] - 10
