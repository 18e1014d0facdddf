"""Fits as plain values for JSON: every number exactly, never the samples."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from .._core import __version__
from ..errors import SpecError
from ..models.free import to_plain
from ..models.noise import Noise
from ..models.options import Options
from ..models.process import ProcessNoise
from ..models.transfer_function import TransferFunction
from .estimates import COVARIANCES, Estimates
from .fitted_samples import begins, unlike

__all__ = ["ARRAYS", "KIND", "PLAIN", "SCHEMA", "TUPLES", "fit_to_dict", "told"]

KIND = "modfun.Fit"
SCHEMA = 2

# Fields that are plain numbers and texts; rows of them; arrays.
PLAIN = ("units", "cost", "noise_scale", "df_resid", "status", "nit", "band_rule")
TUPLES = ("intersample", "omega0", "intervals", "steps", "at_bound")
ARRAYS = ("params", *COVARIANCES, "df_spectral", "gram", "noise_cov")


def fit_to_dict(fit: Estimates) -> dict[str, Any]:
    """A fit as plain Python values; what is not finite becomes text ("nan", "inf"), as JSON has none."""
    values: dict[str, Any] = {"kind": KIND, "schema": SCHEMA, "modfun": __version__}
    values["structure"] = _structure_to_dict(fit.structure)
    values["options"] = _options_to_dict(fit.options)
    values["outputs"], values["inputs"] = list(fit.outputs), list(fit.inputs)
    values["high_band_levels"] = fit.high_band_levels.tolist()
    for name in PLAIN:
        values[name] = getattr(fit, name)
    for name in TUPLES:
        values[name] = list(getattr(fit, name))
    if fit.window_weights:
        values["window_weights"] = list(fit.window_weights)
    for name in ARRAYS:
        values[name] = getattr(fit, name).tolist()
    if fit.records is not None:  # which tell whether the noise changes in time, and are not kept
        values["cov_spectral"] = fit.cov_params("spectral").tolist()
    if found := unlike(fit):
        values["unlike"] = found
    if fit.pieces:
        values["begun"] = list(begins(fit))
    if fit.spectrum is not None:
        values["spectrum"] = [own.tolist() for own in fit.spectrum]
    if fit.df_hc3 is not None:
        values["df_hc3"] = fit.df_hc3.tolist()
    if np.isfinite(fit.stability_cost):
        values["stability_cost"] = fit.stability_cost
    if np.isfinite(fit.tail):
        values["tail"] = fit.tail
    if np.isfinite(fit.free_cost):
        values["free_cost"] = fit.free_cost
    if fit.process_levels is not None:
        values["process_levels"] = [own.tolist() for own in fit.process_levels]
    if fit.record_levels is not None:
        values["record_levels"] = fit.record_levels.tolist()
    values |= fit.own_values()
    values["lines"] = [list(pair) for pair in fit.lines]
    values["residuals"] = [{"re": e.real.tolist(), "im": e.imag.tolist()} for e in fit.pieces]
    plain: dict[str, Any] = told(values)
    return plain


def _structure_to_dict(structure: Any) -> dict[str, Any]:
    if not isinstance(structure, TransferFunction):
        return {"family": type(structure).__name__, **structure.to_dict()}
    values: dict[str, Any] = {"poles": structure.poles, "zeros": structure.zeros}
    values["delay"] = to_plain(structure.delay)
    values["denominator"] = structure.denominator
    values["params"] = {name: to_plain(given) for name, given in structure.params}
    return values


def _options_to_dict(options: Options) -> dict[str, Any]:
    values = asdict(options)
    if isinstance(options.noise, ProcessNoise):
        values["noise"] = {"filters": options.noise.filters}
    if isinstance(options.noise, Noise):
        values["noise"] = {"y": options.noise.y, "u": options.noise.u}
        if any(callable(one) for given in values["noise"].values() for one in np.ravel([given])):
            raise SpecError(
                "saving a fit: its noise is given by functions, which a file cannot hold; fit with standard "
                "deviations, or keep the fit in memory"
            )
    return values


def told(value: Any) -> Any:
    """Plain values for JSON; numbers that are not finite as text."""
    if isinstance(value, dict):
        return {key: told(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [told(one) for one in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    return value
