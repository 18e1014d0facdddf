"""Where noise comes from, by the spectrum of the residuals: the sensors, or the system itself."""

from __future__ import annotations

from itertools import pairwise
from math import nan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64
from ..base.cached import kept
from ..models.transfer_function import TransferFunction
from .coloured_load import moved_by_weights
from .cures import WORTH, again, on_band
from .estimates import Estimates
from .further import fitted_lines

__all__ = [
    "either",
    "gain_of_colour",
    "gain_of_process",
    "hum",
    "in_process_noise",
    "on_wide_band",
    "origin",
    "position",
    "smaller_errors",
    "wide_band",
]

WHITE = np.append(0.0, np.logspace(-6, 0, 31))  # noise of the samples beside other noise, of the mean power
RATES = np.append(np.append(0.0, 1 / (1 + np.logspace(-3, 3, 13))), 1.0)  # what acts on the rate, likewise
LINES = 256  # of all outputs of equations, at most: their covariances grow with the square
LEAST_GAIN = 1.2  # of a standard error
HUM, HUM_LINES = 0.7, 16  # part of the residuals' power in two lines beside each other, of so many at least
# Times the errors of the default, of every parameter, from which noise="process" is not advised. The least
# was 1.1 to 12 in 14 records in slow noise of the sensor, 0.5 to 2.8 in 8 in gusts (where it was large, the
# default was as good), and 0.6 to 1.0 in gusts on a light mode, whose default intervals are too short.
COSTLY = 1.5
# Times the same, on average, from which a record hardly tells the system from the noise. In 1/f noise of 30 %
# the default was more than 3 errors off in 10 of 17 records beyond it, and in none of 6 below.
UNTOLD = 10.0
POLES = 1 - np.logspace(-3.3, 0.1, 45)  # of coloured noise of first order, a sample


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


@kept
def on_wide_band(fit: Estimates) -> Estimates | None:
    """The fit up to an eighth of the rate; None but of transfer functions in white noise, even samples."""
    plain = fit.options.noise == "output" and fit.options.plain_noise and fit.layout.plain
    if not (plain and isinstance(fit.structure, TransferFunction) and fit.again and fit.records):
        return None
    steps = [rec.dt for rec in fit.records if rec.dt is not None and rec.mask is None and rec.sigma is None]
    if len(steps) != len(fit.records):
        return None
    top = np.pi / 4 / max(steps)
    if fit.band[0] >= top:
        return None
    options = fit.options.replace(band=(fit.band[0], top), harmonics=None)
    return again(fit, fit.records, fit.structure, options)


@kept
def origin(fit: Estimates) -> str | None:
    """ "process", "coloured", "either" or None, by likelihoods of residual lines up to an eighth of the rate.

    Process noise has the spectrum (c0 + c1 w^2)/|A|^2, coloured noise of first order
    1/|1 - c exp(-i w dt)|^2, both beside white noise of the samples, as drifting sensors have it, too. The
    likelihoods are restricted: a fit takes the lines at a light mode for itself, and what it leaves looks
    like slow noise. Either is told from white noise, and one from the other, by ten units of -2 log
    likelihood.
    """
    wide = None if hum(fit) else on_wide_band(fit)
    if wide is None or hum(wide):
        return None
    steps = [float(rec.dt or 0.0) for rec in wide.records or ()]
    numbers = [np.arange(low, high + 1) for low, high in wide.lines]
    omega = np.concatenate([m * omega0 for m, omega0 in zip(numbers, wide.omega0, strict=True)])
    turn = np.concatenate([m * w * dt for m, w, dt in zip(numbers, wide.omega0, steps, strict=True)])
    driven = 1 / np.maximum(np.abs(np.polyval(wide.polynomials(0)[0], 1j * omega)) ** 2, np.finfo(float).tiny)
    acting = [_of_mean_one(driven), _of_mean_one(omega**2 * driven)]
    mixed = np.outer(1 - RATES, acting[0]) + np.outer(RATES, acting[1])
    slow = _of_mean_one(1 / np.abs(1 - POLES[:, None] * np.exp(-1j * turn)) ** 2)
    lines = _Lines.of(wide, np.concatenate(numbers))
    process, coloured = lines.deviance(mixed), lines.deviance(slow)
    if min(process, coloured) > lines.deviance(np.ones((1, omega.size))) - WORTH:
        return None
    if abs(process - coloured) <= WORTH:
        return "either"
    return "process" if process < coloured else "coloured"


def _of_mean_one(spectra: F64) -> F64:
    return np.asarray(spectra / spectra.mean(axis=-1, keepdims=True))


