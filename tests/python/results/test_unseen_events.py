"""Loads that nobody measured, which default fits follow, are named at their time; drifts are not."""

import re

import modfun as mf
import numpy as np
import pytest
from flights import warned
from modfun.fitting.single import fit_quietly
from modfun.models.options import Options
from modfun.results import unseen_events
from modfun.results.misfit import refuted, suspicious
from scipy.signal import lfilter

PLANT = mf.tf([0.8], np.polymul([120, 1], [25, 1]), delay=40)
LATE = mf.TransferFunction(poles=2, zeros=0, delay=mf.Free(min=0, max=120))


def process(seed, load=0.0, drift=0.0):
    """Two hours of moves of a valve every 400 s or so; a load steps through a lag of 80 s at t = 3700 s."""
    rng = np.random.default_rng(seed)
    moves = np.round(np.cumsum(rng.uniform(20, 60, 40))).astype(int)
    u = np.zeros(721)
    for move in moves[moves < 721]:
        u[move:] = rng.choice([-5.0, 0.0, 5.0])
    y = np.ravel(PLANT.simulate(u=u, dt=10, intersample="zoh"))
    a, t = np.exp(-10 / 80), 10.0 * np.arange(721)
    y = y + lfilter([1 - a], [1, -a], load * (t > 3700)) + drift * t / t[-1] + 0.1 * rng.standard_normal(721)
    return mf.Record(y=y + 30, u=u + 45, dt=10.0)


@pytest.mark.parametrize("seed", range(4))
def test_a_load_that_steps_is_named_at_its_time(seed):
    """Said was to raise maxiter, or that a fit was unstable or a delay on its bound, or nothing."""
    fit, text = warned(process(seed, load=2.0), LATE)
    found = re.search(r"From about t = ([\d.]+) s on something acts on y", text)
    assert float(found[1]) == pytest.approx(3700, abs=60)
    assert "hum" not in str(fit.check())


@pytest.mark.parametrize("seed", range(4))
def test_drifts_and_nothing_are_no_loads(seed):
    """False alarms of the test of events: one in 10,000."""
    assert warned(process(seed), LATE)[1] == ""
    assert "something acts" not in warned(process(seed, drift=2.0), LATE)[1]


def test_masked_records_are_not_fitted_in_coloured_noise_for_it(monkeypatch):
    """Lines of masked samples tell no event, and that fit took most of the time on grids of uneven rows."""
    rec = process(0, load=1.0)
    kept = np.arange(rec.t.size) % 7 > 0
    fit = fit_quietly((rec._like(mask=kept[None]),), LATE, Options())
    monkeypatch.setattr(unseen_events, "in_coloured_noise", lambda _: pytest.fail("it was made"))
    assert suspicious(fit)
    assert refuted(fit)
    assert unseen_events.unseen_event(fit) is None
