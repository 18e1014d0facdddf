"""Fits as JSON: every number exactly, never the samples."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._core import __version__
from .errors import DataError, SpecError
from .options import Options
from .results import Fit
from .structures import TransferFunction

__all__ = ["fit_from_dict", "fit_to_dict", "load", "told"]

KIND = "modfun.Fit"
SCHEMA = 1

# Fields that are plain numbers, texts, or lists of them.
_PLAIN = ("units", "cost", "sigma", "df_resid", "status", "nit", "high_band_sigma", "band_rule")
_TUPLES = (
    "outputs",
    "inputs",
    "intersample",
    "numerators",
    "delays",
    "param_names",
    "omega0",
    "intervals",
    "steps",
)
_ARRAYS = ("params", "cov_nonrobust", "cov_hc3", "gram")


def fit_to_dict(fit: Fit) -> dict[str, Any]:
    """A fit as plain Python values; what is not finite becomes text ("nan", "inf"), as JSON has none."""
    values: dict[str, Any] = {"kind": KIND, "schema": SCHEMA, "modfun": __version__}
    values["structure"] = _structure_to_dict(fit.structure)
    values["options"] = asdict(fit.options)
    for name in _PLAIN:
        values[name] = getattr(fit, name)
    for name in _TUPLES:
        values[name] = list(getattr(fit, name))
    for name in _ARRAYS:
        values[name] = getattr(fit, name).tolist()
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
        options = dict(values["options"])
        if options["band"] is not None:
            options["band"] = tuple(options["band"])
        fields: dict[str, Any] = {name: values[name] for name in _PLAIN}
        del fields["high_band_sigma"]
        fields["cost"], fields["sigma"], fields["known_level"] = (
            float(values[name]) for name in ("cost", "sigma", "high_band_sigma")
        )
        fields.update({name: tuple(values[name]) for name in _TUPLES})
        fields.update({name: _array(values[name]) for name in _ARRAYS})
        fields["lines"] = tuple((int(lo), int(hi)) for lo, hi in values["lines"])
        pieces = [_array(e["re"]) + 1j * _array(e["im"]) for e in values["residuals"]]
        if fields["band_rule"] is not None:
            fields["band_rule"] = {k: float(v) for k, v in fields["band_rule"].items()}
        structure = _structure_from_dict(values["structure"])
        return Fit(
            structure=structure, options=Options(**options), pieces=tuple(pieces), records=None, **fields
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise DataError(f"loading a fit: the file is damaged ({type(error).__name__}: {error})") from None


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
    place = Path(path)
    if place.is_dir():
        from .study.shards import load

        return load(place)
    if not place.is_file():
        raise SpecError(f"load: there is no file {str(place)!r}")
    try:
        values = json.loads(place.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise DataError(
            f"load: {str(place)!r} is not JSON ({error}); it should be what fit.save wrote"
        ) from None
    return fit_from_dict(values)


def _structure_to_dict(structure: TransferFunction) -> dict[str, Any]:
    return {"poles": structure.poles, "zeros": structure.zeros, "delay": structure.delay}


def _structure_from_dict(values: dict[str, Any]) -> TransferFunction:
    return TransferFunction(**values)


def _array(values: Any) -> NDArray[np.float64]:
    return np.array(values, dtype=float)  # "nan" and "inf" as text are understood


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
