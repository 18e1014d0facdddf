"""Inputs that were measured with noise, which residuals of the outputs or their own high bands show."""

from __future__ import annotations

from math import inf, sqrt

import numpy as np

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
FINE = 64  # samples a period of the highest line, at least, of what is averaged
AROUND = np.full(9, 1 / 9)  # lines over which power is averaged
PART = 0.1  # of what inputs add, from which one is named
MATTERS = 0.05  # of the power of an output's noise, that of an input's on some line: less is not looked at
SAID, WARNED = 1.1, 1.3  # times larger standard errors with noise of inputs: what is said, and warned of
ROUNDED = 0.5  # last digits, of noise that rounding made or left
TOP = 1 / 4  # of all lines: where the high band begins that shows whether it holds noise
LIKELIER = 3.0  # log likelihood of white noise there over that of a motion: of such ones 3 in 100 are above
STEEP = (2, 4)  # powers of 1/sin^2: what beside them is left of the smooth part of a motion
PARTS = np.concatenate([[0.0], np.geomspace(1e-4, 0.9999, 60)])  # of the latter


@kept
def noisy_input(fit: Estimates) -> Doubt | None:
    """That noise of an input, seen at high frequency, is what is left, or standard errors lack it.

    Nothing is estimated for that: the levels are those of other lines, and the model is that of the fit. An
    input that moves the system at high frequency looks noisy, too, but leaves far less than its noise would.
    An integral of noise is strongest on a few lines, where estimates follow it and residuals show little.
    """
    if not _testable(fit) or not fit.records:
        return None
    levels = root(np.mean([[white_level(u) ** 2 for u in rec.u] for rec in fit.records], axis=0))
    if not np.any(levels > 0):
        return None
    gain, added, most = _evidence(fit, levels)
    noisy = added > PART * added.sum()
    left = gain > WORTH and (level_p(fit) < PLAUSIBLE or suspicious(fit))
    if not (left or most > MATTERS) or not _stands_out(fit, np.where(noisy, levels, 0.0)):
        return None
    channels = np.flatnonzero(noisy).tolist()
    if any(_known(fit, j) or not (left or _white(fit, j, float(levels[j]))) for j in channels):
        return None
    steps = any(np.any(noisy & (np.array(rec.intersample) != "smooth")) for rec in fit.records or ())
    if not _stays_out(fit, levels) > (0.0 if steps else -WORTH):
        return None
    options = on_band(fit, fit.band).replace(noise="errors-in-variables")
    other = again(fit, fit.records, fit.structure, options)
    if other is None or not other.success or not (level_p(other) > ENOUGH and other.noise_scale > LEAST):
        return None
    names = [name for name, own in zip(fit.inputs, noisy, strict=True) if own]
    seen = f"Noise on {listed(names)}, {numbers(levels[noisy])} in the samples"
    if not left:
        return _too_small(fit, other, seen)
    name, was, now, _ = furthest(fit, other)
    return Doubt(
        f"{seen}, explains the residuals: carried "
        f"through the model, it raises 2 log likelihood by {gain:.3g} without any new parameter. First try "
        f'noise="errors-in-variables", which leaves only noise: {name} is {now} instead of {was}.'
    )


