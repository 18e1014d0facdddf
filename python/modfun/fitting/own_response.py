"""What sums over samples leave of the equations of a response: nothing of the record, and taken out of it."""

from __future__ import annotations

import numpy as np

from .._core import coefficients
from ..base.arrays import F64
from ..records.corners import driving
from ..records.functions import samples_of
from ..records.record import Record
from ..results.of_equations import EquationFit

__all__ = ["excess"]


def excess(fit: EquationFit, k: int, rec: Record) -> F64:
    """Samples (equation, time) that sum to what the equations leave of the fit's own response to a record.

    An exact solution leaves nothing of integrals. Sums over samples err where signals move between these:
    products of outputs and inputs that jump, and whatever is faster than the sampling. The record has the
    same errors but for its noise.
    """
    # SymPy is loaded already: it made the formulas.
    from ..equations.symbolic.noise_free import coefficients_of, signals_of

    formulas, intervals, last = fit.layout.formulas, fit.intervals[k], fit.lines[k][1]
    step = float(rec.t[1] - rec.t[0])
    rows = formulas.rows(fit.simulate(rec)[0], driving(rec), rec.t, record=k)
    signals, kinds, delays = signals_of(formulas, rows, fit.params, k)
    first = rec.intervals - intervals
    lines = coefficients(signals, last, kinds, [late / step for late in delays], first, None)
    s = 2j * np.pi * np.arange(last + 1) / (intervals * step)
    left = np.zeros((len(fit.layout.orders), last + 1), complex)
    factors = coefficients_of(formulas, fit.params)
    for (equation, signal, order), g in zip(formulas.words["terms"], factors, strict=True):
        left[equation] += g * s**order * lines[signal]
    made = np.zeros((len(left), rec.t.size))
    made[:, first:] = samples_of(left, intervals, fit.options.rule)
    return made
