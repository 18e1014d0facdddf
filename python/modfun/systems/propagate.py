"""Exact output of a linear system at the samples, for inputs held, interpolated or smooth between them.

Nothing is discretised approximately: held (zoh) and linearly interpolated (foh) inputs are propagated by
matrix exponentials, also with delays that are not a whole number of samples; smooth inputs by six-point
Gauss-Legendre quadrature of the convolution inside each sample.
"""

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from .._core import gauss_legendre, simulate, simulate_uneven
from ..base.arrays import F64
from ..base.between import AUTO, FORMS, form_of
from ..base.corners import corners
from ..base.samples import FEWEST
from ..base.words import INTERSAMPLE
from ..errors import DataError, SpecError
from ..signals.sources import Source, evaluate, is_samples

__all__ = ["Inputs", "intersample_kinds", "respond", "spline", "too_steep"]

NODES, WEIGHTS = gauss_legendre()  # of the quadrature within a sample, as parts of it
EVEN = 1e-6  # of a step: differences between even ones
KEPT = 2**15  # samples of splines that are kept


def intersample_kinds(
    given: str | Sequence[str], inputs: Sequence[Source], t: F64 | None = None
) -> tuple[str, ...]:
    """One word an input, checked; "auto" is seen in samples, while text and functions are smooth."""
    kinds = (given,) * len(inputs) if isinstance(given, str) else tuple(given)
    if len(kinds) != len(inputs):
        raise SpecError(
            f"reading intersample: {len(kinds)} entries for {len(inputs)} input(s); give one, or one each"
        )
    known = (AUTO, *INTERSAMPLE)
    for kind in kinds:
        if kind not in known:
            raise SpecError(
                f"reading intersample: {kind!r} is unknown; choose among {', '.join(map(repr, known))}"
            )
    return tuple(
        kind if kind != AUTO else _seen(source, t) for kind, source in zip(kinds, inputs, strict=True)
    )


def _seen(source: Source, t: F64 | None) -> str:
    values = np.asarray(source, dtype=np.float64) if is_samples(source) else np.empty(0)
    if values.ndim != 1 or values.size < FEWEST or not np.isfinite(values).all():
        return "smooth"  # what is not fit for a simulation is refused there
    return FORMS[form_of(values, t if t is not None and t.size == values.size else None)]


def respond(
    matrices: tuple[F64, F64, F64, F64],
    x0: F64,
    inputs: Sequence[Source],
    dt: float,
    intervals: int,
    kinds: Sequence[str],
    delays: Sequence[float],
    held: bool = False,
) -> F64:
    """Output of x' = Ax + Bu(t − delay), y = Cx + Du(t − delay) at t = 0, dt, …, intervals·dt.

    Parameters
    ----------
    matrices : tuple of ndarray
        A, B, C, D.
    x0 : ndarray, shape (states,)
        State at t = 0.
    inputs, dt, intervals, kinds, delays, held
        As for `Inputs`.

    Returns
    -------
    ndarray, shape (output, intervals + 1)
    """
    return Inputs(inputs, dt, intervals, kinds, delays, held).respond(matrices, x0)


