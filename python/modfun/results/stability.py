"""The stable neighbour of a fit: the lowest criterion among models whose poles are all stable."""

from __future__ import annotations

from dataclasses import replace
from math import inf, log, pi
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..errors import FitError, ModfunError, SpecError
from ..models.free import priors_of
from ..models.transfer_function import TransferFunction
from ..systems.polynomials import roots as roots_of
from .cures import on_band
from .derived import stable
from .estimates import Estimates
from .priors import distance

__all__ = ["MARGIN", "deviance", "refuse_stable", "stable_neighbour"]

MARGIN = 0.01  # poles lie left of −MARGIN/T, T the longest record
ACTIVE = 1e-6  # poles nearer to the margin than this part of the band stand there
DAMPING = 0.05  # of poles that a search starts from, where mirrored ones would stand at the axis
PRECISION = 1e-10  # relative fall of the criterion that ends the search


def stable_neighbour(fit: Any) -> Any:
    """The fit of the same structure, records and band whose poles are all stable.

    A(s) is a product of sections s'² + ps' + q and s' + p, p and q not negative, in s' = s + MARGIN/T: all
    stable polynomials and no others. Numerators, delays, end conditions and noise follow each A(s) by the
    core.

    Raises
    ------
    SpecError
        Of equations, gains, free motion, and of denominators with coefficients that are held.
    FitError
        Where no start leads to an estimate.
    """
    refuse_stable(fit)
    duration = 2 * pi / min(fit.omega0)
    margin = MARGIN / duration
    if stable(fit):
        return fit
    from scipy.optimize import minimize

    search = _Search(fit, margin)
    ends = [
        minimize(
            search.criterion, start, method="L-BFGS-B", bounds=[(0, inf)] * len(start),
            options={"ftol": PRECISION, "gtol": 1e-6},
        )
        for start in search.starts()
    ]  # fmt: skip
    best = min(ends, key=lambda end: float(end.fun))
    if not np.isfinite(best.fun):
        raise FitError(
            "stable: no stable denominator gives an estimate; take fewer poles, or a narrower band"
        )
    return search.finished(np.maximum(best.x, 0.0))


def deviance(fit: Estimates) -> float:
    """−2 log likelihood, of priors too, but for a constant that fits on the same lines share."""
    return float(fit.bic - fit.params.size * log(fit.df_resid + fit.params.size)) + distance(fit)


def refuse_stable(fit: Any) -> None:
    """Refuse a fit that has no stable neighbour, whatever its poles."""
    if not isinstance(fit.structure, TransferFunction) or fit.again is None or fit.records is None:
        raise SpecError(
            "stable: this is for transfer functions fitted to records; of a StateSpace or an Equation bound "
            "the parameters that decide, params={...: mf.Free(max=0)}"
        )
    if fit.process_levels is not None:
        raise SpecError(
            f"stable: the criterion of noise={fit.options.noise!r} counts poles by their distance from the "
            'axis alone; fit with noise="output"'
        )
    if not fit.inputs:
        raise SpecError("stable: free motion has no numerator that could follow; bound its coefficients")
    dens = {
        k
        for at, order in zip(fit.layout.places[0], fit.layout.orders, strict=True)
        for k in range(at, at + order)
    }
    held = [fit.layout.names[k] for k in sorted(dens) if fit.layout.positions[k] is None]
    if held:
        raise SpecError(f"stable: {held[0]} is held; leave the coefficients of denominators free")


