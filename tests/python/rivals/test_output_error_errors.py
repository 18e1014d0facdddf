"""Output error: errors of direct calls and of studies, chaos, parameters that only scale hidden signals."""

import pickle

import modfun as mf
import numpy as np
import pytest
from modfun.rivals import output_error

TWO = mf.TransferFunction(poles=2, zeros=0)
SYSTEM = mf.tf([5], [1, 3, 8])
LORENZ = mf.Equation(
    ["x' = s*(y - x)", "y' = x*(r - z) - y", "z' = x*y - b*z"], outputs=["x", "y"], hidden=["z"]
)
PREY = mf.Equation(["x' = a*x - b*x*z", "z' = -c*z + d*x*z"], outputs=["x"], hidden=["z"])


def test_a_call_has_the_errors_of_solve():
    rec = mf.simulate(SYSTEM, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=1)
    found, solved = output_error(TWO)(rec), output_error(TWO).solve(rec)
    for name in ("a1", "a2", "b0"):
        assert found.bse[name] == pytest.approx(solved.bse[name], rel=0.02)
    assert "'a1': 3.0094 ± 0.057" in repr(found)
    assert output_error(TWO, start=found)(rec)["a1"] == pytest.approx(found["a1"], abs=1e-4)
    assert pickle.loads(pickle.dumps(found)).bse == found.bse


def test_studies_count_the_intervals_of_output_error():
    """Of 200 intervals of 95 %, fewer than 180 hold the truth once in 1,000 studies."""
    study = mf.MonteCarlo(
        system=SYSTEM, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.2, seed=1, replicates=200,
        estimators={"rival": output_error(TWO)},
    )  # fmt: skip
    assert np.all(study.run(progress=False).coverage[0] >= 0.9)


def test_chaos_is_cut_into_pieces():
    """Over 10 s of Lorenz's system no step lowered the criterion, from what the fit's warning advises."""
    truth = {"s": 10.0, "r": 28.0, "b": 8 / 3}
    clean = LORENZ.model(truth).simulate(dt=0.01, intervals=1000, initial_state=[-8.0, 8.0, 27.0])
    noise = 0.02 * clean.std(axis=1, keepdims=True) * np.random.default_rng(0).normal(size=clean.shape)
    rec = mf.Record(y=clean + noise, dt=0.01, outputs=["x", "y"])
    with pytest.warns(mf.ModfunWarning, match=r"mf.rivals.output_error\(model, start=dict\(fit.params\)\)"):
        fit = mf.fit(rec, LORENZ)
    found = output_error(LORENZ, start=dict(fit.params)).solve(rec)
    assert found.pieces == 4
    assert found.simulated[0].shape == rec.y.shape
    assert found.noise_cov[0].shape == (2, 2)
    for name, value in truth.items():
        assert abs(found.params[name] - value) < 3.5 * found.bse[name]


def test_a_parameter_that_scales_a_hidden_signal_is_left_out_as_in_fits():
    model = mf.Equation(list(PREY.texts), outputs=["x", "z"]).model({"a": 1.0, "b": 0.5, "c": 1.0, "d": 0.4})
    clean = model.simulate(dt=0.05, intervals=400, initial_state=[3.0, 1.0])[0]
    rec = mf.Record(y=clean + 0.1 * np.random.default_rng(0).normal(size=clean.size), dt=0.05, outputs=["x"])
    fit = mf.fit(rec, PREY)
    found = output_error(PREY, start=dict(fit.params)).solve(rec)
    assert set(found.params) == {"a", "c", "d"}
    for name, value in {"a": 1.0, "c": 1.0, "d": 0.4}.items():
        assert abs(found.params[name] - value) < 3.5 * found.bse[name]
