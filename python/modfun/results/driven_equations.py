"""Whether noise drives linear equations or comes from their sensors, by likelihoods of residual lines."""

from __future__ import annotations

import re
from collections.abc import Iterator
from math import inf, isfinite, log
from typing import Any

import numpy as np

from ..base.arrays import C128, F64
from ..base.cached import kept
from ..equations.equation import Equation
from ..equations.matrices import state_of
from ..equations.state_space import StateSpace
from ..errors import ModfunError
from ..models.options import Options
from ..models.process import ProcessNoise, dryden
from .cures import Cure, again, on_band
from .doubts import Doubt
from .estimates import Estimates
from .linear_lines import output_lines
from .origin import wide_band

__all__ = ["beside_turbulence", "bic_of_driven", "driven", "one_cause", "without_noises"]

GUST = "gust"  # name of the input that nobody measured
SCALE = 1.0  # s: its length over the airspeed
POLES = 1 - np.logspace(-3, 0.1, 40)  # of noise of first order, a sample
WHITE = np.append(0.0, np.logspace(-5, 0, 30))  # white noise beside it, of the mean power
BINS, FEWEST = 12, 8  # of frequencies, and of lines in each
APART = 14.0  # of BIC, of one output
ROUNDS = 3  # of weights
SURELY = 40.0  # of BIC: of 84 sets of records with coloured sensors none came to 29


@kept
def driven(fit: Estimates) -> Cure | None:
    """Noise that drives the equations, where sensors of any colour explain residuals worse beyond doubt.

    Over a wide band: noise in each equation, or one gust that acts as a state does; against sensors whose
    noise is white, of first order, or of several outputs of any level in each of some bins of frequency, from
    residuals of a fit that follows such noise.
    """
    if fit.layout.rational or fit.options.noise != "output" or fit.again is None or not fit.records:
        return None
    options, wide = on_band(fit, wide_band(fit)), beside_turbulence(fit)
    if wide is None:
        return None
    plain = again(fit, fit.records, fit.structure, options)
    if plain is None or not isfinite(sensors := _of_sensors(plain, plain)):
        return None
    told, after = 'noise="process"', bic_of_driven(wide)
    for words, other in _of_gusts(fit, fit.structure, options, wide.band):
        if bic_of_driven(other) < after:
            told, after = words, bic_of_driven(other)
    margin = SURELY if len(fit.outputs) > 1 else APART
    if not after < sensors - margin:
        return None
    followed = again(fit, fit.records, fit.structure, options.replace(noise="coloured"))
    if followed is not None and not after < _of_sensors(followed, plain) - margin:
        return None
    return Cure(told, plain.bic, after, np.nan)


@kept
def beside_turbulence(fit: Estimates) -> Estimates | None:
    """The fit with noise in each equation, over a wide band; None where it has no answer."""
    options = on_band(fit, wide_band(fit)).replace(noise="process", method="ml")
    return _with(fit, fit.structure, options)


@kept
def one_cause(fit: Estimates) -> Doubt | None:
    """That one gust explains better what a fit takes for noise of each equation by itself."""
    base = without_noises(fit)
    if base is None:
        return None
    fits = _of_gusts(fit, base, on_band(fit, fit.band), fit.band)
    after, words = min([(other.bic, words) for words, other in fits], default=(inf, ""))
    if not after < fit.bic - SURELY:
        return None
    return Doubt(
        "The noises of the equations go together: one cause, such as a gust, explains them better than "
        f"independent ones, with which standard errors are too small. First try {words}: BIC falls from "
        f"{fit.bic:.4g} to {after:.4g}, by {fit.bic - after:.3g}."
    )


def without_noises(fit: Estimates) -> Any:
    """The model of a fit with a noise for each equation, without inputs that stand for these."""
    model, noise = fit.structure, fit.options.noise
    if fit.layout.rational or fit.process_levels is None or fit.again is None or not fit.records:
        return None
    if noise == "process":
        return model
    if not isinstance(noise, ProcessNoise) or not isinstance(model, StateSpace) or len(noise.names) < 2:
        return None
    own = [k for k, name in enumerate(model.inputs) if name not in noise.names]
    b, d = ([[row[k] for k in own] for row in matrix] for matrix in (model.B, model.D))
    inputs, delay = [model.inputs[k] for k in own], [model.delay[k] for k in own]
    try:
        return model._like(B=b, D=d, inputs=inputs, delay=delay)
    except ModfunError:  # parameters of those inputs, say
        return None


def _with(fit: Estimates, structure: Any, options: Options) -> Estimates | None:
    """A fit with noise in its equations; None where it has no answer."""
    found = again(fit, fit.records, structure, options)
    return found if found is not None and found.success and found.process_levels is not None else None


def bic_of_driven(driven: Estimates) -> float:
    """BIC of a fit with noise in its equations, beside that of others over its band."""
    return float(driven.bic + len(driven.outputs) * np.log(driven.df_resid))


def _of_gusts(
    fit: Estimates, model: Any, options: Options, band: tuple[float, float]
) -> Iterator[tuple[str, Estimates]]:
    """Fits of one gust over a band, in words."""
    gust = options.replace(noise=ProcessNoise(**{GUST: dryden(SCALE)}), method="ml")
    for words, structure in _gusts(fit, model):
        other = _with(fit, structure, gust)
        if other is not None and other.band == band:
            yield words, other


