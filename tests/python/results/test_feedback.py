"""Noise that a loop feeds back: seen, with its bias, and not where there is none."""

from __future__ import annotations

import warnings

import loops
import modfun as mf
import numpy as np
import pytest
from loops import LEVEL, MODEL
from modfun.results.feedback import feedback
from scipy.signal import lfilter


def said(rec: mf.Record, model: mf.TransferFunction = MODEL, **words: object) -> str:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        mf.fit(rec, model, **words)  # type: ignore[arg-type]
    return "; ".join(str(one.message) for one in caught)


def test_a_loop_warns_with_the_cure_that_helps() -> None:
    """20 records at 30 % noise, where the bias is 0.85 standard deviations: of 60 others 93 % warned; fewer
    than 15 of 20 have a chance of 0.003. `check` finds it in at least as many.
    """
    warned = 0
    for seed in range(100, 120):
        rec = loops.record(LEVEL, seed)
        text = said(rec)
        warned += "u follows earlier residuals of y" in text and 'reference="r"' in text
        assert "follows earlier" not in said(rec, reference="r")
    assert warned >= 15


@pytest.mark.statistics
def test_the_bias_is_about_right() -> None:
    """Over 60 records the mean of what is said is 0.7 to 2 times the largest bias: its own scatter is 0.3
    standard errors per record, and it is the largest of three.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fits = [mf.fit(loops.record(LEVEL, seed), MODEL) for seed in range(60)]
    found = [feedback(fit) for fit in fits]
    told = np.mean([one.bias for one in found if one])
    errors = np.array([fit.params for fit in fits]) - loops.TRUTH
    true = np.max(np.abs(errors.mean(axis=0) / errors.std(axis=0)))
    assert true > 0.5
    assert 0.7 < told / true < 2.0


@pytest.mark.parametrize("pole", [0.0, 0.9])
@pytest.mark.parametrize("kind", ["sweep", "held noise", "loop without noise"])
def test_open_loops_do_not_warn(kind: str, pole: float) -> None:
    """40 records each; a chance of 1e-4 per record at the stated level."""
    rng = np.random.default_rng(1)
    system, words = mf.tf([5], [1, 3, 8]), {"duration": 20.0, "intervals": 400}
    if kind == "sweep":
        clean = mf.simulate(system, input="sin(t**2/5)", **words)
    elif kind == "held noise":
        u = lfilter([1], [1, -0.9], rng.standard_normal(401))
        clean = mf.simulate(system, input=u, intersample="zoh", **words)
    else:
        clean = loops.record(0.0, 0)
    count, size = clean.t.size, clean["y"].std()
    for _ in range(40):
        white = rng.standard_normal(count + 200)
        noise = lfilter([np.sqrt(1 - pole**2)], [1, -pole], white)[200:]
        fit = mf.fit(clean.assign(y=clean["y"] + 0.1 * size * noise), MODEL)
        assert not any("earlier residuals" in text for text in fit.check())
