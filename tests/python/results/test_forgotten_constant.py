"""Nothing else is blamed where a model lacks a constant and its record has offsets."""

import modfun as mf
import numpy as np
from flights import warned
from modfun.results import cures

OVEN = mf.Equation("T*y' + y = K*u(t - d)", outputs="y", inputs="u", params={"d": mf.Free(min=20, max=60)})


def test_an_actuator_does_not_saturate_where_a_constant_is_missing(monkeypatch):
    """Limits of the input at its mean do what a constant does; they were tried for minutes."""
    rng = np.random.default_rng(0)
    u = 40 + 10 * np.repeat(rng.choice([-1.0, 1.0], 14), 30)[:400]
    plant = mf.tf([1.8], [300, 1], delay=40.0)
    y = 92 + np.ravel(plant.simulate(u=u - 40, dt=5.0, intersample="zoh")) + 0.15 * rng.standard_normal(400)
    fit, text = warned(mf.Record(y=y, u=u, dt=5.0, intersample="zoh"), OVEN)
    assert fit.at_bound
    assert 'Fit with trend="constant"' in text
    tried, plain = [], cures.again_at_all
    monkeypatch.setattr(
        cures, "again_at_all", lambda *words, **told: tried.append(words) or plain(*words, **told)
    )
    said = list(fit.check())
    assert 'Fit with trend="constant"' in said[0]
    assert not any("saturates" in one or "Part of the response" in one for one in said)
    assert len(tried) < 8
