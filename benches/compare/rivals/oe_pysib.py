"""pysib's output-error estimator (C core), discrete time, from rest."""

import warnings

import pysib

from .discrete import continuous, orders


class Pysib:
    """`pysib.oe`, started as the package does: from ARX."""

    def __init__(self, problem):
        self.problem = problem
        self.nb, self.delay = orders(problem)

    def __call__(self, rec):
        """θ of a record."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # an unstable result is counted, not announced
            _, model = pysib.oe(rec.u[0], rec.y[0], self.nb, self.problem.poles, self.delay)
        return continuous(model["B"], model["F"], self.problem)
