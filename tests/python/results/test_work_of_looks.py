"""Looks that nobody asked for end by counted work, and a printed line says where they did."""

import modfun as mf
import numpy as np
import pytest
from modfun.base.effort import Effort, Spent, spend
from modfun.equations import integration
from modfun.results import slow_noise
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


def test_a_loop_in_slow_noise_needs_no_cures_of_the_fit_without_weights(monkeypatch):
    """Cures of a fit that weights make needless took 4 to 14 s, where the fit itself took 0.1 s."""
    rng = np.random.default_rng(2)
    count, h, integral, w = 1800, 50.0, 40.0, 0.0
    r = 50 + 5 * np.repeat(rng.choice([-1.0, 1.0], count // 150), 150)
    y, u = np.zeros(count), np.zeros(count)
    for k in range(count):
        y[k] = h + 0.15 * rng.standard_normal()
        integral += 0.02 * (r[k] - y[k])
        u[k] = 1.2 * (r[k] - y[k]) + integral
        w = 0.99 * w + 0.2 * rng.standard_normal()
        h += 0.02 * ((u[k - 6] if k >= 6 else 40.0) - 40 + w)
    rec = mf.Record(y=y, u=u, dt=1.0, intersample="zoh", keep={"r": r})
    model = mf.TransferFunction(poles=1, zeros=0, delay=mf.Free(min=0, max=20), params={"a1": 0.0})
    plain, asked = slow_noise.settles_otherwise, []

    def noted(fit):
        asked.append(fit.options.reference)
        return plain(fit)

    monkeypatch.setattr(slow_noise, "settles_otherwise", noted)
    with pytest.warns(mf.ModfunWarning, match='reference="r", noise="coloured"'):
        mf.fit(rec, model)
    assert not any(asked)
