"""Process noise and transfer functions of which coefficients are held, bounded or known beforehand."""

from __future__ import annotations

from typing import Any

import modfun as mf
import numpy as np
import pytest
from oracle import process_noise as oracle
from oracle.systems import simulate
from scipy.stats import binom

DEN, NUM = [1.0, 3.0, 8.0], [[5.0]]
DT, INTERVALS = 10 / 256, 256
CHIRP = [lambda t: np.sin(t**2 / 5)]
CLEAN, INPUTS = simulate(DEN, NUM, CHIRP, DT, INTERVALS)
RMS = float(np.sqrt(np.mean(CLEAN**2)))
DENSITY, SIGMA = (0.2 * RMS / oracle.spread(DEN)) ** 2, 0.1 * RMS
WHITTLE = "y'' + a1*y' + a2*y = b0*u"


def record(seed: int) -> mf.Record:
    """Eq. (24), process noise 20 % and sensor noise 10 %."""
    rng = np.random.default_rng(seed)
    y = CLEAN + SIGMA * rng.standard_normal(INTERVALS + 1)
    return mf.Record(
        y=y + oracle.drawn(DEN, DENSITY, DT, INTERVALS, rng), u=INPUTS[0], dt=DT, intersample="smooth"
    )


def model(**params: Any) -> mf.TransferFunction:
    return mf.TransferFunction(poles=2, zeros=0, params=params)


def fitted(structure: Any, seed: int = 1, **words: Any) -> mf.Fit:
    return mf.fit(record(seed), structure, noise="process", **words)


def alike(one: mf.Fit, other: mf.Fit, rel: float) -> None:
    assert one.status == other.status == "ok"
    assert one.params == pytest.approx(other.params, rel=rel)
    for kind in ("nonrobust", "spectral", "HC3"):
        assert one.cov_params(kind) == pytest.approx(other.cov_params(kind), rel=20 * rel)
    assert one.degrees == pytest.approx(other.degrees, rel=20 * rel)
    for column in ("level", "se"):
        assert one.process_noise()[column] == pytest.approx(other.process_noise()[column], rel=20 * rel)


