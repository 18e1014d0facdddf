"""The Cramér–Rao bound against finite differences, published values and known figures."""

import json

import modfun as mf
import numpy as np
import pytest
from modfun.experiments.sensitivities import Sensitivities
from modfun.systems.polynomials import time_unit
from modfun.systems.propagate import Inputs
from places import measured

EQ24 = mf.tf([5], [1, 3, 8])
CHIRP = {"input": "sin(t**2/5)", "duration": 10.0, "intervals": 256}


@pytest.mark.parametrize(
    ("num", "den", "kinds", "delays"),
    [
        ([[5]], [1, 3, 8], ["smooth"], [0.0]),
        ([[1, 2, 3]], [1, 3, 8], ["smooth"], [0.0]),
        ([[1, 2], [4]], [1, 2, 3, 4], ["zoh", "foh"], [0.07, 0.0]),
        ([[-6400, 1600], None], [1, 5, 408, 416, 1600], ["zoh", "zoh"], [0.0, 0.0]),
    ],
)
def test_derivatives_equal_high_order_differences(num, den, kinds, delays):
    system = mf.tf(num, den, delay=delays)
    structure = mf.TransferFunction.from_system(system)
    theta = structure.theta(system)
    layout = structure.plain_layout(tuple(f"u{k}" for k in range(len(kinds))), "test")
    n = layout.orders[0]
    rng = np.random.default_rng(5)
    u = rng.standard_normal((len(kinds), 301))
    u[0] = np.sin(np.linspace(0, 9, 301))
    prepared = Inputs(list(u), 0.02, 300, kinds, delays)
    engine = Sensitivities(n, layout.numerators[0], prepared, time_unit(np.concatenate([[1], theta[:n]])))
    transient = rng.standard_normal(n)
    jacobian = engine.run(theta * engine.scale, transient)[1]
    point = np.concatenate([theta * engine.scale, transient])
    for k in range(point.size):
        h = 1e-3 * (abs(point[k]) or 1.0)
        parts = []
        for step in (-2, -1, 1, 2):
            moved = point.copy()
            moved[k] += step * h
            parts.append(engine.run(moved[: theta.size], moved[theta.size :])[0])
        slope = (parts[0] - 8 * parts[1] + 8 * parts[2] - parts[3]) / (12 * h)
        np.testing.assert_allclose(jacobian[k], slope, atol=2e-8 * max(1.0, np.max(np.abs(slope))))
    rest = engine.run(theta * engine.scale)[0]
    np.testing.assert_allclose(
        rest, system.simulate(u=u, dt=0.02, intersample=kinds), atol=1e-10 * max(1.0, np.abs(rest).max())
    )


@pytest.mark.parametrize(("nsr", "percent"), [(0.2, 3.29), (0.6, 9.88)])
def test_the_example_of_the_report(nsr, percent):
    rec = mf.simulate(EQ24, **CHIRP)
    assert mf.crlb(EQ24, rec, nsr=nsr).relative == pytest.approx(percent, abs=0.005)


def test_noise_given_absolutely_and_trends():
    rec = mf.simulate(EQ24, **CHIRP)
    bound = mf.crlb(EQ24, rec, nsr=0.2)
    again = mf.crlb(EQ24, rec, sigma=0.2 * float(np.sqrt(np.mean(rec.y**2))))
    np.testing.assert_allclose(again.cov, bound.cov, rtol=1e-6)
    known = mf.crlb(EQ24, rec, nsr=0.2, initial_state="zero")
    offset = mf.crlb(EQ24, rec, nsr=0.2, trend="constant")
    drift = mf.crlb(EQ24, rec, nsr=0.2, trend="linear")
    assert np.all(known.sd < bound.sd)
    assert np.all(bound.sd < offset.sd)
    assert np.all(offset.sd < drift.sd)
    wider = mf.crlb(EQ24, rec, nsr=0.2, model=mf.TransferFunction(poles=2, zeros=1))
    assert wider.param_names == ("a1", "a2", "b0", "b1")
    assert wider["a1"] > bound["a1"]
    assert "b0" in repr(bound)
    assert bound.to_table()["bound"][0] == pytest.approx(bound["a1"])


def test_the_bound_is_reached_by_linear_least_squares_when_only_gains_are_unknown():
    # y' + y = b u with known a: the variance of b is sigma^2 / sum of the squared response.
    rec = mf.simulate(mf.tf([2], [1, 1]), **CHIRP)
    bound = mf.crlb(mf.tf([2], [1, 1]), rec, sigma=0.1, initial_state="zero")
    precision = np.linalg.inv(bound.cov)
    assert precision[1, 1] == pytest.approx(np.sum((rec.y / 2) ** 2) / 0.01, rel=1e-6)


