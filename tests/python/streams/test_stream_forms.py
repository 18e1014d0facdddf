"""How a stream reads inputs that nobody declared: when they move, and anew when they look otherwise."""

import modfun as mf
import numpy as np
import pytest

DT, WINDOW = 0.02, 8.0
TRUTH = mf.tf([2, 20], [1, 2, 20])
EST = mf.Estimator(mf.TransferFunction(poles=2, zeros=1), band=15.0)
SAMPLES = round(WINDOW / DT) + 1


def prbs(rng, count):
    return np.repeat(rng.choice([-1.0, 1.0], count // 25 + 1), 25)[:count]


def held(u, rng, noise=0.05):
    y = np.atleast_2d(TRUTH.simulate(u=u, dt=DT, intersample="zoh"))
    return y + noise * y.std() * rng.standard_normal(y.shape)


def of_the_window(y, u):
    """`fit` of the last samples as a record of their own."""
    return EST(mf.Record(y=y[:, -SAMPLES:], u=u[-SAMPLES:], dt=DT))


def test_a_window_of_rest_decides_nothing():
    """10 s of rest, then a staircase: it was read as smooth for good, b0 9 standard errors off."""
    z = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        u = np.r_[np.zeros(500), prbs(rng, 1501)]
        y = held(u, rng)
        live = mf.Stream(EST, dt=DT, window=WINDOW)
        live.push(y=y[:, :450], u=u[:450])
        assert live.intersample == ("smooth",)
        live.push(y=y[:, 450:], u=u[450:])
        z.append((live.params[2] - 2) / live.bse[2])
        assert live.intersample == ("zoh",)
        assert "zoh (seen)" in repr(live.fit().records[0])
        np.testing.assert_allclose(live.params, of_the_window(y, u).params, rtol=1e-6)
    assert abs(np.mean(z)) < 3 / np.sqrt(8)  # false alarm: 0.3 %


def test_later_samples_that_look_otherwise_decide_anew():
    """A slow sine, then a staircase; count, times and every go on."""
    rng = np.random.default_rng(1)
    u = np.r_[np.sin(0.8 * np.arange(1000) * DT), prbs(rng, 1203)]
    y = held(u, rng)
    live = mf.Stream(EST, dt=DT, window=WINDOW, t0=5.0)
    live.push(y=y[:, :900], u=u[:900])
    assert live.intersample == ("smooth",)
    assert live.status == "ok"
    live.push(y=y[:, 900:2000], u=u[900:2000])
    assert live.fit().intersample == ("zoh",)
    assert live.count == 2000
    assert live.t == pytest.approx(5.0 + 1999 * DT)
    assert live.record().t[-1] == pytest.approx(live.t)
    np.testing.assert_allclose(live.params, of_the_window(y[:, :2000], u[:2000]).params, rtol=1e-6)
    more = mf.Record(y=y[:, 2000:], u=u[2000:], dt=DT)
    track = live.follow(more, every=70)
    np.testing.assert_allclose(track.t, 5.0 + (np.array([2030, 2100, 2170]) - 1) * DT)
    live.clear()
    assert live.count == 0


def test_what_is_declared_stays():
    rng = np.random.default_rng(2)
    u = prbs(rng, 900)
    live = mf.Stream(EST, dt=DT, window=WINDOW, intersample="smooth")
    live.push(y=held(u, rng), u=u)
    assert live.fit().intersample == ("smooth",)
