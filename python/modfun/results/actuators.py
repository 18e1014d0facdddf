"""Actuators that do not pass on what the record holds: slow, loose, sticking or limited ones.

Behind a servo with a rate limit all estimates are those of no system, and residuals follow no power of any
signal. Each way in which an actuator may change a command has one unknown, of which a few values are tried by
fits of the same structure; a servo has a lag beside its rate, and equations tell when a command changed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import accumulate, product
from math import exp, inf, isfinite, log, pi
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.cached import kept
from ..base.names import listed
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from .cures import (
    CLOSE,
    ENOUGH,
    STRONG,
    WORTH,
    again,
    as_declared,
    bic_beside,
    of_written,
    on_band,
    otherwise,
    with_drift,
)
from .diagnosis import diagnose, growth, level_p, level_ratio
from .doubts import SURE, Doubt, noise_free, still_held
from .estimates import Estimates
from .linear_lines import linear_of, testable
from .misfit import LIKE_GUSTS, UNLIKELY, suspicious
from .missing_modes import UNSPOKEN
from .next_structures import best_cure
from .noisy_inputs import noisy_input
from .offsets import mean
from .position_steps import left_after, rows_with, wider
from .rewritten import rewritten
from .worth import worth

__all__ = ["limited_input", "unlike_command"]

MOST = 20_000  # samples of all records, which are gone through one by one
MOST_PATHS = 2  # of transfer functions: joint fits of more take seconds, and some thirty are tried
TRIED = 24  # fits near the best value of the scan, for each unknown
NEAR, CLOSER = 1.5, 1.15  # factors of values within which these are
SLOWER, LAGS = (0.4, 1.0), (0.3, 1.0)  # of the rate without a lag, and of 1/(the highest line): tried first
FASTER, EARLY = (0.8, 1.0), (0.0, 0.5, 1.0)  # the same beside equations; of a sample before a command is seen
PLACES = (0.3, 0.45, 0.6, 0.7, 0.8, 0.9)  # of the range of an input: limits that are tried
LIMITS = ("both", "top", "bottom")  # kinds of limits of the range
ROUNDS = 2  # of fits with a position, from which one step tells what others leave
SMALL = 0.02  # change of a value, as `moved` counts, by which residuals are told how they go with it
WIDER = 1.25  # factors of standard errors above which they are told
FEW = 3  # ways of which equations are fitted
LESS = 4.0  # times less power: what leaves more than the noise is named where it explains so much


@dataclass(frozen=True)
class _Way:
    """A way in which an actuator changes the command of an input, with one value."""

    channel: str
    kind: str
    value: float
    lag: float = 0.0
    middle: float = 0.0  # of the range of the command
    early: float | None = None  # s; a command may change before the sample that first holds its new value

    def position(self, rec: Record, held: bool) -> F64:
        """What reaches the plant, in the simplest form that the advice can write as one line."""
        c, value = rec[self.channel], self.value
        if self.kind in LIMITS:
            return np.asarray(np.clip(c, *self.ends()))
        if self.kind == "rate":
            step, part = value * _step(rec), self.part(rec)
            seen = np.r_[c[0], c[:-1]] if held else c
            found = accumulate(seen.tolist(), lambda v, c: v + min(max(part * (c - v), -step), step))
        elif self.kind == "backlash":
            found = accumulate(c.tolist(), lambda v, c: min(max(v, c - value), c + value))
        else:
            found = accumulate(c.tolist(), lambda v, c: c if abs(c - v) > value else v)
        moves = np.fromiter(found, float, c.size)
        return moves if self.early is None else np.interp(rec.t + self.early, rec.t, moves)

    def part(self, rec: Record) -> float:
        """Of the way to a held command, what a lag lets an actuator go in a sample."""
        return 1.0 - exp(-_step(rec) / self.lag) if self.lag else 1.0

    def ends(self) -> tuple[float, float]:
        """Limits between which the command acts."""
        if self.kind == "both":
            return self.middle - self.value, self.middle + self.value
        return (-inf, self.value) if self.kind == "top" else (self.value, inf)

    def between(self, word: str) -> str:
        """How the position goes between samples: at a steady rate, or from one jump to the next."""
        if self.kind == "rate":
            return "foh" if word == "zoh" else word
        return "zoh" if self.kind == "friction" else word

    def records(self, fit: Estimates) -> tuple[Record, ...]:
        """The records with the position as the input."""
        k, found = fit.inputs.index(self.channel), []
        for rec in fit.records or ():
            word = rec.intersample[k]
            own: dict[str, Any] = {self.channel: self.position(rec, word == "zoh")}
            moved, new = rec.assign(**own), self.between(word)
            found.append(otherwise(moved, k, new) if new != word else moved)
        return tuple(found)

    def ramped(self) -> str | None:
        """The input, if its position goes at a steady rate from sample to sample."""
        return self.channel if self.kind == "rate" else None

    def left(self, fit: Estimates, other: Estimates) -> float:
        """What one step leaves of equations, from a fit with the recorded or another position."""
        return left_after(other, self.records(fit), self.ramped())

    def structure(self, fit: Estimates) -> Any:
        """The structure, without the pole that is the lag of the actuator."""
        lag_is_pole = self.lag and fit.layout.rational
        return rewritten(fit, poles=fit.layout.orders[0] - 1) if lag_is_pole else fit.structure

    def fitted(self, fit: Estimates) -> Estimates | None:
        """The fit with the position, on the same band."""
        other = again(fit, self.records(fit), self.structure(fit), on_band(fit, fit.band))
        return (
            other if other is not None and other.success and not growth(other) > max(growth(fit), 0) else None
        )

    def bic(self, fit: Estimates) -> float:
        """BIC of that, and of the values that were found."""
        return self.bic_of(self.fitted(fit), fit)

    def bic_of(self, other: Estimates | None, fit: Estimates) -> float:
        """The same where the fit with the position is there."""
        return bic_beside(other, fit) + self.values(fit) if other is not None else inf

    def values(self, fit: Estimates) -> float:
        """What values that are found cost of BIC; the lag stands for a pole."""
        return log(fit.df_resid) * self.count()

    def count(self) -> int:
        """Of values that are looked for."""
        return 1 + bool(self.lag or self.kind == "both") + (self.early is not None)

    def moved(self, x: F64, span: float) -> _Way:
        """The same with values so far away: of limits by parts of the range, others by powers."""
        if self.kind in LIMITS:
            middle = self.middle + 0.1 * span * x[1] if self.kind == "both" else 0.0
            return replace(self, value=self.value + 0.1 * span * x[0], middle=middle)
        lag = self.lag * NEAR ** x[1] if self.lag else 0.0
        early = None if self.early is None else self.early + x[2] * self.lag
        return replace(self, value=self.value * NEAR ** x[0], lag=lag, early=early)

    def best(self, fit: Estimates) -> _Way:
        """The same with the values near these that explain most."""
        if self.kind == "friction":  # the motion jumps with the value
            near = _frictions(fit, self.channel, np.geomspace(1 / CLOSER, CLOSER, TRIED) * self.value)
            return min([self, *near], key=lambda way: way.bic(fit))
        if not _linear(fit):
            return self.least(fit, lambda way: way.bic(fit))
        way = self  # fits take long: steps from one of the position, twice, tell what they would
        for _ in range(ROUNDS):
            if (other := way.fitted(fit)) is None:
                break
            way = way.least(fit, partial(_Way.left, fit=fit, other=other))
        return way

    def least(self, fit: Estimates, left: Callable[[_Way], float]) -> _Way:
        """The same with the values near these of which least is left."""
        from scipy.optimize import minimize

        span, count = _span(fit, self.channel), self.count()
        found = minimize(
            lambda x: left(self.moved(x, span)),
            np.zeros(count),
            method="Nelder-Mead",
            options={
                "maxfev": TRIED * count,
                "initial_simplex": np.vstack([np.zeros(count), 0.5 * np.eye(count)]),
            },
        )
        return self.moved(found.x, span)

    def behind_lag(self, fit: Estimates) -> _Way:
        """The same of a servo whose lag is one of the poles, or beside equations, if that explains more."""
        layout, structure = fit.layout, fit.structure
        if self.kind != "rate":
            return self
        if _linear(fit):
            return self.with_time(fit)
        if not isinstance(structure, TransferFunction):
            return self
        several = len(fit.inputs) > 1 or len(fit.outputs) > 1
        given = structure.denominator is not None or structure.params
        if several or given or not 1 < layout.orders[0] > (layout.numerators[0][0] or 0):
            return self
        starts = [
            replace(self, value=slower * self.value, lag=part / fit.band[1])
            for slower in SLOWER
            for part in LAGS
        ]
        slow = min(starts, key=lambda way: way.bic(fit)).best(fit)
        return slow if slow.bic(fit) < self.bic(fit) - CLOSE else self

    def with_time(self, fit: Estimates) -> _Way:
        """The same of a servo beside equations, which has a lag as well if that explains about as much."""
        other, step = self.fitted(fit), max([_step(rec) for rec in fit.records or ()])
        if other is None:
            return self
        starts = [
            replace(self, value=faster * self.value, lag=part / fit.band[1], early=early * step)
            for faster, part, early in product(FASTER, LAGS, EARLY)
        ]
        free = min(starts, key=lambda way: way.left(fit, other)).best(fit)
        slow = min(free, replace(free, early=None).best(fit), key=lambda way: way.bic(fit))
        return slow if slow.bic(fit) < self.bic(fit) + CLOSE else self

    def on_both_sides(self, fit: Estimates) -> _Way:
        """The same with a limit at the other end, too, if that explains more."""
        if self.kind not in ("top", "bottom"):
            return self
        values = np.concatenate([rec[self.channel] for rec in fit.records or ()])
        near, far = self.value, values.min() if self.kind == "top" else values.max()
        halves = [0.5 * abs(near - far) * part for part in PLACES]
        sign = np.sign(far - near)
        starts = [replace(self, kind="both", value=half, middle=float(near + sign * half)) for half in halves]
        both = min(starts, key=lambda way: way.bic(fit)).best(fit)
        return both if both.bic(fit) < self.bic(fit) - CLOSE else self


@kept
def unlike_command(fit: Estimates) -> Doubt | None:
    """That an actuator does not pass a command on as it is recorded, which explains what is left."""
    if not _suspect(fit) or noisy_input(fit):  # limits would cut off the noise of a command's levels
        return None
    way = _likeliest(fit)
    other = way.fitted(fit) if way else None
    if way is None or other is None or not _explains(fit, way, other):
        return None
    return _told(fit, way, other)


def limited_input(fit: Estimates) -> Doubt | None:
    """The same where an estimate ended on a bound, which is then no matter of the bound."""
    return unlike_command(fit) if fit.at_bound else None


def _suspect(fit: Estimates) -> bool:
    """Whether there is more than noise in the residuals of linear equations, and an input that may be it."""
    layout: Any = fit.layout
    if not fit.inputs or fit.again is None or fit.options.reference or not suspicious(fit) or still_held(fit):
        return False  # fits with a reference take a fifth of a second each
    plain = fit.options.noise == "output" and (layout.rational or _linear(fit))
    if not (plain or fit.at_bound):
        return False
    if layout.rational and len(fit.outputs) * len(fit.inputs) > MOST_PATHS:
        return False
    quick = layout.rational and not layout.free_delays
    if not level_p(fit) < (UNLIKELY if quick else SURE) or noise_free(fit) is not None:
        return False
    few = sum(rec.t.size for rec in fit.records or ()) <= MOST
    return few and not mean(fit)  # limits at the mean do what a constant does


def _linear(fit: Estimates) -> bool:
    """Whether these are linear equations, of which a step tells what a fit would."""
    return not fit.layout.rational and testable(fit) and linear_of(fit) is not None


def _likeliest(fit: Estimates) -> _Way | None:
    """The way that explains most, if it explains enough to be named."""
    bar = bic_beside(fit, fit) - WORTH
    tried = [(way.bic(fit), k, way) for k, way in enumerate(_promising(fit))]
    least, _, way = min(tried, default=(inf, 0, None))
    return way.best(fit).behind_lag(fit).on_both_sides(fit) if way and least < bar else None


def _promising(fit: Estimates) -> list[_Way]:
    """All ways, or of equations, whose fits take long, those of which one step leaves least.

    Less than any shift or term leaves that equations may lack: those are likelier than actuators.
    """
    ways = list(_ways(fit))
    if not _linear(fit):
        return ways
    bar = left_after(fit, fit.records or ()) - max([UNSPOKEN, *worth(fit).values()])
    after = sorted([(way.left(fit, fit), k, way) for k, way in enumerate(ways)])
    return [way for left, _, way in after[:FEW] if left < bar]


def _wider(fit: Estimates, way: _Way, other: Estimates) -> str:
    """That standard errors of a fit with the position leave out those of its values, where these matter."""
    factors = _factors(fit, way, other)
    k = int(np.argmax(factors))
    if not factors[k] > WIDER:
        return ""
    name, error = other.param_names[k], factors[k] * other.bse[k]
    return (
        " The standard errors of that fit do not include the uncertainty of these values: with it "
        f"{name} is {other.params[k]:.4g} ± {error:.2g}, which is {factors[k]:.2g} times as much."
    )


def _factors(fit: Estimates, way: _Way, other: Estimates) -> F64:
    """By how much standard errors of linear equations grow where values of an actuator are estimates, too."""
    span, none = _span(fit, way.channel), np.ones(other.params.size)
    if way.kind == "friction" or not _linear(fit):
        return none
    if way.lag and way.early is None:
        way = replace(way, early=0.0)
    near = [way, *(way.moved(step, span) for step in SMALL * np.eye(3)[: way.count()])]
    rows = [rows_with(other, one.records(fit), one.ramped()) for one in near]
    found = [each for each in rows if each is not None]
    return wider(found[0], found[1:]) if len(found) == len(rows) else none


def _explains(fit: Estimates, way: _Way, other: Estimates) -> bool:
    """Whether what is left is noise, or little, and no change of the structure explains as much."""
    after, noise_left = way.bic_of(other, fit), level_p(other) > ENOUGH
    if not after < bic_beside(fit, fit) - UNSPOKEN:
        return False
    rows = (fit.df_resid + fit.params.size) / len(fit.row_names)
    if fit.at_bound and (other.at_bound or not noise_left):
        return False
    if not noise_left:
        if not bic_beside(fit, fit) - after > rows * log(LESS):
            return False
        tests = diagnose(fit, UNLIKELY).further
        if any(one.what in (*LIKE_GUSTS, "event") and one.p_value < SURE for one in tests):
            return False
    cures = [with_drift(fit)] if fit.trend == "constant" else []
    if fit.layout.rational:
        cures += [best_cure(fit, i, u) for i in range(len(fit.outputs)) for u in fit.inputs]
    else:
        cures.append(of_written(fit))
    bent = _with_powers(fit, way) if way.kind in LIMITS else inf
    # Of limits and a cube that explain as much the limits are likelier.
    # A limited rate is a delay where all steps are of one height: a linear change that does is likelier.
    least = [cure.after - (STRONG if cure.level_p > ENOUGH else CLOSE) for cure in cures if cure is not None]
    return after < min([bent + CLOSE, *least])


def _ways(fit: Estimates) -> Iterator[_Way]:
    """All ways with values over their ranges."""
    layout: Any = fit.layout
    quick, period = layout.rational and not layout.free_delays, 2 * pi / fit.band[1]
    for name in fit.inputs:
        values = np.concatenate([rec[name] for rec in fit.records or ()])
        span, low = _span(fit, name), float(values.min())
        if not span > 0 or any(name in rec._functions for rec in fit.records or ()):
            continue
        for part in PLACES:
            yield _Way(name, "both", part * span / 2, middle=low + span / 2)
            yield _Way(name, "top", low + part * span)
            yield _Way(name, "bottom", low + (1 - part) * span)
        if not (layout.rational or _linear(fit)) or any(rec.dt is None for rec in fit.records or ()):
            continue  # fits take long
        for part in np.geomspace(0.1, 10, 12 if quick else 6).tolist():
            yield _Way(name, "rate", part * span / period)
        for part in np.geomspace(0.005, 0.25, 10 if quick else 6).tolist():
            yield _Way(name, "backlash", part * span)
        yield from _frictions(fit, name, np.geomspace(0.02, 0.6, 48 if quick else 8) * span)


def _frictions(fit: Estimates, name: str, values: F64) -> list[_Way]:
    """Changes of a command that a sticking actuator needs, in the middle of those that make one motion."""
    same = dict[bytes, list[float]]()
    for value in values.tolist():
        way = _Way(name, "friction", value)
        motion = b"".join([way.position(rec, True).tobytes() for rec in fit.records or ()])
        same.setdefault(motion, []).append(value)
    return [_Way(name, "friction", (own[0] + own[-1]) / 2) for own in same.values()]


def _with_powers(fit: Estimates, way: _Way) -> float:
    """BIC of a transfer function with the square and the cube of the input beside it, as of a bent gain."""
    if not fit.layout.rational:
        return inf
    name, k = way.channel, fit.inputs.index(way.channel)
    new, size, more = [f"{name}_to_2", f"{name}_to_3"], _span(fit, name), []
    for rec in fit.records or ():
        x = (rec[name] - way.middle) / size
        own: dict[str, Any] = {new[0]: x**2, new[1]: x**3}
        wider = rec.assign(**own).select(outputs=fit.outputs, inputs=[*fit.inputs, *new])
        for at in (-2, -1):
            wider = otherwise(wider, at % len(wider.inputs), rec.intersample[k])
        more.append(wider)
    layout = fit.layout
    zeros = [[*row, row[k], row[k]] for row in layout.numerators]
    late: list[list[Any]] = []
    for i, routes in enumerate(layout.routes):
        known = layout.delays(fit.params, i)[k]
        late.append([*(layout.paths[route].delay for route in routes), known, known])
    other = again(fit, tuple(more), rewritten(fit, zeros=zeros, delay=late), on_band(fit, fit.band))
    return bic_beside(other, fit) if other is not None else inf


def _told(fit: Estimates, way: _Way, other: Estimates) -> Doubt:
    """What the actuator seems to do, and how to go on."""
    u, before, after = way.channel, bic_beside(fit, fit), way.bic_of(other, fit)
    if way.kind in LIMITS:
        text = f"The actuator saturates: {u} acts {_limits(way)} only, or so it seems"
    else:
        text = f"{u} does not reach the plant as recorded: it acts as if {_words(way)}"
    ends = "ends" if len(fit.at_bound) == 1 else "end"
    bound = f", and {listed(fit.at_bound)} {ends} on no bound" if fit.at_bound else ""
    return Doubt(
        f"{text}. With that the residuals fall from {level_ratio(fit):.3g} to {level_ratio(other):.3g} times "
        f"the noise of the unused high band (BIC from {before:.4g} to {after:.4g}){bound}. First record the "
        "position behind the actuator (of the surface, the valve or the servo) and take it as the input; "
        f"without one, try {_line(fit, way)}.{_wider(fit, way, other)}"
    )


def _words(way: _Way) -> str:
    if way.kind == "rate":
        lag = f", behind a lag of {way.lag:.2g} s" if way.lag else ""
        return f"limited to {way.value:.3g} per s{lag}"
    if way.kind == "backlash":
        return f"there were a backlash of ±{way.value:.3g}"
    return f"the actuator stuck until the command has moved by {way.value:.3g}"


def _limits(way: _Way) -> str:
    low, high = way.ends()
    if isfinite(low) and isfinite(high):
        return f"from {low:.4g} to {high:.4g}"
    return f"up to {high:.4g}" if isfinite(high) else f"down to {low:.4g}"


def _line(fit: Estimates, way: _Way) -> str:
    """What makes the position of the command, and what else the record or the structure has to be."""
    rec, k = (fit.records or ())[0], fit.inputs.index(way.channel)
    c, value, word = f"rec[{way.channel!r}]", f"{way.value:.4g}", rec.intersample[k]
    if way.kind in LIMITS:
        low, high = way.ends()
        if isfinite(low) and isfinite(high):
            made = f"np.clip({c}, {low:.4g}, {high:.4g})"
        else:
            made = f"np.minimum({c}, {value})" if isfinite(high) else f"np.maximum({c}, {value})"
        return f"rec.assign({way.channel}={made})"
    if way.kind == "rate":
        step = f"{way.value * _step(rec):.4g}"
        to = f"{way.part(rec):.4g} * (c - v)" if way.lag else "c - v"
        rule, seen = f"v + np.clip({to}, -{step}, {step})", c
        if word == "zoh":
            seen = f"np.r_[{c}[0], {c}[:-1]]"
    elif way.kind == "backlash":
        rule, seen = f"min(max(v, c - {value}), c + {value})", c
    else:
        rule, seen = f"c if abs(c - v) > {value} else v", c
    made = f"list(itertools.accumulate({seen}, lambda v, c: {rule}))"
    if way.early is not None:
        made = f"np.interp(rec.t {'-' if way.early < 0 else '+'} {abs(way.early):.3g}, rec.t, {made})"
    new, more = way.between(word), []
    if new != word:
        kinds = [*rec.intersample[:k], new, *rec.intersample[k + 1 :]]
        more.append(f"{as_declared(fit, kinds)} in the record")
    if way.lag and fit.layout.rational:
        more.append(f"poles={fit.layout.orders[0] - 1}")
    return f"rec.assign({way.channel}={made}){' with ' if more else ''}{' and '.join(more)}"


def _step(rec: Record) -> float:
    return rec.dt or 0.0


def _span(fit: Estimates, name: str) -> float:
    """The range of an input over all records."""
    return float(np.ptp(np.concatenate([rec[name] for rec in fit.records or ()])))
