"""What is computed on the lines equals generalised least squares on the differenced rows, errors included."""

import numpy as np
import pytest
from core_fit import fit, standard_errors
from oracle import banded, lines
from sample_records import random_record

STRUCTURES = [(1, [0]), (2, [0]), (2, [1, 0]), (3, [1]), (3, [2, None, 0])]


@pytest.mark.parametrize("method", ["ls", "wls", "awls", "ml"])
@pytest.mark.parametrize("extended", [True, False])
@pytest.mark.parametrize("harmonics", [6, 11])
@pytest.mark.parametrize(("order", "numerators"), STRUCTURES)
def test_lines_equal_the_differenced_form(order, numerators, harmonics, extended, method):
    zeros = max(d for d in numerators if d is not None)
    record, _ = random_record(10 * order + zeros, order, zeros, inputs=len(numerators), nsr=0.02)
    twin = banded.Differenced(record, order, numerators, harmonics, extended)
    options = {"extended": extended, "harmonics": harmonics, "tol": 1e-13, "maxiter": 500}
    found = fit(record, order, numerators, method=method, **options)
    assert found["theta"] == pytest.approx(getattr(banded, method)(twin), rel=1e-9)
    cost, df, cov = banded.covariance(twin, found["theta"], method)
    assert found["df_resid"] == df
    assert found["cost"] == pytest.approx(cost, rel=1e-9)
    assert standard_errors(found) == pytest.approx(np.sqrt(np.diag(cov)), rel=1e-8)


@pytest.mark.parametrize("method", ["ls", "wls", "awls", "ml"])
@pytest.mark.parametrize("extended", [True, False])
def test_hc3_is_the_formula_written_out(extended, method):
    record, _ = random_record(31, 3, 1, inputs=2, nsr=0.05)
    found = fit(record, 3, [1, 1], method=method, extended=extended, harmonics=12)
    problem = lines.Problem([record], 3, [1, 1], 15, extended=extended)
    if method == "ls":
        twin = banded.Differenced(record, 3, [1, 1], 12, extended)
        expected = lines.linear_result(problem, found["theta"], banded.on_lines(twin))
    else:
        expected = lines.result(problem, getattr(lines, method)(problem), method)
    assert found["cost"] == pytest.approx(expected.cost, rel=1e-8)
    assert found["cov_nonrobust"] == pytest.approx(expected.cov, rel=1e-5)
    if method == "ls":  # leverages of an oblique projection pass one: tempered, and so only near
        ratio = standard_errors(found, "hc3") / standard_errors(found)
        assert np.all((ratio > 0.3) & (ratio < 3))
    else:
        assert found["cov_hc3"] == pytest.approx(expected.cov_hc3, rel=1e-5)


def test_differenced_maximum_likelihood_is_that_of_levenberg_marquardt():
    record, _ = random_record(21, 2, 1, nsr=0.1)
    twin = banded.Differenced(record, 2, [1], 10)
    assert banded.ml(twin) == pytest.approx(banded.levenberg_marquardt(twin), rel=1e-6)
