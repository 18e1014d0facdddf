"""Monte Carlo studies: numbers, common random numbers, addresses, and what is refused."""

from __future__ import annotations

import warnings
from typing import Any

import modfun as mf
import numpy as np
import pytest

SYSTEM = mf.tf([5], [1, 3, 8])
TF2 = mf.TransferFunction(poles=2, zeros=0)
CHIRP = "sin(t**2/5)"
BASE: dict[str, Any] = {"system": SYSTEM, "input": CHIRP, "duration": 10.0, "intervals": 256}
REPORT: dict[str, Any] = {"harmonics": 6, "rule": "staircase", "extended": False, "trend": None}


def study(**changes: Any) -> mf.MonteCarlo:
    given = {**BASE, "estimators": ["ls", "ml"], "nsr": 0.2, "replicates": 50, "seed": 1, **changes}
    return mf.MonteCarlo(**given)


# Numbers -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def published() -> mf.Results:
    return study(nsr=[0.0, 0.2, 0.6], estimators=["ls", "awls", "ml"], replicates=20_000, **REPORT).run(
        threads=1, progress=False
    )


def test_bias_and_sd_of_the_published_setting(published: mf.Results) -> None:
    table = published.relative()
    figures = {(r["nsr"], r["estimator"]): r for r in table.rows}
    # Known beforehand from independent programs: 15/11 % for ls, 6.8/8.6 % awls, .5/10.3 % ml at 60 %.
    assert figures[0.6, "ls"]["bias"] == pytest.approx(15.0, abs=0.8)
    assert figures[0.6, "ls"]["sd"] == pytest.approx(11.3, abs=0.8)
    assert figures[0.6, "awls"]["bias"] == pytest.approx(6.8, abs=0.8)
    assert figures[0.6, "ml"]["bias"] < 1.5
    assert figures[0.2, "ls"]["bias"] == pytest.approx(2.2, abs=0.3)
    assert figures[0.0, "ls"]["bias"] < 0.05  # quadrature alone
    assert figures[0.2, "ml"]["crlb"] == pytest.approx(3.29, abs=0.01)


@pytest.mark.statistics
def test_intervals_of_ml_cover_and_those_of_ls_do_not(published: mf.Results) -> None:
    by_name = dict(zip(published.estimators, published.coverage[1], strict=True))
    assert np.all((by_name["ml"] > 0.925) & (by_name["ml"] < 0.985))
    assert published.axes["nsr"] == (0.0, 0.2, 0.6)
    assert published.bias.shape == (3, 3, 3)
    share = (published.coverage * 20_000 + 0.5) / 20_001
    np.testing.assert_allclose(published.coverage_mcse, np.sqrt(share * (1 - share) / 20_000))


def test_standard_errors_are_what_repetition_shows() -> None:
    figures = ("bias", "sd", "rmse", "median")
    runs = [study(seed=s, replicates=200, estimators=["ls"], **REPORT).run(progress=False) for s in range(60)]
    for name in figures:
        seen = np.std([getattr(r, name)[0] for r in runs], axis=0)
        claimed = np.mean([getattr(r, f"{name}_mcse")[0] for r in runs], axis=0)
        np.testing.assert_allclose(claimed, seen, rtol=0.4, err_msg=name)


def test_summary_equals_numpy_on_the_samples() -> None:
    res = study(replicates=333, nsr=[0.1, 0.4]).run(keep="samples", progress=False)
    assert res.samples is not None
    errors = res.samples - res.truth[:, :, None]
    np.testing.assert_allclose(res.bias, errors.mean(axis=2), atol=1e-13)
    np.testing.assert_allclose(res.sd, res.samples.std(axis=2, ddof=1), rtol=1e-10)
    np.testing.assert_allclose(res.rmse, np.sqrt((errors**2).mean(axis=2)), rtol=1e-10)
    np.testing.assert_allclose(res.median, np.median(errors, axis=2), rtol=5e-3, atol=1e-3)
    assert study().run(progress=False).samples is None


