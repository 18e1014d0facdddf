"""SIPPY's output error (CasADi, IPOPT) and its N4SID, discrete time."""

import contextlib
import io

import numpy as np
from scipy.signal import ss2tf
from sippy_unipi import system_identification

from .discrete import continuous, orders


def quietly(*args, **options):
    with contextlib.redirect_stdout(io.StringIO()):
        return system_identification(*args, **options)


class SippyOE:
    """Output error by constrained optimisation from zero; the first samples are taken as measured."""

    def __init__(self, problem):
        self.problem = problem
        self.count, self.delay = orders(problem)

    def __call__(self, rec):
        """θ of a record."""
        n = self.problem.poles
        u, y = rec.u, rec.y
        if not self.delay:  # its models have a delay of one sample: the input comes one earlier
            u, y = u[:, 1:], y[:, :-1]
        model = quietly(y, u, "OE", OE_orders=[self.count, n, 0], tsample=rec.dt)
        b = np.concatenate([np.zeros(self.delay), np.ravel(model.NUMERATOR)[: self.count]])
        return continuous(b, np.ravel(model.DENOMINATOR)[: n + 1], self.problem)


class SippyN4SID:
    """Subspace identification, whatever the initial state."""

    def __init__(self, problem):
        self.problem = problem

    def __call__(self, rec):
        """θ of a record."""
        model = quietly(
            rec.y, rec.u, "N4SID", SS_fixed_order=self.problem.poles, SS_f=20, SS_p=20,
            SS_D_required=self.problem.hold != "zoh",
        )  # fmt: skip
        b, f = ss2tf(np.asarray(model.A), np.asarray(model.B), np.asarray(model.C), np.asarray(model.D))
        return continuous(b[0], f, self.problem)
