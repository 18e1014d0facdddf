"""What `sinusoids` returns: tones of one record and of many."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arguments import public
from ..base.arrays import F64
from ..base.names import nearest
from ..base.student import confidence, student_interval
from ..base.tables import Findings, Table
from ..errors import SpecError
from . import drawing
from .check import check

__all__ = ["KINDS", "Sinusoids", "SinusoidsMany"]

KINDS = ("omega", "damping", "amplitude", "phase")
MESSAGES = {
    "ok": "the tones explain the record best among all sets that the search found",
    "maxiter": "the frequencies did not settle: two tones run into one another, or one to 0 or to half the "
    "sampling rate. Look for fewer tones, fit an offset (trend), or take a longer record",
    "rank": "tones cannot be told apart, or one lies at 0 or at half the sampling rate, where amplitude and "
    "phase are one unknown. Look for fewer tones",
    "nonfinite": "samples are not finite",
}


@dataclass(frozen=True, eq=False, repr=False)
class _Tones:
    """What one record and many have in common: parameters by kind along the last axis."""

    params: F64
    bse: F64
    kinds: tuple[str, ...]

    def _of(self, kind: str) -> F64:
        count = self.params.shape[-1] // len(self.kinds)
        if kind not in self.kinds:
            return np.zeros((*self.params.shape[:-1], count))
        at = self.kinds.index(kind) * count
        return self.params[..., at : at + count]

    @property
    def param_names(self) -> tuple[str, ...]:
        """omega1, omega2, …, damping1, … (where free), amplitude1, …, phase1, …"""
        count = self.params.shape[-1] // len(self.kinds)
        return tuple(f"{kind}{i + 1}" for kind in self.kinds for i in range(count))

    @property
    def omega(self) -> F64:
        """Frequencies in rad/s, ascending."""
        return self._of("omega")

    @property
    def damping(self) -> F64:
        """d of e^(-d t), 1/s; zero for tones that may not decay."""
        return self._of("damping")

    @property
    def amplitude(self) -> F64:
        """Amplitudes at the first sample."""
        return self._of("amplitude")

    @property
    def phase(self) -> F64:
        """Phases of cosines at the first sample, radians, in (-pi, pi]."""
        return self._of("phase")

    def __getitem__(self, name: str) -> Any:
        """One parameter by name: a number, of many records an array."""
        if name not in self.param_names:
            raise SpecError(f"sinusoids: there is no parameter {name!r}; {nearest(name, self.param_names)}")
        value = self.params[..., self.param_names.index(name)]
        return float(value) if value.ndim == 0 else value


@public
@dataclass(frozen=True, eq=False, repr=False)
class Sinusoids(_Tones):
    """Tones of one record; see `sinusoids`.

    y(t) = trend + sum of amplitude·e^(-damping·t)·cos(omega·t + phase), t from the first sample. A complex
    record has amplitude·e^((i·omega - damping)·t + i·phase).

    Attributes
    ----------
    params : (p,) array
        Estimates by number or name, ``s.params["omega1"]``: also as `omega`, `damping`, `amplitude`, `phase`.
    bse : (p,) array
        Standard errors for white noise, by number or name.
    kinds : tuple of str
        What the parameters are, in this order: "omega", "damping" (where free), "amplitude", "phase".
    cov : (p, p) array
    sigma : float
        Standard deviation of the noise (complex records: of the real and of the imaginary part).
    df_resid : int
        Real numbers less unknowns.
    cost : float
        Sum of squares that is left.
    costs : (k + 1,) array
        The same with 0, 1, … tones, as far as the search went.
    status, nit : str, int
        "ok", "maxiter", "rank" or "nonfinite"; Gauss-Newton steps.
    trend : str or None
    offset : array
        Coefficients of the trend: of 1 and of (k - (n - 1)/2)/n, k the sample; complex records: real and
        imaginary part of each.
    y : (time,) array
        The samples, real or complex.
    weights : (time,) array
        Zero where samples are masked; else 1, or 1/sigma of the record.
    dt : float
    lines : int
        Lines of the spectrum on each side of a tone that were fitted; 0: all samples.

    See Also
    --------
    modfun.sinusoids : Makes it.
    modfun.SinusoidsMany : Of many records.
    modfun.plot.sinusoids : Draws it.

    References
    ----------
    P. Stoica, R. Moses, Spectral Analysis of Signals, Prentice-Hall, 2005.

    Examples
    --------
    >>> import numpy as np
    >>> import modfun as mf
    >>> t = np.arange(200) * 0.1
    >>> y = np.sin(1.3 * t) + 0.01 * np.random.default_rng(0).normal(size=t.size)
    >>> found = mf.sinusoids(mf.Record(y=y, dt=0.1), count=1)
    >>> print(found.omega.round(3))
    [1.3]
    """

    cov: F64
    sigma: float
    df_resid: int
    cost: float
    costs: F64
    status: str
    nit: int
    trend: str | None
    offset: F64
    y: NDArray[Any]
    weights: F64
    dt: float
    lines: int

    @property
    def success(self) -> bool:
        """Whether the estimates can be used."""
        return self.status == "ok"

    @property
    def message(self) -> str:
        """The status in words."""
        return MESSAGES[self.status]

    def __len__(self) -> int:
        return int(self.omega.size)

    def check(self) -> Findings:
        """What is wrong or doubtful about the tones, in sentences with numbers and what to try.

        Tones no larger than peaks of noise, with less than one period, or too close together; samples far
        from all others; and, unless only `lines` were fitted, tones that decay, grow or move, a further
        tone, and noise whose level about a tone is not that of the record. Each kind of test objects where
        its p-value is below 0.01, over all tones, lines or samples that it looks at; all together object to
        about one right answer in thirty.
        """
        return check(self)

    def cov_params(self) -> F64:
        """Covariance of the parameters (a copy)."""
        return self.cov.copy()

    def conf_int(self, level: float = 0.95) -> F64:
        """Confidence intervals, (p, 2), from Student's t with `df_resid` degrees of freedom."""
        level = confidence("conf_int", level)
        return np.column_stack(
            student_interval(np.asarray(self.params), np.asarray(self.bse), self.df_resid, level)
        )

    def estimates(self) -> dict[str, float]:
        """Estimates by name, what an estimator of `MonteCarlo` may return."""
        return dict(zip(self.param_names, self.params.tolist(), strict=True))

    def predict(self) -> NDArray[Any]:
        """Tones and trend at the samples."""
        n = self.y.size
        t = self.dt * np.arange(n)
        waves = self.amplitude * np.exp(
            np.outer(t, 1j * self.omega - self.damping) + 1j * self.phase
        )  # (time, tone)
        powers = np.vander((np.arange(n) - (n - 1) / 2) / n, 2, increasing=True)
        if np.iscomplexobj(self.y):
            offset = self.offset[0::2] + 1j * self.offset[1::2]
            return np.asarray(waves.sum(axis=1) + powers[:, : offset.size] @ offset)
        return np.asarray(waves.real.sum(axis=1) + powers[:, : self.offset.size] @ self.offset)

    def errors(self) -> NDArray[Any]:
        """Measured less predicted samples; nan where masked."""
        return np.where(self.weights > 0, self.y - self.predict(), np.nan)

    def summary(self) -> Table:
        """One row per tone, its standard errors beside; how it went in the title."""
        columns: dict[str, Any] = {"tone": np.arange(1, len(self) + 1)}
        errors = self.bse.reshape(len(self.kinds), len(self))
        for kind, error in zip(self.kinds, errors, strict=True):
            columns |= {kind: self._of(kind), f"{kind}_bse": error}
        doubts = len(self.check()) if self.success else 0
        how = f"; {doubts} doubt{'s' if doubts > 1 else ''}, see check()" if doubts else ""
        how = how if self.success else f"; {self.status}: {self.message}"
        tones = "1 tone" if len(self) == 1 else f"{len(self)} tones"
        return Table(columns, title=f"{tones} (rad/s, 1/s), noise sd {self.sigma:.4g}{how}")

    def plot(self, *, ax: Any = None, hz: bool = False) -> Any:
        """Draw the spectrum of the record and of what the tones leave; see `modfun.plot.sinusoids`."""
        bse = self.bse[: len(self)]
        return drawing.tones(
            self.y, self.errors(), self.weights, self.dt, self.omega, bse, self.amplitude, ax, hz
        )

    def __repr__(self) -> str:
        return repr(self.summary())

    def _repr_html_(self) -> str:
        return self.summary()._repr_html_()


