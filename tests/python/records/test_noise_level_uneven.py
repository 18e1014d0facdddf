"""The noise level of uneven samples: right at random instants, and beside spikes and gaps."""

import modfun as mf
import numpy as np
import pytest

SIZE = 0.03


def record(seed, count=1000, spikes=0):
    """Two sines at random instants, with a gap of a second in the middle."""
    rng = np.random.default_rng(seed)
    t = rng.uniform(0, 20, count - 2)
    t = np.sort(np.r_[0, t[(t < 9.5) | (t > 10.5)], 20])
    y = np.sin(2 * t) + 0.3 * np.cos(5 * t) + SIZE * rng.standard_normal(t.size)
    y[rng.choice(t.size, spikes, replace=False)] += 1.0
    return mf.Record(y=y, t=t)


@pytest.mark.parametrize(("count", "within"), [(1000, 0.18), (300, 0.35)])
def test_the_level_is_right(count, within):
    """Of 50 records each within four and a half standard deviations, 4 and 8 %: one in 3,000 is not."""
    found = np.array([record(seed, count).noise_level()["noise_sd"][0] for seed in range(50)])
    assert np.all(np.abs(found / SIZE - 1) < within)
    assert abs(found.mean() / SIZE - 1) < 0.02


def test_spikes_hardly_count():
    plain, spiked = (record(3, spikes=spikes).noise_level()["noise_sd"][0] for spikes in (0, 5))
    assert plain < spiked < 1.25 * plain


def test_a_long_record_is_looked_at_in_parts():
    rng = np.random.default_rng(1)
    t = np.cumsum(rng.uniform(0.5, 1.5, 300_000)) * 1e-3
    rec = mf.Record(y=np.sin(t) + SIZE * rng.standard_normal(t.size), t=t)
    assert rec.noise_level()["noise_sd"][0] == pytest.approx(SIZE, rel=0.05)
