"""docs/records/ball_beam.md: what it states."""

import numpy as np
import pytest

EQUATION = "noise of the equation"


@pytest.fixture(scope="module")
def numbers(record_page):
    return record_page("ball_beam")


def test_the_noise_of_a_double_integrator_is_in_the_equation(numbers):
    """A model fitted with the wrong noise predicts windows of 5 s with half the accuracy, or worse."""
    levels = numbers["levels"]
    assert levels[f"held, {EQUATION}"][0] > levels["held, noise of the output"][0] + 10
    assert levels[f"free, {EQUATION}"][0] > levels["free, noise of the output"][0] + 2


def test_free_poles_predict_better_than_poles_at_zero(numbers):
    gain = np.subtract(numbers["levels"][f"free, {EQUATION}"], numbers["levels"][f"held, {EQUATION}"])
    assert np.all(gain > 6)
    assert numbers["levels"][f"free, {EQUATION}"][1] == pytest.approx(24.6, abs=0.2)


def test_both_halves_have_the_same_system(numbers):
    """Four differences within two standard errors each: a right model fails in about one of six records."""
    one, two = numbers["fits"][f"free, {EQUATION}"], numbers["fits"]["free, the other half"]
    assert np.all(np.abs(one.params - two.params) < 2 * np.hypot(one.bse, two.bse))
    # The ball runs away from the middle in both.
    for fit in (one, two):
        at = fit.param_names.index("a2")
        assert fit.params[at] < -3 * fit.bse[at]


def test_the_delay_is_more_than_a_sample(numbers):
    fit = numbers["fits"][f"held, {EQUATION}"]
    assert fit["delay"] == pytest.approx(0.136, abs=0.005)
    assert fit["delay"] > 2 * fit.bse[fit.param_names.index("delay")]


def test_noise_of_both_kinds_is_that_of_the_equation(numbers):
    """With sensor noise as well, the acceleration is all but a few thousandths of the misfit."""
    both, one = numbers["fits"]["free, noise of both"], numbers["fits"][f"free, {EQUATION}"]
    assert both.process_noise()["share"][1] == pytest.approx(0.998, abs=0.001)
    assert np.all(np.abs(both.params - one.params[:3]) < 0.5 * both.bse)
    np.testing.assert_allclose(
        numbers["levels"]["free, noise of both"], numbers["levels"][f"free, {EQUATION}"], atol=0.7
    )
