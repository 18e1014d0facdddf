"""Several free delays in linear equations: the search begins where transfer functions end."""

import modfun as mf
import numpy as np
import pytest
from scipy.signal import lfilter

FINE = 20  # steps of the truth a sample, which delays are multiples of
STEP = 60.0
# Wood and Berry's column (Chem. Eng. Sci. 28, 1973): gains, time constants and delays in s.
PATHS = {
    "xD": {"R": (12.8, 1002.0, 60.0), "S": (-18.9, 1260.0, 180.0)},
    "xB": {"R": (6.6, 654.0, 420.0), "S": (-19.4, 864.0, 180.0)},
}


def _answer(u, gain, constant, delay):
    """Exact response of a lag to a held input, from rest."""
    fine, pole = np.repeat(u, FINE), np.exp(-STEP / FINE / constant)
    late = np.concatenate([np.zeros(round(delay * FINE / STEP)), fine])[: fine.size]
    return lfilter([0.0, gain * (1 - pole)], [1.0, -pole], late)[::FINE]


def _record(seed):
    rng = np.random.default_rng(seed)
    u = {name: np.repeat(rng.choice([-0.1, 0.1], 51), 12)[:601] for name in "RS"}
    y = {
        out: sum(_answer(u[name], *own) for name, own in paths.items()) + 0.1 * rng.standard_normal(601)
        for out, paths in PATHS.items()
    }
    return mf.Record(y=y, u=u, dt=STEP)


def _column():
    late = {f"d{i}{k}": mf.Free(min=0, max=600) for i in "12" for k in "12"}
    lags = [f"T{i}{k}*{x}' + {x} = K{i}{k}*{u}(t - d{i}{k})" for x, i, k, u in
            [("a", 1, 1, "R"), ("b", 1, 2, "S"), ("c", 2, 1, "R"), ("d", 2, 2, "S")]]  # fmt: skip
    return mf.Equation(
        [*lags, "xD = a + b", "xB = c + d"], outputs=["xD", "xB"], inputs=["R", "S"], params=late
    )


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_column_with_a_delay_in_each_path_is_found(seed):
    """From one start the first ended with a delay on its bound, and each took half a minute."""
    fit = mf.fit(_record(seed), _column(), trend="constant")
    truth = {}
    for i, paths in enumerate(PATHS.values(), 1):
        for k, own in enumerate(paths.values(), 1):
            truth |= dict(zip((f"K{i}{k}", f"T{i}{k}", f"d{i}{k}"), own, strict=True))
    z = (fit.params - [truth[name] for name in fit.param_names]) / fit.bse
    assert fit.success
    assert np.abs(z).max() < 4.0  # false once in 1,300 fits of 12 parameters
    assert fit.params[fit.param_names.index("d21")] == pytest.approx(420.0, abs=40.0)
