"""Results as pandas frames and xarray data sets: the same numbers, dimensions by their names."""

from __future__ import annotations

import modfun as mf
import numpy as np
import pytest

pytest.importorskip("pandas")
pytest.importorskip("xarray")

SYSTEM = mf.tf([5], [1, 3, 8])
TF2 = mf.TransferFunction(poles=2, zeros=0)


@pytest.mark.parametrize("keep", ["summary", "samples"])
def test_a_study(keep: str) -> None:
    res = mf.MonteCarlo(
        system={"one": SYSTEM, "two": mf.tf([1, 2], [1, 0.5, 4])},
        input="sin(t**2/5)",
        duration=10.0,
        intervals=128,
        nsr=[0.1, 0.4],
        estimators=["ls", "ml"],
        replicates=20,
    ).run(keep=keep, progress=False)
    frame, data = res.to_pandas(), res.to_xarray()
    assert frame.columns.tolist() == list(res.table().columns)
    assert len(frame) == 2 * 2 * (3 + 4)  # the zero of "two" is not a parameter of "one"
    row = frame[(frame.system == "two") & (frame.nsr == 0.4) & (frame.estimator == "ml")].iloc[1]
    one = data.sel(system="two", nsr=0.4, estimator="ml", parameter="a2")
    for name in ("bias", "bias_mcse", "sd", "sd_mcse", "rmse", "median", "coverage", "coverage_mcse", "crlb"):
        assert row[name] == one[name].item() == getattr(res, name)[1, 1, 1, 1]
    assert data.bias.dims == ("system", "nsr", "estimator", "parameter")
    assert data.failures.dims == ("system", "nsr", "estimator")
    assert data.status_ok.sel(system="one", nsr=0.1, estimator="ls").item() == 20
    assert data.attrs == {"replicates": 20, "seed": 0}
    assert ("samples" in data) == (keep == "samples")
    if keep == "samples":
        assert data.samples.dims == ("system", "nsr", "estimator", "replicate", "parameter")
        np.testing.assert_array_equal(data.samples.values, res.samples)


def test_many_fits() -> None:
    records = [mf.simulate(SYSTEM, input="sin(t**2/5)", duration=10.0, intervals=128, nsr=0.1, replicate=k)
               for k in range(12)]  # fmt: skip
    many = mf.fit_many(records, TF2)
    frame, data = many.to_pandas(), many.to_xarray()
    assert frame.columns.tolist() == ["a1", "a2", "b0", "a1_bse", "a2_bse", "b0_bse", "status", "cost", "nit"]
    np.testing.assert_array_equal(frame["a2_bse"], many.bse[:, 1])
    np.testing.assert_array_equal(data.params.sel(parameter="b0"), many["b0"])
    assert data.bse.dims == ("replicate", "parameter")
    assert data.status.values.tolist() == ["ok"] * 12
