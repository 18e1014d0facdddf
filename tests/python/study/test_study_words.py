"""What a study says of figures that mislead: bounds of other noise, unsettled estimates, errors unknown."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import modfun as mf
import numpy as np
import pytest
import study_functions_kit as kit

BASE: dict[str, Any] = {
    "system": kit.SYSTEM, "input": "sin(t**2/5)", "duration": 10.0, "intervals": 128, "nsr": 0.1,
    "estimators": ["ml"], "harmonics": 8, "replicates": 20, "seed": 1,
}  # fmt: skip
MADE: dict[str, Any] = {
    "model": kit.TF2, "truth": {"a1": 3.0, "a2": 8.0, "b0": 5.0}, "estimators": ["ls"], "harmonics": 8,
}  # fmt: skip


def test_noise_of_ones_own_has_no_bound() -> None:
    res = mf.MonteCarlo(**{**BASE, "noise": kit.coloured}).run(progress=False)
    assert np.isnan(res.crlb).all()
    assert np.isnan(res.relative()["crlb"]).all()
    assert np.isfinite(mf.MonteCarlo(**BASE).run(progress=False).crlb).all()


def test_the_bound_of_equations_has_the_trend_that_they_are_fitted_with() -> None:
    system = mf.Equation("y' + a*y + b*y**2 = u").model({"a": 1.0, "b": 0.2})
    given = {**BASE, "system": system, "input": "sin(t**2/4) + 1"}
    bounds = [
        mf.MonteCarlo(**given, **words).run(progress=False).crlb.ravel()
        for words in ({}, {"trend": None}, {"trend": "constant"})
    ]
    np.testing.assert_array_equal(bounds[0], bounds[1])
    assert np.all(bounds[2] > 2 * bounds[0])


def test_a_plot_without_a_bound_names_none() -> None:
    pytest.importorskip("matplotlib")
    both = {**BASE, "nsr": [0.1, 0.2]}
    own = mf.MonteCarlo(**{**both, "noise": kit.coloured}).run(progress=False).plot()
    assert "Cramér–Rao bound" not in [line.get_label() for ax in own for line in ax.lines]
    white = mf.MonteCarlo(**both).run(progress=False).plot()
    assert "Cramér–Rao bound" in [line.get_label() for ax in white for line in ax.lines]


def test_estimates_that_did_not_settle_are_counted_where_there_are_any(tmp_path: Path) -> None:
    settled = mf.MonteCarlo(**BASE).run(progress=False)
    assert "maxiter" not in settled.table()
    assert "maxiter" not in settled.relative()
    hasty = {"ml": mf.Estimator(kit.TF2, harmonics=8), "hasty": mf.Estimator(kit.TF2, harmonics=8, maxiter=2)}
    given = {**BASE, "nsr": [0.1, 0.2], "estimators": hasty}
    del given["harmonics"]
    res = mf.MonteCarlo(**given).run(progress=False)
    own = res.status["maxiter"][0].tolist()
    assert own[0] == 0
    assert own[1] > 0
    assert res.relative()["maxiter"].tolist()[:2] == own
    assert res.table()["maxiter"].tolist()[:6] == [own[0]] * 3 + [own[1]] * 3
    assert "maxiter" in repr(res)
    pytest.importorskip("jinja2")
    page = res.report(tmp_path / "study.html").read_text(encoding="utf-8")
    both = int(res.status["maxiter"][:, 1].sum())
    assert f"{both} estimates in the figures did not settle" in page
    assert page.count("did not settle") == 1
    assert "95 % intervals (spectral) contain" in page


def test_a_monte_carlo_error_that_is_unknown_is_nan() -> None:
    one, two, three = (mf.MonteCarlo(**{**BASE, "replicates": n}).run(progress=False) for n in (1, 2, 3))
    for name in ("bias", "sd", "rmse", "median"):
        assert np.isnan(getattr(one, f"{name}_mcse")).all(), name
    assert np.isnan(one.relative()["rmse_mcse"]).all()
    assert np.isnan(two.sd_mcse).all()
    assert np.all(two.bias_mcse > 0)
    assert np.all(two.rmse_mcse > 0)
    assert np.all(three.sd_mcse > 0)


def always(cell: dict[str, Any], rng: np.random.Generator) -> mf.Record:
    """A record that forgets its rng."""
    return kit.CLEAN


def silent_at_zero(cell: dict[str, Any], rng: np.random.Generator) -> mf.Record:
    """Noise in some cells only."""
    noise = cell["nsr"] * rng.standard_normal(129)
    return kit.CLEAN.assign(y=lambda rec: rec["y"] + noise)


def test_replicates_that_are_all_the_same_are_noticed() -> None:
    with pytest.warns(mf.ModfunWarning, match="every replicate gave the same estimates"):
        mf.MonteCarlo(generate=always, replicates=3, **MADE).run(progress=False)
    with pytest.warns(mf.ModfunWarning, match="from the rng"):
        mf.MonteCarlo(**{**BASE, "noise": lambda rng, y, dt: np.cos(y)}).run(progress=False)


def test_cells_without_noise_are_not_taken_for_a_mistake() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mf.MonteCarlo(generate=always, replicates=1, **MADE).run(progress=False)
        mf.MonteCarlo(generate=silent_at_zero, grid={"nsr": [0.0, 0.1]}, replicates=3, **MADE).run(
            progress=False
        )
        mf.MonteCarlo(**{**BASE, "nsr": 0.0, "noise": kit.coloured, "replicates": 3}).run(progress=False)


def test_an_input_that_never_moves_is_refused_at_once() -> None:
    with pytest.raises(mf.DataError, match="MonteCarlo: input 'u' stands at 1 throughout"):
        mf.MonteCarlo(**{**BASE, "input": "1"})


def test_noise_in_per_cent_is_doubted() -> None:
    meant = "nsr=20 is noise of 20 times .* if 20 % is meant, give nsr=0.2, .* 20 dB above the noise, nsr=0.1"
    with pytest.warns(mf.ModfunWarning, match=f"MonteCarlo: {meant}") as caught:
        mf.MonteCarlo(**{**BASE, "nsr": [0.1, 20]})
    assert caught[0].filename == __file__
    with pytest.warns(mf.ModfunWarning, match=f"simulate: {meant}") as caught:
        mf.simulate(kit.SYSTEM, input="sin(t)", duration=5.0, intervals=50, nsr=20)
    assert caught[0].filename == __file__


def test_labels_are_found_within_rounding():
    study = mf.MonteCarlo(
        system=mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=64,
        nsr=[0.1, 0.1 * 3], estimators=["ls"],
    )  # fmt: skip
    results = study.run(replicates=16, progress=False)
    np.testing.assert_array_equal(results.sel(nsr=0.3).bias, results.bias[1:])
    with pytest.raises(mf.SpecError, match=r"nsr=0.31 is not in the study"):
        results.sel(nsr=0.31)
