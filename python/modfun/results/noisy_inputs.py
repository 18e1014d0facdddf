"""Inputs that were measured with noise, which the residuals of the outputs show through the model."""

from __future__ import annotations

from math import inf

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import C128, F64
from ..base.cached import kept
from ..base.names import listed
from ..base.noisy_levels import levels_in_noise, white_level
from ..base.student import root
from .cures import ENOUGH, WORTH, again, furthest, on_band
from .diagnosis import level_p
from .doubts import Doubt, numbers
from .estimates import Estimates
from .fitted_samples import stationary
from .further import simulated
from .linear_lines import linear_of, responses_of
from .misfit import suspicious

__all__ = ["noisy_input"]

PLAUSIBLE = 0.1  # p-value of the level below which the lines are looked at
LEAST = 0.4  # chi-square per degree of freedom beside predicted noise: less is that of an input which acts
ABOVE = 4.0  # power of an input on the lines of the fit over that of its noise
HANN = 1.5  # lines that one of this window's stands for
AROUND = np.full(9, 1 / 9)  # lines over which power is averaged
PART = 0.1  # of what inputs add, from which one is named


@kept
def noisy_input(fit: Estimates) -> Doubt | None:
    """That noise of an input, seen at high frequency and carried through the model, is what is left.

    Nothing is estimated for that: the levels are those of other lines, and the model is that of the fit. An
    input that moves the system at high frequency looks noisy, too, but leaves far less than its noise would.
    """
    if not (level_p(fit) < PLAUSIBLE or suspicious(fit)) or not _testable(fit):
        return None
    levels = root(np.mean([[white_level(u) ** 2 for u in rec.u] for rec in fit.records or ()], axis=0))
    if not np.any(levels > 0):
        return None
    gain, added = _evidence(fit, levels)
    noisy = added > PART * added.sum()
    if not gain > WORTH or not _stands_out(fit, levels[noisy], noisy):
        return None
    if any(_known(fit, j) for j in np.flatnonzero(noisy).tolist()):
        return None
    steps = any(np.any(noisy & (np.array(rec.intersample) != "smooth")) for rec in fit.records or ())
    if not _stays_out(fit, levels) > (0.0 if steps else -WORTH):
        return None
    options = on_band(fit, fit.band).replace(noise="errors-in-variables")
    other = again(fit, fit.records, fit.structure, options)
    if other is None or not other.success or not (level_p(other) > ENOUGH and other.noise_scale > LEAST):
        return None
    names = [name for name, own in zip(fit.inputs, noisy, strict=True) if own]
    name, was, now, _ = furthest(fit, other)
    return Doubt(
        f"Noise on {listed(names)}, {numbers(levels[noisy])} in the samples, explains the residuals: carried "
        f"through the model, it raises 2 log likelihood by {gain:.3g} without any new parameter. First try "
        f'noise="errors-in-variables", which leaves only noise: {name} is {now} instead of {was}.'
    )


def _testable(fit: Estimates) -> bool:
    """Whether noise is white on the samples of outputs alone, its level seen, and the model linear."""
    return (
        bool(fit.inputs)
        and fit.options.noise == "output"
        and fit.options.method in ("awls", "ml")
        and fit.again is not None
        and not (fit.with_past or fit.instrumented)
        and len(fit.row_names) == len(fit.outputs)
        and stationary(fit)
        and all(rec.dt is not None and not rec.functions for rec in fit.records or ())
        and bool(np.all(fit.high_band_levels > 0))
        and (fit.layout.rational or linear_of(fit) is not None)
    )


def _known(fit: Estimates, channel: int) -> bool:
    """Whether an input is held at a new value in each sample: those of controllers have no noise."""
    held = [rec.u[channel] for rec in fit.records or () if rec.intersample[channel] == "zoh"]
    return bool(held) and all([levels_in_noise(u) is None for u in held])


