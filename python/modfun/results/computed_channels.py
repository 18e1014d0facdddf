"""Channels that were computed from others, such as a derivative by differences: their noise is the same."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import C128, F64
from ..errors import ModfunError
from .doubts import Doubt
from .estimates import Estimates

__all__ = ["Computed", "computed", "computed_channel", "may_be_computed"]

SAME = 1e-7  # of a channel, up to which it is a difference quotient of another
LINES = 8  # that a coherence is averaged over; of independent noise it is 1/8 on average
LEAST = 0.6  # coherence; that of two groups of independent noise is larger once in 100,000
TURNED = 0.9  # of what two channels share, that is turned by a quarter of a period
ASTRAY = 0.1  # power that a simulation leaves at low frequency, over that of the output
SHIFTS = (0.0, 0.5, -0.5)  # samples: of central, backward and forward differences


class Computed(NamedTuple):
    """Which channel was computed from which.

    Attributes
    ----------
    derivative, source : str
    coherence : float
        Of the noise of both; 1 where one is exactly the difference quotient of the other.
    """

    derivative: str
    source: str
    coherence: float

    def in_words(self) -> str:
        """What is the matter, as a sentence."""
        v, x = self.derivative, self.source
        how = (
            f"it is the difference quotient of {x}"
            if self.coherence == 1
            else "above a quarter of the highest frequency that the samples show, the coherence of the noise "
            f"of {x} and {v} is {self.coherence:.2g}"
        )
        return f"The channel {v} seems to be computed from {x}, as by np.gradient: {how}."


def computed_channel(fit: Estimates) -> Doubt | None:
    """That equations take for measured what was computed from another output."""
    found = None if fit.layout.rational or len(fit.outputs) < 2 else computed(fit)
    if found is None:
        return None
    v, x = found.derivative, found.source
    return Doubt(
        f"{found.in_words()} Its noise is that of {x}, not one of its own, and differences err by more than "
        f"noise. First leave {v} out, and write its equation for {x} alone: {x}' in place of {v}, and {x}'' "
        f"in place of {v}'.",
        sure=False,
    )


def computed(fit: Estimates) -> Computed | None:
    """The output of a fit that was computed from another one, exactly or by the residuals in time."""
    records = fit.records or ()
    if not records or any(rec.dt is None for rec in records):
        return None
    outputs = [rec.y for rec in records]
    exact = _quotient(outputs, fit.outputs)
    if exact is not None or not may_be_computed(outputs) or (errors := _errors(fit)) is None:
        return exact
    return _coherent(errors, outputs, fit.outputs)


def may_be_computed(outputs: Sequence[F64]) -> bool:
    """Whether two channels (channel, time) of all records go together at high frequency, for any reason."""
    spectra = [_high(_whole(y)) for y in outputs]
    pairs = [(i, j) for i in range(len(outputs[0])) for j in range(i)]
    return any(_coherence(spectra, i, j) is not None for i, j in pairs)


def _quotient(outputs: Sequence[F64], names: Sequence[str]) -> Computed | None:
    """A channel that is a difference quotient of another one, in whatever units."""
    for i, v in enumerate(names):
        for j, x in enumerate(names):
            if i != j and any(
                all(_is_quotient(y[i], y[j], ahead, behind) for y in outputs)
                for ahead, behind in ((1, 1), (1, 0), (0, 1))
            ):
                return Computed(v, x, 1.0)
    return None


def _is_quotient(v: F64, x: F64, ahead: int, behind: int) -> bool:
    n = x.size
    if n < 2 * LINES:
        return False
    inside = v[1:-1]
    quotient = x[1 + ahead : n - 1 + ahead] - x[1 - behind : n - 1 - behind]
    power = float(quotient @ quotient)
    if not power > 0:
        return False
    return bool(np.max(np.abs(inside - (quotient @ inside / power) * quotient)) < SAME * np.ptp(inside))


def _coherent(errors: Sequence[F64], outputs: Sequence[F64], names: Sequence[str]) -> Computed | None:
    spectra, whole = [_high(_whole(e)) for e in errors], [_whole(y) for y in outputs]
    for i in range(len(names)):
        for j in range(i):
            shared = _coherence(spectra, i, j)
            if shared is None or not _is_turned(spectra, i, j):
                continue
            # A derivative is a quarter of a period ahead where the signals are.
            ahead = sum(float(np.sum((y[i] * y[j].conj()).imag)) for y in whole) > 0
            v, x = (i, j) if ahead else (j, i)
            return Computed(names[v], names[x], min(shared, 0.999))
    return None


def _whole(rows: F64) -> C128:
    """Spectra of rows under a Hann window, of which every other line is nearly independent."""
    n = rows.shape[1]
    about = rows - rows.mean(axis=1, keepdims=True)
    size = np.maximum(np.abs(about).max(axis=1, keepdims=True), np.finfo(float).tiny)
    return np.asarray(np.fft.rfft(about / size * np.hanning(n))[:, ::2])


def _high(spectra: C128) -> C128:
    """Lines above a quarter of the Nyquist frequency, in groups: (row, group, line)."""
    top = spectra.shape[1] - 1
    groups = (top - top // 4) // LINES
    return np.asarray(spectra[:, top - groups * LINES : top].reshape(len(spectra), groups, LINES))


def _coherence(spectra: Sequence[C128], i: int, j: int) -> float | None:
    """Mean squared coherence of two rows, if they go together over all high lines and on the highest."""
    found, highest = [], []
    for one in spectra:
        if one.shape[1] < 2:
            return None
        cross = np.abs(np.sum(one[i] * one[j].conj(), axis=1)) ** 2
        power = np.sum(np.abs(one[i]) ** 2, axis=1) * np.sum(np.abs(one[j]) ** 2, axis=1)
        own = cross / np.where(power > 0, power, 1.0)
        found.append(float(np.mean(own)))
        highest.append(float(np.mean(own[-max(own.size // 3, 1) :])))
    return min(found) if min(*found, *highest) > LEAST else None


def _is_turned(spectra: Sequence[C128], i: int, j: int) -> bool:
    """Whether what two rows share is turned by a quarter of a period, apart from half a sample."""
    for shift in SHIFTS:
        turned, total = 0.0, 0.0
        for one in spectra:
            count = one.shape[1] * LINES
            turns = np.exp(-1j * shift * pi * np.linspace(1 - 0.75, 1, count)).reshape(one.shape[1:])
            cross = one[i] * one[j].conj()
            turned += float(np.sum(np.sum(cross * turns, axis=1).imag ** 2))
            total += float(np.sum(np.abs(np.sum(cross * turns, axis=1)) ** 2))
        if turned > TURNED * total:
            return True
    return False


def _errors(fit: Any) -> list[F64] | None:
    """What the simulated response leaves of the outputs of each record; None where it goes astray.

    The response of a chaotic system does: it leaves signal, of which channels have the same.
    """
    try:
        with np.errstate(all="ignore"):
            found = [rec.y - fit.simulate(rec)[0] for rec in fit.records]
    except (ModfunError, np.linalg.LinAlgError):
        return None
    for e, rec in zip(found, fit.records, strict=True):
        if not np.all(np.isfinite(e)):
            return None
        left, signal = (np.sum(np.abs(_low(rows)) ** 2, axis=1) for rows in (e, rec.y))
        if not np.all(left < ASTRAY * signal):
            return None
    return found


def _low(rows: F64) -> C128:
    """Lines of rows up to a quarter of the Nyquist frequency."""
    lines = np.fft.rfft((rows - rows.mean(axis=1, keepdims=True)) * np.hanning(rows.shape[1]))
    return np.asarray(lines[:, : lines.shape[1] // 4])
