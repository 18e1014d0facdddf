"""What a fit says where the data cannot answer: a step before the window, a logarithm of negative samples."""

import modfun as mf
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lfilter


def bump(seed=0, noise=0.5):
    """A valve step at 20 s of 300 s; a first-order lag of 42 s, gain 2.4, dead time 9 s."""
    t = np.arange(300.0)
    pole = np.exp(-1 / 42)
    late = np.where(t < 29, 0.0, 10.0)
    y = 71 + 2.4 * lfilter([0, 1 - pole], [1, -pole], late)
    y = y + noise * np.random.default_rng(seed).standard_normal(t.size)
    return mf.Record(
        y=y, u=np.where(t < 20, 40.0, 50.0), dt=1.0, outputs="T", inputs="valve", intersample="zoh"
    )


def delayed(top, low=0.0):
    return mf.TransferFunction(poles=1, zeros=0, delay=mf.Free(min=low, max=top))


@pytest.mark.parametrize("top", [20.0, 40.0])
def test_a_step_before_the_window_is_refused_with_the_longest_delay(top):
    """With max=40 the delay was 36±10 s with status ok, or the status was "rank"."""
    said = f"'valve' moves for the last time at 20 s, and delays of up to {top:g} s .* at most 19 s"
    with pytest.raises(mf.DataError, match=said):
        mf.fit(bump(), delayed(top))
    with pytest.raises(mf.DataError, match=said):
        mf.fit_many([bump(0), bump(1)], delayed(top))
    with pytest.raises(mf.DataError, match=said):
        mf.fit([bump(0), bump(1)], delayed(top))


def test_delays_that_leave_the_step_in_the_window_are_fitted():
    true = [1 / 42, 2.4 / 42, 9.0]
    for model, options in (
        (delayed(19.0), {}),
        (delayed(23.0, low=5.0), {}),  # the shortest delay brings the step in at 25 s
        (delayed(40.0), {"initial_state": "rest"}),
    ):
        fit = mf.fit(bump(noise=0.05), model, **options)
        assert np.all(np.abs(fit.params - true) < 4 * np.maximum(fit.bse, 1e-6)), (model, options)


def test_a_logarithm_of_negative_samples_names_channel_time_and_window():
    """An epidemic seen by the infected alone, eliminated through log(I)."""
    t = np.linspace(0, 80, 400)
    true = [0.5, 0.1]

    def rates(t, x):
        return [-0.5 * x[0] * x[1], 0.5 * x[0] * x[1] - 0.1 * x[1]]

    infected = solve_ivp(rates, (0, 80), [0.99, 0.01], t_eval=t, rtol=1e-9).y[1]
    noise = 0.002 * infected.std() * np.random.default_rng(0).standard_normal(t.size)
    noise[3] = -0.02
    rec = mf.Record(y=infected + noise, t=t, outputs="I")
    model = mf.Equation(["S' = -beta*S*I", "I' = beta*S*I - gamma*I"], outputs="I", hidden="S")
    with pytest.warns(mf.ModfunWarning, match="log\\(I\\) has no value at 1 of 400 samples"):
        fit = mf.fit(rec, model)
    assert f"first at t = {t[3]:.4g} s, where I is {rec['I'][3]:.3g}" in fit.message
    assert f"rec.window({t[4]:.4g}, 77.59)" in fit.message  # above five times the noise
    assert np.isnan(fit.params).all()
    assert "beta=nan" in repr(fit)
    cured = mf.fit(rec.window(t[4], 80), model)
    assert np.all(np.abs(cured.params - true) < 4 * cured.bse)


def test_a_window_too_short_for_a_noise_level_comes_with_one():
    """The window that was advised was refused: 20 of 43 half-days show no noise level."""
    t = np.linspace(0, 21, 43)

    def rates(t, x):
        return [-1.7 * x[0] * x[1] / 763, 1.7 * x[0] * x[1] / 763 - 0.45 * x[1]]

    infected = solve_ivp(rates, (0, 21), [760.0, 3.0], t_eval=t, rtol=1e-9).y[1]
    rec = mf.Record(y=infected + 10 * np.random.default_rng(0).standard_normal(t.size), t=t, outputs="I")
    model = mf.Equation(["S' = -beta*S*I/763", "I' = beta*S*I/763 - gamma*I"], outputs="I", hidden="S")
    with pytest.warns(mf.ModfunWarning, match=r"rec\.window\(2\.5, 12\), and give its noise"):
        fit = mf.fit(rec, model, noise="equation")  # which no response can follow
    level = float(fit.message.split("mf.Noise(y=")[1].split(")")[0])
    assert level == pytest.approx(10.0, rel=0.4)
    cured = mf.fit(rec.window(2.5, 12), model, noise=mf.Noise(y=level))
    for own in (cured, mf.fit(rec, model)):
        assert np.all(np.abs(own.params - [1.7, 0.45]) < 3 * own.bse)
