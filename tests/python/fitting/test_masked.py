"""Masked samples: how much they cost beside the bound of the samples that are left."""

import warnings

import modfun as mf
import numpy as np
import pytest

pytestmark = pytest.mark.statistics
NAMES = ("a1", "a2", "b0", "b1")

N, DT, SD = 512, 0.05, 0.01
T = np.arange(N + 1) * DT
A1, A2 = 1.2, 8.0
INPUT = "sin(t**2/8)"
TF = mf.TransferFunction(poles=2, zeros=[[0], [1]], denominator="common")
TRUTH = np.array([A1, A2, 5.0, 0.7, 2.0])


def responses(theta):
    a1, a2, *b = theta
    systems = [mf.tf([b[0]], [1, a1, a2]), mf.tf(b[1:], [1, a1, a2])]
    runs = [mf.simulate(s, input=INPUT, duration=N * DT, intervals=N) for s in systems]
    return np.array([run.y[0] for run in runs]), runs[0].u


CLEAN, U = responses(TRUTH)
SIGMA = SD * CLEAN.std(axis=1)


def bound(covariance, mask):
    """Least standard deviations of the parameters, both initial states unknown."""
    columns = []
    for k, value in enumerate(TRUTH):
        step = np.zeros(5)
        step[k] = 1e-4 * value
        columns.append((responses(TRUTH + step)[0] - responses(TRUTH - step)[0]) / (2 * step[k]))
    pole = np.roots([1, A1, A2])[0]
    for i in range(2):
        for free in (np.exp(pole * T).real, np.exp(pole * T).imag):
            columns.append(np.where(np.arange(2)[:, None] == i, free, 0.0))
    slopes = np.array(columns)
    information = np.zeros((len(columns), len(columns)))
    for k in range(N + 1):
        if (seen := mask[:, k]).any():
            own = slopes[:, seen, k]
            information += own @ np.linalg.solve(covariance[np.ix_(seen, seen)], own.T)
    return np.sqrt(np.diag(np.linalg.inv(information))[:5])


def errors(covariance, mask, count=100):
    """Errors of `count` fits, and their median standard errors."""
    root, found, se = np.linalg.cholesky(covariance), [], []
    for seed in range(count):
        noise = root @ np.random.default_rng(seed).standard_normal(CLEAN.shape)
        y = np.where(mask, CLEAN + noise, 3.0)
        fit = mf.fit(mf.Record(y=y, u=U, dt=DT, mask=mask, intersample="smooth"), TF)
        found.append(fit.params - TRUTH)
        se.append(fit.bse)
    return np.array(found), np.median(se, axis=0)


def masks(kind):
    mask = np.ones((2, N + 1), bool)
    if kind == "scattered":
        mask[0, np.random.default_rng(7).choice(N + 1, 30, replace=False)] = False
    elif kind == "bursts":
        for start in range(20, N, 100):
            mask[0, start : start + 6] = False
    else:
        mask[0, 200:230] = False
        mask[1, 200:230] = kind == "one"
    return mask


@pytest.mark.parametrize("kind", ["scattered", "bursts", "one", "both"])
def test_gaps_cost_what_they_hide(kind):
    """100 records: the rms of a standard deviation has an error of 7 %; 1.35 is five of these above 1.0.

    Errors of the bridge of a gap taken for independent made them 1.6 to 3 times the bound.
    """
    covariance, mask = np.diag(SIGMA**2), masks(kind)
    least = bound(covariance, mask)
    found, se = errors(covariance, mask)
    assert (np.sqrt(np.mean(found**2, axis=0)) < 1.35 * least).all()
    assert (np.abs(se / least - 1) < 0.15).all()


@pytest.mark.parametrize("kind", ["scattered", "bursts", "one", "both"])
def test_outputs_share_noise_in_the_samples_both_have(kind):
    """As above with noise correlated to 0.9: errors were 1.3 to 2.7 times the bound, one Σ for all lines."""
    root, mask = np.linalg.cholesky([[1, 0.9], [0.9, 1]]), masks(kind)
    covariance = np.diag(SIGMA) @ root @ root.T @ np.diag(SIGMA)
    least = bound(covariance, mask)
    found, se = errors(covariance, mask)
    assert (np.sqrt(np.mean(found**2, axis=0)) < 1.35 * least).all()
    assert (np.abs(se / least - 1) < 0.15).all()


@pytest.mark.parametrize("late", [False, True])
def test_gaps_in_which_much_happens_are_crossed(late):
    """45 samples hidden where the response answers a pulse, or held commands change.

    Of 30 fits 13 did not settle, or 14 of 100 ended 6 standard errors off. The mean square of scores is 1.44
    at most in runs of 100; the limit allows for 30 records (once in 1,000, four scores counted as two).
    """
    t = 0.02 * np.arange(601)
    plant = mf.tf([-4, -3], [1, 1.8, 5])
    if late:
        u = np.interp(t + 1e-9, [0, 1, 2.5, 3.5, 4, 4.5, 12], range(7)) // 1
        u = np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0, 0.0])[u.astype(int)]
    else:
        u = 2 * np.sin(1.7 * t) * np.exp(-((t - 3) ** 2))
    word = "zoh" if late else "smooth"
    y = plant.simulate(u=u, dt=0.02, intersample=word, initial_state=[0.1, 0.1]).ravel()
    mask = np.ones(601, bool)
    mask[200:245] = False
    linear = mf.Equation("y'' + a1*y' + a2*y = b0*u' + b1*u")
    for structure in [mf.TransferFunction(poles=2, zeros=1)] + ([] if late else [linear]):
        scores = []
        for seed in range(30):
            noise = 0.05 * y.std() * np.random.default_rng(seed).standard_normal(601)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", mf.ModfunWarning)
                fit = mf.fit(mf.Record(y=y + noise, u=u, dt=0.02, mask=mask, intersample=word), structure)
            assert fit.success, seed
            scores.append([(fit[k] - v) / fit.bse[k] for k, v in zip(NAMES, (1.8, 5, -4, -3), strict=True)])
        assert np.mean(np.square(scores)) < 1.9
