"""Few samples of several experiments, whose sums have two lines: least squares of the samples know more."""

from __future__ import annotations

import modfun as mf
import numpy as np
from scipy.linalg import expm

TIMES = np.array([0, 1, 2, 3, 5, 7, 10, 14, 18, 24, 30.0])
MODEL = mf.Equation(["A' = -kf*A + kr*B", "B' = kf*A - (kr + k2)*B"], outputs=["A", "B"])


def test_errors_are_those_of_the_samples() -> None:
    """Standard errors of kf were 4 to 5 times as large in a third of such experiments, and 1.0 in others."""
    flow = np.array([[-0.3, 0.1], [0.3, -0.15]])
    for seed in (3, 4, 6, 9):
        rng = np.random.default_rng(seed)
        records = []
        for start in ([1, 0], [0, 1], [0.5, 0.5]):
            clean = np.array([expm(flow * t) @ start for t in TIMES]).T
            records.append(
                mf.Record(y=clean + 0.02 * rng.standard_normal((2, 11)), t=TIMES, outputs=["A", "B"])
            )
        fit = mf.fit(records, MODEL)
        assert abs(fit["kf"] - 0.3) < 3 * fit.bse[fit.param_names.index("kf")]
        assert fit.bse[fit.param_names.index("kf")] < 0.015  # 0.0086 by output error
