"""Noise beside uneven samples: a wrong equation is objected to, a right one is not."""

import warnings

import modfun as mf
import numpy as np
import pytest
from modfun.results.sample_levels import slow_beside
from scipy.integrate import solve_ivp
from scipy.signal import butter, sosfiltfilt

WRONG = mf.Equation("y'' + d*y' + k*y = b*u")
RIGHT = mf.Equation("y'' + d*y' + k*y + c*y**3 = b*u")


def drive(t):
    return 2 * np.sin(1.1 * t) + 1.5 * np.sin(2.3 * t + 1)


def duffing(seed, *, filtered=False):
    """A Duffing oscillator at 201 uneven instants of 20 s, with noise of 2.5 %."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(np.r_[0, rng.uniform(0.05, 0.15, 200)])
    found = solve_ivp(
        lambda s, x: [x[1], drive(s) - 0.3 * x[1] - x[0] - 0.5 * x[0] ** 3],
        (0, t[-1]), [0.2, 0.0], t_eval=t, rtol=1e-8, atol=1e-10,
    )  # fmt: skip
    noise = rng.standard_normal(t.size)
    if filtered:  # to a fifth of half the rate
        noise = sosfiltfilt(butter(4, 0.2, output="sos"), noise)
        noise /= noise.std()
    return mf.Record(y=found.y[0] + 0.03 * noise, u=drive(t), t=t)


def said(rec, model):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        fit = mf.fit(rec, model)
    return fit, [str(one.message) for one in caught]


def test_equation_that_lacks_a_cube_is_warned_of():
    # In ten seeds, ten were warned of; before there was a level, none.
    for seed in range(3):
        fit, found = said(duffing(seed), WRONG)
        assert len(found) == 1
        assert "y**3" in found[0]
        assert "beside neighbouring samples" in found[0]
        assert fit.chi2 > 30 * fit.df_resid


def test_right_equation_is_not():
    # Of 63 right fits of nine plants, 17 to 400 samples, two of 17 samples were warned of, as before.
    for seed in range(4):
        fit, found = said(duffing(seed), RIGHT)
        assert not found
        assert fit.chi2 < 4 * fit.df_resid
        assert not slow_beside(fit)


def test_filtered_noise_does_not_warn():
    for seed in range(3):
        _, found = said(duffing(seed, filtered=True), RIGHT)
        assert not found


def test_summary_compares_with_the_samples():
    rec = duffing(2)
    fit, _ = said(rec, WRONG)
    text = str(fit.summary())
    level = rec.noise_level()["noise_sd"][0]
    assert f"seen beside neighbouring samples {level:.4g}" in text
    assert "times what was expected" not in text
    assert "nothing wrong" not in text


@pytest.mark.parametrize("poles", [1, 2])
def test_transfer_function_with_a_pole_too_few(poles):
    rng = np.random.default_rng(5)
    t = np.cumsum(np.r_[0, rng.uniform(0.05, 0.15, 200)])
    found = solve_ivp(
        lambda s, x: [x[1], 4 * drive(s) - 0.6 * x[1] - 4 * x[0]],
        (0, t[-1]), [0.3, 0.0], t_eval=t, rtol=1e-8, atol=1e-10,
    )  # fmt: skip
    y = found.y[0] + 0.03 * found.y[0].std() * rng.standard_normal(t.size)
    _, told = said(mf.Record(y=y, u=drive(t), t=t), mf.TransferFunction(poles=poles, zeros=0))
    assert bool(told) == (poles == 1)
    assert "First try one more pole" in "".join(told) or poles == 2


def test_too_few_samples_show_no_level():
    rng = np.random.default_rng(0)
    t = np.sort(rng.uniform(0, 10, 12))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit = mf.fit(mf.Record(y=np.exp(-t / 3), t=t - t[0]), mf.Equation("y' + a*y = 0"))
    assert np.isnan(fit.chi2)
