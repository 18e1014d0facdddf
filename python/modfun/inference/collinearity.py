"""Which parameters a record can tell apart: `collinearity` of records, and of structures or fits to them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Unpack

from ..base.arguments import public
from ..equations.equation import Equation
from ..equations.state_space import StateSpace
from ..errors import SpecError
from ..fitting.fit import Estimator, records_of, structure_of
from ..fitting.single import fit_quietly
from ..fitting.undeclared import fit_as_read
from ..models.options import Choices, Options
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from ..results.collinearity import Collinearity, collinearity_of
from ..results.fit import Fit

__all__ = ["collinearity"]


@public
def collinearity(
    data: Record | Sequence[Record],
    model: TransferFunction | Equation | StateSpace | Estimator | Fit,
    **options: Unpack[Choices],
) -> Collinearity:
    """Diagnose collinear regressors, as feedback makes them (report, section 4.10).

    The regressors are the columns of the estimate's last step, weighted by the noise, scaled to unit
    length, the transient projected out. Standard errors hold their inflation already; this says where
    it comes from.

    Parameters
    ----------
    data : Record or sequence of Record
    model : TransferFunction, Equation, StateSpace, Estimator or Fit
        What is fitted to the data; a Fit gives its structure and options.
    **options
        Those of `fit`, with a structure only.

    Returns
    -------
    Collinearity

    Raises
    ------
    FitError
        The fit has no finite regressors.

    See Also
    --------
    modfun.Collinearity : What it returns.
    modfun.crlb : How well an experiment can do.

    References
    ----------
    D. A. Belsley, E. Kuh, R. E. Welsch, Regression Diagnostics, Wiley, 1980; V. Klein, J. G. Batterson,
    NASA TP-1916, 1981.

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
    structure, chosen = _model(model, options)
    return collinearity_of(fit_as_read(records_of(data, "collinearity"), structure, chosen, fit_quietly))


def _model(model: Any, options: Any) -> tuple[Any, Options]:
    if isinstance(model, Fit | Estimator):
        if options:
            raise SpecError(
                f"collinearity: {', '.join(options)} given beside a {type(model).__name__}, which has "
                "options of its own; give its structure with options instead"
            )
        structure = model.structure if isinstance(model, Fit) else model.model
        return structure, model.options
    return structure_of(model, "collinearity"), Options.checked("collinearity", **options)