class Inputs:
    """Inputs of a simulation, evaluated once for any number of systems.

    Parameters
    ----------
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
    held : bool
        Whether samples were at their first value before t = 0; else at zero.
    """

    def __init__(
        self,
        inputs: Sequence[Source],
        dt: float,
        intervals: int,
        kinds: Sequence[str],
        delays: Sequence[float],
        held: bool = False,
    ) -> None:
        self.dt, self.intervals = dt, intervals
        every = list(zip(range(len(inputs)), inputs, kinds, delays, strict=True))
        if not held:
            every += [(k, _taken_back(u), "zoh", late) for k, u, _, late in every if late and _begins(u)]
        # Inputs of one kind go through the core together: (which inputs, kind, samples, nodes).
        self.groups: list[tuple[list[int], str, F64, F64 | None]] = []
        # Held and interpolated inputs whose delay is not a whole number of samples go alone.
        self.fractional: list[tuple[int, str, F64, float]] = []
        grid: F64 = np.arange(intervals + 1.0) * dt
        for kind in INTERSAMPLE:
            together: list[tuple[int, F64, F64 | None]] = []
            for k, source, own, late in every:
                if own != kind:
                    continue
                if kind == "smooth":
                    together.append((k, *_smooth(source, grid, dt, late)))
                    continue
                whole, fraction = _split(late / dt)
                samples = _padded(source, dt, intervals, whole + (fraction > 0))
                if fraction == 0.0:
                    together.append((k, samples[: intervals + 1], None))
                else:
                    self.fractional.append((k, kind, samples, fraction))
            if together:
                inside = [at for _, _, at in together if at is not None]
                self.groups.append(
                    (
                        [k for k, _, _ in together],
                        kind,
                        np.ascontiguousarray([samples for _, samples, _ in together]),
                        np.ascontiguousarray(inside) if inside else None,
                    )
                )

    def respond(self, matrices: tuple[F64, F64, F64, F64], x0: F64) -> F64:
        """Output of a system (A, B, C, D) from the state x0; (output, time)."""
        a, b, c, d = matrices
        groups = self.groups
        if not groups:  # free motion, or fractional delays only
            groups = [([], "zoh", np.zeros((0, self.intervals + 1)), None)]
        start, parts = x0, []
        # The sum is exact because the system is linear.
        for which, kind, u, inside in groups:
            columns = np.ascontiguousarray(b[:, which]), np.ascontiguousarray(d[:, which])
            parts.append(simulate(a, columns[0], c, columns[1], start, u, self.dt, kind, inside))
            start = np.zeros_like(x0)
        y = parts[0]
        for part in parts[1:]:
            y = y + part
        for k, kind, samples, fraction in self.fractional:
            y = y + _fractional(a, b[:, [k]], c, d[:, [k]], samples, self.dt, self.intervals, kind, fraction)
        return y


def too_steep(values: F64, step: float) -> DataError:
    """What to say of samples whose slopes overflow."""
    return DataError(
        f"simulating: an input of samples up to {np.abs(values).max():.3g}, {step:.3g} s apart, has slopes "
        "beyond floating point; take other units, or give intersample='zoh'"
    )


def spline(grid: F64, values: F64) -> Any:
    """The cubic spline through samples, with corners where their slope jumps; SciPy's, with what it offers.

    A corner between two samples is one more knot, of `.x`.

    Raises
    ------
    DataError
        Its slopes are beyond floating point.
    """
    if values.size > KEPT:
        return _spline(grid, values)
    return _spline_again(*[np.asarray(own, dtype=float).tobytes() for own in (grid, values)])


@lru_cache(16)
def _spline_again(grid: bytes, values: bytes) -> Any:
    """The same: a search simulates the inputs of a record some hundred times."""
    return _spline(*[np.frombuffer(own).copy() for own in (grid, values)])


def _spline(grid: F64, values: F64) -> Any:
    from scipy.interpolate import CubicSpline

    with np.errstate(over="ignore", invalid="ignore"):
        try:
            if values.size < 4:
                found = CubicSpline(grid, values)
            else:
                found = CubicSpline.construct_fast(*_between_corners(grid, values))
        except ValueError:
            found = None
    if found is None or not np.all(np.isfinite(found.c)):
        raise too_steep(values, float(grid[1] - grid[0]))
    return found


def _between_corners(grid: F64, values: F64) -> tuple[F64, F64]:
    """Coefficients (power descending, interval) of a spline from corner to corner, and its knots."""
    steps = np.diff(grid)
    bent = corners(np.ascontiguousarray(values)) if np.ptp(steps) <= EVEN * steps[0] else None
    if bent is None:
        return _pieces(grid, values), grid
    whole = np.round(bent.part)
    between = np.abs(bent.part - whole) > EVEN
    after = bent.at[between] + 1
    grid = np.insert(grid, after, grid[after - 1] + bent.part[between] * steps[after - 1])
    values = np.insert(values, after, bent.values[between])
    more = np.cumsum(between)
    ends = [0, *(bent.at + np.where(between, more, whole + more)).astype(int).tolist(), values.size - 1]
    return np.hstack([_pieces(grid[a : b + 1], values[a : b + 1]) for a, b in pairwise(ends)]), grid


