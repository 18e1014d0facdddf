"""Light modes that follow a line of the noise, where fewer poles explain the record as well."""

from __future__ import annotations

from collections.abc import Iterator
from math import expm1, pi
from typing import Any

import numpy as np

from ..models.transfer_function import TransferFunction
from .cures import again, on_band
from .doubts import Doubt
from .estimates import Estimates
from .rewritten import rewritten
from .stability import deviance
from .uncertain_poles import Mode, modes

__all__ = ["noise_mode"]

NARROW = 1.0  # lines of the record: half-power width of a mode that follows one of them, at most
LOWEST = 1.5  # lines: a mode below is part of how the record moves as a whole
STRONG = 20.0  # times the noise: the output at the mode's frequency, of a mode that everybody sees
CHANCE = 0.01  # that the best of as many lines of noise explains as much: above, fewer poles do as well
CHUNK = 2**16  # samples at once, of records that fill the memory
KEPT = 0.5  # lines between a mode and one of the fit with fewer poles: that is the same mode


def noise_mode(fit: Estimates) -> Doubt | None:
    """That a mode with tight standard errors is one line of noise: fewer poles, without it, do as well.

    An F test of the fit against that with fewer poles, times the lines that the mode could have followed.
    Such a minimum of the cost is often the lowest, and a search that begins at fewer poles ends in it, too.
    """
    asked = isinstance(fit.structure, TransferFunction) and not fit.structure.params
    asked = asked and fit.options.method in ("ml", "awls") and fit.options.noise == "output"
    if not (asked and fit.again is not None and fit.records):
        return None
    narrow = [mode for mode in modes(fit) if _follows(fit, mode)]
    if not narrow:
        return None
    mode = min(narrow, key=lambda one: abs(one.pole.real))
    for other, states in _fewer(fit, mode):
        if _explains_as_much(fit, other, states):
            return _said(fit, mode, other)
    return None


def _follows(fit: Estimates, mode: Mode) -> bool:
    """Whether a mode is as narrow as a line, at a frequency at which the output is hardly above the noise.

    One that grows, too, however fast: what grows ends far above the noise.
    """
    spacing = max(fit.omega0)
    return (
        -2 * mode.pole.real < NARROW * spacing
        and mode.pole.imag > LOWEST * spacing
        and max(_power(fit, k, mode) for k in range(len(fit.omega0))) < STRONG
    )


def _power(fit: Estimates, k: int, mode: Mode) -> float:
    """Power of the outputs at the mode's frequency over that of their noise, in a Hann window."""
    assert fit.records is not None
    rec, own = fit.records[k], slice(None) if fit.layout.common else slice(mode.output, mode.output + 1)
    sums: list[Any] = [0.0] * 5
    for first in range(0, rec.t.size, CHUNK):
        y, t = rec.y[own, first : first + CHUNK], rec.t[first : first + CHUNK] - rec.t[0]
        window = 1 - np.cos(2 * pi * t / rec.duration)
        wave = window * np.exp(-1j * mode.pole.imag * t)
        here = (y @ wave, y @ window, wave.sum(), window.sum(), window @ window)
        sums = [total + one for total, one in zip(sums, here, strict=True)]
    of_wave, of_window, wave_sum, window_sum, square = sums
    found = np.abs(of_wave - of_window * (wave_sum / window_sum)) ** 2
    with np.errstate(divide="ignore"):
        return float(np.max(found / (square * fit.noise_levels[k, own] ** 2)))


def _fewer(fit: Estimates, mode: Mode) -> Iterator[tuple[Estimates, int]]:
    """Fits with one and two poles less that lack the mode, and how many initial states they lack."""
    layout = fit.layout
    alone = layout.common or len(layout.orders) == 1
    n = layout.orders[mode.output]
    for drop in (1, 2):
        if n - drop < 1:
            return
        poles: Any = n - drop
        if not alone:
            poles = [n - drop if i == mode.output else own for i, own in enumerate(layout.orders)]
        if fit.inputs:
            structure = rewritten(
                fit, poles=poles, zeros=[_degrees(fit, i, mode, drop) for i in range(len(fit.outputs))]
            )
        else:
            structure = TransferFunction(poles=poles, denominator=fit.structure.denominator)
        other = again(fit, fit.records, structure, on_band(fit, fit.band))
        if other is not None and not any(_same(fit, mode, one) for one in modes(other)):
            outputs = len(fit.outputs) if layout.common else 1
            free = fit.options.initial_state == "unknown"
            yield other, drop * outputs * len(fit.lines) * free


def _same(fit: Estimates, mode: Mode, other: Mode) -> bool:
    return mode.output == other.output and abs(mode.pole - other.pole) < KEPT * max(fit.omega0)


def _degrees(fit: Estimates, i: int, mode: Mode, drop: int) -> list[int | None]:
    """Degrees of the numerators of an output with so many poles less: below as many poles as before."""
    row, n = fit.layout.numerators[i], fit.layout.orders[i]
    if not (fit.layout.common or i == mode.output):
        return list(row)
    return [None if d is None else min(d, n - drop - (d < n)) for d in row]


def _explains_as_much(fit: Estimates, other: Estimates, states: int) -> bool:
    """Whether the fit explains no more than the best of as many lines of noise as there are would."""
    from scipy.special import fdtrc

    more = fit.params.size - other.params.size + states
    rows = fit.df_resid + fit.params.size
    fall = (deviance(other) - deviance(fit)) / rows
    ratio = expm1(min(max(fall, 0.0), 100.0)) * fit.df_resid / more
    lines = sum(hi - lo + 1 for lo, hi in fit.lines)
    return lines * float(fdtrc(more, fit.df_resid, ratio)) > CHANCE


def _said(fit: Estimates, mode: Mode, other: Estimates) -> Doubt:
    orders = other.layout.orders
    poles = orders[0] if len(set(orders)) == 1 else list(orders)
    at, line = mode.pole, mode.pole.imag / max(fit.omega0)
    return Doubt(
        f"The mode at {at.real:.2g} ± {at.imag:.4g}j rad/s follows line {line:.1f} of the record and "
        f"explains no more than noise does by chance: without it, poles={poles} fits as well. All estimates "
        "may be far off, and standard errors do not show it: they hold beside this minimum only. First take "
        f"fewer poles, poles={poles}, or a record that moves more or longer."
    )
