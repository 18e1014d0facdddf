"""Structures fitted to frequency responses: what `fit` does with a `FrequencyResponse` for data."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import nan
from typing import Any, Never

import numpy as np
from numpy.typing import NDArray

from ..base.tables import Findings
from ..errors import DataError, FitError, SpecError
from ..models.free import Free
from ..models.layout import Layout
from ..models.options import Options
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from ..results.fit import Fit
from ..systems.frequency_response import FrequencyResponse

__all__ = ["ResponseFit", "fit_response"]

F64 = NDArray[np.float64]
C128 = NDArray[np.complex128]

TAKEN = ("method", "band", "tol", "maxiter")  # options that mean something here


@dataclass(frozen=True, eq=False, repr=False)
class ResponseFit(Fit):
    """A transfer function fitted to a frequency response: a `Fit` that has never seen samples.

    `predict`, `score` and the like take a record.

    Attributes
    ----------
    data : FrequencyResponse
        The gains that were fitted.
    """

    data: FrequencyResponse = field(default_factory=lambda: FrequencyResponse([], np.empty((1, 1, 0))))

    @property
    def band(self) -> tuple[float, float]:
        """Lowest and highest frequency used, rad/s."""
        return float(np.min(self.data.omega)), float(np.max(self.data.omega))

    @property
    def high_band_levels(self) -> F64:
        """Not known: nan."""
        return np.full(len(self.outputs), np.nan)

    @property
    def harmonics(self) -> Never:
        """Not for a frequency response."""
        raise SpecError("a fit to a frequency response has no harmonics; see fit.data.omega")

    @property
    def cov_type(self) -> str:
        """What `cov_params()` rests on: always the gains' own covariance."""
        return "gains"

    def cov_params(self, cov_type: str | None = None) -> F64:
        """Covariance matrix of the parameters, from that of the gains; larger where the misfit is."""
        if cov_type not in (None, "gains"):
            raise SpecError(
                f'cov_params: cov_type={cov_type!r} is for records; a fit to gains has "gains" only'
            )
        return self.cov_nonrobust.copy()

    def standard_errors(self) -> dict[str, F64]:
        """The column of standard errors of the summary."""
        return {"se": self.bse}

    @property
    def chi2(self) -> float:
        """Cost in units of the variances that came with the gains, about `df_resid`; nan without them."""
        return self.cost if self.data.cov is not None else nan

    @property
    def sigma(self) -> float:
        """Level of the misfit: over the standard errors of the gains, or without these of the gains."""
        return float(np.sqrt(self.cost / max(self.df_resid, 1)))

    def facts(self) -> list[tuple[str, str]]:
        """What stands above the parameters in the summary."""
        low, high = self.band
        level = f"misfit {self.sigma:.4g} times the standard errors that came with the gains"
        if self.data.cov is None:
            level = f"no standard errors came with the gains; misfit {self.sigma:.4g} (standard deviation)"
        return [
            ("Model", f"{', '.join(self.inputs)} -> {', '.join(self.outputs)}: {self.structure!r}"),
            (
                "Data",
                f"frequency response, {self.data.omega.size} frequencies; {self.data.source or 'given'}",
            ),
            ("Method", f"{self.options.method}; {self.status}. {self.message}"),
            ("Band", f"{low:.4g} to {high:.4g} rad/s"),
            ("Weights", level),
            ("Condition", f"{self.cond:.4g} (whitened, scaled columns)"),
            ("Errors", f"from those of the gains; Student's t with {self.df_resid} degrees of freedom"),
        ]

    def plot_residuals(self, *, output: str | None = None, ax: Any = None) -> Never:
        """Not for gains, which lie on no harmonics."""
        raise SpecError(
            "plot_residuals: a fit to a frequency response has no residuals on harmonics; "
            "mf.plot.bode(fit.data, fit) draws its gains beside the model"
        )

    def _record(self, rec: Record | int | None, what: str) -> Record:
        if isinstance(rec, Record):
            return super()._record(rec, what)
        raise FitError(f"{what}: this fit was made of gains and has no record; give one, fit.{what}(rec)")

    def remarks(self) -> list[str]:
        """What deserves a warning when the fit is made."""
        return [f"fit: {text}" for text in self._failings()]

    def check(self) -> Findings:
        """What is wrong or doubtful about the fit, in sentences with numbers."""
        from scipy.special import chdtrc

        from ..results.check import UNLIKELY
        from ..results.summary import one_line

        found = self._failings()
        if self.data.cov is not None and chdtrc(self.df_resid, self.chi2) < UNLIKELY:
            found.append(
                f"The misfit is {self.sigma:.3g} times the standard errors of the gains (chi-square "
                f"{self.chi2:.4g} for {self.df_resid} degrees of freedom): the model misses something, or "
                "the gains are biased, as those of wide neighbourhoods are at resonances."
            )
        return Findings(f"Check of {one_line(self)}", found)

    def _failings(self) -> list[str]:
        from ..results.diagnosis import growth

        found = [] if self.success else [self.message]
        if self.at_bound:
            found.append(
                f"{', '.join(self.at_bound)} ended on a bound: the gains would have it elsewhere, and the "
                "other standard errors hold only if the bound is right."
            )
        if np.all(np.isfinite(self.params)) and (growing := growth(self)) > 0:
            found.append(
                f"The estimate is unstable: a pole has real part {growing:.4g} rad/s. Right for an unstable "
                "system, else a sign of too many poles."
            )
        return found


