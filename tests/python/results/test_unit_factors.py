"""From which factors of channels a unit is named."""

import pytest
from flights import FORCES, flown, warned
from modfun.results.factors import OF_FORCES
from modfun.results.held_numbers import Number, _of_scales


def test_an_accelerometer_whose_unit_is_told_as_g_is_said_to_be_in_g():
    units = {"alpha": "rad", "q": "rad/s", "az": "g", "de": "rad"}
    for seed in range(3):
        text = warned(flown(seed, force=True, az=1 / 9.80665).assign(units=units), FORCES)[1]
        assert "az seems to be in g and not in m/s²" in text


@pytest.mark.parametrize(("found", "error", "named"), [(0.509, 0.096, False), (0.509, 0.01, True)])
def test_no_unit_is_named_from_a_factor_that_is_hardly_known(found, error, named):
    """As of an accelerometer with a lever, which equations without it make half of."""
    one = Number("what the equations make of ay", 1.0, {"ay": 1, "beta": -1}, found, error)
    assert bool(_of_scales([one], [], {"ay": OF_FORCES}, [])) is named


@pytest.mark.parametrize(("error", "named"), [(0.12, False), (0.01, True)])
def test_angles_are_in_degrees_only_where_a_number_of_an_accelerometer_is_known(error, named):
    """57.3 times one of 1/57.3: angles in degrees make an acceleration in m/s2 so much too large."""
    numbers = [
        Number("r in the equation of beta', where the model has -1", -1.0, {"beta": 1, "r": -1}, -1.0, 0.01),
        Number("what the equations make of ay", 1.0, {"ay": 1, "beta": -1}, 1 / 57.3, error / 57.3),
    ]
    assert bool(_of_scales(numbers, ["beta", "r"], {"ay": OF_FORCES}, [])) is named
