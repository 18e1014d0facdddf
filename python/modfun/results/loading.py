"""Fits from the plain values that `Fit.save` wrote."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.between import MIXED
from ..base.words import STATUS
from ..equations.equation import Equation
from ..equations.layout import layout_of
from ..equations.state_space import StateSpace
from ..errors import DataError
from ..models.free import from_plain
from ..models.noise import Noise
from ..models.options import Options
from ..models.process import ProcessNoise
from ..models.transfer_function import TransferFunction
from ..systems.frequency_response import FrequencyResponse
from .estimates import COVARIANCES
from .fit import Fit
from .of_equations import EquationFit
from .of_gains import ResponseFit
from .storage import ARRAYS, KIND, PLAIN, SCHEMA, TUPLES

__all__ = ["fit_from_dict"]

OF_EQUATIONS = ("levels", "seen", "df_hc3")


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
    fields: dict[str, Any] = {name: values[name] for name in PLAIN}
    fields["cost"], fields["noise_scale"] = float(values["cost"]), float(values["noise_scale"])
    fields["known_level"] = _array(values["high_band_levels"])
    fields.update({name: tuple(values[name]) for name in TUPLES})
    fields["intervals"] = tuple([int(count) for count in values["intervals"]])
    fields["window_weights"] = tuple(values.get("window_weights", ()))
    if "cov_spectral" not in values:  # files of old have none
        df = np.full(len(values["params"]), float(values["df_resid"]))
        values = {**values, "cov_spectral": values["cov_hc3"], "df_spectral": df}
    fields.update({name: _array(values[name]) for name in ARRAYS})
    fields["stability_cost"] = float(values.get("stability_cost", "nan"))
    fields["tail"] = float(values.get("tail", "inf"))
    fields["free_cost"] = float(values.get("free_cost", "nan"))
    fields["unlike"], fields["begun"] = str(values.get("unlike", "")), tuple(values.get("begun", ()))
    if "spectrum" in values:
        fields["spectrum"] = tuple(_array(own) for own in values["spectrum"])
    if "process_levels" in values:
        fields["process_levels"] = tuple(_array(own) for own in values["process_levels"])
    if "record_levels" in values:  # files of old have none
        fields["record_levels"] = _array(values["record_levels"])
    fields["lines"] = tuple((int(lo), int(hi)) for lo, hi in values["lines"])
    pieces = [_complex(e["re"], e["im"]) for e in values["residuals"]]
    if fields["band_rule"] is not None:
        fields["band_rule"] = {k: float(v) for k, v in fields["band_rule"].items()}
    structure = _structure_from_dict(values["structure"])
    fields.update(structure=structure, options=_options_from_dict(values["options"]), records=None)
    fields["pieces"] = tuple(pieces)
    if "data" in values:
        data = FrequencyResponse.from_dict(values["data"])
        fields["floor"] = float(values.get("floor", "inf"))  # files of old have none
        fields["uneven_p"] = float(values.get("uneven_p", "nan"))
        return ResponseFit(layout=structure.layout(data.outputs, data.inputs), data=data, **fields)
    if isinstance(structure, TransferFunction):
        return Fit(layout=structure.layout(values["outputs"], values["inputs"]), **fields)
    forms = (tuple("smooth" if word == MIXED else word for word in fields["intersample"]),)  # fits no more
    channels = (tuple(values["outputs"]), tuple(values["inputs"]), forms)
    fields.update({name: _array(values[name]) for name in OF_EQUATIONS})
    for name in ("levels", "seen"):  # files of old have one row for all records
        fields[name] = np.broadcast_to(
            np.atleast_2d(fields[name]), (len(fields["lines"]), fields[name].shape[-1])
        )
    fields["by_response"] = bool(values.get("by_response", False))
    fields["follow_p"] = float(values.get("follow_p", "nan"))
    return EquationFit(layout=layout_of(structure, fields["options"], *channels), **fields)


def _sound(fit: Fit) -> Fit:
    """The fit, if its numbers have the shapes of its parameters."""
    count = len(fit.param_names)
    for name, shape in (("params", (count,)), *((name, (count, count)) for name in COVARIANCES)):
        if getattr(fit, name).shape != shape:
            raise ValueError(f"{name} has shape {getattr(fit, name).shape}, not {shape}")
    if fit.status not in STATUS:
        raise ValueError(f"status is {fit.status!r}")
    if fit.success and not np.all(np.isfinite(fit.params)):
        raise ValueError(f"status is {fit.status!r} and params are {fit.params}")
    Options.checked("load", method=fit.options.method, cov_type=fit.options.cov_type)
    return fit


def _structure_from_dict(values: dict[str, Any]) -> Any:
    if "family" in values:
        own = dict(values)
        family: Any = {"Equation": Equation, "StateSpace": StateSpace}[own.pop("family")]
        return family.from_dict(own)
    params = {name: from_plain(given) for name, given in values["params"].items()}
    return TransferFunction(**{**values, "delay": from_plain(values["delay"]), "params": params})


def _options_from_dict(values: dict[str, Any]) -> Options:
    options = dict(values)
    if options["band"] is not None:
        options["band"] = tuple(options["band"])
    options["reference"] = tuple(options.get("reference", ()))
    if not isinstance(options.get("initial_state", ""), str):
        options["initial_state"] = tuple(map(tuple, options["initial_state"]))
    if options["output_weights"] is not None:
        options["output_weights"] = Options.checked(
            "load", output_weights=options["output_weights"]
        ).output_weights
    given = options["noise"]
    if isinstance(given, dict) and "filters" in given:
        options["noise"] = ProcessNoise.of_filters(given["filters"])
    elif isinstance(given, dict):
        options["noise"] = Noise(**given)
    return Options(**options)


def _array(values: Any) -> NDArray[np.float64]:
    return np.array(values, dtype=float)  # "nan" and "inf" as text are understood


def _complex(re: Any, im: Any) -> NDArray[np.complex128]:
    if np.shape(re) != np.shape(im):
        raise ValueError(f"real parts have shape {np.shape(re)}, imaginary parts {np.shape(im)}")
    found = np.empty(np.shape(re), complex)
    found.real, found.imag = _array(re), _array(im)  # 1j times inf would be nan
    return found