def test_relative_is_the_footnote() -> None:
    res = study(replicates=100).run(progress=False)
    by_hand = 100 * np.sqrt(np.mean((res.bias / res.truth) ** 2, axis=-1))
    np.testing.assert_allclose(res.relative()["bias"], by_hand, rtol=1e-12)
    assert "relative" not in repr(res)
    assert res._repr_html_().startswith("<table>")
    assert len(res.table()) == 2 * 3


# Addresses and common random numbers -------------------------------------------------------------


def test_all_levels_see_the_same_noise() -> None:
    made = study(nsr=[0.1, 0.3])
    res = made.run(progress=False)
    quiet = study(nsr=0.0).run(progress=False).replicate(7)[0]
    low, high = (res.replicate(7, nsr=v)[0].y - quiet.y for v in (0.1, 0.3))
    np.testing.assert_allclose(3 * low, high, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("state", ["zero", "random"])
def test_a_replicate_made_again_is_the_row_of_the_study(state: str) -> None:
    axes = {"initial_state": {"rest": "zero", "other": state}, "nsr": [0.05, 0.4]}
    res = study(estimators=["ls", "wls", "awls", "ml"], harmonics=8, **axes).run(
        keep="samples", progress=False
    )
    assert res.samples is not None
    for number in (0, 17, 49):
        rec, fits = res.replicate(number, initial_state="other", nsr=0.4)
        for k, name in enumerate(res.estimators):
            np.testing.assert_allclose(fits[name].params, res.samples[1, 1, k, number], rtol=1e-10)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", mf.ModfunWarning)
            again = mf.fit(rec, TF2, method="ml", harmonics=8)
        np.testing.assert_allclose(again.params, res.samples[1, 1, 3, number], rtol=1e-10)


def test_the_first_group_is_what_simulate_gives() -> None:
    rec = study(seed=5, initial_state="random").run(draw="samples", progress=False).replicate(3)[0]
    same = mf.simulate(SYSTEM, input=CHIRP, duration=10.0, intervals=256, nsr=0.2, seed=5, replicate=3,
                       initial_state="random")  # fmt: skip
    np.testing.assert_allclose(rec.y, same.y, rtol=1e-12, atol=1e-14)


def test_seeds_and_threads() -> None:
    one = study(replicates=3000, nsr=[0.1, 0.2]).run(threads=1, progress=False)
    two = study(replicates=3000, nsr=[0.1, 0.2]).run(threads=2, progress=False)
    np.testing.assert_array_equal(one.bias, two.bias)
    np.testing.assert_array_equal(one.sd, two.sd)
    assert np.all(one.bias != study(replicates=3000, nsr=[0.1, 0.2], seed=2).run(progress=False).bias)


def test_without_coverage_there_is_none() -> None:
    assert np.isnan(study().run(coverage=False, progress=False).coverage).all()


def test_a_band_left_out_is_chosen_once_and_used() -> None:
    made = study(estimators=["ls", "ml"], trend=None)
    ls, ml = made.plan.contenders
    assert ls.estimators[0].options.harmonics == 9  # M = 3 times the number of unknowns
    chosen = ml.estimators[0].options.harmonics
    assert chosen is not None
    assert 5 <= chosen <= 20
    res = made.run(progress=False)
    assert res.replicate(0)[1]["ml"].lines[0][1] == chosen + 2


# Axes --------------------------------------------------------------------------------------------


def test_axes_structures_and_the_union_of_parameters() -> None:
    systems = {"two": SYSTEM, "one": mf.tf([1], [1, 1])}
    res = study(system=systems, input={"chirp": CHIRP, "pulse": "step(t) - step(t - 3)"}).run(progress=False)
    assert list(res.axes) == ["system", "input", "estimator", "parameter"]
    assert res.axes["parameter"] == ("a1", "a2", "b0")
    assert res.bias.shape == (2, 2, 2, 3)
    assert np.isnan(res.bias[1, :, :, 1]).all()
    assert np.isfinite(res.bias[1, :, :, [0, 2]]).all()
    assert len(res.table()) == 2 * 2 * (3 + 2)
    other = study(model=mf.TransferFunction(poles=1, zeros=0)).run(progress=False)
    assert np.isnan(other.truth).all()
    assert np.isnan(other.bias).all()
    assert np.isfinite(other.sd).all()


# Functions ---------------------------------------------------------------------------------------


def test_a_function_gets_the_records_of_the_core() -> None:
    def mine(rec: mf.Record, rng: np.random.Generator) -> mf.Fit:
        return mf.fit(rec, TF2, method="ls", **REPORT)

    est = mf.Estimator(TF2, method="ls", **REPORT)
    res = study(estimators={"mine": mine, "core": est}, initial_state="random", replicates=40, nsr=[0.1, 0.5])
    found = res.run(keep="samples", progress=False)
    assert found.samples is not None
    np.testing.assert_allclose(found.samples[:, 0], found.samples[:, 1], rtol=1e-10)
    for name in ("bias", "sd", "sd_mcse", "rmse", "rmse_mcse", "coverage", "coverage_mcse"):
        values = getattr(found, name)
        np.testing.assert_allclose(values[:, 0], values[:, 1], rtol=1e-8, atol=1e-12, err_msg=name)


def test_what_a_function_raises_is_counted_and_kept() -> None:
    def moody(rec: mf.Record, rng: np.random.Generator) -> dict[str, float]:
        if rng.random() < 0.3:
            raise RuntimeError("bad day")
        return {"a1": 3.0, "a2": float("nan") if rng.random() < 0.2 else 8.0, "b0": 5.0}

    first, again = (study(estimators={"moody": moody}).run(progress=False) for _ in range(2))
    raised = int(first.status["raised"][0])
    assert 5 <= raised <= 25
    assert first.status["nonfinite"][0] > 0
    assert first.failures[0] == raised + first.status["nonfinite"][0]
    counts = dict(zip(first.messages["text"], first.messages["count"], strict=True))
    assert counts == {"RuntimeError: bad day": raised, "returned a2 = nan": first.status["nonfinite"][0]}
    assert first.messages == again.messages  # the generator is addressed by replicate
    row = list(counts).index("RuntimeError: bad day")
    _, fits = first.replicate(int(first.messages["replicate"][row]))
    assert isinstance(fits["moody"], RuntimeError)


def test_rivals_take_part() -> None:
    res = study(estimators={"oe": mf.rivals.output_error(TF2), "ml": "ml"}, replicates=10).run(progress=False)
    assert res.failures.sum() == 0
    assert np.all(np.abs(res.bias[0] - res.bias[1]) < 3 * res.bias_mcse[1])
    assert res.seconds["oe"] > res.seconds["ml"] > 0


# What is refused ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "cure"),
    [
        ({"noise": "pink"}, "function of"),
        ({"generate": lambda cell, rng: None}, "generate"),
        ({"nsr": -0.1}, "at least 0"),
        ({"nsr": "loud"}, "number or a list"),
        ({"nsr": []}, "flat list"),
        ({"nsr": [0.1, 0.1]}, "each once"),
        ({"nsr": [0.1, np.nan]}, "finite"),
        ({"replicates": 0}, "whole number from 1"),
        ({"replicates": 10.5}, "whole number"),
        ({"seed": -1}, "from 0"),
        ({"system": 3}, "mf.tf"),
        ({"system": {}}, "at least one name"),
        ({"system": {1: SYSTEM}}, "texts"),
        ({"model": mf.TransferFunction(poles=2), "system": mf.tf([[[1]], [[2]]], [1, 1])}, "share"),
        ({"input": "sin(x)"}, "allowed"),
        ({"input": np.zeros(5)}, "one value a time"),
        ({"input": ["t", "t"]}, "one per system input"),
        ({"input": "0"}, "moves"),
        ({"duration": 0.0}, "seconds above 0"),
        ({"intervals": 0}, "whole number from 1 to 10000000"),
        ({"initial_state": "rest"}, "'zero', 'random'"),
        ({"initial_state": [1.0]}, "2 states"),
        ({"initial_state": lambda rng: [0]}, "shape"),
        ({"estimators": []}, "list of method names"),
        ({"estimators": "ml"}, "list of method names"),
        ({"estimators": ["mle"]}, "ml"),
        ({"estimators": ["ml", "ml"]}, "dict from names"),
        ({"estimators": [mf.Estimator(TF2)]}, "give a dict"),
        ({"estimators": {"x": 3}}, "function of"),
        ({"estimators": {" ": "ml"}}, "names of estimators"),
        ({"estimators": {1: "ml"}}, "names of estimators"),
        ({"estimators": {"x": mf.Estimator(TF2)}, "harmonics": 6}, "mf.Estimator"),
        ({"model": SYSTEM}, "structure"),
        ({"harmonic": 6}, "harmonics"),
        ({"harmonics": 6, "band": 3.0}, "one of them"),
        ({"method": "ml"}, "estimators="),
        ({"estimators": {"x": lambda rec, rng: {"a1": 1.0}}}, "b0"),
        ({"estimators": {"x": lambda rec, rng: [1.0]}}, "shape"),
        ({"estimators": {"x": lambda rec, rng: None}}, "return"),
    ],
)
def test_bad_studies(changes: dict[str, Any], cure: str) -> None:
    with pytest.raises((mf.SpecError, mf.DataError), match=cure):
        study(**changes).run(progress=False)


