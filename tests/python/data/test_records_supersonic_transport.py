"""docs/records/supersonic_transport.md: what it states."""

import numpy as np
import pytest

USUAL, SURE = (f"intervals of {level} % that hold the truth" for level in (95, 99.7))


@pytest.fixture(scope="module")
def numbers(record_page):
    return record_page("supersonic_transport")


@pytest.mark.parametrize("noise", ["ytrue, white 5 %", "ytrue, white 10 %", "ytrue, white 20 %"])
def test_truth_and_delay_within_three_errors(numbers, noise):
    """Of 100 copies three or more outside of 99.7 %: probability .3 % a figure with true errors."""
    assert np.all(numbers["studies"][noise][SURE] >= 98)
    assert np.all(numbers["studies"][noise][USUAL] >= 87)  # under .1 % a figure


def test_the_file_is_a_midpoint_rule(numbers):
    """Every digit of ytrue is repeated, so what fits to it miss is the rule's own error."""
    assert numbers["midpoint"] < 1e-9
    np.testing.assert_allclose(numbers["poles"], [0.90075, 2.00107], atol=1e-5)
    assert numbers["exact"] < 1e-5
    # Towards the rule's poles, not past them.
    assert 0.9 < numbers["clean"]["a1"] < numbers["poles"][0]
    assert 2.0 < numbers["clean"]["a2"] < numbers["poles"][1]
    assert np.all(numbers["studies"]["ytrue, white 1 %"][SURE][[1, 4]] < 90)
    assert np.all(numbers["studies"]["exact, white 1 %"][SURE] >= 98)


def test_colour_alone_does_no_harm(numbers):
    """Noise with the spectrum of z - ytrue: intervals hold as limits.md says, weighing by the colour pays."""
    plain = numbers["studies"]["exact, colour of z"]
    knowing = numbers["studies"]['  with noise="coloured"']
    assert np.all(plain[SURE] >= 97)
    assert np.all(knowing[SURE] >= 97)
    assert 86 <= np.mean(plain[USUAL]) <= 96
    assert plain["deviation"][4] > 3 * knowing["deviation"][4]


def test_the_measured_column_is_not_the_truth_plus_noise(numbers):
    """b0 is off by five errors, all else by less than three; the difference follows the stick."""
    fit = numbers["measured"]["output"]
    off = np.abs(fit.params - [0.9, 2.0, 0.4, 0.1, 0.2]) / fit.bse
    assert np.all(off[[0, 1, 3, 4]] < 3)
    assert off[2] > 5
    related, by_chance = numbers["coherence"]
    assert related > 0.5
    assert by_chance < 0.1
