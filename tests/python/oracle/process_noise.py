"""Records of systems that noise drives, and their exact likelihood: the oracle of noise="process".

    dx = (A x + B u) dt + G dw,   y_k = C x(t_k) + D u_k + e_k,   E dw dwᵀ = Q dt,   E e² = σ²,

with the transfer function C (sI - A)⁻¹ G = 1/A(s): white noise of power spectral density Q (two-sided, an
interval of frequency in Hz) stands on the right of A(p) y = B(p) u + w.  Sampled exactly (C. F. Van Loan,
IEEE Trans. Automatic Control 23, 1978), filtered by Kalman's recursion from an initial state of which nothing
is known (P. de Jong, Biometrika 75, 1988): the filter starts from the state 0 for certain, and runs over the
output less the response from rest and over the free response of each state, whose innovations are regressed.
"""

import numpy as np
from scipy.linalg import expm, solve_continuous_lyapunov

from .systems import simulate, state_space


def sampled(den, dt, drive=(1.0,)):
    """Transition matrix and covariance of a sample's noise of unit density, for C/A in observer form."""
    n = len(den) - 1
    a, g = state_space(den, [list(drive)])[:2]
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[:n, n:], block[n:, n:] = -a * dt, g @ g.T * dt, a.T * dt
    whole = expm(block)
    transition = whole[n:, n:].T
    cov = transition @ whole[:n, n:]
    return transition, (cov + cov.T) / 2


def spread(den):
    """Standard deviation of a stable output that noise of unit density has driven for long."""
    n = len(den) - 1
    a = state_space(den, [[1.0]])[0]
    g = np.zeros((n, 1))
    g[-1] = 1.0
    return float(np.sqrt(solve_continuous_lyapunov(a, -g @ g.T)[0, 0]))


def drawn(den, density, dt, intervals, random, rest=False, drive=(1.0,)):
    """Output that the noise drives, from its stationary distribution, or from rest: (N+1,)."""
    transition, cov = sampled(den, dt, drive)
    n = len(den) - 1
    a, g = state_space(den, [list(drive)])[:2]
    root = np.linalg.cholesky(cov * density + 1e-300 * np.eye(n))
    x = np.zeros(n)
    if not rest:
        start = np.linalg.cholesky(solve_continuous_lyapunov(a, -density * g @ g.T))
        x = start @ random.standard_normal(n)
    steps = random.standard_normal((intervals, n)) @ root.T
    out = np.empty(intervals + 1)
    for k in range(intervals):
        out[k] = x[0]
        x = transition @ x + steps[k]
    out[-1] = x[0]
    return out


def innovations(den, density, sigma, dt, signals):
    """Innovations of signals (…, N+1) from the state 0, and their variances (N+1,): a Kalman filter."""
    transition, cov = sampled(den, dt)
    signals = np.atleast_2d(signals)
    n, (count, samples) = len(den) - 1, signals.shape
    x, p = np.zeros((n, count)), np.zeros((n, n))
    out, variances = np.empty((count, samples)), np.empty(samples)
    for k in range(samples):
        variance = p[0, 0] + sigma**2
        gain = p[:, 0] / variance
        out[:, k], variances[k] = signals[:, k] - x[0], variance
        x = transition @ (x + np.outer(gain, out[:, k]))
        p = transition @ (p - np.outer(gain, p[0])) @ transition.T + density * cov
        p = (p + p.T) / 2
    return out, variances


def free_responses(den, dt, intervals, offset=False):
    """Free response to each initial state, and with `offset` a constant: (n or n + 1, N+1)."""
    n = len(den) - 1
    transition = sampled(den, dt)[0]
    rows = [np.eye(n)[0]]
    for _ in range(intervals):
        rows.append(rows[-1] @ transition)
    columns = np.array(rows).T
    return np.vstack([columns, np.ones(intervals + 1)]) if offset else columns


def deviance(den, nums, inputs, density, sigma, dt, y, offset=False):
    """-2 log restricted likelihood of y, initial state (and offset) integrated out, less a constant."""
    intervals = len(y) - 1
    forced, _ = simulate(den, nums, inputs, dt, intervals)
    free = free_responses(den, dt, intervals, offset)
    v, variances = innovations(den, density, sigma, dt, np.vstack([y - forced, free]))
    v = v / np.sqrt(variances)
    q, r = np.linalg.qr(v[1:].T)
    left = v[0] - q @ (q.T @ v[0])
    return float(np.log(variances).sum() + left @ left + 2 * np.log(np.abs(np.diag(r))).sum())


def bound(den, nums, inputs, density, sigma, dt, intervals, free, offset=False, restricted=True):
    """Cramér-Rao bound of the parameters and the logarithms of (σ², Q), initial state (and offset) unknown.

    That of the restricted likelihood, or of the likelihood itself, to which known initial states are as good
    as unknown ones in what the covariance of the samples tells.

    `free(theta)` is (den, nums) of the parameters, `den` and `nums` those of the truth as `free` takes them
    apart: the first argument of it is made by concatenating den[1:] and the numerators. What `free` adds
    besides, such as a pole at zero, is known; a third answer is the numerator C of the noise, 1 without it.
    """
    theta = np.concatenate([den[1:], *nums])

    def moments(theta, logs):
        den, nums, *drive = free(theta)
        response, _ = simulate(den, nums, inputs, dt, intervals)
        cov = covariance(den, np.exp(logs[1]), np.exp(logs[0] / 2), dt, intervals, *drive)
        return response, cov

    logs = np.log([sigma**2, density])
    at, size = np.concatenate([theta, logs]), theta.size
    means, covs = [], []
    for k in range(at.size):
        h = 1e-4 * (abs(at[k]) if k < size else 1.0)
        ends = []
        for side in (-1, 1):
            moved = at.copy()
            moved[k] += side * h
            ends.append(moments(moved[:size], moved[size:]))
        means.append((ends[1][0] - ends[0][0]) / (2 * h))
        covs.append((ends[1][1] - ends[0][1]) / (2 * h))
    cov = moments(theta, logs)[1]
    inverse = np.linalg.inv(cov)
    columns = free_responses(free(theta)[0], dt, intervals, offset).T
    pulled = inverse @ columns
    m = inverse - pulled @ np.linalg.solve(columns.T @ pulled, pulled.T)
    turned = [(m if restricted else inverse) @ c for c in covs]
    information = np.array(
        [
            [a @ m @ b + 0.5 * np.sum(left * right.T) for b, right in zip(means, turned, strict=True)]
            for a, left in zip(means, turned, strict=True)
        ]
    )
    return np.linalg.inv(information)


def covariance(den, density, sigma, dt, intervals, drive=(1.0,)):
    """Covariance of the samples of an output that starts from a state that is known: (N+1, N+1)."""
    transition, cov = sampled(den, dt, drive)
    n = len(den) - 1
    p, blocks = np.zeros((n, n)), []
    for _ in range(intervals + 1):
        blocks.append(p)
        p = transition @ p @ transition.T + density * cov
    out = np.zeros((intervals + 1, intervals + 1))
    ahead = np.stack(blocks)[:, :, 0]
    for lag in range(intervals + 1):
        k = np.arange(intervals + 1 - lag)
        out[k, k + lag] = out[k + lag, k] = ahead[k, 0]
        ahead = ahead[: intervals - lag + 1] @ transition.T
    out[np.diag_indices(intervals + 1)] += sigma**2
    return out
