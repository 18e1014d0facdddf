"""Derivatives of simulated outputs to the parameters of a fit, and to what belongs to a record."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.named import Named
from ..base.student import root
from ..records.record import Record
from .estimates import Estimates
from .gradients import differences
from .initial_state import linear_columns, slopes
from .prediction import InitialState, path_columns

__all__ = ["response_slopes"]


def response_slopes(
    fit: Estimates, rec: Record, initial: InitialState, given: Any = None
) -> tuple[F64, F64, bool]:
    """Derivatives of a fit's simulated outputs for a record.

    Parameters
    ----------
    fit : Estimates
    rec : Record
    initial : InitialState
        That of the simulation.
    given : optional
        The initial state, where it is not fitted; see `Fit.predict`.

    Returns
    -------
    moved : ndarray, shape (p, output, time)
        To the parameters.
    columns : ndarray, shape (unknown, output, time)
        To the initial state, where it is fitted, and the trend.
    following : bool
        Whether initial state and trend follow the parameters in `moved`.
    """
    structure, free = fit.structure, given is None
    if not (fit.layout.rational or (structure.linear and rec.dt is not None)):
        moved, columns = np.split(slopes(fit, rec, initial), [fit.params.size])
        return moved, columns if free else columns[initial.state.size :], False

    def moving(params: F64) -> F64:
        return replace(fit, params=Named(params, fit.param_names)).simulate(rec, given)[0]

    if fit.layout.rational:
        columns = path_columns(fit.layout, fit.params, fit.trend, rec, free)
    else:
        columns = linear_columns(fit, rec, free)
    return differences(moving, fit.params, root(np.diag(fit.cov_nonrobust))), columns, True
