"""Records joined end to end: found by the jump of an output that no input makes, and silence elsewhere."""

from __future__ import annotations

import modfun as mf
import numpy as np
import pytest
import scipy.integrate
from two_signals import signals

LIGHT = mf.tf([1], [1, 0.2, 1])


def flown(text: str, seed: int, state: list[float]) -> mf.Record:
    told = {"duration": 10.0, "intervals": 256, "nsr": 0.02, "seed": seed}
    return mf.simulate(LIGHT, input=text, **told, initial_state=state)


def joined(seed: int) -> mf.Record:
    first, second = flown("sin(t**2/5)", seed, [0.8, 0.0]), flown("sin(t**2/7+1)", 100 + seed, [-0.8, 0.3])
    return mf.Record(y=np.r_[first["y"], second["y"]], u=np.r_[first["u"], second["u"]], dt=10 / 256)


def test_the_joint_is_named_with_the_pieces() -> None:
    """In all of 20 records, with the time after which the second begins."""
    for seed in range(20):
        (said,) = [text for text in joined(seed).check() if "jumps" in text]
        assert "after t = 10 s, and no input does" in said
        assert "[rec.window(0, 10), rec.window(10.0391, 20.0391)]" in said


def test_a_fit_shows_it_among_its_doubts() -> None:
    with pytest.warns(mf.ModfunWarning, match="Output 'y' jumps"):
        fit = mf.fit(joined(0), mf.TransferFunction(poles=2, zeros=0))
    assert any("Output 'y' jumps" in str(doubt) for doubt in fit.check())
    pieces = [joined(0).window(0, 10), joined(0).window(10.04, 20.04)]
    right = mf.fit(pieces, mf.TransferFunction(poles=2, zeros=0))
    assert right.params == pytest.approx([0.2, 1.0, 1.0], abs=0.03)
    assert not any("jumps" in str(doubt) for doubt in right.check())


@pytest.mark.parametrize("nsr", [0.0, 0.02, 0.2])
def test_silent_on_steps_feed_through_spikes_and_noise(nsr: float) -> None:
    """500 records of normal noise, 5 systems; a false alarm takes a difference of 7 standard deviations."""
    systems = [
        LIGHT,
        mf.tf([5], [1, 3, 8]),
        mf.tf([1, 0.1], [1, 1]),
        mf.tf([1, 0, 2], [1, 1, 4]),
        mf.tf([1], [1, 0]),
    ]
    steps = "1*(t>1) - 2*(t>5) + 1.5*(t>9)"
    for k, system in enumerate(systems):
        rng = np.random.default_rng(k)
        for input_, hold in ((steps, "zoh"), ("sin(t**2/5)", "smooth")):
            clean = mf.simulate(system, input=input_, duration=20.0, intervals=400, intersample=hold)
            for _ in range(50):
                y = clean["y"] + nsr * clean["y"].std() * rng.standard_normal(401)
                assert not any("jumps" in text for text in clean.assign(y=y).check())
    y, u = signals()
    y = y.copy()
    y[200] += 5 * y.std()
    assert not any("jumps" in text for text in mf.Record(y=y, u=u, dt=0.02).check())


OSCILLATORS = {
    "Brusselator": (
        lambda t, v: [1 + v[0] ** 2 * v[1] - 4 * v[0], 3 * v[0] - v[0] ** 2 * v[1]],
        [1, 1],
        0.05,
    ),
    "Rossler": (lambda t, v: [-v[1] - v[2], v[0] + 0.2 * v[1], 0.2 + v[2] * (v[0] - 5.7)], [1, 1, 1], 0.1),
    "van der Pol": (lambda t, v: [v[1], 5 * (1 - v[0] ** 2) * v[1] - v[0]], [2, 0], 0.05),
    "a sharper one": (lambda t, v: [v[1], 10 * (1 - v[0] ** 2) * v[1] - v[0]], [2, 0], 0.1),
    "Lotka-Volterra": (lambda t, v: [v[0] - 0.5 * v[0] * v[1], 0.5 * v[0] * v[1] - v[1]], [8, 0.3], 0.1),
}


@pytest.mark.parametrize("name", OSCILLATORS)
def test_flanks_of_relaxation_oscillators_are_no_joints_but_cuts_of_them_are(name: str) -> None:
    """Flanks were named in 8 of 8 records of the first two, and cut records are named as before."""
    motion, start, dt = OSCILLATORS[name]
    t = dt * np.arange(601)
    clean = scipy.integrate.solve_ivp(motion, (0, t[-1]), start, t_eval=t, rtol=1e-8, atol=1e-9).y
    for seed, nsr in enumerate([0.0, 0.003, 0.01, 0.03]):
        rng = np.random.default_rng(seed)
        y = clean + nsr * clean.std(axis=1, keepdims=True) * rng.standard_normal(clean.shape)
        assert not any("jumps" in text for text in mf.Record(y=y, dt=dt).check())
        last = 200 + int(np.argmax(np.abs(clean[0, 200:350] - clean[0, 400])))
        cut = mf.Record(y=np.c_[y[:, : last + 1], y[:, 400:]], dt=dt)
        said = [text for text in cut.check() if "jumps" in text]
        if name != "a sharper one":  # its flanks are as fast as jumps, and as large as this one
            assert f"after t = {dt * last:.6g} s" in said[0]
