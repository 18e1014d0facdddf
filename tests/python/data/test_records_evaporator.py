"""docs/records/evaporator.md: what it states."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def numbers(record_page):
    return record_page("evaporator")


def test_the_last_third_is_predicted(numbers):
    """Each further pole up to four predicts better; the values are those of the page."""
    levels = [row[1] for name, row in numbers["levels"].items() if "an output" in name][:4]
    assert np.all(np.diff(levels, axis=0) > 0)
    assert levels[3] == pytest.approx([7.8, 8.1, 12.9], abs=0.1)


def test_shared_poles_predict_worse(numbers):
    levels = numbers["levels"]
    assert np.all(levels["4 poles an output"][1] > levels["4 poles for all"][1] + 0.3)


def test_the_cooling_water_is_not_held(numbers):
    fitted, predicted, _ = numbers["held"]
    own = numbers["levels"]["4 poles an output"]
    assert own[0][2] > fitted + 2.5
    assert own[1][2] > predicted + 1


def test_gains_have_the_signs_of_an_evaporator(numbers):
    """Three signs beyond two standard errors each."""
    for name, key, sign in (("matter", "feed", -1), ("matter", "vapor", 1), ("temp", "cool", -1)):
        fit = numbers["fits"][name, 3]
        gain = fit.derived(gain=lambda p, key=key: p[f"b2[{key}]"] / p["a3"]).rows[0]
        assert sign * gain["value"] > 2 * gain["bse"]
