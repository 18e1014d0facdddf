"""A valve whose gain goes with its stem is told from a load: both move the output where the valve steps."""

import warnings

import modfun as mf
import numpy as np
import pytest

LAG = mf.TransferFunction(poles=1, zeros=0, delay=mf.Free(min=0, max=40))


def said(seed, valve, load=0.0):
    """What a fit of a flow behind 30 s and 8 s warns of, whose stem moves every 40 s."""
    rng = np.random.default_rng(seed)
    stem = rng.uniform(10, 90, 38).repeat(40)[:1500]
    acts = valve(stem) + load * (np.arange(1500) > 700)
    system = mf.tf([2.0], [30, 1], delay=8.0)
    y = system.simulate(u=acts, dt=1.0, intersample="zoh") + 0.5 * rng.standard_normal(1500)
    rec = mf.Record(y=y, u=stem, dt=1.0, inputs="OP", outputs="F", intersample="zoh")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        mf.fit(rec, LAG)
    return " ".join(str(one.message) for one in caught)


@pytest.mark.parametrize("seed", [0, 2, 5])
def test_an_equal_percentage_valve_is_no_load(seed):
    text = said(seed, lambda stem: 100 * 30 ** (stem / 100 - 1))
    assert "follow powers of OP" in text
    assert "something acts on F" not in text


@pytest.mark.parametrize("seed", [0, 1])
def test_a_load_is_no_valve(seed):
    text = said(seed, lambda stem: stem, load=20.0)
    assert "powers of OP" not in text
    assert "something acts on F" in text or "drift" in text
