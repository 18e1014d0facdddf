"""docs/records/twin_otter_lateral.md: what it states."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def numbers(record_page):
    return record_page("twin_otter_lateral")


def test_four_channels_are_simulated(numbers):
    """Twelve derivatives for four channels of 12.5 s; the worst, phi, is an integral of p."""
    assert np.all(numbers["levels"]["and 2.5 to 15 s"] > [28.5, 30.5, 32.5, 26])
    assert np.all(numbers["levels"]["transfer functions"][:3] > [32, 32, 35])


def test_the_vane_decides_one_derivative(numbers):
    """One sample, as kinematics say, moves Yb by 4 standard errors, Ydr and Lr by 2.5, no other by 2."""
    late, level = numbers["lag"]
    assert late == pytest.approx(0.019, abs=0.002)
    assert level > 32
    before, after = numbers["fits"]["as recorded"], numbers["fits"]["beta earlier"]
    moved = dict(zip(before.param_names, np.abs(after.params - before.params) / after.bse, strict=True))
    assert moved.pop("Yb") > 3.5
    assert moved.pop("Lr") < 3
    assert moved.pop("Ydr") < 3
    assert max(moved.values()) < 2


def test_parts_of_the_record_agree(numbers):
    """The same within two standard errors of the difference at most, for they share data."""
    whole, part = numbers["fits"]["beta earlier"], numbers["fits"]["and 2.5 to 15 s"]
    assert np.all(np.abs(whole.params - part.params) < 2 * np.hypot(whole.bse, part.bse))
    assert np.all(part.bse[[1, 2, 4, 6, 8, 11]] < 0.04 * np.abs(part.params[[1, 2, 4, 6, 8, 11]]))


def test_coefficients_by_hand(numbers):
    """q S b = 56.32 * 422.48 * 64.99: Cndr = (38463 * -5.369 - 1127 * 2.034)/1.5464e6."""
    found = dict(zip(numbers["derived"]["name"], numbers["derived"]["value"], strict=True))
    assert found["Cndr"] == pytest.approx(-0.1350, abs=0.0003)
    assert found["Cnb"] > 0 > found["Clb"]  # weathercock and dihedral
