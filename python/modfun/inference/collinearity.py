"""Which parameters a record can tell apart: `collinearity` of records, and of structures or fits to them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Unpack

from ..base.arguments import public
from ..equations.equation import Equation
from ..equations.state_space import StateSpace
from ..errors import SpecError
from ..fitting.fit import Estimator, fit_quietly, records_of, structure_of
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
    """
    structure, chosen = _model(model, options)
    return collinearity_of(fit_quietly(records_of(data, "collinearity"), structure, chosen))


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