def _too_small(fit: Estimates, other: Estimates, seen: str) -> Doubt | None:
    """That standard errors are larger in a fit that counts noise of inputs; both by levels alone.

    Those by the spectrum of residuals scatter, but where they are larger they may have allowed for it.
    """
    rows = [other.param_names.index(name) for name in fit.param_names]
    larger = root(np.diag(other.cov_nonrobust)[rows])
    stated = np.maximum(fit.spread, root(np.diag(fit.cov_nonrobust)))
    factor = np.where(stated > 0, larger / np.where(stated > 0, stated, 1.0), 0.0)
    at = int(np.argmax(factor))
    if not factor[at] > SAID:
        return None
    name = fit.param_names[at]
    return Doubt(
        f"{seen}, reaches the outputs through the model, and standard errors do not allow for it: that of "
        f"{name} is about {factor[at]:.2g} times too small. First try "
        f'noise="errors-in-variables", with which {name} is {other[name]:.4g} instead of {fit[name]:.4g}.',
        sure=bool(factor[at] > WARNED),
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


def _white(fit: Estimates, channel: int, level: float) -> bool:
    """Whether the high band of an input is white noise rather than a motion, and more than rounding makes.

    The power of a motion that jumps falls by the square of frequency, as that of a random walk or of
    turbulence, 1/sin^2 in samples; of smoother ones it falls faster, and white noise ends that.
    """
    score = 0.0
    for k, rec in enumerate(fit.records or ()):
        u = rec.u[channel, rec.intervals - fit.intervals[k] :]
        size = np.abs(np.diff(u))
        if level < ROUNDED * float(np.min(size[size > 0], initial=inf)):
            return False
        held = levels_in_noise(u)
        lines = _lines(np.hanning(u.size), (u - (0.0 if held is None else held))[None])[0]
        first = int(TOP * lines.size)
        power = np.abs(lines[first:]) ** 2
        falls = np.sin(np.pi / 2 * np.arange(first + 1, lines.size + 1) / lines.size) ** -2
        score += _likelihood(power, np.ones_like(falls), falls) - _likelihood(power, falls, falls)
    return score > LIKELIER * HANN


def _likelihood(power: F64, shape: F64, falls: F64) -> float:
    """Log likelihood of lines (Whittle, 1953) with power of a shape and of the smooth part of a motion."""
    best = -inf
    for steep in STEEP:
        other = falls**steep
        model = np.outer(1 - PARTS, shape / shape.mean()) + np.outer(PARTS, other / other.mean())
        each = -np.log(model).sum(axis=1) - power.size * np.log((power / model).mean(axis=1))
        best = max(best, float(each.max()))
    return best


def _evidence(fit: Estimates, levels: F64) -> tuple[float, F64, float]:
    """By how much noise of inputs raises 2 log likelihood of the residual lines, and what each input adds.

    Beside white noise of each output at the level of the high band. And the most that all add to a line.
    """
    seen, gain, added = fit.high_band_levels[:, None] ** 2, 0.0, np.zeros(len(levels))
    most = 0.0
    for k, (piece, (low, high)) in enumerate(zip(fit.pieces, fit.lines, strict=True)):
        response = _response(fit, k, max(low, 1), high)
        each = np.abs(response) ** 2 * levels[:, None] ** 2 / seen[:, None]
        power = 0.5 * np.abs(piece[:, low == 0 :]) ** 2 * fit.noise_levels[k][:, None] ** 2 / seen
        ratio = 1 + each.sum(axis=1)
        gain += 2 * float(np.sum(power * (1 - 1 / ratio) - np.log(ratio)))
        added += each.sum(axis=(0, 2))
        most = max(most, float(ratio.max()) - 1)
    return gain, added, most


def _stands_out(fit: Estimates, levels: F64) -> bool:
    """Whether noisy inputs are far above their noise on the lines of the fit: noise alone drives nothing.

    A window that goes to zero at both ends hides the pulse of a hammer at one of them, beside which an input
    is nothing but its noise.
    """
    for k, (rec, (low, high)) in enumerate(zip(fit.records or (), fit.lines, strict=True)):
        n = fit.intervals[k]
        each = max(n // (FINE * (high + 1)), 1)  # samples of a long record that are averaged, for memory
        for own, level in zip(rec.u[:, rec.intervals - n :], levels / sqrt(each), strict=True):
            if not level > 0:
                continue
            u = own[: own.size // each * each].reshape(-1, each).mean(axis=1)
            pulse = np.median(np.abs(u - np.median(u))) < level
            window = np.ones(u.size) if pulse else np.hanning(u.size)
            lines = _lines(window, u[None])[0, max(low - 1, 0) : high]
            if np.mean(np.abs(lines) ** 2) < ABOVE * level**2 * float(window @ window):
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
