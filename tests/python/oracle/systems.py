"""Example systems and their exact responses: the oracle of simulation and the source of test records.

A system is (den, nums): the monic denominator and one numerator an input, powers descending.  Responses
are exact to rounding: matrix exponentials from SciPy and Gauss-Legendre nodes inside each sample.  Initial
states are (y, y', ...) of the free response at time zero.
"""

import numpy as np
from scipy.linalg import expm

# Example of the report, eq. (24): y'' + 3 y' + 8 y = 5 u, u = sin(t²/5), T = 10 s, N = 256 intervals.
EQ24 = ([1.0, 3.0, 8.0], [[5.0]])
# The benchmark of Rao and Garnier, (-6400 s + 1600)/(s⁴ + 5 s³ + 408 s² + 416 s + 1600), sampled every .01 s,
# noise at 10 dB of sd 10^(-10/20) times the standard deviation of the noise-free output.
RAO_GARNIER = ([1.0, 5.0, 408.0, 416.0, 1600.0], [[-6400.0, 1600.0]])


def chirp(t):
    """The report's input sin(t²/5)."""
    return np.sin(np.asarray(t) ** 2 / 5)


def prbs(clock=7):
    """Rao and Garnier's input, one period of 1023·clock samples, ±1.

    Ten-stage register, feedback from stages 10 and 7, all ones at the start, the last stage is the output.
    """
    register, out = [1] * 10, []
    for _ in range(1023):
        out.append(register[9])
        register = [register[9] ^ register[6], *register[:9]]
    return np.repeat(2.0 * np.array(out) - 1.0, clock)


def state_space(den, nums):
    """Observer canonical (A, B, C, D) of a system with common denominator."""
    den = np.asarray(den, float)
    n = den.size - 1
    a = np.eye(n, k=1)
    a[:, 0] = -den[1:]
    b, d = np.zeros((n, len(nums))), np.zeros((1, len(nums)))
    for k, num in enumerate(nums):
        full = np.concatenate([np.zeros(n + 1 - len(num)), num])
        d[0, k] = full[0]
        b[:, k] = full[1:] - full[0] * den[1:]
    return a, b, np.eye(1, n), d


def initial_state(a, c, derivatives):
    """State whose free response has the given y, y', ... at time zero."""
    observability = [c[0]]
    for _ in range(a.shape[0] - 1):
        observability.append(observability[-1] @ a)
    return np.linalg.solve(np.array(observability), np.asarray(derivatives, float))


def simulate(den, nums, inputs, dt, intervals, derivatives=None, held=None):
    """Return (y (N+1,), u (nu, N+1)) of the system from (y, y', ...) = `derivatives` (default: rest).

    `inputs` are functions of time; with `held`, an array (nu, N+1), its samples are held instead.
    """
    a, b, c, d = state_space(den, nums)
    t = dt * np.arange(intervals + 1)
    x, w = np.polynomial.legendre.leggauss(16)
    x, w = 0.5 * (x + 1), 0.5 * w
    if held is None:
        at = t[:-1, None] + dt * x
        nodes = np.array([f(at) for f in inputs])  # (nu, N, 16)
        u = np.array([f(t) for f in inputs], float)
    else:
        u = np.asarray(held, float)
        nodes = np.repeat(u[:, :-1, None], x.size, axis=2)
    kernels = np.array([dt * wq * expm(a * dt * (1 - xq)) @ b for xq, wq in zip(x, w, strict=True)])
    drive = np.einsum("qnj,jkq->kn", kernels, nodes)
    phi = expm(a * dt)
    state = np.zeros(a.shape[0]) if derivatives is None else initial_state(a, c, derivatives)
    y = np.empty(intervals + 1)
    for k in range(intervals):
        y[k] = (c @ state)[0]
        state = phi @ state + drive[k]
    y[-1] = (c @ state)[0]
    return y + (d @ u)[0], u


def random_system(rng, order, zeros=0, inputs=1):
    """A stable system with modes spread over .5 to 4 rad/s.

    Pairs of damping .1 to .8, for odd orders a real pole; numerators of degree `zeros`, peak gains near one.
    """
    pairs = order // 2
    grid = np.exp(np.linspace(np.log(0.5), np.log(4.0), max(pairs + order % 2, 2)))
    omega = grid * np.exp(rng.uniform(-0.08, 0.08, grid.size))
    den = np.array([1.0])
    for w in omega[:pairs]:
        den = np.polymul(den, [1.0, 2 * rng.uniform(0.1, 0.8) * w, w * w])
    if order % 2:
        den = np.polymul(den, [1.0, omega[-1]])
    nums = []
    for _ in range(inputs):
        num = np.array([1.0])
        for _ in range(zeros):
            num = np.polymul(num, [1.0, rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 4.0)])
        peak = np.max(np.abs(np.polyval(num, 1j * grid) / np.polyval(den, 1j * grid)))
        nums.append(list(num * rng.uniform(0.7, 1.4) / peak))
    return list(den), nums


def random_inputs(rng, count, low=0.15, high=6.0, tones=14):
    """Smooth inputs of unit rms: sums of tones that are not lines of the record, random phases."""
    out = []
    for _ in range(count):
        omega = np.exp(rng.uniform(np.log(low), np.log(high), tones))
        phase = rng.uniform(0, 2 * np.pi, tones)

        def tone_sum(t, omega=omega, phase=phase):
            return np.sum(np.sin(np.multiply.outer(t, omega) + phase), axis=-1) / np.sqrt(tones / 2)

        out.append(tone_sum)
    return out


def parameters(den, nums):
    """θ of a system: a1..an, then each numerator, powers descending."""
    return np.concatenate([den[1:], *nums])
