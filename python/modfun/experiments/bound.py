"""The Cramér–Rao bound: how well an experiment lets any unbiased estimator find the parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arguments import public, reals
from ..base.arrays import F64
from ..base.names import nearest
from ..base.tables import Table
from ..base.words import TRENDS
from ..errors import DataError, SpecError
from ..models.options import WORDS
from ..models.process import ProcessNoise
from ..models.transfer_function import TransferFunction
from ..records.mask import sample_weights
from ..records.record import Record
from ..results.fit import Fit
from ..signals import Signals
from .innovations import Innovations
from .known_models import noise_of, record_for, sds_beforehand, valued
from .sensitivities import trend_rows
from .slopes import Equations, Known, Slopes

__all__ = ["Bound", "crlb"]

REPEATS = (4, 16, 64, 256)  # periods of the inputs before the one that counts
SETTLED = 1e-6  # change of derivatives from one period to the next


@dataclass(frozen=True, eq=False)
class Bound:
    """Cramér–Rao bound of the parameters of a model.

    Attributes
    ----------
    param_names : tuple of str
    values : ndarray, shape (parameter,)
        Parameters of the system.
    cov : ndarray, shape (parameter, parameter)
        Smallest covariance of an unbiased estimate.
    sigma : float or ndarray, shape (output,)
        Standard deviation of the noise on each output (of a sample whose relative noise is 1).
    """

    param_names: tuple[str, ...]
    values: F64
    cov: F64
    sigma: Any

    @property
    def sd(self) -> F64:
        """Smallest standard deviations, (parameter,)."""
        return np.sqrt(np.diag(self.cov))

    @property
    def relative(self) -> float:
        """Root mean square of standard deviation over value, in %, over the parameters that are not 0."""
        own = self.values != 0
        if not own.any():
            return float("nan")
        return float(100 * np.sqrt(np.mean((self.sd[own] / self.values[own]) ** 2)))

    def __getitem__(self, name: str) -> float:
        """Smallest standard deviation of a parameter."""
        if name not in self.param_names:
            raise SpecError(f"the bound has no parameter {name!r}; {nearest(name, self.param_names)}")
        return float(self.sd[self.param_names.index(name)])

    def to_table(self) -> Table:
        """Parameters, their values and bounds as a Table."""
        with np.errstate(divide="ignore"):
            percent = 100 * self.sd / np.abs(self.values)
        level = ", ".join(f"{sd:.4g}" for sd in np.atleast_1d(self.sigma))
        return Table(
            {"param": list(self.param_names), "value": self.values, "bound": self.sd, "percent": percent},
            title=f"Cramér–Rao bound (standard deviation), noise sd {level}",
        )

    def __repr__(self) -> str:
        return repr(self.to_table())

    def _repr_html_(self) -> str:
        return self.to_table()._repr_html_()


@public
def crlb(
    system: Any,
    experiment: Record | Signals | Sequence[Record | Signals] | None = None,
    *,
    nsr: ArrayLike | None = None,
    sigma: ArrayLike | None = None,
    process_noise: ArrayLike | ProcessNoise | None = None,
    params: Mapping[str, float] | None = None,
    trend: str | None = None,
    initial_state: str | ArrayLike | None = None,
    model: TransferFunction | None = None,
    start: ArrayLike | None = None,
) -> Bound:
    """Cramér–Rao bound of the parameters under white noise on the sampled outputs, and in the system.

    The bound is (Σ SᵀR⁻¹S)⁻¹ with S the derivatives of the outputs at a sample, R the covariance of their
    noise; those to the initial state (and to the trend) of each record are nuisance. Of linear systems S is
    exact, also between the samples; of equations it is made of differences of responses.

    Parameters
    ----------
    system : LTI, NonlinearModel, TransferFunction, StateSpace, Equation or Fit, or of python-control or SciPy
        A system with numbers, or a structure and its numbers in `params`. Of a Fit: its model and estimates,
        and, unless given, its noise and trend; so what this, or another, experiment lets it know.
    experiment : Record, Signals, or a sequence of these
        Inputs, sampling and length; several add up. Of the outputs of a Record only which samples are
        masked, and their relative noise (its `sigma`), count. Of a Fit it may be left out: its own records,
        from the initial states that it found.
    nsr : float or sequence of float
        Noise standard deviation over the root mean square of the noise-free response, one for all outputs
        or one per output. The response includes the free motion from `start`, or from numbers in
        `initial_state`; `simulate` and `MonteCarlo` refer to the response from rest. Give this or `sigma`.
    sigma : float, sequence of float, or array_like (output, output)
        Noise standard deviation, one or one per output; or the covariance matrix of the outputs' noise.
    process_noise : float, sequence of float or ProcessNoise, optional
        Level of noise that drives a linear system, as `simulate` takes it; default: 0, or, with the samples'
        noise of a Fit, the fit's own. All levels of noise, those of the
        samples too, are then unknown (a level of 0 is known), as they are to a fit with ``noise="process"``.
    params : mapping of str to float, optional
        Values of the parameters of a structure, delays included. What the structure, or that of a Fit, knows
        of parameters beforehand (``mf.Free(1.4, sd=0.1)``) counts as information.
    trend : {None, "constant", "linear"}
        Unknown offset, or offset and slope, of each output and record.
    initial_state : {"unknown", "zero", "rest", "periodic"} or array_like, optional
        Whether the initial state is unknown, known (to be `start`, or zero), steady under the inputs' first
        values, or that of whole periods of a steady response. "rest" of linear systems needs a
        `trend` unless these values are zero; of equations the state of rest is searched from `start`.
        Numbers, (state,) or (record, state), are known states, each in place of `start`.
        Default: as the Fit was told, else "unknown".
    model : TransferFunction, optional
        Structure whose parameters are unknown, for an LTI; default: the system's own.
    start : array_like, shape (states,), optional
        Initial state around which S is taken; default: zero. Of a transfer function y, y', …, output after
        output.

    Returns
    -------
    Bound

    Raises
    ------
    SpecError
        Both or none of nsr and sigma, a structure that does not hold the system, parameters that are missing,
        channels of another number or name.
    DataError
        A record with uneven sampling, or experiments from which the parameters cannot be found.

    See Also
    --------
    modfun.simulate : Experiments to try.
    modfun.Fit.bse : Standard errors of a fit.

    Notes
    -----
    With process noise the bound is that of the exact likelihood of the samples, by a Kalman filter and the
    derivatives of its innovations.

    Each output of a transfer function has an initial state of its own, as in `fit`. The states of a
    StateSpace are one system's; there an unknown offset of each output is also what an unknown constant in
    each equation amounts to, unless A is singular.

    References
    ----------
    H. L. Van Trees, Detection, Estimation, and Modulation Theory, Part I, Wiley, 1968, section 2.4; A. Klein,
    G. Mélard, T. Zahaf, Linear Algebra and its Applications 321, 2000 (process noise).

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256)
    >>> round(mf.crlb(system, rec, nsr=0.2).relative, 1)
    3.3

    Before the flight, with no record:

    >>> short_period = mf.StateSpace(
    ...     [["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"], inputs=["de"])
    >>> values = {"Za": -0.8, "Ma": -4.5, "Mq": -1.2, "Zd": -0.1, "Md": -5.0}
    >>> de = mf.signals.multistep("de", [3, 2, 1, 1], unit=0.4, dt=0.02, amplitude=0.03, duration=8.0)
    >>> bound = mf.crlb(short_period, de, params=values, sigma=[0.002, 0.004])
    >>> round(bound["Mq"], 3)
    0.035
    """
    if trend not in TRENDS:
        raise SpecError(f"crlb: trend={trend!r} is unknown; choose None, 'constant' or 'linear'")
    if initial_state is None:
        initial_state = system.options.initial_state if isinstance(system, Fit) else "unknown"
    told: list[Any] = []
    if not isinstance(initial_state, str):
        told = list(np.atleast_2d(reals("crlb", "initial_state", initial_state)))
        initial_state = "zero"
    if initial_state not in WORDS["initial_state"]:
        raise SpecError(
            f"crlb: initial_state={initial_state!r} is unknown; "
            f"{nearest(initial_state, WORDS['initial_state'])}"
        )
    if nsr is not None and sigma is not None:
        raise SpecError("crlb: give the noise once, nsr= (relative to the response) or sigma=")
    levels: F64 | float = 1.0
    states: list[Any] = told or [None if start is None else reals("crlb", "start", start)]
    if isinstance(system, Fit):
        if experiment is None:
            if system.records is None:
                raise SpecError("crlb: the fit has no records with it; give the experiment")
            experiment = system.records
            if start is None and initial_state == "unknown":
                states = [system.initial_state(k).state for k in range(len(system.records))]
        if nsr is None and sigma is None:
            sigma, found = noise_of(system)
            process_noise = found if process_noise is None else process_noise
            if experiment is system.records:
                levels = system.level_ratios
        trend = system.trend if trend is None else trend
    process_noise = 0.0 if process_noise is None else process_noise
    if nsr is None and sigma is None:
        raise SpecError("crlb: give the noise, nsr= (relative to the response) or sigma=")
    given: list[Any] = list(experiment) if isinstance(experiment, list | tuple) else [experiment]
    odd = [one for one in given if not isinstance(one, Record | Signals)]
    if odd or not given:
        kind = type(experiment).__name__
        if kind in ("list", "tuple"):
            kind += f" with a {type(odd[0]).__name__} in it" if given else " of nothing"
        raise SpecError(
            f"crlb: the experiment is a {kind}; give a Record, mf.signals, or a list of these, one or more"
        )
    known, beforehand = valued(system, params, model, given[0]), sds_beforehand(system, model)
    driving = isinstance(process_noise, ProcessNoise) or np.any(reals("crlb", "process_noise", process_noise))
    records = [record_for(known, one, process_noise) for one in given]
    each_state = states * (len(records) // len(states))
    if initial_state == "periodic":
        found = [_steady_slopes(known, rec) for rec in records]
    elif initial_state == "rest" and isinstance(known, Equations):
        both = zip(records, each_state, strict=True)
        found = [known.slopes_from_rest(rec, state) for rec, state in both]
    else:
        held = initial_state != "zero" or bool(told)
        if initial_state == "rest":
            records = [_from_rest(rec, trend) for rec in records]
        found = [known.slopes(rec, state, held) for rec, state in zip(records, each_state, strict=True)]
    y = np.concatenate([one.y for one in found], axis=1)
    if not np.all(np.abs(y) < 1e100):
        raise DataError("crlb: the response grows without bound; shorten the experiment")
    cov = _covariance(nsr, sigma, np.sqrt(np.mean(y**2, axis=1)))
    size = np.zeros(len(known.names))
    factors: list[Any] = []
    information: Any = 0.0
    each = np.broadcast_to(levels, (len(records), len(cov)))
    for rec, one, over in zip(records, found, each, strict=True):
        t = trend_rows(trend, rec.t.size)
        offsets = np.kron(np.eye(len(cov)), t).reshape(-1, len(cov), rec.t.size)
        nuisance = np.concatenate([one.state if initial_state == "unknown" else one.state[:0], offsets])
        columns, of_record = np.concatenate([one.params, nuisance]), cov * np.outer(over, over)
        if driving:
            free = initial_state == "unknown"
            filtering = Innovations(known, process_noise, of_record, float(rec.dt or 0), free=free)
            columns, found_in_cov = filtering.filtered(columns, rec)
            information = information + found_in_cov
        else:
            columns = _whitened(columns, of_record, rec)
        wanted, rest = columns[:, : size.size], columns[:, size.size :]
        size = np.hypot(size, np.linalg.norm(wanted, axis=0))
        factors.append(np.linalg.qr(_without(wanted, rest), mode="r"))
    if driving:
        factors.append(_beside_levels(information, size.size))
        size = np.hypot(size, np.linalg.norm(factors[-1], axis=0))
    sds = np.array([beforehand.get(name, np.inf) for name in known.names])
    if beforehand:
        factors.append(np.diag(1 / sds))
        size = np.hypot(size, 1 / sds)
    half = _inverse(np.vstack(factors), size, known)
    noise = np.sqrt(np.diag(cov))
    sd = float(noise[0]) if noise.size == 1 else noise
    return Bound(param_names=known.names, values=known.values, cov=half @ half.T, sigma=sd)


# Noise and information -----------------------------------------------------------------------


def _covariance(nsr: ArrayLike | None, sigma: ArrayLike | None, rms: F64) -> F64:
    """Covariance of the outputs' noise."""
    q, name = rms.size, "nsr" if sigma is None else "sigma"
    values = reals("crlb", name, sigma if nsr is None else nsr)
    matrix = values.ndim == 2 and nsr is None
    sizes = np.diag(values) if matrix and values.shape == (q, q) else values
    if not np.all(np.isfinite(values)) or np.any(sizes <= 0) or sizes.shape not in ((), (q,)):
        raise SpecError(
            f"crlb: {name}={sigma if nsr is None else nsr!r} must be a number above 0"
            + (f", or {q} of them, one per output" if q > 1 else "")
            + (", or their covariance matrix" if nsr is None and q > 1 else "")
        )
    if matrix:
        if not np.allclose(values, values.T, rtol=1e-9, atol=0):
            raise SpecError("crlb: sigma= is not a covariance matrix: it is not symmetric")
        try:
            np.linalg.cholesky(values)
        except np.linalg.LinAlgError:
            raise SpecError(
                "crlb: sigma= is not a covariance matrix: it is singular, or not positive"
            ) from None
        return values
    if nsr is not None and np.any(rms == 0):
        raise DataError("crlb: the response from rest is zero, so nsr says nothing; give sigma=")
    return np.diag(np.broadcast_to(values, (q,)) ** 2 * (rms**2 if nsr is not None else 1.0))


def _from_rest(rec: Record, trend: str | None) -> Record:
    """The record with inputs counted from their first values."""
    first = rec.u[:, :1]
    if trend is None and np.any(first != 0):
        raise SpecError(
            'crlb: initial_state="rest" under inputs that begin elsewhere than at zero leaves the output\'s '
            'offset open; give trend="constant"'
        )
    return rec._like(u=rec.u - first)


def _steady_slopes(known: Known, rec: Record) -> Slopes:
    """Response and derivatives over the record when its inputs have repeated for ever.

    They are those of the last period but one: a smooth input is known less well at the end of its samples
    than within them.
    """
    count = rec.t.size - 1
    for repeats in REPEATS:
        u = np.hstack([np.tile(rec.u[:, :-1], repeats), rec.u[:, -1:]])
        y = np.zeros((len(rec.outputs), u.shape[1]))
        t = rec.t[0] + np.arange(u.shape[1]) * (rec.t[1] - rec.t[0])
        found = known.slopes(rec._like(y=y, u=u, t=t, mask=None, sigma=None), None)
        within = slice(-2 * count - 1, -count)
        last, before = found.params[..., within], found.params[..., -3 * count - 1 : -2 * count]
        if np.max(np.abs(last - before)) <= SETTLED * np.max(np.abs(last)):
            return Slopes(found.y[..., within], last, found.state[..., within])
    raise DataError(
        f'crlb: initial_state="periodic", but the response has not settled after {REPEATS[-1]} periods; the '
        "system must be stable, or give longer periods"
    )


def _whitened(columns: F64, cov: F64, rec: Record) -> F64:
    """Derivatives (unknown, output, time) as rows with noise of unit variance, (row, unknown)."""
    own = sample_weights(rec.mask, rec.sigma, columns.shape[1:])
    columns = columns * own
    rows = []
    for seen in np.unique(own > 0, axis=1).T:  # outputs that are measured at once
        at = np.all((own > 0) == seen[:, None], axis=0)
        if seen.any():
            lower = np.linalg.cholesky(cov[np.ix_(seen, seen)])
            part = columns[:, seen][:, :, at].transpose(1, 2, 0)
            rows.append(np.linalg.solve(lower, part.reshape(len(part), -1)).reshape(-1, len(columns)))
    return np.concatenate(rows)


def _without(columns: F64, nuisance: F64) -> F64:
    """What is left of columns when all that nuisance columns could explain is taken away."""
    size = np.linalg.norm(nuisance, axis=0)
    u, singular, _ = np.linalg.svd(nuisance[:, size > 0] / size[size > 0], full_matrices=False)
    u = u[:, singular > 1e-10 * singular.max(initial=0.0)]
    for _ in range(2):  # twice is enough for rounding
        columns = columns - u @ (u.T @ columns)
    return columns


def _beside_levels(information: F64, count: int) -> F64:
    """A root of the information on the first so many parameters, those behind them being unknown."""
    own, both, levels = information[:count, :count], information[:count, count:], information[count:, count:]
    values, vectors = np.linalg.eigh(own - both @ np.linalg.pinv(levels, hermitian=True) @ both.T)
    return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T)


def _inverse(factor: F64, size: F64, known: Known) -> F64:
    """A root of the covariance, from a root of the information and the sizes of the parameters' effects."""
    names = np.array(known.names)
    if bad := names[~(np.isfinite(size) & (size > 0))].tolist():
        several = len(bad) > 1
        raise DataError(
            f"crlb: {', '.join(bad)} {'do' if several else 'does'} not move the output, or "
            f"{'move' if several else 'moves'} it without bound; "
            + (
                "shorten the record or give every input a signal"
                if known.shape[1]
                else "free motion begins somewhere: give start=, the initial state (y, y', ...)"
            )
        )
    _, singular, right = np.linalg.svd(factor / size, full_matrices=False)
    if factor.shape[0] < size.size or singular[-1] <= known.accuracy * singular[0]:
        share = np.abs(right[-1]) / np.abs(right[-1]).max()
        raise DataError(
            f"crlb: the experiment does not tell {', '.join(names[share > 0.05])} apart (condition "
            f"{singular[0] / max(singular[-1], 1e-300):.1e}); use a richer input or a longer record, measure "
            "more, or hold one of them"
        )
    return np.asarray(right.T / singular / size[:, None])
