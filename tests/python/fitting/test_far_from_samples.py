"""Least squares of masked samples: no end far from a minimum is taken, and known starts stay known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import modfun as mf
import numpy as np
import pytest
from modfun.fitting.by_samples import _Descent, by_samples
from modfun.results.initial_state import slopes

DUFFING = mf.Equation("y'' + d*y' + a*y + b*y**3 = u")
TRUTH = {"d": 0.3, "a": 1.0, "b": 0.5}


def masked(start: tuple[float, float] = (0.3, 0.0), **words: Any) -> Any:
    """The fit of a record 30 % of whose samples are masked."""
    rec = mf.simulate(
        DUFFING.model(TRUTH), input="1.2*sin(1.1*t) + sin(2.3*t)", duration=20, intervals=400, nsr=0.05,
        seed=0, initial_state=start,
    )  # fmt: skip
    return mf.fit(rec.weigh(mask=np.random.default_rng(0).random(401) < 0.7), DUFFING, **words)


def moved(fit: Any, *params: float) -> Any:
    return replace(fit, params=np.array(params))


@pytest.mark.parametrize("astray", [10.0, np.inf])
@pytest.mark.parametrize("params", [(0.1, 5.0, 5.0), (0.02, 4.0, 2.0)])
def test_a_fit_without_lower_steps_far_from_the_samples_stays_as_it_came(
    monkeypatch: pytest.MonkeyPatch, params: tuple[float, ...], astray: float
) -> None:
    """It had moved to a stiffness below zero, with standard errors of a minimum, 18 times the noise away."""
    monkeypatch.setattr("modfun.fitting.by_samples.ASTRAY", astray)
    far = moved(masked(), *params)
    assert by_samples(far) is far


def test_steps_reach_the_minimum_from_where_there_is_a_way() -> None:
    fit = masked()
    found = by_samples(moved(fit, 0.3, 3.0, 0.5))
    np.testing.assert_allclose(found.params, fit.params, atol=0.05 * fit.bse.min(), rtol=0)


def test_a_response_that_comes_no_nearer_ends_the_rounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Outputs that no parameters explain took ten rounds, and 2.7 s where the fit had taken 0.5 s."""
    fit, rounds = masked(), 0
    wave = 3 * np.sin(np.arange(401) / 7) + np.random.default_rng(2).standard_normal(401)
    wrong = replace(fit, records=tuple([rec._like(y=wave[None]) for rec in fit.records]))

    def counted(descent: Any, params: Any, weigh: Any = _Descent._weigh) -> None:
        nonlocal rounds
        rounds += 1
        weigh(descent, params)

    monkeypatch.setattr(_Descent, "_weigh", counted)
    assert by_samples(wrong) is wrong
    assert rounds == 2


def test_a_known_start_is_no_unknown() -> None:
    fit = masked((0.0, 0.0), initial_state="zero")
    descent, rec = _Descent(fit), fit.records[0]
    own = slopes(fit, rec, fit.simulate(rec)[1])[:3].reshape(3, -1)
    weights = (descent.own[0] / descent.levels[0][:, None]).ravel()
    np.testing.assert_allclose(descent._of_integrations(fit), own * weights)
    assert descent._left(fit.params)[1] == np.count_nonzero(rec.mask)
