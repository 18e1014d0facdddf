"""docs/records/tu144.md: what it states."""

from itertools import combinations

import numpy as np
import pytest


@pytest.fixture(scope="module")
def numbers(record_page):
    return record_page("tu144")


def test_delay_and_poles_with_errors(numbers):
    """The figure asked for is R2 of .99; a delay of .28 s had been found by hand, by trying."""
    fit = numbers["fit"]
    assert fit.success
    assert fit.score()["r2"][0] > 0.995
    assert numbers["trend"]["constant"].score()["r2"][0] > 0.99
    assert abs(fit["delay"] - 0.28) < 2 * fit.bse[-1] < 0.03
    mode = fit.damp().rows[0]
    assert mode["omega"] == pytest.approx(2.65, abs=0.03)
    assert mode["zeta"] == pytest.approx(0.73, abs=0.02)


def test_no_delay_that_is_held_does_better(numbers):
    """In S/E on the whole record, from which no sample was taken for the delay."""
    levels = {late: fit.score()["signal_to_error"][0] for late, fit in numbers["held"].items()}
    assert max(levels, key=levels.get) == 0.28
    assert max(levels.values()) < numbers["fit"].score()["signal_to_error"][0]


def test_parts_agree_within_their_errors(numbers):
    """Three pairs of three figures within 2.5 standard errors; they share samples, so less is expected."""
    for one, two in combinations(numbers["parts"].values(), 2):
        apart = np.abs(one.params - two.params) / np.hypot(one.bse, two.bse)
        assert np.all(apart < 2.5)


def test_trim_matters_and_a_third_pole_is_drift(numbers):
    assert numbers["trend"][None].score()["r2"][0] < 0.985
    slow = numbers["third"].damp().rows[0]
    assert slow["omega"] < 0.05 < slow["omega_bse"]


def test_gains_without_a_model_agree(numbers):
    assert numbers["apart"] < 0.1


def test_the_check_proposes_the_drift(numbers):
    """BIC falls by 72 over the band of the constant; nothing was said of it."""
    said = [text for text in numbers["trend"]["constant"].check() if 'trend="linear"' in text]
    assert said
    assert "BIC falls from -263.6 to -335.3" in said[0]
    assert not [text for text in numbers["trend"]["linear"].check() if "drift" in text]
