"""An output of which only derivatives act has no offset to look for."""

import warnings

import modfun as mf
import numpy as np


def test_a_position_of_a_sticking_servo_is_looked_at() -> None:
    """The look for an offset asked for the parameter that had vanished: "A part of this check failed"."""
    rng, step = np.random.default_rng(0), 0.0005
    u = np.repeat(rng.choice([-3.0, 3.0], 81), 25)[:2000]
    rate, position = 0.0, np.zeros(2000)
    for k in range(1, 40 * 2000):
        rate += step * 4 * (20 * u[k // 40] - 10 * np.sign(rate) - rate)
        if k % 40 == 0:
            position[k // 40] = position[k // 40 - 1] + 40 * step * rate
    y = np.round(position / 0.00628) * 0.00628
    rec = mf.Record(y=y, u=u, dt=0.02, outputs="p", intersample="zoh")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.ModfunWarning)
        found = mf.fit(rec, mf.Equation("p'' + a*p' = b*u", outputs=["p"])).check()
    assert len(found) > 0
    assert not any("failed" in text for text in found)
