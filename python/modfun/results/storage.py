"""Fits as JSON: every number exactly, never the samples."""

from __future__ import annotations

import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._core import __version__
from ..base.arguments import public
from ..errors import DataError, SpecError
from ..files.writing import named
from ..models.free import free_from_plain, free_to_plain
from ..models.noise import Noise
from ..models.options import Options
from ..models.transfer_function import TransferFunction
from .fit import Fit

__all__ = ["fit_from_dict", "fit_to_dict", "load", "told"]

KIND = "modfun.Fit"
SCHEMA = 2
STATUS = ("ok", "maxiter", "rank", "nonfinite")

# Fields that are plain numbers, texts, or lists of them.
_PLAIN = ("units", "cost", "noise_scale", "df_resid", "status", "nit", "band_rule")
_TUPLES = ("intersample", "omega0", "intervals", "steps", "at_bound")
_OF_EQUATIONS = ("levels", "df_hc3")
_ARRAYS = ("params", "cov_nonrobust", "cov_hc3", "gram", "noise_cov")


def fit_to_dict(fit: Fit) -> dict[str, Any]:
    """A fit as plain Python values; what is not finite becomes text ("nan", "inf"), as JSON has none."""
    values: dict[str, Any] = {"kind": KIND, "schema": SCHEMA, "modfun": __version__}
    values["structure"] = _structure_to_dict(fit.structure)
    values["options"] = _options_to_dict(fit.options)
    values["outputs"], values["inputs"] = list(fit.outputs), list(fit.inputs)
    values["high_band_levels"] = fit.high_band_levels.tolist()
    for name in _PLAIN:
        values[name] = getattr(fit, name)
    for name in _TUPLES:
        values[name] = list(getattr(fit, name))
    if fit.window_weights:
        values["window_weights"] = list(fit.window_weights)
    for name in _ARRAYS:
        values[name] = getattr(fit, name).tolist()
    for name in _OF_EQUATIONS:
        if hasattr(fit, name):
            values[name] = getattr(fit, name).tolist()
    data = getattr(fit, "data", None)  # of a fit to a frequency response the gains, which are no samples
    if data is not None:
        values["data"] = data.to_dict()
    values["lines"] = [list(pair) for pair in fit.lines]
    values["residuals"] = [{"re": e.real.tolist(), "im": e.imag.tolist()} for e in fit.pieces]
    plain: dict[str, Any] = told(values)
    return plain


def fit_from_dict(values: Any) -> Fit:
    """A fit from what `fit_to_dict` returned.

    Raises
    ------
    DataError
        Something else, a newer schema, or a damaged file.
    """
    if not isinstance(values, dict) or values.get("kind") != KIND:
        raise DataError("loading a fit: this is not a saved fit; write one with fit.save(path)")
    if values.get("schema") != SCHEMA:
        raise DataError(
            f"loading a fit: it has schema {values.get('schema')!r} (modfun {values.get('modfun')}), this "
            f"version reads {SCHEMA}; install a newer modfun"
        )
    try:
        return _sound(_fit_of(values))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise DataError(
            f"loading a fit: the file is damaged ({type(error).__name__}: {error}); fit and save again"
        ) from None


def _fit_of(values: dict[str, Any]) -> Fit:
    """A fit, whatever its numbers are."""
    fields: dict[str, Any] = {name: values[name] for name in _PLAIN}
    fields["cost"], fields["noise_scale"] = float(values["cost"]), float(values["noise_scale"])
    fields["known_level"] = _array(values["high_band_levels"])
    fields.update({name: tuple(values[name]) for name in _TUPLES})
    fields["window_weights"] = tuple(values.get("window_weights", ()))
    fields.update({name: _array(values[name]) for name in _ARRAYS})
    fields["lines"] = tuple((int(lo), int(hi)) for lo, hi in values["lines"])
    pieces = [_complex(e["re"], e["im"]) for e in values["residuals"]]
    if fields["band_rule"] is not None:
        fields["band_rule"] = {k: float(v) for k, v in fields["band_rule"].items()}
    structure = _structure_from_dict(values["structure"])
    fields.update(structure=structure, options=_options_from_dict(values["options"]), records=None)
    fields["pieces"] = tuple(pieces)
    if "data" in values:
        from ..fitting.of_gains import ResponseFit
        from ..systems.frequency_response import FrequencyResponse

        data = FrequencyResponse.from_dict(values["data"])
        return ResponseFit(layout=structure.layout(data.outputs, data.inputs), data=data, **fields)
    if isinstance(structure, TransferFunction):
        return Fit(layout=structure.layout(values["outputs"], values["inputs"]), **fields)
    from ..equations.layout import layout_of
    from ..fitting.of_equations import EquationFit

    channels = (tuple(values["outputs"]), tuple(values["inputs"]), fields["intersample"])
    fields.update({name: _array(values[name]) for name in _OF_EQUATIONS})
    return EquationFit(layout=layout_of(structure, fields["options"], *channels), **fields)


