"""What a structure with a delay lacks where records begin at rest, and a free initial state hides it."""

from __future__ import annotations

from dataclasses import replace
from math import log, sqrt
from typing import Any

import numpy as np

from ..base.cached import kept
from ..base.student import student_p
from ..errors import ModfunError
from ..models.free import Free
from .cures import CLOSE, ENOUGH, again, bic_beside
from .derived import gain_errors
from .diagnosis import growth, level_p
from .doubts import SURE, Doubt
from .estimates import Estimates
from .known_drift import drifting, linearised
from .known_start import contradicted_p, far_apart, from_rest, hausman, plainly_at_rest
from .rewritten import in_words, rewritten

__all__ = ["hidden_by_start"]

APART = 0.05  # p-value of Hausman's test below which structures from rest are tried
FAR = 2.0  # standard errors by which the gain has to move for a fit to warn: half of an interval
TOLD = 3.0  # standard errors of a gain from 0, below which the system may as well integrate


@kept
def hidden_by_start(fit: Estimates) -> Doubt | None:
    """That the gain is another from rest, as the records begin, where one more pole may be needed.

    Where a step follows soon upon the first sample, a free initial state does about what a lag does: it takes
    from the gain what a structure lacks, and leaves only noise. A start at rest leaves no such freedom, so
    the estimates with and without it differ (Hausman's test), and structures are told apart from it.
    """
    layout: Any = fit.layout
    single = layout.rational and len(layout.orders) == len(fit.inputs) == len(layout.free_delays) == 1
    if not single or fit.structure.params or fit.structure.denominator is not None:
        return None
    if growth(fit) > 0 or not (plainly_at_rest(fit) and _seems_apart(fit)):
        return None
    rest = from_rest(fit)
    apart = far_apart(fit, rest) if rest is not None else None
    if rest is None or apart is None or apart > APART:
        return None
    if rest.at_bound:  # of the delay near the estimate, which the fit from rest has elsewhere
        rest = again(fit, fit.records, fit.structure, rest.options) or rest
    found = _with_pole(fit, rest)
    words, other = found or ("", rest)
    (gain, error), (now, own) = _gain(fit), _gain(other)
    if not (abs(gain) > TOLD * error and abs(now) > TOLD * own and _clean(other)):
        return None
    far = abs(gain - now) / sqrt(max(error**2 - own**2, (error / 2) ** 2))
    p = float(student_p(far, fit._fewest_degrees()))
    if not (found or p < ENOUGH):
        return None
    begins = "record begins" if len(fit.records or ()) == 1 else "records begin"
    text = (
        f"The {begins} at rest, but the fit takes the initial state as unknown, which "
        f"{'hides' if found else 'may hide'} what the structure lacks: the static gain is "
        f"{gain:.4g} ± {error:.2g} so, and {now:.4g} ± {own:.2g} from rest (p = {p:.1g}). First try"
    )
    if not found:
        return Doubt(f'{text} initial_state="rest".', sure=p < SURE)
    fall = f"from {bic_beside(rest, fit):.4g} to {bic_beside(other, fit):.4g}"
    return Doubt(f'{text} {words}, and initial_state="rest": from there BIC falls {fall}.', sure=far > FAR)


def _seems_apart(fit: Estimates) -> bool:
    """Whether Hausman's test may find the fit from rest elsewhere: by one step towards it on samples."""
    rest, rows = replace(fit, options=fit.options.replace(initial_state="rest")), []
    for rec in fit.records or ():
        try:
            left, slopes = linearised(rest, rec)
        except ModfunError:  # a response that overflows
            return False
        both = np.vstack([left, slopes[:, 0]])
        rows.append(both - np.mean(both, axis=1, keepdims=True))
    left, slopes = np.split(np.hstack(rows), [1])
    if not np.all(np.isfinite(slopes)):
        return False
    cov = np.linalg.pinv(slopes @ slopes.T)
    gap = cov @ (slopes @ left[0])
    level = np.sum((left[0] - gap @ slopes) ** 2) / (left.size - gap.size - 1)
    p = hausman(fit, gap, cov * level)
    return p is None or p < APART


def _with_pole(fit: Estimates, rest: Estimates) -> tuple[str, Estimates] | None:
    """One more pole beside the delay or in place of it, in words and from rest, where that is worth it."""
    layout: Any = fit.layout
    poles, known = layout.orders[0] + 1, layout.paths[layout.free_delays[0]].delay
    code = f"poles={poles}, zeros={in_words([list(row) for row in layout.numerators])}"
    tried: list[tuple[str, Free | float]] = []
    if rest.params[-1] > known.min:  # a pole takes a part of the delay, or all of it
        shorter = Free(min=known.min, max=float(rest.params[-1]))
        tried.append((f"one more pole beside the delay, {code}", shorter))
    if known.min <= 0:
        tried.append((f"one more pole in place of the delay, {code}", 0.0))
    bar, found = bic_beside(rest, fit) - CLOSE, None
    for words, delay in tried:
        other = again(fit, fit.records, rewritten(fit, poles=poles, delay=delay), rest.options)
        if other is None or not other.success or other.at_bound or growth(other) > 0:
            continue
        after = bic_beside(other, fit)
        if after < bar:
            bar, found = after, (words, other)
    # A free state is a parameter for each pole, which BIC of the fit does not count.
    most = bic_beside(fit, fit) + layout.orders[0] * log(fit.df_resid + fit.params.size)
    return found if bar < most else None


def _clean(rest: Estimates) -> bool:
    """Whether a fit from rest leaves only noise, no drift, and no sign that records begin otherwise."""
    return level_p(rest) > ENOUGH and contradicted_p(rest) > ENOUGH and drifting(rest) is None


def _gain(fit: Estimates) -> tuple[float, float]:
    """The static gain and its standard error."""
    found, relative, _ = gain_errors(fit, np.zeros(1))
    gain = float(found[0, 0, 0].real)
    return gain, abs(gain) * float(relative[0, 0, 0])
