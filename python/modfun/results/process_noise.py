"""What of a fit's noise drives the system, and what the sensors add."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64
from ..base.student import confidence, normal_factor, root
from ..base.tables import Table
from ..errors import SpecError
from ..models.options import Options
from ..models.process import ProcessNoise

if TYPE_CHECKING:
    from .estimates import Estimates

__all__ = ["in_words", "level_names", "levels_of", "of_many", "process_noise"]

CHANGE = 1e-5  # relative, of a level, by which slopes are taken


def process_noise(fit: Estimates, level: float) -> Table:
    """Levels of both kinds of noise; see `Fit.process_noise`.

    One row per level: of each output ("measurement", the standard deviation of a sample) and of each equation
    ("process", the root of the power spectral density, two-sided, of hertz, of the white noise w on its
    right, A(p) y = B(p) u + w; of `ProcessNoise` the factor of each filter, or the coefficients of a
    `Numerator`, "w: c1" for that of s); with its standard error, its interval, normal on the logarithm, and
    its share of the noise of the output over the lines used.

    Raises
    ------
    SpecError
        For fits that take all noise as that of the samples.
    """
    level = confidence("process_noise", level)
    if fit.process_levels is None:
        raise _of_samples(fit.options.noise)
    values, cov, shares = fit.process_levels
    count = len(shares)
    sizes, errors = levels_of(values, root(np.diag(cov)[-values.size :]))
    noise = fit.options.noise
    if isinstance(noise, ProcessNoise) and noise.estimated:
        own = slice(cov.shape[0] - values.size + count, None)
        sizes[count:], errors[count:] = _coefficients(noise, values[count:], cov[own, own])
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        half = normal_factor(level) * errors / sizes
        low, high = sizes * np.exp(-half), sizes * np.exp(half)
    driving = values.size - count
    # Of one output both parts are told; which of several noises moves an output is not told apart.
    alone = count == driving == 1
    nothing = np.full(driving, np.nan)
    columns = {
        **_whose(fit.layout, fit.options, count, driving),
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


def _coefficients(noise: ProcessNoise, levels: F64, cov: F64) -> tuple[F64, F64]:
    """Factors and coefficients of numerators, and their standard errors by the delta method."""
    found = np.array(noise.coefficients(levels.tolist()))
    slopes = np.zeros((levels.size, levels.size))
    for k in np.flatnonzero(levels > 0):
        ends = [levels + side * CHANGE * levels[k] * (np.arange(levels.size) == k) for side in (1, -1)]
        above, below = (np.array(noise.coefficients(own.tolist())) for own in ends)
        slopes[:, k] = (above - below) / (2 * CHANGE * levels[k])
    return found, np.where(found > 0, root(np.diag(slopes @ cov @ slopes.T)), np.nan)


def of_many(levels: tuple[F64, F64] | None, usable: Any, names: Sequence[str], noise: Any) -> Table:
    """Levels and their errors, (fit, level), over the usable fits of many; see `FitMany.process_noise`.

    Raises
    ------
    SpecError
        For fits that take all noise as that of the samples.
    """
    if levels is None:
        raise _of_samples(noise)
    sizes, errors = (own[usable] for own in levels)
    some, two = bool(len(sizes)), len(sizes) > 1
    nothing = np.full(sizes.shape[1], np.nan)
    found = errors > 0  # a level of 0 has no error
    with np.errstate(invalid="ignore", divide="ignore"):
        usual = np.sum(np.where(found, errors, 0.0), axis=0) / np.sum(found, axis=0)
    whose = [name.split(" of ", 1) for name in names]
    return Table(
        {
            "noise": [kind for kind, _ in whose],
            "of": [of for _, of in whose],
            "mean": sizes.mean(axis=0) if some else nothing,
            "sd": sizes.std(axis=0, ddof=1) if two else nothing,
            "median": np.median(sizes, axis=0) if some else nothing,
            "mean_se": usual,
        },
        title="Standard deviation on a sample, and root of the density of what drives the system",
    )


def _of_samples(noise: Any) -> SpecError:
    return SpecError(
        f'process_noise: with noise={noise!r} all noise is that of the samples; fit with noise="process"'
    )


def levels_of(values: F64, errors: F64) -> tuple[F64, F64]:
    """Roots of levels, and their standard errors, from levels and theirs; nan beside a level of 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        sizes = np.sqrt(values)
        return sizes, np.where(values > 0, errors / (2 * sizes), np.nan)


def level_names(layout: Any, options: Options, count: int) -> tuple[str, ...]:
    """What each of so many levels is of, in words."""
    whose = _whose(layout, options, len(layout.outputs), count - len(layout.outputs))
    return tuple([f"{noise} of {of}" for noise, of in zip(whose["noise"], whose["of"], strict=True)])


def _whose(layout: Any, options: Options, count: int, driving: int) -> dict[str, NDArray[np.str_]]:
    """Kind of the levels, and the outputs, equations or inputs that they are of."""
    rows = layout.outputs if layout.rational else [f"equation {k + 1}" for k in range(len(layout.orders))]
    names = options.noise.parts if isinstance(options.noise, ProcessNoise) else rows
    return {
        "noise": np.repeat(["measurement", "process"], [count, driving]),
        "of": np.array([*layout.outputs[:count], *names]),
    }


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
