"""Two estimators of a study compared on the same records."""

from typing import Any

import modfun as mf
import numpy as np
import pytest

STUDY = mf.MonteCarlo(
    system=mf.tf([5], [1, 3, 8]),
    input="sin(t**2/5)",
    duration=10.0,
    intervals=256,
    nsr=[0.1, 0.4],
    estimators=["ls", "awls", "ml"],
    seed=3,
)


@pytest.fixture(scope="module")
def res() -> Any:
    return STUDY.run(replicates=400, progress=False, keep="samples")


def test_differences_are_those_of_the_figures(res: Any) -> None:
    table = res.compare("ls", "ml")
    assert len(table) == 6
    for row in table:
        at = res.axes["nsr"].index(row["nsr"]), res.param_names.index(row["parameter"])
        for name in ("rmse", "bias"):
            both = [getattr(res, name)[at[0], k, at[1]] for k in (0, 2)]
            assert row[name] == pytest.approx(both[0] - both[1], rel=1e-6, abs=1e-9)
            assert row[f"{name}_z"] == pytest.approx(row[name] / row[f"{name}_mcse"])
        assert row["count"] == 400
    other = res.sel(nsr=0.4).compare("ml", "ls")
    np.testing.assert_allclose(other["rmse"], -table["rmse"][3:])
    np.testing.assert_allclose(other["closer"], 1 - table["closer"][3:])


def test_errors_are_those_of_refitted_studies(res: Any) -> None:
    """100 studies of 40 replicates tell a standard deviation to 7 %."""
    samples = STUDY.run(replicates=4000, progress=False, keep="samples").samples
    errors = samples[0][1:] - res.truth[0, 1:][:, None]
    parts = errors.reshape(2, 100, 40, 3)
    rmse = np.sqrt(np.mean(parts**2, axis=2))
    scatter = np.std(rmse[0] - rmse[1], axis=0) * np.sqrt(40 / 400)
    told = res.sel(nsr=0.1).compare("awls", "ml")["rmse_mcse"]
    np.testing.assert_allclose(told, scatter, rtol=0.35)
    alone = res.rmse_mcse[0, 1]
    assert np.all(told < alone)  # they share the noise


def test_estimates_have_to_be_kept(res: Any) -> None:
    with pytest.raises(mf.SpecError, match='keep="samples"'):
        STUDY.run(replicates=20, progress=False).compare("ls", "ml")
    with pytest.raises(mf.SpecError, match="there is no estimator 'oe'"):
        res.compare("oe", "ml")
    with pytest.raises(mf.SpecError, match="compared with itself"):
        res.compare("ml", "ml")
