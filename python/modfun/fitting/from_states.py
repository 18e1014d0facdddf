"""Fits of linear state spaces from given states: what moves beside the first state begins at zero."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..equations.layout import layout_of
from ..equations.matrices import Entry
from ..equations.state_space import StateSpace
from ..errors import SpecError
from ..models.options import Options
from ..records.forms import forms_of, in_common
from ..records.record import Record
from ..results.estimates import COVARIANCES

__all__ = ["fit_from_states"]


def fit_from_states(
    records: tuple[Record, ...],
    structure: StateSpace,
    options: Options,
    fit_from_zero: Callable[[tuple[Record, ...], Any, Options], Any],
) -> Any:
    """The fit of a state space whose states x₀ at the first sample of each record are given.

    z = x − x₀ begins at zero and follows z' = Az + B(u − u₀) + (Ax₀ + Bu₀)h from there, u₀ the inputs' first
    values. h is an input that is held at 1 and was 0 before, one a record, since x₀ differs.

    Raises
    ------
    SpecError
        States of another number, or outputs that depend on parameters or follow inputs at once.
    """
    states = [np.array(own) for own in options.states(len(records))]
    told, size = f"fit: initial_state={options.initial_state!r}", len(structure.states)
    if any(own.size != size for own in states):
        raise SpecError(
            f"{told}: the model has the states {', '.join(structure.states)}; give {size} numbers"
        )
    records = tuple([structure.own_channels(rec) for rec in records])
    first = records[0]
    rows = [structure.outputs.index(name) for name in first.outputs]
    if any(isinstance(entry, str) for i in rows for entry in structure.C[i]):
        raise SpecError(f"{told} takes outputs whose row of C has numbers alone; measure states")
    if any(entry != 0 for i in rows for entry in structure.D[i]):
        raise SpecError(f"{told} takes outputs that no input feeds through to, D = 0, as they jump with it")
    seen = np.array([structure.C[i] for i in rows], dtype=float)
    order = [first.inputs.index(name) for name in structure.inputs]
    names = [f"from_state{k}" for k in range(len(records))]
    columns = [
        [_sum((*a, *b), (*state, *rec.u[order, 0])) for a, b in zip(structure.A, structure.B, strict=True)]
        for rec, state in zip(records, states, strict=True)
    ]
    b = [[*row, *(column[i] for column in columns)] for i, row in enumerate(structure.B)]
    model = StateSpace(
        structure.A, b, structure.C, np.zeros((len(structure.C), len(b[0]))),
        states=structure.states, inputs=[*structure.inputs, *names], outputs=structure.outputs,
        params=dict(structure.params), delay=[*structure.delay, *[0.0] * len(names)],
    )  # fmt: skip
    beside = tuple(
        [
            _beside(rec, seen @ state, names, k)
            for k, (rec, state) in enumerate(zip(records, states, strict=True))
        ]
    )
    fit = fit_from_zero(beside, model, options.replace(initial_state="zero"))
    layout = layout_of(structure, options, first.outputs, first.inputs, forms_of(records))
    place = [list(fit.param_names).index(name) for name in layout.param_names]
    both = np.ix_(place, place)
    moved = {name: getattr(fit, name)[both] for name in (*COVARIANCES, "gram")}
    moved |= {name: getattr(fit, name)[place] for name in ("df_spectral", "df_hc3")}
    return replace(
        fit, params=fit.params[place], **moved, structure=structure, layout=layout, options=options,
        records=records, units=first.units, intersample=in_common(forms_of(records)),
    )  # fmt: skip


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
