"""Records of a batch that are unlike the others are named, and told apart from those that are noisy."""

import modfun as mf
import numpy as np
import pytest

TRUE = mf.tf([76.8], [1, 1.28, 64])
MODEL = mf.TransferFunction(poles=2, zeros=0)
CLEAN = mf.simulate(TRUE, input="sin(2*pi*(0.3*t+0.1687*t**2))", duration=8.0, intervals=400)
RMS = float(np.sqrt(np.mean(CLEAN.y**2)))


def batch(seed, records=40):
    noise = 0.1 * RMS * np.random.default_rng(seed).standard_normal((records, 401))
    return CLEAN["y"] + noise


def fitted(y, model=MODEL, u=CLEAN["u"]):
    return mf.fit_many(mf.Batch(y=y, u=u, dt=0.02), model, progress=False)


DAMAGE = {
    "stuck": lambda y: np.where(np.arange(401) < 150, y, y[150]),
    "out of step": lambda y: np.roll(y, 12),
    "gain": lambda y: y * np.where(np.arange(401) < 200, 1.0, 2.0),
    "spike": lambda y: y + 60 * RMS * (np.arange(401) == 100),
}


@pytest.mark.parametrize("kind", DAMAGE)
def test_a_damaged_record_is_named(kind):
    y = batch(0)
    y[17] = DAMAGE[kind](y[17])
    many = fitted(y)
    assert np.flatnonzero(many.odd).tolist() == [17]
    text = str(many)
    assert "1 of 40 records leaves at least" in text
    assert "times what the others leave: record 17." in text
    assert "mf.fit(data[17], model)" in text
    assert "params[~odd]" in text
    assert any("; record 17: " in one for one in many.doubts)  # what its own fit says of it
    assert "record 17" in many.table().title


def test_a_dead_sensor_has_a_gain_unlike_the_others():
    y = batch(1)
    y[3] = 0.1 * RMS * np.random.default_rng(9).standard_normal(401)
    many = fitted(y)
    assert np.flatnonzero(many.odd).tolist() == [3]
    assert "b0 is far from that of the others in record 3: " in str(many)
    np.testing.assert_allclose(many.params[~many.odd].mean(axis=0), [1.28, 64, 76.8], rtol=0.02)


def test_of_two_outputs_whose_covariance_is_fitted():
    y = np.stack([batch(2, 12), batch(3, 12)], axis=1)
    y[5, 0] = np.roll(y[5, 0], 12)
    many = fitted(y, mf.TransferFunction(poles=2, zeros=0, denominator="common"))
    assert np.ptp(many.cost) < 1e-9
    assert np.flatnonzero(many.odd).tolist() == [5]
    assert "1 of 12 records has standard errors of at least" in str(many)


def test_one_by_one():
    y = batch(4, 6)
    y[4] = np.roll(y[4], 12)
    records = [mf.Record(y=own, u=CLEAN["u"], dt=0.02, sigma=0.1 * RMS * np.ones((1, 401))) for own in y]
    many = mf.fit_many(records, MODEL, progress=False)
    assert np.flatnonzero(many.odd).tolist() == [4]
    assert any("; record 4: " in one for one in many.doubts)


@pytest.mark.parametrize("spread", [0.0, 0.5])
def test_records_of_like_or_unlike_noise_are_not_odd(spread):
    """24 batches, 960 records; levels of noise that differ by a factor of 8 within a batch, too."""
    for seed in range(24):
        rng = np.random.default_rng(seed)
        level = 0.1 * RMS * np.exp(spread * rng.standard_normal((40, 1)))
        many = fitted(CLEAN["y"] + level * rng.standard_normal((40, 401)))
        assert not many.odd.any(), (seed, many._odd.texts)


def test_three_records_are_too_few_to_tell():
    y = batch(5, 3)
    y[1] = np.roll(y[1], 12)
    many = fitted(y)
    assert not many.odd.any()
    assert not many._odd.texts