@public
@dataclass(frozen=True, eq=False, repr=False)
class SinusoidsMany(_Tones):
    """Tones of many records; see `sinusoids`.

    Attributes
    ----------
    params, bse : (replicate, p) array
        Estimates and standard errors in the order of `param_names`; nan behind the tones that were chosen.
    kinds : tuple of str
        What the parameters are, in this order: "omega", "damping" (where free), "amplitude", "phase".
    count : (replicate,) array of int
        Tones found.
    sigma, cost : (replicate,) array
    status : (replicate,) array of str
    nit : (replicate,) array of int

    See Also
    --------
    modfun.sinusoids : Makes it of a `Batch`.
    modfun.Sinusoids : Of one record.

    References
    ----------
    P. Stoica, R. Moses, Spectral Analysis of Signals, Prentice-Hall, 2005.

    Examples
    --------
    >>> import numpy as np
    >>> import modfun as mf
    >>> t = np.arange(200) * 0.1
    >>> y = np.sin(1.3 * t) + 0.01 * np.random.default_rng(0).normal(size=(4, 1, t.size))
    >>> many = mf.sinusoids(mf.Batch(y=y, dt=0.1), count=1)
    >>> many.params.shape
    (4, 3)
    """

    count: NDArray[np.int64]
    sigma: F64
    cost: F64
    status: NDArray[np.str_]
    nit: NDArray[np.int64]

    @property
    def success(self) -> NDArray[np.bool_]:
        """Which estimates can be used."""
        return np.asarray(self.status == "ok")

    def __len__(self) -> int:
        return int(self.params.shape[0])

    def table(self) -> Table:
        """Mean, sd, median and mean standard error of each parameter over the good records."""
        values, errors = self.params[self.success], self.bse[self.success]
        columns: dict[str, list[Any]] = {
            name: [] for name in ("parameter", "mean", "sd", "median", "mean_bse")
        }
        for name, value, error in zip(self.param_names, values.T, errors.T, strict=True):
            value, error = value[np.isfinite(value)], error[np.isfinite(error)]
            some = value.size > 0
            columns["parameter"].append(name)
            columns["mean"].append(value.mean() if some else np.nan)
            columns["sd"].append(value.std(ddof=1) if value.size > 1 else np.nan)
            columns["median"].append(np.median(value) if some else np.nan)
            columns["mean_bse"].append(error.mean() if error.size else np.nan)
        return Table(columns, title=f"{int(self.success.sum())} of {len(self)} records succeeded")

    def __repr__(self) -> str:
        return repr(self.table())

    def _repr_html_(self) -> str:
        return self.table()._repr_html_()
