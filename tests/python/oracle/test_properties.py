"""Properties 1 and 2 of the modulating functions against integrals in the time domain (oracles only)."""

from math import comb

import numpy as np
import pytest

from oracle import banded, lines
from oracle.modulating import phi, real_functions

PERIOD = 3.0
NODES, WEIGHTS = np.polynomial.legendre.leggauss(120)
T = 0.5 * PERIOD * (NODES + 1)
W = 0.5 * PERIOD * WEIGHTS
OMEGA0 = 2 * np.pi / PERIOD


def signal(t, derivative=0):
    """A signal that is neither periodic nor at rest at either end, and its derivatives."""
    z = -0.4 + 1.7j
    return np.real((0.8 - 0.3j) * z**derivative * np.exp(z * t))


def fourier(m):
    return np.sum(W * signal(T) * np.exp(-1j * m * OMEGA0 * T)) / PERIOD


def difference(f, m, order):
    return sum((-1) ** (order - j) * comb(order, j) * f(m + j) for j in range(order + 1))


@pytest.mark.parametrize("order", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("m", [-3, 0, 1, 7])
def test_property_1(order, m):
    coefficients = [1.0, -0.7, 0.4, 1.3, -0.2, 0.9][: order + 1]  # degree = order, descending
    derivative = sum(c * signal(T, order - i) for i, c in enumerate(coefficients))
    integral = np.sum(W * phi(T, m, order, PERIOD) * derivative)
    differenced = difference(lambda k: np.polyval(coefficients, 1j * k * OMEGA0) * fourier(k), m, order)
    largest = 2**order * abs(np.polyval(coefficients, 1j * (abs(m) + order) * OMEGA0))
    assert differenced == pytest.approx(integral, abs=1e-14 * largest)


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("m", [0, 2, 5])
def test_property_2(order, m):
    factor = {-2: 0.3 - 0.1j, 0: 1.0, 1: 0.5j, 3: -0.2}
    values = sum(f * np.exp(1j * k * OMEGA0 * T) for k, f in factor.items())
    integral = np.sum(W * phi(T, m, order, PERIOD) * values * signal(T, order))
    convolved = sum(
        f * difference(lambda j: (1j * j * OMEGA0) ** order * fourier(j), m - k, order)
        for k, f in factor.items()
    )
    assert convolved == pytest.approx(integral, abs=1e-9)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_real_functions_vanish_with_their_derivatives_at_the_ends(order):
    k = np.arange(9.0)
    cosines, sines = real_functions(order, 8)
    for d in range(order):  # d-th derivatives of cos kω₀t and sin kω₀t at an end, in powers of ω₀
        assert np.abs(cosines @ np.real((1j * k) ** d)) == pytest.approx(0, abs=1e-12 * 8.0**d)
        assert np.abs(sines @ np.imag((1j * k) ** d)) == pytest.approx(0, abs=1e-12 * 8.0**d)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_the_extended_range_holds_every_real_function_and_the_reports_range_does_not(order):
    """Δⁿ from -⌊n/2⌋ spans the same functions as the Vandermonde construction: no information is lost."""
    top = 8 + order
    rng = np.random.default_rng(order)
    record = lines.Record(rng.normal(size=65), rng.normal(size=(1, 65)), 0.1, ("smooth",))
    whole = banded.Differenced(record, order, [0], 8)
    short = banded.Differenced(record, order, [0], 8, extended=False)
    for rows, functions in zip((whole.re, whole.im), real_functions(order, top), strict=True):
        rows = rows[np.any(rows != 0, axis=1)]
        assert (
            functions.shape[0]
            == np.linalg.matrix_rank(rows)
            == np.linalg.matrix_rank(np.vstack([rows, functions]))
        )
    missing = whole.re.shape[0] + whole.im.shape[0] - short.re.shape[0] - short.im.shape[0]
    assert missing == order - 1
