"""Fits of linear equations from given states: what moves beside the first state begins at zero."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..equations.equation import Equation
from ..equations.layout import layout_of
from ..equations.matrices import Entry
from ..equations.nonlinear import model_of
from ..equations.state_space import StateSpace
from ..errors import SpecError
from ..models.options import Options
from ..records.forms import forms_of, in_common
from ..records.record import Record
from ..results.estimates import COVARIANCES

__all__ = ["fit_from_states"]


def fit_from_states(
    records: tuple[Record, ...],
    structure: StateSpace | Equation,
    options: Options,
    fit_from_zero: Callable[[tuple[Record, ...], Any, Options], Any],
) -> Any:
    """The fit of a linear model whose states x₀ at the first sample of each record are given.

    z = x − x₀ begins at zero and follows z' = Az + B(u − u₀) + (Ax₀ + Bu₀)h from there, u₀ the inputs' first
    values. h is an input that is held at 1 and was 0 before, one a record, since x₀ differs. Equations say
    the same with derivatives of h.

    Raises
    ------
    SpecError
        States of another number, outputs that depend on parameters or follow inputs at once, or equations
        that are not linear.
    """
    states = [np.array(own) for own in options.states(len(records))]
    told = f"fit: initial_state={options.initial_state!r}"
    records = tuple([structure.own_channels(rec) for rec in records])
    names = [f"from_state{k}" for k in range(len(records))]
    beside: Any = _beside_states if isinstance(structure, StateSpace) else _beside_jets
    model, levels = beside(structure, records, states, names, told)
    moved = tuple(
        [_beside(rec, level, names, k) for k, (rec, level) in enumerate(zip(records, levels, strict=True))]
    )
    fit = fit_from_zero(moved, model, options.replace(initial_state="zero"))
    first = records[0]
    layout = layout_of(structure, options, first.outputs, first.inputs, forms_of(records))
    place = [list(fit.param_names).index(name) for name in layout.param_names]
    both = np.ix_(place, place)
    kept = {name: getattr(fit, name)[both] for name in (*COVARIANCES, "gram")}
    kept |= {name: getattr(fit, name)[place] for name in ("df_spectral", "df_hc3")}
    return replace(
        fit, params=fit.params[place], **kept, structure=structure, layout=layout, options=options,
        records=records, units=first.units, intersample=in_common(forms_of(records)),
    )  # fmt: skip


def _beside_states(
    model: StateSpace, records: Sequence[Record], states: Sequence[F64], names: Sequence[str], told: str
) -> tuple[StateSpace, list[F64]]:
    """The state space of z with its inputs h, and the outputs' values of x₀ in each record."""
    _refuse_size(states, model.states, told)
    first = records[0]
    rows = [model.outputs.index(name) for name in first.outputs]
    if any(isinstance(entry, str) for i in rows for entry in model.C[i]):
        raise SpecError(f"{told} takes outputs whose row of C has numbers alone; measure states")
    if any(entry != 0 for i in rows for entry in model.D[i]):
        raise SpecError(f"{told} takes outputs that no input feeds through to, D = 0, as they jump with it")
    seen = np.array([model.C[i] for i in rows], dtype=float)
    order = [first.inputs.index(name) for name in model.inputs]
    columns = [
        [_sum((*a, *b), (*state, *rec.u[order, 0])) for a, b in zip(model.A, model.B, strict=True)]
        for rec, state in zip(records, states, strict=True)
    ]
    b = [[*row, *(column[i] for column in columns)] for i, row in enumerate(model.B)]
    made = StateSpace(
        model.A, b, model.C, np.zeros((len(model.C), len(b[0]))),
        states=model.states, inputs=[*model.inputs, *names], outputs=model.outputs,
        params=dict(model.params), delay=[*model.delay, *[0.0] * len(names)],
    )  # fmt: skip
    return made, [seen @ state for state in states]


def _beside_jets(
    model: Equation, records: Sequence[Record], states: Sequence[F64], names: Sequence[str], told: str
) -> tuple[Equation, list[F64]]:
    """As `_beside_states`, of equations, whose states are y, y', … of the free response."""
    from ..equations.symbolic.begun import begun

    first = records[0]
    compiled = model.compiled(first.outputs, first.inputs)
    form = model_of(compiled, np.ones(len(compiled.parameters)), model).form
    jumping = [name for name in first.outputs if name not in form.states]
    if form.feeds or jumping:
        raise SpecError(
            f"{told}: an output jumps with an input, or is no state ({', '.join(form.states)}); take "
            '"rest", "zero" or "unknown"'
        )
    _refuse_size(states, form.states, told)
    starts = [
        dict(zip((*form.states, *rec.inputs), (*state, *rec.u[:, 0]), strict=True))
        for rec, state in zip(records, states, strict=True)
    ]
    levels = [np.array([own[name] for name in first.outputs]) for own in starts]
    return begun(model, told, form.states, starts, names), levels


def _refuse_size(states: Sequence[F64], names: Sequence[str], told: str) -> None:
    if any(own.size != len(names) for own in states):
        raise SpecError(f"{told}: the model has the states {', '.join(names)}; give {len(names)} numbers")


def _sum(entries: Sequence[Entry], values: Sequence[float]) -> Entry:
    """Entries of a row times numbers."""
    pairs = [(entry, float(value)) for entry, value in zip(entries, values, strict=True) if value != 0]
    number = sum(float(entry) * value for entry, value in pairs if not isinstance(entry, str))
    texts = [f"{value!r}*({entry})" for entry, value in pairs if isinstance(entry, str)]
    return " + ".join([*texts, f"({number!r})"]) if texts else number


def _beside(rec: Record, start: F64, names: Sequence[str], k: int) -> Record:
    """What a record's channels move beside their start, with the inputs that hold the states' part."""
    held = np.zeros((len(names), rec.t.size))
    held[k] = 1.0
    return rec._like(
        y=rec.y - start[:, None],
        u=np.vstack([rec.u - rec.u[:, :1], held]),
        inputs=(*rec.inputs, *names),
        intersample=(*rec.intersample, *["zoh"] * len(names)),
        _keep={},
    )
