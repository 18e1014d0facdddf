"""Rivals of docs/rivals.md: exact conversions, own SRIVC finds the truth, the script writes a page."""

import subprocess
import sys

import numpy as np
import pytest
from places import ROOT
from scipy.signal import cont2discrete, lfilter

COMPARE = ROOT / "benches" / "compare"
sys.path.insert(0, str(COMPARE))

import problems  # noqa: E402
from rivals.discrete import continuous, orders  # noqa: E402
from rivals.srivc_numpy import Filters, Srivc  # noqa: E402


def every_problem():
    return [problems.report(), *([problems.rao_garnier()] if problems.DEFINITION.exists() else [])]


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_discrete_models_convert_back(hold):
    """SciPy's discretisation, and back."""
    for problem in every_problem():
        num, den = problem.system.num, problem.system.den
        b, f, _ = cont2discrete((num, den), problem.dt, method=hold)
        held = problems.Problem(
            problem.name, problem.system, problem.u, problem.dt,
            "zoh" if hold == "zoh" else "smooth", problem.zeros, problem.cutoff,
        )  # fmt: skip
        count, delay = orders(held)
        assert np.allclose(b[0, :delay], 0, atol=1e-12)
        assert count + delay == problem.poles + 1
        np.testing.assert_allclose(continuous(b[0], f, held), problem.truth, rtol=1e-6)


def test_a_pole_without_a_logarithm_is_refused():
    with pytest.raises(ArithmeticError, match="logarithm"):
        continuous([0, 1.0], [1.0, 0.5, -0.2], problems.report())


def test_filters_of_srivc_are_exact_for_linear_input():
    """Against SciPy's first-order hold of p^k/A, A = s² + 3s + 8."""
    v = np.random.default_rng(0).normal(size=50)
    got = Filters([3.0, 8.0], 0.05)(v, "foh")
    for power, num in ((0, [1.0]), (1, [1.0, 0.0])):
        b, f, _ = cont2discrete((num, [1.0, 3.0, 8.0]), 0.05, method="foh")
        # SciPy's filter has seen a ramp from 0 to v[0] before; a first sample of 0 leaves no difference.
        want = lfilter(np.ravel(b), f, np.concatenate([[0.0], v]))
        np.testing.assert_allclose(Filters([3.0, 8.0], 0.05)(np.concatenate([[0.0], v]), "foh")[power], want,
                                   atol=1e-12)  # fmt: skip
    assert got.shape == (2, 50)


@pytest.mark.statistics
@pytest.mark.parametrize("state", problems.STATES)
def test_own_srivc_is_at_the_bound(state):
    """200 records of eq. (24) at NSR .2: rms error within 20 % of the bound.

    The rms of 200 errors scatters by 5 %: four standard deviations, false alarm under .05 % for 3 parameters.
    """
    problem = problems.report()
    estimate = Srivc(problem)
    theta = np.array([estimate(problem.record(k, 0.2, state)) for k in range(200)])
    assert not problem.failed(theta).any()
    rms = np.sqrt(np.mean((theta - problem.truth) ** 2, axis=0))
    if state == "zero":
        np.testing.assert_allclose(rms, problem.bound(0.2), rtol=0.2)
    else:  # the initial state excites the system, too
        assert np.all(rms < 1.2 * problem.bound(0.2))


def test_failures_are_what_they_are_said_to_be():
    problem = problems.report()
    theta = [[3, 8, 5], [np.nan, 8, 5], [4.6, 8, 5], [3, 8, 2.4], [-3, 8, 5]]
    assert problem.failed(np.array(theta, dtype=float)).tolist() == [False, True, True, True, True]


def test_states_of_the_observer_form_have_the_output_first():
    for problem in every_problem():
        y = problem.record(3, 0.0, "zero").y[0]
        states = problem.record(3, 0.0, "zero", all_states=True).y
        np.testing.assert_allclose(states[0], y, rtol=0, atol=1e-9 * np.std(y))


@pytest.mark.process
def test_quick_run_writes_the_page(tmp_path):
    page = tmp_path / "rivals.md"
    command = [sys.executable, COMPARE / "accuracy.py", "--quick", "--workers", "1", "--out", page]
    run = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
    assert run.returncode == 0, run.stderr
    text = page.read_text()
    for problem in every_problem():
        assert f"**{problem.name}, in motion**" in text
    assert "pysid (left out by --quick)" in text
    for who in ("modfun ml", "SciPy output error", "SRIVC, NumPy"):
        assert f"| {who} |" in text
    assert "## Time per fit" in text
