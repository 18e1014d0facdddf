"""Candidates of several orders on the same lines: together in the core, or each by its own fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

from .._core import Fitter
from ..base.arrays import F64
from ..base.cached import cached_property
from ..base.words import USABLE
from ..fitting.prepared import plain_words
from ..fitting.single import fit_from, fit_near
from ..models.options import Options
from ..models.transfer_function import TransferFunction
from ..records.corners import driving
from ..records.forms import forms_of
from ..records.record import Record
from ..results.cures import again, on_band
from ..results.doubts import FINEST
from ..results.fit import Fit
from .common import widest

__all__ = ["Race"]


@dataclass(frozen=True)
class Race:
    """Candidates, and the fit of each by itself."""

    records: tuple[Record, ...]
    options: Options
    structures: list[TransferFunction]
    fits: tuple[Fit, ...]
    on_candidate: Callable[[], None]  # called after each

    @cached_property
    def apart(self) -> bool:
        """Whether each candidate is compared by its own fit, as the core has no common sums for them.

        Their delays differ, and so does what stands in gaps, or what sums over uneven samples have too much.
        """
        late = any([fit.layout.free_delays for fit in self.fits])
        own = [rec.mask is not None or rec.sigma is not None for rec in self.records]
        return late or any(own) or any([rec.dt is None for rec in self._held])

    @cached_property
    def _held(self) -> list[Record]:
        """Records whose inputs are known between their samples."""
        return [rec for rec in self.records if rec.intersample and "smooth" not in rec.intersample]

    @cached_property
    def channels(self) -> tuple[list[F64], list[F64]]:
        """Outputs and inputs of the records, as they are summed."""
        return [rec.y for rec in self.records], [driving(rec) for rec in self.records]

    @cached_property
    def transient(self) -> int:
        """The most transient terms of a candidate."""
        return max(fit.order for fit in self.fits)

    @cached_property
    def folded(self) -> bool:
        """Whether the core takes what sampling folds of transients out of the sums.

        Terms beyond the poles have no response that dies away along the lines: what they seemed to fold was
        ten times the noise.
        """
        return any([rec.dt is not None for rec in self._held])

    def wide(self) -> tuple[float, float]:
        """The wide band of the default rule that all records have, in rad/s; of fits theirs, too.

        Sums over uneven samples of smooth inputs are no integrals so far up.
        """
        fit, own = self.fits[-1], [fit.band for fit in self.fits if fit.usable] or [self.fits[-1].band]
        edge = widest(fit.intervals, fit.omega0)
        if not self.apart:
            return 0.0, edge
        edges = [high for _, high in own] + ([edge] if self._held else [])
        return min([low for low, _ in own]), max(edges)

    def finest(self) -> float:
        """Level below which residuals say nothing."""
        return FINEST * self.spread()

    def spread(self) -> float:
        """Standard deviation of the output."""
        return float(np.sqrt(np.mean([np.var(rec.y) for rec in self.records])))

    def guideline(self) -> float:
        """Upper edge of 3 # + n lines for the largest candidate, in rad/s."""
        fit = self.fits[-1]
        lines = 3 * (fit.params.size + (fit.trend is not None) + (fit.trend == "linear")) + self.transient
        return max(lines * w for w in fit.omega0)

    def run(
        self, band: tuple[float, float], tol: float = 0.0, fits: tuple[Fit, ...] | None = None
    ) -> list[dict[str, Any]]:
        """What each candidate, or each of other `fits`, leaves on the band."""
        fits = self.fits if fits is None else fits
        if self.apart:
            return self._by_themselves(fits, band)
        edges = (band[0], band[1] * (1 + 1e-9))
        options = self.options.replace(harmonics=None, band=edges, tol=max(self.options.tol, tol))
        return self._together(fits, options, band[1])

    def _by_themselves(self, fits: tuple[Fit, ...], band: tuple[float, float]) -> list[dict[str, Any]]:
        """Every candidate by a fit of its own."""
        rows: list[dict[str, Any]] = []
        best: Fit | None = None
        for own in fits:
            made = _grown_up(rows, own, band, _on_band(own, band, best))
            if made is not None and made.success and not (best and _mean(best) < _mean(made)):
                best = made
            rows.append(_row(made or own, made is not None))
            self.on_candidate()
        return rows

    def _together(self, fits: tuple[Fit, ...], options: Options, edge: float) -> list[dict[str, Any]]:
        """Every candidate in the core, each from several starts: larger ones have many minima."""
        rows: list[dict[str, Any]] = []
        core = None
        for own in fits:
            core = Fitter(
                [rec.y.shape[1] for rec in self.records],
                [rec.t if rec.dt is None else rec.dt for rec in self.records],
                beside=core,
                transient=own.order if self.folded else self.transient,
                **plain_words(own.layout, forms_of(self.records), options.replace(trend=own.trend)),
            )
            starts: list[F64] = [own.params] if np.all(np.isfinite(own.params)) else []
            starts += [s for row in rows if row["usable"] for s in _grown(row, own, 3 * edge)]
            row = core.fit(*self.channels, starts=[s.tolist() for s in starts])
            rows.append({**row, "fit": own, "usable": _usable(row)})
            self.on_candidate()
        return rows


