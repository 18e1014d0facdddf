"""What of a fit's noise drives the system, and what the sensors add."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base.student import confidence, normal_factor, root
from ..base.tables import Table
from ..errors import SpecError
from ..models.process import ProcessNoise

if TYPE_CHECKING:
    from .estimates import Estimates

__all__ = ["in_words", "process_noise"]


def process_noise(fit: Estimates, level: float) -> Table:
    """Levels of both kinds of noise; see `Fit.process_noise`.

    One row per level: of each output ("measurement", the standard deviation of a sample) and of each equation
    ("process", the root of the power spectral density, two-sided, of hertz, of the white noise w on its
    right, A(p) y = B(p) u + w; of `ProcessNoise` the factor of each filter); with its standard error, its
    interval, normal on the logarithm, and its share of the noise of the output over the lines used.

    Raises
    ------
    SpecError
        For fits that take all noise as that of the samples.
    """
    level = confidence("process_noise", level)
    if fit.process_levels is None:
        raise SpecError(
            f"process_noise: with noise={fit.options.noise!r} all noise is that of the samples; fit "
            'with noise="process"'
        )
    values, cov, shares = fit.process_levels
    count = len(shares)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        sizes = np.sqrt(values)
        errors = np.where(values > 0, root(np.diag(cov)[-values.size :]) / (2 * sizes), np.nan)
        half = normal_factor(level) * errors / sizes
        low, high = sizes * np.exp(-half), sizes * np.exp(half)
    noise, driving = fit.options.noise, values.size - count
    names = noise.names if isinstance(noise, ProcessNoise) else fit.row_names
    # Of one output both parts are told; which of several noises moves an output is not told apart.
    alone = count == driving == 1
    nothing = np.full(driving, np.nan)
    columns = {
        "noise": np.repeat(["measurement", "process"], [count, driving]),
        "of": np.array([*fit.outputs[:count], *names]),
        "level": sizes,
        "se": errors,
        "low": low,
        "high": high,
        "share": np.concatenate([1 - shares[:, 0], shares[:, 0] if alone else nothing]),
        "share_se": np.concatenate([shares[:, 1], shares[:, 1] if alone else nothing]),
    }
    told = slice(0 if fit.options.drives else count, None)
    return Table(
        {name: column[told] for name, column in columns.items()},
        title="Standard deviation on a sample, and root of the density of what drives the system",
    )


def in_words(fit: Estimates) -> str:
    """Levels of process and measurement noise, and how much of the misfit is the first."""
    assert fit.process_levels is not None
    if not np.isfinite(fit.process_levels[0]).all():
        return "white in the system and on the outputs; no levels"
    values, _, shares = fit.process_levels
    rows = process_noise(fit, 0.95)
    several = len(values) > 2
    told = [
        f"{name}{f' of {of}' if several else ''} {level:.4g}" + (f" ± {error:.2g}" if error > 0 else "")
        for name, of, level, error in zip(rows["noise"], rows["of"], rows["level"], rows["se"], strict=True)
    ]
    if not fit.options.drives:
        return f"white in the equations: {', '.join(told)}"
    parts = [
        f"{100 * share:.0f} ± {100 * error:.0f} % of the misfit{f' of {y}' if len(shares) > 1 else ''}"
        for y, (share, error) in zip(fit.outputs, shares, strict=False)
    ]
    kind = "white in the system" if fit.options.noise == "process" else "through the inputs named"
    return f"{kind} and white on the outputs: {', '.join(told)}; process noise is {', '.join(parts)}"
