"""The estimators against independent twins: orders of the rules, eq. (19), SciPy on the lines."""

from dataclasses import replace

import numpy as np
import pytest
from core_fit import fit, relative, standard_errors
from oracle import banded, lines, systems
from sample_records import THETA24, eq24, random_record

ORDERS = {"staircase": 1, "trapezoid": 2, "parabolic": 4, "gregory": 5}


@pytest.mark.parametrize("method", ["ls", "wls", "awls", "ml"])
@pytest.mark.parametrize(("rule", "order"), ORDERS.items())
def test_noise_free_errors_fall_at_the_order_of_the_rule(rule, order, method):
    errors = [
        relative(fit(eq24(n, (1.0, 0.5)), 2, [0], method=method, rule=rule, harmonics=6)["theta"], THETA24)
        for n in ((512, 1024, 2048) if rule == "gregory" else (128, 256, 512))
    ]
    slopes = np.log2(np.divide(errors[:-1], errors[1:]))
    assert slopes == pytest.approx(order, abs=0.4)


@pytest.mark.parametrize("extended", [True, False])
@pytest.mark.parametrize("rule", ORDERS)
@pytest.mark.parametrize(
    ("order", "numerators"), [(1, [0]), (2, [0]), (2, [1, 0]), (3, [2, None, 1]), (4, [2])]
)
def test_ls_is_the_reports_equation_19(order, numerators, rule, extended):
    record, _ = random_record(order, order, min(1, order - 1), inputs=len(numerators), nsr=0.02)
    twin = banded.ls(banded.Differenced(record, order, numerators, 12, extended, rule))
    found = fit(record, order, numerators, method="ls", rule=rule, extended=extended, harmonics=12)
    assert found["status"] == "ok"
    assert found["theta"] == pytest.approx(twin, rel=1e-10)


def ml_cases():
    """Orders 1 to 5, every number of zeros, one input and two, up to three records; trends, bands, ranges."""
    options = [
        {},
        {"trend": "constant"},
        {"trend": "linear"},
        {"extended": False},
        {"low": 2},
        {"rule": "trapezoid"},
        {"records": 2},
        {"records": 2, "trend": "constant", "inputs": 2},
        {"inputs": 2, "records": 3, "extended": False},
        {"inputs": 2, "trend": "linear"},
    ]
    cases = [(n, z) for n in range(1, 6) for z in range(n)]
    return [
        pytest.param(n, z, options[(3 * i + k) % 10], id=f"{n}-{z}-{i}{k}")
        for i, (n, z) in enumerate(cases)
        for k in (0, 1)
    ]


@pytest.mark.parametrize(("order", "zeros", "options"), ml_cases())
def test_ml_is_scipys_fit_with_an_explicit_transient(order, zeros, options):
    options = dict(options)
    inputs, count, low = options.pop("inputs", 1), options.pop("records", 1), options.pop("low", 0)
    records = several(order, zeros, inputs, count)
    degrees = [zeros] * inputs
    omega0 = [2 * np.pi / (r.dt * (r.y.size - 1)) for r in records]
    edge = 40.3 * omega0[0]
    tops = [int(edge / w) for w in omega0]
    problem = lines.Problem(records, order, degrees, tops, low, **options)
    found = fit(records, order, degrees, band=(max(low - 0.2, 0.0) * omega0[0], edge), **options)
    if count > 1:  # records over their levels have noise of one level
        levels = found["record_levels"]
        even = [replace(r, y=r.y / own, u=r.u / own) for r, own in zip(records, levels, strict=True)]
        problem = lines.Problem(even, order, degrees, tops, low, **options)
    expected = lines.result(problem, lines.ml(problem, found["theta"]))
    assert found["status"] == "ok"
    assert found["theta"] == pytest.approx(expected.theta, rel=1e-5)
    assert found["cost"] == pytest.approx(expected.cost, rel=1e-8)
    assert found["df_resid"] == expected.df
    assert standard_errors(found) == pytest.approx(np.sqrt(np.diag(expected.cov)), rel=1e-4)
    assert standard_errors(found, "hc3") == pytest.approx(np.sqrt(np.diag(expected.cov_hc3)), rel=1e-4)
    spectral = np.sqrt(np.diag(expected.cov_spectral))
    assert standard_errors(found, "spectral") == pytest.approx(spectral, rel=5e-3)  # four steps, not all
    assert found["df_spectral"] == pytest.approx(expected.df_spectral, rel=1e-2)
    # and it is the right minimum: SciPy's own start finds nothing lower
    own = lines.result(problem, lines.ml(problem))
    assert found["cost"] <= own.cost * (1 + 1e-8)


def several(order, zeros, inputs, count):
    """Records of one system: other inputs, initial states, noise, lengths and rates."""
    rng = np.random.default_rng([order, zeros, inputs, count])
    den, nums = systems.random_system(rng, order, zeros, inputs)
    out = []
    for i in range(count):
        intervals = 640 + 80 * i
        dt = 0.08 * (1 + 0.2 * i)
        drives = systems.random_inputs(rng, inputs, tones=24)
        y, u = systems.simulate(den, nums, drives, dt, intervals, rng.normal(size=order))
        noise = 0.003 * np.sqrt(np.mean(y**2)) * rng.normal(size=y.size)
        out.append(lines.Record(y + noise, u, dt, ("smooth",) * inputs))
    return out


@pytest.mark.parametrize("method", ["ls", "wls", "awls", "ml"])
def test_held_inputs_are_exact(method):
    """By their coefficients, and by what sampling folds into the output, the ends of the record included."""
    rng = np.random.default_rng(4)
    u = np.repeat(rng.choice([-1.0, 1.0], 65), 4)[None, :257]
    y, _ = systems.simulate(*systems.EQ24, None, 10 / 256, 256, (1.0, 0.5), held=u)
    # One-shot estimates of a wide band need more rounds than there are.
    for harmonics in (6, 60, 100) if method in ("awls", "ml") else (6,):
        found = fit(lines.Record(y, u, 10 / 256, ("zoh",)), 2, [0], method=method, harmonics=harmonics)
        assert relative(found["theta"], THETA24) < 1e-6
    wrong = fit(lines.Record(y, u, 10 / 256, ("foh",)), 2, [0], method=method, harmonics=6)
    assert relative(wrong["theta"], THETA24) > 1e-3


def test_equation_noise_is_the_wls_solution_but_for_ml():
    """The term log det A is `ml`'s alone; see tests/python/fitting/test_process_noise.py."""
    record, _ = random_record(3, 3, 1)
    words = {"noise": "equation", "harmonics": 15}
    first, second, other = (fit(record, 3, [1], method=m, **words) for m in ("wls", "awls", "ml"))
    assert first["theta"] == pytest.approx(second["theta"], rel=1e-9)
    assert relative(other["theta"], first["theta"]) > 1e-3
