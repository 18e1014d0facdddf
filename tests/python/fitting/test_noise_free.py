"""State spaces of several outputs fitted to simulations of SciPy without noise: what users try first."""

import modfun as mf
import numpy as np
import pytest
from scipy.signal import cont2discrete, lsim

pytest.importorskip("sympy")

A, B = np.array([[-0.8, 1.0], [-4.5, -1.2]]), np.array([[-0.09], [-5.0]])
VALUES = {"Za": -0.8, "Ma": -4.5, "Mq": -1.2, "Zd": -0.09, "Md": -5.0}
SPACE = mf.StateSpace([["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"], inputs=["de"])


def held(seed, dt):
    """Steps of half a second, held: the exact discrete equivalent."""
    rng, size = np.random.default_rng(seed), int(15 / dt) + 1
    each = int(0.5 / dt)
    u = np.repeat(rng.choice([-1.0, 0.0, 1.0], size // each + 1), each)[:size]
    a, b, *_ = cont2discrete((A, B, np.eye(2), np.zeros((2, 1))), dt)
    x = np.zeros((size, 2))
    for k in range(size - 1):
        x[k + 1] = a @ x[k] + b[:, 0] * u[k]
    return u, x


def smooth(seed, dt):
    """Six sines; `lsim` takes straight lines between the samples, which are not quite these."""
    rng, t = np.random.default_rng(seed), np.arange(int(15 / dt) + 1) * dt
    u = sum(np.sin(w * t + p) for w, p in zip(rng.uniform(0.3, 4, 6), rng.uniform(0, 6.28, 6), strict=True))
    return u, lsim((A, B, np.eye(2), np.zeros((2, 1))), u, t)[1]


@pytest.mark.parametrize(
    ("made", "seed", "dt", "form"),
    [(held, 0, 0.05, "zoh"), (held, 1, 0.05, "zoh"), (held, 0, 0.02, "zoh"), (smooth, 0, 0.02, "smooth")],
)
def test_a_level_that_runs_away_does_not_end_a_fit(made, seed, dt, form):
    """Three of these ended as "maxiter", 200 % and more off: the level learnt of q went to 15 times q."""
    u, x = made(seed, dt)
    rec = mf.Record(y=x.T, u=u, dt=dt, outputs=["alpha", "q"], inputs=["de"], intersample=form)
    fit = mf.fit(rec, SPACE)
    assert fit.success
    for name, value in VALUES.items():
        assert fit[name] == pytest.approx(value, rel=5e-3), name
    assert np.all(np.sqrt(np.diag(fit.noise_cov)) < 0.01 * x.std(axis=0))
    assert not [text for text in fit.check() if "drift" in text]