@pytest.mark.parametrize(
    ("options", "cure"),
    [
        ({"keep": "all"}, "summary"),
        ({"draw": "bits"}, "coefficients"),
        ({"coverage": "yes"}, "True or False"),
        ({"threads": 0}, "from 1"),
        ({"progress": "bar"}, "auto"),
    ],
)
def test_bad_runs(options: dict[str, Any], cure: str) -> None:
    with pytest.raises(mf.SpecError, match=cure):
        study().run(**options)


def test_functions_need_samples() -> None:
    with pytest.raises(mf.SpecError, match="draw='samples'"):
        study(estimators={"x": lambda rec, rng: [1, 2, 3]}).run(draw="coefficients")


@pytest.mark.parametrize(
    ("number", "cell", "cure"),
    [
        (50, {"nsr": 0.1}, "0 to 49"),
        (-1, {"nsr": 0.1}, "0 to 49"),
        (1.0, {"nsr": 0.1}, "number"),
        (0, {}, "which nsr.* --cell nsr=0.1"),
        (0, {"nsr": 0.15}, "not in the study"),
        (0, {"nsr": 0.1, "noise": 1}, "no axis"),
    ],
)
def test_bad_addresses(number: Any, cell: dict[str, Any], cure: str) -> None:
    with pytest.raises(mf.SpecError, match=cure):
        study(nsr=[0.1, 0.2]).run(progress=False).replicate(number, **cell)


# Looks, progress and Ctrl-C ----------------------------------------------------------------------


def test_plot() -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")

    res = study(nsr=[0.0, 0.2], initial_state={"zero": "zero", "random": "random"}).run(progress=False)
    axes = res.plot()
    assert axes.shape == (4,)
    assert "%" in axes[0].get_ylabel()
    with pytest.raises(mf.SpecError, match="one noise level"):
        study().run(progress=False).plot()


def test_progress_is_silent_when_quick_and_says_lines_when_asked(capfd: pytest.CaptureFixture[str]) -> None:
    study().run()
    assert capfd.readouterr().err == ""
    study(estimators={"x": lambda rec, rng: [1, 2, 3]}).run(progress=True)
    assert "x: 1 of 50" in capfd.readouterr().err