def _sound(fit: Fit) -> Fit:
    """The fit, if its numbers have the shapes of its parameters."""
    count = len(fit.param_names)
    for name, shape in (
        ("params", (count,)), ("cov_nonrobust", (count,) * 2), ("cov_hc3", (count,) * 2)
    ):  # fmt: skip
        if getattr(fit, name).shape != shape:
            raise ValueError(f"{name} has shape {getattr(fit, name).shape}, not {shape}")
    if fit.status not in STATUS:
        raise ValueError(f"status is {fit.status!r}")
    if fit.success and not np.all(np.isfinite(fit.params)):
        raise ValueError(f"status is {fit.status!r} and params are {fit.params}")
    Options.checked("load", method=fit.options.method)
    return fit


@public
def load(path: str | Path) -> Any:
    """Read a fit that was written with `Fit.save`, or the directory of a study.

    Parameters
    ----------
    path : str or Path
        The JSON file, or the `directory` of `MonteCarlo.run`.

    Returns
    -------
    Fit or Results
        A fit equals the saved one but for the samples: give a record to `predict`, `score` and the like.
        Results are those of the run, `Results.replicate` included.

    Raises
    ------
    SpecError
        No such file, or no directory of a study.
    DataError
        Something else, a damaged file, or a study with parts missing.
    """
    place = named("load", path)
    if os.path.isdir(place):
        from ..study.shards import load

        return load(place)
    if not os.path.isfile(place):  # where Path.is_file raises: of a name that is too long
        raise SpecError(f"load: there is no file {str(place)!r}")
    try:
        values = json.loads(place.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError) as error:  # ValueError: no JSON, no UTF-8, numbers without an end
        raise DataError(
            f"load: {str(place)!r} is not JSON ({error}); it should be what fit.save wrote"
        ) from None
    try:
        return fit_from_dict(values)
    except DataError as error:
        raise DataError(f"load: {str(place)!r}: {str(error).removeprefix('loading a fit: ')}") from None


def _structure_to_dict(structure: Any) -> dict[str, Any]:
    if not isinstance(structure, TransferFunction):
        return {"family": type(structure).__name__, **structure.to_dict()}
    values: dict[str, Any] = {"poles": structure.poles, "zeros": structure.zeros}
    values["delay"] = free_to_plain(structure.delay)
    values["denominator"] = structure.denominator
    values["params"] = {name: free_to_plain(given) for name, given in structure.params}
    return values


def _structure_from_dict(values: dict[str, Any]) -> Any:
    if "family" in values:
        from ..equations.equation import Equation
        from ..equations.state_space import StateSpace

        own = dict(values)
        family: Any = {"Equation": Equation, "StateSpace": StateSpace}[own.pop("family")]
        return family.from_dict(own)
    params = {name: free_from_plain(given) for name, given in values["params"].items()}
    return TransferFunction(**{**values, "delay": free_from_plain(values["delay"]), "params": params})


def _options_to_dict(options: Options) -> dict[str, Any]:
    values = asdict(options)
    if isinstance(options.noise, Noise):
        values["noise"] = {"y": options.noise.y, "u": options.noise.u}
        if any(callable(one) for given in values["noise"].values() for one in np.ravel([given])):
            raise SpecError(
                "saving a fit: its noise is given by functions, which a file cannot hold; fit with standard "
                "deviations, or keep the fit in memory"
            )
    return values


def _options_from_dict(values: dict[str, Any]) -> Options:
    options = dict(values)
    if options["band"] is not None:
        options["band"] = tuple(options["band"])
    if options["output_weights"] is not None:
        options["output_weights"] = Options.checked(
            "load", output_weights=options["output_weights"]
        ).output_weights
    if isinstance(options["noise"], dict):
        options["noise"] = Noise(**options["noise"])
    return Options(**options)


def _array(values: Any) -> NDArray[np.float64]:
    return np.array(values, dtype=float)  # "nan" and "inf" as text are understood


def _complex(re: Any, im: Any) -> NDArray[np.complex128]:
    if np.shape(re) != np.shape(im):
        raise ValueError(f"real parts have shape {np.shape(re)}, imaginary parts {np.shape(im)}")
    found = np.empty(np.shape(re), complex)
    found.real, found.imag = _array(re), _array(im)  # 1j times inf would be nan
    return found


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
