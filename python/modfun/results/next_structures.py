"""What to try first where residuals of a transfer function follow an input: structures next to it."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, isfinite, isnan, pi
from typing import Any

from ..base.between import BY_FIT, MIXED
from ..base.cached import kept
from ..models.free import Free
from ..models.options import Options
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from .cures import CLOSE, ENOUGH, WORTH, Cure, again, as_declared, bic_beside, on_band, otherwise, with_drift
from .diagnosis import growth, level_p
from .estimates import Estimates
from .fitted_samples import measured_lines, stationary
from .line_tests import colour_of_lines, correlation_of_lines
from .rewritten import in_words, rewritten

__all__ = ["best_cure", "settles"]

MOST_POLES = 6  # of an output; more than that is a matter for `select_order`
RADIAN = 0.5  # of the highest line: delays tried first are so far apart,
BEYOND = 10  # and so many of them later than the best one


@kept
def best_cure(fit: Estimates, output: int, channel: str | None) -> Cure | None:
    """The neighbouring structure, or hold of the input, whose fit lowers BIC most; None where none pays.

    Without a channel: of free motion, which has poles only.
    """
    if fit.again is None or fit.records is None or not isinstance(fit.structure, TransferFunction):
        return None
    before = bic_beside(fit, fit)
    found: Cure | None = None
    options = on_band(fit, fit.band)
    near = _poles(fit, output) if channel is None else _neighbours(fit, output, fit.inputs.index(channel))
    for words, records, structure in near:
        if words.startswith("more zeros") and found and found.level_p > ENOUGH:
            continue  # what acts at once can do what a delay does
        if options.reference and records is fit.records:
            rough = _roughly(fit, structure, options)
            if rough is None or not bic_beside(rough, fit) < (found.after if found else before):
                continue
        other = again(fit, records, structure, options)
        if other is None or growth(other) > 0 >= growth(fit):  # unstable where the fit is stable
            continue
        after = bic_beside(other, fit)
        # Poles can do what a delay does, or a zero: they have to do more than one that leaves noise alone.
        margin = CLOSE if found and found.level_p < ENOUGH else WORTH
        if isfinite(after) and after < (found.after if found else before) - margin:
            delay = [name for name in other.param_names if name.startswith("delay")]
            late = f" ({other[delay[-1]]:.3g} s)" if "delay" in words and delay else ""
            found = Cure(words + late, before, after, level_p(other), other)
    # Poles follow a drift, too.
    drift = with_drift(fit) if found and "poles=" in found.words and fit.trend == "constant" else None
    return drift if found and drift and drift.after < found.after else found


def settles(cure: Cure) -> bool:
    """Whether a structure leaves noise alone: by its level, or beside masks, which show none, its lines."""
    fit = cure.fit
    if fit is None or not isnan(cure.level_p) or stationary(fit) or not measured_lines(fit):
        return cure.level_p > ENOUGH
    tests = (colour_of_lines, correlation_of_lines)
    rows = [[piece[i] for piece in fit.pieces] for i in range(len(fit.row_names))]
    return all(test(row)[0].p_value > ENOUGH for test in tests for row in rows)


def _roughly(fit: Estimates, structure: Any, options: Options) -> Estimates | None:
    """The fit of another structure; of one with a reference on the record in which its rounds ended.

    Rounds of its own are seven fits or more, and most structures next to a right one lower nothing.
    """
    if options.reference and fit.instrumented is not None:
        return again(fit, fit.instrumented, structure, options.replace(reference=()))
    return again(fit, fit.records, structure, options)


def _neighbours(
    fit: Estimates, output: int, channel: int
) -> Iterator[tuple[str, tuple[Record, ...], TransferFunction]]:
    """Changes in words, the records and the structure with that change; the most likely ones first."""
    name, layout = fit.inputs[channel], fit.layout
    records: tuple[Record, ...] = fit.records or ()
    degrees: list[list[Any]] = [list(row) for row in layout.numerators]
    path = degrees[output][channel]
    several = len(fit.inputs) > 1
    of = f" of {name}" if several else ""
    if path is None:
        degrees[output][channel] = layout.orders[output] - 1
        words = f"a path from {name} to {fit.outputs[output]}, zeros={in_words(degrees)}"
        yield words, records, rewritten(fit, zeros=degrees)
        return
    for word in ("zoh", "smooth", "foh"):
        if fit.intersample[channel] not in (word, MIXED):
            changed = tuple(otherwise(rec, channel, word) for rec in records)
            yield f"{as_declared(fit, changed[0].intersample)} in the record", changed, fit.structure
    if fit.intersample[channel] == "zoh" or records[0]._seen.get(name) == BY_FIT:
        words = f"{name} a sample earlier, since it acts in its own sample (y[:-1] with {name}[1:])"
        yield words, tuple(_earlier(rec, channel) for rec in records), fit.structure
    delays = [[layout.paths[route].delay for route in row] for row in layout.routes]
    known = delays[output][channel]
    if not isinstance(known, Free):
        for late in _likeliest_delay(fit, delays, output, channel):
            delays[output][channel] = late
            yield f"a delay{of}, delay={in_words(delays)}", records, rewritten(fit, delay=delays)
    for degree in range(path + 1, layout.orders[output] + 1):  # as many as poles: an accelerometer
        more = [list(row) for row in degrees]
        more[output][channel] = degree
        count = "one more zero" if degree == path + 1 else "more zeros"
        yield f"{count}{of}, zeros={in_words(more)}", records, rewritten(fit, zeros=more)
    yield from _poles(fit, output)


def _likeliest_delay(
    fit: Estimates, delays: list[list[Any]], output: int, channel: int
) -> tuple[Free, float] | tuple[()]:
    """Bounds about the delay of a path that suits best, and that delay; nothing where none suits better.

    Delays in whole samples are tried one by one, coarsely first: a free one that starts far away ends in
    another minimum, and loses the samples of the longest delay that it may be.
    """
    known, omega = delays[output][channel], fit.band[1]
    dt = max(rec.dt or rec.duration / rec.intervals for rec in fit.records or ())
    # Up to two periods of the highest line, or an eighth of the record: later ones are not next door.
    most = int(min(4 * pi / omega, *(2 * pi / w / 8 for w in fit.omega0)) / dt)
    options, step = on_band(fit, fit.band), max(1, int(RADIAN / omega / dt))
    scores = {0: bic_beside(fit, fit)}

    def score(k: int) -> None:
        late = [list(row) for row in delays]
        late[output][channel] = known + k * dt
        other = _roughly(fit, rewritten(fit, delay=late), options)
        scores[k] = bic_beside(other, fit) if other is not None else inf

    best = 0
    for k in range(step, most + 1, step):
        score(k)
        best = min(scores, key=scores.__getitem__)
        if k - best >= BEYOND * step:
            break
    for k in range(max(best - step, 0) + 1, best + step):
        if k not in scores:
            score(k)
    best = min(scores, key=scores.__getitem__)
    if not best:
        return ()
    low, mid, high = (float(f"{known + k * dt:.3g}") for k in (max(best - 1.5, 0.0), best, best + 1.5))
    return Free(min=low, max=high), mid


def _earlier(rec: Record, channel: int) -> Record:
    """The record with a held input a sample earlier, and so a sample shorter."""
    short = rec.window(rec.t[0], rec.t[-2])
    u, kinds = short.u.copy(), list(rec.intersample)
    u[channel], kinds[channel] = rec.u[channel, 1:], "zoh"
    return short._like(u=u, intersample=tuple(kinds))


def _poles(fit: Estimates, output: int) -> Iterator[tuple[str, tuple[Record, ...], TransferFunction]]:
    """The structure with one or two more poles, and as many more zeros."""
    layout, records = fit.layout, fit.records or ()
    degrees = [list(row) for row in layout.numerators]
    for extra in (1, 2):
        poles: Any = [n + extra if layout.common or i == output else n for i, n in enumerate(layout.orders)]
        if max(poles) > MOST_POLES:
            continue
        told = poles[0] if layout.common or len(poles) == 1 else poles
        words = "one more pole" if extra == 1 else "two more poles"
        if not fit.inputs:
            yield (
                f"{words}, poles={told}",
                records,
                TransferFunction(poles=told, denominator=fit.structure.denominator),
            )
            continue
        yield f"{words}, poles={told}, zeros={in_words(degrees)}", records, rewritten(fit, poles=told)
        wider = [
            [None if d is None else d + extra for d in row] if layout.common or i == output else row
            for i, row in enumerate(degrees)
        ]
        shown = f"{words}, poles={told}, zeros={in_words(wider)}"
        yield shown, records, rewritten(fit, poles=told, zeros=wider)
