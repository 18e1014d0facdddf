"""Multisines whose inputs are orthogonal, with phases that make their peaks low."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arguments import public, whole
from ..base.arrays import F64, I64
from ..errors import SpecError
from .checks import amplitudes_of, band_of, intervals_of, names_of
from .signals import Signals

__all__ = ["multisine"]

NORMS = (4, 8, 16, 32, 64, 128)  # powers of two: p-norms that close in on the largest |u|
STEPS = 80  # of the search, a norm
FINE = 16  # points a period of the highest line at which peaks are made low
FINER = 8  # times as many where the peak is measured


@public
def multisine(
    inputs: str | int | Sequence[str] = "u",
    *,
    band: float | Sequence[float],
    duration: float,
    dt: float,
    amplitude: ArrayLike = 1.0,
    power: ArrayLike | Callable[[F64], ArrayLike] | None = None,
    before: float = 0.0,
    after: float = 0.0,
    periods: int = 1,
    odd: bool = False,
    seed: int | None = None,
) -> Signals:
    """Orthogonal multisines with low relative peak factor, one per input.

    The lines are the multiples of 2π/T in the band, T the duration less the rests, dealt out to the inputs
    in turn: so inputs that move at once are orthogonal over T, and each covers the band. Phases start as
    Schroeder's and are then moved to make the largest `|u|` small (p-norms from 4 to 128). Each input is
    shifted in time so that it begins and ends at zero.

    Parameters
    ----------
    inputs : str, sequence of str or int
        Names of the inputs, or how many.
    band : float or (float, float)
        Upper edge, or lower and upper, rad/s. A lower edge of two or more periods in T, 4π/T, is usual.
    duration : float
        Length of one period, s, rests included.
    dt : float
        Sampling interval, s; eight samples per period of the upper edge are good.
    amplitude : float or sequence of float, default 1
        Largest `|u|`, of all inputs or one per input.
    power : array_like or callable, optional
        Relative power of each line in the band, in order of frequency, or a function of an array of rad/s
        that returns it. Default: the same for all.
    before, after : float, default 0
        Rests at zero, s.
    periods : int, default 1
        How often the sum repeats, without rests: the last sample is in the phase of the first.
    odd : bool
        Odd lines alone, and of each four in turn one left out, drawn by `seed`: what a response has on lines
        left out is distortion (`frf`).
    seed : int, optional
        Draws independent phases instead of those of a low peak: one realisation a seed.

    Returns
    -------
    Signals
        "smooth" between samples. ``.peak_factor`` is the value reached: 0.98 to 1.06 for one or two inputs,
        up to 1.13 for more, 1.2 with four lines an input.

    Raises
    ------
    SpecError
        Fewer lines than inputs; other arguments that do not fit each other.

    See Also
    --------
    modfun.signals.chirp : A sweep.
    modfun.crlb : What an input is worth.

    References
    ----------
    V. Klein, E. A. Morelli, Aircraft System Identification, AIAA, 2006, chapter 9. M. R. Schroeder,
    Synthesis of low-peak-factor signals, IEEE Trans. Inf. Theory 16, 1970.

    Examples
    --------
    >>> import modfun as mf
    >>> s = mf.signals.multisine(["de", "da"], band=(0.6, 12), duration=20, dt=0.02)
    >>> bool(abs(s.u[0, :-1] @ s.u[1, :-1]) < 1e-10), bool(s.peak_factor.max() < 1.02)
    (True, True)
    """
    what = "multisine"
    names = names_of(what, inputs)
    step, lead, count, _ = intervals_of(what, duration, dt, before, after)
    low, high = band_of(what, band, step)
    length = count * step
    base = 2 * np.pi / length
    lines = np.arange(max(int(np.ceil(low / base * (1 - 1e-12))), 1), int(high / base * (1 + 1e-12)) + 1)
    drawn = None if seed is None else np.random.default_rng(whole(what, "seed", seed, 0, 2**63))
    periods = whole(what, "periods", periods, 1, 10**6)
    if periods > 1 and (before or after):
        raise SpecError(f"multisine: periods={periods} repeats without rests; leave before and after out")
    if odd:
        lines = _odd(lines, drawn or np.random.default_rng(0))
    if lines.size < len(names):
        raise SpecError(
            f"multisine: the band {low:g} to {high:g} rad/s holds {lines.size} multiples of {base:.4g} rad/s "
            f"(one period in {length:g} s) for {len(names)} input(s); widen the band or raise duration"
        )
    sizes = np.sqrt(_power(power, np.asarray(lines * base, dtype=np.float64)))
    peaks = amplitudes_of("multisine: amplitude", amplitude, len(names))
    functions = []
    for k, (name, peak) in enumerate(zip(names, peaks, strict=True)):
        own, size = lines[k :: len(names)], sizes[k :: len(names)]
        if not np.any(size):
            raise SpecError(f"multisine: power= gives the lines of {name!r} none")
        if drawn is None:
            phases, top = low_peak(own[size > 0], size[size > 0])
        else:
            phases, top = _random(own[size > 0], size[size > 0], drawn)
        functions.append(
            _Sines(
                tuple((own[size > 0] * base).tolist()),
                tuple((peak / top * size[size > 0]).tolist()),
                tuple(phases.tolist()),
                lead * step,
                length * periods,
                drawn is not None,
            )
        )
    t: F64 = np.arange(round(periods * duration / step) + 1.0) * step
    return Signals([f(t) for f in functions], step, names, "smooth", functions)


def _odd(lines: I64, drawn: np.random.Generator) -> I64:
    """Odd lines, of each four in turn one left out."""
    odd = lines[lines % 2 == 1]
    groups = [odd[k : k + 4] for k in range(0, odd.size, 4)]
    return np.concatenate([np.delete(g, drawn.integers(4)) if g.size == 4 else g for g in groups])


def _random(lines: I64, sizes: F64, drawn: np.random.Generator) -> tuple[F64, float]:
    """Independent phases, and the peak of their sum."""
    phases = drawn.uniform(0.0, 2 * np.pi, lines.size)
    count = 1 << int(np.ceil(np.log2(FINE * lines[-1] + 1)))
    return phases, float(np.abs(_wave(lines, sizes, phases, FINER * count)).max())


def low_peak(lines: I64, sizes: F64) -> tuple[F64, float]:
    """Phases of Σ size·cos(line·τ + phase), 0 ≤ τ < 2π, with a low peak and zero at τ = 0; and the peak."""
    count = 1 << int(np.ceil(np.log2(FINE * lines[-1] + 1)))
    share = sizes**2 / np.sum(sizes**2)
    before = np.concatenate([[0.0], np.cumsum(share)[:-1]])
    found = []
    # Schroeder: as a sweep that stays at each line in proportion to its power; for lines apart by more than
    # 1 once through the whole period, and once through the part of it that repeats but for sign.
    for gaps in {tuple(np.diff(lines, prepend=lines[0]).tolist()), (0, *(1,) * (lines.size - 1))}:
        phases = _searched(lines, sizes, -2 * np.pi * np.cumsum(before * gaps), count)
        found.append((float(np.abs(_wave(lines, sizes, phases, FINER * count)).max()), gaps, phases))
    peak, _, phases = min(found, key=lambda one: one[:2])
    return phases + lines * _gentle_zero(lines, sizes, phases, count), peak


def _wave(lines: I64, sizes: F64, phases: F64, count: int) -> F64:
    spectrum = np.zeros(count // 2 + 1, dtype=np.complex128)
    spectrum[lines] = sizes * np.exp(1j * phases) * (count / 2)
    return np.fft.irfft(spectrum, count)


def _searched(lines: I64, sizes: F64, phases: F64, count: int) -> F64:
    """Phases moved to make one p-norm after the other small."""
    from scipy.optimize import minimize

    if lines.size == 1:
        return phases
    for p in NORMS:

        def cost(x: F64, p: int = p) -> tuple[float, F64]:
            u = _wave(lines, sizes, x, count)
            top = np.abs(u).max()
            v = u / top
            powers = v * v
            for _ in range(p.bit_length() - 2):
                powers = powers * powers
            mean = np.mean(powers)
            slope = np.divide(powers, v, out=np.zeros_like(v), where=powers > 0) / (mean * count * top)
            return float(np.log(top) + np.log(mean) / p), -sizes * np.imag(
                np.conj(np.fft.rfft(slope)[lines]) * np.exp(1j * x)
            )

        phases = minimize(cost, phases, jac=True, method="L-BFGS-B", options={"maxiter": STEPS}).x
    return phases


def _gentle_zero(lines: I64, sizes: F64, phases: F64, count: int) -> float:
    """Of the instants at which the sum is zero, the one with the least slope."""
    u = _wave(lines, sizes, phases, count)
    after = np.roll(u, -1)
    at = np.flatnonzero(((u < 0) & (after >= 0)) | ((u >= 0) & (after < 0)))
    k = at[np.argmin(np.abs(after - u)[at])]
    tau = 2 * np.pi * (k + u[k] / (u[k] - after[k])) / count
    for _ in range(4):  # Newton: the straight line was a good start
        angle = lines * tau + phases
        tau += np.sum(sizes * np.cos(angle)) / np.sum(sizes * lines * np.sin(angle))
    return float(tau)


def _power(given: Any, omega: F64) -> F64:
    if given is None:
        return np.ones(omega.size)
    try:
        power = np.asarray(given(omega) if callable(given) else given, dtype=np.float64)
    except (TypeError, ValueError):
        power = np.zeros(0)
    if power.shape != omega.shape or not np.all(np.isfinite(power) & (power >= 0)):
        raise SpecError(
            f"multisine: power= must give {omega.size} finite numbers of at least 0, one per line from "
            f"{omega[0]:.4g} to {omega[-1]:.4g} rad/s; it has shape {power.shape}"
        )
    return power


@dataclass(frozen=True)
class _Sines:
    """The sum at any time; zero outside its periods, and at their ends unless these are `open`."""

    omega: tuple[float, ...]
    sizes: tuple[float, ...]
    phases: tuple[float, ...]
    start: float
    length: float
    open: bool = False

    def __call__(self, t: F64) -> F64:
        s = t - self.start
        edge = (-1e-12 if self.open else 1e-12) * self.length
        inside = (s > edge) & (s < self.length - edge)
        angles = np.multiply.outer(s[inside], self.omega) + self.phases
        u = np.zeros(t.shape)
        u[inside] = np.cos(angles) @ self.sizes
        return u