def fit_response(data: FrequencyResponse, structure: Any, options: Options) -> ResponseFit:
    """Fit a structure to the gains: the least Σ r*C⁻¹r, C their covariance (equal weights where unknown).

    Gains made of the same lines have errors that are alike: each counts as much as it is its own.

    Raises
    ------
    SpecError
        Something else than a `TransferFunction`, or an option for samples.
    DataError
        No frequency within the band, gains that are not finite, or fewer than parameters.
    """
    from ..reduction.rational import fit_rational

    _refuse(structure, options)
    if options.band is not None:
        data = data.select(options.band)
    usable = np.all(np.isfinite(data.response), axis=(0, 1))
    if data.cov is not None:
        usable &= np.all(np.isfinite(data.cov), axis=(1, 2))
    if not np.any(usable):
        raise DataError("fit: the frequency response has no frequency at which all gains are finite")
    if not np.all(usable):
        data = data.take(np.flatnonzero(usable))
    layout = structure.layout(data.outputs, data.inputs)
    paths, lines = len(data.outputs) * len(data.inputs), data.omega.size
    own = _own(data)
    # A covariance is shared by real and imaginary parts, half each.
    weight = (
        np.broadcast_to(np.eye(paths), (lines, paths, paths)) if data.cov is None else 2 * _inverse(data.cov)
    )
    found = fit_rational(
        data.omega,
        data.response,
        layout,
        weight * own[:, None, None] if paths > 1 else weight[:, 0, 0] * own,
        tol=min(options.tol, 1e-9),
        maxiter=max(options.maxiter, 100),
    )
    count = len(layout.param_names)
    free = max(round(2 * paths * float(own.sum())) - count, 1)
    level = found.cost / free
    # Variances that came with the gains are believed, unless the misfit is larger.
    cov = found.cov * (level if data.cov is None else max(level, 1.0))
    residuals = found.residuals.reshape(2, lines, paths)
    scaled = found.jacobian / np.maximum(np.linalg.norm(found.jacobian, axis=0), 1e-300)
    return ResponseFit(
        structure=structure,
        layout=layout,
        options=options,
        units={},
        intersample=(),
        params=found.theta,
        cov_nonrobust=cov,
        cov_hc3=cov,
        cost=found.cost,
        noise_cov=np.eye(len(data.outputs)) * level,
        df_resid=free,
        status=found.status,
        nit=found.nit,
        at_bound=_at_bound(layout, found.theta),
        lines=(),
        omega0=(),
        intervals=(),
        steps=(),
        gram=scaled.T @ scaled,
        band_rule=None,
        pieces=((residuals[0] + 1j * residuals[1]).T * np.sqrt(free / max(found.cost, 1e-300)),),
        records=None,
        data=data,
    )


def _at_bound(layout: Layout, theta: F64) -> tuple[str, ...]:
    """Names of the parameters that stand on a bound."""
    bounds = [layout.bounds[k] for k in layout.free]
    late = [layout.paths[k].delay for k in layout.free_delays]
    bounds += [(max(own.min, 0.0), own.max) for own in late if isinstance(own, Free)]
    pairs = zip(layout.param_names, theta, bounds, strict=True)
    return tuple(name for name, value, ends in pairs if value in ends)


def _refuse(structure: Any, options: Options) -> None:
    if not isinstance(structure, TransferFunction):
        raise SpecError(
            "fit: a frequency response is data for a TransferFunction; equations and state spaces need the "
            "record itself"
        )
    for name, value in options.given().items():
        if name not in TAKEN:
            raise SpecError(
                f"fit: {name}={value!r} is for records; with a frequency response there are "
                f"{', '.join(TAKEN)}"
            )
    if options.method != "ml":
        raise SpecError(
            f'fit: method={options.method!r} is for records; a frequency response is fitted by "ml", the '
            "weighted least squares of its gains"
        )


def _inverse(cov: C128) -> C128:
    """Inverse covariances; directions without noise (a response that is known) get a finite weight."""
    values, vectors = np.linalg.eigh(cov)
    largest = np.max(values[:, -1], initial=0.0)
    least = np.maximum(1e-12 * values[:, -1:], 1e-24 * largest)
    values = np.maximum(values, np.where(least > 0, least, 1.0))
    return np.asarray(np.einsum("kij,kj,klj->kil", vectors, 1 / values, vectors.conj()))


def _own(data: FrequencyResponse) -> F64:
    """The part of each gain that no other holds, (omega,)."""
    alike = np.ones(data.omega.size)
    if data.reach is None:
        return alike
    order = np.argsort(data.omega, kind="stable")
    omega, reach = data.omega[order], data.reach[order]
    for apart in range(1, omega.size):
        width = reach[:-apart] + reach[apart:]
        part = np.maximum(1.0 - (omega[apart:] - omega[:-apart]) / width, 0.0)
        if not np.any(part):
            break
        alike[order[:-apart]] += part
        alike[order[apart:]] += part
    return 1.0 / alike
