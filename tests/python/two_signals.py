"""Two signals of ten seconds, a noisy sine and a cosine, that tests of records share."""

import numpy as np

N = 500
T = 0.02 * np.arange(N + 1)


def signals(seed=0):
    rng = np.random.default_rng(seed)
    return np.sin(2 * T) + 0.1 * rng.standard_normal(N + 1), np.cos(3 * T)