def test_rao_garnier():
    given = json.loads(measured("rao_garnier/definition.json").read_text())
    register, bits = [1] * 10, []
    for _ in range(1023):
        bits.append(1.0 if register[-1] else -1.0)
        register = [register[9] ^ register[6], *register[:-1]]
    u = np.repeat(bits, 7)
    system = mf.tf(given["B"], given["F"])
    y = system.simulate(u=u, dt=given["Ts"], intersample="zoh")
    assert np.std(y) / np.sqrt(10) == pytest.approx(given["sigma_snr10"], rel=1e-8)
    rec = mf.Record(y=y, u=u, dt=given["Ts"], intersample="zoh")
    bound = mf.crlb(system, rec, sigma=given["sigma_snr10"], initial_state="zero")
    for name, value in given["crlb_snr10"].items():
        # Their derivatives are numerical; ours equal fourth-order differences to 2e-8 (above).
        assert bound[name] == pytest.approx(value, rel=5e-3)


@pytest.mark.parametrize("top", [3.0, 8.0])
def test_whole_periods_by_their_spectra(top):
    """The response and its derivatives as sums of sines; the last sample repeats the first."""
    period, n = 10.0, 128
    one = mf.signals.multisine("u", band=(2 * np.pi / period, top), duration=period, dt=period / n, seed=1)
    rec = mf.Record(y=np.zeros(n + 1), u=one.u[0], dt=period / n, intersample="smooth")
    s = 2j * np.pi / period * np.arange(n // 2 + 1)
    gains = 5 / (s**2 + 3 * s + 8)
    slopes = np.array([-gains * s, -gains, np.ones_like(s)]) / (s**2 + 3 * s + 8)
    rows = np.fft.irfft(slopes * np.fft.rfft(one.u[0, :n]), n)
    rows = np.hstack([rows, rows[:, :1]])
    expected = np.sqrt(np.diag(np.linalg.inv(rows @ rows.T))) * 0.1
    bound = mf.crlb(mf.tf([5], [1, 3, 8]), rec, sigma=0.1, initial_state="periodic")
    assert bound.sd == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({}, "nsr= .*or sigma="),
        ({"nsr": 0.1, "sigma": 0.1}, "once"),
        ({"nsr": 0.0}, "above 0"),
        ({"nsr": 0.1, "trend": "cubic"}, "'linear'"),
        ({"nsr": 0.1, "initial_state": "free"}, "unknown, zero, rest, periodic"),
        ({"nsr": 0.1, "model": mf.TransferFunction(poles=1)}, "does not hold"),
    ],
)
def test_mistakes_in_options(options, said):
    with pytest.raises(mf.SpecError, match=said):
        mf.crlb(EQ24, mf.simulate(EQ24, **CHIRP), **options)


def test_mistakes_in_systems_and_records():
    rec = mf.simulate(EQ24, **CHIRP)
    with pytest.raises(mf.SpecError, match="TransferFunction has no numbers; give"):
        mf.crlb(mf.TransferFunction(poles=2), rec, nsr=0.1)
    with pytest.raises(mf.SpecError, match="1 input"):
        mf.crlb(mf.tf([[5], [1]], [1, 3, 8]), rec, nsr=0.1)
    silent = mf.Record(y=rec.y, u=np.zeros(257), dt=rec.dt)
    with pytest.raises(mf.DataError, match="response from rest is zero"):
        mf.crlb(EQ24, silent, nsr=0.1)
    with pytest.raises(mf.DataError, match=r"every input a signal|apart"):
        mf.crlb(EQ24, silent, sigma=0.1)
    t = np.cumsum(np.random.default_rng(0).uniform(0.01, 0.05, 257))
    with pytest.raises(mf.DataError, match="evenly"):
        mf.crlb(EQ24, mf.Record(y=rec.y, u=rec.u, t=t), nsr=0.1)


def test_a_covariance_is_symmetric():
    system = mf.tf([[[1, 2]], [[0.5]]], [1, 1.2, 4])
    rec = mf.simulate(system, input="sin(t**2/6)", duration=20.0, intervals=400)
    with pytest.raises(mf.SpecError, match="not symmetric"):
        mf.crlb(system, rec, sigma=[[1.0, 0.5], [0.0, 1.0]])


def test_a_fit_with_given_noise_has_a_bound():
    """Levels given by `Noise` are known up to the factor that the fit found."""
    rec = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1)
    tf2 = mf.TransferFunction(poles=2, zeros=0)
    fit = mf.fit(rec, tf2, noise=mf.Noise(y=0.3), cov_type="nonrobust")
    bound = mf.crlb(fit)
    assert bound.sigma == pytest.approx(float(np.sqrt(fit.noise_cov[0, 0])))
    assert np.all(np.abs(bound.sd / fit.bse - 1) < 0.1)
    with pytest.raises(mf.SpecError, match="give sigma= or nsr="):
        mf.crlb(mf.fit(rec, tf2, noise="coloured"))