def _pieces(grid: F64, values: F64) -> F64:
    """Coefficients (power descending, interval); the first two pieces are one cubic, and so are the last two.

    SciPy's own way to them checks its arguments for ten times as long as this takes.
    """
    from scipy.linalg.lapack import dgtsv

    dx = np.diff(grid)
    slope = np.diff(values) / dx
    first, last = grid[2] - grid[0], grid[-1] - grid[-3]
    # Equal second derivatives inside, equal third ones next to the ends: equations for the samples' slopes.
    diagonal = np.concatenate([dx[1:2], 2 * (dx[:-1] + dx[1:]), dx[-2:-1]])
    upper, lower = np.append(first, dx[:-1]), np.append(dx[1:], last)
    right = np.empty_like(values)
    right[1:-1] = 3 * (dx[1:] * slope[:-1] + dx[:-1] * slope[1:])
    right[0] = ((dx[0] + 2 * first) * dx[1] * slope[0] + dx[0] ** 2 * slope[1]) / first
    right[-1] = (dx[-1] ** 2 * slope[-2] + (2 * last + dx[-1]) * dx[-2] * slope[-1]) / last
    at = dgtsv(lower, diagonal, upper, right, 1, 1, 1, 1)[3]
    bend = (at[:-1] + at[1:] - 2 * slope) / dx
    return np.array([bend / dx, (slope - at[:-1]) / dx - bend, at[:-1], values[:-1]])


def _smooth(source: Source, grid: F64, dt: float, delay: float) -> tuple[F64, F64]:
    """A smooth signal, delayed, at the samples and at the quadrature nodes (interval, node) inside each.

    Text and functions are evaluated there (before the record at negative times); samples go through a
    cubic spline and hold their first value before the record.
    """
    at: F64 = grid - delay
    inside: F64 = at[:-1, None] + NODES * dt
    if not is_samples(source):
        return evaluate(source, at), evaluate(source, inside.ravel()).reshape(inside.shape)
    values = evaluate(source, grid)
    curve = spline(grid, values)
    more = np.setdiff1d(curve.x, grid) if delay == 0.0 else _corners_of(curve)
    if delay == 0.0 and not more.size:
        return values, np.ascontiguousarray(curve.c.T @ np.vander(NODES * dt, len(curve.c)).T)
    seen = np.ascontiguousarray(curve(np.maximum(inside, 0.0)))
    for corner in more:
        k = int(np.searchsorted(at, corner, side="right")) - 1
        if k < len(seen):
            seen[k] = _bent(curve, at[k], (corner - at[k]) / dt, dt)
    return (values if delay == 0.0 else curve(np.maximum(at, 0.0))), seen


def _corners_of(curve: Any) -> F64:
    """Knots of a spline at which its slope jumps."""
    powers = np.arange(len(curve.c))[::-1]
    ends = np.sum(
        [p * c * np.diff(curve.x) ** max(p - 1, 0) for p, c in zip(powers, curve.c, strict=True)], axis=0
    )
    slopes = curve(curve.x[1:-1], 1)
    jumps = np.abs(slopes - ends[:-1]) > EVEN * np.max(np.abs(slopes), initial=1e-300)
    return np.asarray(curve.x[1:-1][jumps])


def _bent(curve: Any, begin: float, part: float, dt: float) -> F64:
    """Values at the nodes of an interval with a corner, with which their rule has its moments."""
    places = np.concatenate([part * NODES, part + (1 - part) * NODES])
    weights = np.concatenate([part * WEIGHTS, (1 - part) * WEIGHTS])
    size = 2 * np.arange(NODES.size) + 1
    lines = size * (weights * curve(np.maximum(begin + places * dt, 0.0)) @ _legendre(places))
    return np.asarray(_legendre(NODES) @ lines)


def _legendre(places: F64) -> F64:
    """Legendre's polynomials (place, degree) of parts of an interval."""
    return np.asarray(np.polynomial.legendre.legvander(2 * places - 1, NODES.size - 1))


def _begins(source: Source) -> float:
    """The first value of samples; 0 of text and functions, which say what was before."""
    return float(np.ravel(source)[0]) if is_samples(source) else 0.0  # type: ignore[arg-type]


def _taken_back(source: Source) -> Source:
    """What takes the first value of samples from the time before them."""
    first = _begins(source)
    return lambda t: np.where(t < 0, -first, 0.0)


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

    The core goes from each sampling instant to the breakpoint of the delayed input that follows, and on.
    """
    # samples[k] stands at (k − 1 + fraction)·dt, a rest before the sampling instant k·dt.
    before, after = samples[: intervals + 1], samples[1 : intervals + 2]
    now = before if kind == "zoh" else before + (1.0 - fraction) * (after - before)  # the input at k·dt
    t = np.arange(intervals + 1.0)[:, None] * dt + [0.0, fraction * dt]
    u = np.column_stack([now, after])
    held, start = [kind == "zoh"], np.zeros(len(a))
    u, t = np.ascontiguousarray(u.ravel()[None, :-1]), t.ravel()[:-1]
    return simulate_uneven(a, b, c, d, start, u, held, t)[:, ::2]
