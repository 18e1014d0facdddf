"""What a study says of metrics that always fail, of repeated messages and of replicates that are there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import modfun as mf
import numpy as np
import pytest

WORDS: dict[str, Any] = {
    "system": mf.tf([5], [1, 3, 8]), "input": "sin(t**2/5)", "duration": 10.0, "intervals": 64, "nsr": 0.1,
    "estimators": ["ls", "ml"], "harmonics": 6, "seed": 1,
}  # fmt: skip


def misspelt(fit: mf.Fit, rec: mf.Record) -> float:
    return float(fit["a3"])


def test_a_metric_that_always_fails_stops_the_study_or_warns() -> None:
    study = mf.MonteCarlo(**WORDS, metrics={"gain": lambda fit, rec: fit["b0"], "third": misspelt})
    with pytest.raises(mf.SpecError, match=r"metric 'third' failed for every .* first 128 .*'a3'"):
        study.run(replicates=300, progress=False)
    with pytest.warns(mf.ModfunWarning, match=r"metric 'third' failed for every estimate; .*'a3'"):
        res = study.run(replicates=20, progress=False)
    assert res.metrics["gain"].count.tolist() == [20, 20]
    assert res.messages["count"].tolist() == [20, 20]
    assert res.messages["replicate"].tolist() == [0, 0]


def test_a_metric_of_one_estimator_alone_is_no_mistake() -> None:
    study = mf.MonteCarlo(
        **{**WORDS, "estimators": {"ml": "ml", "own": lambda rec, rng: {"a1": 3.0, "a2": 8.0, "b0": 5.0}}},
        metrics={"poles": lambda fit, rec: abs(fit.model.poles()[0])},
    )
    res = study.run(replicates=128, progress=False)
    assert res.metrics["poles"].count.tolist() == [128, 0]
    assert res.messages["count"].tolist() == [128]


def test_a_fit_on_its_bound_counts_as_an_interval_that_misses() -> None:
    bounded = mf.TransferFunction(poles=2, zeros=0, params={"a1": mf.Free(3.1, min=2.95, max=4)})
    words = {name: value for name, value in WORDS.items() if name not in ("estimators", "harmonics")}
    study = mf.MonteCarlo(
        **words,
        estimators={"own": lambda rec, rng: mf.fit(rec, bounded, harmonics=6)},
        metrics={"on": lambda fit, rec: bool(fit.at_bound), "nan": lambda fit, rec: np.isnan(fit.bse["a1"])},
    )
    res = study.run(replicates=40, progress=False)
    assert 0.1 < res.metrics["on"].mean[0] == res.metrics["nan"].mean[0] < 0.6
    assert res.coverage[0, 0] <= 1 - res.metrics["on"].mean[0]


def test_fewer_replicates_than_a_directory_holds_are_told(tmp_path: Path) -> None:
    study = mf.MonteCarlo(**WORDS)
    study.run(replicates=300, directory=tmp_path, progress=False)
    with pytest.warns(mf.ModfunWarning, match=r"replicates=50, but directory=.* holds 300 of this study"):
        assert study.run(replicates=50, directory=tmp_path, progress=False).replicates == 300
    assert study.run(directory=tmp_path, progress=False).replicates == 300  # the study's own number is silent
