"""What of a fit's noise drives the system, and what the sensors add."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base.arrays import F64
from ..base.student import normal_factor, probability, root
from ..base.tables import Table
from ..errors import SpecError

if TYPE_CHECKING:
    from .estimates import Estimates

__all__ = ["process_noise", "share_of_process"]

PARTS = ("measurement", "process")
STEP = 1e-5  # of a parameter or level, in differences


def process_noise(fit: Estimates, level: float) -> Table:
    """Levels of both kinds of noise, with intervals; see `Fit.process_noise`."""
    level = probability("process_noise", level)
    if fit.process_levels is None:
        raise SpecError(
            'process_noise: this fit takes all noise as that of the outputs; fit with noise="process"'
        )
    values, cov = fit.process_levels
    shares, share_error = share_of_process(fit)
    with np.errstate(divide="ignore", invalid="ignore"):
        sizes = np.sqrt(values)
        errors = np.where(values > 0, root(np.diag(cov)[-2:]) / (2 * sizes), np.nan)
        half = normal_factor(level) * errors / sizes
        low, high = sizes * np.exp(-half), sizes * np.exp(half)
    told = [k for k, name in enumerate(PARTS) if name == "process" or fit.options.noise == "process"]
    return Table(
        {
            "noise": np.array(PARTS)[told],
            "level": sizes[told],
            "se": errors[told],
            "low": low[told],
            "high": high[told],
            "share": np.array([1 - shares, shares])[told],
            "share_se": np.full(len(told), share_error),
        },
        title="Standard deviation on a sample, and root of the density of what drives the system",
    )


def share_of_process(fit: Estimates) -> tuple[float, float]:
    """Part of the noise power on the lines used that the system's response to process noise is, and its error."""
    assert fit.process_levels is not None
    values, cov = fit.process_levels
    at, order = np.append(fit.params, values), fit.order
    if not (np.isfinite(at).all() and (values > 0).all()):
        return float(values[0] == 0), 0.0

    def share(unknowns: F64) -> float:
        measured, driven = 0.0, 0.0
        for (low, high), omega0, intervals in zip(fit.lines, fit.omega0, fit.intervals, strict=True):
            m = np.arange(low, high + 1)
            a = np.polyval(np.append(1.0, unknowns[:order]), 1j * m * omega0)
            measured += m.size * unknowns[-2] / intervals
            driven += float(np.sum(omega0 / (2 * np.pi) * unknowns[-1] / np.abs(a) ** 2))
        return driven / (measured + driven)

    slopes = np.zeros(at.size)
    for k in (*range(order), at.size - 2, at.size - 1):
        step = np.zeros(at.size)
        step[k] = STEP * abs(at[k])
        if step[k]:
            slopes[k] = (share(at + step) - share(at - step)) / (2 * step[k])
    return share(at), float(np.sqrt(max(slopes @ cov @ slopes, 0.0)))
