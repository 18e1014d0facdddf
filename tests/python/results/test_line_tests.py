"""Statistics of residual lines against formulas written out."""

from __future__ import annotations

import numpy as np
import pytest
from modfun import _core
from modfun.results import line_tests
from oracle import line_tests as oracle
from scipy.special import chdtrc, kolmogorov


def records(sizes):
    rng = np.random.default_rng(sum(sizes))
    return [rng.standard_normal(n) + 1j * rng.standard_normal(n) for n in sizes]


@pytest.mark.parametrize("sizes", [(22,), (7,), (400,), (12, 12), (20, 9, 31)])
def test_statistics_are_those_of_the_formulas(sizes):
    e = records(sizes)
    lags = min(10, min(sizes) // 4)
    near, r = line_tests.correlation_of_lines(e)
    np.testing.assert_allclose(r, oracle.autocorrelation(e, lags), rtol=1e-10, atol=1e-14)
    assert near.statistic == pytest.approx(oracle.ljung_box(e, lags), rel=1e-10)
    assert near.p_value == pytest.approx(chdtrc(lags, near.statistic))
    level, ratio = line_tests.colour_of_lines(e)
    assert level.statistic == pytest.approx(oracle.distance(e), rel=1e-10)
    assert level.p_value == pytest.approx(kolmogorov(level.statistic * np.sqrt(sum(sizes) - 1)))
    power = oracle.power_in_order(e)
    half = power.size // 2
    assert ratio == pytest.approx(np.sqrt(power[:half].mean() / power[half:].mean()), rel=1e-10)
    share, cumulated = line_tests.cumulated_power(e)
    np.testing.assert_allclose(cumulated, np.cumsum(power) / power.sum())
    np.testing.assert_allclose(share, np.arange(1, power.size + 1) / power.size)


def test_lags_stop_at_the_shortest_record():
    assert line_tests.correlation_of_lines(records((5, 30)), lags=25)[1].size == 4


def test_lines_may_be_a_view_with_gaps():
    e = records((40,))[0]
    assert line_tests.colour_of_lines([e[::2]]) == line_tests.colour_of_lines([e[::2].copy()])


def test_what_cubics_do_not_foresee():
    x = np.random.default_rng(3).standard_normal(300) + 7.0
    assert _core.unforeseen(x) == pytest.approx(oracle.unforeseen(x), rel=1e-10)
    assert _core.unforeseen(x[::3]) == pytest.approx(oracle.unforeseen(x[::3]), rel=1e-10)
    assert _core.unforeseen(x[:4]) == _core.unforeseen(np.full(50, 0.1)) == 0.0


def test_one_sample_stands_out_of_its_channel():
    x = np.random.default_rng(3).standard_normal((2, 300))
    x[1, 120] += 50.0
    assert _core.sharpest(x) == pytest.approx(oracle.sharpest(x[1]), rel=1e-10)
    assert _core.sharpest(x[:1]) == pytest.approx(oracle.sharpest(x[0]), rel=1e-10)
    assert _core.sharpest(x[:, ::3]) == pytest.approx(max(map(oracle.sharpest, x[:, ::3])), rel=1e-10)
    assert _core.sharpest(x[:, :4]) == _core.sharpest(np.zeros((1, 50))) == 0.0
