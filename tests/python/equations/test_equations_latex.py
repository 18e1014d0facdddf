"""Equations as LaTeX: with the names of parameters, and with estimates in their places."""

import re

import modfun as mf
import pytest


def _lines(text):
    first, *rows, last = text.split("\n")
    assert (first, last) == (r"\begin{aligned}", r"\end{aligned}")
    return rows


@pytest.mark.parametrize(
    ("text", "words", "rows"),
    [
        ("y'' + d*y' + a*y + b*y**3 = u", {}, [r"\ddot{y} + a y + b y^{3} + d \dot{y} &= u"]),
        (
            "x' = V*u**n/(K**n + u**n) - d*x",
            {"outputs": ["x"], "inputs": ["u"]},
            [r"\dot{x} &= - d x + \frac{V u^{n}}{K^{n} + u^{n}}"],
        ),
        (
            ["v' = v - v**3/3 - w + I", "w' = b*(v - c*w)"],
            {"outputs": ["v"], "hidden": ["w"]},
            [r"\dot{v} &= I + v - w - \frac{v^{3}}{3} \\", r"\dot{w} &= b \left(v - c w\right)"],
        ),
        ("y' + k_1*y(t - h) = u", {}, [r"\dot{y} + k_{1} y\left(t - h\right) &= u"]),
        (
            ["hare' = r*hare - b1*hare*lynx", "lynx' = -de*lynx"],
            {"outputs": ["hare", "lynx"]},
            [
                r"\dot{\mathrm{hare}} &= r \mathrm{hare} - b_{1} \mathrm{hare} \mathrm{lynx} \\",
                r"\dot{\mathrm{lynx}} &= - \mathrm{de} \mathrm{lynx}",
            ],
        ),
        ("y' + c(t)*y = u", {"varying": {"c": ["1", "t"]}}, [r"\dot{y} + y c{\left(t \right)} &= u"]),
    ],
)
def test_equations_are_written_with_the_names_of_parameters(text, words, rows):
    model = mf.Equation(text, **words)
    assert _lines(model.to_latex()) == rows
    assert model._repr_latex_() == f"$${model.to_latex()}$$"


@pytest.mark.parametrize(
    ("text", "row"),
    [
        ("y' + a*y - b*y**2 = c*u", r"\dot{y} - 1.2 y + 0.5 y^{2} &= -0.4 u"),
        ("y' = -a*y + a**2*sin(b*y)", r"\dot{y} &= \left(-1.2\right)^{2} \sin{\left(-0.5 y \right)} + 1.2 y"),
        ("y' = b*(a + y)", r"\dot{y} &= -0.5 \cdot \left(-1.2 + y\right)"),
        ("y' = a*y/2 + u*d*e1", r"\dot{y} &= \frac{-1.2 y}{2} + 0.10 \left(3 \cdot 10^{-7}\right) u"),
    ],
)
def test_numbers_keep_their_signs_and_do_not_run_together(text, row):
    numbers = {"a": "-1.2", "b": "-0.5", "c": "-0.4", "d": "0.10", "e1": r"3 \cdot 10^{-7}"}
    model = mf.Equation(text, outputs=["y"], inputs=["u"] if "u" in text else [])
    assert _lines(model.to_latex(numbers)) == [row]


def test_a_fit_writes_its_estimates_to_two_digits_of_their_errors():
    system = mf.tf([1.0], [1, 0.4, 2.0])
    rec = mf.simulate(system, input="sin(t**2/5)", duration=20.0, intervals=400, nsr=0.05, seed=1)
    fit = mf.fit(rec, mf.Equation("y'' + d*y' + a*y = b*u", params={"b": 1.0}))
    row = _lines(fit.to_latex())[0]
    found = re.fullmatch(r"\\ddot\{y\} \+ ([\d.]+) y \+ ([\d.]+) \\dot\{y\} &= 1 u", row)
    assert found is not None
    for number, name in zip(found.groups(), "ad", strict=True):
        assert abs(float(number) - fit[name]) <= 0.05 * fit.bse[name]
    rational = mf.fit(rec, mf.TransferFunction(poles=2))
    assert rational.to_latex().startswith(r"G(s) = \frac{")
