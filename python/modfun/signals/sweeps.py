"""Frequency sweeps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.arguments import public, reals
from ..base.arrays import F64
from ..errors import SpecError
from .checks import amplitudes_of, band_of, intervals_of, number, one_input
from .signals import Signals

__all__ = ["chirp"]

SWEEPS = ("logarithmic", "linear")
FADE = 0.05  # of the sweep, at each end


@public
def chirp(
    input: str = "u",
    *,
    band: Sequence[float],
    duration: float,
    dt: float,
    amplitude: float = 1.0,
    sweep: str = "logarithmic",
    fade: float | None = None,
    before: float = 0.0,
    after: float = 0.0,
) -> Signals:
    """A frequency sweep, amplitude · sin ∫ω dt.

    Parameters
    ----------
    input : str
        Name of the input. For several, sweep one after the other: ``chirp("da", …).then(chirp("dr", …))``.
    band : (float, float)
        Frequency at the beginning and at the end, rad/s; a falling sweep has the higher one first.
    duration : float
        Length of the record, s, rests included.
    dt : float
        Sampling interval, s.
    amplitude : float, default 1
        Largest `|u|`.
    sweep : {"logarithmic", "linear"}
        Course of the frequency. Logarithmic: as long in each octave, as piloted sweeps are.
    fade : float, optional
        Seconds in which the amplitude rises from zero at the beginning, and falls to zero at the end, as
        sin²; default: a twentieth of the sweep. 0: none, the sweep then ends where it is.
    before, after : float, default 0
        Rests at zero, s.

    Returns
    -------
    Signals
        "smooth" between samples.

    Raises
    ------
    SpecError
        Arguments that do not fit each other.

    Examples
    --------
    >>> import modfun as mf
    >>> de = mf.signals.chirp("de", band=(0.5, 12), duration=60, dt=0.02, amplitude=2.0, before=3, after=3)
    >>> de.intervals, de.intersample
    (3000, ('smooth',))
    """
    what = "chirp"
    name = one_input(what, input)
    step, lead, count, _ = intervals_of(what, duration, dt, before, after)
    edges = reals(what, "band", band).ravel().tolist()
    if len(edges) != 2:
        raise SpecError(f"chirp: band={band!r} must be (first, last) frequency in rad/s")
    low, high = band_of(what, sorted(edges), step)
    if sweep not in SWEEPS:
        raise SpecError(f"chirp: sweep={sweep!r} is unknown; choose {' or '.join(map(repr, SWEEPS))}")
    if low == 0 and sweep == "logarithmic":
        raise SpecError(f"chirp: band={band!r} from 0 rad/s has no first octave; raise it, or sweep='linear'")
    length = count * step
    ends = FADE * length if fade is None else number("chirp: fade", fade, strict=False)
    if ends > length / 2:
        raise SpecError(
            f"chirp: fade={ends:g} s at both ends of a sweep of {length:g} s; at most a half of it"
        )
    first, last = (low, high) if edges[0] == low else (high, low)
    peak = float(amplitudes_of("chirp: amplitude", amplitude, 1)[0])
    function = _Sweep(first, last, length, lead * step, peak, sweep, ends)
    t: F64 = np.arange(round(duration / step) + 1.0) * step
    return Signals(function(t), step, name, "smooth", [function])


@dataclass(frozen=True)
class _Sweep:
    """The sweep at any time; zero outside."""

    first: float
    last: float
    length: float
    start: float
    amplitude: float
    sweep: str
    fade: float

    def __call__(self, t: F64) -> F64:
        s = t - self.start
        inside = (s >= 0) & (s <= self.length * (1 + 1e-12))
        s = np.clip(s, 0.0, self.length)
        if self.sweep == "linear":
            phase = self.first * s + (self.last - self.first) * s**2 / (2 * self.length)
        else:
            rate = np.log(self.last / self.first) / self.length
            phase = self.first * np.expm1(rate * s) / rate
        u = self.amplitude * np.sin(phase)
        if self.fade > 0:
            near = np.minimum(np.minimum(s, self.length - s) / self.fade, 1.0)
            u = u * np.sin(np.pi / 2 * near) ** 2
        return np.where(inside, u, 0.0)
