"""pysid's output-error estimator (SciPy's least_squares with differences), discrete time, from rest."""

from pysid.identification.pemethod import oe

from .discrete import continuous, orders


class Pysid:
    """`pysid`'s `oe`, started as the package does: from least squares."""

    def __init__(self, problem):
        self.problem = problem
        self.nb, self.delay = orders(problem)

    def __call__(self, rec):
        """θ of a record."""
        model = oe(self.nb - 1, self.problem.poles, self.delay, rec.u.T.copy(), rec.y.T.copy())
        return continuous(model.B[0, 0], model.F[0, 0], self.problem)
