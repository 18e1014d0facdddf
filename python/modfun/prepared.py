"""What fits of one kind share whatever the samples: checked and laid out once, with the core's `Fitter`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _core
from .errors import DataError, SpecError
from .options import Options
from .records import Batch, Record
from .structures import TransferFunction

__all__ = ["Prepared", "channels", "prepare", "refuse_standing"]

KEPT = 32  # kinds of fits
LONGEST = 1 << 14  # samples of all records; longer ones would keep megabytes for less than the fit takes

Names = tuple[str, ...]
F64 = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Prepared:
    """A structure with options for records of some lengths, steps and channels.

    Attributes
    ----------
    core : _core.Fitter
    numerators : tuple of int or None
        Degree of each input's numerator.
    delays : tuple of float
        Of each input, s.
    param_names : tuple of str
    intervals : tuple of int
        Sampling intervals used, a record.
    """

    core: _core.Fitter
    numerators: tuple[int | None, ...]
    delays: tuple[float, ...]
    param_names: Names
    intervals: tuple[int, ...]


def prepare(structure: TransferFunction, options: Options, data: Batch | Sequence[Record]) -> Prepared:
    """What the fits of a batch, or of records as one problem, share.

    Raises
    ------
    DataError, SpecError
        As in `fit`, as far as lengths, steps and channels are concerned.
    """
    first: Batch | Record
    sampling: tuple[tuple[int, Any], ...]
    if isinstance(data, Batch):
        first, sampling = data, ((data.y.shape[2], data.dt),)
    else:
        first = data[0]
        sampling = tuple([(rec.y.shape[1], rec.t if rec.dt is None else rec.dt) for rec in data])
    short = sum([samples for samples, _ in sampling]) <= LONGEST
    even = isinstance(data, Batch) or all(rec.dt is not None for rec in data)
    make = _kept if short and even else _made
    return make(structure, options, first.outputs, first.inputs, first.intersample, sampling)


def channels(structure: TransferFunction, outputs: Names, inputs: Names) -> tuple[Any, Any]:
    """Numerator degrees and delays for the inputs of a record, checked."""
    if len(outputs) > 1:
        raise SpecError(
            f"fit: the record has {len(outputs)} outputs ({', '.join(outputs)}) and this version fits "
            f"one at a time; choose it with rec.select(outputs=[{outputs[0]!r}])"
        )
    if not inputs:
        if structure.n_inputs is not None:
            raise SpecError(
                f"fit: the structure has {structure.n_inputs} input(s), the record has none; free "
                f"motion takes TransferFunction(poles={structure.poles})"
            )
        return (), ()
    return structure.numerators(len(inputs)), structure.delays(len(inputs))


def refuse_standing(
    made: Prepared, outputs: Names, inputs: Names, ys: Sequence[F64], us: Sequence[F64]
) -> None:
    """Refuse records (outputs (time), inputs (channel, time)) in which a channel that counts never moves.

    Raises
    ------
    DataError
    """
    if all([_stands(y) for y in ys]):
        raise DataError(
            f"fit: output {outputs[0]!r} stands at {ys[0][0]:g} throughout, so nothing can be learnt "
            "from it: take a record in which it moves"
        )
    for k, degree in enumerate(made.numerators):
        if degree is not None and all([_stands(u[k]) for u in us]):
            raise DataError(
                f"fit: input {inputs[k]!r} stands at {us[0][k, 0]:g} throughout, so nothing can be "
                "learnt from it: leave it out with rec.select(inputs=[...]), or take a record in which "
                "it moves"
            )


def _stands(values: F64) -> bool:
    # The ends differ as a rule, which is said at once.
    return values.item(0) == values.item(-1) and bool(np.ptp(values) == 0)


def _made(
    structure: TransferFunction,
    options: Options,
    outputs: Names,
    inputs: Names,
    intersample: Names,
    sampling: tuple[tuple[int, Any], ...],
) -> Prepared:
    """As `prepare`; `sampling` holds the number of samples and the step (uneven: the times) a record."""
    numerators, delays = channels(structure, outputs, inputs)
    late = max(delays, default=0.0)
    leads = [0 if late == 0 else _lead(late, samples, step) for samples, step in sampling]
    core = _core.Fitter(
        [samples for samples, _ in sampling],
        [step for _, step in sampling],
        order=structure.poles,
        numerators=numerators,
        delays=delays,
        intersample=intersample,
        **options.core(),
    )
    return Prepared(
        core=core,
        numerators=numerators,
        delays=delays,
        param_names=structure.param_names(inputs)
        if inputs
        else tuple(f"a{k + 1}" for k in range(structure.poles)),
        intervals=tuple(samples - 1 - lead for (samples, _), lead in zip(sampling, leads, strict=True)),
    )


_kept = lru_cache(KEPT)(_made)


def _lead(late: float, samples: int, step: Any) -> int:
    """Samples by which the window starts late."""
    if not isinstance(step, float):
        raise DataError(
            f"fit: a delay of {late:g} s needs even sampling, and the record's steps are uneven; "
            "resample it, or leave the delay out"
        )
    duration = (samples - 1) * step
    if late >= duration / 2:
        raise DataError(
            f"fit: the delay of {late:g} s leaves less than half of the record of {duration:g} s; "
            "delays are in seconds"
        )
    return ceil(late / step - 1e-9)
