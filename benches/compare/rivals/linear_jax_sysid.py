"""jax-sysid's linear state-space model, discrete time, initial state trained, L-BFGS."""

import jax
import numpy as np
from scipy.signal import ss2tf

from .discrete import continuous

jax.config.update("jax_enable_x64", True)

from jax_sysid.models import LinearModel  # noqa: E402  (after JAX knows its precision)


class Linear:
    """Signals scaled, regularisation nearly off; Adam, then L-BFGS, as the package's examples do."""

    def __init__(self, problem):
        self.problem = problem

    def __call__(self, rec):
        """θ of a record."""
        n = self.problem.poles
        u, y = rec.u.T / np.std(rec.u), rec.y.T / np.std(rec.y)
        model = LinearModel(n, 1, 1, feedthrough=self.problem.hold != "zoh", sigma=0.9, Ts=rec.dt)
        model.loss(rho_x0=1e-9, rho_th=1e-9)
        model.optimization(adam_epochs=1000, lbfgs_epochs=3000, iprint=-1)
        model.fit(y, u)
        a, b, c, d = (np.asarray(part) for part in model.ssdata())
        b, f = ss2tf(a, b * np.std(rec.y) / np.std(rec.u), c, d * np.std(rec.y) / np.std(rec.u))
        return continuous(b[0], f, self.problem)
