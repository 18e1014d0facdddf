"""Undeclared inputs before a free delay, which makes up for half a sample: fits tell what is open."""

import warnings

import modfun as mf
import numpy as np
import pytest


def quiet(*args, **words):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return mf.fit(*args, **words)


@pytest.mark.parametrize("held", [True, False])
def test_a_free_delay_is_asked_how_the_input_goes(held):
    """A multisine of a converter without a filter: half a sample of delay, and nothing was said."""
    t, k = np.arange(901), np.arange(1, 40)
    u = 0.25 * np.cos(2 * np.pi * np.outer(t / 900, k) - np.pi * k * (k - 1) / 39).sum(axis=1)
    plant = mf.tf([2.5], [400, 50, 1], delay=8.0)
    y = plant.simulate(u=u, dt=1.0, intersample="zoh" if held else "smooth").ravel()
    late = mf.TransferFunction(poles=2, zeros=0, delay=mf.Free(min=0, max=20))
    for seed in range(5):
        noisy = 10 + y + 0.05 * y.std() * np.random.default_rng(seed).standard_normal(901)
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # neither is beyond doubt
            fit = mf.fit(mf.Record(y=noisy, u=u, dt=1.0), late)
        assert fit.intersample == ("smooth",)
        said = str(fit.check())
        assert "Held, as by a computer, it fits about as well (BIC" in said
        both = [quiet(mf.Record(y=noisy, u=u, dt=1.0, intersample=w), late) for w in ("zoh", "smooth")]
        now, was = (f"{one['delay']:.4g} ± {one.bse['delay']:.2g}" for one in both)
        assert f"delay is {now} instead of {was}" in said
        assert abs(both[not held]["delay"] - 8) < 4 * both[not held].bse["delay"]
        assert "Nobody declared" not in str(both[1].check())


def test_half_a_sample_of_a_free_delay_is_doubted_from_one_standard_error_on():
    """The sweep of an autopilot: below three, the delay was read half a sample late, and nothing was said."""
    t = 0.02 * np.arange(701)
    u = 5 * np.sin(2 * np.pi * 0.2 * 13 / np.log(20) * np.expm1(t / 13 * np.log(20)))
    y = mf.tf([240], [1, 6], delay=0.06).simulate(u=u, dt=0.02, intersample="zoh").ravel()
    late = mf.TransferFunction(poles=1, zeros=0, delay=mf.Free(min=0, max=0.3))
    for seed in range(3):
        noisy = y + 60 * np.random.default_rng(seed).standard_normal(t.size)
        fit = quiet(mf.Record(y=noisy, u=u, dt=0.02), late)
        assert 0.01 < 3 * fit.bse["delay"] < 0.03
        assert "Held, as by a computer, it fits about as well" in str(fit.check())
