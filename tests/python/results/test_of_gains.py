"""The misfit of a fit to gains whose variances are estimates, beside draws of it."""

import modfun as mf
import numpy as np
import pytest
from modfun.results.of_gains import scattered
from scipy.special import chdtrc, fdtrc

PLANT = mf.tf([5], [1, 3, 8])


def drawn(rng, outputs, inputs, freedom, gains, count):
    """Misfits 2 Σ r*Ĉ⁻¹r of normal errors whose columns have Ĉ, a mean of `freedom` outer products."""

    def normal(*shape):
        return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2)

    noise = normal(count, gains, outputs, freedom)
    cov = noise @ noise.conj().swapaxes(-1, -2) / freedom
    errors = normal(count, gains, outputs, inputs)
    return 2 * np.einsum("ckoi,ckoi->c", errors.conj(), np.linalg.solve(cov, errors)).real


@pytest.mark.parametrize(("outputs", "inputs", "freedom"), [(1, 1, 5), (1, 1, 11), (1, 2, 7), (2, 1, 9)])
def test_the_law_of_the_misfit_is_that_of_draws(outputs, inputs, freedom):
    """Share of right ones rejected at 1 % of 20,000: within 0.6 to 1.4 %, where chi-square rejects more.

    The standard error is 0.07 %; what is left is that the law has two moments of the sum only.
    """
    gains = 16
    data = mf.FrequencyResponse(
        np.arange(1.0, gains + 1), np.ones((outputs, inputs, gains), complex), degrees=np.full(gains, freedom)
    )
    df = 2.0 * outputs * inputs * gains
    mean, free = scattered(data, df)
    found = drawn(np.random.default_rng(1), outputs, inputs, freedom, gains, 20_000)
    assert np.mean(found) == pytest.approx(mean, rel=0.01)
    share = np.mean(fdtrc(df, free, found / mean * free / (free - 2)) < 0.01)
    assert 0.006 < share < 0.014
    assert np.mean(chdtrc(df, found) < 0.01) > 2 * share


def test_certain_variances_have_chi_square():
    omega = np.arange(1.0, 9.0)
    for degrees in (None, np.full(8, np.inf)):
        gains = PLANT(1j * omega) * (1 + 0.01j)
        data = mf.FrequencyResponse(omega, gains, bse=0.02 * np.abs(gains), degrees=degrees)
        fit = mf.fit(data, mf.TransferFunction(poles=2, zeros=0))
        assert fit.misfit_p == pytest.approx(chdtrc(fit.df_resid, fit.chi2), rel=1e-9)


def test_a_wrong_model_of_gains_is_found_and_right_ones_rarely():
    """At most 5 of 60 right ones at 1 %: more come once in 10,000 at the measured 1.4 %."""
    wrong = right = 0
    omega = np.arange(0.5, 12.1, 0.5)
    for seed in range(60):
        rng = np.random.default_rng(seed)
        u = rng.standard_normal(1025)
        y = PLANT.simulate(u=u, dt=0.05, intersample="zoh").ravel()
        rec = mf.Record(y=y + 0.1 * y.std() * rng.standard_normal(1025), u=u, dt=0.05, intersample="zoh")
        gains = mf.frf(rec, omega=omega)
        right += "The misfit is" in mf.fit(gains, mf.TransferFunction(poles=2, zeros=0)).check()
        if seed < 5:
            wrong += "The misfit is" in mf.fit(gains, mf.TransferFunction(poles=1, zeros=0)).check()
    assert wrong == 5
    assert right <= 5
