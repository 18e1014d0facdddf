"""Sinusoids in noise: frequencies, dampings, amplitudes and phases of the tones of a record."""

from __future__ import annotations

from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._core import sinusoids as core_sinusoids
from ..base.arguments import public, real, reals, whole
from ..base.arrays import F64
from ..base.named import Named
from ..base.names import nearest
from ..base.progress import Progress
from ..base.samples import FEWEST, LARGEST
from ..base.words import STATUS, TRENDS
from ..errors import DataError, SpecError
from ..models.options import MOST_THREADS
from ..records.batches import Batch
from ..records.record import Record
from .results import KINDS, Sinusoids, SinusoidsMany

__all__ = ["sinusoids"]

METHODS = ("ml", "awls")
AWLS_LINES = 9


@public
@overload
def sinusoids(
    data: Batch,
    count: int | None = None,
    *,
    damped: bool = False,
    method: str = "ml",
    lines: int | None = None,
    trend: str | None = "auto",
    band: float | tuple[float, float] | None = None,
    most: int = 8,
    dt: None = None,
    threads: int | None = None,
    progress: str | bool = "auto",
) -> SinusoidsMany: ...


@public
@overload
def sinusoids(
    data: Record | ArrayLike,
    count: int | None = None,
    *,
    damped: bool = False,
    method: str = "ml",
    lines: int | None = None,
    trend: str | None = "auto",
    band: float | tuple[float, float] | None = None,
    most: int = 8,
    dt: float | None = None,
    threads: int | None = None,
    progress: str | bool = "auto",
) -> Sinusoids: ...


