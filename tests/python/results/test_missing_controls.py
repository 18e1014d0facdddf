"""What fits of state spaces say where a control that moved is not in the record at all."""

import numpy as np
import pytest
from flights import SHORT, WRITTEN, flown, warned

MISSING = ("an input that is not in the record seems to act", "an input that is not in the record, or")


def flap(t, rng):
    """A flap that travels for two seconds and stays, with a force and a moment."""
    return np.outer((0.02, 0.02), 1 / (1 + np.exp(-(t - rng.uniform(3, 8)) / 0.5)))


def throttle(t, rng):
    start = rng.uniform(2, 8)
    return np.outer((0.01, 0.06), np.interp(t, [0, start, start + 2, 16], [0, 0, 1, 1]))


def drift(t, rng):
    """What a drift of the outputs is: a slow change of both constants."""
    return np.outer((0.002, 0.01), t / 4)


@pytest.mark.parametrize("forces", [flap, throttle])
def test_a_control_that_is_not_in_the_record_is_no_drift(forces):
    """Both were answered with a drift; at least 18 of 20 records tell more."""
    named = 0
    for seed in range(20):
        text = warned(flown(seed, forces=forces), SHORT)[1]
        assert 'First try trend="linear"' not in text
        named += any(words in text for words in MISSING)
    assert named >= 18


def test_a_drift_is_still_named():
    for seed in range(20):
        assert 'First try trend="linear"' in warned(flown(seed, forces=drift), SHORT)[1]


def test_records_with_all_controls_are_not_warned_of():
    """A rate of 6 % would be seen in 50 records with 95 %."""
    for seed in range(50):
        assert warned(flown(500 + seed), WRITTEN if seed % 2 else SHORT)[1] == ""
