"""Structures fitted to frequency responses: what `fit` does with a `FrequencyResponse` for data."""

from __future__ import annotations

from math import inf, nan
from typing import Any

import numpy as np

from ..base.arrays import C128, F64
from ..errors import DataError, SpecError
from ..models.free import Free, refuse_priors
from ..models.layout import Layout
from ..models.options import Options
from ..models.transfer_function import TransferFunction
from ..reduction.rational import RationalFit, fit_rational
from ..results.of_gains import ResponseFit
from ..systems.frequency_response import FrequencyResponse
from .gain_noise import gain_noise

__all__ = ["fit_response"]


TAKEN = ("method", "band", "tol", "maxiter")  # options that mean something here


def fit_response(data: FrequencyResponse, structure: Any, options: Options) -> ResponseFit:
    """Fit a structure to the gains: the least Σ r*C⁻¹r, C their covariance (`gain_noise` where unknown).

    Gains made of the same lines have errors that are alike: each counts as much as it is its own.

    Raises
    ------
    SpecError
        Something else than a `TransferFunction`, or an option for samples.
    DataError
        No frequency within the band, gains that are not finite, or fewer than parameters.
    """
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
    count = len(layout.param_names)
    free = max(round(2 * paths * float(own.sum())) - count, 1)

    def weighted(weight: C128 | F64, start: RationalFit | None = None) -> RationalFit:
        """The fit with inverse covariances (omega, path, path), which real and imaginary parts share."""
        return fit_rational(
            data.omega,
            data.response,
            layout,
            2 * weight * own[:, None, None] if paths > 1 else 2 * weight[:, 0, 0] * own,
            start=None if start is None else start.free_poles,
            tol=min(options.tol, 1e-9),
            maxiter=max(options.maxiter, 100),
        )

    if data.cov is None:
        found, floor, uneven = gain_noise(
            lambda size, start: weighted(np.eye(paths) / size[:, :, None] ** 2, start), data.omega, own, free
        )
    else:
        found, floor, uneven = weighted(_inverse(data.cov)), inf, nan
    level = found.cost / free
    # Variances that came with the gains are believed, unless the misfit is larger.
    cov = found.cov * (level if data.cov is None else max(level, 1.0))
    residuals = found.residuals.reshape(2, lines, paths)
    scaled = found.jacobian / np.maximum(np.linalg.norm(found.jacobian, axis=0), 1e-300)
    answer = {
        "theta": found.theta,
        "cov_nonrobust": cov,
        "cov_hc3": cov,
        "cov_spectral": cov,
        "df_spectral": np.full(found.theta.size, float(free)),
        "cost": found.cost,
        "noise": np.eye(len(data.outputs)) * level,
        "df_resid": free,
        "status": found.status,
        "nit": found.nit,
        "at_bound": _at_bound(layout, found.theta),
        "lines": (),
        "omega0": (),
        "gram": scaled.T @ scaled,
        "condition_bound": inf,
        "band_rule": None,
        "residuals": [(residuals[0] + 1j * residuals[1]).T * np.sqrt(free / max(found.cost, 1e-300))],
    }
    noise = {"floor": floor, "uneven_p": uneven}
    return ResponseFit.of_core(answer, structure, layout, options, None, (), data=data, **noise)


def _at_bound(layout: Layout, theta: F64) -> list[bool]:
    """Which parameters stand on a bound."""
    bounds = [layout.bounds[k] for k in layout.free]
    late = [layout.paths[k].delay for k in layout.free_delays]
    bounds += [(max(own.min, 0.0), own.max) for own in late if isinstance(own, Free)]
    return [value in ends for value, ends in zip(theta, bounds, strict=True)]


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
    refuse_priors("fit: with a frequency response", structure)
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
