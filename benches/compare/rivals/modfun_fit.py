"""modfun itself, in the shape of a rival."""

import modfun as mf
import numpy as np


class Modfun:
    """`mf.fit` with defaults but for the method and what else is given; batches by `mf.fit_many`."""

    def __init__(self, problem, **options):
        self.problem, self.options = problem, options

    def __call__(self, rec):
        """θ of a record."""
        fit = mf.fit(rec, self.problem.model, **self.options)
        if not fit.success:
            raise ArithmeticError(fit.message)
        return fit.params

    def many(self, records):
        """θ of each record; the band is chosen on the first."""
        batch = mf.Batch(
            np.array([rec.y for rec in records]), records[0].u, records[0].dt, intersample=self.problem.hold
        )
        found = mf.fit_many(batch, self.problem.model, threads=1, progress=False, **self.options)
        return np.where((found.status == "ok")[:, None], found.params, np.nan)


class OutputError:
    """`mf.rivals.output_error`: SciPy's least_squares on the exact response, initial state free."""

    def __init__(self, problem):
        self.problem = problem
        self.estimate = mf.rivals.output_error(problem.model)

    def __call__(self, rec):
        """θ of a record."""
        found = self.estimate(rec)
        return np.array([found[name] for name in self.problem.names])
