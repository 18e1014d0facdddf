"""A study whose system is a state space with numbers knows the parameters of the structure it was made by."""

from dataclasses import replace

import modfun as mf
import numpy as np
import pytest

SHORT = mf.StateSpace([["Zw", 1], ["Mw", "Mq"]], [["Zd"], ["Md"]], inputs=["de"], states=["w", "q"])
VALUES = {"Zw": -1.0, "Mw": -5.0, "Mq": -2.0, "Zd": 0.1, "Md": -4.0}


def test_truth_coverage_and_bound() -> None:
    """Over 60 replicates a ratio of standard deviations scatters by 9 %; the limits are 3.5 times that."""
    study = mf.MonteCarlo(
        system=SHORT.model(VALUES), input="sin(t**2/4)", duration=10.0, intervals=200, nsr=[0.05, 0.1],
        replicates=60, estimators={"ml": mf.Estimator(SHORT)}, seed=0,
    )  # fmt: skip
    res = study.run(progress=False)
    assert np.array_equal(res.truth[0, 0], list(VALUES.values()))
    assert np.all(np.abs(res.bias / res.bias_mcse) < 4)
    assert np.all(res.coverage > 0.85)
    assert np.all(np.abs(res.sd / res.crlb - 1) < 0.32)
    own = mf.crlb(SHORT, mf.simulate(SHORT.model(VALUES), input="sin(t**2/4)", duration=10.0, intervals=200),
                  params=VALUES, nsr=0.05, trend="constant")  # fmt: skip
    np.testing.assert_allclose(res.crlb[0, 0], own.sd, rtol=1e-5)  # samples for the text


def test_theta_is_read_off_the_matrices() -> None:
    assert np.array_equal(SHORT.theta(SHORT.model(VALUES)), list(VALUES.values()))
    held = mf.StateSpace([[0, 1], ["-k", "c"]], [[0], ["b"]], params={"c": -0.4})
    with pytest.raises(mf.SpecError, match=r"StateSpace\.theta: the system is none"):
        held.theta(held.model([2.0, 1.0]))  # k stands alone nowhere
    twisted = [[-1, 2], [-5, -2]], [[0.1], [-4]], np.eye(2)
    other = replace(mf.ss(*twisted), inputs=("de",), outputs=("w", "q"))
    with pytest.raises(mf.SpecError, match="none of this structure"):
        SHORT.theta(other)
    study = mf.MonteCarlo(
        system=other, input="sin(t**2/4)", duration=10.0, intervals=100, nsr=0.05, replicates=4,
        estimators={"ml": mf.Estimator(SHORT)},
    )  # fmt: skip
    assert np.isnan(study.run(progress=False).truth).all()
