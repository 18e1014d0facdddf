"""A fit to a frequency response: what is other than with records."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf, nan
from typing import Any, Never

import numpy as np

from ..base.arrays import F64
from ..base.cached import cached_property
from ..base.tables import Findings
from ..errors import FitError, SpecError
from ..records.record import Record
from ..systems.frequency_response import FrequencyResponse
from .diagnosis import growth
from .doubts import on_bound
from .fit import Fit
from .misfit import UNLIKELY
from .page_records import Content, of_gains
from .summary import one_line

__all__ = ["ResponseFit"]

UNEVEN = 1e-4  # p-value of sizes of residuals: below it their noise is not that of the weights
LEAST = 2.1  # complex degrees of freedom of a variance, at least: below 2 the misfit has none itself


@dataclass(frozen=True, eq=False, repr=False)
class ResponseFit(Fit):
    """A transfer function fitted to a frequency response: a `Fit` that has never seen samples.

    `predict`, `score` and the like take a record.

    Attributes
    ----------
    data : FrequencyResponse
        The gains that were fitted.
    floor : float
        Without standard errors of the gains their noise was taken as √(floor² + |G|²) times `sigma`; inf: as
        `sigma` at each.
    uneven_p : float
        Probability that residuals beside such noise go with |G| or the frequency as much by chance.
    """

    data: FrequencyResponse = field(default_factory=lambda: FrequencyResponse([], np.empty((1, 1, 0))))
    floor: float = inf
    uneven_p: float = nan

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

    @property
    def chi2(self) -> float:
        """Cost in units of the variances that came with the gains, about `df_resid`; nan without them."""
        return self.cost if self.data.cov is not None else nan

    @property
    def misfit_p(self) -> float:
        """Probability of a misfit as large if the model is right; nan without variances of the gains.

        Where the gains came with degrees of freedom, their variances are estimates: each gain has Hotelling's
        T² for its misfit, and their sum an F law with the same mean and variance. Else it is chi-square.
        """
        from scipy.special import chdtrc, fdtrc

        if self.data.cov is None:
            return nan
        df = float(self.df_resid)
        law = None if self.data.degrees is None else scattered(self.data, df)
        if law is None:
            return float(chdtrc(df, self.chi2))
        mean, free = law
        return float(fdtrc(df, free, self.chi2 / mean * free / (free - 2)))

    @property
    def sigma(self) -> float:
        """Level of the misfit: over the standard errors of the gains; without these see `floor`."""
        return float(np.sqrt(self.cost / max(self.df_resid, 1)))

    def facts(self) -> list[tuple[str, str]]:
        """What stands above the parameters in the summary."""
        low, high = self.band
        level = f"misfit {self.sigma:.4g} times the standard errors that came with the gains"
        if self.data.cov is None:
            level = f"no standard errors came with the gains; noise: {self._noise}, as the residuals show"
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

    def plot_residuals(self, *, output: str | None = None, hz: bool = False, ax: Any = None) -> Never:
        """Not for gains, which lie on no harmonics."""
        raise SpecError(
            "plot_residuals: a fit to a frequency response has no residuals on harmonics; "
            "mf.plot.bode(fit.data, fit) draws its gains beside the model"
        )

    def record_of(self, rec: Record | int | None, what: str) -> Record:
        """The record that is given: the fit has none."""
        if isinstance(rec, Record):
            return super().record_of(rec, what)
        raise FitError(f"{what}: this fit was made of gains and has no record; give one, fit.{what}(rec)")

    def remarks(self) -> list[str]:
        """What deserves a warning when the fit is made."""
        return [f"fit: {text}" for text in self._failings()[:1]]

    @cached_property
    def _findings(self) -> Findings:
        """What is wrong or doubtful about the fit, in sentences with numbers."""
        found = self._failings()
        if self.misfit_p < UNLIKELY:
            found.append(
                f"The misfit is {self.sigma:.3g} times the standard errors of the gains (chi-square "
                f"{self.chi2:.4g} for {self.df_resid} degrees of freedom, p = {self.misfit_p:.2g}): the "
                "model misses something, or gains are biased, as those of wide neighbourhoods are at "
                "resonances."
            )
        if self.uneven_p < UNEVEN:
            found.append(
                "No standard errors came with the gains, and their residuals contradict noise of "
                f"{self._noise}: their sizes go with the gain, the frequency or the path beyond that (p = "
                f"{self.uneven_p:.1g}). Either the model misses something, or the noise has another shape: "
                "give the standard error of each gain, FrequencyResponse(..., bse=...)."
            )
        return Findings(f"Check of {one_line(self)}", [*found, *self.data.notes])

    @property
    def _noise(self) -> str:
        """The noise of gains that came without standard errors, in words."""
        if self.floor == inf:
            return f"{self.sigma:.3g} at each gain"
        least = f", at least {self.sigma * self.floor:.2g}" if self.floor else ""
        return f"{100 * self.sigma:.3g} % of each gain{least}"

    def content(self) -> Content:
        """What its page says of the gains, and what is told and found."""
        return of_gains(self.data, self.facts(), self.check())

    def own_values(self) -> dict[str, Any]:
        """What is kept of it besides what all fits have: the gains, which are no samples."""
        return {"data": self.data.to_dict(), "floor": self.floor, "uneven_p": self.uneven_p}

    def _failings(self) -> list[str]:
        found = [] if self.success else [self.message]
        if doubt := on_bound(self):
            found.append(doubt.text)
        if np.all(np.isfinite(self.params)) and (growing := growth(self)) > 0:
            found.append(
                f"The estimate is unstable: a pole has real part {growing:.4g} rad/s. Right for an unstable "
                "system, else a sign of too many poles."
            )
        return found


def scattered(data: FrequencyResponse, df: float) -> tuple[float, float] | None:
    """Mean of the misfit, and degrees of freedom of the F law that has its variance; None for chi-square.

    Of p complex gains whose noise of q outputs has ν complex degrees of freedom, the misfit is 2pν/ν' times
    F(2p, 2ν'), ν' = ν − q + 1. A law without a variance, ν' of 2 or less, is taken as one that has one.
    """
    assert data.degrees is not None
    first, count = 2.0 * len(data.outputs) * len(data.inputs), float(len(data.outputs))
    freedom = data.degrees
    left = 2 * np.maximum(freedom - count + 1, LEAST)
    with np.errstate(invalid="ignore", divide="ignore"):
        scale = np.where(np.isfinite(left), (left + 2 * count - 2) / (left - 2), 1.0)
        wide = np.where(np.isfinite(left), 2 * (first + left - 2) / (first * (left - 4)), 2 / first)
    mean, spread = scale.mean(), float(np.mean(scale**2 * wide)) * first / scale.mean() ** 2
    more = spread - 2  # relative variance of the sum times its degrees of freedom, beyond that of chi-square
    if not more > 1e-9:
        return None
    return df * float(mean), (2 * df - 4 + 4 * spread) / more
