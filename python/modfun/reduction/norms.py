"""Sizes of frequency responses: a grid that resolves them, the H2 and the H-infinity norm."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..base.arrays import C128, F64
from .gramians import Realisation

__all__ = ["Grid", "Response", "grid_for", "h2_norm", "hinf_norm", "largest_gain"]

Response = Callable[[F64], C128]  # omega -> (omega, output, input)

NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)
FINEST = 40  # halvings of a panel
MOST = 10_000  # panels
# A panel with less than this part of the integral holds rounding.
FAINT = 1e-18


@dataclass(frozen=True)
class Grid:
    """Frequencies with the weights of an integral over ω, and the response there.

    Attributes
    ----------
    omega : ndarray, shape (omega,)
        Ascending, rad/s.
    share : ndarray, shape (omega,)
        ∫ f dω ≈ Σ share f, over the band or from 0 to infinity.
    response : ndarray of complex, shape (omega, output, input)
    """

    omega: F64
    share: F64
    response: C128


def grid_for(response: Response, low: float, high: float, below: bool = True, above: bool = True) -> Grid:
    """Panels of eight Gauss nodes, halved until ∫‖G‖² is settled in each.

    Parameters
    ----------
    response : callable
    low, high : float
        The edges, or where it begins and ends to be interesting, rad/s.
    below, above : bool, default True
        Whether the panels from 0 to low and from high to infinity belong to it.
    """
    octaves = max(int(np.ceil(np.log2(high / low))), 1)
    edges = np.geomspace(low, high, octaves + 1)
    # Between frequencies f the variable is f itself, above the highest it is 1/f.
    panels = [(a, b, False) for a, b in pairwise(edges)]
    panels += [(0.0, low, False)] if below else []
    panels += [(0.0, 1 / high, True)] if above else []
    kept: list[_Part] = []
    total = 0.0
    current = _parts(response, panels)
    for depth in range(FINEST + 1):
        total = max(total, sum(one.power for one in current) + sum(one.power for one in kept))
        halves = []
        for one in current:
            # The nodes of one rule tell little of themselves; the rule of every other node is coarser.
            error = abs(one.power - one.coarse)
            settled = error <= 1e-8 * total and error <= max(1e-3 * one.power, FAINT * total)
            if settled or depth == FINEST or len(kept) + len(current) > MOST:
                kept.append(one)
            else:
                a, b, inverse = one.panel
                middle = (a + b) / 2
                halves += [(a, middle, inverse), (middle, b, inverse)]
        if not halves:
            break
        current = _parts(response, halves)
    omega = np.concatenate([one.omega for one in kept])
    order = np.argsort(omega)
    share, gains = (np.concatenate(parts)[order] for parts in zip(*[one[2:4] for one in kept], strict=True))
    return Grid(omega[order], share, gains)


Panel = tuple[float, float, bool]


class _Part(NamedTuple):
    """A panel with its nodes, and the integral over it by all of them and by every other one."""

    panel: Panel
    omega: F64
    share: F64
    gains: C128
    power: float
    coarse: float


def _nodes(panel: Panel) -> tuple[F64, F64]:
    a, b, inverse = panel
    x = (a + b) / 2 + (b - a) / 2 * NODES
    share = (b - a) / 2 * WEIGHTS
    return (1 / x, share / x**2) if inverse else (x, share)


def _parts(response: Response, panels: list[Panel]) -> list[_Part]:
    nodes = [_nodes(panel) for panel in panels]
    gains = response(np.concatenate([omega for omega, _ in nodes]))
    squares = np.sum(np.abs(gains) ** 2, axis=(1, 2)).reshape(len(panels), -1)
    share = np.array([own for _, own in nodes])
    power, coarse = ((weights * squares).sum(axis=1).tolist() for weights in (share, share * COARSE))
    return [
        _Part(panel, *own, *rest)
        for panel, own, *rest in zip(panels, nodes, np.split(gains, len(panels)), power, coarse, strict=True)
    ]


def _coarse_weights() -> F64:
    """Weights of the polynomial of degree 6 through all nodes but two, zero at these."""
    kept = [0, 1, 2, 4, 6, 7]
    powers = np.vander(NODES[kept], increasing=True).T
    exact = [(1 - (-1) ** (k + 1)) / (k + 1) for k in range(len(kept))]
    found = np.zeros(NODES.size)
    found[kept] = np.linalg.solve(powers, exact)
    return found / WEIGHTS


COARSE = _coarse_weights()


def h2_norm(system: Realisation) -> float:
    """√(1/2π ∫ tr G*G dω) from the Gramian; inf where it does not exist."""
    from scipy.linalg import solve_continuous_lyapunov

    if np.any(system.d) or np.any(system.poles.real >= 0):
        return float("inf")
    if system.order == 0:
        return 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of poles nearly on the axis; the norm is as large
        gramian = solve_continuous_lyapunov(system.a, -system.b @ system.b.T)
    return float(np.sqrt(max(np.trace(system.c @ gramian @ system.c.T), 0.0)))


def largest_gain(gains: C128) -> F64:
    """Largest singular value on each line."""
    if 1 in gains.shape[1:]:
        return np.asarray(np.linalg.norm(gains.reshape(gains.shape[0], -1), axis=1))
    unit = float(np.max(np.abs(gains), initial=0.0)) or 1.0
    own = gains / unit if gains.shape[1] <= gains.shape[2] else gains.transpose(0, 2, 1) / unit
    squares = np.linalg.eigvalsh(own @ own.conj().transpose(0, 2, 1))[:, -1]
    return np.asarray(unit * np.sqrt(squares), dtype=np.float64)


def hinf_norm(response: Response, omega: F64, gains: C128, light: F64) -> tuple[float, float]:
    """The largest gain over all frequencies and where it is: a grid, its highest peaks refined.

    Parameters
    ----------
    response : callable
    omega, gains : ndarray
        Frequencies fine enough to show each peak but the light ones, and the response there.
    light : ndarray
        More frequencies to look at.
    """
    from scipy.optimize import minimize_scalar

    more = np.append(0.0, light)
    omega, first = np.unique(np.concatenate([omega, more]), return_index=True)
    sizes = np.concatenate([largest_gain(gains), largest_gain(response(more))])[first]
    inner = np.flatnonzero((sizes[1:-1] >= sizes[:-2]) & (sizes[1:-1] >= sizes[2:])) + 1
    peak = int(np.argmax(sizes))
    best, at = float(sizes[peak]), float(omega[peak])
    for k in inner[np.argsort(-sizes[inner])][:8]:
        if sizes[k] < 0.5 * best:
            continue
        found = minimize_scalar(
            lambda w: -float(largest_gain(response(np.array([w])))[0]),
            bounds=(omega[k - 1], omega[k + 1]),
            method="bounded",
            options={"xatol": 1e-9 * omega[k]},
        )
        if -found.fun > best:
            best, at = float(-found.fun), float(found.x)
    return best, at
