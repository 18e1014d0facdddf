"""Fourier coefficients of records and the modulated regressors made of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, comb

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._core import coefficients as core_coefficients
from .._core import quadrature_weights
from ..base.arguments import public, reals, whole
from ..base.arrays import C128, F64
from ..base.names import nearest
from ..errors import DataError, SpecError
from ..models.options import MOST, WORDS
from ..models.transfer_function import TransferFunction
from ..records.corners import driving
from ..records.mask import refuse_own_noise
from ..records.record import Record

__all__ = ["Coefficients", "Regressors", "coefficients", "regressors", "spectrum"]


# Fourier coefficients ----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Fourier coefficients of a record over [0, T], report, eqs. (8) and (21).

    Attributes
    ----------
    omega : ndarray, shape (harmonic,)
        m·2π/T in rad/s, m = 0, 1, …
    y : ndarray of complex, shape (output, harmonic)
    u : ndarray of complex, shape (input, harmonic)
    """

    omega: F64
    y: C128
    u: C128


@public
def coefficients(rec: Record, harmonics: int, rule: str = "gregory") -> Coefficients:
    """Fourier coefficients V(m) = (1/T) ∫ v(t) exp(−i m 2π t/T) dt of a record, m = 0 … harmonics.

    Parameters
    ----------
    rec : Record
    harmonics : int
        Highest harmonic, at most half the number of intervals.
    rule : {"gregory", "parabolic", "trapezoid", "staircase"}
        Quadrature of the outputs and of smooth inputs, report, eq. (21); held and linearly interpolated
        inputs are integrated exactly.

    Returns
    -------
    Coefficients

    See Also
    --------
    modfun.regressors : The modulated regressors made of them.
    modfun.frf : Gains without a model.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, eqs. (8) and (21).

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> c = mf.coefficients(rec, harmonics=5)
    >>> c.y.shape
    (1, 6)
    """
    _check_rule("coefficients", rule)
    top = whole("coefficients", "harmonics", harmonics, 0, MOST)
    y, u = spectrum(rec, top, rule)
    return Coefficients(omega=np.arange(top + 1.0) * (2 * np.pi / rec.duration), y=y, u=u)


def spectrum(
    rec: Record, top: int, rule: str, delays: Sequence[float] | None = None, lead: int = 0
) -> tuple[C128, C128]:
    """Coefficients 0 … `top` of outputs and inputs (channel, line), the inputs late by `delays`, s.

    Raises
    ------
    DataError
        Too few samples.
    """
    intervals = rec.intervals - lead
    if 2 * top > intervals:
        raise DataError(
            f"the record has {intervals} sampling intervals"
            + (f" after the {lead} that the delays take" if lead else "")
            + f", so harmonics go up to {intervals // 2}, not {top}: lower harmonics, or sample faster"
        )
    kinds = [rule if k == "smooth" else k for k in rec.intersample]
    late = [d / rec.dt if rec.dt else 0.0 for d in delays or (0.0,) * len(rec.inputs)]
    t = None if rec.dt else rec.t - rec.t[0]
    y = core_coefficients(rec.y, top, [rule] * len(rec.outputs), [0.0] * len(rec.outputs), lead, t)
    return y, core_coefficients(driving(rec, rule), top, kinds, late, lead, t)


# Regressors --------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False, repr=False)
class Regressors:
    """The modulated regression target ≈ gamma @ theta, report, eqs. (14) to (18).

    Attributes
    ----------
    gamma : ndarray, shape (row, parameter)
        Columns Δⁿ of −sⁿ⁻ⁱY for a1 … an and of s^k U for the numerators; the real parts of the rows, then
        the imaginary parts.
    target : ndarray, shape (row,)
        Δⁿ of sⁿY.
    param_names : tuple of str
    index : ndarray of int
        Modulating index m of the complex rows.
    """

    gamma: F64
    target: F64
    param_names: tuple[str, ...]
    index: NDArray[np.int64]
    _differences: tuple[F64, F64]
    _s: C128
    _order: int
    _unit: float

    def __repr__(self) -> str:
        return (
            f"Regressors(gamma {self.gamma.shape}, {', '.join(self.param_names)}; "
            f"m = {self.index[0]} to {self.index[-1]})"
        )

    def differenced(self, lines: C128) -> F64:
        """Rows of further terms, given on the lines 0 … M + n: (term, line) becomes (row, term)."""
        re, im = self._differences
        return np.concatenate([re @ lines.real.T, im @ lines.imag.T])

    def covariance(self, theta: ArrayLike) -> F64:
        """Covariance of the rows under white output noise of variance 1 at the samples.

        The noise enters the lines as A(s)E, independent with variance |A|² Σw²/N², a half of it in Re
        and in Im (all in Re at m = 0); Δⁿ then correlates the rows.

        Parameters
        ----------
        theta : array_like, shape (parameter,)
            Parameters; only a1 … an matter.

        Returns
        -------
        ndarray, shape (row, row)
        """
        values = reals("covariance", "theta", theta)
        if values.shape != (len(self.param_names),):
            raise SpecError(
                f"covariance: {values.size} numbers for the parameters {', '.join(self.param_names)}"
            )
        a = np.polyval(np.concatenate([[1.0], values[: self._order]]), self._s)
        variance = self._unit * np.abs(a) ** 2
        variance[1:] /= 2
        re, im = ((d * variance) @ d.T for d in self._differences)
        rows = self.target.size
        full = np.zeros((rows, rows))
        full[: len(re), : len(re)] = re
        full[len(re) :, len(re) :] = im
        return full


