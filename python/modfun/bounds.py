"""The Cramér–Rao bound: how well an experiment lets any unbiased estimator find the parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import DataError, SpecError
from .lti import LTI
from .nonlinear import NonlinearModel
from .prediction import sample_weights
from .propagate import Inputs
from .records import Record
from .sensitivities import Sensitivities, time_unit
from .structures import TransferFunction
from .tables import Table

__all__ = ["Bound", "crlb"]

F64 = NDArray[np.float64]
STEP = 1e-4  # of a parameter's size: differences on common steps, exact to its square
TRENDS = (None, "constant", "linear")


@dataclass(frozen=True, eq=False)
class Bound:
    """Cramér–Rao bound of the parameters of a transfer function.

    Attributes
    ----------
    param_names : tuple of str
    values : ndarray, shape (parameter,)
        Parameters of the system.
    cov : ndarray, shape (parameter, parameter)
        Smallest covariance of an unbiased estimate.
    sigma : float
        Standard deviation of the noise (of a sample whose relative noise is 1).
    """

    param_names: tuple[str, ...]
    values: F64
    cov: F64
    sigma: float

    @property
    def sd(self) -> F64:
        """Smallest standard deviations, (parameter,)."""
        return np.sqrt(np.diag(self.cov))

    @property
    def relative(self) -> float:
        """Root mean square over the parameters of standard deviation over value, in %."""
        if not np.all(self.values != 0):
            return float("nan")
        return float(100 * np.sqrt(np.mean((self.sd / self.values) ** 2)))

    def __getitem__(self, name: str) -> float:
        """Smallest standard deviation of a parameter."""
        if name not in self.param_names:
            raise SpecError(f"the bound has no parameter {name!r}; there are {', '.join(self.param_names)}")
        return float(self.sd[self.param_names.index(name)])

    def to_table(self) -> Table:
        """Parameters, their values and bounds as a Table."""
        with np.errstate(divide="ignore"):
            percent = 100 * self.sd / np.abs(self.values)
        return Table(
            {"param": list(self.param_names), "value": self.values, "bound": self.sd, "percent": percent},
            title=f"Cramér–Rao bound (standard deviation), noise sd {self.sigma:.4g}",
        )

    def __repr__(self) -> str:
        return repr(self.to_table())

    def _repr_html_(self) -> str:
        return self.to_table()._repr_html_()


def crlb(
    sys: LTI | NonlinearModel,
    rec: Record,
    *,
    nsr: float | None = None,
    sigma: float | None = None,
    trend: str | None = None,
    initial_state: str = "unknown",
    model: TransferFunction | None = None,
    start: ArrayLike | None = None,
) -> Bound:
    """Cramér–Rao bound of the parameters under white noise on the sampled output.

    The bound is σ²(SᵀS)⁻¹ with S the derivatives of the response from rest to the record's input, exact
    between the samples; those to the initial state (and to the trend) are nuisance. Of equations, S is
    made of differences of responses from `start`.

    Parameters
    ----------
    sys : LTI or NonlinearModel
        The system, one output.
    rec : Record
        Inputs, sampling and length of the experiment; of its output only which samples are masked, and
        their relative noise (`sigma` of the record), count.
    nsr : float
        Noise standard deviation over the root mean square of the noise-free response from rest. Give
        this or `sigma`.
    sigma : float
        Noise standard deviation.
    trend : {None, "constant", "linear"}
        Unknown offset, or offset and slope, of the output.
    initial_state : {"unknown", "zero"}
        Whether the initial state is unknown or known to be zero.
    model : TransferFunction, optional
        Structure whose parameters are unknown; default: the system's own (of equations always).
    start : array_like, shape (states,), optional
        Initial state of equations; default: zero.

    Returns
    -------
    Bound

    Raises
    ------
    SpecError
        Both or none of nsr and sigma, several outputs, a structure that does not hold the system.
    DataError
        A record with uneven sampling, or one from which the parameters cannot be found.

    Examples
    --------
    >>> import modfun as mf
    >>> sys = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(sys, input="sin(t**2/5)", duration=10.0, intervals=256)
    >>> round(mf.crlb(sys, rec, nsr=0.2).relative, 1)
    3.3
    """
    if not isinstance(sys, LTI | NonlinearModel):
        raise SpecError(f"crlb: the system is a {type(sys).__name__}; give mf.tf(num, den) or fit.model")
    if (nsr is None) == (sigma is None):
        raise SpecError("crlb: give the noise once, nsr= (relative to the response) or sigma=")
    level = nsr if nsr is not None else sigma
    if not isinstance(level, int | float) or not (np.isfinite(level) and level > 0):
        raise SpecError(f"crlb: the noise level {level!r} must be a number above 0")
    if trend not in TRENDS:
        raise SpecError(f"crlb: trend={trend!r} is unknown; choose None, 'constant' or 'linear'")
    if initial_state not in ("unknown", "zero"):
        raise SpecError(f"crlb: initial_state={initial_state!r} is unknown; choose 'unknown' or 'zero'")
    if len(rec.outputs) > 1 and (rec.mask is not None or rec.sigma is not None):
        raise SpecError(
            f"crlb: the record has {len(rec.outputs)} outputs whose samples count differently; choose one, "
            f"rec.select(outputs=[{rec.outputs[0]!r}])"
        )
    if rec.dt is None:
        raise DataError("crlb: the record is sampled unevenly; give an evenly sampled one")
    if sys.shape[0] != 1:
        raise SpecError(f"crlb: the system has {sys.shape[0]} outputs; take them one by one")
    inputs = len(rec.inputs)
    if inputs != sys.shape[1]:
        raise SpecError(f"crlb: the record has {inputs} input(s), the system {sys.shape[1]}")
    if isinstance(sys, NonlinearModel):
        names, theta, scale = tuple(sys.params), np.array(list(sys.params.values())), np.ones(len(sys.params))
        y, columns = _differences(sys, rec, start)
    else:
        structure = TransferFunction.from_system(sys) if model is None else model
        layout = structure.plain_layout(rec.inputs, "crlb")
        names, theta = layout.param_names, structure.theta(sys)
        prepared = Inputs(list(rec.u), rec.dt, rec.intervals, rec.intersample, sys.delays)
        omega = time_unit(np.concatenate([[1.0], theta[: layout.orders[0]]]))
        engine = Sensitivities(layout.orders[0], layout.numerators[0], prepared, omega)
        scale = engine.scale
        y, columns = engine.run(theta * scale)
    rms = float(np.sqrt(np.mean(y**2)))
    if nsr is not None and rms == 0:
        raise DataError("crlb: the response from rest is zero, so nsr says nothing; give sigma=")
    if initial_state == "zero":
        columns = columns[: theta.size]
    t = np.linspace(-1.0, 1.0, y.size)
    extra = {None: [], "constant": [np.ones_like(t)], "linear": [np.ones_like(t), t]}[trend]
    s = np.vstack([columns, *extra]).T
    weight = sample_weights(rec, 0)
    if weight is not None:
        s = s[weight > 0] * weight[weight > 0, None]
    size = np.linalg.norm(s, axis=0)
    if not np.all(np.isfinite(size)) or np.any(size == 0):
        raise DataError("crlb: a parameter does not move the output, or moves it without bound; shorten the "
                        "record or give every input a signal")  # fmt: skip
    r = np.linalg.qr(s / size, mode="r")
    singular = np.linalg.svd(r, compute_uv=False)
    if singular[-1] < 1e-12 * singular[0] or s.shape[0] < s.shape[1]:
        raise DataError(
            f"crlb: the experiment does not tell the parameters apart (condition "
            f"{singular[0] / max(singular[-1], 1e-300):.1e}); use a richer input or a longer record"
        )
    half = np.linalg.inv(r) / size[:, None]
    noise = float(level) * (rms if nsr is not None else 1.0)
    factor = half[: theta.size] / scale[:, None]
    return Bound(
        param_names=names,
        values=theta,
        cov=noise**2 * (factor @ factor.T),
        sigma=noise,
    )


def _differences(sys: NonlinearModel, rec: Record, start: ArrayLike | None) -> tuple[F64, F64]:
    """Response of equations, and its derivatives to parameters and initial state, by central differences."""
    x0 = np.zeros(len(sys.states)) if start is None else np.asarray(start, dtype=np.float64)
    theta = np.array(list(sys.params.values()))
    delays = [d.delay for d in sys.form.drives] + [d.delay for d in sys.form.pasts]
    if any(delay.free_symbols for delay in delays):
        raise SpecError("crlb: a delay among the parameters of an equation has no bound here; hold it")
    sizes = np.concatenate([np.where(theta != 0, np.abs(theta), 1.0), np.maximum(np.abs(x0), 1e-2)])
    steps = np.diag(STEP * sizes)
    both = np.hstack([np.zeros((sizes.size, 1)), steps, -steps]) + np.concatenate([theta, x0])[:, None]
    y, _ = sys.family(
        list(rec.u),
        rec.t,
        both[theta.size :],
        rec.intersample,
        params=np.ascontiguousarray(both[: theta.size]),
    )
    up, down = np.split(y[0, 1:], 2)
    return y[0, 0], (up - down) / (2 * STEP * sizes)[:, None]
