"""The noise spectrum that the standard errors of a fit rest on, as a table."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.student import confidence, normal_factor
from ..base.tables import Table
from ..errors import SpecError

__all__ = ["noise_spectrum"]


def noise_spectrum(fit: Any, level: float) -> Table:
    """Noise level of each row over the band, with intervals; see `Fit.noise_spectrum`."""
    level = confidence("noise_spectrum", level)
    if fit.process_levels is not None:
        raise SpecError(
            f"noise_spectrum: with noise={fit.options.noise!r} standard errors rest on its levels, "
            "fit.process_noise()"
        )
    if fit.spectrum is None:
        raise SpecError("noise_spectrum: this fit holds no residual lines; fit a record")
    omega, power, log_error = fit.spectrum
    half = normal_factor(level) * log_error / 2
    root = np.sqrt(power)
    return Table(
        {
            "row": np.repeat(fit.row_names, omega.size),
            "omega": np.tile(omega, len(power)),
            "level": root.ravel(),
            "low": (root * np.exp(-half)).ravel(),
            "high": (root * np.exp(half)).ravel(),
        },
        title="Noise level over that of white noise, which is 1",
        units={"omega": "rad/s"},
    )
