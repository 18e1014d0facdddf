"""Standard errors of equations that one or two lines determine: no less than white noise makes them."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.arrays import F64

__all__ = ["at_least_white", "many_at_least_white"]

# Degrees of freedom of a spectral variance below which the level of white noise, which all lines tell, counts
# where it is larger. Of S' = -V*S/(K + S), 121 samples, variances with 2 of them scattered so much that one
# of 200 estimates was 15 standard errors off (now 5); intervals hold as often and are 0.8 times as wide.
FEW = 8.0


def at_least_white(found: dict[str, Any]) -> dict[str, Any]:
    """The core's answer for one record or several, with such spectral errors."""
    spectral, white = np.diag(found["cov_spectral"]), np.diag(found["cov_nonrobust"])
    by, degrees = _raised(spectral, white, found["df_spectral"], found["df_resid"])
    by = np.sqrt(by)
    return {**found, "cov_spectral": found["cov_spectral"] * np.outer(by, by), "df_spectral": degrees}


def many_at_least_white(found: dict[str, Any]) -> dict[str, Any]:
    """The same for a batch, of which each record has its row."""
    spectral, white = found["bse_spectral"] ** 2, found["bse_nonrobust"] ** 2
    by, degrees = _raised(spectral, white, found["df_spectral"], found["df_resid"])
    return {**found, "bse_spectral": found["bse_spectral"] * np.sqrt(by), "df_spectral": degrees}


def _raised(spectral: F64, white: F64, degrees: F64, of_white: float) -> tuple[F64, F64]:
    """Factors of the variances, and their degrees of freedom."""
    raised = (degrees < FEW) & (spectral > 0) & (white > spectral)
    by = np.divide(white, spectral, out=np.ones_like(spectral), where=raised)
    return by, np.where(raised, of_white, degrees)
