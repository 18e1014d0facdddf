"""Signals made of steps: doublets, multisteps and pseudo-random binary sequences, held or rate limited."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, floor, pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arguments import public
from ..base.arrays import F64
from ..errors import SpecError
from .checks import amplitudes_of, band_of, intervals_of, number, one_input, samples_of
from .signals import Signals

__all__ = ["doublet", "multistep", "prbs"]

DOUBLET = 2.331122370414423  # tan(x/2) = x: a doublet of width x/ω has most energy at ω
MULTISTEP = pi / 2  # a pulse of two units is half a period of the mode
HALF_POWER = 2.7831  # (sin(x/2)/(x/2))² = 1/2: what is held for x/ω has half its power at ω
# Feedback taps of shift registers of maximum length 2ⁿ − 1, n = 2 … 20 (primitive polynomials).
TAPS = {
    2: (2, 1), 3: (3, 2), 4: (4, 3), 5: (5, 3), 6: (6, 5), 7: (7, 6), 8: (8, 6, 5, 4), 9: (9, 5), 10: (10, 7),
    11: (11, 9), 12: (12, 6, 4, 1), 13: (13, 4, 3, 1), 14: (14, 5, 3, 1), 15: (15, 14), 16: (16, 15, 13, 4),
    17: (17, 14), 18: (18, 11), 19: (19, 6, 2, 1), 20: (20, 17),
}  # fmt: skip


@public
def doublet(
    input: str = "u",
    *,
    dt: float,
    width: float | None = None,
    omega: float | None = None,
    amplitude: ArrayLike = 1.0,
    rate: float | None = None,
    before: float = 0.0,
    after: float | None = None,
    duration: float | None = None,
) -> Signals:
    """A doublet: up for a width, down for as long.

    Parameters
    ----------
    input : str
        Name of the input.
    dt : float
        Sampling interval, s.
    width : float
        Length of each pulse, s, a whole number of dt. Give this or `omega`.
    omega : float
        Natural frequency of the mode to be excited, rad/s. The width is 2.33/omega, to the nearest sample:
        the energy spectrum of a doublet of width x/ω, sin⁴(x/2)/x², is highest where tan(x/2) = x.
    amplitude, rate, before, after, duration
        As in `multistep`.

    Returns
    -------
    Signals

    See Also
    --------
    modfun.signals.multistep : Steps of several lengths.
    modfun.crlb : What an input is worth.

    References
    ----------
    V. Klein, E. A. Morelli, Aircraft System Identification, AIAA, 2006, chapter 9.

    Examples
    --------
    >>> import modfun as mf
    >>> de = mf.signals.doublet("de", omega=3.0, dt=0.02, amplitude=2.0, before=1.0, duration=10.0)
    >>> int((de.u == 2).sum()) * 0.02  # the width: 2.33/3 s
    0.78
    """
    what = "doublet"
    unit = _unit(what, "width", width, omega, dt, DOUBLET)
    return _pulses(what, input, [1, 1], unit, dt, amplitude, rate, before, after, duration)


@public
def multistep(
    input: str = "u",
    pulses: Sequence[float] = (3, 2, 1, 1),
    *,
    dt: float,
    unit: float | None = None,
    omega: float | None = None,
    amplitude: ArrayLike = 1.0,
    rate: float | None = None,
    before: float = 0.0,
    after: float | None = None,
    duration: float | None = None,
) -> Signals:
    """Pulses of alternating sign: 3-2-1-1, 2-1-1, or any widths.

    Parameters
    ----------
    input : str
        Name of the input.
    pulses : sequence of float, default (3, 2, 1, 1)
        Widths in units.
    dt : float
        Sampling interval, s.
    unit : float
        Length of a pulse of width 1, s; each pulse must be a whole number of dt. Give this or `omega`.
    omega : float
        Natural frequency of the mode to be excited, rad/s. The unit is π/(2 omega), to the nearest sample,
        so that a pulse of width 2 is half a period of the mode: the customary rule of flight test, which
        puts the mode in the middle of the band of a 3-2-1-1 (half of its highest energy density at least
        from 0.28/unit to 2.65/unit rad/s).
    amplitude : float or sequence of float, default 1
        Height of the first pulse, the others alternate in sign; negative begins downwards. Or a height a
        pulse, before the alternation.
    rate : float, optional
        Fastest change a second: ramps instead of steps, since actuators do not jump. Each sample goes
        towards the step by at most rate·dt. Default: steps.
    before : float, default 0
        Rest at zero before, s.
    after : float, default 0
        Rest at zero after, s. Or say how long it all is:
    duration : float, optional
        Length of the record, s, rests included.

    Returns
    -------
    Signals
        "zoh" between samples, with a `rate` "foh".

    Raises
    ------
    SpecError
        Arguments that do not fit each other; pulses shorter than the ramp to them.

    See Also
    --------
    modfun.signals.doublet : Two steps.
    modfun.crlb : What an input is worth.

    References
    ----------
    V. Klein, E. A. Morelli, Aircraft System Identification, AIAA, 2006, chapter 9.

    Examples
    --------
    >>> import modfun as mf
    >>> mf.signals.multistep("de", [2, 1, 1], unit=0.2, dt=0.1).u
    array([[ 1.,  1.,  1.,  1., -1., -1.,  1.,  1.,  0.]])
    """
    what = "multistep"
    try:
        widths = [float(w) for w in pulses]
    except Exception:  # of whatever the conversion of unknown objects raises
        widths = []
    if not widths or isinstance(pulses, str) or not all(np.isfinite(w) and w > 0 for w in widths):
        raise SpecError(f"multistep: pulses={pulses!r} must be widths above 0 in units, as [3, 2, 1, 1]")
    one = _unit(what, "unit", unit, omega, dt, MULTISTEP)
    return _pulses(what, input, widths, one, dt, amplitude, rate, before, after, duration)


@public
def prbs(
    input: str = "u",
    *,
    dt: float,
    band: Any = None,
    clock: float | None = None,
    duration: float | None = None,
    amplitude: float = 1.0,
    seed: int = 0,
    rate: float | None = None,
    before: float = 0.0,
    after: float = 0.0,
) -> Signals:
    """A pseudo-random binary sequence of maximum length: ±amplitude, changing at ticks of a clock.

    Parameters
    ----------
    input : str
        Name of the input.
    dt : float
        Sampling interval, s.
    band : (float, float) or float
        Where power is wanted, rad/s. The clock is the longest whole number of dt with at least half the
        power density at the upper edge, clock ≤ 2.78/upper; the sequence of 2ⁿ − 1 ticks is the shortest
        whose fundamental, 2π/(ticks·clock), is not above the lower edge. One number is the upper edge; the
        sequence is then as long as `duration` allows. Give this or `clock`.
    clock : float
        Seconds between ticks, a whole number of dt.
    duration : float, optional
        Length of the record, s, rests included. The sequence is repeated or cut to fill it. Default: one
        period and the rests; with `clock` or one edge it is needed.
    amplitude : float, default 1
        Largest `|u|`.
    seed : int, default 0
        Where in its period the sequence begins.
    rate : float, optional
        As in `multistep`.
    before, after : float, default 0
        Rests at zero, s.

    Returns
    -------
    Signals
        "zoh" between samples, with a `rate` "foh".

    Raises
    ------
    SpecError
        Arguments that do not fit each other.

    See Also
    --------
    modfun.signals.multisine : Sums of sines.
    modfun.crlb : What an input is worth.

    References
    ----------
    V. Klein, E. A. Morelli, Aircraft System Identification, AIAA, 2006, chapter 9.

    Examples
    --------
    >>> import modfun as mf
    >>> de = mf.signals.prbs("de", band=(0.5, 10), dt=0.02)  # clock .26 s, 63 ticks
    >>> round(de.duration, 2)
    16.38
    """
    what = "prbs"
    name, step = one_input(what, input), number("prbs: dt", dt)
    if (band is None) == (clock is None):
        raise SpecError("prbs: give band= in rad/s, or clock= in s, one of them")
    rests = sum(samples_of(f"prbs: {k}", v, step) for k, v in (("before", before), ("after", after)))
    order = None
    if band is None:
        tick = samples_of("prbs: clock", clock, step, strict=True)
    else:
        low, high = band_of(what, band, step)
        tick = floor(HALF_POWER / (high * step) + 1e-9)
        if tick < 1:
            raise SpecError(
                f"prbs: a clock of 2.78/{high:g} s for the upper edge is shorter than dt={step:g} s; lower "
                "the band or dt"
            )
        if low > 0:
            order = next((n for n in TAPS if (2**n - 1) * tick * step * low >= 2 * pi * (1 - 1e-9)), None)
            if order is None:
                raise SpecError(f"prbs: band={band!r} asks for more than 2^20 ticks; raise its lower edge")
    if order is None:
        if duration is None:
            raise SpecError("prbs: say how long it is, duration= in s, or give both edges of the band")
        room = (samples_of("prbs: duration", duration, step, strict=True) - rests) // tick
        order = max((n for n in TAPS if 2**n - 1 <= room), default=2)
    length = (2**order - 1) * tick * step + rests * step if duration is None else duration
    step, lead, count, tail = intervals_of(what, length, step, before, after)
    sequence = _sequence(order, seed)
    ticks = np.resize(sequence, ceil(count / tick))
    if np.ptp(ticks) == 0:
        raise SpecError(
            f"prbs: {count * step:g} s hold {ticks.size} tick(s) of {tick * step:g} s, and the sequence "
            "never changes; give a longer duration or a shorter clock"
        )
    target = np.concatenate([np.zeros(lead), np.repeat(ticks, tick)[:count], np.zeros(tail + 1)])
    peak = float(amplitudes_of("prbs: amplitude", amplitude, 1)[0])
    return _limited(what, name, peak * target, step, rate, tick)


def _sequence(order: int, seed: int) -> F64:
    """One period of ±1 from a shift register, begun at a place that the seed chooses."""
    if not isinstance(seed, int | np.integer) or isinstance(seed, bool) or seed < 0:
        raise SpecError(f"prbs: seed={seed!r} must be a whole number of at least 0")
    length = 2**order - 1
    state, taps = [1] * order, [tap - 1 for tap in TAPS[order]]
    bits = np.empty(length)
    for k in range(length):
        bits[k] = state[-1]
        state = [sum(state[tap] for tap in taps) % 2, *state[:-1]]
    start = int(np.random.default_rng(seed).integers(length)) if seed else 0
    return np.roll(2 * bits - 1, -start)


def _unit(what: str, name: str, given: Any, omega: Any, dt: Any, rule: float) -> float:
    step = number(f"{what}: dt", dt)
    if (given is None) == (omega is None):
        raise SpecError(f"{what}: give {name}= in s, or omega= of the mode in rad/s, one of them")
    if given is not None:
        return number(f"{what}: {name}", given)
    return max(round(rule / number(f"{what}: omega", omega) / step), 1) * step


def _pulses(
    what: str, input: Any, widths: Sequence[float], unit: float, dt: float, amplitude: ArrayLike, rate: Any,
    before: float, after: float | None, duration: float | None,
) -> Signals:  # fmt: skip
    name, step = one_input(what, input), number(f"{what}: dt", dt)
    counts = [samples_of(f"{what}: a pulse of {w:g} units", w * unit, step, strict=True) for w in widths]
    if duration is None:
        rests = samples_of(f"{what}: before", before, step) + samples_of(f"{what}: after", after or 0.0, step)
        duration = (sum(counts) + rests) * step
    elif after is not None:
        raise SpecError(f"{what}: give after= or duration=, one of them")
    step, lead, count, _ = intervals_of(what, duration, step, before, 0.0)
    if count < sum(counts):
        raise SpecError(
            f"{what}: the pulses last {sum(counts) * step:g} s, and duration={duration:g} s leaves "
            f"{count * step:g} s after before={before:g} s; raise duration or shorten the pulses"
        )
    heights = amplitudes_of(f"{what}: amplitude", amplitude, len(widths))
    heights = heights * (-1.0) ** np.arange(len(widths))
    rest = np.zeros(count - sum(counts) + 1)
    return _limited(
        what,
        name,
        np.concatenate([np.zeros(lead), np.repeat(heights, counts), rest]),
        step,
        rate,
        min(counts),
    )


def _limited(what: str, name: tuple[str, ...], target: F64, dt: float, rate: Any, shortest: int) -> Signals:
    """Held steps, or ramps towards them at a rate that reaches the shortest pulse's height."""
    if rate is None:
        return Signals(target, dt, name, "zoh")
    most = number(f"{what}: rate", rate) * dt
    jump = float(np.abs(np.diff(target, prepend=0.0)).max())
    if jump > most * shortest * (1 + 1e-9):
        raise SpecError(
            f"{what}: at rate={rate:g} a change by {jump:g} takes {jump / rate:.4g} s, the shortest "
            f"pulse lasts {shortest * dt:g} s; raise rate or lengthen the pulses"
        )
    u = np.zeros(target.size)
    for k in range(1, target.size):
        left = target[k - 1] - u[k - 1]
        u[k] = target[k - 1] if abs(left) <= most else u[k - 1] + np.sign(left) * most
    if u[-1] != 0:
        raise SpecError(
            f"{what}: at rate={rate:g} the input is still at {u[-1]:g} when the record ends; give after= at "
            f"least {np.ceil(abs(u[-1]) / most) * dt:g} s more"
        )
    return Signals(u, dt, name, "foh")
