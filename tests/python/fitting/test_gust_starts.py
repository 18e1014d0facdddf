"""Fits in gusts settle where a start that gives all noise to the sensors, or few lines, leads away."""

import modfun as mf
import numpy as np
import pytest
from modfun.fitting.single import fit_quietly
from modfun.models.options import Options

SHORT_PERIOD = mf.StateSpace(
    [["Za", 1], ["Ma", "Mq"]],
    [["Zd", "Za"], ["Md", "Ma"]],
    states=["alpha", "q"],
    inputs=["de", "gust"],
)
TRUTH = {"Za": -1.2, "Ma": -4.0, "Mq": -1.6, "Zd": -0.1, "Md": -6.0}
ELEVATOR = "0.02*(sign(sin(0.9*t)) + sign(sin(1.7*t + 1)))"


@pytest.mark.parametrize("seed", [0, 1, 12])
def test_strong_gusts_settle(seed: int) -> None:
    """These three of 20 ended in "rank" and "maxiter". Of 79 records 78 are within 4 standard errors."""
    rec = mf.simulate(
        SHORT_PERIOD.model(TRUTH),
        input=ELEVATOR,
        duration=15,
        intervals=750,
        nsr=0.05,
        process_noise=mf.ProcessNoise(gust=mf.dryden(1.0, 0.05)),
        seed=seed,
    )
    fit = mf.fit(rec, SHORT_PERIOD, noise=mf.ProcessNoise(gust=mf.dryden(1.0)))
    assert fit.status == "ok"
    truth = np.array([TRUTH[name] for name in fit.param_names])
    assert np.max(np.abs(fit.params - truth) / fit.bse) < 4


LATERAL = {
    "Yb": -0.25, "Lb": -6.0, "Lp": -4.5, "Lr": 1.2, "Nb": 4.0, "Np": -0.35, "Nr": -0.7,
    "Yd": 0.03, "La": -12.0, "Ld": 0.8, "Na": -0.3, "Nd": -3.5,
}  # fmt: skip
YAW = [["Yb", 0, -1, 0.1962], ["Lb", "Lp", "Lr", 0], ["Nb", "Np", "Nr", 0], [0, 1, 0, 0]]
MOVED = [[0, "Yd"], ["La", "Ld"], ["Na", "Nd"], [0, 0]]
AIRCRAFT = mf.StateSpace(YAW, MOVED, states=["beta", "p", "r", "phi"], inputs=["da", "dr"])
IN_GUSTS = mf.StateSpace(
    YAW,
    [[*row, by] for row, by in zip(MOVED, ["Yb", "Lb", "Nb", 0], strict=True)],
    np.eye(4).tolist(),
    [[0, 0, 1], [0, 0, 0], [0, 0, 0], [0, 0, 0]],
    states=["drift", "p", "r", "phi"],
    inputs=["da", "dr", "gust"],
    outputs=["beta", "p", "r", "phi"],
)
RUDDER = "2*(tanh(20*(t - 2)) - 2*tanh(20*(t - 3)) + tanh(20*(t - 4)))"
AILERON = "1.5*(tanh(20*(t - 11)) - tanh(20*(t - 14)))"


def doublet_and_step(seed: int) -> mf.Record:
    """25 s of lateral motion, a doublet of the rudder and a step of the ailerons, in turbulence."""
    return mf.simulate(
        IN_GUSTS.model(LATERAL),
        input=[AILERON, RUDDER],
        duration=25,
        intervals=1250,
        nsr=0.02,
        process_noise=mf.ProcessNoise(gust=mf.dryden(1.0, 0.8)),
        seed=seed,
    )


@pytest.mark.parametrize("seed", [1, 4, 7, 9])
def test_levels_do_not_run_away_from_few_lines(seed: int) -> None:
    """They were 1,790, 30, 18 and 18 times the motion, seed 1 without an end; of 20 records now below 6."""
    rec = doublet_and_step(seed)
    fit = fit_quietly((rec,), AIRCRAFT, Options())
    assert fit.success
    assert fit.band_rule is not None
    assert fit.options.band is None
    assert np.all(fit.noise_levels < 6 * rec.y.std(axis=1))
    assert abs(fit["Nb"] - 4) < 1.2
