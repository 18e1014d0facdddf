"""Fits by the samples that count alone, where so many are masked that lines hold too much between them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from ..base.arrays import F64
from ..errors import ModfunError
from ..records.mask import sample_weights
from ..results.diagnosis import growth
from ..results.estimates import COVARIANCES
from ..results.initial_state import slopes
from .gaps import hides_much

__all__ = ["by_samples"]

PART = 0.1  # of a standard error: steps of differences
ROUNDS, HALVED = 12, 5
SETTLED = 0.02  # of a standard error: a move that ends the rounds


AnyFit = TypeVar("AnyFit", bound=Any)


def by_samples(fit: AnyFit) -> AnyFit:
    """The fit led to the least squares of the samples that count; itself where few of them are masked.

    Sums over a record need a value at every instant. What a polynomial or the model puts there is no
    measurement, and where most samples are so, standard errors from lines are too small and the rounds of
    filling end too early. Output error has no such values: from estimates near the truth a few steps of Gauss
    and Newton reach its minimum. Covariances keep what they tell of the colour of the noise, on the scale of
    that minimum.
    """
    white = fit.options.noise == "output" and fit.options.method in ("ml", "awls") and not fit.layout.priors
    if not (white and fit.usable) or not any(map(hides_much, fit.records)) or growth(fit) > 0:
        return fit
    try:
        with np.errstate(all="ignore"):  # steps too far away overflow, and are halved
            return _Descent(fit).ended()  # type: ignore[no-any-return]
    except (ModfunError, np.linalg.LinAlgError):
        return fit


class _Descent:
    """Steps of Gauss and Newton for output error, with initial states and trends at their best in each."""

    def __init__(self, fit: Any) -> None:
        self.fit = fit
        self.moving = np.flatnonzero(fit.cov_nonrobust.diagonal() > 0)  # not on a bound
        self.steps = PART * np.sqrt(fit.cov_nonrobust.diagonal())
        weights = [sample_weights(rec.mask, rec.sigma, rec.y.shape) for rec in fit.records]
        self.weights = [own / level[:, None] for own, level in zip(weights, fit.noise_levels, strict=True)]

    def ended(self) -> Any:
        """The fit at the least squares; status "maxiter" where the steps do not end."""
        params = self.fit.params.copy()
        left, count = self._left(params)
        for _ in range(ROUNDS):
            steep = self._slopes(params, left)
            move = np.zeros(params.size)
            move[self.moving] = np.linalg.lstsq(steep.T, left, rcond=None)[0]
            for _ in range(HALVED):
                beside, _ = self._left(params + move)
                if beside @ beside <= left @ left:
                    break
                move = move / 2
            else:
                break
            params, left = params + move, beside
            cov = np.linalg.inv(steep @ steep.T) * (left @ left) / max(count - params.size, 1)
            if np.all(np.abs(move[self.moving]) < SETTLED * np.sqrt(cov.diagonal())):
                break
        else:
            return replace(self.fit, params=params, status="maxiter")
        return self._told(params, left, count)

    def _left(self, params: F64) -> tuple[F64, int]:
        """Weighted residuals of all records, and how many samples beyond the unknowns of each they have."""
        fit = replace(self.fit, params=params)
        rows, count = [], 0
        for rec, weights in zip(fit.records, self.weights, strict=True):
            simulated, initial = fit.simulate(rec)
            rows.append(((rec.y - simulated) * weights).ravel())
            count += int(np.count_nonzero(weights)) - initial.state.size - np.size(initial.trend)
        return np.concatenate(rows), count

    def _slopes(self, params: F64, left: F64) -> F64:
        if not (self.fit.layout.rational or self.fit.structure.linear):
            return self._of_integrations(replace(self.fit, params=params))
        found = []
        for k in self.moving:
            beside = params.copy()
            beside[k] += self.steps[k]
            found.append((left - self._left(beside)[0]) / self.steps[k])
        return np.array(found)

    def _of_integrations(self, fit: Any) -> F64:
        """The same with initial states and trends beside the parameters: they are long in the finding."""
        found = []
        for rec, weights in zip(fit.records, self.weights, strict=True):
            each = (slopes(fit, rec, fit.simulate(rec)[1]) * weights).reshape(-1, weights.size)
            own, beside = each[self.moving], each[fit.params.size :]
            found.append(own - own @ np.linalg.pinv(beside) @ beside)
        return np.concatenate(found, axis=1)

    def _told(self, params: F64, left: F64, count: int) -> Any:
        """The fit with these parameters, and covariances on the scale of those of least squares."""
        steep, fit = self._slopes(params, left), self.fit
        square = float(left @ left) / max(count - params.size, 1)
        scale = np.zeros(params.size)
        errors = np.sqrt(np.linalg.inv(steep @ steep.T).diagonal() * square)
        scale[self.moving] = errors / np.sqrt(fit.cov_nonrobust.diagonal()[self.moving])
        covs = {name: getattr(fit, name) * np.outer(scale, scale) for name in COVARIANCES}
        return replace(fit, params=params, noise_cov=fit.noise_cov * square, **covs)
