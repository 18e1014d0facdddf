"""pySINDy's weak form: linear regression of integrals, which needs every state of the system measured."""

import warnings

import numpy as np
import pysindy as ps
from scipy.signal import ss2tf

STATES = True  # records must hold all states
SUBDOMAINS, HALF = 300, 1.5  # how many, and half the length of each in units of 1/cutoff


class Weak:
    """x' = A x + B u from all states, library x and u alone, no threshold; y is the first state."""

    def __init__(self, problem):
        self.problem = problem
        np.random.seed(0)  # noqa: NPY002 - the package draws its subdomains from NumPy's global numbers
        t = np.arange(problem.u.size) * problem.dt
        self.library = ps.WeakPDELibrary(
            function_library=ps.PolynomialLibrary(degree=1, include_bias=False),
            spatiotemporal_grid=t,
            K=SUBDOMAINS,
            H_xt=HALF / problem.cutoff,
        )

    def __call__(self, rec):
        """θ of a record of all states."""
        n, m = self.problem.poles, self.problem.zeros
        size = rec.y.std(axis=1)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            model = ps.SINDy(feature_library=self.library, optimizer=ps.STLSQ(threshold=0.0, alpha=0.0))
            model.fit(rec.y.T / size, t=rec.dt, u=rec.u.T)
        found = np.asarray(model.coefficients())
        a, b = found[:, :n] * size[:, None] / size, found[:, n:] * size[:, None]
        b, a = ss2tf(a, b, np.eye(1, n), [[0.0]])
        return np.concatenate([a[1:], b[0, n - m :]])
