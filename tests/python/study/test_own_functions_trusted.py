"""What would make a study's figures wrong in silence: other parameters of the same name, other randomness."""

from __future__ import annotations

from math import nan
from typing import Any

import modfun as mf
import numpy as np
import pytest

SYSTEM = mf.tf([5], [1, 3, 8])
WORDS: dict[str, Any] = {
    "system": SYSTEM,
    "input": "sin(t**2/5)",
    "duration": 10.0,
    "intervals": 128,
    "nsr": 0.1,
    "replicates": 12,
    "seed": 2,
}
LARGER = mf.TransferFunction(poles=3, zeros=1)


def larger(rec: mf.Record, rng: np.random.Generator) -> mf.Fit:
    return mf.fit(rec, LARGER, harmonics=8)


def right(rec: mf.Record, rng: np.random.Generator) -> mf.Fit:
    return mf.fit(rec, mf.TransferFunction(poles=2, zeros=0), harmonics=8)


def missing(rec: mf.Record, rng: np.random.Generator) -> list[float]:
    return [3.0, 8.0, nan if rng.random() < 0.5 else 5.0]


def test_a_fit_of_another_structure_is_not_scored_by_names() -> None:
    with pytest.raises(mf.SpecError, match=r"'mine' returned a fit of TransferFunction\(poles=3, zeros=1\)"):
        mf.MonteCarlo(**WORDS, estimators={"mine": larger}).run(progress=False)


def test_a_fit_of_the_systems_structure_is() -> None:
    res = mf.MonteCarlo(**WORDS, estimators={"mine": right}).run(progress=False)
    assert np.abs(res.bias).max() < 1.0


@pytest.mark.parametrize("what", ["noise", "initial_state", "generate"])
def test_randomness_of_ones_own_is_refused(what: str) -> None:
    own = np.random.default_rng(0)
    if what == "generate":
        words: dict[str, Any] = {
            "generate": lambda cell, rng: mf.simulate(
                SYSTEM, input="sin(t**2/5)", duration=10.0, intervals=128, nsr=0.1, seed=int(own.integers(99))
            ),
            "truth": {"a1": 3.0, "a2": 8.0, "b0": 5.0},
            "estimators": {"ml": mf.Estimator(mf.TransferFunction(poles=2, zeros=0), harmonics=8)},
        }
    else:
        function = {
            "noise": lambda rng, y, dt: own.standard_normal(y.shape),
            "initial_state": lambda rng: own.standard_normal(2),
        }[what]
        words = WORDS | {what: function, "estimators": ["ml"], "harmonics": 8}
    with pytest.raises(mf.SpecError, match=f"{what} called again for the same replicate returned other"):
        mf.MonteCarlo(**words)


def test_numbers_that_are_not_finite_are_told_by_replicate() -> None:
    res = mf.MonteCarlo(**WORDS, estimators={"mine": missing}).run(progress=False)
    failed = int(res.status["nonfinite"].sum())
    assert 0 < failed < 12
    assert res.messages["text"].tolist() == ["returned b0 = nan"]
    assert res.messages["count"].tolist() == [failed]


def test_a_metric_that_is_always_one_has_the_error_of_a_share() -> None:
    res = mf.MonteCarlo(**WORDS, estimators=["ml"], harmonics=8, metrics={"ok": lambda fit, rec: 1.0}).run(
        progress=False
    )
    share = 12.5 / 13
    assert res.metrics["ok"].mean_mcse.item() == pytest.approx(np.sqrt(share * (1 - share) / 12))
