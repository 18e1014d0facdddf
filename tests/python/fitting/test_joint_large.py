"""Joint fits of many unknowns: a batch takes them one by one, and a single fit ends at a minimum."""

import modfun as mf
import numpy as np
import pytest

N, DT = 300, 0.1
MODEL = mf.TransferFunction(poles=3, zeros=2, denominator="separate")


def record(seed: int) -> mf.Record:
    """Two outputs of three poles each, correlated noise of 2 %."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], (2, N // 5 + 1)), 5, axis=1)[:, : N + 1]
    rows = []
    for den, nums in [([1, 2, 5, 3], ([1, 1, 3], [2, 0, 4])), ([1, 3, 8, 5], ([0, 2, 5], [1, 4, 2]))]:
        parts = [
            mf.tf(num, den).simulate(u=own, dt=DT, intersample="zoh")
            for num, own in zip(nums, u, strict=True)
        ]
        rows.append(np.sum(parts, axis=0).ravel())
    y = np.array(rows)
    noise = np.array([[1.0, 0.0], [0.6, 0.8]]) @ rng.standard_normal(y.shape)
    return mf.Record(y=y + 0.02 * y.std() * noise, u=u, dt=DT, intersample="zoh")


def test_a_batch_of_large_problems_is_made_of_single_fits():
    records = [record(seed) for seed in range(3)]
    many = mf.fit_many(records, MODEL, harmonics=32, threads=2)
    for k, rec in enumerate(records):
        fit = mf.fit(rec, MODEL, harmonics=32)
        assert many.status[k] == fit.status == "ok"
        # A batch has the units of its first record: rounding differs.
        assert (np.abs(many.params[k] - fit.params) < 1e-6 * fit.bse).all()
        np.testing.assert_allclose(many.bse[k], fit.bse, rtol=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_no_neighbour_has_a_smaller_covariance_of_the_noise(seed):
    """Held elsewhere, each coefficient leaves residuals of a larger log det Σ̂."""
    rec = record(seed)
    best = mf.fit(rec, MODEL, harmonics=32)
    lowest = np.linalg.slogdet(best.noise_cov * best.df_resid)[1]
    for name, value, error in zip(best.param_names[::5], best.params[::5], best.bse[::5], strict=True):
        for side in (-1.0, 1.0):
            held = mf.TransferFunction(
                poles=3, zeros=2, denominator="separate", params={name: value + side * error}
            )
            fit = mf.fit(rec, held, harmonics=32)
            assert np.linalg.slogdet(fit.noise_cov * fit.df_resid)[1] > lowest
