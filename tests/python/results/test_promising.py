"""Which terms are tried first: one step on residual lines ranks them, and few are fitted."""

import modfun as mf
import numpy as np
import pytest
from flights import TRUTH, WRITTEN, flown, warned
from modfun.equations import integration
from modfun.fitting.single import fit_quietly
from modfun.models.options import Options
from modfun.results import cures, promising
from modfun.results.neighbours import neighbours
from scipy.integrate import solve_ivp

T = np.arange(0.0, 40.0, 0.05)


def _moved(rates, start, seed, noise=0.01):
    rng = np.random.default_rng(seed)
    parts = zip((2.0, 1.5, 1.0), (0.5, 1.1, 2.3), rng.uniform(0, 6, 3), strict=True)
    waves = [(size, omega, phase) for size, omega, phase in parts]

    def u(t):
        return sum(size * np.sin(omega * t + phase) for size, omega, phase in waves)

    found = solve_ivp(
        lambda t, x: rates(x, u(t)), (0, T[-1]), start, "DOP853", T, rtol=1e-8, atol=1e-10, max_step=0.5
    )
    y = found.y + noise * found.y.std(axis=1, keepdims=True) * rng.normal(size=found.y.shape)
    return y, u(T)


def _fitted(rec, model):
    """Without looks at it, which other tests are of."""
    return fit_quietly((rec,), model, Options())


def _first(fit):
    terms = tuple(key for _, _, key in next(iter(neighbours(fit)[1:]), ()) if key)
    falls = promising._falls(fit, terms)
    return max(falls, key=falls.__getitem__)


def _oscillator(name, x, u):
    bend = {"y**3": -3 * x[0] ** 3, "y**2*y'": -1.5 * x[0] ** 2 * x[1]}[name]
    return [x[1], u - (0.4 if name == "y**3" else -1.0) * x[1] - x[0] + bend]


@pytest.mark.parametrize("missing", ["y**3", "y**2*y'"])
def test_the_term_that_is_missing_comes_first(missing):
    for seed in range(4):
        y, u = _moved(lambda x, u: _oscillator(missing, x, u), [0.1, 0.0], seed)
        fit = _fitted(mf.Record(y=y[0], u=u, dt=0.05), mf.Equation("y'' + d*y' + a*y = u"))
        assert _first(fit) == ("term", "0", missing)


def _two(x, u):
    return [
        x[1], u - 0.4 * x[1] - 3 * x[0] + 1.5 * x[2] - x[0] ** 3,
        x[3], -2 * x[2] - 0.3 * x[3] + x[0] - x[2] ** 3,
    ]  # fmt: skip


def test_of_forty_terms_of_two_equations_few_are_fitted(monkeypatch):
    """What couples the equations is named by BIC as before, though half of the terms are never fitted."""
    fits = []

    def counted(fit, records, structure, *given, **how):
        fits.append(structure)
        return plain(fit, records, structure, *given, **how)

    plain = cures.again
    model = mf.Equation(["x'' = c*x + d*x' + e*u - k*x**3", "z'' = f*z + g*z' + h*x"], outputs=["x", "z"])
    y, u = _moved(_two, [0.0] * 4, 0)
    fit = _fitted(mf.Record(y={"x": y[0], "z": y[2]}, u=u, dt=0.05), model)
    keys = [key for _, _, key in neighbours(fit)[1]]
    assert len(keys) > promising.MOST + 15
    assert len(promising.promising(fit, keys)) == promising.MOST
    assert _first(fit) == ("term", "0", "z")
    monkeypatch.setattr(cures, "again", counted)
    monkeypatch.setattr(integration, "core_integrate", None)  # nothing is simulated
    found = cures._missing_term(fit)
    assert "a term in z in equation 1 (coefficient 1." in found.words
    assert len(fits) < len(keys)


def test_candidates_beside_linear_equations_are_not_simulated(monkeypatch):
    """Two flight conditions in one list: each of forty terms had its response taken out, 17 s."""
    calls = []

    def counted(*given):
        calls.append(1)
        return plain(*given)

    plain = integration.core_integrate
    monkeypatch.setattr(integration, "core_integrate", counted)
    text = warned([flown(2), flown(3, truth={**TRUTH, "Ma": -8.0, "Md": -10.0})], WRITTEN)[1]
    assert "The records disagree on the parameters" in text
    assert len(calls) < 600
