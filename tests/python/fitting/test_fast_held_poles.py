"""Poles as fast as the sampling under held inputs: what sampling folds is taken out until estimates stand."""

import modfun as mf
import numpy as np
import pytest
from scipy.signal import chirp, cont2discrete, lfilter

DT = 1e-4
# A loudspeaker: 6 ohm, 0.5 mH and a mass on a spring, poles at -328 +- 321j and -11,410 rad/s.
MASS, DAMPING, SPRING, OHM, HENRY, FORCE = 0.015, 1.2, 3000.0, 6.0, 0.5e-3, 7.0
LEAD = HENRY * MASS
NUM = np.array([MASS, DAMPING, SPRING]) / LEAD
DEN = np.polyadd(np.polymul([HENRY, OHM], [MASS, DAMPING, SPRING]), [0, 0, FORCE**2, 0]) / LEAD
TRUTH = np.r_[DEN[1:], NUM]


def current() -> tuple[np.ndarray, np.ndarray]:
    """Held voltage and current at the samples, exact."""
    t = np.arange(8000) * DT
    u = 4 * chirp(t, 10, t[-1], 1500, method="logarithmic", phi=-90)
    num, den, _ = cont2discrete((NUM, DEN), DT)
    return u, lfilter(num[0], den, u)


@pytest.mark.parametrize("outputs", [1, 2])
def test_estimates_of_noise_free_records_stand(outputs: int) -> None:
    """Two rounds left them 1e-3 off: 4 standard errors at 0.5 % noise. Two outputs are a joint fit."""
    u, y = current()
    y = y + 1e-6 * y.std() * np.random.default_rng(0).standard_normal((outputs, y.size))
    rec = mf.Record(y=y, u=u, dt=DT, intersample="zoh")
    fit = mf.fit(rec, mf.TransferFunction(poles=3, zeros=2, denominator="common"), band=(0, 5000))
    assert fit.params[:3] == pytest.approx(TRUTH[:3], rel=1e-5)


def test_batches_are_as_single_fits() -> None:
    u, y = current()
    model = mf.TransferFunction(poles=3, zeros=2)
    records = [
        mf.Record(
            y=y + 0.003 * y.std() * np.random.default_rng(seed).standard_normal(y.size),
            u=u, dt=DT, intersample="zoh",
        )
        for seed in range(9)
    ]  # fmt: skip
    many = mf.fit_many(records, model, band=(0, 5000))
    errors = (many.params - TRUTH) / many.bse
    assert np.sqrt(np.mean(errors**2, axis=0)) == pytest.approx(np.ones(6), abs=0.8)
    for own, rec in zip(many.params, records, strict=True):
        assert own == pytest.approx(mf.fit(rec, model, band=(0, 5000)).params, rel=1e-5)