def _evidence(fit: Estimates, levels: F64) -> tuple[float, F64]:
    """By how much noise of inputs raises 2 log likelihood of the residual lines, and what each input adds.

    Beside white noise of each output at the level of the high band.
    """
    seen, gain, added = fit.high_band_levels[:, None] ** 2, 0.0, np.zeros(len(levels))
    for k, (piece, (low, high)) in enumerate(zip(fit.pieces, fit.lines, strict=True)):
        response = _response(fit, k, max(low, 1), high)
        each = np.abs(response) ** 2 * levels[:, None] ** 2 / seen[:, None]
        power = 0.5 * np.abs(piece[:, low == 0 :]) ** 2 * fit.noise_levels[k][:, None] ** 2 / seen
        ratio = 1 + each.sum(axis=1)
        gain += 2 * float(np.sum(power * (1 - 1 / ratio) - np.log(ratio)))
        added += each.sum(axis=(0, 2))
    return gain, added


def _stands_out(fit: Estimates, levels: F64, noisy: NDArray[np.bool_]) -> bool:
    """Whether noisy inputs are far above their noise on the lines of the fit: noise alone drives nothing."""
    for k, (rec, (low, high)) in enumerate(zip(fit.records or (), fit.lines, strict=True)):
        n = fit.intervals[k]
        window = np.hanning(n + 1)
        lines = _lines(window, rec.u[noisy, rec.intervals - n :])[:, max(low - 1, 0) : high]
        if np.any(np.mean(np.abs(lines) ** 2, axis=1) < ABOVE * levels**2 * float(window @ window)):
            return False
    return True


def _stays_out(fit: Estimates, levels: F64) -> float:
    """2 log likelihood of residuals in which noise of inputs is missing, over that of an input which acts.

    The model carries all samples of an input to the output. What is noise of them did not go there, so that
    it is in the residuals with its sign turned, also on lines that were not fitted. Of what was held all is
    noise beside its levels; of other inputs as much of each line as their noise has of the power around it.
    """
    seen, score = fit.high_band_levels[:, None] ** 2, 0.0
    for k, rec in enumerate(fit.records or ()):
        whole, n = simulated(fit, k), fit.intervals[k]
        if whole is None:
            return -inf
        first = rec.intervals - n
        window = np.hanning(n + 1)
        unit = float(window @ window)
        left = _lines(window, rec.y[:, first:] - whole)
        noise = [u - (held if (held := levels_in_noise(u)) is not None else 0.0) for u in rec.u[:, first:]]
        lines = _lines(window, np.array(noise))
        high = lines.shape[1]
        around = np.array([np.convolve(np.abs(own) ** 2, AROUND, "same") for own in lines])
        share = np.minimum(levels[:, None] ** 2 * unit / np.maximum(around, 1e-300), 1.0)
        response = _response(fit, k, 1, high)
        turn = 1j * fit.omega0[k] * (rec.dt or 1.0) * np.arange(1, high + 1)
        hold = [(-np.expm1(-turn) / turn if word == "zoh" else 1.0) for word in rec.intersample]
        carried = response * np.array([lines[j] * hold[j] for j in range(len(lines))])
        expected = np.sum(carried * share, axis=1)
        level = seen + np.einsum("ijl,j->il", np.abs(response) ** 2, levels**2)
        parts = 2 * (expected.conj() * left).real + np.abs(expected) ** 2
        score -= 2 * float(np.sum(parts / level)) / unit / HANN
    return score


def _lines(window: F64, rows: F64) -> C128:
    """Lines from the first on of rows in a window."""
    return np.asarray(np.fft.rfft(window * (rows - rows.mean(axis=1)[:, None]), window.size - 1)[:, 1:])


def _response(fit: Estimates, k: int, low: int, high: int) -> C128:
    """What each input makes of each output on lines of a record, (output, input, line)."""
    if fit.layout.rational:
        return fit.response_gradients(np.arange(low, high + 1.0) * fit.omega0[k])[0]
    model = linear_of(fit)
    assert model is not None
    return responses_of(fit, model, k, low, high)
