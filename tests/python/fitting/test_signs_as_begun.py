"""Of parameters that make the same equations, those nearest to the given starts are estimated."""

import modfun as mf
import numpy as np
import pytest

TRUTH = {"r": 0.5, "K": 100.0, "A": 20.0}


def allee(K: float, A: float) -> mf.Equation:
    return mf.Equation(
        "N' = r*N*(1 - N/K)*(N/A - 1)",
        outputs=["N"],
        params={"A": mf.Free(A, min=1), "K": mf.Free(K, min=1)},
    )


@pytest.fixture(scope="module")
def records() -> list[mf.Record]:
    clean = mf.simulate(allee(100, 20).model(TRUTH), duration=20, intervals=400, initial_state=[30.0])
    return [
        clean.assign(N=clean["N"] + 2 * np.random.default_rng(seed).standard_normal(401)) for seed in range(4)
    ]


def test_starts_choose(records):
    for rec in records:
        fit = mf.fit(rec, allee(100, 20))
        assert fit["A"] < 30 < 90 < fit["K"]  # 8 of 20 were the other way round
        other = mf.fit(rec, allee(20, 100))
        assert other["K"] == pytest.approx(fit["A"], rel=1e-3)
        assert other["A"] == pytest.approx(fit["K"], rel=1e-3)


@pytest.mark.parametrize("seed", [0, 3])
def test_starts_choose_in_batches(seed):
    clean = mf.simulate(
        allee(100, 20).model(TRUTH | {"r": 0.3}), duration=14, intervals=280, initial_state=[25.0]
    )
    sd = 0.05 * clean["N"].std()
    noise = [sd * np.random.default_rng([seed, k]).standard_normal(281) for k in range(3)]
    found = mf.fit_many([clean.assign(N=clean["N"] + own) for own in noise], allee(100, 20))
    assert np.all(found.params[:, list(found.param_names).index("A")] < 30)  # all were the other way round
