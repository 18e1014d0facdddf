"""Studies of systems that noise drives."""

from pathlib import Path
from typing import Any

import modfun as mf
import numpy as np
import pytest
from modfun.study.frozen import freeze, thaw

SYSTEM, TWO = mf.tf([5], [1, 3, 8]), mf.TransferFunction(poles=2, zeros=0)
BASE: dict[str, Any] = {"input": "sin(t**2/5)", "duration": 10.0, "intervals": 256}
LEVEL = 0.6


@pytest.fixture(scope="module")
def found() -> mf.Results:
    return mf.MonteCarlo(
        system=SYSTEM, **BASE, nsr=[0.05, 0.1], process_noise=LEVEL, seed=5, replicates=300,
        estimators={"output": mf.Estimator(TWO), "process": mf.Estimator(TWO, noise="process")},
    ).run(threads=1, keep="samples")  # fmt: skip


def test_the_bound_the_errors_and_the_intervals(found: mf.Results) -> None:
    """300 records: rmse to 4 %, coverage to 1.3 %; a false alarm in 1,000."""
    rec = mf.simulate(SYSTEM, **BASE)
    bound = mf.crlb(SYSTEM, rec, nsr=0.1, process_noise=LEVEL, trend="constant")
    np.testing.assert_allclose(found.crlb[1], [bound.sd, bound.sd], rtol=1e-6)
    assert np.all(found.crlb[0] < found.crlb[1])
    ratio = found.rmse / found.crlb
    assert np.all(ratio[:, 1] < 1.3)
    assert np.all(ratio[:, 0] > 1.1 * ratio[:, 1])
    assert np.all(np.abs(found.coverage[:, 1] - 0.95) < 0.045)


@pytest.mark.parametrize("levels", [LEVEL, [LEVEL]])
def test_a_replicate_is_that_of_simulate(found: mf.Results, levels: Any) -> None:
    rec, fits = found.replicate(7, nsr=0.1)
    again = mf.simulate(SYSTEM, **BASE, nsr=0.1, process_noise=levels, seed=5, replicate=7)
    np.testing.assert_allclose(rec.y, again.y, atol=1e-14)
    np.testing.assert_array_equal(fits["process"].params, found.samples[1, 1, 7])


def test_gusts_through_an_input_and_a_directory(tmp_path: Path) -> None:
    short = {"states": ["alpha", "q"]}
    model = mf.StateSpace(
        [["Za", 1], ["Ma", "Mq"]], [["Zd", "Za"], ["Md", "Ma"]], inputs=["de", "gust"], **short
    )
    values = {"Za": -1.2, "Ma": -4.0, "Mq": -1.6, "Zd": -0.1, "Md": -6.0}
    noise = mf.ProcessNoise(gust=mf.dryden(1.0, 0.01))
    study = mf.MonteCarlo(
        system=model.model(values), input="0.02*sign(sin(0.9*t))", duration=15.0, intervals=300, nsr=0.05,
        process_noise=noise, seed=2, replicates=5,
        estimators={"gusts": mf.Estimator(model, noise=mf.ProcessNoise(gust=mf.dryden(1.0)))},
    )  # fmt: skip
    found = study.run(directory=tmp_path / "s", keep="samples")
    again = mf.load(tmp_path / "s")
    np.testing.assert_array_equal(found.sd, again.sd)
    rec, fits = again.replicate(3)
    assert rec.inputs == ("de",)
    assert rec.outputs == ("alpha", "q")
    np.testing.assert_allclose(fits["gusts"].params, found.samples[0, 3], rtol=1e-9)


def test_what_is_refused() -> None:
    with pytest.raises(mf.SpecError, match=r"MonteCarlo: process_noise=\[1.0, 2.0\] must be a level"):
        mf.MonteCarlo(system=SYSTEM, **BASE, process_noise=[1.0, 2.0], estimators=["ml"])
    cubic = mf.Equation("y' + a*y**3 = u").model({"a": 1.0})
    with pytest.raises(mf.SpecError, match="MonteCarlo: process_noise= is for linear systems"):
        mf.MonteCarlo(system=cubic, **BASE, process_noise=1.0, estimators=["ml"])


@pytest.mark.parametrize(
    "noise",
    [
        mf.ProcessNoise(w=mf.Numerator(1)),
        mf.ProcessNoise(w=mf.Numerator(2, den=(2.0, 1.0)), gust=mf.dryden(1.0)),
        mf.ProcessNoise(w=0.5),
    ],
)
def test_a_directory_gives_back_filters_and_numerators(noise: mf.ProcessNoise) -> None:
    arrays: dict[str, Any] = {}
    assert thaw(freeze(noise, arrays), arrays) == noise
