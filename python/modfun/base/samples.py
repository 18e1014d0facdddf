"""Rules about samples, channel names and times; each is stated here and nowhere else."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import DataError, SpecError
from .arguments import real, reals, whole
from .arrays import F64
from .between import AUTO
from .names import nearest
from .words import INTERSAMPLE

Array = TypeVar("Array", bound=NDArray[Any])
Names = str | Sequence[str] | None

FEWEST = 8  # samples a record must have
LARGEST = 1e151  # of a sample: squares of a million of them are still numbers
PARTS = 10  # of the mean step: a grid for samples at any times
MOST_PARTS = 100  # the same, a grid of the times' own
MOST_SAMPLES = 10**7  # a simulation may make
TEXTS = "convert the texts to numbers first, or let modfun.read do it; names go to inputs= and outputs="
ROUNDED = 0.6  # of a step: how far a clock that is rounded, to a step at most, may stray from an even grid
EVEN = 1e-6  # of a step: what times may stray from an even grid and still be called even


@dataclass(frozen=True)
class Origin:
    """The file that samples were read from: its name without folders, and the SHA-256 of its bytes."""

    name: str
    sha256: str


def frozen(values: Array) -> Array:
    """Return a read-only, C-contiguous view or copy; the caller's own array stays as it is."""
    array = np.ascontiguousarray(values).view()
    array.flags.writeable = False
    return array  # type: ignore[return-value]


def floats(values: ArrayLike, what: str) -> F64:
    if isinstance(values, np.ma.MaskedArray) and np.ma.getmaskarray(values).any():
        raise DataError(
            f"Record: {what} has {int(np.ma.getmaskarray(values).sum())} masked samples, which a fit would "
            "use all the same; of y give y=y.data, mask=~y.mask, else cut the record there or fill them"
        )
    try:
        array = np.asarray(values)
    except Exception:  # of whatever the conversion of an unknown object raises
        raise DataError(
            f"Record: {what} is ragged; all its channels must have the same number of samples"
        ) from None
    if array.dtype.kind not in "biuf":
        cure = {
            "c": "give real and imaginary part as two channels",
            "O": "give numbers; missing values and text must be dealt with first",
            "U": TEXTS,
            "S": TEXTS,
        }.get(array.dtype.kind, "give numbers")
        raise DataError(
            f"Record: {what} holds {array.dtype.name} values where real numbers are needed; {cure}"
        )
    return reals("Record", what, array, DataError)


def channels_of(values: ArrayLike, what: str, axis: int) -> F64:
    """Return a fresh array (channel, time)."""
    array = np.array(floats(values, what), order="C")
    if array.ndim == 1:
        array = array[None, :]
    elif array.ndim != 2:
        step = "; give a sampling interval by its name, dt=" if what == "u" and array.ndim == 0 else ""
        raise DataError(
            f"Record: {what} has {array.ndim} dimensions; it must be 1-D (time) or 2-D (channel, time){step}"
        )
    elif axis == 0:
        array = np.ascontiguousarray(array.T)
    elif axis not in (-1, 1):
        raise SpecError(f"Record: axis={axis!r}; the axis of time is -1 (last) or 0 (first)")
    if array.size == 0:
        raise DataError(f"Record: {what} is empty")
    if array.shape[0] > array.shape[1]:
        cure = "leave axis=0 out" if axis == 0 else "if time runs along the first axis, give axis=0"
        raise DataError(
            f"Record: {what} would have {array.shape[0]} channels of {array.shape[1]} samples; {cure}"
        )
    return array


def refuse_nonfinite(names: Sequence[str], values: F64) -> None:
    if not np.isfinite(values).all():
        _refuse_gaps(names, values)
    largest = np.abs(values).max(axis=1, initial=0.0)
    if largest.size and largest.max() > LARGEST:
        worst = int(np.argmax(largest))
        raise DataError(
            f"Record: channel {names[worst]!r} reaches {largest[worst]:.3g}, whose square overflows; give "
            "it in another unit"
        )


def _refuse_gaps(names: Sequence[str], values: F64) -> None:
    for name, channel in zip(names, values, strict=True):
        bad = np.flatnonzero(~np.isfinite(channel))
        if bad.size:
            raise DataError(
                f"Record: channel {name!r} has {bad.size} values that are not finite, the first at index "
                f"{bad[0]} ({channel[bad[0]]}); cut the record there, fill the gap before, or leave samples "
                "of outputs out with mask=, False where they are to be ignored"
            )


def frequencies(omega: ArrayLike, what: str) -> F64:
    """Angular frequencies in rad/s: one list, finite."""
    found = np.atleast_1d(reals(what, "omega", omega, DataError))
    if found.ndim != 1 or not np.all(np.isfinite(found)):
        raise DataError(f"{what}: omega must be one list of finite angular frequencies in rad/s")
    return found


