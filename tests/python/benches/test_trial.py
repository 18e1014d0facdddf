"""Fits warn of wrong set-ups with a right cure, and are silent about right ones; `make trial` has all."""

import sys

import pytest
from places import ROOT

sys.path.insert(0, str(ROOT / "benches" / "trial"))
import trial

# A record of these that is not warned of, or whose cure is another one, was not seen among a hundred.
CERTAIN = (
    "two poles for three", "a zero too few", "feed-through left out", "a path left out", "a hard spring",
    "a spike of 20 times the noise", "stiffness up by half over the record", "a square in the spring",
    "an equation without the constant", "a bound that excludes the truth", "drag by the square",
)  # fmt: skip


@pytest.mark.parametrize("name", CERTAIN)
def test_wrong_set_ups_are_warned_of_with_their_cure(name):
    setup = next(one for one in trial.WRONG if one.name == name)
    found = trial.tried(setup, 4)
    assert found["warned"] == found["cured"] == found["told"] == 4


@pytest.mark.parametrize("setup", trial.RIGHT, ids=lambda setup: setup.name)
def test_right_set_ups_are_not(setup):
    """Four records each, 92 in all; of 2,300 none is warned of: one here has a chance below 1 in 10."""
    assert trial.tried(setup, 4)["said"] == 0


def test_the_page_counts_what_was_tried():
    row = {"told": 4, "said": 4, "warned": 3, "cured": 3, "doubts": 4, "common": ""}
    text = trial.page([("one", row)], [("two", row | {"said": 0})], 4)
    assert "75.0 % were warned of" in text
    assert "| one | 4 | 75 % | 100 % | 4 |" in text
