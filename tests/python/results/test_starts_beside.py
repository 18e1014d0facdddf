"""Candidates that need a search begin at the estimates, also beside a fit that needed none."""

from __future__ import annotations

import modfun as mf
import numpy as np
import pytest
from modfun.fitting import signs, single
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
