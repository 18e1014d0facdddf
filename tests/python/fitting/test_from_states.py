"""State spaces from given states: little noise, the bound, several records, refusals."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import modfun as mf
import numpy as np
import pytest
from modfun.results.known_start import contradicted_p

MOTION = mf.StateSpace([["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"], inputs=["de"])
DERIVATIVES = {"Za": -0.8, "Ma": -4.5, "Mq": -1.2, "Zd": -0.1, "Md": -5.0}
TRUTH = np.array(list(DERIVATIVES.values()))
STATE = [0.05, -0.1]
STEP = 0.02 + 0.08 * (np.arange(151) >= 15)


def record(state: Any = STATE, **words: Any) -> mf.Record:
    told = {"input": STEP, "duration": 3.0, "intervals": 150, "intersample": "zoh"}
    channels = {"outputs": ["alpha", "q"], "inputs": ["de"]}
    return mf.simulate(MOTION.model(DERIVATIVES), initial_state=state, **(told | words), **channels)


@pytest.mark.parametrize("trend", [None, "constant"])
@pytest.mark.parametrize(
    "told",
    [{}, {"input": 0.05 * np.cos(np.linspace(0, 6, 151)), "intersample": "smooth"}],
    ids=["zoh", "smooth"],
)
def test_next_to_exact_under_little_noise(told: dict[str, Any], trend: str | None) -> None:
    rec = record(nsr=2e-3, seed=1, **told)
    fit = mf.fit(rec, MOTION, initial_state=STATE, trend=trend)
    np.testing.assert_allclose(fit.params, TRUTH, rtol=0.03)
    assert np.all(np.abs(fit.params - TRUTH) < 4 * fit.bse)


@pytest.mark.statistics
def test_scatter_is_that_of_the_bound() -> None:
    """60 records with an offset: scatter over the bound 0.68 to 1.32, coverage from 83 % (1 in 1,000)."""
    clean = record()
    sigma = 0.05 * np.sqrt(np.mean(clean.y**2, axis=1))
    words = {"params": DERIVATIVES, "sigma": sigma, "trend": "constant"}
    known = mf.crlb(MOTION, clean, initial_state=STATE, **words).sd
    assert np.max(mf.crlb(MOTION, clean, start=STATE, **words).sd / known) > 3
    errors, inside = [], []
    for seed in range(60):
        noise = sigma[:, None] * np.random.default_rng(seed).standard_normal(clean.y.shape)
        rec = clean.assign(alpha=clean["alpha"] + noise[0] + 0.03, q=clean["q"] + noise[1])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            fit = mf.fit(rec, MOTION, initial_state=STATE)
        low, high = fit.conf_int().T
        errors.append((fit.params - TRUTH) / known)
        inside.append((low < TRUTH) & (high > TRUTH))
    spread = np.sqrt(np.mean(np.square(errors), axis=0))
    assert np.all((spread > 0.68) & (spread < 1.32)), spread
    assert np.all(np.mean(inside, axis=0) > 0.83), np.mean(inside, axis=0)


def test_records_from_states_of_their_own(tmp_path: Path) -> None:
    states = [STATE, [-0.1, 0.2]]
    records = [record(state, nsr=0.02, seed=k) for k, state in enumerate(states)]
    fit, free = (mf.fit(records, MOTION, initial_state=own, trend=None) for own in (states, "unknown"))
    assert fit.param_names == free.param_names
    assert np.all(np.abs(fit.params - TRUTH) < 4 * fit.bse)
    assert fit.structure == MOTION
    np.testing.assert_array_equal(fit.initial_state(1).state, states[1])
    assert np.max(np.abs(fit.predict(1).y - record(states[1]).y)) < 0.01
    assert dict(fit.summary().facts)["Start"].startswith("0.05, -0.1; -0.1, 0.2, taken as known")
    fit.save(tmp_path / "fit.json")
    np.testing.assert_array_equal(mf.load(tmp_path / "fit.json").params, fit.params)


def test_a_false_state_is_said() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit = mf.fit(record(nsr=0.02, seed=1), MOTION, initial_state=[0.0, 0.1], trend=None)
    assert "does not begin in the given state (p = " in str(fit.check())
    assert contradicted_p(mf.fit(record(nsr=0.02, seed=1), MOTION, initial_state=STATE)) > 0.01


@pytest.mark.parametrize(
    ("model", "state", "said"),
    [
        (MOTION, [0.1], "the states alpha, q; give 2 numbers"),
        (mf.StateSpace([["a"]], [["b"]], [["c"]], inputs=["de"], outputs=["q"]), [0.1], "numbers alone"),
        (mf.StateSpace([["a"]], [["b"]], [[1]], [["d"]], inputs=["de"], outputs=["q"]), [0.1], "D = 0"),
    ],
)
def test_what_cannot_begin_in_a_state(model: mf.StateSpace, state: list[float], said: str) -> None:
    with pytest.raises(mf.errors.SpecError, match=said):
        mf.fit(record(), model, initial_state=state)
