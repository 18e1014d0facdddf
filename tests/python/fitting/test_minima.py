"""Fits of random systems end in the right minimum: two to four poles, time constants over two decades."""

import modfun as mf
import numpy as np
import pytest
from scipy.signal import cont2discrete, dlsim, tf2ss

FINE = 20  # steps a sample in which smooth inputs are simulated


def factors(rng, degree, damping):
    """A polynomial of modes and lags with frequencies of 0.1 to 10 rad/s."""
    out = np.ones(1)
    while (left := degree + 1 - out.size) > 0:
        w = 10 ** rng.uniform(-1, 1)
        mode = left > 1 and rng.random() < 0.6
        out = np.polymul(out, [1, 2 * rng.uniform(damping, 1) * w, w * w] if mode else [1, w])
    return out


def steps(rng, t, *_):
    hold = int(rng.integers(1, 8)) * FINE
    return np.repeat(rng.choice([-1.0, 1.0], t.size // hold + 1), hold)[: t.size]


def chirp(_, t, low, top):
    return np.sin(low * t + (top - low) * t**2 / (2 * t[-1]))


def multisine(rng, t, low, top):
    return np.sin(np.outer(t, np.geomspace(low, top, 12)) + rng.uniform(0, 2 * np.pi, 12)).sum(axis=1)


def trial(seed):
    """A record of a random system in 5 to 20 % noise, the structure, and the true parameters."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 5))
    m = int(rng.integers(0, n))
    den, num = factors(rng, n, 0.05), factors(rng, m, 0.3)
    num *= den[-1] / num[-1]
    w = np.abs(np.roots(den))
    dt = 2 * np.pi / w.max() / rng.uniform(8, 30)
    t = np.arange(int(rng.integers(200, 1001)) * FINE + 1) * dt / FINE
    draw = [steps, chirp, multisine][int(rng.integers(3))]
    u = draw(rng, t, max(2 * np.pi / t[-1], 0.3 * w.min()), rng.uniform(0.7, 2) * w.max())
    how = "zoh" if draw is steps else "foh"
    a, b, c, d, _ = cont2discrete(tf2ss(num, den), dt / FINE, how)
    y = dlsim((a, b, c, d, dt / FINE), u)[1][::FINE, 0]
    y += rng.uniform(0.05, 0.2) * y.std() * rng.standard_normal(y.size)
    between = {"intersample": "zoh"} if draw is steps else {}
    return mf.Record(y=y, u=u[::FINE], dt=dt, **between), (n, m), np.r_[den[1:], num]


def errors(fit, truth):
    """How many standard errors the estimates are off."""
    return np.abs(np.asarray(fit.params) - truth) / np.asarray(fit.bse)


def from_truth(rec, fit, truth):
    """The core's fit on the lines of another, started at the truth."""
    n, m = fit.structure.poles, fit.structure.zeros
    options = {"order": n, "numerators": [m], "delays": [0.0], "intersample": [rec.intersample]}
    options |= {"method": "ml", "noise": "output", "initial_state": "unknown", "states": [], "trend": None}
    options |= {"rule": "gregory", "extended": True, "band": fit.band, "harmonics": None}
    fitter = mf._core.Fitter([rec.y.size], [rec.dt], **options, tol=1e-9, maxiter=50)
    data = [np.ascontiguousarray(rec.y)], [np.ascontiguousarray(rec.u)]
    return fitter.fit(*data, starts=[truth.tolist()])


def is_false(fit, led, truth):
    """Whether a fit settled far from the truth, well above a minimum near it of a stable system."""
    right = led["status"] == "ok" and np.roots(np.r_[1, led["theta"][: fit.structure.poles]]).real.max() < 0
    return right and fit.status == "ok" and fit.cost > 1.005 * led["cost"] and errors(fit, truth).max() > 6


@pytest.mark.filterwarnings("ignore::modfun.ModfunWarning")
@pytest.mark.parametrize("seed", [455, 640, 781, 951])
def test_a_fit_ends_at_the_lower_of_two_minima(seed):
    """From `wls` and from few lines alone these ended 6 and more standard errors from the truth."""
    rec, (poles, zeros), truth = trial(seed)
    fit = mf.fit(rec, mf.TransferFunction(poles=poles, zeros=zeros))
    assert fit.status == "ok"
    assert errors(fit, truth).max() < 5


@pytest.mark.filterwarnings("ignore::modfun.ModfunWarning")
def test_few_random_systems_end_in_another_minimum():
    """Two of these 150 did; of 1,200 seven, and now one."""
    wrong = []
    for seed in range(150):
        rec, (poles, zeros), truth = trial(seed)
        fit = mf.fit(rec, mf.TransferFunction(poles=poles, zeros=zeros))
        if is_false(fit, from_truth(rec, fit, truth), truth):
            wrong.append(seed)
    assert wrong in ([], [147])
