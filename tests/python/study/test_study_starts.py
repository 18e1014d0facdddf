"""Studies of estimators that know a past before the records: single fits, the bound, refusals."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from typing import Any

import modfun as mf
import numpy as np
import pytest

DUFFING = mf.Equation("y'' + a*y' + b*y + c*y**3 = d*u")
VALUES = {"a": 0.8, "b": 4.0, "c": 2.0, "d": 4.0}
TWO = mf.tf([[[5]], [[1, 1]]], [[[1, 3, 8]], [[1, 3, 8]]])
COMMON = mf.TransferFunction(poles=2, zeros=1, denominator="common")
LATE = mf.TransferFunction(poles=2, zeros=0, delay=mf.Free(0.1, min=0.0, max=0.3))
TANK = mf.Equation("h' = -k*sqrt(h) + b*u", outputs=["h"])
STAIR = np.where(np.arange(129) >= 13, 1.0, 0.0)
CASES: dict[str, dict[str, Any]] = {
    "duffing": {"system": DUFFING.model(VALUES), "model": DUFFING, "duration": 5.0},
    "two outputs": {"system": TWO, "model": COMMON, "duration": 4.0},
    "delay": {"system": mf.tf([5], [1, 3, 8], delay=0.12), "model": LATE, "duration": 4.0},
    "tank": {
        "system": TANK.model({"k": 0.5, "b": 0.4}), "model": TANK, "duration": 6.0, "initial_state": [0.64],
        "input": 1 + STAIR / 2,
    },
}  # fmt: skip


def study(case: str, told: Any = "rest", **words: Any) -> mf.MonteCarlo:
    given = {"input": STAIR, "intervals": 128, "intersample": "zoh", "nsr": 0.05, "seed": 3} | CASES[case]
    model = given.pop("model")
    known = {"known": mf.Estimator(model, initial_state=told), "free": mf.Estimator(model)}
    return mf.MonteCarlo(estimators=known, **(given | words))


@pytest.mark.parametrize("case", CASES)
def test_replicates_are_single_fits(case: str) -> None:
    res = study(case, replicates=3).run(progress=False, keep="samples")
    assert not np.any(res.failures)
    for number in range(3):
        _, fits = res.replicate(number)
        np.testing.assert_array_equal(res.samples[0, number], fits["known"].params)
        assert fits["known"].with_past is not None
        assert fits["free"].with_past is None
    gains = res.crlb[1] / res.crlb[0]
    assert np.all(gains > 0.99)
    assert np.max(gains) > 1.15


@pytest.mark.statistics
@pytest.mark.parametrize("case", CASES)
def test_scatter_and_coverage_are_those_of_the_bound(case: str) -> None:
    """100 replicates: scatter over the bound 0.75 to 1.25, coverage from 87 % (false alarm 1 in 1,000)."""
    res = study(case, replicates=100).run(progress=False)
    known = res.sel(estimator="known")
    assert not np.any(res.failures)
    ratio = known.sd / known.crlb
    assert np.all((ratio > 0.75) & (ratio < 1.25)), ratio
    assert np.all(known.coverage > 0.87), known.coverage


def test_the_bound_knows_what_the_estimator_knows() -> None:
    res = study("duffing", replicates=2).run(progress=False)
    clean = mf.simulate(
        DUFFING.model(VALUES),
        input=STAIR,
        intervals=128,
        duration=5.0,
        intersample="zoh",
        initial_state="zero",
    )
    sigma = 0.05 * float(np.sqrt(np.mean(clean.y**2)))
    for row, told in zip(res.crlb, ("rest", "unknown"), strict=True):
        own = mf.crlb(DUFFING.model(VALUES), clean, sigma=sigma, initial_state=told)
        np.testing.assert_allclose(row, own.sd, rtol=1e-6)


def test_executors_give_the_same_numbers() -> None:
    here = study("duffing", replicates=70).run(progress=False)
    with ProcessPoolExecutor(2) as pool:
        there = study("duffing", replicates=70).run(progress=False, executor=pool)
    np.testing.assert_array_equal(here.sd, there.sd)
    np.testing.assert_array_equal(here.coverage, there.coverage)


def test_what_no_study_begins_with() -> None:
    with pytest.raises(mf.errors.SpecError, match=r"mf\.Estimator\(structure, initial_state='rest'\)"):
        study("duffing", initial_state="rest")
    with pytest.raises(mf.errors.SpecError, match='by "ml" or "awls"'):
        mf.MonteCarlo(
            system=TWO, input=STAIR, intervals=128, duration=4.0, nsr=0.05,
            estimators={"ls": mf.Estimator(COMMON, method="ls", initial_state="rest")},
        )  # fmt: skip


def test_the_bound_is_that_where_the_records_begin():
    """By `crlb` from that state, in whatever coordinates; from rest it would be 1.4 times as large."""
    system, state = mf.tf([5], [1, 3, 8]), np.array([2.0, -5.0])
    a, turn = np.array([[0.0, 1.0], [-8.0, -3.0]]), np.array([[1.0, 2.0], [0.5, 3.0]])
    back = np.linalg.inv(turn)
    turned = mf.ss(turn @ a @ back, turn @ [[0.0], [5.0]], np.array([[1.0, 0.0]]) @ back, [[0.0]])
    two = mf.TransferFunction(poles=2, zeros=0)
    record = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256)
    sigma = 0.1 * float(np.sqrt(np.mean(record.y**2)))
    wanted = mf.crlb(system, record, sigma=sigma, start=state)
    for whole, start in ((system, state), (turned, turn @ state)):
        res = mf.MonteCarlo(
            system=whole,
            input="sin(t**2/5)",
            duration=10.0,
            intervals=256,
            nsr=0.1,
            initial_state=start.tolist(),
            replicates=8,
            seed=1,
            estimators={"ml": mf.Estimator(two, trend=None, harmonics=20)},
        ).run(progress=False)
        np.testing.assert_allclose(res.crlb.ravel(), wanted.sd, rtol=1e-6)
    assert mf.crlb(system, record, sigma=sigma).relative > 1.39 * wanted.relative
