"""Frequencies of real sinusoids by two classics of spectral analysis: high-order Yule–Walker and ESPRIT."""

import numpy as np


def nearest_to_circle(roots, count):
    """The frequencies of the `count` roots of the upper half plane nearest to the unit circle, ascending."""
    upper = roots[roots.imag > 1e-9]
    order = np.argsort(np.abs(np.abs(upper) - 1))[:count]
    found = np.sort(np.angle(upper[order]))
    return np.concatenate([found, np.full(count - found.size, np.nan)])


def autocovariance(y, most):
    """Biased estimates at lags 0…most, as Yule–Walker methods take them."""
    return np.array([y[k:] @ y[: y.size - k] for k in range(most + 1)]) / y.size


def hoyw(y, count, order=20, equations=20):
    """High-order Yule–Walker: `equations` beyond the order, solved by an SVD cut at rank 2·count.

    With additive white noise the covariances of lags order + 1 … order + equations obey the difference
    equation of the sinusoids; of its `order` roots those nearest to the unit circle are taken.
    """
    r = autocovariance(y, order + equations)
    rows = np.array([[r[abs(order + i - j)] for j in range(order)] for i in range(equations)])
    u, s, vt = np.linalg.svd(rows)
    rank = 2 * count
    b = -(vt[:rank].T / s[:rank]) @ (u[:, :rank].T @ r[order + 1 : order + equations + 1])
    return nearest_to_circle(np.roots(np.concatenate([[1.0], b])), count)


def esprit(y, count, window=None):
    """ESPRIT: rotation of the signal subspace of the forward-backward covariance between shifted windows."""
    size = y.size // 3 if window is None else window
    rows = np.lib.stride_tricks.sliding_window_view(y, size)
    both = np.vstack([rows, rows[:, ::-1]])
    _, vectors = np.linalg.eigh(both.T @ both)
    signal = vectors[:, -2 * count :]
    rotation = np.linalg.lstsq(signal[:-1], signal[1:], rcond=None)[0]
    return nearest_to_circle(np.linalg.eigvals(rotation), count)
