"""Outputs that are slower than their record: named, cured by a mask, and silence elsewhere."""

from __future__ import annotations

import flights
import modfun as mf
import numpy as np
import pytest
from modfun.records.slower import drawn as lines

PLANT, MODEL = mf.tf([4, 8], [1, 1.2, 4]), mf.TransferFunction(poles=2, zeros=1)
T = 0.05 * np.arange(500)


def drawn(kind: str, seed: int, step: int, first: int = 0) -> mf.Record:
    rng = np.random.default_rng(seed)
    if kind == "steps":
        u, word = np.repeat(rng.choice([-1.0, 0.0, 1.0], 20), 25), "zoh"
    else:
        u, word = np.sin(2 * np.pi * (0.05 * T + 0.03 * T**2)), "smooth"
    y = np.ravel(PLANT.simulate(u=u, dt=0.05, intersample=word))
    y += 0.05 * y.std() * rng.standard_normal(500)
    k = np.arange(first, 500, step)
    own = slice(first, k[-1] + 1)
    return mf.Record(y=np.interp(np.arange(500), k, y[k])[own], u=u[own], dt=0.05, intersample=word)


@pytest.mark.parametrize("step", [2, 5])
@pytest.mark.parametrize("kind", ["steps", "chirp"])
def test_lines_are_named_and_the_mask_cures(kind: str, step: int) -> None:
    """In all of 10 records each; of the chirp the numerator was 5 errors off at a step of 5."""
    off = []
    for seed in range(10):
        rec = drawn(kind, seed, step, first=seed % step)
        text = flights.warned(rec, MODEL)[1]
        assert f"straight lines between every {step}" in text
        assert any(f"between every {step}" in one for one in rec.check())
        cured = eval(text.split("leave them out, ")[1].removesuffix("."), {"rec": rec, "np": np})
        assert cured.mask.sum() == np.ceil(rec.t.size / step)
        assert not any("straight lines" in one for one in cured.check())
        fit, after = flights.warned(cured, MODEL)
        assert "straight" not in after
        off.append((fit["b0"] - 4) / fit.bse["b0"])
    assert np.sqrt(np.mean(np.square(off))) < 2.5


def test_of_few_samples_a_slower_record_is_made() -> None:
    """A mask of nine of ten samples left estimates tens of errors off."""
    rec = drawn("chirp", 0, 10)
    text = flights.warned(rec, MODEL)[1]
    cured = eval(text.split("of all channels, ")[1].removesuffix("."), {"rec": rec, "mf": mf})
    assert cured.t.size == 50
    assert cured.dt == pytest.approx(0.5)
    assert not any("straight lines between" in one for one in cured.check())


def test_right_records_are_not_drawn() -> None:
    for seed in range(20):
        rec = flights.flown(seed, nsr=0.05 * (seed % 3))
        assert not any("straight lines between" in one for one in rec.check())
        assert lines(np.round(rec["q"], 3))[0] == 1
    held = np.repeat(np.random.default_rng(0).standard_normal(100), 5)
    ramps = np.ravel(mf.tf([1], [1, 0]).simulate(u=held, dt=0.05, intersample="zoh"))
    rec = mf.Record(y=ramps, u=held, dt=0.05, intersample="zoh")
    assert lines(ramps)[0] == 5
    assert not any("straight lines between" in one for one in rec.check())
    assert lines(held)[0] == 1


@pytest.mark.parametrize("step", [3, 5])
def test_a_vane_that_repeats_its_samples_is_named_and_the_mask_cures(step: int) -> None:
    """Of all 8 records each: derivatives were 5 to 8 errors off in silence."""
    off = []
    for seed in range(8):
        right = flights.flown(seed, nsr=0.05)
        kept = np.repeat(right["alpha"][::step], step)[: right.t.size]
        rec = right.assign(alpha=kept)
        text = flights.warned(rec, flights.SHORT)[1]
        assert f"'alpha' has a new value only every {step}" in text
        assert any("has a new value only" in one for one in rec.check())
        cured = eval(text.split("leave them out, ")[1].removesuffix("."), {"rec": rec, "np": np})
        fit, after = flights.warned(cured, flights.SHORT)
        assert "new value" not in after
        off.append([(fit[name] - value) / fit.bse[name] for name, value in flights.TRUTH.items()])
    assert np.sqrt(np.mean(np.square(off))) < 1.5
