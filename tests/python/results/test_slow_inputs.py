"""Inputs with a new value every few samples: held, though declared smooth, or measured by a slower sensor."""

from __future__ import annotations

import flights
import modfun as mf
import numpy as np
import pytest
import scipy

TRUTH = {"b0": 4.0, "b1": 8.0, "a1": 1.2, "a2": 4.0}
PLANT, MODEL = mf.tf([4, 8], [1, 1.2, 4]), mf.TransferFunction(poles=2, zeros=1)
T = 0.02 * np.arange(1400)


def moved(seed: int, step: int, acts: str, word: str, nsr: float = 0.05) -> mf.Record:
    """A chirp of which every `step`-th sample is kept; what `acts` is held, or the chirp itself."""
    rng = np.random.default_rng(seed)
    chirp = np.sin(2 * np.pi * (0.05 * T + 0.03 * T**2) + seed)
    u = np.repeat(chirp[::step], step)[: T.size]
    y = np.ravel(PLANT.simulate(u=u if acts == "zoh" else chirp, dt=0.02, intersample=acts))
    y += nsr * y.std() * rng.standard_normal(T.size)
    return mf.Record(y=y, u=u, dt=0.02, intersample=word)


def off(fit: mf.Fit) -> float:
    return float(
        np.sqrt(np.mean([((fit[name] - true) / fit.bse[name]) ** 2 for name, true in TRUTH.items()]))
    )


@pytest.mark.parametrize("step", [2, 7])
@pytest.mark.parametrize("word", ["smooth", "foh"])
def test_an_input_that_was_held_and_is_declared_otherwise_is_named(word: str, step: int) -> None:
    """Estimates were 5 errors off, and of random motions in silence."""
    for seed in range(5):
        rec = moved(seed, step, "zoh", word)
        fit, text = flights.warned(rec, MODEL)
        assert f"every {'2nd' if step == 2 else '7th'} sample and repeats it and is declared {word}" in text
        assert "First give intersample='zoh' in the record: BIC falls" in text
        assert any("give intersample='zoh'" in one for one in rec.check())
        cured, after = flights.warned(moved(seed, step, "zoh", "zoh"), MODEL)
        assert after == ""
        assert off(cured) < 2 < off(fit)


@pytest.mark.parametrize("step", [2, 7])
@pytest.mark.parametrize("word", ["auto", "zoh", "smooth"])
def test_an_input_that_a_slower_sensor_saw_is_named(word: str, step: int) -> None:
    """One more zero was advised, or the input a sample earlier."""
    for seed in range(4):
        rec = moved(seed, step, "smooth", word)
        fit, text = flights.warned(rec, MODEL)
        assert "did not stand in between. First draw a curve" in text
        code = text.split("new values, ")[1].split(", with intersample" if word != "auto" else ": BIC")[0]
        drawn = eval(code, {"rec": rec, "scipy": scipy})
        if word == "zoh":
            assert "intersample='smooth' in the record" in text
            drawn = mf.Record(y=drawn.y, u=drawn.u, dt=0.02, intersample="smooth")
        cured, after = flights.warned(drawn, MODEL)
        assert after == ""
        assert cured.records[0].intersample == ("smooth",)
        assert off(cured) < 2 < off(fit)


@pytest.mark.parametrize("word", ["auto", "zoh"])
def test_inputs_that_were_held_are_right(word: str) -> None:
    for seed in range(10):
        rec = moved(seed, (2, 4, 7)[seed % 3], "zoh", word, nsr=(0.0, 0.05, 0.3)[seed % 3])
        assert flights.warned(rec, MODEL)[1] == ""
