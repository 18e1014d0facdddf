"""docs/records/exchanger.md: what it states."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def numbers(record_page):
    return record_page("exchanger")


def test_the_flow_acts_in_its_own_sample(numbers):
    """A held input cannot: the response at lag 0 would be 0, and it is as large as those after it."""
    pulse = numbers["pulse"]
    assert pulse[0] < 0.8 * pulse[1:5].max()
    assert np.all(np.abs(pulse[8:]) < 0.12)


def test_one_sample_earlier_is_worth_four_decibels(numbers):
    levels = numbers["levels"]
    gained = np.subtract(levels["one sample earlier"], levels["as in the file"])
    assert np.all(gained[:3] > 3.7)
    assert numbers["order"] == (2, 0)


def test_what_leaves_the_tube_is_what_entered(numbers):
    """Two gains fitted apart cancel: within their errors, which a false model would not do."""
    for name in ("transit time", "squared, transit time"):
        fit = numbers["fits"][name]
        assert abs(fit["b0[in]"] + fit["b0[out]"]) < 0.2 * fit.bse[0]
        assert fit["delay[out]"] == pytest.approx(6.25, abs=0.1)


def test_squares_predict_better(numbers):
    """On all windows of the same excitation; three poles most, and least at low flow."""
    levels = numbers["levels"]
    assert levels["flow squared"][1] > levels["one sample earlier"][1] + 1
    assert levels["flow squared"][1] == pytest.approx(9.8, abs=0.1)
    gained = np.subtract(levels["squared, three poles"], levels["flow squared"])
    assert gained[:3] == pytest.approx([2.2, 2.3, 1.6], abs=0.2)
    assert 0 < gained[3] < 0.5
    assert numbers["gain"]["flow squared"]["value"] == pytest.approx(-17.9, abs=0.1)
