"""Channels with a slower clock of their own, which repeat values at no even rate, and inputs that rest."""

import modfun as mf
import numpy as np
import pytest

T = 0.02 * np.arange(401)


def repeated(rate: float, digits: int = 9) -> np.ndarray:
    """A noisy signal of which a sensor saw so many values per second."""
    tick = np.floor(T * rate + 0.3).astype(int)
    first = np.unique(tick, return_index=True)[1]
    y = np.sin(2 * T) + 0.05 * np.random.default_rng(1).normal(size=401)
    return np.round(y, digits)[first][tick - tick[0]]


def record(y: np.ndarray, u: np.ndarray | None = None) -> mf.Record:
    return mf.Record(y=y, u=np.cos(3 * T) if u is None else u, dt=0.02, outputs=["alpha"], inputs=["de"])


@pytest.mark.parametrize(
    ("rate", "said"),
    [(12.3, "4 to 5 samples (4.06"), (18.5, "2 to 3 samples (2.7"), (30.0, "1 to 2 samples (1.66")],
)
def test_a_clock_of_its_own_is_named_with_the_mask_that_leaves_its_samples(rate, said):
    rec = record(repeated(rate))
    (text,) = rec.check()
    assert said in text
    assert "rec.weigh(mask=np.r_[True, np.diff(rec['alpha']) != 0])" in text
    left = rec.weigh(mask=np.r_[True, np.diff(rec["alpha"]) != 0]).check()
    assert not any("repeats" in sentence for sentence in left)


def test_what_is_no_clock_is_not_called_one():
    rng = np.random.default_rng(2)
    fresh = np.sin(2 * T) + 0.05 * rng.normal(size=401)
    lost = fresh[np.maximum.accumulate(np.where(rng.random(401) > 0.3, np.arange(401), 0))]
    clock = repeated(12.3)
    for rec in (record(fresh), record(np.round(fresh, 1)), record(lost), record(2 * clock, clock)):
        assert not any("its own clock" in text for text in rec.check())


def test_an_input_that_rests_after_a_manoeuvre_is_not_called_stale():
    u = np.where(T < 4, np.sin(T) * np.sin(np.pi * T / 4) + 1e-3 * np.sin(40 * T), 0.2)
    u[-30:] = u[-30:] + 0.1 * np.sin(T[:30])
    y = np.sin(2 * T) + 0.05 * np.random.default_rng(1).normal(size=401)
    assert not any("stale" in text for text in record(y, u).check())