def test_a_bound_that_is_far_changes_nothing() -> None:
    """The fastest path and the one that takes bounds are two programs for the same equations."""
    plain, bounded = fitted(model()), fitted(model(a1=mf.Free(min=-100.0)))
    alike(plain, bounded, 1e-9)
    assert (plain.sigma, plain.bic) == pytest.approx((bounded.sigma, bounded.bic), rel=1e-9)
    assert np.abs(plain.pieces[0]) == pytest.approx(np.abs(bounded.pieces[0]), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("held", [{"a1": 3.0}, {"b0": 5.0}, {"a1": 2.5, "a2": 7.0}])
def test_held_coefficients_are_those_of_the_equation(held: dict[str, float]) -> None:
    transfer = fitted(model(**held))
    equation = mf.Equation(WHITTLE, params=held)
    alike(transfer, fitted(equation, trend="constant", band=transfer.band), 1e-6)
    assert held.keys().isdisjoint(transfer.param_names)


def test_several_records_share_the_levels() -> None:
    pair = [record(1), record(2)]
    together = mf.fit(pair, model(a1=3.0), noise="process")
    equation = mf.Equation(WHITTLE, params={"a1": 3.0})
    alike(together, mf.fit(pair, equation, noise="process", trend="constant", band=together.band), 1e-6)


@pytest.mark.parametrize("structure", ["transfer function", "equation"])
def test_a_prior_lies_between_a_free_and_a_held_coefficient(structure: str) -> None:
    def known(given: Any) -> Any:
        params = {} if given is None else {"a1": given}
        return model(**params) if structure == "transfer function" else mf.Equation(WHITTLE, params=params)

    words = {"trend": "constant", "band": (0.5, 20.2)}
    free, vague = (fitted(known(own), **words) for own in (None, mf.Free(3.4, sd=1e5)))
    assert vague.params == pytest.approx(free.params, rel=1e-6)
    assert vague.bse == pytest.approx(free.bse, rel=1e-6)
    held, sure = (fitted(known(own), **words) for own in (3.4, mf.Free(3.4, sd=1e-5)))
    assert sure.params[1:] == pytest.approx(held.params, rel=1e-4)
    assert sure.bse[1:] == pytest.approx(held.bse, rel=1e-4)
    # Precisions add up; a prior leaves the lines more degrees of freedom, which moves the levels a little.
    half = fitted(known(mf.Free(float(free["a1"]), sd=float(free.bse["a1"]))), **words)
    assert half["a1"] == pytest.approx(free["a1"], abs=0.05 * free.bse["a1"])
    assert half.bse["a1"] == pytest.approx(free.bse["a1"] / np.sqrt(2), rel=0.02)
    assert half.degrees[0] > 2 * free.degrees[0]


def test_a_coefficient_ends_on_its_bound() -> None:
    with pytest.warns(mf.ModfunWarning, match="a1 ended on a bound"):
        fit = fitted(model(a1=mf.Free(max=2.0)))
    held = fitted(model(a1=2.0))
    assert fit["a1"] == pytest.approx(2.0, rel=1e-12)
    assert np.all(np.abs(fit.params[1:] - held.params) < 0.05 * held.bse)


def test_batches_fit_each_record_alone() -> None:
    structure = model(a1=3.0)
    alone = mf.fit(record(1), structure, noise="process")
    rec = record(1)
    batch = mf.Batch(y=np.array([rec.y[0]] * 2), u=rec.u, dt=DT, intersample="smooth")
    many = mf.fit_many(batch, structure, noise="process")
    assert many.params == pytest.approx(np.array([alone.params] * 2), rel=1e-6)
    assert many.bse == pytest.approx(np.array([alone.bse] * 2), rel=1e-6)


def test_a_stream_fits_what_a_record_does() -> None:
    rec, structure = record(1), model(a1=3.0)
    alone = mf.fit(rec, structure, noise="process")
    words: dict[str, Any] = {"window": INTERVALS * DT, "dt": DT, "intersample": "smooth"}
    stream = mf.Stream(mf.Estimator(structure, noise="process", band=alone.band), **words)
    for y, u in zip(rec.y[0], rec.u[0], strict=True):
        stream.push(y, u)
    assert stream.params == pytest.approx(alone.params, rel=1e-6)
    assert stream.bse == pytest.approx(alone.bse, rel=1e-5)


@pytest.mark.statistics
def test_near_the_bound_with_honest_intervals() -> None:
    """200 records: rmse to 5 %, above 1.2 of a bound that is met in 1 of 1,000 of two; coverage alike."""
    free = oracle.bound(
        DEN, NUM, CHIRP, DENSITY, SIGMA, DT, INTERVALS, lambda x: ([1.0, *x[:2]], [[x[2]]]), offset=True
    )
    bound = np.linalg.inv(np.linalg.inv(free)[1:, 1:])
    truth, found = np.array([8.0, 5.0]), []
    for seed in range(200):
        fit = mf.Estimator(model(a1=3.0), noise="process")(record(seed))
        low, high = fit.conf_int().T
        assert fit.process_levels is not None
        found.append([fit.params - truth, (low < truth) & (truth < high), fit.process_levels[0]])
    errors, inside, levels = np.array(found).swapaxes(0, 1)
    assert np.all(np.sqrt(np.mean(errors**2, axis=0)) < 1.2 * np.sqrt(np.diag(bound))[:2])
    assert np.all(inside.sum(axis=0) >= binom.ppf(5e-4, 200, 0.94))
    assert levels.mean(axis=0) == pytest.approx([SIGMA**2, DENSITY], rel=0.1)


@pytest.mark.parametrize(
    "given",
    [
        {"mask": np.arange(INTERVALS + 1)[None] != 9},
        {"sigma": np.linspace(0.1, 0.3, INTERVALS + 1)[None]},
    ],
)
def test_uneven_samples_are_refused(given: dict[str, Any]) -> None:
    rec = record(1)
    uneven = mf.Record(y=rec.y, u=rec.u, dt=DT, intersample="smooth", **given)
    with pytest.raises(mf.SpecError, match=r'(?s)masks and sigma.*noise="output"'):
        mf.fit(uneven, model(a1=3.0), noise="process")


def test_a_study_refuses_held_coefficients() -> None:
    with pytest.raises(mf.SpecError, match="in a study also without held"):
        mf.MonteCarlo(
            system=mf.tf([5], DEN), input="sin(t**2/5)", duration=10.0, intervals=INTERVALS, nsr=0.1,
            estimators={"process": mf.Estimator(model(a1=3.0), noise="process")}, replicates=8, seed=1,
        ).run()  # fmt: skip
