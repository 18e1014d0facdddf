"""Terms of compiled models against the equations, by derivatives that SymPy takes of functions of time."""

from types import SimpleNamespace

import numpy as np
import pytest
import sympy
from modfun.equations.symbolic.compiled import Delayed, jet, time

t = time
D = sympy.diff


def smooth(rng):
    """A positive function of time with every derivative."""
    a, b, w, v, phase = rng.uniform([0.2, 0.1, 0.7, 2.0, 0.0], [0.5, 0.2, 1.2, 3.0, 3.0])
    return 1.5 + a * sympy.sin(w * t + phase) + b * sympy.cos(v * t)


def sums(compiled, given, values):
    """Σ g F p^k E of each equation, with functions of time for channels and numbers for parameters."""
    made = [sympy.S.Zero] * len(compiled.orders)
    for equation, value in parts(compiled, given, values):
        made[equation] += value
    return made


def parts(compiled, given, values):
    """The summands of `sums`, with the number of their equation."""
    numbers = {sympy.Symbol(name, real=True): value for name, value in values.items()}
    channels = {jet(name): value for name, value in given.items()}

    def at(expr):
        expr = expr.replace(Delayed, lambda y, h: given[y.name].subs(t, t - h))
        return expr.subs(channels).subs(numbers)

    for term in compiled.terms:
        factor = 1 if term.factor is None else at(term.factor)
        yield term.equation, at(term.coefficient) * factor * D(at(term.signal), t, term.order)


def identity(model, residuals, times=None):
    """Terms against the equations as they were written, at random instants and parameters.

    `residuals(f, p)` gives the equations as expressions in t, `times(f, p)` the multiplier.
    """
    compiled = model.compiled()
    rng = np.random.default_rng(20)
    for _ in range(2):
        given = {name: smooth(rng) for name in (*compiled.outputs, *compiled.inputs)}
        values = {name: float(rng.uniform(0.3, 0.9)) for name in compiled.parameters}
        f, p = SimpleNamespace(**given), SimpleNamespace(**values)
        wanted = residuals(f, p)
        wanted = wanted if isinstance(wanted, tuple) else (wanted,)
        scale = 1 if times is None else times(f, p)
        made = sums(compiled, given, values)
        for instant in rng.uniform(0, 5, 3):
            for left, right in zip(made, wanted, strict=True):
                theirs = float((sympy.sympify(right) * scale).subs(t, instant))
                assert float(left.subs(t, instant)) == pytest.approx(theirs, rel=1e-9, abs=1e-9)


def vanishes(model, states, motion):
    """Terms are zero along the motions of a system, from random states.

    `motion(x, u, p)` gives the rates of the states and the outputs, as dictionaries of expressions.
    Outputs are Taylor polynomials, from derivatives along the motion; inputs are polynomials in time.
    """
    compiled = model.compiled()
    rng = np.random.default_rng(21)
    for _ in range(2):
        values = {name: float(rng.uniform(0.3, 0.9)) for name in model.all_parameters}
        given = {name: np.polyval(rng.uniform(0.5, 1, 5), t) for name in compiled.inputs}
        x = {name: sympy.Symbol(f"state_{name}", positive=True) for name in states}
        rates, outputs = motion(*(SimpleNamespace(**some) for some in (x, given, values)))
        start = {s: float(rng.uniform(0.5, 1.5)) for s in x.values()}
        for name, value in outputs.items():
            series, rate = sympy.S.Zero, sympy.sympify(value)
            for k in range(max(compiled.orders) + 1):
                series += rate.subs(t, 0).subs(start) * t**k / sympy.factorial(k)
                rate = D(rate, t) + sum(D(rate, x[n]) * slope for n, slope in rates.items())
            given[name] = series
        made = [(equation, float(part.subs(t, 0))) for equation, part in parts(compiled, given, values)]
        for equation in range(len(compiled.orders)):
            own = [value for e, value in made if e == equation]
            assert abs(sum(own)) < 1e-9 * max(map(abs, own))
