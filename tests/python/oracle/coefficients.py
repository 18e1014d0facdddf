"""Fourier coefficients of sampled signals by naive sums: the oracle of quadrature and spectrum.

V(m) = (1/T) ∫ v(t) exp(-i m ω₀ t) dt over the window, ω₀ = 2π/T (report, eq. (8)), every sum written out
term by term.  Rules: staircase, trapezoid and parabolic (report, eqs (21a)-(21c)) and Gregory with four
end weights.  Held inputs ("zoh", "foh") are integrated cell by cell with Gauss-Legendre nodes, which at
twelve nodes a cell is exact to rounding, whatever the delay; no closed formula is used.
"""

import itertools
from fractions import Fraction

import numpy as np

RULES = ("staircase", "trapezoid", "parabolic", "gregory")
HOLDS = ("zoh", "foh")


def gregory_end_weights():
    """Return the four end weights 1 + c_j as fractions.

    Euler-Maclaurin: the corrections c_0..c_3 need Σ c_j j^p = B_{p+1}/(p+1), p = 0..3, for cubics to be
    integrated exactly (B_1 = -1/2, B_2 = 1/6, B_3 = 0, B_4 = -1/30).
    """
    moments = [Fraction(-1, 2), Fraction(1, 12), Fraction(0), Fraction(-1, 120)]
    system = [[*(Fraction(j**p) for j in range(4)), moments[p]] for p in range(4)]
    for i in range(4):  # Gauss-Jordan in exact arithmetic
        pivot = next(r for r in range(i, 4) if system[r][i] != 0)
        system[i], system[pivot] = system[pivot], system[i]
        system[i] = [x / system[i][i] for x in system[i]]
        for r in range(4):
            if r != i:
                system[r] = [a - system[r][i] * b for a, b in zip(system[r], system[i], strict=True)]
    return [1 + system[j][4] for j in range(4)]


def weights(rule, intervals):
    """Return the N+1 weights of `rule` in units of the sampling interval."""
    w = np.ones(intervals + 1)
    if rule == "staircase":
        w[-1] = 0.0
    elif rule == "trapezoid":
        w[0] = w[-1] = 0.5
    elif rule == "parabolic":
        if intervals % 2:
            raise ValueError("the parabolic rule needs an even number of intervals")
        w[1::2] = 4 / 3
        w[::2] = 2 / 3
        w[0] = w[-1] = 1 / 3
    elif rule == "gregory":
        ends = np.array([float(x) for x in gregory_end_weights()])
        w[:4], w[-4:] = ends, ends[::-1]
    else:
        raise ValueError(rule)
    return w


def unit_variance(rule, intervals):
    """Variance of a coefficient under white noise of unit variance: Σ w²/N², of Re V(0), or of |V(m)|."""
    w = weights(rule, intervals)
    return w @ w / intervals**2


def coefficients(v, harmonics, kind="gregory", delay=0.0, lead=0):
    """Return V(0..harmonics) of `v`, `delay` samples late, in the window starting at sample `lead`."""
    v = np.asarray(v, float)
    intervals = v.size - 1 - lead
    if kind in HOLDS:
        return _held(v, harmonics, kind, delay, lead)
    shifted = v[lead:] if delay == 0 else _interpolate(v, np.arange(lead, v.size) - delay)
    w = weights(kind, intervals) * shifted
    k = np.arange(intervals + 1)
    turns = [(m * k % intervals) / intervals for m in range(harmonics + 1)]  # reduced exactly, in integers
    return np.array([np.sum(w * np.exp(-2j * np.pi * x)) / intervals for x in turns])


def _interpolate(v, positions):
    """Local six-point Lagrange interpolation at fractional sample positions."""
    out = np.empty(positions.size)
    for i, x in enumerate(positions):
        first = int(np.clip(np.floor(x) - 2, 0, v.size - 6))
        nodes = range(first, first + 6)
        out[i] = sum(v[a] * np.prod([(x - b) / (a - b) for b in nodes if b != a]) for a in nodes)
    return out


def _held(v, harmonics, kind, delay, lead):
    last = v.size - 1
    intervals = last - lead
    breaks = np.unique(np.clip(np.concatenate([np.arange(v.size) + delay, [lead, last]]), lead, last))
    x, w = np.polynomial.legendre.leggauss(12)
    out = np.zeros(harmonics + 1, complex)
    m = np.arange(harmonics + 1)
    for left, right in itertools.pairwise(breaks):
        at = 0.5 * (left + right) + 0.5 * (right - left) * x
        cell = int(np.floor(0.5 * (left + right) - delay))
        fraction = at - delay - cell
        value = np.full(12, v[cell]) if kind == "zoh" else v[cell] * (1 - fraction) + v[cell + 1] * fraction
        phase = np.exp(-2j * np.pi * np.outer(m, at - lead) / intervals)
        out += 0.5 * (right - left) / intervals * phase @ (w * value)
    return out
