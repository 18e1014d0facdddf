"""Options of more than least squares in `fit_many`: single fits over one band, and records without a fit."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import modfun as mf
import numpy as np
import pytest
from modfun.models.options import Options

SYSTEM = mf.tf([5], [1, 3, 8])
TF2 = mf.TransferFunction(poles=2, zeros=0)
EQUATION = mf.Equation("y'' + a1*y' + a2*y = b*u")
SPACE = mf.StateSpace(A=[[0, 1], ["a2", "a1"]], B=[[0], ["b"]], C=[[1, 0]], states=["x", "v"], outputs=["y"])
CLEAN = mf.simulate(SYSTEM, input="sin(t**2/5)", duration=10.0, intervals=128)
LIGHT = mf.tf([1], [1, 0.02, 4])


def heavy(seed: int, clean: mf.Record = CLEAN) -> mf.Record:
    """Noise of Student's t with 2.2 degrees of freedom."""
    noise = 0.02 * np.random.default_rng(seed).standard_t(2.2, clean.t.size)
    return clean.assign(y=clean["y"] + noise)


def same(found: mf.FitMany, fits: list[mf.Fit], limit: float = 1e-9) -> None:
    params, errors = np.array([fit.params for fit in fits]), np.array([fit.bse for fit in fits])
    np.testing.assert_allclose(found.params, params, rtol=limit)
    np.testing.assert_allclose(found.bse, errors, rtol=limit)
    assert found.status.tolist() == [fit.status for fit in fits]


@pytest.mark.parametrize("model", [TF2, EQUATION, SPACE], ids=["transfer function", "equation", "states"])
@pytest.mark.filterwarnings("ignore::modfun.errors.ModfunWarning")
def test_robust_fits_of_many_records_are_single_fits(model: Any) -> None:
    """Each record chooses its band, as alone: over the band of the first, transfer functions were up to 1.1
    standard errors off.
    """
    records = [heavy(seed) for seed in range(3)]
    found = mf.fit_many(records, model, robust=True, progress=False)
    fits = [mf.fit(rec, model, robust=True) for rec in records]
    assert found.band == fits[0].band
    same(found, fits)
    if model is TF2:
        assert len({fit.band for fit in fits}) > 1
    assert min(fit.tail for fit in fits) < 10
    plain = mf.fit_many(records, model, progress=False)
    assert np.max(np.abs(found.params - plain.params) / plain.bse) > 0.1
    assert "robust=True" in repr(mf.Estimator(model, **found.options.given()))


def test_a_batch_is_its_records() -> None:
    records = [heavy(seed) for seed in range(3)]
    batch = mf.Batch(y=np.array([rec.y for rec in records]), u=CLEAN.u, dt=CLEAN.dt, intersample="smooth")
    words: dict[str, Any] = {"robust": True, "band": 12.0}
    found = mf.fit_many(batch, TF2, progress=False, **words)
    same(found, [mf.fit(rec, TF2, **words) for rec in records])
    same(mf.fit_many(records, TF2, progress=False, **words), [mf.fit(rec, TF2, **words) for rec in records])


def test_a_replicate_that_is_no_record_has_a_status() -> None:
    y = np.array([heavy(seed).y for seed in range(3)])
    y[0, 0, 5] = np.nan
    batch = mf.Batch(y=y, u=CLEAN.u, dt=CLEAN.dt, intersample="smooth")
    found = mf.fit_many(batch, TF2, robust=True, band=12.0, progress=False)
    assert found.status.tolist() == ["nonfinite", "ok", "ok"]
    assert np.isnan(found.params[0]).all()
    assert np.isnan(found.bse[0]).all()
    assert found.usable.tolist() == [False, True, True]
    assert found.failures == {"nonfinite": 1}
    assert "1 of 3 records have no estimate; record 0: Record: channel 'y' has 1 values" in repr(found)
    np.testing.assert_array_equal(found.params[1], mf.fit(heavy(1), TF2, robust=True, band=12.0).params)


