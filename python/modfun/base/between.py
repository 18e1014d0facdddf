"""How an input goes between its samples: held, in straight lines or smoothly, seen in the samples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .arrays import F64
from .control_laws import computed
from .noisy_levels import held_in_noise

__all__ = [
    "AUTO", "BY_FIT", "CLOSE", "DOUBTFUL", "FORMS", "LOOP", "MIXED", "OPEN", "decided", "form_of",
    "liveliest", "restless",
]  # fmt: skip

Mask = NDArray[np.bool_]

MIXED = "mixed"  # in place of a word of several records that differ in it
AUTO = "auto"  # what users say, or leave unsaid, to have the word taken from the samples

# What samples look like, and the word for it. An input at rest says nothing: every word is right.
FORMS = {
    "rest": "smooth",
    "held": "zoh",  # flat between jumps
    "stairs": "zoh",  # the same on four or five levels, one at a time: held, or a coarsely rounded motion
    "noisy": "zoh",  # held, and measured with noise
    "computed": "zoh",  # from outputs at the same samples, as a digital controller does
    "straight": "foh",
    "rounded": "smooth",  # flat, and then one unit of the last digit up or down
    "rough": "smooth",  # some power at the highest frequencies: held for one sample each, or noisy
    "walk": "smooth",  # changes are random: held for one sample each, or like few motions that are measured
    "smooth": "smooth",
}
MOVING = ("rough", "walk", "smooth")  # at every sample
DOUBTFUL = ("stairs", "rough", "walk")
# What decided where samples leave it open: fits of both, whose difference may be short of
# very strong evidence, or that a reference tells of a loop. Nothing did where both fit alike.
BY_FIT, CLOSE, LOOP, OPEN = "fit", "close", "loop", "open"

SAME = 1e-9  # of the range: a change that is none
LINE = 5e-6  # of the range: a bend that is none, since files keep six digits
ON, BENDS = 0.5, 0.45  # a change of straight lines: so many go on, at least, and so many bends, at most
REST = 0.01  # of all that bends: what a slow motion, each bend of which seems none, is above
FLAT = 0.4  # of both sides of the changes of held values: what is flat, at least
UNITS = 1.5  # smallest changes in a mean change of rounded values, at most
LEVELS = 6  # of rounded values, at least, and two less where it is doubtful
OUTLYING = 6  # median deviations
ROUGH = 0.05  # of the mean power density: that of the upper quarter of all frequencies
LAGS = 10  # correlations of changes that are looked at
RANDOM = 25.2  # their sum of squares times the changes: one random walk in 200 is above
CHANGES = 128  # at least, to tell these from a motion's
RESTLESS = 0.5  # of the mean power density of changes: that of their upper quarter of frequencies


def form_of(values: F64, t: F64 | None = None) -> str:
    """Tell what the samples of an input look like, one of `FORMS`.

    Parameters
    ----------
    values : ndarray, shape (time,)
    t : ndarray, shape (time,), optional
        Times, where they are uneven.

    Notes
    -----
    Values held for one sample each, on more than two levels, cannot be told from a motion with power up to
    the highest frequencies, or from noise: they are rough, which is doubtful.
    """
    span = float(values.max() - values.min())
    if span == 0:
        return "rest"
    change = values[1:] - values[:-1]
    size = np.abs(change)
    moves = size > SAME * span
    count = int(np.count_nonzero(moves))
    slope = change if t is None else change * (((t[-1] - t[0]) / len(change)) / np.diff(t))
    if _straight(np.abs(slope[1:] - slope[:-1]), size > LINE * span, span):
        return "straight"
    if count < len(moves) and (form := _flat(size, moves, span)):
        return form
    if held_in_noise(values):
        return "noisy"
    top = _top(values)
    if top >= ROUGH:  # a few outliers would do it
        middle = float(np.median(values))
        reach = OUTLYING * float(np.median(np.abs(values - middle)))
        if span > 2 * reach > 0:
            top = min(top, _top(values.clip(middle - reach, middle + reach)))
    if top >= ROUGH:
        return "rough"
    return "walk" if _random(change) else "smooth"


def _random(change: F64) -> bool:
    """Tell whether changes do not follow each other (Box and Pierce, 1970), as those of a motion do."""
    if change.size < CHANGES:
        return False
    unit = change / np.max(np.abs(change))
    unit = unit - unit.mean()
    lags = [float(unit[k:] @ unit[:-k]) for k in range(1, LAGS + 1)]
    return change.size * float(np.sum(np.square(lags))) < RANDOM * float(unit @ unit) ** 2


def restless(values: F64) -> bool:
    """Tell whether changes have as much power at high frequencies as elsewhere, as those of noise do.

    Those of a motion lose it with frequency: to a share of 0.1 where it is of second order.
    """
    change = np.diff(values)
    return bool(np.ptp(change) > SAME * np.ptp(values) and _top(change) >= RESTLESS)


def _top(values: F64) -> float:
    """Return the mean power density of the upper quarter of frequencies, of that of all."""
    unit = float(np.max(np.abs(values))) or 1.0  # numbers of any size
    lines = np.fft.rfft(values / unit - np.mean(values / unit))[1:]
    power = lines.real**2 + lines.imag**2
    whole = float(power.mean())
    return float(power[-(len(power) // 4) :].mean() / whole) if whole > 0 else 0.0


def _straight(bend: F64, moves: Mask, span: float) -> bool:
    """Tell whether most changes go on in the same line, between corners that hold all the bending."""
    line = bend <= LINE * span
    count = np.count_nonzero(moves)
    if len(line) - np.count_nonzero(line) > BENDS * count:
        return False
    on = line & moves[1:] & moves[:-1]
    little = REST * float(bend.sum()) + SAME * span * len(bend)
    return bool(np.count_nonzero(on) >= ON * count and float(bend[on].sum()) <= little)


def _flat(size: F64, moves: Mask, span: float) -> str:
    """Return the form where changes stand between flat stretches, else nothing."""
    changes = size[moves]
    smallest = float(changes.min())
    if smallest > span * (1 - SAME):  # between two levels, at whatever samples
        return "held"
    flat = np.ones(len(moves) + 2)  # before the first sample and after the last one, too
    flat[1:-1] = ~moves
    beside = 0.5 * (flat[2:] + flat[:-2])[moves]
    if beside.mean() < FLAT or float(beside @ changes) < FLAT * float(changes.sum()):
        return ""
    levels = span / smallest + 1
    if changes.mean() > UNITS * smallest or levels < LEVELS - 2.5:
        return "held"
    return "rounded" if levels > LEVELS - 0.5 else "stairs"


def decided(
    words: Sequence[str], rows: Sequence[F64] | F64, t: F64 | None = None, y: F64 | None = None
) -> tuple[tuple[str, ...], dict[int, str]]:
    """Return one word an input, and the forms by number of those that their samples decided.

    Parameters
    ----------
    words : sequence of str
        "auto", or what the user declared.
    rows : sequence of ndarray, shape (time,)
    t : ndarray, shape (time,), optional
        Times, where they are uneven.
    y : ndarray, shape (output, time), optional
        Outputs, from which a controller may have computed an input.
    """
    forms = {k: form_of(rows[k], t) for k, word in enumerate(words) if word == AUTO}
    if y is not None and t is None:
        forms |= {k: "computed" for k, form in forms.items() if form in MOVING and computed(rows[k], y)}
    return tuple(FORMS[forms[k]] if k in forms else word for k, word in enumerate(words)), forms


def liveliest(words: Sequence[str], pieces: Sequence[F64]) -> str:
    """Return the word of the pieces of one input that move most; an input may rest in the others."""
    votes = dict.fromkeys(words, 0.0)
    for word, values in zip(words, pieces, strict=True):
        votes[word] += float(values.size * values.var())
    return max(votes, key=votes.__getitem__)
