"""Outputs clipped for longer than a tenth of a record: what is advised works when it is followed."""

from __future__ import annotations

import re

import flights
import modfun as mf
import numpy as np
import pytest

MODEL = mf.TransferFunction(poles=1, zeros=0)


def clipped(part: float, periods: float, seed: int) -> mf.Record:
    """A response to a square wave, cut at that part of its largest value."""
    t = 0.05 * np.arange(500)
    u = np.sign(np.sin(2 * np.pi * periods * t / t[-1] + 0.1))
    y = np.ravel(mf.tf([2], [1, 1]).simulate(u=u, dt=0.05, intersample="zoh"))
    y += 0.02 * y.std() * np.random.default_rng(seed).standard_normal(500)
    return mf.Record(y=np.minimum(y, part * y.max()), u=u, dt=0.05, intersample="zoh")


@pytest.mark.parametrize(("part", "periods"), [(0.8, 1.5), (0.8, 2.5), (0.6, 2.5)])
def test_the_advice_works(part: float, periods: float) -> None:
    """The mask that was advised was refused, as of a gap that is too long."""
    for seed in range(5):
        rec = clipped(part, periods, seed)
        text = next(one for one in rec.check() if "clipped" in one or "frozen" in one)
        own, code = re.findall(r"own = (rec\.weigh\(.*?\)) and (mf\.fit\(.*\))\.$", text)[0]
        names = {"rec": rec, "np": np, "mf": mf, "model": MODEL, "own": eval(own, {"rec": rec, "np": np})}
        fit = eval(code, names)
        assert np.all(np.abs(fit.params - [1, 2]) < 4.5 * fit.bse)
        assert not any("clipped" in one or "frozen" in one for one in names["own"].check())


def test_short_plateaus_are_masked_as_before() -> None:
    text = next(one for one in clipped(0.8, 6, 0).check() if "clipped" in one)
    assert re.search(r"If so, leave them out, rec\.weigh\(mask=rec\['y'\] != [\d.]+\)\.$", text)
    assert flights.warned(clipped(2.0, 6, 0), MODEL)[1] == ""
