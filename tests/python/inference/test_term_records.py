"""Records of a term selection of which one has another unit or exchanged columns."""

import re

import modfun as mf
import pytest

PREDATION = mf.Equation(["x' = a*x - b*x*z", "z' = -c*z + d*x*z"], outputs=["x", "z"]).model(
    {"a": 1.0, "b": 0.5, "c": 0.8, "d": 0.4}
)
LIBRARY = "polynomials of x, z up to 2"


def records(seed):
    each = zip(([2, 1], [4, 3], [1, 0.5]), (12, 10, 15), strict=True)
    return [
        mf.simulate(
            PREDATION,
            initial_state=state,
            duration=duration,
            intervals=20 * duration,
            nsr=0.03,
            seed=seed + k,
        )
        for k, (state, duration) in enumerate(each)
    ]


@pytest.mark.parametrize("seed", [0, 10, 20])
def test_a_record_in_another_unit_is_named(seed):
    """A constant was all that was chosen, and "a term is missing" all that was said."""
    first, second, third = records(seed)
    slip = third.assign(x=10 * third["x"])
    found = mf.select_terms([first, second, slip], LIBRARY)
    told = found.notes[-1]
    assert "Alone, each is explained by x' = c1*x + c2*x*z, z' = c3*z + c4*x*z." in told
    assert re.search(r"c4 is 0\.\d+ ± \S+ in record [01] and 0\.0[34]\d+ ± \S+ in record 2", told)


def test_a_record_with_exchanged_columns_is_named():
    first, second, third = records(0)
    slip = third.assign(x=third["z"], z=third["x"])
    found = mf.select_terms([first, second, slip], LIBRARY)
    assert "do not follow one equation" in found.notes[-1]


def test_records_of_one_equation_are_not_told_apart():
    for seed in range(0, 60, 3):
        found = mf.select_terms(records(seed), LIBRARY)
        assert not any("one equation" in note for note in found.notes)


def test_a_term_that_no_record_has_is_not_blamed_on_records():
    found = mf.select_terms(records(0), "polynomials of x, z up to 1")
    assert not any("one equation" in note for note in found.notes)
    assert "a term is missing" in "".join(found.notes)
