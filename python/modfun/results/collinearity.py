"""Which parameters a fit tells apart: conditions, variance inflation, and the combination at fault."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base import html
from ..base.arguments import public
from ..base.arrays import F64
from ..base.names import series
from ..base.student import root
from ..base.tables import Table
from ..errors import FitError
from .estimates import Estimates

__all__ = ["Collinearity", "collinearity_of"]

STRONG = 30.0  # condition index (Belsley, Kuh and Welsch)
SHARE = 0.5  # of a variance that one direction accounts for


@public
@dataclass(frozen=True, eq=False, repr=False)
class Collinearity:
    """Collinearity of the regressors of a fit, whitened, of unit length, transient eliminated.

    Attributes
    ----------
    table : Table
        One row per parameter: value, se classical, variance_inflation (of its squared standard error,
        beside regressors at right angles) and collinearity, in per cent: 100 (1 - 1/inflation), the share
        of the regressor that the others explain.
    condition : float
        Largest condition index: the condition number of the regressors.
    indices : (p,) array
        Condition indices, the largest first: the largest singular value over each.
    proportions : (p, p) array
        Row k: the share of each parameter's variance that the direction of index k accounts for; columns
        add up to one.
    directions : (p, p) array
        Row k: the change of the parameters that direction k is, in their standard errors.
    findings : tuple of str
        The combinations at fault, in words.
    fit : Fit

    See Also
    --------
    modfun.collinearity : Computes it.
    modfun.Fit.cov_params : The covariance it is made of.

    References
    ----------
    D. A. Belsley, E. Kuh, R. E. Welsch, Regression Diagnostics, Wiley, 1980.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    >>> found = mf.collinearity(rec, fit)
    >>> f"{found.condition:.1f}"
    '5.4'
    """

    table: Table
    condition: float
    indices: F64
    proportions: F64
    directions: F64
    findings: tuple[str, ...]
    fit: Estimates

    def decomposition(self) -> Table:
        """Condition indices with the variance proportions of all parameters, the worst first."""
        columns: dict[str, Any] = {"condition_index": self.indices}
        return Table(columns | dict(zip(self.fit.param_names, self.proportions.T, strict=True)))

    def __repr__(self) -> str:
        parts = [repr(self.table), "", f"Condition number {self.condition:.3g}.", *self.findings]
        return "\n".join(parts)

    def _repr_html_(self) -> str:
        lines = [f"Condition number {self.condition:.3g}.", *self.findings]
        return self.table._repr_html_() + html.listing(lines)


def collinearity_of(fit: Estimates) -> Collinearity:
    """Collinearity of the regressors of a fit.

    Raises
    ------
    FitError
        The fit has no finite regressors.
    """
    gram = fit.gram
    if not (np.all(np.isfinite(gram)) and np.all(np.isfinite(fit.params))):
        raise FitError(
            f"collinearity: the fit has no finite regressors (status {fit.status!r}). {fit.message}"
        )
    values, vectors = np.linalg.eigh(gram)
    values = np.maximum(values, np.finfo(float).eps * values[-1])
    indices = np.sqrt(values[-1] / values)
    parts = vectors**2 / values  # (parameter, direction): shares of the inflation
    inflation = parts.sum(axis=1)
    errors = root(np.diag(fit.cov_nonrobust))
    # A direction of unit-length regressors changes parameter j by v_j over its length: errors hold both.
    directions = (vectors / np.sqrt(inflation)[:, None]).T
    directions /= np.abs(directions).max(axis=1, keepdims=True)
    proportions = (parts / inflation[:, None]).T
    table = Table(
        {
            "parameter": list(fit.param_names),
            "value": fit.params,
            "se classical": errors,
            "variance_inflation": inflation,
            "collinearity": 100 * (1 - 1 / inflation),
        }
    )
    findings = _findings(fit, errors, indices, proportions, directions)
    return Collinearity(table, float(indices[0]), indices, proportions, directions, findings, fit)


def _findings(
    fit: Estimates, errors: F64, indices: F64, proportions: F64, directions: F64
) -> tuple[str, ...]:
    found = []
    for index, shares, way in zip(indices, proportions, directions, strict=True):
        joined = np.flatnonzero(shares > SHARE)
        if index < STRONG or joined.size < 2:
            continue
        names = [fit.param_names[j] for j in joined]
        moves = way * np.sign(way[joined[0]]) * errors
        changes = [f"{name} by {moves[j]:+.3g}" for name, j in zip(names, joined, strict=True)]
        found.append(
            f"{series(names)} can hardly be told apart (condition index {index:.3g}): changing "
            f"{series(changes)} together leaves the record nearly as well explained. "
            "Excite the input independently of the output, or fix one of them."
        )
    if not found:
        found.append(f"No combination of parameters stands out (no condition index above {STRONG:g}).")
    return tuple(found)
