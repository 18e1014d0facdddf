"""Output error of equations whose hidden signals cannot be eliminated, which only simulates them."""

import modfun as mf
import numpy as np
import pytest

CHAIN = mf.Equation(["A' = -k1*A**2", "B' = k1*A**2 - k2*B"], outputs=["B"], hidden=["A"])
TRUE = {"k1": 0.5, "k2": 0.4}


def record(seed):
    y = CHAIN.model(TRUE).simulate(dt=0.1, intervals=200, initial_state=[0.0, 2.0])  # B, then A
    return mf.Record(y={"B": y + 0.01 * np.random.default_rng(seed).standard_normal(201)}, dt=0.1)


def test_a_fit_asks_for_the_hidden_signal_or_names_output_error():
    with pytest.raises(
        mf.SpecError, match=r"measure A, or fit the response .*output_error\(model, start="
    ) as e:
        mf.fit(record(0), CHAIN)
    assert "measure B''" not in str(e.value)
    assert "start={'k1': ..., 'k2': ...}" in str(e.value)


@pytest.mark.parametrize("seed", range(3))
def test_output_error_finds_parameters_and_hidden_initial_states(seed):
    found = mf.rivals.output_error(CHAIN, start={"k1": 0.8, "k2": 0.6}).solve(record(seed))
    for name, value in TRUE.items():
        assert abs(found.params[name] - value) < 3 * found.bse[name]
    assert found.initial_states[0] == pytest.approx([0.0, 2.0], abs=0.05)


def test_the_model_is_simulated_with_the_hidden_state():
    model = CHAIN.model(TRUE)
    assert model.states == ("B", "A")
    assert mf.simulate(model, duration=5.0, intervals=50, initial_state=[0.0, 2.0], nsr=0.0)["B"].max() > 0.5
