"""Single wrong samples: a fit names them all, first, with code that cures; right records have none."""

from __future__ import annotations

import re
from typing import Any

import flights
import modfun as mf
import numpy as np
import pytest

PLANT, MODEL = mf.tf([4, 8], [1, 1.2, 4]), mf.TransferFunction(poles=2, zeros=1)
TRUTH = np.array([1.2, 4.0, 4.0, 8.0])
COUNT, DT = 500, 0.05


def driven(kind: str, rng: Any) -> tuple[np.ndarray, str]:
    t = DT * np.arange(COUNT)
    if kind == "multisine":
        tones = [np.sin(2 * np.pi * k * t / t[-1] + rng.uniform(0, 6.3)) for k in range(1, 25)]
        return np.sum(tones, axis=0), "smooth"
    if kind == "steps":
        return np.repeat(rng.choice([-1.0, 0.0, 1.0], COUNT // 25), 25), "zoh"
    if kind == "chirp":
        return np.sin(2 * np.pi * (0.05 * t + 0.03 * t**2)), "smooth"
    if kind == "impulses":
        u = np.zeros(COUNT)
        u[rng.choice(np.arange(20, COUNT - 40), 8, replace=False)] = 20.0
        return u, "zoh"
    return np.sign(np.sin(1.3 * t + 0.1)), "zoh"  # a square wave


def measured(kind: str, seed: int, nsr: float = 0.05, tail: float = np.inf) -> mf.Record:
    rng = np.random.default_rng(seed)
    u, word = driven(kind, rng)
    y = np.ravel(PLANT.simulate(u=u, dt=DT, intersample=word))
    noise = rng.standard_normal(COUNT) if np.isinf(tail) else rng.standard_t(tail, COUNT)
    return mf.Record(y=y + nsr * y.std() * noise, u=u, dt=DT, intersample=word)


def spoiled(rec: mf.Record, name: str, seed: int, low: float, high: float) -> tuple[mf.Record, list[int]]:
    """Three to ten samples off by so many hundredths of 5 % of the channel."""
    rng, values = np.random.default_rng(100 + seed), rec[name].copy()
    at = np.sort(rng.choice(np.arange(5, values.size - 5), rng.integers(3, 11), replace=False))
    values[at] += 0.05 * values.std() * rng.uniform(low, high, at.size) * rng.choice([-1, 1], at.size)
    return rec.assign(**{name: values}), at.tolist()


@pytest.mark.parametrize("kind", ["multisine", "steps", "chirp", "square"])
@pytest.mark.parametrize(("low", "high"), [(5, 20), (100, 100)])
def test_spikes_of_an_output_are_named_and_the_mask_cures(kind: str, low: float, high: float) -> None:
    """In all of 5 records each; one of several was named, and the mask was no code."""
    for seed in range(5):
        rec, at = spoiled(measured(kind, seed), "y", seed, low, high)
        text = flights.warned(rec, MODEL)[1]
        assert re.match(r"fit: Output 'y' has \d+ spikes, at t = ", text), text
        cured = eval(re.findall(r"rec\.weigh\(mask=.*?\]\)\)", text)[0], {"rec": rec, "np": np})
        masked = np.flatnonzero(~cured.mask[0]).tolist()
        assert len({*masked} - {*at}) <= 1
        assert high < 100 or {*at} <= {*masked}
        fit, after = flights.warned(cured, MODEL)
        assert after == ""
        assert np.all(np.abs(fit.params - TRUTH) < 4.5 * fit.bse)
        assert flights.warned(rec, MODEL, robust=True)[1] == ""  # weights take care of them


@pytest.mark.parametrize("model", [flights.SHORT, flights.WRITTEN])
@pytest.mark.parametrize("name", ["alpha", "q"])
def test_spikes_are_named_of_equations_and_state_spaces(model: Any, name: str) -> None:
    for seed in range(3):
        rec, _ = spoiled(flights.flown(seed), name, seed, 5, 20)
        text = flights.warned(rec, model)[1]
        assert f"Output {name!r} has " in text
        cured = eval(re.findall(r"rec\.weigh\(mask=.*?\]\)\}\)", text)[0], {"rec": rec, "np": np})
        assert flights.warned(cured, model)[1] == ""


def test_spikes_of_an_input_are_named_where_a_fit_without_them_explains_more() -> None:
    for kind in ("multisine", "chirp"):
        for seed in range(5):
            rec, _ = spoiled(measured(kind, seed), "u", seed, 20, 40)
            fit, text = flights.warned(rec, MODEL)
            assert text.startswith("fit: Input 'u' has "), text
            assert "With the samples beside them in their place BIC falls" in text
            k, code = re.findall(r"k = (.*?\])\) and (rec.assign\(.*\))\.", text)[0]
            k = eval(f"{k})", {"rec": rec, "np": np})
            cured = eval(code, {"rec": rec, "np": np, "k": k})
            after = flights.warned(cured, MODEL)[0]
            assert np.max(np.abs(after.params - TRUTH)) < np.max(np.abs(fit.params - TRUTH)) + after.bse.max()
            assert np.sum(after.bse) < np.sum(fit.bse)


@pytest.mark.parametrize("kind", ["multisine", "steps", "chirp", "square", "impulses"])
@pytest.mark.parametrize(("nsr", "tail"), [(0.0, np.inf), (0.05, np.inf), (0.5, np.inf), (0.1, 3), (0.1, 5)])
def test_right_records_have_none(kind: str, nsr: float, tail: float) -> None:
    """None in 1,616 records of these kinds, of flights and of wrong models."""
    for seed in range(3):
        rec = measured(kind, seed, nsr, tail)
        step = np.ptp(rec["y"]) / 60
        for own in (rec, rec.assign(y=np.round(rec["y"] / step) * step)):
            fit, text = flights.warned(own, MODEL)
            assert "spike" not in text
            assert "spike" not in str(fit.check())


def test_the_check_of_a_record_prints_the_code() -> None:
    rec, at = spoiled(measured("multisine", 0), "y", 0, 100, 100)
    (text,) = [one for one in rec.check() if "outlying" in one]
    cured = eval(text.split("leave them out, ")[1][:-1], {"rec": rec, "np": np})
    assert {*np.flatnonzero(~cured.mask[0])} < {*at}  # two are side by side, which a step may be
    assert cured.mask.sum() == COUNT - 7


def test_what_stands_for_masked_samples_is_no_spike() -> None:
    """Of bursts of them, samples between were named in right records."""
    for seed in range(5):
        rec = measured("multisine", seed, nsr=0.3)
        lost = np.random.default_rng(seed).random(COUNT) < 0.25
        assert "spike" not in flights.warned(rec.weigh(mask=~lost), MODEL)[1]
