"""Priors of parameters: the least squares of the oracle, combined information, coverage, contradiction."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import modfun as mf
import numpy as np
import pytest
from oracle import prior as oracle

SYSTEM = mf.tf([5], [1, 3, 8])
TRUTH = np.array([3.0, 8.0, 5.0])
EQUATION = "y'' + a1*y' + a2*y = b0*u"


def record(nsr: float = 0.1, seed: int = 0, **words: float) -> mf.Record:
    told: dict[str, Any] = {"duration": 6.0, "intervals": 128, "intersample": "smooth", **words}
    return mf.simulate(SYSTEM, input="sin(t**2/5)", nsr=nsr, seed=seed, **told)


def structure(**known: mf.Free) -> mf.TransferFunction:
    return mf.TransferFunction(poles=2, zeros=0, params=known)


KNOWN = structure(a1=mf.Free(3.0, sd=0.1))


def se(fit: mf.Fit) -> np.ndarray:
    return np.sqrt(np.diag(fit.cov_params("nonrobust")))


@pytest.mark.parametrize(
    "known",
    [{"a1": (2.5, 0.3)}, {"a1": (3.2, 0.1), "b0": (5.2, 0.2)}, {"a2": (8.0, 1e-3)}],
    ids=["one", "two", "sharp"],
)
def test_the_least_squares_of_the_oracle(known: dict[str, tuple[float, float]]) -> None:
    rec = record(0.05)
    params = {name: mf.Free(mean, sd=sd) for name, (mean, sd) in known.items()}
    told = {"trend": None, "band": 14.0, "tol": 1e-12}
    fits = [
        mf.fit(rec, structure(**params), **told),
        mf.fit(rec, mf.Equation(EQUATION, params=params), **told),
    ]
    priors = [(fits[0].param_names.index(name), *own) for name, own in known.items()]
    theta, cov, _ = oracle.estimate(rec.y[0], rec.u[0], rec.dt, fits[0].lines[0], (2, 0), TRUTH, priors)
    sd = np.sqrt(np.diag(cov))
    for fit in fits:
        assert fit.success
        values = np.array([fit[name] for name in ("a1", "a2", "b0")])
        place = [fit.param_names.index(name) for name in ("a1", "a2", "b0")]
        assert np.max(np.abs(values - theta) / sd) < 0.02
        np.testing.assert_allclose(se(fit)[place], sd, rtol=0.01)


def test_standard_errors_are_those_of_combined_information() -> None:
    rec = record(0.02, duration=24.0, intervals=1024)
    free = mf.fit(rec, structure(), band=14.0)
    cov = free.cov_params("nonrobust")
    sd = np.sqrt(cov[0, 0])
    both = mf.fit(rec, structure(a1=mf.Free(free["a1"], sd=sd)), band=14.0)
    information = np.linalg.inv(cov) + np.diag([1 / sd**2, 0, 0])
    np.testing.assert_allclose(se(both), np.sqrt(np.diag(np.linalg.inv(information))), rtol=0.005)
    np.testing.assert_allclose(both.params, free.params, rtol=1e-6)
    # Under robust kinds the prior is as certain as it says.
    for kind in ("spectral", "HC3"):
        robust = free.cov_params(kind)
        gain = cov[:, 0] / (cov[0, 0] + sd**2)
        left = np.eye(3) - np.outer(gain, [1, 0, 0])
        joseph = left @ robust @ left.T + np.outer(gain, gain) * sd**2
        np.testing.assert_allclose(both.cov_params(kind), joseph, rtol=0.1)


def test_vague_and_sharp_priors() -> None:
    rec = record()
    free, held = mf.fit(rec, structure(), band=14.0), mf.fit(rec, structure(a1=2.9), band=14.0)
    vague = mf.fit(rec, structure(a1=mf.Free(2.9, sd=1e6)), band=14.0)
    np.testing.assert_allclose(vague.params, free.params, rtol=1e-5)
    np.testing.assert_allclose(vague.bse, free.bse, rtol=1e-2)
    sharp = mf.fit(rec, structure(a1=mf.Free(2.9, sd=1e-5)), band=14.0)
    np.testing.assert_allclose(sharp.params[1:], held.params, rtol=1e-4)
    np.testing.assert_allclose(sharp.bse, [1e-5, *held.bse], rtol=1e-2)
    assert sharp.df_spectral[0] > 1e4 > sharp.df_spectral[1]  # the first rests on what was told


def test_what_the_record_does_not_tell() -> None:
    """Of the product b·c a prior of b makes c: its relative variance is the sum of both."""
    text = "y'' + a1*y' + a2*y = b*c*u"
    rec = record(0.02)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert not mf.fit(rec, mf.Equation(text), band=14.0).success
    fit = mf.fit(rec, mf.Equation(text, params={"b": mf.Free(2.0, sd=0.1)}), band=14.0)
    product = mf.fit(rec, mf.Equation(EQUATION), band=14.0)
    assert fit.success
    np.testing.assert_allclose([fit["b"], fit["b"] * fit["c"]], [2.0, product["b0"]], rtol=1e-5)
    of_product = se(product)[product.param_names.index("b0")] / product["b0"]
    c = fit.param_names.index("c")
    np.testing.assert_allclose(se(fit)[c] / fit["c"], np.hypot(0.05, of_product), rtol=0.01)


@pytest.mark.statistics
def test_intervals_cover_where_priors_are_true() -> None:
    """400 systems drawn from the prior: 95 % intervals cover 0.915 to 0.98 (false alarm below 1 in 1,000)."""
    rng = np.random.default_rng(5)
    inside = np.zeros(3)
    for seed in range(400):
        truth = np.array([3.0 + 0.3 * rng.standard_normal(), 8.0, 5.0])
        system = mf.tf([truth[2]], [1, *truth[:2]])
        rec = mf.simulate(
            system, input="sin(t**2/5)", duration=6.0, intervals=128, nsr=0.1, seed=seed, intersample="smooth"
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            fit = mf.fit(rec, structure(a1=mf.Free(3.0, sd=0.3)), band=14.0)
        low, high = fit.conf_int().T
        inside += (low < truth) & (truth < high)
    assert np.all((inside / 400 > 0.915) & (inside / 400 < 0.98)), inside


def test_records_lists_batches_and_outputs() -> None:
    records = [record(seed=seed) for seed in range(3)]
    model = structure(a1=mf.Free(3.0, sd=0.1))
    many = mf.fit_many(records, model, band=14.0)
    alone = [mf.fit(rec, model, band=14.0) for rec in records]
    np.testing.assert_allclose(many.params, [fit.params for fit in alone], rtol=1e-9)
    np.testing.assert_allclose(many.bse, [fit.bse for fit in alone], rtol=1e-9)
    together = mf.fit(records, model, band=14.0)
    assert together.bse["a1"] < min(fit.bse["a1"] for fit in alone) < 0.1
    two = mf.Record(y=np.vstack([records[0].y, records[1].y]), u=records[0].u, dt=records[0].dt)
    words = {"poles": 2, "zeros": 0, "denominator": "common"}
    known = mf.TransferFunction(**words, params={"a1": mf.Free(3.0, sd=0.02)})
    free, both = (mf.fit(two, s, band=14.0) for s in (mf.TransferFunction(**words), known))
    gain = 1 / np.sqrt(1 / se(free)[0] ** 2 + 1 / 0.02**2)
    np.testing.assert_allclose(se(both)[0], gain, rtol=0.02)


def test_state_spaces_and_delays() -> None:
    rec = record(0.02)
    words = {"states": ["y", "v"], "inputs": ["u"]}
    free = mf.fit(rec, mf.StateSpace([[0, 1], ["k", "d"]], [[0], ["b"]], C=[[1, 0]], **words), band=14.0)
    known = mf.StateSpace(
        [[0, 1], ["k", "d"]], [[0], ["b"]], C=[[1, 0]], **words, params={"d": mf.Free(-3.0, sd=0.01)}
    )
    both = mf.fit(rec, known, band=14.0)
    place = both.param_names.index("d")
    expected = 1 / np.sqrt(1 / se(free)[place] ** 2 + 1 / 0.01**2)
    np.testing.assert_allclose(se(both)[place], expected, rtol=0.02)
    late = mf.simulate(
        mf.tf([5], [1, 3, 8], delay=0.2), input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=1
    )
    free = mf.fit(late, mf.TransferFunction(poles=2, zeros=0, delay=mf.Free(0.2, min=0, max=0.5)), band=10.0)
    told = mf.Free(0.2, min=0, max=0.5, sd=0.01)
    fit = mf.fit(late, mf.TransferFunction(poles=2, zeros=0, delay=told), band=10.0)
    np.testing.assert_allclose(se(fit)[3], 1 / np.sqrt(1 / se(free)[3] ** 2 + 1 / 0.01**2), rtol=0.02)


def test_a_record_that_contradicts_its_prior_is_said() -> None:
    rec = record(0.05, duration=12.0, intervals=256)
    with pytest.warns(mf.errors.ModfunWarning, match=r"told of a1 beforehand, 2 ± 0.1 \(p = ") as said:
        fit = mf.fit(rec, structure(a1=mf.Free(2.0, sd=0.1)), band=14.0)
    assert "mf.Free()" in str(said[0].message)
    facts = dict(fit.summary().facts)
    assert facts["Prior"].startswith("a1 = 2 ± 0.1; the record does not agree")
    # On a prior a thousand times sharper than the record it is heard all the same.
    with pytest.warns(mf.errors.ModfunWarning, match="beforehand, 1 ±"):
        mf.fit(rec, structure(a1=mf.Free(1.0, sd=1e-4)), band=14.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        held = mf.fit(rec, structure(a1=mf.Free(1.0, sd=1e-9)), band=14.0)
    assert dict(held.summary().facts)["Prior"] == "a1 = 1 ± 1e-09; the record says nothing beside it"


@pytest.mark.parametrize("seed", [1, 8, 17, 36])
def test_what_check_says_of_a_prior_is_warned_of(seed: int) -> None:
    """p = 0.0004 to 0.002, six of its standard deviations off: only check() and summary() said so."""
    rec = mf.simulate(
        mf.tf([1.5, 4], [1, 1.4, 6.2]), input="sin(t**2/6)", duration=8.0, intervals=200, nsr=0.1,
        initial_state="random", seed=seed,
    )  # fmt: skip
    with pytest.warns(mf.errors.ModfunWarning, match=r"told of a1 beforehand, 2 ± 0.1 \(p = 0.00"):
        mf.fit(rec, mf.TransferFunction(poles=2, zeros=1, params={"a1": mf.Free(2.0, sd=0.1)}))


@pytest.mark.statistics
def test_true_priors_are_seldom_contradicted() -> None:
    """300 draws: p-values below 0.1 in 4 to 17 % (false alarm below 1 in 1,000)."""
    rng = np.random.default_rng(11)
    from modfun.results.priors import contradicted_priors

    low = 0
    for seed in range(300):
        a1 = 3.0 + 0.2 * rng.standard_normal()
        rec = mf.simulate(
            mf.tf([5], [1, a1, 8]), input="sin(t**2/5)", duration=6.0, intervals=128, nsr=0.1, seed=seed,
            intersample="smooth",
        )  # fmt: skip
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            fit = mf.fit(rec, structure(a1=mf.Free(3.0, sd=0.2)), band=14.0)
        low += contradicted_priors(fit)[0] < 0.1
    assert 0.04 < low / 300 < 0.17, low


def test_the_bound_counts_it() -> None:
    rec = record(0.05)
    plain = mf.crlb(structure(), rec, sigma=0.02, params=dict(zip(("a1", "a2", "b0"), TRUTH, strict=True)))
    known = mf.crlb(
        structure(a1=mf.Free(3.0, sd=0.01)), rec, sigma=0.02, params={"a1": 3.0, "a2": 8.0, "b0": 5.0}
    )
    information = np.linalg.inv(plain.cov) + np.diag([1e4, 0, 0])
    np.testing.assert_allclose(known.cov, np.linalg.inv(information), rtol=1e-6)


def test_saved_and_shown(tmp_path: Path) -> None:
    rec = record()
    fit = mf.fit(rec, structure(a1=mf.Free(3.0, sd=0.1)), band=14.0)
    assert fit.structure.params[0][1].prior == (3.0, 0.1)
    fit.save(tmp_path / "fit.json")
    again = mf.load(tmp_path / "fit.json")
    assert again.structure == fit.structure
    assert dict(again.summary().facts)["Prior"] == dict(fit.summary().facts)["Prior"]
    assert repr(mf.Free(3.0, sd=0.1)) == "Free(3, sd=0.1)"
    page = fit.report(tmp_path / "fit.html").read_text(encoding="utf-8")
    assert "Known beforehand, as one measurement more: a1 = 3 ± 0.1." in page


@pytest.mark.parametrize(
    ("mean", "sd"), [(3.0, 1e-300), (3.0, 1e300), (1e300, 1.0), (1e308, 1e-300), (-1e5, 1e-3), (3.0, 1e-15)]
)
def test_any_numbers_give_an_answer_or_a_status(mean: float, sd: float) -> None:
    known = {"a1": mf.Free(mean, sd=sd)}
    for model in (structure(**known), mf.Equation(EQUATION, params=known)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            fit = mf.fit(record(), model, band=14.0)
        assert fit.status in ("ok", "maxiter", "rank", "nonfinite")
        assert not fit.success or fit.bse["a1"] <= 1.01 * sd
        assert dict(fit.summary().facts)["Prior"]


def test_streams() -> None:
    rec = record(0.05)
    live = mf.Stream(mf.Estimator(KNOWN, band=14.0), dt=rec.dt, window=6.0, outputs="y", inputs="u")
    live.push(y=rec.y, u=rec.u)
    fit = mf.fit(rec, KNOWN, band=14.0)
    np.testing.assert_allclose(live.params, fit.params, rtol=1e-6)
    np.testing.assert_allclose(live.bse, fit.bse, rtol=1e-6)


def test_studies() -> None:
    study = mf.MonteCarlo(
        system=SYSTEM, input="sin(t**2/5)", duration=6.0, intervals=128, nsr=[0.01, 0.1],
        seed=4, model=structure(),
        estimators={"known": mf.Estimator(KNOWN, band=14.0), "free": mf.Estimator(structure(), band=14.0)},
    )  # fmt: skip
    found = study.run(replicates=100)
    known, free = (np.squeeze(found.sel(estimator=name, nsr=0.1).rmse) for name in ("known", "free"))
    assert known[0] < 0.1 < free[0]
    assert np.all(known[1:] < 0.8 * free[1:])
    # A prior weighs more, the more noise there is: of a1 alone it adds to the information beside the others.
    for level in (0.01, 0.1):
        cell = found.sel(nsr=level).crlb
        told, plain = np.squeeze(cell)[:, 0]
        assert told**-2 == pytest.approx(plain**-2 + 0.1**-2, rel=1e-6)


def combined(free: mf.Fit, mean: float, sd: float) -> tuple[np.ndarray, np.ndarray]:
    """Estimates and standard errors of a fit and a prior of its first parameter, as two measurements."""
    cov = free.cov_params("nonrobust")
    gain = cov[:, 0] / (cov[0, 0] + sd**2)
    cov = cov - np.outer(gain, cov[0])
    return free.params + gain * (mean - free["a1"]), np.sqrt(np.diag(cov))


def test_robust_fits_and_references_count_it() -> None:
    """Fits with priors are fits without, combined with the priors: to the curvature of the response."""
    told = structure(a1=mf.Free(2.97, sd=0.02))
    rec = record(0.05, duration=12.0, intervals=512)
    y = rec["y"].copy()
    y[[40, 200, 333]] += [0.5, -0.5, 0.7]
    spoilt = rec.assign(y=y)
    noise = 0.05 * np.random.default_rng(1).standard_normal(rec.t.size)
    u = rec["u"] - 0.4 * np.convolve(noise, [0.0, 1.0, 0.5])[: noise.size]
    clean = mf.simulate(SYSTEM, input=u, duration=12.0, intervals=512, intersample="smooth")
    loop = mf.Record(y=clean["y"] + noise, u=u, dt=rec.dt, intersample="smooth", keep={"r": rec["u"]})
    for one, words in ((spoilt, {"robust": True}), (loop, {"reference": "r"})):
        free, fit = (mf.fit(one, model, band=14.0, **words) for model in (structure(), told))
        sd = combined(free, 2.97, 0.02)[1]
        # Weighted samples count as known when record and prior are weighed.
        known = mf.fit(free.records[0], structure(), band=14.0) if "robust" in words else free
        params = combined(known, 2.97, 0.02)[0]
        assert se(free)[0] > 1.1 * se(fit)[0]
        assert np.max(np.abs(fit.params - params) / sd) < 0.1
        np.testing.assert_allclose(se(fit), sd, rtol=0.08)


def test_the_bootstrap_draws_it() -> None:
    """Standard deviations of 200 refits scatter by 5 % (false alarm 1 in 1,000)."""
    rec = record(0.1)
    told = [
        structure(a1=mf.Free(3.0, sd=0.1)),
        mf.Equation(EQUATION, params={"a1": mf.Free(3.0, sd=0.1)}),
    ]
    for model in told:
        fit = mf.fit(rec, model, band=14.0, trend=None)
        own = list(fit.param_names).index("a1")
        found = mf.bootstrap(fit, replicates=200, seed=1)
        assert found.sd[own] == pytest.approx(se(fit)[own], rel=0.17)
        again = mf.bootstrap(fit, replicates=3, seed=1)
        np.testing.assert_array_equal(again.params, found.params[:3])
    late = mf.TransferFunction(poles=2, zeros=0, delay=mf.Free(0.1, min=0.0, max=0.4, sd=0.05))
    fit = mf.fit(record(0.05), late, band=14.0)
    assert mf.bootstrap(fit, replicates=8).params.shape == (8, 4)


@pytest.mark.filterwarnings("ignore::modfun.ModfunWarning")
def test_the_stable_neighbour_counts_it() -> None:
    """The lowest criterion along the margin, of records and priors."""
    light = mf.tf([1], [1, 0.02, 4])
    rec = mf.simulate(light, input="sin(t**2/5)", duration=10.0, intervals=128, nsr=0.5, seed=2)
    told = structure(a2=mf.Free(4.3, sd=0.05), b0=mf.Free(1.0, sd=0.2))
    free = mf.fit(rec, told)
    assert free.model.poles().real.max() > 0
    found = free.stable()
    low, high = free.band
    rows = free.df_resid + 3

    def criterion(q: float) -> float:
        params = {"a1": 2 * 0.01 / 10, "a2": q, "b0": mf.Free(1.0, sd=0.2)}
        fit = mf.fit(rec, structure(**params), band=(low, high * (1 + 1e-9)))
        return rows * float(np.log(fit.cost)) + ((fit["b0"] - 1.0) / 0.2) ** 2 + ((q - 4.3) / 0.05) ** 2

    lowest = criterion(found["a2"])
    step = 0.3 * found.bse["a2"]
    assert lowest < min(criterion(found["a2"] - step), criterion(found["a2"] + step))
    priors = ((free["a2"] - 4.3) / 0.05) ** 2 + ((free["b0"] - 1.0) / 0.2) ** 2
    gap = lowest - rows * float(np.log(free.cost)) - priors
    assert found.stability_cost == pytest.approx(gap, abs=1e-6)


def test_noise_that_changes_is_allowed_for() -> None:
    """Errors beside a vague prior are those without; a sharp one stays as certain as it says."""
    rec = record(0.0, duration=24.0, intervals=1024)
    level = np.where(rec.t < 10, 0.12, 0.03)
    loud = rec.assign(y=rec["y"] + level * np.random.default_rng(3).standard_normal(rec.t.size))
    free, vague, sharp = (
        mf.fit(loud, model, band=14.0)
        for model in (structure(), structure(a1=mf.Free(3.0, sd=1e3)), structure(a1=mf.Free(3.0, sd=0.003)))
    )
    assert "allow for it" in str(vague.check())
    assert "do not allow" not in str(vague.check())
    np.testing.assert_allclose(vague.bse, free.bse, rtol=1e-3)
    assert np.max(free.bse / np.sqrt(np.diag(free.cov_spectral))) > 1.05
    assert sharp.bse[0] == pytest.approx(0.003, rel=0.02)
    assert np.all(sharp.bse[1:] / np.sqrt(np.diag(sharp.cov_spectral))[1:] > 1.02)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: mf.Free(sd=0.1), "needs the mean"),
        (lambda: mf.Free(1.0, sd=0.0), "above 0"),
        (lambda: mf.fit(record(), KNOWN, method="ls"), "ml"),
        (lambda: mf.fit(mf.frf(record()), KNOWN), "frequency response: the prior of a1"),
        (lambda: mf.rivals.output_error(KNOWN)(record()), "the prior of a1"),
    ],
)  # fmt: skip
def test_where_a_prior_does_not_count_it_is_refused(call: Any, said: str) -> None:
    with pytest.raises(mf.errors.SpecError, match=said):
        call()
