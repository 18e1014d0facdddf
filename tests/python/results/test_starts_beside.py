"""Candidates that need a search begin at the estimates, also beside a fit that needed none."""

from __future__ import annotations

import modfun as mf
import numpy as np
import pytest
from modfun.fitting import of_equations, signs, single
from modfun.fitting.single import fit_quietly
from modfun.models.options import Options
from modfun.results.refits import starts_beside

TEXT = "y' + a*y = b*u"
LAGGED = "extra*y'' + (1 + extra*a)*y' + a*y = b*u"


@pytest.fixture
def rec() -> mf.Record:
    u = np.repeat([1.0, -1.0, 0.0, 1.0, 0.0, -1.0], 60)
    y = np.ravel(mf.tf([-2.0], [1, 0.5], delay=1.0).simulate(u=u, dt=0.1, intersample="zoh"))
    return mf.Record(
        y=y + 0.05 * np.random.default_rng(0).standard_normal(y.size), u=u, dt=0.1, intersample="zoh"
    )


def test_a_lag_beside_linear_equations_begins_at_the_estimates(rec: mf.Record) -> None:
    fit = fit_quietly((rec,), mf.Equation(TEXT), Options())
    starts = dict(zip(("extra", "a", "b"), starts_beside(fit, mf.Equation(LAGGED))["starts"], strict=True))
    assert starts == {"a": fit["a"], "b": fit["b"], "extra": 0.0}
    assert starts_beside(fit, mf.Equation(TEXT + " + extra*y**2")) == {}  # needs no search


@pytest.mark.parametrize("begun", [False, True])
def test_a_gain_below_zero_asks_for_no_second_search(
    rec: mf.Record, monkeypatch: pytest.MonkeyPatch, begun: bool
) -> None:
    """Of two delays each took two thirds of a fit, and so it did for each of some thirty candidates."""
    model = mf.Equation("T*y' + y = K*u(t - d)", params={"d": mf.Free(min=0, max=3)})
    made = []

    def counted(*given, **words):
        made.append(given[1])
        return plain(*given, **words)

    plain = single.fit_equation
    monkeypatch.setattr(single, "fit_equation", counted)
    first = fit_quietly((rec,), model, Options(trend="constant"))
    assert first["K"] == pytest.approx(-4.0, rel=0.05)
    assert first["d"] == pytest.approx(1.0, abs=0.1)
    if begun:
        monkeypatch.setattr(signs, "_is_gain", lambda *_: False)
        made.clear()
        fit_quietly((rec,), model, Options(trend="constant"), starts=first.params.tolist())
    assert {one for one in made} == {model}


def friction() -> mf.Record:
    """A servo with friction, J = 0.5, b = 0.3, c = 0.8, v = 0.3, beside a little noise."""
    t = np.arange(1000) * 0.01
    u = sum(np.sin(2 * np.pi * k * t / 6 + k * k) for k in range(1, 9))
    w = np.zeros(t.size)
    for k in range(t.size - 1):
        x = w[k]
        for part in range(10):
            held = u[k] + (u[k + 1] - u[k]) * part / 10
            x += 0.001 * (held - 0.3 * x - 0.8 * np.tanh(x / 0.3)) / 0.5
        w[k + 1] = x
    noise = 0.01 * np.random.default_rng(0).standard_normal(t.size)
    return mf.Record(y={"w": w + noise}, u={"u": u}, dt=0.01, intersample="foh")


def test_beside_estimates_of_the_same_equations_no_other_start_is_tried(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Each refit tried 24 starts of its own, which took most of the time of a check."""
    model, own, asked = mf.Equation("J*w' + b*w + c*tanh(w/v) = u", inputs=["u"]), (friction(),), []

    def noted(*given, **words):
        asked.append(words["near"])
        return plain(*given, **words)

    plain = of_equations.TermsFitter
    monkeypatch.setattr(of_equations, "TermsFitter", noted)
    fit = fit_quietly(own, model, Options(harmonics=20))
    assert abs(fit["v"]) == pytest.approx(0.3, rel=0.1)
    beside = starts_beside(fit, model)
    assert beside["near"]
    asked.clear()
    again = fit_quietly(own, model, Options(harmonics=20), **beside)
    assert asked == [True]
    assert again.params == pytest.approx(fit.params, rel=1e-6)
    more = mf.Equation("J*w' + b*w + c*tanh(w/v) + d*w**3 = u", inputs=["u"])
    assert not starts_beside(fit, more)["near"]
