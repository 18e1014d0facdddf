"""Whether a free delay of inputs is a lag of their actuators, or has one beside it, and what that does."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from ..base.arrays import F64
from ..base.cached import kept
from ..base.names import listed
from ..equations.equation import Equation
from ..equations.state_space import StateSpace
from ..errors import ModfunError
from ..models.free import Free
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from .cures import CLOSE, ENOUGH, WORTH, again, amplified, bic_beside, on_band
from .diagnosis import growth, level_p
from .doubts import SURE, Doubt, noise_free
from .estimates import Estimates
from .fitted_samples import measured_lines
from .known_start import from_rest
from .lags import EXTRA, free_delays, lagging, least_time, undelayed, unused, with_values
from .rewritten import in_words, rewritten

__all__ = ["acts_by_lag", "uncounted_lag"]

SEEN = 3.0  # standard errors of a delay from 0, below which nothing says that there is one
FAR = 2.0  # standard errors by which a lag has to move an estimate for it to be said: half of an interval
ALIKE = 5.0  # times a delay, or a part of it: a time constant beyond is that of something else


_Changed = tuple[str, str, StateSpace | Equation | TransferFunction]


@dataclass(frozen=True)
class _Lag:
    """A lag in place of a delay, or beside it: in words with code, and BIC before and after it.

    `level_p`: probability of a chi-square as large as that after it; `name`: the estimate that it moves
    furthest, `far`: by how many standard errors, `value`: to what.
    """

    words: str
    before: float
    after: float
    level_p: float
    delay: str
    name: str
    value: str
    far: float


def acts_by_lag(fit: Estimates) -> Doubt | None:
    """That an input acts by a lag, alone or beside its delay, where the record leaves no doubt of it."""
    lag, seems = _in_place(fit), "to be a lag"
    if lag is None or not lag.after < lag.before - WORTH or _denied_at_rest(fit, -WORTH):
        lag = None
    if lag is None or not lag.level_p > ENOUGH:
        both = _beside(fit)
        if both and both.after < (lag.after if lag else both.before) - WORTH:
            lag, seems = both, "to have a lag beside it"
    if lag is None:
        return None
    was = f"{fit[lag.name]:.4g} ± {fit.spread[fit.param_names.index(lag.name)]:.2g}"
    return Doubt(
        f"{lag.delay} seems {seems}: {lag.name} is {was} so, and {lag.value} with a lag. First "
        f"try {lag.words}: BIC falls from {lag.before:.4g} to {lag.after:.4g}.",
        sure=lag.far > FAR,
    )


def uncounted_lag(fit: Estimates) -> str:
    """How far a lag in place of a delay, or beside it, moves the estimates, where the record leaves it open.

    "" where it moves none far. Whether something follows its command by a lag of 0.05 s, or as much later,
    a short manoeuvre may leave open, and a control derivative differs by a tenth.
    """
    lag, may, least = _in_place(fit), "be a lag", -CLOSE
    if lag is None or not lag.before - lag.after > least:
        lag, may, least = _beside(fit), "have a lag beside it", 0.0  # of true delays one in 200 or so
    if lag is None or not least < lag.before - lag.after < WORTH or not lag.far > FAR:
        return ""
    if _denied_at_rest(fit, CLOSE):
        return ""
    fall = lag.before - lag.after
    return (
        f"{lag.delay} may as well {may}: then {lag.name} is {lag.value}, {lag.far:.2g} standard errors "
        f"from this. The record does not tell (BIC {abs(fall):.2g} {'lower' if fall > 0 else 'higher'}). If "
        f"you know that it is one, fit {lag.words}."
    )


def _denied_at_rest(fit: Estimates, rise: float) -> bool:
    """Whether records begin at rest, and a lag raises BIC by more where the fit knows that."""
    rest, found = from_rest(fit), _changed(fit)
    if rest is None or found is None:
        return False
    other = again(fit, fit.records, found[2], rest.options)
    return other is None or not bic_beside(other, fit) < bic_beside(rest, fit) + rise


@kept
def _in_place(fit: Estimates) -> _Lag | None:
    """The lag in place of a delay that is seen; None where there is none, or no fit with it."""
    return _tried(fit, _changed(fit)) if _plain(fit) else None


@kept
def _beside(fit: Estimates) -> _Lag | None:
    """The same of a lag beside it; of a transfer function that is a pole more, which is tried elsewhere."""
    model = fit.structure
    if not isinstance(model, StateSpace) or not _plain(fit):
        return None
    every = [name for name in free_delays(fit, model) if _seen(fit, name)]
    tried = [_tried(fit, _both(fit, model, name)) for name in every]
    return min((lag for lag in tried if lag), key=lambda lag: lag.after, default=None)


def _plain(fit: Estimates) -> bool:
    """Whether BIC of fits like this one tells structures apart."""
    plain = fit.again is not None and fit.process_levels is None and not fit.options.reference
    plain = plain and measured_lines(fit)  # of filled ones BIC tells nothing
    return plain and fit.options.method in ("ml", "awls") and noise_free(fit) is None and not amplified(fit)


def _tried(fit: Estimates, found: _Changed | None) -> _Lag | None:
    """The lag of a changed structure, where what is left may be noise."""
    records = _from_first(fit)
    if found is None or records is None:
        return None
    delay, words, structure = found
    # Over the samples of the fit: those that a delay leaves out would count for the lag.
    other = again(fit, records, structure, on_band(fit, fit.band))
    if other is None or other.at_bound or level_p(other) < SURE:  # of what is still missing others tell
        return None
    if growth(other) > 0 >= growth(fit):
        return None
    moved = _moved(fit, other, delay)
    if moved is None:
        return None
    lag, values, errors = moved
    with np.errstate(all="ignore"):
        far = np.nan_to_num(np.abs(values - fit.params) / np.where(fit.bse > 0, fit.bse, np.inf))
    at = int(np.argmax(far))
    value = f"{values[at]:.4g}" + (f" ± {errors[at]:.2g}" if errors[at] > 0 else "")
    return _Lag(
        with_values(words, other).replace("{}", f"{lag:.3g}"),
        bic_beside(fit, fit),
        bic_beside(other, fit),
        level_p(other),
        "The delay" if delay == "delay" else f"The delay {delay}",
        fit.param_names[at],
        value,
        float(far[at]),
    )


def _both(fit: Estimates, model: StateSpace, name: str) -> _Changed:
    """The same with a lag of the actuator beside the delay."""
    words, code, made = lagging(fit, model, model.delay.index(name), fit[name])
    return name, f"{words}, {code}", made


def _changed(fit: Estimates) -> _Changed | None:
    """A delay that is seen, the lag in its place in words, `{}` for its size, and the structure with it."""
    model = fit.structure
    if isinstance(model, StateSpace):
        for name in free_delays(fit, model):
            if _seen(fit, name):
                words, code, made = undelayed(fit, model, name)
                return name, f"{words}, {code}", made
    elif isinstance(model, Equation):
        for name in fit.param_names:
            if (found := _written(fit, model, name)) and _seen(fit, name):
                return name, *found
    elif isinstance(model, TransferFunction) and _seen(fit, "delay"):
        return _with_pole(fit)
    return None


def _seen(fit: Estimates, name: str) -> bool:
    """Whether a parameter is well above 0, and on no bound."""
    if name not in fit.param_names or name in fit.at_bound:
        return False
    return bool(fit[name] > max(SEEN * fit.bse[fit.param_names.index(name)], least_time(fit)))


def _written(fit: Estimates, model: Equation, name: str) -> tuple[str, Equation] | None:
    """Equations with a hidden signal that follows the one input which this delays."""
    late = rf"(?<![\w.])(\w+)\(\s*t\s*-\s*{re.escape(name)}\s*\)"
    inputs = dict.fromkeys(u for text in model.texts for u in re.findall(late, text) if u in model.inputs)
    if len(inputs) != 1 or any(
        re.search(rf"\b{re.escape(name)}\b", re.sub(late, "", t)) for t in model.texts
    ):
        return None
    texts = [re.sub(late, r"\1_moved", text) for text in model.texts]
    follow = [f"{{}}*{u}_moved' + {u}_moved = {u}" for u in inputs]
    lag, least = unused("lag", model), least_time(fit)
    params = {own: told for own, told in model.params if own != name} | {EXTRA: Free(fit[name], min=least)}
    try:
        made = model._like(
            text=[*texts, *(own.format(EXTRA) for own in follow)],
            hidden=(*model.hidden, *(f"{u}_moved" for u in inputs)),
            params=params,
        )
    except ModfunError:
        return None
    told = listed([repr(text) for text in (*texts, *(own.format(lag) for own in follow))])
    words = (
        f"a lag of the actuator of {listed(list(inputs))} ({{}} s) in place of the delay {name}, "
        f"{told} with params={{{lag!r}: mf.Free({{}}, min={least:.2g})}}"
    )
    return words, made


def _with_pole(fit: Estimates) -> tuple[str, str, TransferFunction] | None:
    """A transfer function of one path with one more pole in place of its delay."""
    structure, layout = fit.structure, fit.layout
    single = len(layout.orders) == len(fit.inputs) == 1 and structure.denominator is None
    if not single or structure.params:
        return None
    poles = layout.orders[0] + 1
    made = rewritten(fit, poles=poles, delay=0.0)
    zeros = in_words([list(row) for row in layout.numerators])
    code = f"mf.TransferFunction(poles={poles}, zeros={zeros})"
    return "delay", f"one more pole in place of the delay, a lag of {{}} s, {code}", made


def _moved(fit: Estimates, other: Estimates, delay: str) -> tuple[float, F64, F64] | None:
    """The lag, and what the parameters are with it, with their errors, 0 where unknown."""
    names = fit.param_names
    if not fit.layout.rational:
        at = [other.param_names.index(name if name in other.param_names else EXTRA) for name in names]
        values, errors = other.params[at], other.spread[at]
        k = names.index(delay)
        values[k], errors[k] = fit.params[k], 0.0  # a lag is no delay, nor is a part of it
        return other[EXTRA], values, errors
    den, nums = other.layout.polynomials(other.params, 0)
    poles = np.roots(den)
    real = -poles[np.abs(poles.imag) == 0].real
    near = [float(p) for p in real if p > 0 and 1 / ALIKE < p * fit[delay] < ALIKE]
    if not near:
        return None
    pole = min(near, key=lambda p: abs(np.log(p * fit[delay])))
    left = np.polydiv(den, [1.0, pole])[0]
    values = np.array([*left[1:], *(nums[0] / pole), fit[delay]])
    return 1 / pole, values, np.zeros(values.size)


def _from_first(fit: Estimates) -> tuple[Record, ...] | None:
    """The records from the first sample on that the fit took, as a delay leaves some out."""
    if not fit.records or any(rec.dt is None for rec in fit.records):
        return None
    pairs = zip(fit.records, fit.intervals, strict=True)
    return tuple([rec.window(rec.t[k], rec.t[-1]) if (k := rec.intervals - n) else rec for rec, n in pairs])
