"""docs/records/output_error.md: the default fit is no worse than an output error of the same structure."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def numbers(record_page):
    return record_page("output_error")


def test_default_fits_are_within_a_decibel_of_output_error(numbers):
    """The criteria weigh a wrong model differently; no output may lose more than 1 dB by that."""
    compared = {name: one for name, one in numbers["default"].items() if "rival" in one}
    assert set(numbers["default"]) - set(compared) == {"F-18, lateral, 12.5 to 22 s"}
    for name, one in compared.items():
        assert np.all(one["fit, dB"] > one["rival, dB"] - 1.0), name


def test_estimates_agree_within_standard_errors(numbers):
    """HC3's, which know that the residuals are not white."""
    for name, one in numbers["default"].items():
        if "rival" in one:
            fit = one["fit"]
            theirs = np.array([one["rival"].params[key] for key in fit.param_names])
            assert np.all(np.abs(fit.params - theirs) < 2 * fit.bse), name


def test_a_drift_explains_more(numbers):
    for name in ("Twin Otter 018", "Tu-144"):
        for key in ("fit, dB", "rival, dB"):
            assert np.all(numbers["linear"][name][key] > numbers["default"][name][key] + 3.0), name
