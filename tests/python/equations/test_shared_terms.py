"""Equations that share a rational term are combined: it stands once, where denominators free it."""

import modfun as mf
import numpy as np
import pytest

RATE = "mu*S/(Ks+S+S**2/Ki)"
HALDANE = [f"X' = {RATE}*X", f"S' = -q*{RATE}*X"]
TRUE = {"mu": 0.9, "Ks": 1.5, "Ki": 4.0, "q": 2.0}


def fitted(*texts, outputs=("X", "S"), **words):
    model = mf.Equation(list(texts), outputs=list(outputs), **words)
    return [line for line in str(model.explain()).split("\n* ") if line.startswith("Fitted:")], model


def test_growth_becomes_a_balance_and_parameters_leave_the_signals():
    (balance, kinetics), model = fitted(*HALDANE)
    assert balance == "Fitted: 1/q p [S] + p [X] = 0, p = d/dt."
    assert "[S*X]" in kinetics
    assert "/(" not in kinetics.replace("1/(3*Ki)", "")
    assert "Equation 1 was combined with equation 2" in str(model.explain())


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_order_of_equations_and_a_yield_below_change_nothing(order):
    texts = ["X' = mu*S/(Ks+S)*X - k*X", "S' = -mu*S/(Ks+S)*X/Y"]
    lines, _ = fitted(*(texts[k] for k in order))
    assert lines[order.index(0)] == "Fitted: Y p [S] + p [X] + k [X] = 0, p = d/dt."


def test_three_equations_keep_the_term_once():
    lines, _ = fitted(
        "X' = mu*S/(Ks+S)*X",
        "S' = -mu*S/(Ks+S)*X/Y",
        "P' = a*mu*S/(Ks+S)*X + b*X",
        outputs=("X", "S", "P"),
    )
    assert lines[2] == "Fitted: p [P] + Y*a p [S] - b [X] = 0, p = d/dt."


def test_a_term_that_no_denominator_frees_stays():
    lines, _ = fitted("X' = mu*S*X/(K*X+S)", "S' = -q*mu*S*X/(K*X+S)")
    assert all("S*X/(S + K*X)" in line for line in lines)


@pytest.mark.parametrize("seed", range(3))
def test_haldane_kinetics_as_in_the_textbook(seed):
    # At seed 1 mu was 8.7 standard errors off, and fits took up to 42 s.
    model = mf.Equation(HALDANE, outputs=["X", "S"])
    y = model.model(TRUE).simulate(dt=0.1, intervals=300, initial_state=[0.1, 10.0])
    size = 0.03 * y.std(axis=1, keepdims=True)
    y = y + size * np.random.default_rng(seed).standard_normal(y.shape)
    fit = mf.fit(mf.Record(y={"X": y[0], "S": y[1]}, dt=0.1), model)
    for name, value in TRUE.items():
        assert abs(fit[name] - value) < 3.5 * fit.bse[name]
        assert fit[name] == pytest.approx(value, rel=0.4)
