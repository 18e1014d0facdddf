"""Residuals of a dozen samples that follow each other: their test, its law, and what fits say of it."""

from __future__ import annotations

import warnings

import modfun as mf
import numpy as np
import pytest
from modfun.results.serial import durbin_watson

HOURS = np.array([0, 0.01, 0.25, 0.5, 0.75, 1, 1.5, 2, 3, 4, 6, 8, 10, 12, 24.0])
TRUE = {"V": 20.0, "ka": 1.2, "ke": 0.25}
ONE = mf.Equation(
    ["g' = -ka*g + u", "c' = ka*g/V - ke*c"],
    outputs=["c"],
    hidden=["g"],
    params={"V": mf.Free(15, min=1), "ka": mf.Free(1, min=0.7), "ke": mf.Free(0.2, min=0, max=0.6)},
)
TWO = mf.Equation(
    ["g' = -ka*g + u", "c' = ka*g/V - ke*c - k12*c + k21*p", "p' = k12*c - k21*p"],
    outputs=["c"],
    hidden=["g", "p"],
)


def subject(model: mf.NonlinearModel, seed: int, sd: float = 0.1) -> mf.Record:
    dose = np.zeros(HOURS.size)
    dose[0] = 100 / 0.01
    c = model.simulate(u=dose, t=HOURS, intersample="zoh")
    c = c * np.exp(sd * np.random.default_rng(seed).standard_normal(c.size))
    return mf.Record(y=c, u=dose, t=HOURS, mask=HOURS != 0.01, outputs=["c"], intersample="zoh")


def fitted(*records: mf.Record) -> tuple[mf.Fit, str]:
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        fit = mf.fit(records, ONE, initial_state="zero", noise="log-normal")
    return fit, " ".join(str(one.message) for one in seen)


def test_probability_is_that_of_white_noise():
    """The law given the columns, in the middle and in the tail, to 4 standard errors of 40,000 draws."""
    rng = np.random.default_rng(1)
    columns = np.vstack([np.ones(14), np.arange(14.0), np.arange(14.0) ** 2])
    columns[2, 8:] = 0.0
    sizes = 8, 6
    q = np.linalg.qr(columns.T)[0]
    noise = rng.standard_normal((40_000, 14))
    noise -= (noise @ q) @ q.T
    steps = [np.diff(part, axis=1) for part in np.split(noise, [sizes[0]], axis=1)]
    found = sum(np.sum(step**2, axis=1) for step in steps) / np.sum(noise**2, axis=1)
    for level in (0.002, 0.01, 0.1, 0.5, 0.9):
        draw = int(np.argsort(found)[round(level * len(found))])
        statistic, p = durbin_watson(np.split(noise[draw], [sizes[0]]), columns)
        assert statistic == pytest.approx(found[draw])
        assert p == pytest.approx(level, abs=4 * np.sqrt(level * (1 - level) / len(found)) + 0.03 * level)


def test_second_compartment_is_missed():
    fit, said = fitted(subject(TWO.model({**TRUE, "k12": 0.4, "k21": 0.2}), 0))
    assert fit.success
    assert "follow each other from sample to sample" in said
    assert "second compartment" in said
    assert any("follow each other from sample to sample" in text for text in fit.check())


def test_several_subjects_are_one_test():
    truth = TWO.model({**TRUE, "k12": 0.4, "k21": 0.2})
    _, said = fitted(*[subject(truth, seed, 0.1) for seed in (1, 2, 3)])
    assert "follow each other from sample to sample" in said


@pytest.mark.parametrize("seed", range(4))
def test_right_structure_leaves_nothing_to_say(seed):
    """At most 1 % of right fits have the doubt, and 0.2 % a warning; these are fixed seeds."""
    fit, said = fitted(subject(ONE.model(TRUE), seed))
    assert said == ""
    assert not any("follow each other" in text or "is missing" in text for text in fit.check())


BOLUS = mf.Equation(
    "c' = -CL/V*c + u/V", outputs=["c"], params={"V": mf.Free(15, min=1), "CL": mf.Free(3, min=0)}
)
SAMPLED = np.array([0, 0.01, 0.25, 0.5, 1, 2, 3, 4, 6, 8, 12.0])


def bolus(volume: float, clearance: float, rng: np.random.Generator) -> mf.Record:
    dose = np.where(np.arange(SAMPLED.size) == 0, 100 / 0.01, 0.0)
    c = 100 / volume * np.exp(-clearance / volume * SAMPLED + 0.08 * rng.standard_normal(SAMPLED.size))
    c[0] = 0.0
    return mf.Record(y=c, u=dose, t=SAMPLED, mask=SAMPLED != 0.01, outputs=["c"], intersample="zoh")


@pytest.mark.parametrize(("scatter", "seed"), [(0.25, 0), (0.25, 1), (0.25, 4), (0.0, 0), (0.0, 1), (0.0, 2)])
def test_subjects_that_differ_ask_for_no_second_compartment(scatter, seed):
    """Six subjects of one compartment each; where they are alike nothing is said (false alarms 0.2 %)."""
    rng = np.random.default_rng(seed)
    sizes = np.array([20, 4]) * np.exp(scatter * rng.standard_normal((6, 2)))
    records = [bolus(*size, rng) for size in sizes]
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        fit = mf.fit(records, BOLUS, initial_state="zero", noise="log-normal")
    said = " ".join(str(one.message) for one in seen)
    assert ("The records disagree on the parameters" in said) == (scatter > 0)
    assert "compartment" not in said + " ".join(fit.check())
