"""The page docs/records/f18_longitudinal.md shows what its script prints; what it states beside that."""

import numpy as np
import pytest


@pytest.fixture
def found(record_page):
    return record_page("f18_longitudinal")


def test_the_reports_figures_are_exceeded(found):
    """8–12 dB in the report (4.7), for two and three poles, common and separate."""
    for channel, two, three in (("alpha, dB", 16.4, 17.3), ("q, dB", 21.0, 23.7)):
        levels = found["scores"][channel]
        assert np.all(levels > 12)
        assert np.all(levels[:2] > two)
        assert np.all(levels[2:] > three)


def test_the_observer_is_as_good_and_zero_is_not(found):
    levels = found["levels"]
    np.testing.assert_allclose(levels["observer, mean"], levels["least squares, mean"], atol=0.02)
    assert np.all(levels["zero, mean"] < 0)
    assert levels["least squares, about zero"][0] == pytest.approx(36.9, abs=0.2)


def test_the_vane_shakes(found):
    assert found["fast"][0] == pytest.approx(96, abs=1)


def test_what_is_known_and_what_not(found):
    """The stabilator's pitching moment to 5 %, the damping not at all."""
    fit = found["fits"][3, "common"]
    assert fit["b0[q_dps]"] == pytest.approx(-1.47, abs=0.03)
    assert fit.bse[fit.param_names.index("b0[q_dps]")] < 0.07
    mode = fit.damp().rows[0]
    assert mode["omega"] == pytest.approx(0.753, abs=0.01)
    assert abs(mode["zeta"]) < 2 * mode["zeta_bse"]
