"""A parameter that a likelihood without a parabola tells has its interval by the likelihood in the check."""

import modfun as mf
import numpy as np
import pytest
from scipy.integrate import solve_ivp

T = np.arange(0, 181, 1.0)
AT = [0, 2, 4, 6, 8, 10, 14, 19, 22, 24, 27, 30, 40, 50, 60, 80, 100, 120, 140, 160, 180]
INSULIN = [11, 26, 130, 85, 51, 49, 40, 35, 30, 30, 27, 30, 35, 22, 15, 15, 11, 10, 8, 11, 8]
BERGMAN = ["G' = -(SG + X)*G + SG*92", "X' = -p2*X + p3*(I - 11)"]


@pytest.fixture(scope="module")
def glucose():
    """Bergman's minimal model without noise: SG = 0.026, p2 = 0.025, p3 = 1.3e-5 per minute."""

    def rate(t, z):
        return [
            -(0.026 + z[1]) * z[0] + 0.026 * 92,
            -0.025 * z[1] + 1.3e-5 * (np.interp(t, AT, INSULIN) - 11),
        ]

    return solve_ivp(rate, (0, 180), [279.0, 0.0], t_eval=T, rtol=1e-8, atol=1e-10, max_step=1.0).y[0]


def _checked(glucose, seed, noise):
    y = glucose + noise * np.random.default_rng(seed).normal(size=T.size)
    u = np.interp(T, AT, INSULIN)
    rec = mf.Record(y=y, u=u, t=T, outputs=["G"], inputs=["I"], intersample="foh")
    model = mf.Equation(BERGMAN, outputs=["G"], inputs=["I"], hidden=["X"])
    return str(mf.fit(rec, model).check())


def test_an_interval_that_ends_elsewhere_than_the_likelihood_does_is_told(glucose):
    """The interval was 0.0049 to 0.0162 for 0.026, z = -5.8, and nothing wrong was found."""
    told = _checked(glucose, 201, 2.0)
    assert "SG is known to 25 % only" in told
    assert "0.00538 to 0.031 by the likelihood, and 0.0049 to 0.0162 by the standard error" in told


def test_a_parameter_that_is_known_well_has_the_interval_of_its_standard_error(glucose):
    assert "by the likelihood" not in _checked(glucose, 201, 0.1)