def _mean(fit: Fit) -> float:
    """Cost per equation."""
    return fit.cost / (fit.df_resid + fit.params.size)


def _on_band(own: Fit, band: tuple[float, float], best: Fit | None) -> Fit | None:
    """A candidate's own fit on a band; of uneven records begun by what it, or the best, tells of sums."""
    if own.band == band and own.success:
        return own
    options = on_band(own, band)
    for fit in (own, best):
        if fit is not None and (found := fit_from(fit, own.structure, options)):
            return found
    return again(own, own.records, own.structure, options)  # type: ignore[return-value]


def _grown_up(
    rows: list[dict[str, Any]], own: Fit, band: tuple[float, float], made: Fit | None
) -> Fit | None:
    """The best fit of a candidate with free delays, begun also by smaller ones that leave less."""
    smaller = [row for row in rows if row["usable"] and own.layout.free_delays]
    for row in smaller:
        if made is None or _mean(row["fit"]) < _mean(made):
            begun = [fit_near(own, on_band(own, band), start) for start in _grown(row, own, 3 * band[1])]
            made = min([fit for fit in (made, *begun) if fit], key=_mean, default=None)
    return made


def _row(fit: Fit, usable: bool) -> dict[str, Any]:
    """Of a fit what the core says of a candidate."""
    return {
        "theta": fit.params,
        "cost": fit.cost,
        "df_resid": fit.df_resid,
        "sigma": fit.sigma,
        "cov_nonrobust": fit.cov_nonrobust,
        "status": fit.status,
        "fit": fit,
        "usable": usable and fit.usable,
    }


def _usable(found: dict[str, Any]) -> bool:
    return found["status"] in USABLE and isfinite(found["cost"])


def _grown(row: dict[str, Any], larger: Fit, far: float) -> list[F64]:
    """The same model as a start of a larger one: with a leading zero in each numerator, or a pole at -far.

    Nothing, where the larger one has not the same paths with one zero, or one pole, more.
    """
    smaller: Fit = row["fit"]
    degrees, poles = smaller.layout.numerators[0], larger.layout.orders[0] - smaller.layout.orders[0]
    zeros = 1 - poles
    if poles not in (0, 1) or larger.layout.numerators[0] != tuple(
        None if d is None else d + zeros for d in degrees
    ):
        return []
    den, nums = smaller.layout.polynomials(row["theta"])
    paths = [num for num, degree in zip(nums, degrees, strict=True) if degree is not None]
    late = row["theta"][row["theta"].size - len(smaller.layout.free_delays) :]
    if poles:
        return [np.concatenate([np.convolve(den, [1.0, far])[1:], *(far * num for num in paths), late])]
    return (
        [np.concatenate([den[1:], *(part for num in paths for part in ([0.0], num)), late])] if paths else []
    )