def test_records_whose_fit_ends_in_an_error_have_a_status(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where none has an estimate, the error is raised."""
    real = mf.Fit.simulate
    bad = heavy(1)

    def simulate(fit: mf.Fit, rec: mf.Record, *given: Any) -> Any:
        if np.array_equal(rec.y, bad.y):
            raise mf.DataError("the response leaves the range of numbers")
        return real(fit, rec, *given)

    monkeypatch.setattr(mf.Fit, "simulate", simulate)
    found = mf.fit_many([heavy(0), bad, heavy(2)], TF2, robust=True, band=12.0, progress=False)
    assert found.status.tolist() == ["ok", "nonfinite", "ok"]
    assert "record 1: fit: robust=True weighs samples by the simulation's errors, but the" in found.notes[-1]
    with pytest.raises(mf.FitError, match="leaves the range of numbers"):
        mf.fit_many([bad, bad], TF2, robust=True, band=12.0, progress=False)


def test_unstable_estimates_of_many_records_give_way() -> None:
    records = [
        mf.simulate(LIGHT, input="sin(t**2/5)", duration=10.0, intervals=128, nsr=0.5, seed=seed)
        for seed in range(6)
    ]
    free = mf.fit_many(records, TF2, harmonics=8, progress=False)
    kept = mf.fit_many(records, TF2, harmonics=8, stable=True, progress=False)
    unstable = free["a1"] < 0
    assert 0 < unstable.sum() < 6
    assert np.all(kept["a1"] > 0)
    np.testing.assert_allclose(kept.params[~unstable], free.params[~unstable], rtol=1e-6)
    same(kept, [mf.fit(rec, TF2, harmonics=8, stable=True) for rec in records], 1e-5)


def test_options_that_came_later_are_in_the_text_where_they_are_given() -> None:
    plain = Options()
    assert "robust" not in repr(plain)
    assert "initial_state" not in repr(plain)
    for given in ({"robust": True}, {"stable": True}, {"reference": "r"}, {"initial_state": "rest"}):
        own = Options.checked("fit", **given)
        (name,) = given
        assert f"{name}={getattr(own, name)!r}" in repr(own)
        assert own != plain
        assert copy.copy(own) == own == pickle.loads(pickle.dumps(own))
        assert hash(own) != hash(plain)
        assert own.is_plain == (name == "initial_state")
        assert own.plain() == (own if own.is_plain else plain)
        assert eval(repr(own), {"Options": Options}) == own


@pytest.mark.filterwarnings("ignore::modfun.errors.ModfunWarning")
def test_bootstrap_refits_as_the_fit_was_made() -> None:
    """Noise is normal here, so robust refits are plain ones; the bootstrap refused such fits."""
    noise = 0.02 * np.random.default_rng(0).normal(size=129)
    rec = CLEAN.assign(y=CLEAN["y"] + noise)
    plain, stable, robust = (
        mf.bootstrap(mf.fit(rec, TF2, **words), replicates=20, seed=1)
        for words in ({}, {"stable": True}, {"robust": True})
    )
    np.testing.assert_allclose(stable.sd, plain.sd, rtol=1e-6)
    np.testing.assert_allclose(robust.sd, plain.sd, rtol=1e-6)


@pytest.mark.filterwarnings("ignore::modfun.errors.ModfunWarning")
def test_cross_validation_fits_as_the_estimator_says() -> None:
    """It left robust= and stable= out in silence."""
    records = [heavy(seed) for seed in range(3)]
    table = mf.cross_validate(records, {"plain": TF2, "robust": mf.Estimator(TF2, robust=True)})
    own = mf.fit(records[1:], TF2, robust=True).score(records[0])
    scores = dict(zip(zip(table["model"], table["record"], strict=True), table["fit_percent"], strict=True))
    assert scores["robust", 0] == pytest.approx(own["fit_percent"][0], rel=1e-9)
    assert scores["plain", 0] != scores["robust", 0]
