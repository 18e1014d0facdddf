"""What may be said of any result: numbers that claim to be answers are numbers."""

from __future__ import annotations

from typing import Any

import modfun as mf
import numpy as np


class Broken(AssertionError):
    """A result that says it is right and is not."""


def _need(holds: Any, words: str) -> None:
    if not np.all(holds):
        raise Broken(words)


def _finite(result: Any, *names: str) -> None:
    for name in names:
        _need(np.isfinite(np.asarray(getattr(result, name))), f"{name} is not finite")


def _fit(fit: mf.Fit) -> None:
    _need(fit.status in ("ok", "maxiter", "rank", "nonfinite"), f"status {fit.status!r}")
    if fit.success:
        _finite(fit, "params")
        _need(~(fit.bse < 0), "a standard error below 0")
        _need(~np.isinf(fit.bse), "an infinite standard error")


def _many(found: Any) -> None:
    good = np.asarray(found.status) == "ok"
    _need(
        np.isfinite(np.asarray(found.params)[good]), "a row with status ok has parameters that are no numbers"
    )
    _need(~(np.asarray(found.bse)[good] < 0), "a standard error below 0")


def _record(rec: mf.Record) -> None:
    _finite(rec, "u", "t")
    _need(np.isfinite(rec.y), "y is not finite")
    _need(np.diff(rec.t) > 0, "times do not ascend")


def _response(frf: mf.FrequencyResponse) -> None:
    _finite(frf, "omega")  # a gain may be infinite at a pole, or nan where the data give no answer
    if frf.bse is not None:
        _need(~(np.asarray(frf.bse) < 0), "a standard error below 0")


def _sinusoids(found: mf.Sinusoids) -> None:
    if found.success:
        _finite(found, "params", "offset")
        _need(~(found.bse < 0), "a standard error below 0")


def _reduction(found: mf.Reduction) -> None:
    if found.success:
        _finite(found.model, "num", "den")


def _array(found: np.ndarray[Any, Any]) -> None:
    if found.dtype.kind in "fc":
        _need(np.isfinite(found), "an array that is not finite")


KINDS: tuple[tuple[Any, Any], ...] = (
    (mf.Fit, _fit),
    (mf.Record, _record),
    (mf.FrequencyResponse, _response),
    (mf.Sinusoids, _sinusoids),
    (mf.Reduction, _reduction),
    (np.ndarray, _array),
)


def check(result: Any) -> None:
    """Raise Broken where a result claims more than it has."""
    for kind, look in KINDS:
        if isinstance(result, kind):
            look(result)
            return
    if isinstance(result, tuple | list):
        for part in result:
            check(part)
    elif type(result).__name__ in ("FitMany", "SinusoidsMany"):
        _many(result)
    elif type(result).__name__ == "Coefficients":
        _finite(result, "y", "u")
