"""Exact output of a linear system at the samples, for inputs held, interpolated or smooth between them.

Nothing is discretised approximately: held (zoh) and linearly interpolated (foh) inputs are propagated by
matrix exponentials, also with delays that are no whole number of samples; smooth inputs by six-point
Gauss-Legendre quadrature of the convolution inside each sample.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from . import _core
from .errors import SpecError
from .signals import Source, evaluate, is_samples

__all__ = ["INTERSAMPLE", "intersample_kinds", "nodes", "respond"]

F64 = NDArray[np.float64]
INTERSAMPLE = ("smooth", "zoh", "foh")


def intersample_kinds(given: str | Sequence[str], inputs: int) -> tuple[str, ...]:
    """One behaviour between samples an input, checked."""
    kinds = (given,) * inputs if isinstance(given, str) else tuple(given)
    if len(kinds) != inputs:
        raise SpecError(
            f"reading intersample: {len(kinds)} entries for {inputs} input(s); give one, or one an input"
        )
    for kind in kinds:
        if kind not in INTERSAMPLE:
            raise SpecError(
                f"reading intersample: {kind!r} is unknown; choose among {', '.join(map(repr, INTERSAMPLE))}"
            )
    return kinds


def nodes(source: Source, dt: float, intervals: int, delay: float = 0.0) -> F64:
    """Values of a smooth signal, delayed, at the quadrature nodes inside each sample.

    Text and functions are evaluated there (before the record at negative times); samples go through a
    cubic spline and hold their first value before the record.

    Returns
    -------
    ndarray, shape (intervals, nodes)
    """
    positions = _core.gauss_legendre()[0]
    times: F64 = (np.arange(float(intervals))[:, None] + positions) * dt - delay
    if not is_samples(source):
        return evaluate(source, times.ravel()).reshape(times.shape)
    grid: F64 = np.arange(intervals + 1.0) * dt
    return _spline(grid, evaluate(source, grid), times)


def respond(
    matrices: tuple[F64, F64, F64, F64],
    x0: F64,
    inputs: Sequence[Source],
    dt: float,
    intervals: int,
    kinds: Sequence[str],
    delays: Sequence[float],
) -> F64:
    """Output of x' = Ax + Bu(t − delay), y = Cx + Du(t − delay) at t = 0, dt, …, intervals·dt.

    Parameters
    ----------
    matrices : tuple of ndarray
        A, B, C, D.
    x0 : ndarray, shape (states,)
        State at t = 0.
    inputs : sequence of Source
        One signal an input; arrays have intervals + 1 samples.
    dt : float
        Sampling interval, s.
    intervals : int
        Number of sampling intervals N.
    kinds : sequence of {"smooth", "zoh", "foh"}
        Behaviour between samples, an input.
    delays : sequence of float
        Delay of each input, s, at least 0.

    Returns
    -------
    ndarray, shape (output, intervals + 1)
    """
    a, b, c, d = matrices
    y = np.zeros((c.shape[0], intervals + 1))
    if not inputs:
        empty = np.zeros((0, intervals + 1))
        return _core.simulate(a, b, c, d, x0, empty, dt, "zoh", None)
    start = x0
    # Inputs of one kind go together; the sum is exact because the system is linear.
    for kind in sorted(set(kinds)):
        together: list[tuple[int, F64, F64 | None]] = []
        for k, source in enumerate(inputs):
            if kinds[k] != kind:
                continue
            if kind == "smooth":
                grid: F64 = np.arange(intervals + 1.0) * dt
                inside = nodes(source, dt, intervals, delays[k])
                if is_samples(source):
                    samples = _spline(grid, evaluate(source, grid), grid - delays[k])
                else:
                    samples = evaluate(source, grid - delays[k])
                together.append((k, samples, inside))
                continue
            whole, fraction = _split(delays[k] / dt)
            samples = _padded(source, dt, intervals, whole + (fraction > 0))
            if fraction == 0.0:
                together.append((k, samples[: intervals + 1], None))
            else:
                y += _fractional(a, b[:, [k]], c, d[:, [k]], samples, dt, intervals, kind, fraction)
        if together:
            which = [k for k, _, _ in together]
            u = np.ascontiguousarray([samples for _, samples, _ in together])
            inside_all = (
                np.ascontiguousarray([inside for _, _, inside in together]) if kind == "smooth" else None
            )
            y += _core.simulate(
                a, np.ascontiguousarray(b[:, which]), c, np.ascontiguousarray(d[:, which]),
                start, u, dt, kind, inside_all,
            )  # fmt: skip
            start = np.zeros_like(x0)
    if start is x0 and np.any(x0):
        nothing = np.zeros((1, intervals + 1))
        one = np.zeros((a.shape[0], 1)), np.zeros((c.shape[0], 1))
        y += _core.simulate(a, one[0], c, one[1], x0, nothing, dt, "zoh", None)
    return y


def _spline(grid: F64, values: F64, times: F64) -> F64:
    from scipy.interpolate import CubicSpline

    held = np.maximum(times, 0.0)
    return np.ascontiguousarray(CubicSpline(grid, values)(held), dtype=np.float64)


def _split(samples: float) -> tuple[int, float]:
    """A delay in samples as whole and fraction; what is whole but for rounding is whole."""
    nearest = round(samples)
    if abs(samples - nearest) <= 1e-9 * max(1.0, samples):
        return nearest, 0.0
    whole = int(np.floor(samples))
    return whole, samples - whole


def _padded(source: Source, dt: float, intervals: int, before: int) -> F64:
    """Samples at −before·dt, …, intervals·dt."""
    grid: F64 = np.arange(intervals + 1.0) * dt
    if is_samples(source):
        values = evaluate(source, grid)
        return np.concatenate([np.full(before, values[0]), values])
    return evaluate(source, np.arange(-before, intervals + 1) * dt)


def _fractional(
    a: F64, b: F64, c: F64, d: F64, samples: F64, dt: float, intervals: int, kind: str, fraction: float
) -> F64:
    """Response from rest to one held or interpolated input whose samples fall inside the intervals.

    The breakpoints of the delayed input lie at (fraction + j)·dt: propagate exactly from one to the next,
    then from each to the sampling instant a rest = 1 − fraction of an interval later.
    """
    # samples[k] stands at (k − 1 + fraction)·dt, a rest before the sampling instant k·dt.
    rest = 1.0 - fraction
    before, after = samples[: intervals + 1], samples[1 : intervals + 2]
    now = before if kind == "zoh" else before + rest * (after - before)  # the input at k·dt
    until = before if kind == "zoh" else after
    n = a.shape[0]
    first = _advance(a, b, np.zeros((n, 1)), fraction * dt, now[:1], until[:1])[:, 0]
    breaks = np.ascontiguousarray(before[None, 1:])
    at_breaks = _core.simulate(a, b, np.eye(n), np.zeros((n, 1)), first, breaks, dt, kind, None)
    states = np.zeros((n, intervals + 1))
    states[:, 1:] = _advance(a, b, at_breaks, rest * dt, before[1:], now[1:])
    return c @ states + d * now


def _advance(a: F64, b: F64, x: F64, h: float, first: F64, last: F64) -> F64:
    """States h later, the input going linearly from first to last: columns of x, one input value each."""
    from scipy.linalg import expm

    n = a.shape[0]
    block = np.zeros((n + 2, n + 2))
    block[:n, :n] = a * h
    block[:n, n] = b[:, 0] * h
    block[n, n + 1] = 1.0
    e = expm(block)
    moved: F64 = e[:n, :n] @ x + np.outer(e[:n, n], first) + np.outer(e[:n, n + 1], last - first)
    return moved
