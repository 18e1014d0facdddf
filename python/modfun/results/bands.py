"""How well a fit predicts a record: intervals of its response, and of new samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import F64
from ..base.gamma_regression import smooth_level
from ..base.names import nearest
from ..base.student import confidence, root, student_interval
from ..errors import SpecError
from ..records.mask import sample_weights
from ..records.record import Record
from .estimates import Estimates
from .prediction import InitialState
from .slopes import response_slopes

__all__ = ["Prediction", "both", "predicted"]

INTERVALS = ("confidence", "prediction")
LEAST = 0.1  # of the noise of a line that must be left of it


@dataclass(frozen=True, eq=False)
class Prediction:
    """A simulated response with the limits of its interval at each sample.

    Attributes
    ----------
    y, lower, upper : ndarray, shape (output, time)
    se : ndarray, shape (output, time)
        Standard error of the response, of an interval of samples with their noise.
    level : float
        Confidence of the interval at one sample.
    kind : {"confidence", "prediction"}
        Whether it is of the response or of new samples.
    outputs : tuple of str
    """

    y: F64
    lower: F64
    upper: F64
    se: F64
    level: float
    kind: str
    outputs: tuple[str, ...]

    def __repr__(self) -> str:
        half = (self.upper - self.lower) / 2
        rows = zip(self.outputs, self.y, half, strict=True)
        return "\n".join(
            f"{name}: {y.size} samples from {y.min():.4g} to {y.max():.4g}, {100 * self.level:g} % "
            f"{self.kind} interval within ±{np.median(own):.3g} (median)"
            for name, y, own in rows
        )


def predicted(
    fit: Estimates, rec: Record, kind: str | None, initial_state: Any = None, level: float | None = None
) -> Prediction | Record:
    """Response of a fit to a record, with its interval where there is a kind of it; see `Fit.predict`."""
    if kind is None:
        if level is not None:
            raise SpecError(
                f"predict: level={level!r} belongs to an interval; give interval='confidence' or 'prediction'"
            )
        return rec._like(y=fit.simulate(rec, initial_state)[0], mask=None, sigma=None)
    if kind not in INTERVALS:
        raise SpecError(f"predict: interval={kind!r} is unknown; {nearest(kind, INTERVALS)}")
    return both(fit, rec, initial_state, 0.95 if level is None else level)[kind]


def both(
    fit: Estimates, rec: Record, initial_state: Any = None, level: float = 0.95
) -> dict[str, Prediction]:
    """A response with both kinds of intervals.

    With z the record's initial state and trend, found from its output under θ, the response has the variance
    dy/dθ cov θ̂ dy/dθᵀ, z moving with θ, and that of z under a known θ: θ̂ comes from another record or, of
    the record itself, from what z leaves of it.
    """
    level = confidence("predict", level)
    y, initial = fit.simulate(rec, initial_state)
    found = _variances(fit, rec, y, initial, initial_state)
    left = found.left[:, None]
    parts, made = [(found.of_params, found.degrees), (found.of_start, left)], {}
    for kind in INTERVALS:
        if kind == "prediction":
            parts.append((found.noise**2, left))
        variance = np.asarray(sum(own for own, _ in parts))
        with np.errstate(divide="ignore", invalid="ignore"):
            # Welch and Satterthwaite: parts of a variance that are known to so many degrees of freedom.
            degrees = variance**2 / sum(own**2 / free for own, free in parts)
        se = root(variance)
        made[kind] = Prediction(
            y,
            *student_interval(y, se, np.nan_to_num(degrees, nan=np.inf), level),
            se,
            level,
            kind,
            rec.outputs,
        )
    return made


class _Variances(NamedTuple):
    """Parts of the variance of a response, (output, time), and what they are known to.

    Attributes
    ----------
    of_params, of_start : ndarray
        By the errors of the parameters, and of initial state and trend under known ones.
    noise : ndarray
        Standard deviation of the noise of each sample.
    degrees : ndarray, shape (output, time)
        Degrees of freedom of the first part.
    left : ndarray, shape (output,)
        Those of the residuals.
    """

    of_params: F64
    of_start: F64
    noise: F64
    degrees: F64
    left: F64


def _variances(fit: Estimates, rec: Record, y: F64, initial: InitialState, given: Any) -> _Variances:
    own = sample_weights(rec.mask, rec.sigma, y.shape)
    moved, columns, following = response_slopes(fit, rec, initial, given)
    errors = own * (rec.y - y)
    level = np.sqrt(np.sum(errors**2, axis=1) / np.count_nonzero(own, axis=1))
    level = np.maximum(level, 1e-12 * np.abs(rec.y).max())[:, None]
    weight = own / level
    rows = (columns * weight).reshape(len(columns), y.size).T
    size = np.linalg.norm(rows, axis=0)
    size = np.where(size > 0, size, 1.0)
    u, singular, right = np.linalg.svd(rows / size, full_matrices=False)
    keep = singular > 1e-12 * singular.max(initial=0.0)
    u, columns = u[:, keep], np.tensordot(right[keep] / singular[keep, None] / size, columns, 1)
    if not following:
        moved = moved - np.tensordot((moved * weight).reshape(len(moved), y.size) @ u, columns, 1)
    cov = np.nan_to_num(fit.cov_params())
    of_params = np.einsum("iot,ij,jot->ot", moved, cov, moved)
    shares = moved**2 * np.diag(cov)[:, None, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        each = np.broadcast_to(np.asarray(fit.degrees, dtype=np.float64), len(cov))
        degrees = shares.sum(axis=0) / np.nansum(shares / each[:, None, None], axis=0)
    fitted = u
    if any(rec is one for one in fit.records or ()):
        directions = (moved * weight).reshape(len(moved), y.size).T
        fitted = np.linalg.qr(np.hstack([u, directions / np.linalg.norm(directions, axis=0)]))[0]
    across, lost = _coloured(
        u.reshape(*y.shape, len(columns)), fitted.reshape(*y.shape, fitted.shape[1]), errors / level
    )
    left = np.count_nonzero(own, axis=1)
    with np.errstate(divide="ignore"):
        size = level * np.sqrt(1 + lost / left)[:, None]
        noise = np.where(own > 0, size / own, size)
    of_start = np.einsum("iot,ij,jot->ot", columns, across, columns)
    return _Variances(of_params, of_start, noise, degrees, left)


def _coloured(functions: F64, fitted: F64, errors: F64) -> tuple[F64, F64]:
    """Covariance of sums of noise weighted by functions (output, time, k), and what residuals have lost.

    The noise of each output has a smooth spectrum, as for standard errors. Residuals are noise less its
    components along the orthonormal functions that were fitted; the squares of these are lost, (output,).
    """
    count = errors.shape[1]
    lines = np.arange(count // 2 + 1)
    freedom = np.where((lines == 0) | (2 * lines == count), 1.0, 2.0)
    used = np.abs(np.fft.rfft(fitted, axis=1)) ** 2 / count
    free = np.maximum(1 - used.sum(axis=2), 0.0)
    power = np.abs(np.fft.rfft(errors, axis=1)) ** 2 / count
    with np.errstate(divide="ignore", invalid="ignore"):
        noise = np.where(free > LEAST, power / free, 0.0)
    spectra = np.array(
        [
            smooth_level(own, np.log1p(lines), np.where(some > LEAST, freedom * some, 0.0))
            for own, some in zip(noise, free, strict=True)
        ]
    )
    lost = np.einsum("olk,ol->o", used, freedom * spectra)
    waves = np.fft.rfft(functions, axis=1) * np.sqrt(freedom * spectra / count)[:, :, None]
    waves = waves.reshape(waves.shape[0] * waves.shape[1], functions.shape[2])
    return np.asarray((waves.conj().T @ waves).real), lost