class _Lines(NamedTuple):
    """Residual lines of the first output, and what was fitted to them, as sums over their two parts.

    Attributes
    ----------
    parts : ndarray
        Degrees of freedom of each line.
    power, shared, products : ndarray
        Of each line: of its residual, of this with each column that was fitted, of these with each other.
    """

    parts: F64
    power: F64
    shared: F64
    products: F64

    @classmethod
    def of(cls, fit: Estimates, m: NDArray[np.intp]) -> _Lines:
        residual, basis, ends = fitted_lines(fit, 0)
        every = np.vstack([residual, basis.T])
        records = [every[:, a:b].reshape(len(every), 2, -1) for a, b in pairwise([0, *ends.tolist()])]
        products = np.concatenate([np.einsum("pcm,qcm->mpq", own, own) for own in records])
        parts = np.where(m == 0, 1.0, 2.0)
        products *= parts[:, None, None]
        return cls(parts, products[:, 0, 0], products[:, 0, 1:], products[:, 1:, 1:])

    def deviance(self, shapes: F64) -> float:
        """The least -2 log restricted likelihood of noise of some shapes (shape, line) beside white noise."""
        lines, count = self.shared.shape
        free, best = float(self.parts.sum()) - count, np.inf
        flat = self.products.reshape(lines, -1)
        for white in WHITE.tolist():
            spectra = (1 - white) * shapes + white
            inverse = 1 / spectra
            information = (inverse @ flat).reshape(-1, count, count)
            moved = inverse @ self.shared
            try:
                solved = np.linalg.solve(information, moved[:, :, None])[:, :, 0]
            except np.linalg.LinAlgError:  # a shape that leaves no line with all columns
                continue
            left = inverse @ self.power - np.sum(moved * solved, axis=1)
            found = np.log(spectra) @ self.parts + free * np.log(left / free)
            found += np.linalg.slogdet(information)[1]
            best = min(best, float(np.min(found[np.isfinite(found)], initial=np.inf)))
        return best


def either(fit: Estimates) -> str:
    """What to do where noise of the sensors and of the system look alike, by what the safe choice costs."""
    price = _price_of_process(fit)
    text = (
        f"{position(fit)} Noise that drives the system, such as turbulence, looks like this, too, and one "
        "record does not tell it from slow noise of the sensors."
    )
    if price is None:
        return f'{text} Where turbulence or a load is known to act, first take noise="process".'
    least, mean = price
    if least > COSTLY:
        size = f"{mean:.2g}" if mean < 100 else "over 100"
        dear = (
            f'noise="process" holds for both, but its standard errors are {size} times larger (geometric '
            "mean). Take it where turbulence or a load is known to act."
        )
        if mean < UNTOLD and fit.success and not moved_by_weights(fit):
            return f"{text} First keep this fit, whose errors allow for slow noise of the sensors: {dear}"
        return (
            f"{text} The estimates rest on which of both it is, and their intervals may be too short: {dear} "
            "First take a longer record, or one that moves the system more beside the noise."
        )
    return (
        f'{text} First take noise="process", whose intervals hold for both: its standard errors are '
        f"{mean:.2g} times those of this fit (geometric mean)."
    )


def position(fit: Estimates) -> str:
    """That a held input may be a command, which an actuator follows in its own way."""
    held = [name for name, word in zip(fit.inputs, fit.intersample, strict=True) if word == "zoh"]
    if not held:
        return ""
    return (
        f" If {' or '.join(held)} is a command, a rate limit, backlash or friction of its actuator looks "
        "like this, too: record the position, and take it as the input."
    )


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
    gain = smaller_errors(fit, other) if other is not None else nan
    return gain if gain >= LEAST_GAIN else None


def _price_of_process(fit: Estimates) -> tuple[float, float] | None:
    """How many times larger errors are with noise="process": the least and the geometric mean."""
    other = None
    if fit.again is not None and fit.records is not None and fit.bse.size and np.all(fit.bse > 0):
        other = again(fit, fit.records, fit.structure, fit.options.replace(noise="process", method="ml"))
    if other is None or not np.all(other.bse > 0):
        return None
    return float(np.min(other.bse / fit.bse)), 1 / smaller_errors(fit, other)


def smaller_errors(fit: Estimates, other: Estimates) -> float:
    """How many times smaller the standard errors of another fit are, geometric mean; nan without any."""
    if not (fit.bse.size and np.all(fit.bse > 0) and np.all(other.bse > 0)):
        return nan
    return float(np.exp(np.mean(np.log(fit.bse / other.bse))))


def wide_band(fit: Estimates) -> tuple[float, float]:
    """The band of a fit up to eight samples a period, or as many lines as are cheap."""
    least = min(2 * np.pi / ((rec.dt or np.inf) * 8) for rec in fit.records or ())
    most = LINES // max(len(fit.outputs), 2) * min(fit.omega0)
    return fit.band[0], max(fit.band[1], float(min(least, most)))


@kept
def in_process_noise(fit: Estimates) -> Estimates | None:
    """The fit on a wide band in noise that drives the system; None where it has no answer."""
    options = on_band(fit, wide_band(fit)).replace(noise="process", method="ml")
    return again(fit, fit.records, fit.structure, options)


def gain_of_process(fit: Estimates) -> tuple[float, float] | None:
    """BIC of equations over a wide band without and with noise in each; None where that does not pay."""
    if fit.layout.rational or fit.options.noise != "output" or fit.again is None or fit.records is None:
        return None
    driven = in_process_noise(fit)  # none of equations that are not linear, say
    if driven is None or driven.process_levels is None:
        return None
    plain = again(fit, fit.records, fit.structure, on_band(fit, wide_band(fit)))
    if plain is None:
        return None
    after = driven.bic + len(fit.outputs) * np.log(driven.df_resid)
    return (plain.bic, after) if after < plain.bic - WORTH else None
