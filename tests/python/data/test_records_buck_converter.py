"""docs/records/buck_converter.md: what it states."""

import pytest


@pytest.fixture(scope="module")
def numbers(record_page):
    return record_page("buck_converter")


def test_one_linear_model_does_not_predict(numbers):
    fitted, predicted = numbers["linear"]
    assert fitted == pytest.approx(16.7, abs=0.1)
    assert predicted == pytest.approx(8.4, abs=0.1)


def test_the_diode_does(numbers):
    """Twice the accuracy on the second half; 8 dB of gain is far beyond what two fitted states give."""
    assert numbers["diode"][0] > 16
    assert numbers["diode"][1] > 16


def test_the_gain_is_that_of_theory(numbers):
    """-8 V/V: within two standard errors, which a right model misses in 5 %."""
    gain = numbers["gain"]
    assert abs(gain["value"] - 8) < 2 * gain["bse"]
    assert gain["bse"] < 0.1


def test_circuit(numbers):
    """As the page states them; LC is 1/omega**2 by hand: 1/5196.6**2 = 3.703e-8."""
    rising = {row["name"]: row for row in numbers["rising"].rows}
    assert rising["omega"]["value"] == pytest.approx(5198, rel=0.002)
    assert rising["LC"]["value"] == pytest.approx(3.701e-8, rel=0.004)
    assert rising["zeta"]["value"] == pytest.approx(0.151, abs=0.003)
    assert numbers["falling"].rows[0]["value"] == pytest.approx(3.477e-3, rel=0.002)


def test_what_one_linear_model_misses_counts_as_process_noise(numbers):
    """90 % of the misfit of the whole; none where the circuit is linear."""
    whole, rising, falling = numbers["process"]
    assert whole == pytest.approx(0.90, abs=0.02)
    assert rising == falling == 0.0
