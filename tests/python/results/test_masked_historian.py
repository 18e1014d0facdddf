"""Outputs that a historian stores with a dead band, a few of whose samples are masked."""

from __future__ import annotations

import modfun as mf
import numpy as np
import pytest
from scipy.signal import lfilter


def stored(seed: int, masked: int) -> mf.Record:
    """A first-order process with dead time under steps; changes below 0.5 are not stored."""
    rng, count, dt = np.random.default_rng(seed), 900, 10.0
    u = 10 * np.repeat(rng.choice([-1.0, 1.0], 15), 60)
    a = np.exp(-dt / 240)
    clean = lfilter([0, 0.8 * (1 - a)], [1, -a], np.r_[np.full(6, u[0]), u[:-6]])
    noisy = clean + 0.05 * rng.standard_normal(count)
    kept = np.empty(count)
    last = kept[0] = noisy[0]
    for k in range(1, count):
        if abs(noisy[k] - last) > 0.5:
            last = noisy[k]
        kept[k] = last
    mask = np.ones(count, dtype=bool)
    mask[rng.choice(np.arange(50, 850), masked, replace=False)] = False
    return mf.Record(y=kept, u=u, dt=dt, mask=mask if masked else None, outputs=["PV"], intersample="zoh")


@pytest.mark.parametrize("masked", [0, 1, 12])
def test_a_dead_band_is_named_whatever_is_masked(masked):
    """One masked sample had silenced it in 10 of 10 records, a gain 9 % off."""
    for seed in range(3):
        with pytest.warns(mf.ModfunWarning, match="keeps its value until it has changed by 0.5"):
            mf.fit(stored(seed, masked), mf.TransferFunction(poles=1, zeros=0, delay=mf.Free(max=200)))


def test_words_of_quality_are_a_mask(tmp_path):
    rows = [f"{k},{k % 7},{k % 5},{'Bad' if k == 4 else 'Good'}" for k in range(40)]
    (tmp_path / "tag.csv").write_text("\n".join(["t,PV,OP,Quality", *rows]))
    rec = mf.read(tmp_path / "tag.csv", time="t", outputs="PV", inputs="OP", mask="Quality")
    assert np.flatnonzero(~rec.mask[0]).tolist() == [4]