def _gusts(fit: Estimates, model: Any) -> Iterator[tuple[str, Any]]:
    """One cause that acts on all equations as a measured state does, in words and as a structure."""
    if len(fit.outputs) < 2 or GUST in (*model.all_parameters, *model.outputs, *model.inputs):
        return
    noise = f"noise=mf.ProcessNoise({GUST}=mf.dryden({SCALE}))"
    words = f"an input {GUST} that acts as {{}} does and {noise}"
    if isinstance(model, StateSpace):
        shown = [state_of(c, d) for c, d in zip(model.C, model.D, strict=True)]
        for j in sorted({state for state in shown if state is not None}):
            b = [[*own, row[j]] for own, row in zip(model.B, model.A, strict=True)]
            inputs, delay = [*model.inputs, GUST], [*model.delay, 0.0]
            d = [[*own, 0] for own in model.D]
            yield words.format(model.states[j]), model._like(B=b, D=d, inputs=inputs, delay=delay)
    elif isinstance(model, Equation):
        for x in model.outputs:
            texts = [
                re.sub(rf"(?<![\w.]){re.escape(x)}(?![\w'(])", f"({x} + {GUST})", t) for t in model.texts
            ]
            try:
                yield words.format(x), model._like(text=texts, inputs=[*model.inputs, GUST])
            except ModfunError:  # texts in another form
                continue


def _of_sensors(fit: Estimates, plain: Estimates) -> float:
    """BIC of the plain fit if the residuals of another one have levels that sensors may have; inf of none."""
    pieces, own = output_lines(fit), output_lines(plain)
    if pieces is None or own is None:
        return inf
    rows = plain.df_resid + plain.params.size
    count, turns = len(fit.outputs), list[C128]()
    for rec, (low, high), omega0 in zip(fit.records or (), fit.lines, fit.omega0, strict=True):
        turns.append(np.exp(-1j * np.arange(max(low, 1), high + 1) * omega0 * (rec.dt or 0.0)))
    z = np.concatenate(turns)
    omega = -np.unwrap(np.angle(z)) if len(turns) == 1 else np.abs(np.angle(z))
    white = _deviance(own, lambda power: np.full(power.size, power.mean()))
    found = [white, _deviance(pieces, _of_first_order(z)) + 2 * count * log(rows)]
    if count > 1:  # of one output such levels are those of the system, too
        bins = _bins(omega)
        found.append(_deviance(pieces, _in_bins(bins, np.log(omega))) + int(bins.max()) * count * log(rows))
    return plain.bic + min(found) - white


def _deviance(pieces: list[tuple[C128, C128]], levels: Any) -> float:
    """-2 log likelihood of lines with these levels and one correlation of the outputs."""
    ends = np.cumsum([0, *(e.shape[1] for e, _ in pieces)])
    shape = np.ones((pieces[0][0].shape[0], ends[-1]))
    for _ in range(ROUNDS):
        left = [
            _without(e, columns, np.sqrt(shape[:, a:b]))
            for (e, columns), a, b in zip(pieces, ends, ends[1:], strict=False)
        ]
        e = np.concatenate(left, axis=1)
        shape = np.array([levels(np.abs(row) ** 2) for row in e])
    scaled = e / np.sqrt(shape)
    correlation = np.linalg.slogdet((scaled @ scaled.conj().T).real / e.shape[1])[1]
    return float(2 * (np.log(shape).sum() + e.shape[1] * correlation))


def _without(e: C128, columns: C128, deviation: F64) -> C128:
    """Lines (output, line) without what columns explain of them, weighted."""
    rows = (columns / deviation).reshape(len(columns), -1)
    rows = rows / np.maximum(np.linalg.norm(rows, axis=1), 1e-300)[:, None]
    q = np.linalg.qr(np.concatenate([rows.real, rows.imag], axis=1).T)[0]
    x = (e / deviation).ravel()
    both = np.concatenate([x.real, x.imag])
    both -= q @ (q.T @ both)
    return np.asarray((both[: x.size] + 1j * both[x.size :]).reshape(e.shape) * deviation)


def _of_first_order(z: C128) -> Any:
    """Likeliest levels of lines with a given power among noise of first order beside white noise."""
    shapes = 1 / np.abs(1 - POLES[:, None] * z) ** 2
    shapes /= shapes.mean(axis=1)[:, None]
    spectra = ((1 - WHITE)[:, None, None] * shapes + WHITE[:, None, None]).reshape(-1, z.size)
    logs = np.log(spectra).sum(axis=1)
    inverse = 1 / spectra

    def levels(power: F64) -> F64:
        size = inverse @ power / z.size
        at = int(np.argmin(logs + z.size * np.log(size)))
        return np.asarray(spectra[at] * size[at])

    return levels


def _bins(omega: F64) -> Any:
    """The bin of each line, of one width over the logarithm of frequency, with some lines in each."""
    edges = np.geomspace(omega.min(), omega.max() * (1 + 1e-9), BINS + 1)
    own = np.searchsorted(edges, omega, "right") - 1
    found, now, lines = np.zeros(omega.size, int), 0, 0
    for at in range(BINS):
        found[own == at] = now
        lines += int(np.sum(own == at))
        if lines >= FEWEST:
            now, lines = now + 1, 0
    return np.minimum(found, max(now - 1, 0))


def _in_bins(bins: Any, x: F64) -> Any:
    """Likeliest levels of lines with a given power, of straight lines from bin to bin over logarithms."""
    count = np.bincount(bins)
    centre = np.bincount(bins, x) / count

    def levels(power: F64) -> F64:
        height = np.log(np.bincount(bins, power) / count)
        for _ in range(ROUNDS):
            height += np.log(np.bincount(bins, power / np.exp(np.interp(x, centre, height))) / count)
        return np.asarray(np.exp(np.interp(x, centre, height)))

    return levels
