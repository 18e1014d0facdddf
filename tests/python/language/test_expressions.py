"""Texts, functions and samples as signals."""

import math

import modfun as mf
import numpy as np
import pytest
from modfun.signals.sources import evaluate, sources

T = np.linspace(0.0, 10.0, 257)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("sin(t**2/5)", np.sin(T**2 / 5)),
        ("-2*exp(-t/3)*cos(2*pi*t) + 1", -2 * np.exp(-T / 3) * np.cos(2 * np.pi * T) + 1),
        ("step(t - 2) - step(t - 5)", ((T >= 2) & (T < 5)).astype(float)),
        ("(1 < t < 3)*t", np.where((T > 1) & (T < 3), T, 0.0)),
        ("(1 < 2 < t)*t", np.where(T > 2, T, 0.0)),
        ("where(t > 4, sqrt(t), abs(-t))", np.where(T > 4, np.sqrt(T), T)),
        ("min(t, 3) + max(t % 2, 1) + sign(t - 5)", np.minimum(T, 3) + np.maximum(T % 2, 1) + np.sign(T - 5)),
        ("tanh(log(t + e)) + tan(0.1)", np.tanh(np.log(T + np.e)) + np.tan(0.1)),
        ("3", np.full(T.size, 3.0)),
    ],
)
def test_text_equals_numpy(text, expected):
    np.testing.assert_allclose(evaluate(text, T), expected, rtol=1e-15, atol=1e-15)


def test_function_of_arrays_and_of_single_times():
    np.testing.assert_array_equal(evaluate(np.sin, T), np.sin(T))
    np.testing.assert_allclose(evaluate(lambda t: math.sin(t), T), np.sin(T), rtol=1e-15)
    np.testing.assert_array_equal(evaluate(lambda t: 1.0 if t > 5 else 0.0, T), (T > 5) * 1.0)
    np.testing.assert_array_equal(evaluate(lambda t: 2.0, T), np.full(T.size, 2.0))


def test_samples_pass_through():
    np.testing.assert_array_equal(evaluate(T**2, T), T**2)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("__import__('os').system('true')", "__import__"),
        ("t.__class__", "t.__class__"),
        ("open(t)", "'open' is not a known function"),
        ("sin(x)", "'x' is not a known name"),
        ("sin", "write sin"),
        ("t^2", "is written \\*\\*"),
        ("sin(t, t)", "sin takes 1"),
        ("[t]", "is not part of the language"),
        ("'t'", "is not part of the language"),
        ("lambda: t", "is not part of the language"),
        ("1j*t", "a product is written with"),
        ("True", "is not part of the language"),
        ("t == 1", "unknown comparison"),
        ("t // 2", "unknown operator"),
        ("sin(t", "allowed are t"),
        ("", "allowed are t"),
        ("t = 3", "allowed are t"),
        ("sin(t=3)", "'=' stands where an operator"),
        ("1" + "0" * 400, "1e308"),
        ("-" * 500 + "t", "nested"),
        ("(" * 900 + "t" + ")" * 99, "allowed are t|characters"),
        ("t+" * 600 + "t", "characters"),
    ],
)
def test_refused_text_names_the_token_and_what_is_allowed(text, said):
    with pytest.raises(mf.SpecError, match=said):
        evaluate(text, T)


def test_huge_powers_are_cheap_and_refused_as_not_finite():
    with pytest.raises(mf.DataError, match="inf at t = 0"):
        evaluate("9**9**9**9", T)


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("1/t", "inf at t = 0 s"),
        ("log(t - 20)", "nan at t = 0 s"),
        (np.ones(5), "N\\+1 samples"),
        (lambda t: t[:-1], "shape"),
        (lambda t: {}[t], "raised"),
        (["a", "b"], "text; give real numbers"),
        (object(), "cannot be read as numbers"),
        (np.where(T == 0, np.nan, T), "nan at t = 0 s"),
    ],
)
def test_refused_values(source, said):
    with pytest.raises(mf.DataError, match=said):
        evaluate(source, T)


def test_one_source_an_input():
    assert sources("t", 1) == ["t"]
    assert sources(["t", np.sin], 2) == ["t", np.sin]
    assert len(sources(np.ones((3, 5)), 3)) == 3
    assert np.size(sources([1.0, 2.0], 1)[0]) == 2
    with pytest.raises(mf.SpecError, match="2 input"):
        sources("t", 2)
