"""Example systems with general terms, their noise-free records and true parameters: nothing but SciPy."""

from types import SimpleNamespace

import numpy as np
from scipy.integrate import solve_ivp

from .terms import Term


def _one(v, t, theta):
    return 1.0


def _channel(c):
    return lambda v, t, theta: v[c]


def _parameter(i):
    return lambda theta: theta[i]


def linear(coefficient, order, channel=0, equation=0):
    """coefficient(θ) p^order v_channel."""
    return Term(coefficient, order, _channel(channel), {channel: _one}, equation)


def known(coefficient, function, equation=0):
    """coefficient(θ) times a function of time."""
    return Term(coefficient, 0, lambda v, t, theta: function(t), {}, equation)


def _unit(theta):
    return 1.0


def _minus(theta):
    return -1.0


def response(rhs, x0, period, intervals):
    """States (n, N+1) at equal steps."""
    t = np.linspace(0, period, intervals + 1)
    return solve_ivp(rhs, (0, period), x0, t_eval=t, rtol=1e-10, atol=1e-12).y


def duffing(intervals=1024):
    """y'' + .3 y' + y + .5 y³ = u, three tones, from (.5, 0), 20 s."""

    def u(t):
        return 2 * np.sin(1.1 * t) + 1.5 * np.sin(2.3 * t + 1) + np.sin(0.45 * t)

    terms = [
        linear(_unit, 2),
        linear(_parameter(0), 1),
        linear(_parameter(1), 0),
        Term(_parameter(2), 0, lambda v, t, theta: v[0] ** 3, {0: lambda v, t, theta: 3 * v[0] ** 2}),
        known(_minus, u),
    ]

    def rhs(t, x):
        return [x[1], u(t) - 0.3 * x[1] - x[0] - 0.5 * x[0] ** 3]

    v = response(rhs, [0.5, 0.0], 20.0, intervals)[:1]
    return SimpleNamespace(
        terms=terms, v=v, t=np.linspace(0, 20, intervals + 1), u=u, true=np.array([0.3, 1.0, 0.5])
    )


def predator_and_prey(intervals=600):
    """x' = a x - b x z, z' = -c z + d x z from (2, 1), 12 s."""
    a, b, c, d = true = np.array([1.0, 0.5, 1.2, 0.6])

    def both(coefficient, equation):
        slopes = {0: lambda v, t, theta: v[1], 1: lambda v, t, theta: v[0]}
        return Term(coefficient, 0, lambda v, t, theta: v[0] * v[1], slopes, equation)

    terms = [
        linear(_unit, 1, 0, 0),
        linear(lambda theta: -theta[0], 0, 0, 0),
        both(_parameter(1), 0),
        linear(_unit, 1, 1, 1),
        linear(_parameter(2), 0, 1, 1),
        both(lambda theta: -theta[3], 1),
    ]

    def rhs(t, x):
        return [a * x[0] - b * x[0] * x[1], -c * x[1] + d * x[0] * x[1]]

    v = response(rhs, [2.0, 1.0], 12.0, intervals)
    return SimpleNamespace(terms=terms, v=v, t=np.linspace(0, 12, intervals + 1), true=true)


def elevator(t):
    """3-2-1-1 of half seconds, edges of .1 s, from t = 1 s."""
    edges = 1.0 + 0.7 * np.array([0, 3, 5, 6, 7])
    signs = np.array([1, -2, 2, -2, 1]) * 0.05
    return np.sum(signs * 0.5 * (1 + np.tanh((np.asarray(t)[..., None] - edges) / 0.05)), axis=-1)


def short_period(intervals=600):
    """α' = Zα α + q + Zδ δ, q' = Mα α + Mq q + Mδ δ: two equations that share noisy signals, 12 s."""
    za, zd, ma, mq, md = true = np.array([-0.8, -0.1, -4.0, -1.2, -5.0])

    def negative(i):
        return lambda theta: -theta[i]

    terms = [
        linear(_unit, 1, 0, 0),
        linear(negative(0), 0, 0, 0),
        linear(_minus, 0, 1, 0),
        known(negative(1), elevator, 0),
        linear(_unit, 1, 1, 1),
        linear(negative(2), 0, 0, 1),
        linear(negative(3), 0, 1, 1),
        known(negative(4), elevator, 1),
    ]

    def rhs(t, x):
        de = elevator(t)
        return [za * x[0] + x[1] + zd * de, ma * x[0] + mq * x[1] + md * de]

    v = response(rhs, [0.02, 0.0], 12.0, intervals)
    return SimpleNamespace(terms=terms, v=v, t=np.linspace(0, 12, intervals + 1), u=elevator, true=true)
