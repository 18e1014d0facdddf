"""How studies draw noise: coefficients by default, the record behind them on demand, samples where needed."""

from pathlib import Path
from typing import Any

import modfun as mf
import numpy as np
import pytest

BASE: dict[str, Any] = {
    "system": mf.tf([5], [1, 3, 8]), "input": "sin(t**2/5)", "duration": 10.0, "intervals": 64,
    "estimators": ["ls", "ml"], "nsr": [0.1, 0.2], "harmonics": 6, "replicates": 600, "seed": 3,
}  # fmt: skip
PLAIN = mf.TransferFunction(poles=2, zeros=0)
TWO = {
    "system": mf.tf([[[5]], [[1, 2]]], [[[1, 3, 8]], [[1, 3, 8]]]),
    "estimators": {"two": mf.Estimator(mf.TransferFunction(poles=2, denominator="common"), harmonics=6)},
}


def study(**changes: Any) -> mf.MonteCarlo:
    given = BASE | changes
    if isinstance(given["estimators"], dict):
        del given["harmonics"]
    return mf.MonteCarlo(**given)


def mine(rec: mf.Record, rng: np.random.Generator) -> list[float]:
    return [float(rec.y.mean()), 1.0, 2.0]


@pytest.mark.parametrize(
    ("changes", "draw"),
    [
        ({}, "coefficients"),
        ({"initial_state": "random"}, "coefficients"),
        (TWO, "coefficients"),
        ({"estimators": {"mine": mine}}, "samples"),
        ({"metrics": {"size": lambda fit, rec: float(np.sum(fit.params))}}, "samples"),
        ({"noise": lambda rng, y, dt: rng.standard_normal(y.size)}, "samples"),
        ({"harmonics": 16}, "coefficients"),
        ({"harmonics": 120, "intervals": 256}, "samples"),  # less work than so many lines
    ],
)
def test_what_is_less_work_is_drawn(changes: dict[str, Any], draw: str) -> None:
    assert study(replicates=2, **changes).run(progress=False).draw == draw


@pytest.mark.parametrize("changes", [{}, {"initial_state": "random"}, TWO])
def test_the_record_of_a_replicate_is_the_one_that_was_fitted(changes: dict[str, Any]) -> None:
    made = study(**changes).run(keep="samples", progress=False)
    assert made.draw == "coefficients"
    for number in (0, 7, 599):
        for level, nsr in enumerate(BASE["nsr"]):
            rec, fits = made.replicate(number, nsr=nsr)
            assert rec.y.shape[1] == 65
            for k, fit in enumerate(fits.values()):
                kept = made.samples[level, k, number]
                # Joint fits of one record settle by other steps than those of studies.
                np.testing.assert_allclose(
                    fit.params, kept, rtol=1e-9 if not changes.get("estimators") else 1e-5
                )


def test_completed_noise_is_white() -> None:
    """Correlations of all pairs of samples over 400 records; false alarm below 1e-3."""
    made = study(nsr=0.2).run(progress=False)
    noise = np.array([made.replicate(r)[0].y[0] for r in range(400)])
    noise -= noise.mean(axis=0)
    cov = noise.T @ noise / len(noise)
    scale = cov / np.sqrt(np.outer(np.diag(cov), np.diag(cov)))
    off = scale[np.triu_indices(65, 1)]
    assert np.abs(off).max() < 5.5 / np.sqrt(400)
    assert np.sum(off**2) * 400 / off.size == pytest.approx(1.0, abs=0.12)
    assert np.ptp(np.diag(cov)) / np.diag(cov).mean() < 0.6


def test_samples_and_coefficients_have_one_distribution() -> None:
    made = study(replicates=4000)
    samples, drawn = (made.run(draw=d, progress=False) for d in ("samples", "coefficients"))
    assert np.all(samples.bias != drawn.bias)
    gap = np.abs(samples.bias - drawn.bias) / np.hypot(samples.bias_mcse, drawn.bias_mcse)
    assert gap.max() < 4.5  # of 12 figures: false alarm below 1e-4
    np.testing.assert_allclose(samples.sd, drawn.sd, rtol=0.1)


def test_a_directory_keeps_to_what_was_drawn_there(tmp_path: Path) -> None:
    made = study(replicates=64)
    made.run(directory=tmp_path / "a", draw="samples", progress=False)
    more = made.run(directory=tmp_path / "a", replicates=128, progress=False)
    assert more.draw == "samples"
    again = mf.load(tmp_path / "a")
    assert isinstance(again, mf.Results)
    assert again.draw == "samples"
    with pytest.raises(mf.SpecError, match="draw 'samples' there, 'coefficients' here"):
        made.run(directory=tmp_path / "a", draw="coefficients", progress=False)


def test_estimators_of_several_windows_see_samples() -> None:
    """Their coefficients are those of one record only where it is drawn sample by sample."""
    late = mf.Estimator(mf.TransferFunction(poles=2, zeros=0, delay=0.7), harmonics=6)
    made = study(estimators={"here": mf.Estimator(PLAIN, harmonics=6), "late": late})
    assert made.run(progress=False, replicates=4).draw == "samples"
    forced = made.run(progress=False, replicates=4, draw="coefficients")
    with pytest.raises(mf.SpecError, match="2 rules or windows apart"):
        forced.replicate(0, nsr=0.1)


def test_what_belongs_to_a_run_is_sent_there() -> None:
    with pytest.raises(mf.SpecError, match=r"draw is no part of a study .* study.run\(draw='samples'\)"):
        study(draw="samples")
