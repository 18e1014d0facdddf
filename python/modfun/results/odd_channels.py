"""Channels of one record that have another scale or time than the fit of other records predicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..errors import ModfunError
from ..records.mask import sample_weights
from ..records.record import Record
from .doubts import Doubt
from .estimates import Estimates
from .factors import turned, unit_of
from .regression import rms
from .shifts import earlier_by

__all__ = ["Change", "left_of", "likeliest_change", "told", "told_both", "votes"]

OTHER = 0.03  # relative: a factor closer to 1 is none
SIGMAS = 4.0  # standard errors, the same of a factor and of a time
MOST = 16  # samples that a channel may be late or early
FAINT = 30.0  # times the error of a change: records that know its channel so badly have no vote
TINY = 1e-300
STEPS = 3  # in which the time is found from the nearest sample


@dataclass(frozen=True)
class Change:
    """A channel of a record that is a factor of what others predict, or late by so many seconds (early: < 0).

    Attributes
    ----------
    record : int
    channel : str
    factor, late : float
        One of them is as predicted, 1 or 0.
    error : float
        Standard error of the other.
    step : float
        Of the record, s.
    """

    record: int
    channel: str
    factor: float
    late: float
    error: float
    step: float

    @property
    def size(self) -> float:
        """The factor without its sign, or that of a unit."""
        unit = unit_of(self.factor)
        return unit[0] if unit else 1.0 if turned(self.factor) else abs(self.factor)

    @property
    def clear(self) -> bool:
        """Whether it is one at all; of a channel that does not move the factor may be any."""
        if self.late:
            return abs(self.late) > SIGMAS * self.error
        known = abs(self.factor) > SIGMAS * self.error
        return known and abs(self.factor - 1) > max(OTHER, SIGMAS * self.error)

    def undone(self, rec: Record) -> Record:
        """The record as the others predict it."""
        if self.late:
            return self._moved(rec)[1]
        return rec.assign(**{self.channel: rec[self.channel] / np.copysign(self.size, self.factor)})

    def _moved(self, rec: Record) -> tuple[str, Record]:
        near = round(self.late / self.step) * self.step
        whole = bool(near) and abs(self.late - near) < max(2 * self.error, 0.1 * self.step)
        words, (moved,) = earlier_by((rec,), self.channel, near if whole else self.late, whole=whole)
        return words, moved

    @property
    def unit(self) -> bool:
        """Whether the factor is that of a unit."""
        return unit_of(self.factor) is not None

    def inverse(self, record: int) -> Change:
        """The change of a record with the same channel that makes both alike as well."""
        error = self.error if self.late else self.error / self.factor**2
        return replace(self, record=record, factor=1 / self.factor, late=-self.late, error=error)

    def same(self, other: Change) -> bool:
        """Whether it is that of another record, too."""
        near = abs(self.size / other.size - 1) < OTHER and self.factor * other.factor > 0
        return self.channel == other.channel and near and abs(self.late - other.late) < self.step / 2

    def seen(self, where: str) -> str:
        """What was seen in these records."""
        name = f"{self.channel} of {where}"
        if self.late:
            return (
                f"{name} seems to be recorded {abs(self.late):.3g} ± {self.error:.2g} s "
                f"({abs(self.late) / self.step:.2g} samples) {'late' if self.late > 0 else 'early'} beside "
                "what the rest of the list predicts"
            )
        unit = unit_of(self.factor)
        words = ["of the opposite sign"] if self.factor < 0 else []
        if not turned(self.factor):
            words += [
                f"{self.size:.3g} times what the rest of the list predicts ({abs(self.factor):.4g} ± "
                f"{self.error:.2g}){f', {unit[1]}' if unit else ''}"
            ]
        return f"{name} is {' and '.join(words)}"

    def cure(self, rec: Record, name: str) -> str:
        """The change of the record of that name that undoes it."""
        if self.late:
            return self._moved(rec)[0].replace("rec.", f"{name}.").replace("rec[", f"{name}[")
        size = "" if self.size == 1 else f"/{self.size:.4g}" if self.size > 1 else f"*{1 / self.size:.4g}"
        minus = "-" if self.factor < 0 else ""
        return f"{name}.assign({self.channel}={minus}{name}[{self.channel!r}]{size})"


def told(fit: Estimates, changes: Sequence[Change]) -> Doubt:
    """The channels in words, with the change of the records."""
    if len(changes) > 1 and all([one.same(changes[0]) for one in changes]):
        where = _of_all([one.record for one in changes])
        text = f"{changes[0].seen(where)}. First try {_cure(fit, changes, 'these')}"
    else:
        text = "; ".join([one.seen(f"record {one.record}") for one in changes]) + ". First try "
        text += ", ".join([_cure(fit, [one]) for one in changes])
    return Doubt(f"{text}{_or_inverse(fit, changes[0])}.")


def told_both(
    fit: Estimates, changes: Sequence[Change], others: Sequence[Change], silent: Sequence[int] = ()
) -> Doubt:
    """The same of two groups of as many records, of which either may be changed.

    `silent`: records in which the channel moves too little to tell.
    """
    here, there = (_of_all([own.record for own in group]) for group in (changes, others))
    one = changes[0]
    pair = len(changes) == 1
    cures = [_cure(fit, changes), _cure(fit, others)]
    if turned(one.factor):
        text = f"{one.channel} of {here} and {one.channel} of {there} are of opposite signs"
        cures[1] = f"the same of {there}"
    else:
        text = one.seen(here).replace("the rest of the list predicts", f"{there} predict{'s' * pair}")
    open_ = "two records do not tell which is wrong" if pair else "as many do not tell which are wrong"
    if silent:
        open_ += f" (in {_of_all(silent)} {one.channel} moves too little to say)"
    return Doubt(
        f"{text}, and {open_}; the wrong change would pass in silence. First see the wiring, the calibration "
        f"or other manoeuvres; then {' or '.join(cures)}{_or_inverse(fit, one)}."
    )


def _of_all(records: Sequence[int]) -> str:
    """The records in words."""
    *first, last = map(str, records)
    return f"records {', '.join(first)} and {last}" if first else f"record {last}"


def _cure(fit: Estimates, changes: Sequence[Change], where: str = "") -> str:
    """One change of a record or of several."""
    first, records = changes[0], fit.records or ()
    name = f"records[{first.record}]" if len(changes) == 1 else "rec"
    words = first.cure(records[first.record], name)
    return words if len(changes) == 1 else f"{words} for {where or _of_all([one.record for one in changes])}"


def _or_inverse(fit: Estimates, change: Change) -> str:
    """The channel that does the same in all that a record of two tells."""
    if not len(fit.outputs) == len(fit.inputs) == 1:
        return ""
    other = next(name for name in (*fit.outputs, *fit.inputs) if name != change.channel)
    return f"; the inverse change of {other} would do the same"


def likeliest_change(base: Estimates, rec: Record, k: int) -> Change | None:
    """The change of one channel of record `k` that explains best what a fit of other records does not."""
    channels = _channels(base, rec)
    if channels is None or rec.dt is None:
        return None
    rows, every = channels[0], channels[1][0].response
    plain = [row.left(every[row.at]) for row in rows]
    found = list[tuple[float, Change]]()
    for one in channels[1]:
        others = sum(plain[row.at] for row in rows if row not in one.rows)
        (f, error, left), (late, off, moved) = _fitted(one.rows, one.response, one.rest)
        size = error if one.power > 0 or not f else error / f**2
        scaled = Change(k, one.name, f if one.power > 0 else 1 / f, 0.0, size, rec.dt) if f else None
        found.extend((round(others + left, 2), own) for own in (scaled,) if own and own.clear)
        shifted = Change(k, one.name, 1.0, one.power * late, off, rec.dt)
        found.extend((round(others + moved, 2), own) for own in (shifted,) if own.clear)
    # Of those that do the same the first is named.
    return min(found, key=lambda pair: pair[0], default=(inf, None))[1]


def votes(base: Estimates, rec: Record, change: Change) -> bool:
    """Whether a record that a fit explains contradicts the change of another one as a change of the fit.

    It has to agree with the fit on the channel's factor or time, and to know it about as well as the other
    does: a channel that stands still but for its noise says nothing.
    """
    channels = _channels(base, rec)
    if channels is None:
        return False
    one = next(own for own in channels[1] if own.name == change.channel)
    (f, error, _), (late, off, _) = _fitted(one.rows, one.response, one.rest)
    seen, usual, other = f, 1.0, change.factor**one.power
    if change.late:
        seen, usual, other, error = late, 0.0, one.power * change.late, off
    agrees, clear = abs(seen - usual) < SIGMAS * error, abs(other - usual) > 2 * SIGMAS * error
    faint = FAINT * change.error / (1.0 if change.late else abs(change.factor))
    return agrees and clear and error < faint


def left_of(base: Estimates, rec: Record) -> float:
    """The logarithm of what a fit of other records leaves of one, over its outputs; infinite without one."""
    moved = _responses(base, rec)
    if moved is None:
        return inf
    every, free = moved[0].sum(axis=0), moved[1]
    return sum(_Row(rec, i, free[:, i]).left(every[i]) for i in range(len(rec.y)))


@dataclass(frozen=True)
class _Channel:
    """A channel with the response that its change scales or shifts, the rest, and the outputs with these.

    `power`: 1 of an output and -1 of an input: all outputs late beside an input, that is early beside them.
    """

    name: str
    rows: Sequence[_Row]
    response: F64
    power: int
    rest: F64 | float


def _channels(base: Estimates, rec: Record) -> tuple[Sequence[_Row], Sequence[_Channel]] | None:
    """The outputs of a record, and its channels beside what a fit predicts."""
    moved = _responses(base, rec)
    if moved is None:
        return None
    forced, free = moved
    every = forced.sum(axis=0)
    rows = [_Row(rec, i, free[:, i]) for i in range(len(rec.y))]
    found = [_Channel(name, [row], every, 1, 0.0) for row, name in zip(rows, base.outputs, strict=True)]
    inputs = zip(base.inputs, forced, strict=True)
    return rows, [*found, *(_Channel(name, rows, own, -1, every - own) for name, own in inputs)]


class _Row:
    """An output without what its own free response and offset explain, which know no scale of others."""

    def __init__(self, rec: Record, at: int, free: F64) -> None:
        self.at, self.t = at, rec.t
        self.weight = sample_weights(rec.mask, rec.sigma, rec.y.shape)[at]
        self.q = np.linalg.qr((free * self.weight).T)[0]
        self.y = self.of(rec.y[at])
        self.df = max(int(np.count_nonzero(self.weight)) - len(free) - 1, 1)

    def of(self, values: F64) -> F64:
        own = values * self.weight
        return np.asarray(own - self.q @ (self.q.T @ own))

    def left(self, response: F64) -> float:
        """The logarithm of what a response leaves."""
        return float(np.log(rms(self.y - self.of(response)) or TINY))


def _responses(base: Estimates, rec: Record) -> tuple[F64, F64] | None:
    """What a fit predicts of the outputs: responses to each input, to each state at first, and 1.

    Shapes (input, output, time) and (state + 1, output, time); None where there is no such sum.
    """
    bare: Any = replace(base, options=base.options.replace(trend=None))
    still = rec._like(u=np.zeros_like(rec.u))
    states = sum(base.layout.orders) if base.layout.rational else len(bare.state_names)
    nothing = np.zeros(states)
    try:
        none = bare.simulate(still, nothing)[0]
        free = [bare.simulate(still, unit)[0] - none for unit in np.eye(states)]
        forced = []
        for j in range(len(rec.u)):
            u = np.zeros_like(rec.u)
            u[j] = rec.u[j]
            forced.append(bare.simulate(rec._like(u=u), nothing)[0] - none)
    except ModfunError:
        return None
    rows = np.array(forced), np.array([*free, np.ones_like(rec.y)])
    return rows if forced and all([np.all(np.isfinite(row)) for row in rows]) else None


def _fitted(
    rows: Sequence[_Row], response: F64, rest: F64 | float
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """The factor of a response beside others, and by how much it is late, s: value, error, what is left."""
    t, step = rows[0].t, float(rows[0].t[1] - rows[0].t[0])
    known = [row.y - row.of(np.broadcast_to(rest, response.shape)[row.at]) for row in rows]
    scaled = [(y, row.of(response[row.at]), row.df) for row, y in zip(rows, known, strict=True)]
    factor = _mean(scaled)

    def late(by: float) -> list[tuple[F64, F64, int]]:
        shifted = [np.interp(t - by, t, response[row.at]) for row in rows]
        parts = zip(rows, known, shifted, strict=True)
        return [(y - row.of(w), row.of(-np.gradient(w, t)), row.df) for row, y, w in parts]

    def left(by: float) -> float:
        return sum(float(np.log(rms(e) or TINY)) for e, _, _ in late(by))

    best = min(range(-MOST, MOST + 1), key=lambda k: left(k * step)) * step
    for _ in range(STEPS):
        by, off = _mean(late(best))
        best += by
    kept = sum(float(np.log(rms(y - factor[0] * w) or TINY)) for y, w, _ in scaled)
    return (*factor, kept), (best, off, left(best))


def _mean(parts: Sequence[tuple[F64, F64, int]]) -> tuple[float, float]:
    """The coefficient of columns that series share, each with a level of noise of its own, and its error."""
    sums, weights = 0.0, 0.0
    for y, column, df in parts:
        square = float(column @ column)
        if square > 0:
            along = float(column @ y)
            variance = max(float(y @ y) - along**2 / square, TINY * float(y @ y)) / df
            sums, weights = sums + along / variance, weights + square / variance
    return (sums / weights, weights**-0.5) if weights > 0 else (0.0, inf)
