"""Looks that nobody asked for end by counted work, and a printed line says where they did."""

import modfun as mf
import numpy as np
import pytest
from modfun.base.effort import Effort, Spent, spend
from modfun.equations import integration
from scipy.integrate import solve_ivp


def test_work_counts_in_all_contexts_it_is_in():
    spend(1e9)  # nobody counts
    with Effort(2.0) as outer:
        with pytest.raises(Spent), Effort(1.0):
            spend(1.5)
        assert outer.left == pytest.approx(0.5)
        with pytest.raises(Spent), Effort(1.0):
            spend(0.75)
        assert outer.left < 0
    assert not Effort.limited()


def test_a_stiff_candidate_takes_no_minutes(monkeypatch):
    """This right fit took 0.1 s, and what was looked for beside it 4 minutes: 200,000 steps at a time."""
    steps = []

    def counted(*given):
        steps.append(given[-1])
        return plain(*given)

    plain = integration.core_integrate
    t = np.arange(0, 40.001, 0.1)
    model = mf.Equation("s' = b*feed - V*s/(K+s)", outputs=["s"], inputs=["feed"])

    def feed(at):
        return 0.6 + 0.4 * np.sin(0.5 * at) + 0.3 * np.sin(1.3 * at + 1)

    found = solve_ivp(
        lambda at, s: feed(at) - 1.5 * s / (0.3 + s), (0, t[-1]), [1.5], "DOP853", t, rtol=1e-10, atol=1e-12
    )
    s = found.y[0]
    noise = np.random.default_rng(108).standard_normal((1, t.size))[0]
    rec = mf.Record(y={"s": s + 0.03 * np.sqrt(np.mean(s**2)) * noise}, u={"feed": feed(t)}, dt=0.1)
    monkeypatch.setattr(integration, "core_integrate", counted)
    fit = mf.fit(rec, model)
    assert sum(steps) < 5e6
    assert "check() looks further" in repr(fit)
    for name, value in {"b": 1.0, "V": 1.5, "K": 0.3}.items():
        assert abs(fit[name] - value) < 4 * fit.bse[fit.param_names.index(name)]
