"""docs/records/cd_arm.md: what it states."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def numbers(record_page):
    return record_page("cd_arm")


def test_the_inputs_end_where_the_band_does(numbers):
    assert np.all(numbers["above"] < 0.0025)


def test_three_poles_are_chosen(numbers):
    """y1 decides: y2 is the same within .5 dB from one pole to five, and five poles gain next to nothing."""
    levels = np.reshape(numbers["table"]["signal_to_error"], (5, 2))
    assert np.argmax(levels[:4, 0]) == 2
    assert levels[4, 0] - levels[2, 0] < 0.3
    assert np.ptp(levels[:, 1]) < 0.5


def test_the_last_quarter_is_predicted(numbers):
    assert list(numbers["score"]["signal_to_error"]) == pytest.approx([12.9, 14.0], abs=0.1)


def test_the_light_mode(numbers):
    mode = max(numbers["fits"][4].damp().rows, key=lambda row: abs(np.imag(complex(row["pole"]))))
    assert mode["omega"] == pytest.approx(0.4077, abs=0.001)
    assert mode["zeta"] == pytest.approx(0.0094, abs=0.001)


def test_the_future_of_the_forces_tells_of_the_outputs(numbers):
    """Without feedback ten more regressors would only add error."""
    past, future = numbers["future"][0], numbers["future"][5]
    assert future[1] > past[1] + 0.8
