"""What fits of one kind share whatever the samples: checked and laid out once, with the core's `Fitter`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice
from math import ceil
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from .._core import Fitter, JointFitter, Stream
from ..base.arrays import F64
from ..base.samples import grid_step, rounded_step
from ..errors import DataError, SpecError
from ..models.layout import Layout
from ..models.options import Options
from ..models.transfer_function import TransferFunction
from ..records.batches import Batch
from ..records.forms import Forms, forms_of
from ..records.record import Record
from .gaps import blind, bridged, variances, weighs
from .weights import weighting

__all__ = [
    "Prepared", "counts_start", "fits_alone", "joint_words", "plain_words", "prepare", "prepare_stream",
    "refuse_cut_off", "refuse_known_start", "refuse_process_noise", "refuse_standing", "refuse_uneven",
    "spans",
]  # fmt: skip

KEPT = 32  # kinds of fits
LONGEST = 1 << 14  # samples of all records; longer ones would keep megabytes for less than the fit takes

OPEN = 0.1  # of an input's range: ends of whole periods are no farther apart
LOOKED_AT = 64  # records of a batch that tell the noise levels
ROUNDING = 1e-9  # of times
_NOTHING = np.zeros(0)


@dataclass(frozen=True, slots=True)
class Prepared:
    """A structure with options for records of some lengths, steps and channels.

    Attributes
    ----------
    core : Fitter, JointFitter or Stream
    layout : Layout
    intervals : tuple of int
        Sampling intervals used, a record.
    outputs : tuple of ndarray (output, time)
        Of each record, masked samples interpolated; empty for a batch.
    blinds : tuple of ndarray (output, time) or None
        Samples of each record that tell nothing, None where there are none; empty as `outputs` is.
    """

    core: Any
    layout: Layout
    intervals: tuple[int, ...]
    outputs: tuple[F64, ...] = ()
    blinds: tuple[NDArray[np.bool_] | None, ...] = ()


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
        even = True
    else:
        first = data[0]
        sampling = tuple([(rec.y.shape[1], rec.t if rec.dt is None else rec.dt) for rec in data])
        even = _even(options, data)
    layout = structure.layout(first.outputs, first.inputs)
    if not (layout.plain and options.plain_noise and even):
        return _joint(layout, options, data, forms_of(data), sampling)
    if _jumps_late(layout, options, data):
        refuse_known_start(options)
    if options.initial_state == "periodic":
        refuse_open_periods(first.inputs, [data.u] if isinstance(data, Batch) else [rec.u for rec in data])
    short = sum([samples for samples, _ in sampling]) <= LONGEST
    kept = isinstance(data, Batch) or all([rec.dt is not None for rec in data])
    make = _kept if short and kept else _made
    return make(layout, options, forms_of(data), sampling)


def counts_start(structure: Any, options: Options, data: Batch | Sequence[Record]) -> bool:
    """Whether the core knows the initial states of such fits, as of transfer functions of one output."""
    if not isinstance(structure, TransferFunction):
        return False
    first = data if isinstance(data, Batch) else data[0]
    layout = structure.layout(first.outputs, first.inputs)
    told = options.initial_state
    drifts = isinstance(told, str) and told in ("rest", "zero") and options.fitted_trend == "linear"
    plain = layout.plain and not drifts and not _jumps_late(layout, options, data)
    return plain and options.plain_noise and (isinstance(data, Batch) or _even(options, data))


def fits_alone(data: Batch | Sequence[Record], structure: Any, options: Options) -> bool:
    """Whether records of one kind are fitted one by one, because the core has no batch of such fits.

    Options ask for more than least squares, or noise drives a transfer function some coefficients of which
    are held, bounded or known.
    """
    if not options.is_plain:
        return True
    if not (options.drives and isinstance(structure, TransferFunction)):
        return False
    first = data if isinstance(data, Batch) else data[0]
    return not structure.layout(first.outputs, first.inputs).plain


def _jumps_late(layout: Layout, options: Options, data: Batch | Sequence[Record]) -> bool:
    """Whether delayed inputs jump from zero at the first sample, which the core counts as their past."""
    if options.initial_state != "zero":
        return False
    late = [k for k, delay in enumerate(layout.delays(_NOTHING)) if delay]
    us = [data.u] if isinstance(data, Batch) else [rec.u for rec in data]
    return any(np.any(u[..., late, 0]) for u in us)


def _even(options: Options, data: Sequence[Record]) -> bool:
    # Uneven steps alone refuse no option that needs the plain path.
    able = options.initial_state == "unknown" and options.noise == "output"
    own = [rec for rec in data if able or rec.mask is not None or rec.sigma is not None]
    return not any([weighs(rec) for rec in own])


def prepare_stream(
    structure: TransferFunction,
    options: Options,
    channels: tuple[tuple[str, ...], ...],
    intervals: int,
    dt: float,
    weights: Sequence[float],
) -> Prepared:
    """What the fits of a stream share; `channels`: outputs, inputs, how these go between samples.

    The last `intervals` of it are fitted, and as many before them for each further weight, that of their
    squared residuals. Delays are known, noise is white or given by numbers.
    """
    options.refuse_alone("Stream")
    if options.initial_state != "unknown":
        raise SpecError(
            f"Stream: initial_state={options.initial_state!r} is for whole records, and a stream forgets "
            "its start"
        )
    outputs, inputs, intersample = channels
    layout = structure.layout(outputs, inputs)
    late = layout.longest_delay
    samples = intervals + 1 + (0 if late == 0 else ceil(late / dt - 1e-9))
    forms = (intersample,)
    words = plain_words(layout, forms, options)
    if not (layout.plain and options.plain_noise):
        words = joint_words(layout, forms, options) | weighting(layout, options, (), ())
    remembered = samples + (len(weights) - 1) * intervals
    factors = [weight**0.5 for weight in weights]
    core = Stream(len(outputs) + len(inputs), remembered, samples, dt, factors, **words)
    return Prepared(core, layout, (intervals,))


def refuse_known_start(options: Options) -> None:
    """Refuse a known initial state where fits cannot count it.

    Raises
    ------
    SpecError
    """
    if options.initial_state != "unknown":
        raise SpecError(
            f"fit: initial_state={options.initial_state!r} is for transfer functions of one output in white "
            "noise here, without free delays, masks, sigma and inputs that jump from zero behind a delay; "
            'mf.fit and mf.fit_many fit the rest from initial_state="rest" and "zero"'
        )


def refuse_process_noise(options: Options, layout: Layout | None = None) -> None:
    """Refuse noise inside the system where fits cannot tell it; `layout`: of records without masks and sigma.

    Raises
    ------
    SpecError
    """
    able = layout is not None and len(layout.outputs) == 1 and not layout.free_delays
    if options.drives and not (able and options.noise == "process"):
        raise SpecError(
            'fit: noise="process" is for transfer functions of one output without free delays, masks and '
            "sigma (in a study also without held or bounded coefficients), and for an Equation or StateSpace "
            'that measures all its states; write several outputs so, or take noise="output"'
        )


def refuse_open_periods(names: tuple[str, ...], us: Sequence[F64]) -> None:
    """Refuse inputs (…, input, time) whose last sample is not where the first one is.

    Raises
    ------
    DataError
    """
    for u in us:
        gaps = np.abs(u[..., -1] - u[..., 0]) / np.maximum(np.ptp(u, axis=-1), 1e-300)
        far = np.argwhere(gaps > OPEN)
        if len(far):
            k = tuple(far[0])
            raise DataError(
                f"fit: initial_state='periodic', but input {names[k[-1]]!r} begins at {u[k][0]:.4g} and ends "
                f"at {u[k][-1]:.4g}: cut whole periods with rec.window, its last sample in the phase of the "
                "first"
            )


def refuse_standing(
    layout: Layout, ys: Sequence[F64], us: Sequence[F64], initial_state: Any = "unknown"
) -> None:
    """Refuse records (outputs and inputs (channel, time)) in which a channel that counts never moves.

    From an initial state that is known, an input that stands tells its gain all the same.

    Raises
    ------
    DataError
    """
    for k, name in enumerate(layout.outputs):
        if all([_stands(y[k]) for y in ys]):
            raise DataError(
                f"fit: output {name!r} stands at {ys[0][k, 0]:g} throughout, so nothing can be learnt "
                "from it: take a record in which it moves"
            )
    if initial_state == "zero" or not isinstance(initial_state, str):
        return
    for k, name in enumerate(layout.inputs):
        if not any([row[k] is not None for row in layout.numerators]):
            continue
        if all([_stands(u[k]) for u in us]):
            left = [other for other in layout.inputs if other != name]
            raise DataError(
                f"fit: input {name!r} stands at {us[0][k, 0]:g} throughout, so nothing can be "
                f"learnt from it: leave it out with rec.select(inputs={left}), or take a record in which "
                "it moves (of a step test, from before the step; if the step came at the first sample, at "
                'rest, give initial_state="zero", with inputs and outputs as deviations from the operating '
                "point before the step)"
            )
        if initial_state == "unknown" and all([_stands(u[k, 1:]) or _stands(u[k, :-1]) for u in us]):
            raise DataError(
                f"fit: input {name!r} stands at {us[0][k, 1]:g} but for one sample at an end, so its gain "
                "cannot be told from an unknown initial state: of a record that begins at rest, give "
                'initial_state="rest" (before a step) or "zero" (an impulse at the first sample), or take '
                "a record in which the input moves"
            )


def refuse_cut_off(layout: Layout, ts: Sequence[F64], us: Sequence[F64]) -> None:
    """Refuse records (times; inputs (input, time)) whose inputs stand where free delays leave the window.

    It begins as late as the longest delay may be.

    Raises
    ------
    DataError
    """
    most = layout.longest_delay
    for at in layout.free_delays:
        path = layout.paths[at]
        least = max(path.delay.min, 0.0)  # type: ignore[union-attr]
        seen = [
            u[path.input, t >= t[0] + most - least - ROUNDING * t[-1]] for t, u in zip(ts, us, strict=True)
        ]
        if not all([_stands(u) for u in seen]):
            continue
        moves = [np.flatnonzero(np.diff(u[path.input])) for u in us]
        last, still = max(
            (t[k[-1] + 1] - t[0], t[k[-1]] - t[0]) for t, k in zip(ts, moves, strict=True) if k.size
        )
        raise DataError(
            f"fit: input {layout.inputs[path.input]!r} moves for the last time at {last:.4g} s, and delays "
            f"of up to {most:g} s leave only the samples from {most:g} s on, in which a delay of {least:g} s "
            f"shows none of it: give max= of at most {still + least:.4g} s, or, for a record that begins at "
            'rest, initial_state="rest"'
        )


def _stands(values: F64) -> bool:
    first = values.item(0)
    # As a rule the end or the middle differs, which is said at once.
    return first == values.item(-1) == values.item(values.size // 2) and bool(np.ptp(values) == 0)


def _made(layout: Layout, options: Options, forms: Forms, sampling: tuple[tuple[int, Any], ...]) -> Prepared:
    """As `prepare`; `sampling` holds the number of samples and the step (uneven: the times) a record."""
    intervals = _intervals(layout, sampling)
    core = Fitter(
        [samples for samples, _ in sampling],
        [step for _, step in sampling],
        **plain_words(layout, forms, options, len(sampling)),
    )
    return Prepared(core, layout, intervals)


_kept = lru_cache(KEPT)(_made)


def plain_words(layout: Layout, forms: Forms, options: Options, records: int = 1) -> dict[str, Any]:
    """Keywords of the core for a layout that is plain."""
    return {
        "order": layout.orders[0],
        "numerators": layout.numerators[0],
        "delays": layout.delays(_NOTHING),
        "intersample": forms,
        "states": options.states(records),
        **options.core(),
    }


def joint_words(layout: Layout, forms: Forms, options: Options) -> dict[str, Any]:
    """Keywords of the core for any layout, noise aside.

    Raises
    ------
    SpecError
        For a delay that the samples cannot tell.
    """
    for intersample in forms:
        _refuse_hidden_delay(layout, intersample)
    words = {**layout.core(), "intersample": forms, **options.core()}
    del words["noise"]
    return words


def _refuse_hidden_delay(layout: Layout, intersample: tuple[str, ...]) -> None:
    """A held input that acts at once steps between two samples, which do not tell where."""
    for order, routes, degrees in zip(layout.orders, layout.routes, layout.numerators, strict=True):
        for kind, path, degree in zip(intersample, routes, degrees, strict=True):
            if kind == "zoh" and degree == order and path in layout.free_delays:
                own = layout.paths[path]
                raise SpecError(
                    f"fit: {own.name} is to be estimated, but {layout.inputs[own.input]} is held between "
                    "samples and acts at once (as many zeros as poles): with other delays within a sampling "
                    "interval and other numerators the samples are the same. Give the delay, take fewer "
                    'zeros, or declare the input intersample="smooth" if it is not held'
                )


def _joint(
    layout: Layout,
    options: Options,
    data: Batch | Sequence[Record],
    forms: Forms,
    sampling: tuple[tuple[int, Any], ...],
) -> Prepared:
    refuse_known_start(options)
    even = not isinstance(data, Batch) and not any([weighs(rec) for rec in data])
    refuse_process_noise(options, layout if even else None)
    intervals = _intervals(layout, sampling)
    if isinstance(data, Batch):
        # Some of its records say how much noise there is; where that is told, one stands for all.
        looked_at = min(len(data), LOOKED_AT if options.noise == "errors-in-variables" else 1)
        records = list(islice(data._finite(), looked_at)) or [data[0]]
        used = intervals * len(records)
    else:
        records, used = list(data), intervals
    order = max(layout.orders)
    # A batch has no masks.
    filled = [] if isinstance(data, Batch) else [(rec, *bridged(rec)) for rec in data]
    uneven = [variances(rec, off, noise, order) for rec, _, off, noise in filled] or [None]
    core = JointFitter(
        [samples for samples, _ in sampling],
        [step for _, step in sampling],
        uneven,
        **weighting(layout, options, records, used),
        **joint_words(layout, forms, options),
    )
    blinds = tuple(blind(rec, v) for (rec, *_), v in zip(filled, uneven, strict=False))
    return Prepared(core, layout, intervals, outputs=tuple(y for _, y, _, _ in filled), blinds=blinds)


def refuse_uneven(late: float, times: F64) -> NoReturn:
    """Refuse a delay of a record with uneven steps; a clock that was only rounded is named first."""
    even = rounded_step(times)
    clock = f"if its clock was only rounded, give dt={even:.6g} instead of the times; else " if even else ""
    raise DataError(
        f"fit: a delay of {late:g} s needs even sampling, and the record's steps are uneven; {clock}"
        f"make it even, rec.resample({grid_step(times):.6g}), or leave the delay out; of doses at few "
        'samples shift the rows instead, and compare several lags (page "Doses and blood samples"). A held '
        "input is taken to step where its rows do: where it stepped between rows, add masked rows at these "
        "times first, or the delay is off by as much"
    )


def spans(layout: Layout, records: Sequence[Record]) -> tuple[int, ...]:
    """Sampling intervals of each record that a fit uses."""
    return _intervals(layout, tuple((rec.y.shape[1], rec.dt or rec.t) for rec in records))


def _intervals(layout: Layout, sampling: tuple[tuple[int, Any], ...]) -> tuple[int, ...]:
    late = layout.longest_delay
    return tuple(samples - 1 - (0 if late == 0 else _lead(late, samples, step)) for samples, step in sampling)


def _lead(late: float, samples: int, step: Any) -> int:
    """Samples by which the window starts late."""
    if not isinstance(step, float):
        refuse_uneven(late, step)
    duration = (samples - 1) * step
    if late >= duration / 2:
        raise DataError(
            f"fit: the delay of {late:g} s leaves less than half of the record of {duration:g} s; "
            "delays are in seconds"
        )
    return ceil(late / step - 1e-9)
