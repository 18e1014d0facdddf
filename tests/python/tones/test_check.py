"""What check() finds of tones: each kind of doubt where it is due, and false alarms at the stated rate."""

from __future__ import annotations

from collections.abc import Callable

import modfun as mf
import numpy as np
import pytest

DT, N = 0.01, 256
T = DT * np.arange(N)
TWO = 2 * np.cos(63 * T + 0.3) + np.sin(75 * T) + 5
Noise = np.random.Generator


def coloured(rng: Noise, pole: float = 0.8) -> np.ndarray:
    e = rng.standard_normal(N + 100)
    for i in range(1, e.size):
        e[i] += pole * e[i - 1]
    return e[100:]


def spiky(rng: Noise) -> np.ndarray:
    return np.where(rng.random(N) < 0.05, 3.0, 0.2) * rng.standard_normal(N)


CASES: dict[str, tuple[int, Callable[[Noise], np.ndarray], str, int]] = {
    "too many": (3, lambda rng: TWO + 0.5 * rng.standard_normal(N), "no larger than peaks of noise", 90),
    "too few": (1, lambda rng: TWO + 0.5 * rng.standard_normal(N), "may be a further tone", 100),
    "decays": (
        1,
        lambda rng: 2 * np.exp(-T) * np.cos(63 * T) + 0.3 * rng.standard_normal(N),
        "Fit with damped=True",
        100,
    ),
    "moves": (
        1,
        lambda rng: 2 * np.cos(63 * T + T**2) + 0.3 * rng.standard_normal(N),
        "does not keep its frequency",
        100,
    ),
    "colour": (
        2,
        lambda rng: 2 * np.cos(31.4 * T) + 2 * np.cos(251 * T) + 0.3 * coloured(rng),
        "on which its standard errors rest",
        90,
    ),
    "close": (
        1,
        lambda rng: 2 * np.cos(63 * T) + np.cos(64.2 * T + 6 * rng.random()) + 0.2 * rng.standard_normal(N),
        "further tone",
        90,
    ),
    "spikes": (2, lambda rng: TWO + spiky(rng), "Leave them out", 100),
}


@pytest.mark.parametrize("case", CASES)
def test_what_is_due_is_found(case: str) -> None:
    count, samples, text, least = CASES[case]
    found = [
        text in mf.sinusoids(mf.Record(y=samples(np.random.default_rng(seed)), dt=DT), count).check()
        for seed in range(100)
    ]
    assert sum(found) >= least


@pytest.mark.parametrize("kind", ["real", "short", "damped", "masked", "complex", "lines"])
def test_false_alarms(kind: str) -> None:
    """At most 5 % are objected to; of 300 then more than 26 with a probability of 0.2 %."""
    alarms = 0
    for seed in range(300):
        rng = np.random.default_rng(seed)
        noise, count, options, more = 0.5 * rng.standard_normal(N), 2, {}, {}
        y = TWO + noise
        if kind == "short":
            y = y[:64]
        elif kind == "damped":
            y, count, options = 2 * np.exp(-T) * np.cos(63 * T) + 0.6 * noise, 1, {"damped": True}
        elif kind == "masked":
            more = {"mask": rng.random(N) > 0.2}
        elif kind == "lines":
            options = {"lines": 9}
        if kind == "complex":
            z = np.exp(63j * T) + 0.5 * np.exp(-75j * T) + noise + 0.5j * rng.standard_normal(N)
            found = mf.sinusoids(z, 2, dt=DT)
        else:
            found = mf.sinusoids(mf.Record(y=y, dt=DT, **more), count, **options)
        alarms += bool(found.check())
    assert alarms <= 26


def test_the_frequency_that_moves_and_the_damping_are_right() -> None:
    rng = np.random.default_rng(0)
    noise = 0.01 * rng.standard_normal(N)
    moves = mf.sinusoids(mf.Record(y=2 * np.cos(63 * T + 0.05 * T**2) + noise, dt=DT), 1).check()
    assert "moves by 0.101 ± 0.0038 rad/s per second" in moves
    decays = mf.sinusoids(mf.Record(y=2 * np.exp(-0.05 * T) * np.cos(63 * T) + noise, dt=DT), 1).check()
    assert "decays, by a damping of 0.0" in decays
    grows = mf.sinusoids(mf.Record(y=2 * np.exp(0.05 * T) * np.cos(63 * T) + noise, dt=DT), 1).check()
    assert "grows, by a damping of -0.0" in grows


def test_what_a_record_cannot_tell() -> None:
    rng = np.random.default_rng(1)
    pair = np.cos(63 * T) + np.cos(63.8 * T + 1) + 0.3 * rng.standard_normal(N)
    close = mf.sinusoids(mf.Record(y=pair, dt=DT), 2)
    assert "the record does not tell them from one tone" in close.check()
    assert "1 doubt, see check()" in repr(close)
    slow = mf.sinusoids(mf.Record(y=np.cos(1.5 * T) + 0.1 * rng.standard_normal(N), dt=DT), 1)
    assert 'Compare with trend="linear"' in slow.check()


def test_what_is_not_tested_is_said() -> None:
    exact = mf.sinusoids(mf.Record(y=np.cos(63 * T), dt=DT), 1).check()
    assert not exact
    assert "There is no noise" in exact.note
    few = mf.sinusoids(
        mf.Record(y=TWO + 0.1 * np.random.default_rng(0).standard_normal(N), dt=DT), 2, lines=9
    )
    assert "Residuals are not tested" in few.check().note


def test_errors_have_names() -> None:
    found = mf.sinusoids(mf.Record(y=TWO + 0.1 * np.random.default_rng(0).standard_normal(N), dt=DT), 2)
    assert found.bse["omega2"] == found.bse[1] > 0
    assert found.params["omega2"] == found["omega2"] == found.omega[1]
    with pytest.raises(mf.SpecError, match="there is no parameter 'omega3'"):
        found.bse["omega3"]
