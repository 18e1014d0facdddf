"""Outputs that are slower than their record: held between the samples of a sensor, or drawn as lines."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64
from .samples import Samples
from .words import left_out

__all__ = ["changes", "drawn", "held", "slow_samples"]

SLOWEST = 50  # samples, at most, from one measured value to the next
KNOTS = 10, 0.5  # of the measured values, at least, and the part of them, that show: a change, or an angle
BRIDGED = 6  # samples from one that counts to the next, at most, of which a mask makes good estimates


def changes(values: F64) -> NDArray[np.bool_]:
    """Whether each sample but the first differs from the one before."""
    return np.abs(np.diff(values)) > 1e-9 * float(np.ptp(values))


def held(values: F64) -> tuple[int, int]:
    """How many samples lie from one measured value to the next, and the first; (1, 0) if all are measured."""
    return _grid(np.flatnonzero(changes(values)) + 1, values.size)


def drawn(values: F64) -> tuple[int, int]:
    """The same of values between which lines were drawn."""
    bend = np.abs(np.diff(values, 2))
    return _grid(np.flatnonzero(bend > 1e-9 * float(np.ptp(values))) + 1, values.size)


def _grid(places: NDArray[np.intp], samples: int) -> tuple[int, int]:
    least, part = KNOTS
    if places.size < least:
        return 1, 0
    step = int(np.gcd.reduce(np.diff(places)))
    if not 1 < step <= SLOWEST or places.size < part * samples / step:
        return 1, 0
    return step, int(places[0]) % step


def slow_samples(record: Samples, name: str) -> Iterator[str]:
    """Say that an output is slower than its record, unless only its own samples count."""
    for (step, first), seen in (
        (
            held(record[name]),
            "has a new value only every {} sample and repeats it, as a slower sensor does",
        ),
        (drawn(record[name]), "consists of straight lines between every {} sample, as of a slower record"),
    ):
        others = np.arange(record.t.size) % step != first
        if step == 1 or not record._good(name)[others].any():
            continue
        moved = [np.flatnonzero(changes(record[u])) + 1 for u in record.inputs]
        if any(2 * step * at.size > record.t.size and not others[at].any() for at in moved):
            continue  # the response to an input that is held as long
        cure = left_out(record, name, f"np.arange(rec.t.size) % {step} == {first}")
        if step > BRIDGED:
            own = f"[:, {first}::{step}]"
            cure = (
                f"take these samples of all channels, mf.Record(y=rec.y{own}, u=rec.u{own}, dt={step} * "
                "rec.dt, outputs=rec.outputs, inputs=rec.inputs)"
            )
        yield (
            f"Output {name!r} {seen.format(_ordinal(step))}: the samples between are no measurements. "
            f"First {cure}."
        )


def _ordinal(number: int) -> str:
    teens = number % 100 in (11, 12, 13)
    return f"{number}{'th' if teens else {1: 'st', 2: 'nd', 3: 'rd'}.get(number % 10, 'th')}"
