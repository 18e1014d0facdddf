"""Unstable estimates of stable plants with dead time give way to the stable twin that fits as well."""

from __future__ import annotations

from dataclasses import replace

import modfun as mf
import numpy as np
import pytest
from modfun.fitting.mirrored import mirrored

LATE = mf.TransferFunction(poles=2, zeros=0, delay=mf.Free(min=0, max=36))
PLANT = mf.tf([2.5 / 900], [1, 75 / 900, 1 / 900], delay=12)  # 60 s and 15 s


def stepped(seed: int) -> mf.Record:
    """A step of 10 at 40 s, noise of 1 on a rise of 25."""
    u = np.where(np.arange(300) < 40, 0.0, 10.0)
    y = PLANT.simulate(u=u, dt=1.0, intersample="zoh")
    return mf.Record(y + np.random.default_rng(seed).standard_normal(300), u, dt=1.0, intersample="zoh")


def test_plants_with_dead_time_are_stable() -> None:
    seeds = (0, 1, 7, 12, 15)  # the last three had unstable estimates
    found = [mf.fit(stepped(seed), LATE, initial_state="rest") for seed in seeds]
    assert max(float(fit.model.poles().real.max()) for fit in found) < 0
    off = [abs(fit["delay"] - 12) / fit.bse["delay"] for fit in found]
    assert np.median(off) < 1.5


def of_system(fit: mf.Fit, system: mf.LTI) -> mf.Fit:
    return replace(fit, params=fit.params.__class__(LATE.theta(system), fit.param_names))


def test_a_mirrored_pole_has_a_shorter_delay_and_the_same_gain() -> None:
    fit = mf.fit(stepped(0), LATE, initial_state="rest", band=(0, 0.3))
    den = [1, 1 / 60 - 1 / 15, -1 / 900]
    unstable = of_system(fit, mf.tf([-2.5 / 900], den, delay=42 - 1e-9))
    assert mirrored(unstable) == pytest.approx([75 / 900, 1 / 900, 2.5 / 900, 12.0])
    assert mirrored(fit) is None


def test_a_plant_that_a_loop_can_hold_has_no_twin() -> None:
    fit = mf.fit(stepped(0), LATE, initial_state="rest", band=(0, 0.3))
    held = of_system(fit, mf.tf([2.5 / 900], [1, 1 / 60 - 1 / 15, -1 / 900], delay=14))  # below 1/p = 15 s
    assert mirrored(held) is None
