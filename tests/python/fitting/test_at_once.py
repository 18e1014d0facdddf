"""Held inputs that act at once: held or bounded coefficients, several outputs, batches, studies."""

import modfun as mf
import numpy as np
import pytest

pytestmark = pytest.mark.statistics

N, DT, NSR = 256, 0.1, 0.02
SYSTEMS = {
    "y": mf.tf([1, 3, 13], [1, 3, 8]),
    "z": mf.tf([2, 5], [1, 3, 8]),
    "x": mf.tf([2, 5], [1, 1.5, 4]),
}
U = np.repeat(np.random.default_rng(5).choice([-1.0, 1.0], 40), 7)[: N + 1]
CLEAN = {
    name: mf.simulate(s, input=U, duration=N * DT, intervals=N, intersample="zoh", nsr=0.0).y[0]
    for name, s in SYSTEMS.items()
}
BOUNDED = mf.TransferFunction(poles=2, zeros=2, params={"a1": mf.Free(min=0.0)})
TWO = mf.TransferFunction(poles=2, zeros=[[2], [1]], denominator="common")
CASES = {
    "bounded": (BOUNDED, "y", [3, 8, 1, 3, 13]),
    "held numerator": (mf.TransferFunction(poles=2, zeros=2, params={"b0": 1.0}), "y", [3, 8, 3, 13]),
    "held pole": (mf.TransferFunction(poles=2, zeros=2, params={"a1": 3.0}), "y", [8, 1, 3, 13]),
    "two outputs": (TWO, "yz", [3, 8, 1, 3, 13, 2, 5]),
    "own denominators": (
        mf.TransferFunction(poles=[2, 2], zeros=[[2], [1]], denominator="separate"),
        "yx",
        [3, 8, 1, 3, 13, 1.5, 4, 2, 5],
    ),
}


def samples(outputs, seed):
    clean = np.array([CLEAN[name] for name in outputs])
    noise = np.random.default_rng(seed).standard_normal(clean.shape)
    return clean + NSR * clean.std(axis=1, keepdims=True) * noise


@pytest.mark.parametrize("case", CASES)
def test_errors_are_those_of_the_noise(case):
    """40 records, each bound four standard errors away: false alarms below 1e-3.

    The median of |t| is 0.67 ± 0.12, the mean of t 0 ± 0.16. Both were 1.2 to 7 with two rounds.
    """
    structure, outputs, truth = CASES[case]
    t = []
    for seed in range(40):
        rec = mf.Record(y=samples(outputs, seed), u=U, dt=DT, intersample="zoh")
        fit = mf.fit(rec, structure)
        t.append((fit.params - truth) / fit.bse)
    assert (np.median(np.abs(t), axis=0) < 1.2).all()
    assert (np.abs(np.mean(t, axis=0)) < 0.65).all()


def test_batches_have_the_estimates_of_single_fits():
    ys = np.array([samples("yz", seed) for seed in range(10)])
    batch = mf.Batch(y=ys, u=U, dt=DT, intersample="zoh")
    many = mf.fit_many(batch, TWO)
    single = np.array([mf.fit(batch[k], TWO, band=many.band).params for k in range(10)])
    assert (np.abs(many.params - single) < 1e-3 * many.bse).all()


def test_studies_are_as_right_with_a_bound_as_without():
    free = mf.TransferFunction(poles=2, zeros=2)
    found = mf.MonteCarlo(
        system=SYSTEMS["y"],
        input=U,
        duration=N * DT,
        intervals=N,
        intersample="zoh",
        nsr=NSR,
        replicates=64,
        estimators={"bounded": mf.Estimator(BOUNDED, harmonics=60), "free": mf.Estimator(free, harmonics=60)},
    ).run(progress=False)
    bounded, free = np.moveaxis(found.rmse, found.rmse.shape.index(2), 0)
    np.testing.assert_allclose(bounded, free, rtol=0.02)
