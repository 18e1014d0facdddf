"""What may be wrong with a record that is not wrong enough to refuse it, in words with numbers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64
from ..base.between import CLOSE, LOOP, form_of
from ..base.samples import rounded_step
from ..base.tables import Findings
from ..base.units import TIMES, counted_in
from .codes import codes_of
from .conversion import mixed_angles, mixed_inputs
from .dead_band import FROZEN, dead_band, dropouts, frozen, off_line, rounded_top
from .joints import joints
from .mask import leaving_out, runs
from .samples import Samples
from .slower import slow_samples
from .spectra import noise_table, spectrum_of
from .uneven_rows import bridged, unit_of_time, written_at_changes
from .uneven_rows import gaps as long_gaps

__all__ = [
    "bad_samples",
    "check_record",
    "dropped_samples",
    "frozen_samples",
    "remarks_for_fits",
]

CLEAN = 0.1  # percent of the rms: noise on a command that was recorded as it was given, at most
SPIKES = 0.05  # of the samples, at most: more are those of a channel that jumps
KINK = 0.5  # of a bend: what its neighbours bend back is all of it beside an outlying sample, none at a kink
SAID = 3  # times
RESTS = 10  # equal samples of an input: as many are a rest
SLOW = 10  # s: times without a unit and shorter steps are taken as seconds in silence
PAUSE = 20.0  # usual steps: what is longer is no lost row
MATTERS = 0.05  # of the rms of an output: what half a sample of delay may change and not be worth a word


def check_record(record: Samples) -> Findings:
    """Return the findings of `Record.check`."""
    sentences = [*_missing(record), *_clock(record), *_length(record), *_masked(record)]
    for name in (*record.outputs, *record.inputs):
        values = record[name]
        if values.min() == values.max():
            sentences.append(_constant(record, name))
            continue
        form = _form(record, name)
        sentences += _between_samples(record, name, form)
        if _measured(record, name, form):
            sentences += [*codes_of(record, name), *_clipped(record, name), *_stale(record, name)]
            sentences += _outliers(record, name)
        if name in record.outputs:
            sentences += _trend(record, name)
    sentences += [*_joined(record), *_noise(record), *_alike(record), *mixed_angles(record)]
    sentences += [text for _, text in mixed_inputs(record)]
    size = f"{len(record.t)} samples of {', '.join((*record.outputs, *record.inputs))}"
    return Findings(f"Record, {size}", sentences)


def remarks_for_fits(record: Samples) -> Iterator[tuple[str, str, str]]:
    """What bears on any fit of the record and its residuals may not show: kind, channel, sentence."""
    yield from (("rows", "", text) for text in _missing(record))
    yield from (("joint", "", text) for text in _joined(record))
    yield from (("angle", name, text) for name, text in mixed_inputs(record))
    for name in (*record.outputs, *record.inputs):
        if np.ptp(record[name]) == 0:
            continue
        form = _form(record, name)
        if name in record._seen:  # residuals show whether what is declared is wrong
            yield from (("between", name, text) for text in _doubtful(record, name, record._seen[name]))
        if _measured(record, name, form):
            yield from (("frozen", name, text) for text in frozen_samples(record, name))
            yield from (("dropouts", name, text) for text in dropped_samples(record, name))
            yield from (("code", name, text) for text in codes_of(record, name))
            yield from (("clipped", name, text) for text in _clipped(record, name))


def bad_samples(record: Samples, *, codes_only: bool = False) -> Iterator[str]:
    """What makes a fit fail though few samples are wrong: codes, dropouts, outlying samples of outputs."""
    for find in (codes_of,) if codes_only else (codes_of, dropped_samples, _outliers):
        # Commands move by steps that look like outlying samples.
        for name in record.outputs if find is _outliers else (*record.outputs, *record.inputs):
            found = list(find(record, name))
            if found and np.ptp(record[name]) and _measured(record, name, _form(record, name)):
                yield from found


def _form(record: Samples, name: str) -> str:
    """What an input looks like; nothing of an output."""
    return form_of(record[name], None if record.dt else record.t) if name in record.inputs else ""


def _measured(record: Samples, name: str, form: str) -> bool:
    """Whether a channel may be measured; others jump, repeat themselves or sit at extremes by design."""
    if name in record.outputs:
        return True
    return form in ("smooth", "rough", "walk") and record.intersample[record.inputs.index(name)] == "smooth"


def _missing(record: Samples) -> Iterator[str]:
    if record._lost is not None:
        starts, lengths = runs(record._lost)
        first, length = max(zip(starts, lengths, strict=True), key=lambda run: run[1])
        filled = " and their inputs filled in" if record.inputs else ""
        yield (
            f"{_count(int(lengths.sum()), 'row')} of {len(record.t)} are missing, {int(length)} in a row at "
            f"most, from t = {record.t[first]:g} s; their outputs are masked{filled}. Split the record there "
            f"if the inputs moved in the gap, rec.split(gap={length * float(record.dt or 0) / 2:.2g})."
        )


def _clock(record: Samples) -> Iterator[str]:
    usual = float(np.median(np.diff(record.t)))
    unit = counted_in(usual) if usual >= SLOW and not record._timed else None
    if unit and np.all(record.t == np.rint(record.t)):
        seconds, words = TIMES[unit]
        yield (
            f"Steps of {usual:g} are taken as seconds; if they are {words[-2]}, give dt={seconds * usual:g}, "
            "or the times in seconds."
        )
    if record.dt is not None:
        return
    steps = np.diff(record.t)
    if text := written_at_changes(record):
        yield text
        return
    gaps = np.flatnonzero(steps > 1.5 * usual)
    if gaps.size:
        worst, unit = int(np.argmax(steps)), unit_of_time(record)
        yield (
            f"Time has {_count(gaps.size, 'gap')}, the longest of {steps[worst]:.4g}{unit} at t = "
            f"{record.t[worst]:g}{unit} where {usual:.4g}{unit} is usual. {_fitted(record)}"
        )
        return
    grid = record.t[0] + record.duration / record.intervals * np.arange(len(record.t))
    stray = float(np.abs(record.t - grid).max()) / usual
    step, unit = rounded_step(record.t), unit_of_time(record)
    rounded = f" If the clock was only rounded, give dt={step:.6g} instead of the times." if step else ""
    yield (
        f"Steps are uneven, {steps.min():.4g} to {steps.max():.4g}{unit}, and times stray from an even grid "
        f"by up to {100 * stray:.2g} % of a step.{rounded}"
    )


def _fitted(record: Samples) -> str:
    """Which fits take times with gaps."""
    if not long_gaps(record).size:
        return "Split the record if inputs moved in a gap. Fits take such times as they are, but no delays."
    told = "Fits of an mf.Equation take such times as they are, others refuse them."
    return told if bridged(record) else "Fits refuse it, and say where to split the record."


def _joined(record: Samples) -> Iterator[str]:
    found = joints(record)
    if not found:
        return
    name, before, size = found[0]
    others = f", and {_count(len(found) - 1, 'other time')} in the outputs" if len(found) > 1 else ""
    after = record.t[np.searchsorted(record.t, before, side="right")]
    yield (
        f"Output {name!r} jumps by {size:.3g} after t = {before:.6g} s{others}, and no input does. If "
        f"records were joined end to end, fit the pieces as a list: "
        f"[rec.window({record.t[0]:.6g}, {before:.6g}), rec.window({after:.6g}, {record.t[-1]:.6g})]."
    )


def _masked(record: Samples) -> Iterator[str]:
    for name in record.outputs:
        good = record._good(name)
        if record._lost is not None:
            good = good | record._lost  # said already
        if good.all():
            continue
        starts, lengths = runs(~good)
        first, length = max(zip(starts, lengths, strict=True), key=lambda run: run[1])
        before, after = max(first - 1, 0), min(first + length, len(good) - 1)
        yield (
            f"Output {name!r}: {int((~good).sum())} of {len(good)} samples masked, {int(length)} in a "
            f"row at most, a gap of {record.t[after] - record.t[before]:.4g}{unit_of_time(record)} from t = "
            f"{record.t[before]:g}{unit_of_time(record)}."
        )


def _length(record: Samples) -> Iterator[str]:
    if len(record.t) < 50:
        yield f"There are only {len(record.t)} samples: expect wide intervals and a short band."
    steps = np.diff(record.t)
    if record.dt is None and steps.max() > PAUSE * np.median(steps):
        return  # across a pause spectra hold the jumps from one run to the next
    spectrum = spectrum_of(record)
    for name in record.outputs:
        power = spectrum[name] ** 2
        if not power.sum() > 0:
            continue
        rises = _above_floor(power)
        top = 1 + int(np.argmax(np.cumsum(rises) >= 0.95 * rises.sum()))
        if record.intervals / top < 6:
            yield (
                f"Output {name!r}: 95 % of its power lies below {top} periods a record, which is "
                f"{record.intervals / top:.1f} samples a period; noise covers it, or it is sampled too "
                "slowly."
            )
        if _slow(power) and not any(_slow(spectrum[u] ** 2) for u in record.inputs):
            yield (
                f"Output {name!r}: {100 * power[:2].sum() / power.sum():.0f} % of its power lies in the "
                f"lowest two harmonics; {record.duration:.4g} s are short for its slow motion."
            )


def _slow(power: F64) -> bool:
    """Whether nearly all of a spectrum is in its lowest two lines."""
    return bool(power[:2].sum() > 0.9 * power.sum() and power[0] > power[1])


def _above_floor(power: F64) -> F64:
    """Power without the noise that the upper half shows, unless there is hardly more."""
    above = power - np.mean(power[power.size // 2 :])
    return above if above.sum() > 0.2 * power.sum() else power


def _constant(record: Samples, name: str) -> str:
    value = record[name][0]
    if name in record.outputs:
        return f"Output {name!r} is {value:g} throughout: it says nothing about the system."
    begun = (
        "; if it stepped there from 0 at the first sample, give initial_state='zero' to the fit"
        if value
        else ""
    )
    left = [other for other in record.inputs if other != name]
    return (
        f"Input {name!r} is {value:g} throughout: no excitation, nothing can be learnt about its gain; leave "
        f"it out, rec.select(inputs={left}){begun}."
    )


def _changes(values: F64) -> NDArray[np.bool_]:
    return np.abs(np.diff(values)) > 1e-9 * float(np.ptp(values))


def _between_samples(record: Samples, name: str, form: str) -> Iterator[str]:
    """Say what contradicts the declaration of an input, or what its samples alone cannot decide."""
    if name not in record.inputs:
        return
    word = record.intersample[record.inputs.index(name)]
    if name in record._seen:
        yield from _doubtful(record, name, record._seen[name])
        return
    values = record[name]
    flat = int((~_changes(values)).sum())
    if form in ("held", "stairs") and word != "zoh":
        yield (
            f"Input {name!r} is declared {word} but holds its value over {flat} of {record.intervals} steps "
            "and jumps between; if it was held, give intersample='zoh'."
        )
    if form == "straight" and word == "smooth":
        bends = np.abs(np.diff(values, 2)) > 1e-9 * float(np.ptp(values))
        yield (
            f"Input {name!r} is declared smooth but consists of straight lines ({int(bends.sum())} bends); "
            "if it was interpolated so, give intersample='foh'."
        )
    if word == "zoh" and flat == 0 and _is_smooth(values):
        yield (
            f"Input {name!r} is declared zoh but changes smoothly at every sample; if it was not held, "
            "give intersample='smooth'."
        )


def _doubtful(record: Samples, name: str, form: str) -> Iterator[str]:
    """Say where nobody declared an input and its samples leave it open."""
    if form == "stairs":
        yield (
            f"Input {name!r} is assumed held: it goes up and down by one step at a time. If it was measured "
            "and coarsely rounded, give intersample='smooth'; else declare intersample='zoh'."
        )
    if form == CLOSE:
        yield (
            f"Input {name!r} is assumed held, since its samples repeat, but straight lines between them fit "
            "better, as in a simulation that interpolates. Declare what it was, intersample='zoh' or 'foh'."
        )
    if form == LOOP:
        yield (
            f"Input {name!r} is assumed held for one sample each, since a loop with a reference is mostly "
            "closed by a computer. If it was measured, give intersample='smooth'; else declare "
            "intersample='zoh'."
        )
    if form == "rough":
        yield (
            f"Input {name!r} is assumed smooth, but has power up to the highest frequencies. If each value "
            "was held for one sample, give intersample='zoh'; if that is noise, declare "
            "intersample='smooth'."
        )
    if form == "walk":
        yield (
            f"Input {name!r} is assumed smooth, but its changes are random from sample to sample, as those "
            "of a command. If each value was held for one sample, give intersample='zoh'; if it was "
            "measured, declare intersample='smooth'."
        )
    if form == "smooth" and (part := _half_a_sample(record, name)):
        yield (
            f"Input {name!r} is assumed smooth; a command held for one sample each looks the same, and is "
            f"half a sample late, which is {100 * part:.0f} % of an output. If it was held, give "
            "intersample='zoh'; else declare intersample='smooth'."
        )


def _half_a_sample(record: Samples, name: str) -> float:
    """Return what half a sample of delay changes of an output, as a part of it; 0 where it is no matter.

    It matters beyond the noise and `MATTERS`. Noise on an input says that it was measured.
    """
    if record.dt is None or record.intervals < 40:
        return 0.0
    noise = {row["channel"]: row for row in noise_table(record, 2)}
    if noise[name]["percent"] > CLEAN:
        return 0.0
    found = 0.0
    for output in record.outputs:
        values, sd = record[output], noise[output]["noise_sd"]
        shift = 0.5 * float(np.sqrt(max(np.mean(np.diff(values) ** 2) - 2 * sd**2, 0.0)))
        if shift > max(sd, MATTERS * float(values.std())) > 0:
            found = max(found, shift / float(values.std()))
    return found


def _is_smooth(values: F64) -> bool:
    return float(np.mean(np.diff(values, 2) ** 2)) < 0.05 * float(np.mean(np.diff(values) ** 2))


def _clipped(record: Samples, name: str) -> Iterator[str]:
    values = record[name]
    same = ~_changes(values)
    if same.mean() > 0.5:
        # Coarse steps or rest, said by _stale; unless it is at both ends that the samples stay.
        low, high = values == values.min(), values == values.max()
        between = ~((low[1:] & low[:-1]) | (high[1:] & high[:-1]))
        if min(low.mean(), high.mean(), between.mean()) < 0.05 or same[between].mean() > 0.1:
            return
    for end, extreme in (("largest", float(values.max())), ("smallest", float(values.min()))):
        there = (values == extreme) & record._good(name)
        if there[0]:  # at rest until the test begins
            there[: np.argmin(there)] = False
        if not there.any():
            continue
        starts, lengths = runs(there)
        if lengths.max() >= 4 and there.sum() >= 0.01 * len(values) and not rounded_top(values, extreme):
            where = record.t[starts[int(np.argmax(lengths))]]
            cure = f" If so, {leaving_out(record, name, f'rec[{name!r}] != {extreme!r}')}."
            yield (
                f"{_kind(record, name)} {name!r} may be clipped: {int(there.sum())} samples sit exactly at "
                f"its {end} value {extreme:g}, {int(lengths.max())} in a row from t = {where:g} s."
                + (cure if name in record.outputs else "")
            )


def _stale(record: Samples, name: str) -> Iterator[str]:
    values = record[name]
    if name in record.outputs and (width := dead_band(values)):
        yield (
            f"Output {name!r} keeps its value until it has changed by {width:.3g}, as a data historian "
            "stores it: responses look late and small. Store it without a dead band, or draw a curve "
            "between the stored values, as fit.check() says."
        )
        return
    slow = slow_samples(record, name) if name in record.outputs else ()
    if found := [*slow, *frozen_samples(record, name), *dropped_samples(record, name)]:
        yield from found
        return
    good = record._good(name)
    inside = (np.diff(values) == 0) & (values[1:] != values.max()) & (values[1:] != values.min())
    inside &= good[1:] & good[:-1]
    starts, lengths = runs(inside)
    longest = int(lengths.max(initial=0))
    rests = name in record.inputs and longest >= RESTS  # after a manoeuvre
    if not rests and (inside.mean() > 0.2 or longest >= max(10, 0.05 * len(values))):
        yield (
            f"{_kind(record, name)} {name!r}: {100 * inside.mean():.0f} % of its samples repeat the one "
            f"before, {longest + 1} equal ones from t = {record.t[starts[np.argmax(lengths)]]:g} s; stale, "
            "held or coarsely rounded samples?"
        )


def frozen_samples(record: Samples, name: str) -> Iterator[str]:
    """Say that a channel stood still in between, unless these samples are left out already."""
    found = frozen(record[name], record._good(name))
    if found is None:
        return
    first, last = found[0], found[0] + found[1] - 1
    if not off_line(record[name], first):  # one was measured, and repeated
        first += 1
    if np.count_nonzero(record._good(name)[found[0] : last + 1]) < FROZEN:
        return
    moving = f"(rec.t < {record.t[first]:.6g}) | (rec.t > {record.t[last]:.6g})"
    cure = leaving_out(record, name, moving) if name in record.outputs else "fill them in"
    yield (
        f"{_kind(record, name)} {name!r} is frozen: {found[1]} samples from t = {record.t[found[0]]:.6g} s "
        f"on are equal, and others hardly ever are. First {cure}."
    )


def dropped_samples(record: Samples, name: str) -> Iterator[str]:
    """Say that a measured channel drops to 0 or keeps its last value for a few samples, several times."""
    found = dropouts(record[name], record._good(name))
    if found is None or not _measured(record, name, _form(record, name)):
        return
    starts, lengths, zeros = found
    kept = f"rec[{name!r}] != 0" if zeros else f"np.r_[True, np.diff(rec[{name!r}]) != 0]"
    cure = leaving_out(record, name, kept)
    if name in record.inputs:
        still = zeros and np.count_nonzero(record[name] == 0) > lengths.sum()  # at rest, too
        cure = "fill them in from the samples beside them"
        if not still:
            cure += f", k = {kept} and rec.assign({name}=np.interp(rec.t, rec.t[k], rec[{name!r}][k]))"
    what = "exactly 0" if zeros else "equal to the one before, and others never are"
    yield (
        f"{_kind(record, name)} {name!r} drops out {starts.size} times: {int((lengths - (not zeros)).sum())} "
        f"samples, from t = {_first_times(record, starts)} s on, are {what}. First {cure}."
    )


def _first_times(record: Samples, places: NDArray[np.intp]) -> str:
    """The first times of these samples, in words."""
    shown = ", ".join([f"{time:.6g}" for time in record.t[places[:SAID]]])
    return f"{shown}, …" if places.size > SAID else shown


def _outliers(record: Samples, name: str) -> Iterator[str]:
    """Find single samples that stick out of both neighbours: a step, a lag of one, and a kink do not."""
    values, rise = record[name], np.diff(record[name])
    out = np.where(rise[:-1] * rise[1:] < 0, np.minimum(np.abs(rise[:-1]), np.abs(rise[1:])), 0.0)
    turn = 0.5 * np.diff(rise)
    bend, back = np.abs(turn), np.pad(turn, 1, "reflect" if turn.size > 1 else "constant")
    beside = np.maximum(np.append(bend[1:], 0.0), np.insert(bend[:-1], 0, 0.0))
    limit = max(15 * float(np.median(bend)), 1e-8 * float(np.ptp(values)), 0.5 * float(values.std()))
    single = (bend > 1.5 * beside) & (-np.sign(turn) * (back[:-2] + back[2:]) > KINK * bend)
    found = np.flatnonzero((bend > limit) & single & (out > 0.5 * bend)) + 1
    if 0 < found.size <= SPIKES * len(values) + 1:
        first = found[0]
        then = f", then at t = {_first_times(record, found[1:])} s" if found.size > 1 else ""
        before, own, after = values[first - 1 : first + 2]
        yield (
            f"{_kind(record, name)} {name!r} has {_count(found.size, 'outlying sample')}, the first at t = "
            f"{record.t[first]:g} s ({own:.4g} between {before:.4g} and {after:.4g}){then}."
        )


def _trend(record: Samples, name: str) -> Iterator[str]:
    slope, explained = _slope(record, name)
    driven = record.inputs and not any(_slope(record, u)[1] > 0.5 * explained for u in record.inputs)
    if explained > 0.5 and driven:  # free motion decays
        yield (
            f"Output {name!r} drifts by {slope:.4g} over the record, {100 * explained:.0f} % of its "
            "variance; if the sensor drifts, fit with trend='linear'; if the system integrates, leave it."
        )


def _slope(record: Samples, name: str) -> tuple[float, float]:
    """Rise of a channel over the record by the line through it, and the part of its variance that this is."""
    values = record[name]
    phase = (record.t - record.t[0]) / record.duration - 0.5
    phase = phase - phase.mean()
    slope = float(phase @ values / (phase @ phase))
    variance = float(values.var())
    return slope, slope**2 * float(np.var(phase)) / variance if variance > 0 else 0.0


def _noise(record: Samples) -> Iterator[str]:
    if record.dt is None or record.intervals < 40:  # fewer lines than that say little about a level
        return
    for row in noise_table(record, 2):
        if row["channel"] in record.outputs and row["percent"] > 30:
            yield (
                f"Output {row['channel']!r} is noisy: standard deviation {row['noise_sd']:.3g} in the upper "
                f"harmonics, {row['percent']:.0f} % of its rms; expect wide intervals, look at spectrum()."
            )


def _alike(record: Samples) -> Iterator[str]:
    moving = [name for name in record.inputs if np.ptp(record[name]) > 0]
    for k, one in enumerate(moving):
        for other in moving[k + 1 :]:
            r = float(np.corrcoef(record[one], record[other])[0, 1])
            if abs(r) > 0.98:
                yield (
                    f"Inputs {one!r} and {other!r} move together (correlation {r:.3f}): their effects can "
                    "hardly be told apart."
                )


def _kind(record: Samples, name: str) -> str:
    return "Output" if name in record.outputs else "Input"


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"
