"""Sine and cosine of channels that the record has in degrees."""

import warnings

import modfun as mf
import numpy as np
import pytest

MODEL = mf.Equation("th'' + c*th' + k*sin(th) = 0", outputs="th")
KNOWN = {"c": 0.15, "k": 16.0}


def swing(unit="deg"):
    """A pendulum let go at 57°."""
    th = MODEL.model(KNOWN).simulate(dt=0.02, intervals=400, initial_state=[1.0, 0.0])
    th = th + 0.005 * np.random.default_rng(0).standard_normal(th.size)
    return mf.Record(y=th * (180 / np.pi if unit == "deg" else 1), dt=0.02, outputs="th", units={"th": unit})


def test_a_sine_of_degrees_is_named_with_the_cure_that_works():
    """The fit said to bound parameters closer, or nothing."""
    with pytest.warns(mf.ModfunWarning, match=r"take sin\(\) of th, which is in deg. First try rec.convert"):
        fit = mf.fit(swing(), MODEL)
    assert "sin() of th, which is in deg" in next(iter(fit.check()))
    cured = mf.fit(swing().convert(th="rad"), MODEL)
    assert np.abs((cured.params - list(KNOWN.values())) / cured.bse).max() < 3
    assert not any("which is in" in text for text in cured.check())


def test_a_cosine_of_a_shifted_angle_is_named(recwarn):
    text = "th'' + c*th' + k*cos(th - a) = 0"
    mf.fit(swing(), mf.Equation(text, outputs="th", params={"a": mf.Free(1.5, min=1.4, max=1.7)}))
    assert "cos() of th, which is in deg" in str(recwarn[0].message)


@pytest.mark.parametrize("text", ["th'' + c*th' + k*57.3*sin(th/57.3) = 0", "th'' + c*th' + k*th = 0"])
def test_degrees_turned_into_radians_or_outside_are_right(text):
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", category=mf.ModfunWarning)  # the second is no pendulum
        fit = mf.fit(swing(), mf.Equation(text, outputs="th"))
    assert not any("which is in deg" in sentence for sentence in fit.check())
