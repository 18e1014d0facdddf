"""The rule that chooses the band where none is given, written out with dense matrices.

K_max = max(⌊N/8⌋, min(⌊N/4⌋, 16)) and K₀ = 3# + n, # the unknowns with the trend's.  The fit at K_max
starts from `wls` and once more from the fit at K₀; the cheaper one is kept.  At its θ, with its own
response in place of y, standard errors se(K) at constant noise follow from the lines up to K; the smallest
K with every se at most 1.01 times that at K_max is the band.
"""

import numpy as np

from . import lines


def choose(record, order, numerators, trend=None):
    """Return (k_max, k_0, cost from wls, cost from the narrow fit, k)."""
    intervals = record.y.size - 1
    unknowns = (
        order + sum(d + 1 for d in numerators if d is not None) + {None: 0, "constant": 1, "linear": 2}[trend]
    )
    k_max = max(intervals // 8, min(intervals // 4, 16))
    k_0 = min(3 * unknowns + order, k_max)
    wide = lines.Problem([record], order, numerators, k_max, trend=trend)
    narrow = lines.Problem([record], order, numerators, k_0, trend=trend)
    first = lines.ml(wide, lines.wls(wide)[: wide.p] * wide.unit)
    start = lines.ml(narrow, lines.wls(narrow)[: narrow.p] * narrow.unit)[: narrow.p] * narrow.unit
    second = lines.ml(wide, start)
    costs = [float(np.sum(wide.residual(x) ** 2)) for x in (first, second)]
    x = first if costs[0] <= costs[1] else second
    errors = {k: standard_errors(record, wide, x, k) for k in range(2, k_max + 1)}
    limit = 1.01 * errors[k_max]
    k = min(k for k, se in errors.items() if se is not None and np.all(se <= limit))
    return k_max, k_0, costs[0], costs[1], k


def standard_errors(record, wide, x, top):
    """se of θ from the lines up to `top` at the unknowns `x` of the wide problem, noise of unit variance."""
    ((m, *_),) = wide.lines
    kept = np.concatenate([m <= top, (m <= top)[m > 0]])
    j = wide.system(x, x)[0][kept]
    if j.shape[0] <= j.shape[1]:
        return None
    norm = np.linalg.norm(j, axis=0)
    root = np.linalg.inv(np.linalg.qr(j / norm, mode="r")) / norm[:, None]
    return np.sqrt(np.sum(root**2, axis=1))[: wide.p]