def band_edges(what: str, band: Any) -> tuple[float, float]:
    """Lower and upper edge in rad/s; one number is the upper edge, the lower one is then 0."""
    several = isinstance(band, tuple | list) or (isinstance(band, np.ndarray) and band.ndim)
    edges = band if several else (0.0, band)
    if len(edges) != 2:
        raise SpecError(f"{what}: band={band!r} must be the upper edge or (lower, upper), in rad/s")
    low, high = (real(what, "band", edge) for edge in edges)
    if not 0 <= low < high:
        raise SpecError(
            f"{what}: band={band!r} must satisfy 0 <= lower < upper (rad/s; an edge in Hz times 2 pi)"
        )
    return low, high


def listed(names: Names) -> tuple[str, ...]:
    return (names,) if isinstance(names, str) else () if names is None else tuple(names)


def numbered(letter: str, count: int) -> tuple[str, ...]:
    """Names of so many channels that nobody named: y, or y1, y2, …."""
    return (letter,) if count == 1 else tuple(f"{letter}{k}" for k in range(1, count + 1))


def apart(values: Any, names: Names, letter: str, option: str) -> tuple[Any, Names]:
    """Samples and names of a mapping from one to the other; anything else as it is."""
    if not isinstance(values, Mapping):
        return values, names
    if names is not None:
        raise SpecError(f"Record: {letter} names its channels, as does {option}; leave {option} out")
    return [floats(own, f"channel {name!r}") for name, own in values.items()], list(values)


def names_of(given: Names, count: int, letter: str, option: str) -> tuple[str, ...]:
    if given is None:
        return numbered(letter, count)
    names = listed(given)
    if len(names) != count:
        raise SpecError(
            f"Record: {option} names {len(names)} channels ({', '.join(map(str, names))}), {letter} has "
            f"{count}"
        )
    for name in names:
        if not isinstance(name, str) or not name.strip():
            raise SpecError(f"Record: {option} holds {name!r}; names are texts that are not empty")
    return tuple(str(name) for name in names)


def refuse_duplicates(names: Sequence[str]) -> None:
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise SpecError(
            f"Record: {', '.join(map(repr, twice))} names more than one channel; names must differ"
        )


def intersample_of(
    given: str | Sequence[str] | Mapping[str, str], inputs: tuple[str, ...]
) -> tuple[str, ...]:
    """Return one word an input as users give them, "auto" where they leave it to the samples."""
    if isinstance(given, Mapping):
        for name in given:
            if name not in inputs:
                raise SpecError(
                    f"Record: intersample names {name!r}, which is not an input; {nearest(name, inputs)}"
                )
        words = tuple(given.get(name, AUTO) for name in inputs)
    elif isinstance(given, str):
        words = (given,) * len(inputs)
        given = (given,)  # an unknown word is refused also where there is no input yet
    else:
        if given is None:
            raise SpecError(f"Record: intersample=None; {nearest('None', (AUTO, *INTERSAMPLE))}")
        words = tuple(given)
        if len(words) != len(inputs):
            raise SpecError(
                f"Record: intersample has {len(words)} words for {len(inputs)} inputs; one for all or one "
                "each"
            )
    for word in (*words, *(given if not isinstance(given, Mapping) else ())):
        if word not in (AUTO, *INTERSAMPLE):
            raise SpecError(f"Record: intersample {word!r} is unknown; {nearest(word, (AUTO, *INTERSAMPLE))}")
    return words


def steps_of(dt: Any, intervals: Any) -> tuple[float, int]:
    """Step and number of intervals of a simulation, checked."""
    step = real("simulating", "dt", dt)
    if not step > 0:
        raise DataError(f"simulating: dt is {dt}; give the sampling interval in seconds, above 0")
    count = whole("simulating", "intervals", intervals, 0, MOST_SAMPLES)
    if count < 1:
        raise DataError(f"simulating: {count} intervals; at least 1, that is two samples, are needed")
    if not step < 1e150:
        raise SpecError(f"simulating: a step of {step!r} s is out of range; give time in another unit")
    return step, count


def positive(value: float, option: str, unit: str) -> float:
    number = real("Record", option, value, finite=False)
    if not (math.isfinite(number) and number > 0):
        raise SpecError(f"Record: {option}={value!r} must be a positive number of {unit}")
    return number


