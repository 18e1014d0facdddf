"""Criteria of fits of few uneven samples: those of the samples, as by hand."""

import warnings

import modfun as mf
import numpy as np
import pytest

HOURS = np.array([0, 0.5, 1, 1.25, 1.5, 2, 3, 4, 6, 8, 12, 16, 24.0])
DOSE = np.where(HOURS < 1, 100.0, 0.0)
FREE = {name: mf.Free(0.3, min=0) for name in ("k", "k12", "k21")} | {"V": mf.Free(10, min=0.5)}
ONE = mf.Equation("c' = u/V - k*c", outputs=["c"], params={name: FREE[name] for name in ("V", "k")})
TWO = mf.Equation(
    ["c' = u/V - k*c - k12*c + k21*q/V", "q' = k12*V*c - k21*q"], outputs=["c"], hidden=["q"], params=FREE
)
TRUTH = {"V": 10.0, "k": 0.3, "k12": 0.6, "k21": 0.25}


def record(seed, noise):
    c = np.ravel(TWO.model(TRUTH).simulate(u=DOSE, t=HOURS, intersample="zoh"))
    white = np.random.default_rng(seed).standard_normal(c.size)
    y = c * np.exp(0.07 * white) if noise == "log-normal" else c + 0.1 * white
    return mf.Record(y=y, u=DOSE, t=HOURS, outputs=["c"], intersample="zoh")


def fitted(records, noise):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # one compartment does not suit
        return {
            name: mf.fit(records, model, initial_state="zero", noise=noise)
            for name, model in (("one", ONE), ("two", TWO))
        }


def by_hand(fit, rec, noise):
    """AIC of the samples; at zero no logarithm counts."""
    y, m = rec.y[0], np.ravel(fit.model.simulate(u=DOSE, t=HOURS, intersample="zoh"))
    left = np.log(y[1:] / m[1:]) if noise == "log-normal" else y - m
    return left.size * np.log(np.mean(left**2)), left.size


@pytest.mark.parametrize("noise", ["log-normal", "output"])
@pytest.mark.parametrize("seed", range(3))
def test_criteria_are_those_of_the_samples_by_hand(noise, seed):
    """BIC of two compartments, the truth, was 61 to 82 higher than that of one, or nan."""
    rec = record(seed, noise)
    fits = fitted(rec, noise)
    table = mf.compare(fits)
    for k, fit in enumerate(fits.values()):
        log, n = by_hand(fit, rec, noise)
        assert table["aic"][k] == pytest.approx(log + 2 * fit.params.size, abs=0.1)
        assert table["bic"][k] == pytest.approx(log + fit.params.size * np.log(n), abs=0.1)
    assert f"at the {n} samples" in table.title
    assert table["bic"][1] < table["bic"][0] - 20
    test = table.likelihood_ratio("one", "two")
    assert test["minus_2_log"][0] == pytest.approx(table["aic"][0] - table["aic"][1] + 4)
    assert (test["df"][0], test["df_resid"][0]) == (2, n - 4)
    assert test["p_value"][0] < 1e-4
    assert test.title is None


def test_subjects_have_levels_of_their_own():
    records = [record(seed, "log-normal") for seed in range(4)]
    fits = fitted(records, "log-normal")
    table = mf.compare(fits, records[0])
    for k, fit in enumerate(fits.values()):
        log = sum(by_hand(fit, rec, "log-normal")[0] for rec in records)
        assert table["aic"][k] == pytest.approx(log + 2 * fit.params.size, abs=0.1)
    assert table["bic"][1] < table["bic"][0] - 100


def test_a_larger_model_that_explains_less_is_not_tested():
    """−2 log Λ of −73 had the p-value 1, without a word."""
    rec = record(0, "output")
    fits = fitted(rec, "output")
    # Not nested: a dose that is a hundredth of what it was.
    texts = [TWO.texts[0].replace("u/V", "u/1000"), *TWO.texts[1:]]
    held = mf.Equation(texts, outputs=["c"], hidden=["q"], params=FREE)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        worse = mf.fit(rec, held, initial_state="zero")
    test = mf.compare({"one": fits["one"], "worse": worse}).likelihood_ratio("one", "worse")
    assert test["minus_2_log"][0] < -0.1
    assert np.isnan([test["F"][0], test["p_value"][0]]).all()
    assert "'worse' explains less than 'one'" in test.title


def test_why_criteria_do_not_compare_is_said():
    one = fitted(record(0, "output"), "output")["one"]
    log = fitted(record(0, "output"), "log-normal")["one"]
    table = mf.compare({"even": one, "log": log}, one.records[0])
    assert np.isnan(table["aic"]).all()
    assert table.title.startswith("aic and bic do not compare: the fits ")
