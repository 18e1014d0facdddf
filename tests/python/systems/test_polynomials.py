"""Roots with their derivatives and companion forms, in every unit of time."""

import numpy as np
import pytest
from modfun.systems.polynomials import companion, root_slopes, time_unit

UNITS = [1e-9, 1.0, 1e60]  # rad/s


@pytest.mark.parametrize("unit", UNITS)
def test_derivatives_of_roots_are_those_of_a_product(unit):
    roots = unit * np.array([-2.0, -0.3 + 1.5j, -0.3 - 1.5j, -7.0])
    found, slopes = root_slopes(4.0 * np.poly(roots).real)
    near = [np.argmin(np.abs(found - r)) for r in roots]
    np.testing.assert_allclose(found[near], roots, rtol=1e-13)
    for at, r in zip(near, roots, strict=True):
        others = np.prod(r / unit - np.delete(roots / unit, np.flatnonzero(roots == r)))
        want = [-((r / unit) ** k) / (4.0 * others) * unit ** (k - 3.0) for k in range(4, -1, -1)]
        np.testing.assert_allclose(slopes[at], want, rtol=1e-12)


def test_a_root_at_zero_and_leading_zeros_have_derivatives():
    found, slopes = root_slopes(np.array([0.0, 1.0, 3.0, 0.0]))  # s² + 3s and a term of s³
    np.testing.assert_allclose(found, [0.0, -3.0])
    np.testing.assert_allclose(slopes, [[0, 0, 0, -1 / 3], [-9.0, 3.0, -1.0, 1 / 3]], atol=1e-15)


@pytest.mark.parametrize("unit", UNITS)
def test_a_companion_form_has_the_roots_of_its_polynomial(unit):
    monic = np.array([1.0, 3.0, 8.0]) * unit ** np.arange(3.0)
    assert time_unit(monic) == pytest.approx(3.0 * unit)
    np.testing.assert_allclose(companion(monic), [[0, 1], [-8 * unit**2, -3 * unit]])
    counted = companion(monic, time_unit(monic))
    np.testing.assert_allclose(np.poly(counted / unit), [1, 3, 8], rtol=1e-14)
    assert np.all(np.abs(counted) <= 3.0 * unit * (1 + 1e-15))


def test_the_unit_of_a_polynomial_without_one_is_the_given():
    assert time_unit(np.array([1.0, 0.0, 0.0])) == 1.0
    assert time_unit(np.array([1.0, 0.0]), 0.25) == 0.25
    assert companion(np.ones(1)).shape == (0, 0)