def times_of(
    count: int, dt: float | None, fs: float | None, t: ArrayLike | None, t0: float
) -> tuple[F64, float | None]:
    """Return the times and the step, None where the steps are uneven."""
    given = [name for name, value in (("dt", dt), ("fs", fs), ("t", t)) if value is not None]
    if len(given) != 1:
        found = f"{' and '.join(given)} were given" if given else "none was given"
        raise SpecError(f"Record: give exactly one of dt= (seconds), fs= (hertz) and t= (times); {found}")
    if t is None:
        step = positive(dt, "dt", "seconds") if dt is not None else 1.0 / positive(fs or 0.0, "fs", "hertz")
        if not 1e-150 < step < 1e150:
            raise SpecError(f"Record: a step of {step!r} s is out of range; give time in another unit")
        times = np.asarray(real("Record", "t0", t0) + step * np.arange(count), dtype=np.float64)
        if not (np.diff(times) > 0).all():
            raise SpecError(f"Record: t0={t0!r} is too large for steps of {step:g} s; count time from later")
        return times, step
    if not (isinstance(t0, float | int) and t0 == 0):
        raise SpecError("Record: t0= goes with dt= or fs=; t= has its own start")
    try:
        read: Any = t if isinstance(t, np.ndarray) else np.asarray(t)
    except Exception:  # of whatever an unknown object raises
        read = floats(t, "t")
    if read.dtype.kind in "mM":  # dates or time differences: seconds from the first sample
        read = (read - read[:1]) / np.timedelta64(1, "s")
    times = floats(read, "t")
    if times.shape != (count,):
        raise DataError(
            f"Record: t has shape {times.shape}, it must have one value for each of the {count} samples"
        )
    if not np.isfinite(times).all():
        bad = int(np.flatnonzero(~np.isfinite(times))[0])
        raise DataError(
            f"Record: t is {times[bad]} at index {bad}; every sample needs its time: cut the record there"
        )
    with np.errstate(over="ignore"):
        steps = np.diff(times)
    if not (steps > 0).all():
        bad = int(np.flatnonzero(steps <= 0)[0])
        if coarse := coarse_clock(times):
            count, step = coarse
            raise DataError(
                f"Record: time does not increase at index {bad + 1}: t is {times[bad]:.10g} in {count} "
                f"samples in a row, by a clock with steps of {count * step:.4g} s, too coarse for the "
                f"samples; give dt={step:.6g} instead of the times"
            )
        raise DataError(
            f"Record: time does not increase at index {bad + 1}: t = {times[bad]:.10g}, then "
            f"{times[bad + 1]:.10g}; sort the samples, merge rows of one time (pandas: "
            "frame.groupby('t').first()), drop repeated ones, or give dt= if the clock is at fault"
        )
    if not 1e-150 < float(np.max(steps)) < 1e150:
        raise SpecError("Record: the steps of t are out of range; give time in another unit")
    mean = even_step(times)
    return (times, None) if mean is None else (times[0] + mean * np.arange(count), mean)


def coarse_clock(times: F64) -> tuple[int, float] | None:
    """Samples for each reading of a clock that is too coarse for them, and their step; None of other clocks.

    Readings repeat in runs of one length, give or take one; the first and the last run may be cut.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # of times out of range
        steps = np.diff(times)
        at = np.flatnonzero(steps)
        if at.size < 3 or not (steps[at] > 0).all():
            return None
        runs, jump = np.diff(at), float(np.mean(steps[at]))
        even = np.ptp(runs) <= 1 and np.ptp(steps[at]) <= EVEN * jump
    count = float(np.mean(runs))
    return (round(count), jump / count) if even and runs.min() > 1 and at[0] < runs.max() else None


def even_step(times: F64, rows: F64 | None = None) -> float | None:
    """Return the mean step of increasing times where they are even, else None.

    With `rows`, of a grid of which the times are these rows, counted from the first.

    Even means to 1e-6 of a step, or to the decimals the times were written with: 0.017, 0.033, 0.050 are
    sixtieths. Rounding coarser than a tenth of a step says nothing, so there it does not count.
    """
    at = np.arange(len(times)) if rows is None else rows
    step = float(times[-1] - times[0]) / float(at[-1])
    stray = float(np.abs(times - times[0] - step * at).max())
    largest = float(np.abs(times).max())
    slack = EVEN * step + 4 * float(np.finfo(np.float64).eps) * largest
    if stray > slack:  # the largest times show it: of 9 significant digits, small times have more decimals
        late = times[np.abs(times) >= 10.0 ** math.floor(math.log10(largest))]
        for decimals in range(10):
            unit = 10.0**-decimals
            if unit <= 0.1 * step and np.abs(late - late.round(decimals)).max() <= 1e-15 * largest:
                slack = 1.01 * unit
                break
    return step if stray <= slack else None


def rounded_step(times: F64) -> float | None:
    """Return the mean step of uneven times that rounding may have made of even ones, else None.

    A unit of rounding of more than a step would make times stand still, so that none is off by much more
    than half a step.
    """
    step = float(times[-1] - times[0]) / (len(times) - 1)
    stray = float(np.abs(times - times[0] - step * np.arange(len(times))).max())
    return step if stray < ROUNDED * step else None


def grid_step(times: F64) -> float:
    """Return about a tenth of the mean step of uneven times, in steps of their own grid if they have one.

    On finer grids, of which nearly all samples are masked, searches go astray.
    """
    steps = np.diff(times)
    least, mean = float(steps.min()), float(steps.mean())
    for part in range(1, PARTS + 1):
        counts = part * steps / least
        if np.abs(counts - np.rint(counts)).max() < 1e-3 and part * mean < MOST_PARTS * least:
            return least / part * max(1, int(part * mean / (PARTS * least)))
    return float(f"{mean / PARTS:.2g}")
