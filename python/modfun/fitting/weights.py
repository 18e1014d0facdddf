"""What the residuals of a joint fit are weighted by: the noise that is known, or seen beside signals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .._core import noise_level
from ..base.arrays import F64
from ..base.noisy_levels import white_level
from ..errors import DataError, SpecError
from ..models.layout import Layout
from ..models.noise import Noise
from ..models.options import Options
from ..records.record import Record

__all__ = ["weighting"]


def weighting(
    layout: Layout, options: Options, records: Sequence[Record], intervals: Sequence[int]
) -> dict[str, Any]:
    """Keywords of the core: what the residuals of a joint fit are weighted by.

    Raises
    ------
    DataError, SpecError
        Levels that are not available, or for another number of channels.
    """
    if options.noise == "log-normal":
        raise SpecError(
            'fit: noise="log-normal" is for equations: mf.Equation("y\' + a*y = b*u") takes what a '
            "TransferFunction does"
        )
    outputs, inputs = len(layout.outputs), len(layout.inputs)
    found: dict[str, Any] = {
        "equation": options.noise == "equation",
        "coloured": options.noise == "coloured",
        "sigma_y": None,
        "sigma_u": None,
        "spectra": [],
        "driven": options.drives,
        "own_levels": not isinstance(options.noise, Noise)
        and not options.drives
        and options.noise != "errors-in-variables"
        and all(rec.sigma is None for rec in records),
    }
    if options.output_weights is not None:
        weights = np.array(options.output_weights, dtype=float)
        weights = np.diag(weights) if weights.ndim == 1 else weights
        if weights.shape != (outputs, outputs):
            raise SpecError(
                f"fit: output_weights is for {weights.shape[0]} output(s), the record has {outputs}; give "
                "one weight an output (1/variance), or the inverse covariance matrix"
            )
        found["sigma_y"] = np.linalg.inv(weights).ravel().tolist()
    if isinstance(options.noise, Noise):
        given = options.noise
        cov, shape = _covariance("y", given.y, outputs)
        found["sigma_y"] = cov.ravel().tolist()
        shapes = [shape]
        if given.u is not None:
            cov, shape = _covariance("u", given.u, inputs)
            found["sigma_u"] = _of_paths(cov, layout).ravel().tolist()
            shapes.append(shape)
        if any(shape is not None for shape in shapes):
            found["spectra"] = [
                _spectra(layout, shapes, rec, used) for rec, used in zip(records, intervals, strict=True)
            ]
    elif options.noise == "errors-in-variables":
        y, u = _levels(layout, records, intervals)
        found["sigma_y"] = np.diag(y**2).ravel().tolist()
        found["sigma_u"] = _of_paths(np.diag(u**2), layout).ravel().tolist()
    if found["sigma_u"] is not None and len(layout.paths) > inputs:
        raise SpecError(
            "fit: noisy inputs with a delay that differs from output to output are not supported; give one "
            "delay an input"
        )
    return found


def _covariance(name: str, given: Any, channels: int) -> tuple[F64, tuple[Callable[..., Any], ...] | None]:
    """Covariance of the channels and, where given as functions, their spectra."""
    if callable(given) or (isinstance(given, tuple) and given and callable(given[0])):
        functions = given if isinstance(given, tuple) else (given,) * channels
        _count(name, len(functions), channels)
        return np.eye(channels), functions
    values = np.asarray(given, dtype=float)
    if values.ndim == 2:
        _count(name, len(values), channels)
        return values, None
    if values.ndim == 1:
        _count(name, values.size, channels)
    return np.diag(np.broadcast_to(values, (channels,)) ** 2), None


def _count(name: str, have: int, wanted: int) -> None:
    if have != wanted:
        raise SpecError(
            f"fit: noise of {have} {name} channel(s) for a record of {wanted}; give one per channel of {name}"
        )


def _of_paths(cov: F64, layout: Layout) -> F64:
    index = [path.input for path in layout.paths]
    return np.ascontiguousarray(cov[np.ix_(index, index)])


def _spectra(layout: Layout, shapes: Sequence[Any], rec: Record, intervals: int) -> list[list[float]]:
    """Power on the lines from 0 on, outputs then paths."""
    duration = rec.duration if rec.dt is None else intervals * rec.dt
    omega = 2 * np.pi / duration * np.arange(intervals // 2 + 1)
    rows = []
    for shape, index in zip(
        [*shapes, None][:2],
        [range(len(layout.outputs)), [path.input for path in layout.paths]],
        strict=True,
    ):
        for k in index:
            try:
                with np.errstate(all="ignore"):
                    values = np.ones(omega.size) if shape is None else np.array(shape[k](omega), dtype=float)
            except Exception as error:
                raise SpecError(
                    f"fit: noise spectrum number {k} raised {type(error).__name__}: {error}; it gets an "
                    "array of omega in rad/s and returns as many numbers above 0"
                ) from error
            if values.shape != omega.shape or not np.all(np.isfinite(values)) or np.any(values <= 0):
                raise SpecError(
                    "fit: a noise spectrum must return one finite number above 0 for each omega (rad/s, from "
                    f"0 to {omega[-1]:.4g}); it returned shape {values.shape}, smallest {np.min(values):.3g}"
                )
            rows.append(values.tolist())
    return rows


def _levels(layout: Layout, records: Sequence[Record], intervals: Sequence[int]) -> tuple[F64, F64]:
    """Noise levels of outputs and inputs from the harmonics that the signals leave empty."""
    order = max(layout.orders)
    power = []
    for rec, used in zip(records, intervals, strict=True):
        if rec.dt is None:
            raise DataError(
                'fit: noise="errors-in-variables" takes levels from the unused high band of evenly sampled '
                "records; give them as noise=mf.Noise(y=..., u=...)"
            )
        window = np.vstack([rec.y, rec.u])[:, rec.intervals - used :]
        power.append(noise_level(np.ascontiguousarray(window), order) ** 2)
        for row, (own, kind) in enumerate(
            zip(window[len(rec.y) :], rec.intersample, strict=True), len(rec.y)
        ):
            if kind != "smooth":  # jumps and corners have power at all frequencies
                power[-1][row] = min(power[-1][row], white_level(own) ** 2)
    level = np.sqrt(np.mean(power, axis=0))
    outputs = len(layout.outputs)
    if np.any(level[:outputs] == 0):
        raise DataError(
            'fit: noise="errors-in-variables": the unused high band of an output is empty, so its noise '
            "level cannot be seen; give the levels as noise=mf.Noise(y=..., u=...)"
        )
    return level[:outputs], level[outputs:]
