"""Roots and frequency responses of what a layout makes of parameters, with their derivatives to these."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import C128, F64
from ..models.layout import Layout
from ..systems.polynomials import root_slopes

__all__ = ["differences", "pole_gradients", "response_gradients", "root_gradients"]


def root_gradients(p: F64, places: Sequence[int | None], size: int) -> tuple[C128, C128]:
    """Roots and their derivatives (root, parameter).

    `places` says which of the `size` parameters each coefficient is, None where it is none. The derivatives
    of a repeated root are infinite.
    """
    found, slopes = root_slopes(p)
    gradient = np.zeros((found.size, size), complex)
    for k, at in enumerate(places):
        if at is not None:
            gradient[:, at] = slopes[:, k]
    return found, gradient


def pole_gradients(layout: Layout, params: F64, output: int = 0) -> tuple[C128, C128]:
    """Poles of an output and their derivatives (pole, parameter)."""
    den, _ = layout.polynomials(params, output)
    first = layout.places[0][output]
    return root_gradients(den, [None, *layout.positions[first : first + den.size - 1]], params.size)


def response_gradients(layout: Layout, params: F64, omega: F64) -> tuple[C128, C128]:
    """Frequency response (output, input, f) and its derivatives (parameter, output, input, f)."""
    outputs, inputs = len(layout.outputs), len(layout.inputs)
    s = 1j * omega
    response = np.zeros((outputs, inputs, s.size), complex)
    gradient = np.zeros((params.size, outputs, inputs, s.size), complex)
    delays = {path: len(layout.free) + at for at, path in enumerate(layout.free_delays)}
    with np.errstate(all="ignore"):
        for i in range(outputs):
            den, nums = layout.polynomials(params, i)
            n, first = layout.orders[i], layout.places[0][i]
            over = 1 / np.polyval(den, s)
            for k, (num, delay) in enumerate(zip(nums, layout.delays(params, i), strict=True)):
                degree = layout.numerators[i][k]
                if degree is None:
                    continue
                late = np.exp(-s * delay)
                response[i, k] = np.polyval(num, s) * over * late
                for j in range(1, n + 1):
                    at = layout.positions[first + j - 1]
                    if at is not None:
                        gradient[at, i, k] = -response[i, k] * s ** (n - j) * over
                for j in range(degree + 1):
                    at = layout.positions[layout.places[1][i][k] + j]
                    if at is not None:
                        gradient[at, i, k] = s ** (degree - j) * over * late
                path = layout.routes[i][k]
                if path in delays:
                    gradient[delays[path], i, k] = -s * response[i, k]
    return response, gradient


def differences(of: Callable[[F64], Any], params: F64, errors: F64) -> NDArray[Any]:
    """Central differences of a function, parameters first, with steps that suit their sizes and errors."""
    found = []
    for k, (own, error) in enumerate(zip(params.tolist(), errors.tolist(), strict=True)):
        step = np.zeros(params.size)
        step[k] = np.cbrt(np.finfo(float).eps) * (max(abs(own), float(np.nan_to_num(error))) or 1.0)
        found.append((of(params + step) - of(params - step)) / (2 * step[k]))
    return np.array(found)
