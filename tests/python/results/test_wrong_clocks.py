"""A record with a wrong time step that has a level of noise of its own is named."""

import modfun as mf
import numpy as np
import pytest
from scipy.signal import lsim

TWO = mf.TransferFunction(poles=2, zeros=1)


def flight(seed: int, size: int, dt: float = 0.01) -> mf.Record:
    """A pitch rate after a 3-2-1-1 of the elevator, 3 % noise; `dt` is what the record says."""
    t, rng = np.arange(size) * 0.01, np.random.default_rng(seed)
    edges, signs = 0.5 + np.cumsum([0, 0.9, 0.6, 0.3, 0.3]), (1, -1, 1, -1)
    de = sum(s * ((t >= a) & (t < b)) for s, a, b in zip(signs, edges, edges[1:], strict=False)) * 0.05
    q = lsim(([-60.0, -230.0], [1.0, 9.5, 58.5]), de, t, interp=False)[1]
    return mf.Record(y=q + 0.03 * q.std() * rng.standard_normal(size), u=de, dt=dt, intersample="zoh")


@pytest.mark.parametrize("wrong", range(3))
def test_a_record_that_counts_for_nothing_is_named_with_its_step(wrong: int) -> None:
    """A level of its own took it up in silence, a hundred times theirs. 1 in 100 is said to disagree only."""
    records = [
        flight(30 + 10 * wrong + k, n, 0.001 if k == wrong else 0.01) for k, n in enumerate((600, 500, 900))
    ]
    with pytest.warns(
        mf.ModfunWarning, match=f"Record {wrong} contradicts the others.*First try dt=0.01 for"
    ):
        mf.fit(records, TWO)


def test_records_of_one_clock_are_not_objected_to() -> None:
    """Warnings are errors here; of 10 fits of three records 0 warn."""
    for seed in range(0, 100, 10):
        assert mf.fit([flight(seed + k, size) for k, size in enumerate((600, 500, 900))], TWO).success
