"""Models whose parameters have values, from what a user may give, and experiments in their channels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.names import nearest
from ..base.samples import numbered
from ..equations.equation import Equation
from ..equations.nonlinear import NonlinearModel
from ..equations.state_space import StateSpace
from ..errors import DataError, SpecError
from ..models.free import priors_of
from ..models.noise import Noise
from ..models.process import ProcessNoise, with_inputs
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from ..results.fit import Fit
from ..signals import Signals
from ..systems.lti import LTI
from ..systems.making import linear
from .slopes import Equations, Known, States, Transfers

__all__ = ["noise_of", "record_for", "sds_beforehand", "valued"]


def valued(
    system: Any, params: Mapping[str, float] | None, model: TransferFunction | None, first: Record | Signals
) -> Known:
    """The model with values for its parameters."""
    system = linear(system, "crlb")
    structured = isinstance(system, TransferFunction | StateSpace | Equation)
    if structured and params is None:
        raise SpecError(
            f"crlb: a {type(system).__name__} has no numbers; give params={{name: value}}, or a system with "
            "numbers, as mf.tf(num, den) or a Fit"
        )
    if not structured and params is not None:
        raise SpecError(f"crlb: params= is for structures; a {type(system).__name__} has its own numbers")
    if model is not None and not isinstance(system, LTI):
        raise SpecError(
            f"crlb: model= is for systems made by mf.tf or mf.ss, not for a {type(system).__name__}"
        )
    if isinstance(system, Fit):
        return _of_fit(system)
    if isinstance(system, LTI):
        structure = TransferFunction.from_system(system) if model is None else model
        q, k = system.shape
        inputs = system.inputs or (first.inputs if len(first.inputs) == k else numbered("u", k))
        named = system.inputs if isinstance(first, Signals) else None
        return Transfers(structure.layout(_outputs(first, q), inputs), structure.theta(system), named)
    if isinstance(system, NonlinearModel):
        return Equations(system)
    assert params is not None or not structured
    if isinstance(system, TransferFunction):
        count = system.n_outputs
        if count is None:
            count = len(first.outputs) if isinstance(first, Record) else 1
        layout = system.layout(_outputs(first, count), first.inputs)
        return Transfers(layout, _values(params, layout.param_names))
    if isinstance(system, StateSpace):
        held = [name for name, given in system.params if isinstance(given, int | float)]
        names = tuple(name for name in system.all_parameters if name not in held)
        return States(system, dict(zip(names, _values(params, names).tolist(), strict=True)))
    if isinstance(system, Equation):
        _values(params, system.param_names())
        return Equations(system.model(params or {}))
    raise SpecError(
        f"crlb: the system is of type {type(system).__name__}; give mf.tf(num, den), a structure with "
        "params=, or a Fit"
    )


def sds_beforehand(system: Any, model: TransferFunction | None) -> dict[str, float]:
    """Standard deviations of what is known of parameters before the experiment."""
    structure = system.structure if isinstance(system, Fit) else system if model is None else model
    if not isinstance(structure, TransferFunction | StateSpace | Equation):
        return {}
    return {name: given.sd for name, given in priors_of(structure).items() if given.sd}


def _of_fit(fit: Fit) -> Known:
    if isinstance(fit.structure, TransferFunction):
        return Transfers(fit.layout, fit.params, fit.inputs)
    if isinstance(fit.structure, StateSpace):
        return States(fit.structure, fit.estimates(), fit.outputs)
    if fit.trend is not None:
        raise SpecError(
            f"crlb: the fit has an unknown trend ({fit.trend}) in each equation; write it, '+ c', as a "
            "parameter"
        )
    return Equations(fit.model)  # type: ignore[arg-type]  # of equations a NonlinearModel


def noise_of(fit: Fit) -> tuple[F64, Any]:
    """Covariance of the white noise that a fit found on the samples of its outputs, and what drives it."""
    noise = fit.options.noise
    if fit.options.drives and fit.process_levels is not None:
        outputs = len(fit.outputs)
        own, driving = np.split(np.sqrt(fit.process_levels[0]), [outputs])
        if not np.all(own > 0):
            raise SpecError("crlb: the fit found no noise on the samples; give sigma=")
        if isinstance(noise, ProcessNoise):
            return np.diag(own**2), noise.scaled((driving**2).tolist())
        return np.diag(own**2), driving
    told = isinstance(noise, Noise) and noise.u is None and noise.white
    if noise != "output" and not told:
        raise SpecError(
            f"crlb: the fit's noise is {fit.options.noise!r}, and the bound is for white noise on the "
            "outputs and in the system; give sigma= or nsr="
        )
    return fit.noise_cov, 0.0


def _values(params: Mapping[str, float] | None, names: Sequence[str]) -> F64:
    given = dict(params or {})
    for name in names:
        if name not in given:
            raise SpecError(f"crlb: params lacks {name!r}; the parameters are {', '.join(names)}")
    for name, value in given.items():
        if name not in names:
            raise SpecError(f"crlb: params names {name!r}; {nearest(name, names)}")
        if isinstance(value, bool | str) or not np.isfinite(value):
            raise SpecError(f"crlb: params[{name!r}]={value!r} must be a finite number")
    return np.array([float(given[name]) for name in names])


def record_for(known: Known, given: Record | Signals, process_noise: Any = 0.0) -> Record:
    """The experiment as a record with the inputs of the model, those at zero through which noise enters."""
    q, k = known.shape
    if isinstance(given, Signals):
        names = process_noise.names if isinstance(process_noise, ProcessNoise) else ()
        measured = None if known.inputs is None else tuple([n for n in known.inputs if n not in names])
        given = given.arranged("crlb", measured, k - len(names))
        given = Record(np.zeros((q, given.intervals + 1)), given, outputs=known.outputs)
    given = with_inputs(given, process_noise)
    if given.dt is None:
        raise DataError("crlb: the record is sampled unevenly; give an evenly sampled one")
    weighed = given.mask is not None or given.sigma is not None
    if known.outputs is not None and set(known.outputs) <= set(given.outputs):
        given = given.select(outputs=known.outputs)
    if weighed and len(given.outputs) != q:
        raise SpecError(
            f"crlb: the record has {len(given.outputs)} outputs whose samples count differently, the system "
            f"{q}; choose, rec.select(outputs=[{given.outputs[0]!r}])"
        )
    if known.inputs is not None:
        if lost := [name for name in known.inputs if name not in given.inputs]:
            raise SpecError(
                f"crlb: the model has the input {lost[0]!r}, the record the inputs {list(given.inputs)}; "
                "name them alike"
            )
        return given.select(inputs=known.inputs)
    if len(given.inputs) != k:
        raise SpecError(f"crlb: the record has {len(given.inputs)} input(s), the system {k}")
    return given


def _outputs(first: Record | Signals, count: int) -> tuple[str, ...]:
    named = isinstance(first, Record) and len(first.outputs) == count
    return first.outputs if named else numbered("y", count)  # type: ignore[union-attr]
