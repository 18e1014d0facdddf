"""docs/records/f16_simulation.md: what it states."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def numbers(record_page):
    return record_page("f16_simulation")


def test_thirteen_of_fourteen_within_three_errors(numbers):
    """Linear matrices of a nonlinear simulation: fourteen normal errors would all hold in 96 % of cases."""
    off = {name: abs(value) for name, value in numbers["off"]["all"].items()}
    assert off.pop("Nda") > 4
    assert len(off) == 13
    assert max(off.values()) < 3
    assert off["Lp"] < 1.5  # those the README quotes
    assert off["Lda"] < 1.5
    fit = numbers["fits"]["all"]
    assert fit["Nda"] / numbers["truth"][-1] == pytest.approx(1.0075, abs=0.001)


def test_the_record_itself_has_another_yawing_moment(numbers):
    """One entry of the published matrices changed, nothing fitted: what beta and r gain, dB."""
    levels = numbers["levels"]
    better = levels["published, Nda 0.9 % larger"] - levels["published, smooth"]
    assert np.all(better[[0, 2]] > [9, 7])
    held, straight = levels["published, zoh"], levels["published, foh"]
    assert np.all(np.abs(levels["published, smooth"] - straight) < 1)
    assert np.all(held[[0, 2, 3]] < straight[[0, 2, 3]] - 3)


def test_errors_hold_where_the_matrices_are_true(numbers):
    """100 simulations, 26 entries: fewer than 97 has probability .03 % an entry if 99.7 % are expected."""
    for shares in numbers["covered"].values():
        assert np.all(shares >= 97)


def test_one_input_ties_six_entries(numbers):
    free, held = numbers["collinearity"]["all"], numbers["collinearity"]["two known"]
    assert free.condition > 100
    assert "Yr, Lb, Lp, Lr, Pr and Lda can hardly be told apart" in free.findings[0]
    assert held.condition < 20
    one, two = numbers["fits"]["all"], numbers["fits"]["two known"]
    sizes = [dict(zip(f.param_names, f.bse, strict=True)) for f in (one, two)]
    gain = {name: sizes[0][name] / sizes[1][name] for name in ("Lb", "Lr", "Lda")}
    assert min(gain.values()) > 3
