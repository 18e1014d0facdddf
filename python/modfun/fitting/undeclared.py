"""Inputs that nobody declared: fits tell how they move between samples where the samples do not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import islice
from math import nan
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import F64
from ..base.between import BY_FIT, CLOSE, DOUBTFUL, FORMS, LOOP, OPEN, restless
from ..base.student import root
from ..errors import ModfunError
from ..models.noise import Noise
from ..models.options import Options
from ..models.transfer_function import TransferFunction
from ..records.batches import Batch
from ..records.forms import agreed
from ..records.record import Record
from ..results.cures import amplified, on_band, realigned
from ..results.diagnosis import growth
from ..results.estimates import Estimates
from ..results.feedback import feedback
from ..results.fit import Fit
from ..results.fitted_samples import measured_lines
from ..results.misfit import UNLIKELY, refuted, suspicious
from ..results.refits import starts_beside
from ..results.undeclared import POSITIVE
from .by_response import by_response
from .by_samples import lower_by_samples
from .candidates import score

__all__ = [
    "OTHER",
    "STRONG",
    "Which",
    "Word",
    "decided_by_fit",
    "fit_as_read",
    "in_sentences",
    "read_alike",
    "read_as",
]

# Takes records, a structure and options; of equations also `starts` and `near`.
FitOnce = Callable[..., Fit]

FEW = 4  # records that are asked where each of many is fitted by itself

# Differences of BIC (Kass and Raftery, 1995). Positive evidence decides where samples are doubtful, and of a
# motion beside records in which the input moves otherwise. Very strong evidence is needed in a loop, where
# the noise that comes back biases both fits and a computer holds what it commands, and of inputs that look
# held or like a motion. Most of them were; steps and square waves that passed through straight lines look
# held, and so do those that switch between two samples, and the command of a computer that changes little a
# tick looks like a motion; positive evidence does where the noise of an output is seen to come back, or where
# a motion needs a pole as fast as the samples, of which a hold is free. Strong
# evidence that an input was not held is said, and so is that a motion may be held where that makes other
# estimates.
STRONG, VERY_STRONG = 6.0, 10.0
LONG, MANY = 2.0, 0.1  # median steps, and how many are longer where times are those of no clock
# Standard errors between estimates of both readings: these are others. A free delay makes up for half a
# sample, whichever reading is right: at one standard error 95 % intervals of the other one hold 83 %.
FAR, LATE = 3.0, 1.0
SAID = {
    BY_FIT: "which the fit prefers",
    CLOSE: "though straight lines between its samples fit better",
    LOOP: "as a computer that closes a loop holds it",
    OPEN: "though read otherwise it fits about as well, with other estimates",
}
COMPUTED = ("rough", "walk")  # what inputs of a loop look like that a computer closes
OTHER = {"zoh": "smooth", "smooth": "zoh", "foh": "zoh"}


class Which(NamedTuple):
    """An input, in the records in which it looks so; in all where that is nothing."""

    name: str
    look: str = ""


class Word(NamedTuple):
    """How an input is read, and what decided it."""

    word: str
    why: str


def fit_as_read(records: tuple[Record, ...], structure: Any, options: Options, fit_once: FitOnce) -> Fit:
    """One fit, of records whose open inputs are read as it prefers."""
    words, fits = _asked([records], structure, options, fit_once)
    if fits and not words and options.is_plain:
        return fits[0]
    return fit_once(read_as(records, words), structure, options)


def decided_by_fit(
    problems: Iterable[tuple[Record, ...]],
    structure: Any,
    options: Options,
    fit_once: FitOnce,
    *,
    many: bool = False,
) -> dict[Which, Word]:
    """How each open input is read, whichever way the fits of the structure prefer, all together.

    `many`: what they prefer is for many more records, whose mean shows a small error.

    Open are all undeclared inputs that move: what looks held may be straight lines from sample to sample, and
    what looks like a motion may be held. With a reference, rough ones are held unless the fits say otherwise.
    Inputs that stay as they look are not named.
    """
    return _asked(problems, structure, options, fit_once, many)[0]


def read_as(records: tuple[Record, ...], words: Mapping[Which, Word]) -> tuple[Record, ...]:
    """The records with their inputs read so."""
    return tuple([_read_as(rec, words) for rec in records]) if words else records


def _read_as(rec: Record, words: Mapping[Which, Word]) -> Record:
    kinds, seen = list(rec.intersample), dict(rec._seen)
    for k, name in enumerate(rec.inputs):
        if word := words.get(Which(name)) or words.get(Which(name, _look(rec, name))):
            kinds[k], seen[name] = word
    return rec._like(intersample=tuple(kinds), _seen=seen)


def _look(rec: Record, name: str) -> str:
    """The word for what samples look like, or what makes it doubtful; nothing if it was declared."""
    form = rec._seen.get(name, "")
    return form if form in DOUBTFUL else FORMS.get(form, "")


def read_alike(data: Any, structure: Any, options: Options, fit_once: FitOnce) -> tuple[Any, tuple[str, ...]]:
    """A batch or many records with inputs as fits of the first few prefer them, and what was decided.

    Of records that look unlike, the first few of each kind.
    """
    count = FEW if isinstance(structure, TransferFunction) else 1  # fits of equations take long
    if isinstance(data, Batch):
        if data._declared:
            return data, ()
        alike = agreed(list(islice(data._finite(), count)), alike=True)
        words = decided_by_fit([(rec,) for rec in alike], structure, options, fit_once, many=True)
        return data._read_as({name: word for (name, _), (word, _) in words.items()}), in_sentences(words)
    read, notes = list(data), dict[str, None]()
    for members in _kinds(data):
        alike = agreed([data[k] for k in members], alike=True)
        few = sorted(alike, key=lambda rec: len(rec._seen))[:count]  # what one record declares holds for all
        words = decided_by_fit([(rec,) for rec in few], structure, options, fit_once, many=True)
        notes |= dict.fromkeys(in_sentences(words))
        for k, rec in zip(members, read_as(alike, words), strict=True):
            read[k] = rec
    return tuple(read), (*notes, *_mixture(read))


def _kinds(records: Sequence[Record]) -> list[list[int]]:
    """Numbers of records whose inputs look alike between samples; one at rest looks like any."""
    kinds: list[tuple[list[str], list[int]]] = []
    for k, rec in enumerate(records):
        forms = [rec._seen.get(name, "") for name in rec.inputs]
        looks = [
            "" if form == "rest" else form if form in DOUBTFUL else word
            for form, word in zip(forms, rec.intersample, strict=True)
        ]
        for own, members in kinds:
            if all(a == b or not (a and b) for a, b in zip(own, looks, strict=True)):
                own[:] = [a or b for a, b in zip(own, looks, strict=True)]
                members.append(k)
                break
        else:
            kinds.append((looks, [k]))
    return [members for _, members in kinds]


def _mixture(records: Sequence[Record]) -> Iterator[str]:
    """Inputs that are not read alike in all records."""
    for channel, name in enumerate(records[0].inputs):
        counts = Counter(rec.intersample[channel] for rec in records)
        if len(counts) > 1:
            told = ", ".join(f"{word} in {count}" for word, count in counts.items())
            yield f"Input {name!r} is read as {told} of {len(records)} records, as each of them looks."


def in_sentences(words: Mapping[Which, Word]) -> tuple[str, ...]:
    """What was decided."""
    return tuple(
        f"Input {name!r} is read as {word}, {SAID[why]}." for (name, _), (word, why) in words.items()
    )


def _asked(
    problems: Iterable[tuple[Record, ...]],
    structure: Any,
    options: Options,
    fit_once: FitOnce,
    many: bool = False,
) -> tuple[dict[Which, Word], list[Fit]]:
    """How open inputs are read, and the fits of the problems so."""
    each, loop = list(problems), bool(options.reference)
    if not each:
        return {}, []
    noise, measured = options.noise, options.noise == "errors-in-variables"
    measured |= isinstance(noise, Noise) and noise.u is not None
    names = [name for name in each[0][0].inputs if name not in options.reference]
    looks = {which: seen for name in names for which, seen in _open(each, name).items()}
    if measured:  # noise of their own makes them rough, and no random walks
        looks = {which: seen for which, seen in looks.items() if seen[0] == "walk"}
    if not looks:
        return {}, []
    computed = {which for which, (look, _) in looks.items() if loop and _computed(each, which, look)}
    found = {which: Word("zoh", LOOP) for which in computed}
    plain = options.plain()  # of the fits that are compared
    asked = [(records, _fit(read_as(records, found), structure, plain, fit_once)) for records in each]
    each = [records for records, fit in asked if fit is not None]
    fits = [fit for _, fit in asked if fit is not None]
    for which, (look, word) in looks.items():
        held, doubtful = look == "zoh", look in DOUBTFUL or which in computed
        motion = not (held or doubtful or loop) and options.method == "ml"  # others have no likelihood
        motion = motion and all(_ticks(rec) for records in each for rec in records)
        if not (held or doubtful or loop or motion):
            continue
        if not fits or which.name not in fits[0].inputs or (held and not any(map(_contradicted, fits))):
            continue
        late = bool(fits[0].layout.free_delays)
        if late and held:
            continue  # a free delay makes up for half a sample, and what is left tells of other errors
        word = found[which].word if which in found else word
        walk = look == "walk" and not loop
        unsure = doubtful or bool(which.look and motion)
        bar = 0.0 if walk else POSITIVE if unsure and not (loop or many) else VERY_STRONG
        # Where steps were straight lines, motions beside them are what they look like.
        changed = {w: own for w, own in found.items() if not (held and w.name == which.name)}
        changed[which] = Word("foh" if held else OTHER[word], BY_FIT)
        others = _on_bands(each, fits, changed, structure, fit_once)
        gain = _gain(fits, others)
        if motion and gain <= POSITIVE and not (gain > -STRONG and _apart(fits, others)):
            continue  # as most do; whether the others are refuted takes simulations
        if motion and not all(other is not None and other.success and not refuted(other) for other in others):
            continue  # of two wrong models: half a sample of delay makes up for many a lag
        if motion and not late and POSITIVE < gain <= bar:
            imitated = all(map(_imitated, fits, others))
            bar = POSITIVE if imitated or all(map(_fed_back, fits)) else bar
        if gain > bar:  # a fit of many parameters may have ended elsewhere by its default band alone
            gain = min(gain, _gain(_on_bands(each, fits, found, structure, fit_once), others))
        if gain > bar and any(map(amplified, fits)):  # sums with products have several minima, and are bent
            gain = min(gain, _lower_by_response(fits, others))
        if motion and gain > bar:
            bar += sum(_out_of_time(fit, which.name) for fit in fits)
        why = OPEN if walk and abs(gain) < STRONG and _apart(fits, others) else BY_FIT
        if gain > bar:
            found = changed | {which: Word(changed[which].word, why)}
            fits = [other for other in others if other is not None]
        elif gain < -bar and (doubtful or loop):
            found[which] = Word(word, why)
        elif gain > STRONG and held:
            found[which] = Word(word, CLOSE)
        elif gain > -STRONG and motion and _apart(fits, others):
            found[which] = Word(word, OPEN)
    return found, fits


def _ticks(rec: Record) -> bool:
    """Whether a clock makes the times, late and with gaps at worst: only such a one holds what it commands.

    Sums over samples at any times have errors, and a motion that is read as held has none.
    """
    if rec.dt is not None:
        return True
    steps = np.diff(rec.t)
    return bool(np.mean(steps > LONG * np.median(steps)) < MANY)


def _computed(problems: Sequence[Sequence[Record]], which: Which, look: str) -> bool:
    """Whether a computer makes an input of a loop: it holds what comes back with the noise, or walks."""
    own = [rec for records in problems for rec in records if which.look in ("", _look(rec, which.name))]
    return look in COMPUTED or (look == "smooth" and all(restless(rec[which.name]) for rec in own))


def _open(problems: Sequence[Sequence[Record]], name: str) -> dict[Which, tuple[str, str]]:
    """What an input that nobody declared looks like where it moves, and how that is read, by these looks.

    What looks held, which most often was, comes last: the others are asked beside it.
    """
    channel, looks = problems[0][0].inputs.index(name), dict[str, str]()
    for rec in (rec for records in problems for rec in records):
        if rec._seen.get(name) != "rest":
            looks.setdefault(_look(rec, name), rec.intersample[channel])
    apart = len(looks) > 1
    return {
        Which(name, look if apart else ""): (look, looks[look])
        for look in sorted(looks, key="zoh".__eq__)
        if look
    }


def _on_bands(
    problems: Sequence[tuple[Record, ...]],
    fits: Sequence[Fit],
    words: Mapping[Which, Word],
    structure: Any,
    fit_once: FitOnce,
) -> list[Fit | None]:
    """Fits of the problems read so, each on the band of its fit."""
    return [
        _fit(
            read_as(records, words),
            structure,
            on_band(fit, fit.band),
            fit_once,
            **starts_beside(fit, structure),
        )
        for records, fit in zip(problems, fits, strict=True)
    ]


def _gain(fits: Sequence[Fit | None], others: Sequence[Fit | None]) -> float:
    """By how much others lower BIC; nan where one has no answer, or is unstable where the fit is not."""
    pairs = zip(fits, others, strict=True)
    return sum(
        _lower(fit, other)
        if fit is not None and other is not None and not growth(other) > 0 >= growth(fit)
        else nan
        for fit, other in pairs
    )


def _lower(fit: Fit, other: Fit) -> float:
    """By how much another reading lowers BIC: that of samples where lines hold much that none measured."""
    if measured_lines(fit):
        return score(fit, fit) - score(other, fit)
    try:
        with np.errstate(all="ignore"):
            return lower_by_samples(fit, other)
    except (ModfunError, np.linalg.LinAlgError):  # the response of one runs away
        return nan


def _lower_by_response(fits: Sequence[Fit], others: Sequence[Fit | None]) -> float:
    """By how much others lower BIC of the samples, each led on to the least squares of its response."""
    pairs = zip(fits, others, strict=True)
    try:
        with np.errstate(all="ignore"):
            return sum(lower_by_samples(by_response(a), by_response(b)) for a, b in pairs if b is not None)
    except (ModfunError, np.linalg.LinAlgError):  # a response runs away
        return nan


def _apart(fits: Sequence[Fit], others: Sequence[Fit | None]) -> bool:
    """Whether both readings make estimates that differ by more than their errors in steady noise."""
    return any(
        bool(np.any(np.abs(other.params - fit.params) > _far(fit) * _steady_errors(other)))
        for fit, other in zip(fits, others, strict=True)
        if other is not None and fit.param_names and fit.param_names == other.param_names
    )


def _steady_errors(fit: Fit) -> F64:
    return root(np.diag(Estimates.cov_params(fit)))


def _far(fit: Fit) -> F64:
    """By how many standard errors estimates of a parameter differ at least; free delays come last."""
    late = len(fit.layout.free_delays) if fit.layout.rational else 0
    return np.array([FAR] * (fit.params.size - late) + [LATE] * late)


def _contradicted(fit: Fit) -> bool:
    """Whether another reading is worth a fit: those of equations take long, so that residuals decide."""
    return fit.layout.rational or suspicious(fit)


def _out_of_time(fit: Fit, name: str) -> float:
    """What another channel at its own time would lower BIC by: half a sample of delay makes up for some."""
    found = realigned(fit)
    return max(found.before - found.after, 0.0) if found and found.shift.channel != name else 0.0


def _imitated(fit: Fit, other: Fit | None) -> bool:
    """Whether a real pole as fast as the samples stands for a hold, with which the other has one pole less.

    Half a sample late is a pole at -2/dt, or with a zero beside it one from -1/dt on.
    """
    if other is None or not other.order < fit.order:
        return False
    poles: Any = fit.model.poles()
    step = max(rec.duration / rec.intervals for rec in fit.records or ())
    return bool(np.any((poles.imag == 0) & (np.abs(poles) * step >= 1)))


def _fed_back(fit: Fit) -> bool:
    """Whether a loop brings the noise back to an input, which most often is closed by a computer."""
    found = feedback(fit)
    return found is not None and found.p_value < UNLIKELY


def _fit(
    records: Any,
    structure: Any,
    options: Options,
    fit_once: FitOnce,
    **starts: Any,
) -> Fit | None:
    """A fit with an answer; what is wrong without one, the fit of the user says."""
    try:
        fit = fit_once(records, structure, options, **starts)
    except ModfunError:
        return None
    return fit if fit.usable else None
