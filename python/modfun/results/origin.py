"""Where noise comes from, by the spectrum of the residuals: the sensors, or the system itself."""

from __future__ import annotations

import numpy as np

from ..base.arrays import F64
from ..errors import ModfunError
from ..models.transfer_function import TransferFunction
from .cures import WORTH, again, on_band
from .estimates import Estimates

__all__ = ["APART", "gain_of_colour", "gain_of_process", "hum", "origin", "wide_band"]

RATIOS = np.append(0.0, np.logspace(-5, 0, 60))  # measurement noise beside process noise, of the mean power
APART = 14.0
LINES = 256  # of all outputs of equations, at most: their covariances grow with the square
LEAST_GAIN = 1.2  # of a standard error
HUM, HUM_LINES = 0.7, 16  # part of the residuals' power in two lines beside each other, of so many at least
POLES = 1 - np.logspace(-3, 0.1, 80)  # of coloured noise of first order, a sample


def hum(fit: Estimates) -> tuple[int, float, float] | None:
    """Output, frequency and part of the power of a tone that most of the residuals are; None without."""
    for i in range(len(fit.row_names) if fit.layout.rational else 0):
        for piece, (low, _), omega0 in zip(fit.pieces, fit.lines, fit.omega0, strict=True):
            power = np.abs(piece[i]) ** 2
            if power.size < HUM_LINES:
                continue
            pairs = power[1:] + power[:-1]
            at = int(np.argmax(pairs))
            part = float(pairs[at] / power.sum())
            centre = low + at + float(power[at + 1] / pairs[at])
            if part > HUM and centre > 0.5:  # below that it is an offset
                return i, centre * omega0, part
    return None


def origin(fit: Estimates) -> str | None:
    """ "process", "coloured", "either" or None, by likelihoods of residual lines up to an eighth of the rate.

    Process noise beside white noise of the samples has the spectrum r + (1 - r)/|A|^2, coloured noise of
    first order 1/|1 - c exp(-i w dt)|^2: one shape parameter each. Either is told from white noise by ten
    units of -2 log likelihood, one from the other by fourteen: of 900 records with coloured noise none came
    to eleven.
    """
    plain = fit.options.noise == "output" and fit.options.plain_noise and fit.layout.plain
    if hum(fit) or not (plain and isinstance(fit.structure, TransferFunction) and fit.again and fit.records):
        return None
    steps = [rec.dt for rec in fit.records if rec.dt is not None and rec.mask is None and rec.sigma is None]
    if len(steps) != len(fit.records):
        return None
    top = np.pi / 4 / max(steps)
    if fit.band[0] >= top:
        return None
    options = fit.options.replace(band=(fit.band[0], top), harmonics=None)
    wide = again(fit, fit.records, fit.structure, options)
    if wide is None:
        return None
    power, rows, driven, delay = [], [], [], []
    for (low, high), omega0, (piece, *_), dt in zip(wide.lines, wide.omega0, wide.pieces, steps, strict=True):
        m = np.arange(low, high + 1)
        power.append(np.abs(piece) ** 2)
        rows.append(np.where(m == 0, 1.0, 2.0))
        a = np.polyval(wide.polynomials(0)[0], 1j * m * omega0)
        driven.append(1 / np.maximum(np.abs(a) ** 2, np.finfo(float).tiny))
        delay.append(np.exp(-1j * m * omega0 * dt))
    k, squares, z = np.concatenate(rows), np.concatenate(power), np.concatenate(delay)
    count, shape = float(k.sum()), np.concatenate(driven)
    shape /= shape.mean()

    def deviance(spectrum: F64) -> float:
        return float(k @ np.log(spectrum)) + count * float(np.log(squares @ (1 / spectrum) / count))

    process = min([deviance((1 - r) * shape + r) for r in RATIOS.tolist()])
    coloured = min([deviance(1 / np.abs(1 - c * z) ** 2) for c in POLES.tolist()])
    white = deviance(np.ones(k.size))
    if min(process, coloured) > white - WORTH:
        return None
    if abs(process - coloured) <= APART:
        return "either"
    return "process" if process < coloured else "coloured"


def gain_of_colour(fit: Estimates) -> float | None:
    """How many times smaller errors are where lines are weighted by the noise spectrum; None where little.

    Geometric mean over the parameters, over the band of the fit.
    """
    if fit.options.noise != "output" or fit.again is None or fit.records is None:
        return None
    if hum(fit):  # the lines beside it would count as known
        return None
    options = on_band(fit, fit.band).replace(noise="coloured", output_weights=None)
    other = again(fit, fit.records, fit.structure, options)
    if not (other is not None and fit.bse.size and np.all(fit.bse > 0) and np.all(other.bse > 0)):
        return None
    gain = float(np.exp(np.mean(np.log(fit.bse / other.bse))))
    return gain if gain >= LEAST_GAIN else None


def wide_band(fit: Estimates) -> tuple[float, float]:
    """The band of a fit up to eight samples a period, or as many lines as are cheap."""
    least = min(2 * np.pi / ((rec.dt or np.inf) * 8) for rec in fit.records or ())
    most = LINES // max(len(fit.outputs), 2) * min(fit.omega0)
    return fit.band[0], max(fit.band[1], float(min(least, most)))


def gain_of_process(fit: Estimates) -> tuple[float, float] | None:
    """BIC of equations over a wide band without and with noise in each; None where that does not pay."""
    if fit.layout.rational or fit.options.noise != "output" or fit.again is None or fit.records is None:
        return None
    try:
        options = on_band(fit, wide_band(fit))
        driven = fit.again(fit.records, fit.structure, options.replace(noise="process", method="ml"))
        plain = fit.again(fit.records, fit.structure, options)
    except ModfunError:  # equations that are not linear, say
        return None
    if not (driven.usable and plain.usable and driven.process_levels is not None):
        return None
    after = driven.bic + len(fit.outputs) * np.log(driven.df_resid)
    return (plain.bic, after) if after < plain.bic - WORTH else None