class _Search:
    """Coefficients of stable sections, all denominators in a row, and the fits they lead to."""

    def __init__(self, fit: Any, margin: float) -> None:
        layout = fit.layout
        self.fit, self.margin = fit, margin
        places = dict.fromkeys(zip(layout.places[0], layout.orders, strict=True))
        self.names = [[layout.names[k] for k in range(at, at + order)] for at, order in places]
        self.orders = [order for _, order in places]
        self.unit = fit.band[1] / 2
        self.options = on_band(fit, fit.band)
        self.lowest = deviance(fit)

    def denominators(self, x: F64) -> list[F64]:
        """Monic polynomials in s, descending powers."""
        found, at = [], 0
        for order in self.orders:
            whole = np.ones(1)
            own = x[at : at + order]
            at += order
            for k in range(0, order, 2):
                p = own[k] * self.unit
                if k + 1 == order:
                    section = [1.0, p + self.margin]
                else:
                    q, m = own[k + 1] * self.unit**2, self.margin
                    section = [1.0, p + 2 * m, q + p * m + m * m]
                whole = np.convolve(whole, section)
            found.append(whole)
        return found

    def starts(self) -> list[F64]:
        """Unstable poles mirrored, moved to the margin, and well damped ones of the same size."""
        found = []
        for way in ("mirrored", "margin", "damped"):
            x: list[float] = []
            for den in self.fit.layout.denominators(self.fit.params):
                poles = roots_of(np.array(den)) + self.margin
                real = {"mirrored": -np.abs(poles.real), "margin": np.minimum(poles.real, 0.0)}.get(
                    way, np.minimum(poles.real, -DAMPING * np.abs(poles))
                )
                x += self._sections(real + 1j * poles.imag)
            found.append(np.array(x))
        return found

    def _sections(self, poles: Any) -> list[float]:
        """Coefficients (p, q) of pairs, and p of what is left over."""
        pairs = sorted((pole for pole in poles if pole.imag > 0), key=abs)
        single = sorted(-pole.real for pole in poles if pole.imag == 0)
        x = []
        for pole in pairs:
            x += [-2 * pole.real / self.unit, abs(pole) ** 2 / self.unit**2]
        for k in range(0, len(single) - 1, 2):
            x += [(single[k] + single[k + 1]) / self.unit, single[k] * single[k + 1] / self.unit**2]
        if len(single) % 2:
            x.append(single[-1] / self.unit)
        return x

    def held(self, x: F64) -> Any:
        """The fit whose denominators are held; None where there is none."""
        own = {
            name: float(value)
            for names, den in zip(self.names, self.denominators(x), strict=True)
            for name, value in zip(names, den[1:], strict=True)
        }
        structure = self.fit.structure
        words = {name: getattr(structure, name) for name in ("poles", "zeros", "delay", "denominator")}
        try:
            made = TransferFunction(**words, params=dict(structure.params) | own)
            found = self.fit.again(self.fit.records, made, self.options)
        except ModfunError:
            return None
        return found if found.usable and np.isfinite(found.cost) else None

    def criterion(self, x: F64) -> float:
        """How much higher than the free fit's."""
        found = self.held(np.maximum(x, 0.0))
        return inf if found is None else self._above(found)

    def _above(self, found: Any) -> float:
        """Deviance over the free fit's; priors of denominators count, though these are held."""
        priors = priors_of(self.fit.structure)
        gaps = [
            (value - priors[name].start) / priors[name].sd
            for name, value in found.layout.held.items()
            if name in priors
        ]
        return deviance(found) - self.lowest + float(np.sum(np.square(gaps)))

    def finished(self, x: F64) -> Any:
        """The fit of the structure itself at these denominators.

        Its covariances are those of the free fit: with the poles held at the margin nothing would be left of
        some, and intervals would hold the truth in half of the records.
        """
        found, fit = self.held(x), self.fit
        values = dict(zip(found.param_names, found.params, strict=True))
        for names, den in zip(self.names, self.denominators(x), strict=True):
            values |= dict(zip(names, den[1:], strict=True))
        params = np.array([values[name] for name in fit.param_names])
        return replace(
            fit,
            params=params,
            cost=found.cost,
            noise_cov=found.noise_cov,
            pieces=found.pieces,
            df_resid=fit.df_resid + self._at_margin(params),
            nit=fit.nit + found.nit,
            options=fit.options.replace(stable=True),
            stability_cost=self._above(found),
        )

    def _at_margin(self, params: F64) -> int:
        """How many poles and pairs stand at the margin."""
        near = self.margin * (1 + ACTIVE) + ACTIVE * self.unit
        each = [roots_of(np.array(den)) for den in self.fit.layout.denominators(params)]
        return sum(int(np.sum((poles.real > -near) & (poles.imag >= 0))) for poles in each)
