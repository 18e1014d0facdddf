"""docs/records/twin_otter.md: what it states."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def numbers(record_page):
    return record_page("twin_otter")


def test_run_018_predicts_run_019(numbers):
    """The figure asked for is R2 of .99; a published transfer function has .992 and .999 here."""
    assert numbers["q 018"]["r2"] > 0.998
    assert numbers["q 019"]["r2"] > 0.999


def test_state_equations_predict_both_channels(numbers):
    """Within 2 dB of the fit's own record: a model of noise would lose more on the other run."""
    fitted, predicted = numbers["levels"]["018, alpha earlier"].values()
    assert np.all(fitted > 26.5)
    assert np.all(predicted > 28)


def test_runs_agree_within_their_errors(numbers):
    """Five differences within three standard errors each: false alarm about 1 % (t of 10 degrees: 6 %)."""
    one, two = numbers["fits"]["018, alpha earlier"], numbers["fits"]["019, alpha earlier"]
    assert np.all(np.abs(one.params - two.params) < 3 * np.hypot(one.bse, two.bse))


def test_the_vane_is_late_in_both_runs(numbers):
    """Two records, two manoeuvres, no aerodynamics: between one sample and one and a half."""
    for late, level in numbers["lag"].values():
        assert 0.02 <= late <= 0.03
        assert level > 26
    # The equations, which know of the lag by aerodynamics alone, say the same with their larger error.
    lag = dict(zip(numbers["late"].param_names, numbers["late"].bse, strict=True))["h"]
    assert numbers["late"].success
    assert abs(numbers["late"]["h"] - 0.0245) < 2 * lag < 0.02
    # With it the elevator's lift has the sign that an elevator's lift has.
    assert numbers["fits"]["both"]["Zd"] > 0 > numbers["fits"]["both, alpha earlier"]["Zd"]


def test_nondimensional_derivatives(numbers):
    """Cma = -9.667 * 24273/(55.97 * 422.48 * 6.496) = -1.528, Cmq = -3.086 * .158 * 72.9 = -35.54."""
    found = dict(zip(numbers["derived"]["name"], numbers["derived"]["value"], strict=True))
    assert found["Cma"] == pytest.approx(-1.528, abs=0.002)
    assert found["Cmq"] == pytest.approx(-35.54, abs=0.05)