@public
def sinusoids(
    data: Record | Batch | ArrayLike,
    count: int | None = None,
    *,
    damped: bool = False,
    method: str = "ml",
    lines: int | None = None,
    trend: str | None = "auto",
    band: float | tuple[float, float] | None = None,
    most: int = 8,
    dt: float | None = None,
    threads: int | None = None,
    progress: str | bool = "auto",
) -> Sinusoids | SinusoidsMany:
    """Find the sinusoids in a record, their standard errors with them.

    Tones are looked for one after another on a zero-padded spectrum of what the others leave, the best sets
    kept, and settled together by Gauss-Newton steps: the maximum likelihood estimate for white noise.

    Parameters
    ----------
    data : Record, Batch or array_like, shape (time,)
        One output, evenly sampled; inputs are not looked at. Masked samples are left out, `sigma` of a record
        weighs them. An array may be complex, of complex exponentials; it needs `dt`.
    count : int, optional
        Number of tones; default: chosen, at most `most`, by BIC in which a frequency counts three times
        (docs/sinusoids.md has the rate of right choices).
    damped : bool, default False
        Whether tones may decay or grow: damping is estimated, too.
    method : {"ml", "awls"}
        "awls" takes the tones from the lines around them by reweighted least squares instead: the report's
        homogeneous model, exact for samples. Real records.
    lines : int, optional
        See only so many lines of the spectrum on each side of a tone, at least 2; standard errors are then of
        the noise near each tone, whatever its colour. Default: all samples; of "awls" 9.
    trend : {"auto", None, "constant", "linear"}
        Fitted beside the tones; "auto": "constant", of complex arrays None.
    band : float or (float, float), optional
        Upper edge, or both, of where tones are looked for, rad/s; default: everywhere.
    most : int, default 8
        Most tones that are looked for where `count` is not given.
    dt : float, optional
        Sampling interval of an array, s.
    threads : int, optional
        For a Batch; default: all cores, or MODFUN_NUM_THREADS.
    progress : {"auto", True, False}
        Of a Batch, on standard error; "auto": from two seconds on.

    Returns
    -------
    Sinusoids, or SinusoidsMany for a Batch

    Raises
    ------
    DataError
        Several channels, uneven steps, samples that are not finite or do not change, too few for the count.
    SpecError
        Options out of range.

    See Also
    --------
    modfun.Sinusoids : What it returns.
    modfun.frf : Responses to inputs.

    References
    ----------
    P. Stoica, R. Moses, Spectral Analysis of Signals, Prentice-Hall, 2005; S. M. Kay, S. L. Marple, Proc.
    IEEE 69, 1981.

    Examples
    --------
    >>> import numpy as np
    >>> t = 0.01 * np.arange(256)
    >>> noise = 0.1 * np.random.default_rng(0).standard_normal(256)
    >>> s = sinusoids(Record(y=np.cos(60 * t) + np.sin(75 * t) + noise, dt=0.01), count=2)
    >>> [float(round(w, 1)) for w in s.omega]
    [60.0, 75.0]
    """
    y, weights, step = _samples(data, dt)
    many, is_complex = isinstance(data, Batch), np.iscomplexobj(y)
    trend = _checked(count, most, trend, is_complex)
    reach = _lines(method, lines, is_complex, weights)
    powers = TRENDS.index(trend)
    real = np.concatenate([y.real, y.imag], axis=1) if is_complex else y
    width = (4 if damped else 3, (2 if is_complex else 1) * powers)
    good = int(np.sum(weights > 0)) * (2 if is_complex else 1)
    wanted = min(most, max((good - 1 - width[1]) // width[0], 1)) if count is None else count
    with np.errstate(invalid="ignore"):
        peaks = np.max(np.abs(real), axis=1)
        still = np.ptp(y[:, weights > 0], axis=1) == 0 if not is_complex else peaks == 0
    if not many and bool(still[0]):
        raise DataError(f"sinusoids: y is {y[0, 0]:g} throughout: there is no tone in it")
    scale = np.ldexp(1.0, np.frexp(np.where(np.isfinite(peaks) & (peaks > 0), peaks, 1.0))[1])
    with Progress(progress if many else False, "sinusoids", "records") as bar:
        found = core_sinusoids(
            np.ascontiguousarray(real / scale[:, None]),
            weights,
            count=wanted,
            choose=count is None,
            damped=bool(damped),
            complex=is_complex,
            trend=powers,
            band=_edges(band, step, is_complex),
            lines=reach,
            awls=method == "awls",
            threads=None if threads is None else whole("sinusoids", "threads", threads, 1, MOST_THREADS),
            progress=bar,
        )
    kinds = KINDS if damped else tuple(kind for kind in KINDS if kind != "damping")
    if many:
        return _made_many(found, kinds, wanted, step, scale)
    return _made(found, kinds, wanted, step, float(scale[0]), trend, y[0], weights, reach)


def _made(
    found: dict[str, Any],
    kinds: tuple[str, ...],
    wanted: int,
    dt: float,
    scale: float,
    trend: str | None,
    y: NDArray[Any],
    weights: F64,
    lines: int,
) -> Sinusoids:
    own = int(found["count"][0])
    unit = _units(kinds, own, dt) * np.repeat([scale if kind == "amplitude" else 1.0 for kind in kinds], own)
    params, bse = (
        found[name][0].reshape(len(kinds), wanted)[:, :own].ravel() * unit for name in ("params", "bse")
    )
    names = tuple(f"{kind}{i + 1}" for kind in kinds for i in range(own))
    return Sinusoids(
        params=Named(params, names),
        bse=Named(bse, names, "se"),
        kinds=kinds,
        cov=found["cov"] * np.outer(unit, unit),
        sigma=float(np.sqrt(found["variance"][0])) * scale,
        df_resid=int(found["df_resid"]),
        cost=float(found["cost"][0]) * scale * scale,
        costs=found["costs"] * scale * scale,
        status=STATUS[found["status"][0]],
        nit=int(found["nit"][0]),
        trend=trend,
        offset=found["trend"] * scale,
        y=y,
        weights=weights,
        dt=dt,
        lines=lines,
    )


def _made_many(
    found: dict[str, Any], kinds: tuple[str, ...], wanted: int, dt: float, scale: F64
) -> SinusoidsMany:
    rows = scale[:, None]
    unit = _units(kinds, wanted, dt) * np.hstack(
        [
            np.broadcast_to(rows if kind == "amplitude" else np.ones_like(rows), (len(rows), wanted))
            for kind in kinds
        ]
    )
    return SinusoidsMany(
        params=found["params"] * unit,
        bse=found["bse"] * unit,
        kinds=kinds,
        count=found["count"],
        sigma=np.sqrt(found["variance"]) * scale,
        cost=found["cost"] * scale * scale,
        status=np.array(STATUS).take(found["status"]),
        nit=found["nit"],
    )


def _units(kinds: tuple[str, ...], count: int, dt: float) -> F64:
    """Per sample into per second."""
    return np.repeat([1 / dt if kind in ("omega", "damping") else 1.0 for kind in kinds], count)


def _samples(data: Record | Batch | ArrayLike, dt: float | None) -> tuple[NDArray[Any], F64, float]:
    """Samples (replicate, time), weights (time,) and the step."""
    if isinstance(data, Record | Batch):
        if dt is not None:
            raise SpecError("sinusoids: dt= is for arrays; a Record or Batch has its own")
        if data.dt is None:
            raise DataError("sinusoids: the steps are uneven; resample the record, or give dt= if it is even")
        if len(data.outputs) != 1:
            raise DataError(
                f"sinusoids: there are {len(data.outputs)} outputs ({', '.join(data.outputs)}); take one at "
                f"a time, as rec.select(outputs={data.outputs[0]!r})"
            )
        if isinstance(data, Batch):
            if data.sigma is not None and len(data.sigma) > 1:
                raise SpecError(
                    "sinusoids: records of a Batch share the weights of their samples; give sigma of shape "
                    "(time,), or fit records one by one, mf.sinusoids(batch[k])"
                )
            shared = np.ones(data.y.shape[2]) if data.sigma is None else 1 / data.sigma[0, 0]
            return data.y[:, 0], shared, data.dt
        weights = np.ones(data.y.shape[1]) if data.sigma is None else 1 / data.sigma[0]
        if data.mask is not None:
            weights = np.where(data.mask[0], weights, 0.0)
        return data.y, weights, data.dt
    try:
        y = np.asarray(data)
        y = y.astype(np.complex128 if y.dtype.kind == "c" else np.float64)
    except (TypeError, ValueError) as wrong:
        raise DataError("sinusoids: data must be a Record, a Batch or an array of numbers") from wrong
    if y.ndim != 1:
        raise DataError(
            f"sinusoids: an array must be 1-D (time), its shape is {y.shape}; many records are a Batch"
        )
    if y.size < FEWEST:
        raise DataError(f"sinusoids: {y.size} samples are too few; at least {FEWEST} are needed")
    if not np.all(np.isfinite(y)):
        where = int(np.argmin(np.isfinite(y)))
        raise DataError(
            f"sinusoids: sample {where} is {y[where]}; cut it off, fill it, or mask it in a Record"
        )
    if np.abs(y).max() > LARGEST:
        raise DataError(
            f"sinusoids: the samples reach {np.abs(y).max():.3g}, whose square overflows; give them in "
            "another unit"
        )
    if dt is None or not real("sinusoids", "dt", dt) > 0:
        raise SpecError(
            f"sinusoids: dt={dt!r}; an array needs its sampling interval in seconds, a positive number"
        )
    if not 1e-150 < dt < 1e150:
        raise SpecError(f"sinusoids: a step of {dt!r} s is out of range; give time in another unit")
    return y[None], np.ones(y.size), float(dt)


def _checked(count: int | None, most: int, trend: str | None, is_complex: bool) -> str | None:
    for name, value in (("count", count), ("most", most)):
        whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
        if value is not None and not (whole and value >= 1):
            raise SpecError(f"sinusoids: {name}={value!r} must be a whole number of at least 1")
    if trend != "auto" and trend not in TRENDS:
        raise SpecError(
            f"sinusoids: trend={trend!r} is not available; {nearest(trend, ('auto', *TRENDS[1:]))}, or None"
        )
    if trend == "auto":
        return None if is_complex else "constant"
    return trend


def _lines(method: str, lines: int | None, is_complex: bool, weights: F64) -> int:
    """Lines on each side of a tone; 0: the samples."""
    if method not in METHODS:
        raise SpecError(f"sinusoids: method={method!r} is not available; {nearest(method, METHODS)}")
    if lines is None:
        if method == "ml":
            return 0
        lines = AWLS_LINES
    if not isinstance(lines, int | np.integer) or isinstance(lines, bool) or lines < 2:
        raise SpecError(f"sinusoids: lines={lines!r} must be a whole number of at least 2, or None")
    if method == "awls" and is_complex:
        raise SpecError('sinusoids: method="awls" takes real records; use "ml" for complex ones')
    if np.ptp(weights) > 0:
        raise DataError(
            "sinusoids: lines of a record with masked or unequal samples depend on one another; leave lines "
            'out and take method="ml"'
        )
    return min(int(lines), weights.size)  # there are no more


def _edges(band: float | tuple[float, float] | None, dt: float, is_complex: bool) -> tuple[float, float]:
    """The band in turns a sample."""
    limit = np.pi / dt
    low, high = -limit if is_complex else 0.0, limit
    if band is not None:
        given = np.atleast_1d(reals("sinusoids", "band", band))
        if given.size == 1:
            given = np.array([low, given[0]])
        if given.size != 2 or not low <= given[0] < given[1] <= limit * (1 + 1e-9):
            raise SpecError(
                f"sinusoids: band={band!r} must be an upper edge or (lower, upper) in rad/s, between "
                f"{low:.4g} and {limit:.4g}, half the sampling rate"
            )
        low, high = given
    return float(low * dt / (2 * np.pi)), float(high * dt / (2 * np.pi))
