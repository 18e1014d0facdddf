"""docs/records/steam_generator.md: what it states."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def numbers(record_page):
    return record_page("steam_generator")


def test_the_last_third_is_predicted(numbers):
    levels = {name: row[1] for name, row in numbers["levels"].items()}
    assert levels["steam, as below"] == pytest.approx(19.9, abs=0.1)
    assert levels["p, as below"] == pytest.approx(14.9, abs=0.1)
    assert levels["level, as below"] > levels["level, four inputs"] + 3.5  # its delays
    assert levels["o2, as below"] > levels["o2, four inputs"] + 9  # its formula


def test_responses_begin_after_their_delays(numbers):
    """Before it a response is noise of least squares, below .015; at it at least .04."""
    level = numbers["pulses"]["level"]
    for row, first in ((0, 4), (2, 4), (3, 3)):
        assert np.all(np.abs(level[row, :first]) < 0.015)
        assert abs(level[row, first]) > 0.04
    fit = numbers["delay"]
    assert fit["delay[fuel]"] == pytest.approx(3.0, abs=0.3)


def test_the_controller_inside_makes_the_gains_one_and_zero(numbers):
    """Within three standard errors each: a right model misses that in one of a hundred records."""
    fit = numbers["fits"]["level"]
    last = {name: f"b2[{name}]" for name in ("fuel", "ref", "load")}
    found = fit.derived(**{k: (lambda p, b=b: p[b] / p["a3"]) for k, b in last.items()})
    for row, wanted in zip(found.rows, (0, 1, 0), strict=True):
        assert abs(row["value"] - wanted) < 3 * row["bse"]


def test_oxygen_is_what_burning_leaves(numbers):
    """By mass balance the gain from the formula is 1."""
    fit = numbers["fits"]["o2"]
    gain = fit.derived(gain="b0/a1").rows[0]
    assert abs(gain["value"] - 1) < 2 * gain["bse"]
    assert numbers["carried"] == pytest.approx(0.88, abs=0.021)