@public
def regressors(
    rec: Record,
    model: TransferFunction,
    *,
    harmonics: int,
    rule: str = "gregory",
    extended: bool = True,
) -> Regressors:
    """Modulated regressors of a transfer function, for estimators of your own.

    Parameters
    ----------
    rec : Record
        One output.
    model : TransferFunction
        Order n, numerators and known delays; a delay makes the window start as many samples late.
    harmonics : int
        Highest modulating index M; Fourier coefficients up to M + n are used.
    rule : {"gregory", "parabolic", "trapezoid", "staircase"}
        Quadrature, see `coefficients`.
    extended : bool, default True
        Indices from −⌊n/2⌋, which loses no information, or the report's 0 … M.

    Returns
    -------
    Regressors

    Raises
    ------
    SpecError
        Not a TransferFunction, several outputs, or harmonics that are not a whole number.
    DataError
        A delay with uneven samples, or one as long as the record.

    See Also
    --------
    modfun.coefficients : The Fourier coefficients alone.
    modfun.fit : Solves for the parameters.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, eqs. (9) to (12).

    Examples
    --------
    The report's one-shot estimate, eq. (19):

    >>> import modfun as mf
    >>> import numpy as np
    >>> rec = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256)
    >>> r = mf.regressors(rec, mf.TransferFunction(poles=2, zeros=0), harmonics=6)
    >>> np.linalg.lstsq(r.gamma, r.target, rcond=None)[0].round(3)
    array([3., 8., 5.])
    """
    if not isinstance(model, TransferFunction):
        raise SpecError(f"regressors: the model is a {type(model).__name__}; give a TransferFunction")
    if len(rec.outputs) != 1:
        raise SpecError(
            f"regressors: the record has {len(rec.outputs)} outputs; take one, rec.select(outputs=[...])"
        )
    refuse_own_noise(rec, "regressors", "take a piece without them, rec.window(start, stop)")
    _check_rule("regressors", rule)
    layout = model.plain_layout(rec.inputs, "regressors")
    n, degrees, delays = layout.orders[0], layout.numerators[0], layout.delays(np.zeros(0))
    top = whole("regressors", "harmonics", harmonics, 0, MOST) + n
    lead = 0
    if any(delays):
        if rec.dt is None:
            raise DataError("regressors: a delay needs even sampling; resample the record")
        lead = ceil(max(delays) / rec.dt - 1e-9)
        if lead >= rec.intervals:
            raise DataError(
                f"regressors: the delay of {max(delays):g} s leaves nothing of a record of {rec.duration:g} s"
            )
    y, u = spectrum(rec, top, rule, delays, lead)
    intervals = rec.intervals - lead
    length = rec.duration - lead * (rec.dt or 0.0)
    s = np.asarray(1j * np.arange(top + 1.0) * (2 * np.pi / length), dtype=np.complex128)
    columns = [s**n * y[0]] + [-(s ** (n - i)) * y[0] for i in range(1, n + 1)]
    for k, degree in enumerate(degrees):
        if degree is not None:
            columns += [s**power * u[k] for power in range(degree, -1, -1)]
    index = np.arange(-(n // 2) if extended else 0, top - n + 1)
    re, im = _differences(n, index, top)
    if extended and n % 2 == 0:
        im = im[1:]  # the row of m = −n/2 is real
    lines = np.array(columns)
    rows = np.concatenate([re @ lines.real.T, im @ lines.imag.T])
    weights = quadrature_weights(rule, intervals, None if rec.dt else rec.t - rec.t[0])
    return Regressors(
        gamma=np.ascontiguousarray(rows[:, 1:]),
        target=np.ascontiguousarray(rows[:, 0]),
        param_names=layout.param_names,
        index=index,
        _differences=(re, im),
        _s=s,
        _order=n,
        _unit=float(np.sum(weights**2) / np.sum(weights) ** 2),
    )


def _differences(n: int, index: NDArray[np.int64], top: int) -> tuple[F64, F64]:
    """Δⁿ as matrices on the real and on the imaginary parts of the lines 0 … top.

    A line of negative index is the conjugate of its mirror image: its real part adds to the mirror's
    column, its imaginary part subtracts.
    """
    re, im = np.zeros((index.size, top + 1)), np.zeros((index.size, top + 1))
    for row, m in enumerate(index):
        for j in range(n + 1):
            factor = (-1.0) ** (n - j) * comb(n, j)
            re[row, abs(m + j)] += factor
            im[row, abs(m + j)] += factor * np.sign(m + j)
    return re, im


def _check_rule(what: str, rule: str) -> None:
    if rule not in WORDS["rule"]:
        raise SpecError(f"{what}: rule={rule!r} is not available; {nearest(rule, WORDS['rule'])}")
