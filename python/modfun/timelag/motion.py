"""Responses of linear delay equations: collocation of high order on pieces that no kink crosses.

Each sampling interval is cut where kinks come to lie: at the lags of u, from its steps, and at the lags of x
thereafter, all modulo the interval. On a piece the state is a polynomial of degree 7 that satisfies the
equation at the Radau points; the delayed state is read from the polynomials of the past.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arguments import reals
from ..base.arrays import F64
from ..errors import DataError, SpecError
from ..signals.sources import Source, evaluate, is_samples
from ..systems.propagate import spline
from . import drawing
from .plant import Plant

__all__ = ["History", "Motion", "Trajectory", "drive", "history"]

History = Callable[[F64], F64]

STAGES = 7  # order of the method: one more
LEVELS = 3  # lags of x after which a kink is smooth enough to be passed over
SAME = 1e-9  # of an interval: kinks closer than this are one
RESOLVED = 0.75  # length of a piece times the size of the matrices, at most
MOST = 400_000  # pieces of a simulation


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    """A response of a delay system; `state` and `input` hold between the samples and before t = 0, too.

    Attributes
    ----------
    t : ndarray, shape (time,)
        Instants of the samples, s.
    x : ndarray, shape (state, time)
    u : ndarray, shape (input, time)
        What drives the plant: feedback, held from its sample on, and what comes from outside.
    y : ndarray, shape (output, time)
        Cx.
    z : ndarray, shape (state, time), or None
        The reduced state as the controller sees it; None without feedback.
    state, input : callable
        ``state(t)`` is (state, time) at any instants up to the end, `input` (input, time).
    """

    plant: Plant
    t: F64
    x: F64
    u: F64
    y: F64
    z: F64 | None
    state: History
    input: History

    def plot(self, ax: Any = None) -> Any:
        """Draw states above, inputs below (extra ``plot``); returns Axes."""
        held = self.z is not None
        return drawing.trajectory(self.t, self.plant.states, self.x, self.plant.inputs, self.u, held, ax)

    def __repr__(self) -> str:
        size = np.sqrt(np.mean(self.x**2, axis=1))
        rms = ", ".join(f"{n} {s:.4g}" for n, s in zip(self.plant.states, size, strict=True))
        return f"Trajectory of {len(self.t)} samples over {self.t[-1]:g} s, rms {rms}"


class Motion:
    """The equation made ready for sampling intervals of one length.

    Parameters
    ----------
    plant : Plant
    dt : float
        Sampling interval, s.
    intervals : int
    stages : int
        Points of the collocation.
    """

    def __init__(self, plant: Plant, dt: float, intervals: int, stages: int = STAGES) -> None:
        self.plant, self.dt, self.intervals = plant, dt, intervals
        self.now, self.late = plant.a[0][1], plant.a[1:]
        edges = _edges(plant, dt)
        self.pieces = len(edges) - 1
        self.back = int(np.ceil(max(lag for lag, _ in (*plant.a, *plant.b)) / dt - SAME)) + 1
        if (intervals + self.back) * self.pieces > MOST:
            raise SpecError(
                f"simulating: {intervals} intervals of {dt:g} s in {self.pieces} pieces each (no longer than "
                f"the shortest lag, and short beside the matrices) make more than {MOST}; simulate a shorter "
                "time, or leave out lags that are next to nothing"
            )
        points = _radau(stages)
        local = np.append(0.0, points)  # the left end is a node, too
        slopes = _differentiation(local)[1:]
        self.local, self.edges = local, edges
        self.nodes = (edges[:-1, None] + np.diff(edges)[:, None] * points).astype(np.float64)
        n = len(self.now)
        self.inverse, self.pull = [], []
        for length in np.diff(edges) * dt:
            self.inverse.append(
                np.linalg.inv(np.kron(slopes[:, 1:] / length, np.eye(n)) - np.kron(np.eye(stages), self.now))
            )
            self.pull.append(slopes[:, :1] / length)
        self.reads = [[self._read(s, lag) for lag, _ in self.late] for s in range(self.pieces)]

    def _read(self, piece: int, lag: float) -> tuple[NDArray[np.int64], F64]:
        """Where the delayed state is read, piece by piece back, and with what weights, one row per node."""
        edges = self.edges
        middle = 0.5 * (edges[piece] + edges[piece + 1])
        at = self.nodes[piece] - lag / self.dt
        inside = at + 1e-7 * (middle - self.nodes[piece])  # of two pieces the one that this piece sees
        whole = np.floor(inside)
        own = np.clip(np.searchsorted(edges, inside - whole, side="right") - 1, 0, self.pieces - 1)
        place = (at - whole - edges[own]) / np.diff(edges)[own]
        steps = (whole * self.pieces).astype(int) + own - piece
        return steps, _cardinal(self.local, place)

    def run(
        self,
        past: History,
        x0: F64,
        outside: Callable[[F64], F64],
        law: Callable[[int, F64, F64, F64], F64] | None,
        held: F64,
    ) -> tuple[F64, F64]:
        """March from t = 0.

        Parameters
        ----------
        past : callable
            States (state, time) before t = 0.
        x0 : ndarray, shape (state,)
        outside : callable
            Input (input, time) from outside, at any instant.
        law : callable or None
            Feedback: of the number of the sample, the state, and both results as far as they are; None: none.
        held : ndarray, shape (past, input)
            Feedback before t = 0, the sample before it last.

        Returns
        -------
        pieces : ndarray, shape (piece, node, state)
            From `back` intervals before t = 0 on.
        held : ndarray, shape (past + intervals + 1, input)
        """
        plant, dt, c = self.plant, self.dt, self.pieces
        n, first = len(x0), self.back * c
        total = first + self.intervals * c
        x = np.empty((total, len(self.local), n))
        starts = (np.arange(-self.back, self.intervals)[:, None] + self.edges[:-1]).ravel() * dt
        lengths = np.tile(np.diff(self.edges), self.back + self.intervals) * dt
        before = starts[:first, None] + lengths[:first, None] * self.local
        inside = np.minimum(before, -SAME * dt).ravel()
        x[:first] = past(inside).T.reshape(first, -1, n)
        times = starts[first:, None] + lengths[first:, None] * self.local[1:]
        middles = times.mean(axis=1, keepdims=True)
        seen = times + 1e-7 * (middles - times)  # of an input's jump the side on which the piece lies
        force = np.zeros((total - first, len(self.local) - 1, n))
        for lag, m in plant.b:
            force += (m @ outside((seen - lag).ravel())).T.reshape(force.shape)
        u = np.concatenate([held, np.zeros((self.intervals + 1, plant.shape[1]))])
        steps = [
            [int(np.floor(0.5 * (self.edges[s] + self.edges[s + 1]) - lag / dt)) for lag, _ in plant.b]
            for s in range(c)
        ]
        state = x0
        with np.errstate(over="ignore", invalid="ignore"):
            for k in range(self.intervals):
                if law is not None:
                    u[len(held) + k] = law(k, state, x, u)
                for s in range(c):
                    at = first + k * c + s
                    f = force[k * c + s]
                    for (back, weights), (_, m) in zip(self.reads[s], self.late, strict=True):
                        f = f + np.einsum("jq,jqn->jn", weights, x[at + back]) @ m.T
                    if law is not None:
                        for step, (_, m) in zip(steps[s], plant.b, strict=True):
                            f = f + m @ u[len(held) + k + step]
                    x[at, 0] = state
                    x[at, 1:] = (self.inverse[s] @ (f - self.pull[s] * state).ravel()).reshape(-1, n)
                    state = x[at, -1]
                if not np.all(np.isfinite(state)):
                    raise DataError(
                        f"simulating: the response overflows at t = {(k + 1) * dt:g} s; it is unstable: "
                        "simulate a shorter time, or with a feedback that stabilises it"
                    )
        if law is not None:
            u[-1] = law(self.intervals, state, x, u)
        return x, u

    def between(self, pieces: F64, past: History, intervals: int) -> History:
        """The state at any instant of the intervals that are done, and before."""
        edges, local, dt = self.edges, self.local, self.dt

        def state(t: ArrayLike) -> F64:
            t = np.atleast_1d(np.asarray(t, dtype=np.float64))
            place = t / dt
            if np.any(place > intervals * (1 + 1e-12) + SAME):
                raise SpecError(f"state: the trajectory ends at {intervals * dt:g} s")
            whole = np.clip(np.floor(place + SAME), 0, max(intervals - 1, 0))
            own = np.clip(np.searchsorted(edges, place - whole + SAME, side="right") - 1, 0, self.pieces - 1)
            x = pieces[((whole + self.back) * self.pieces).astype(int) + own]
            weights = _cardinal(local, (place - whole - edges[own]) / np.diff(edges)[own])
            found: F64 = np.einsum("jq,jqn->nj", weights, x)
            early = t < 0
            if early.any():
                found[:, early] = past(t[early])
            return found

        return state


def history(given: Any, count: int, what: str) -> History:
    """A past: zero, constant, or a function of an array of instants, (channel, time)."""
    if callable(given):

        def called(t: F64) -> F64:
            found = np.asarray(given(t), dtype=np.float64)
            found = np.broadcast_to(found[None] if found.ndim == 1 and count == 1 else found, (count, t.size))
            if not np.all(np.isfinite(found)):
                raise DataError(f"simulating: the {what} is not finite before t = 0")
            return found

        try:
            called(np.array([-1e-9, 0.0]))
        except ValueError as error:
            if isinstance(error, DataError):
                raise
            raise SpecError(
                f"simulating: the {what}, a function of an array of instants, must give ({count}, time): "
                f"{error}"
            ) from None
        return called
    values = np.zeros(count) if given is None else np.atleast_1d(reals("simulating", what, given))
    if values.shape != (count,) or not np.all(np.isfinite(values)):
        raise SpecError(
            f"simulating: the {what} has shape {values.shape}; give {count} finite number(s), or a function "
            f"of an array of instants that gives ({count}, time)"
        )
    return lambda t: np.repeat(values[:, None], np.size(t), axis=1)


def drive(source: Source, kind: str, grid: F64) -> Callable[[F64], F64]:
    """One input from outside at any instant; before t = 0 samples hold their first value."""
    if kind == "smooth" and not is_samples(source):
        return lambda t: evaluate(source, t)
    values = evaluate(source, grid)
    if kind == "zoh":
        step = grid[1] - grid[0]
        return lambda t: values[np.clip(np.floor(t / step + SAME), 0, len(values) - 1).astype(int)]
    if kind == "foh":
        return lambda t: np.interp(t, grid, values)
    smooth = spline(grid, values)
    return lambda t: np.asarray(smooth(np.maximum(t, 0.0)))


def _edges(plant: Plant, dt: float) -> F64:
    """Ends of the pieces of a sampling interval, in parts of it."""
    own = [0.0]
    for _ in range(LEVELS):
        own += [o + lag / dt for o in own for lag, _ in plant.a]
        own = _apart(own)
    kinks = _apart([o + lag / dt for o in own for lag, _ in (*plant.b, (0.0, None))])
    size = sum(float(np.linalg.norm(m, 2)) for _, m in plant.a)
    longest = min(
        [*(lag / dt for lag, _ in plant.a if lag > 0), RESOLVED / (size * dt) if size else 1.0, 1.0]
    )
    edges = [0.0]
    for one, other in zip(kinks, [*kinks[1:], 1.0], strict=True):
        count = max(int(np.ceil((other - one) / longest - 1e-9)), 1)
        if count > MOST:
            raise SpecError(
                f"simulating: the shortest lag or the fastest motion, {longest * dt:.3g} s, is too short "
                f"beside the sampling interval {dt:g} s; sample faster, or leave out what is next to nothing"
            )
        edges += list(np.linspace(one, other, count + 1)[1:])
    return np.array(edges)


def _apart(places: list[float]) -> list[float]:
    """Fractions of an interval, rising, those that are the same once."""
    out: list[float] = []
    for place in sorted(p % 1.0 for p in places):
        if (not out or place - out[-1] > SAME) and place < 1 - SAME:
            out.append(place)
    return [0.0, *out[1:]] if out and out[0] < SAME else [0.0, *out]


def _radau(stages: int) -> F64:
    """Radau points of (0, 1], the right end among them."""
    from numpy.polynomial import legendre

    p = np.zeros(stages + 1)
    p[stages], p[stages - 1] = 1.0, 1.0  # roots of P_s + P_{s−1}: Radau's points with the left end
    found: F64 = np.sort(0.5 * (1 - legendre.legroots(p).real))
    found[-1] = 1.0
    return found


def _differentiation(nodes: F64) -> F64:
    """Derivatives of the cardinal polynomials at the nodes: (node, polynomial)."""
    gaps = nodes[:, None] - nodes + np.eye(nodes.size)
    w = 1 / np.prod(gaps, axis=1)
    d: F64 = w / w[:, None] / gaps
    return d - np.diag(d.sum(axis=1))


def _cardinal(nodes: F64, at: ArrayLike) -> F64:
    """Values of the cardinal polynomials, along the last axis."""
    gaps = nodes[:, None] - nodes + np.eye(nodes.size)
    apart = np.asarray(at)[..., None] - nodes
    others = np.where(np.eye(nodes.size, dtype=bool), 1.0, apart[..., None, :])
    found: F64 = np.prod(others / gaps, axis=-1)
    return found
